"""Work over processes of this machine (``--workers``) or the machines of a Dask cluster (``--scheduler ADDRESS``).

Each machine of a cluster has LumenPilot's folder, in the same version.
"""

from __future__ import annotations

import hashlib
import importlib
import logging
import multiprocessing
import os
import re
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import cache
from typing import Any, TypeVar

from core.devices import UserError
from core.program import ROOT, import_problem, is_installed
from core.system import begin_as_worker

Task = TypeVar("Task")
Result = TypeVar("Result")


class WorkerEnded(UserError):
    """A process was ended from outside."""


def over_processes(
    workers: int, function: Callable[[Task], Result], tasks: Sequence[Task], within_s: float | None = None
) -> Generator[Result, None, None]:
    """Results as they come, of so many processes with one thread each; closing the iterator ends them, and `within_s` does.

    Raises WorkerEnded.
    """
    # Spawned, not forked: physics, OpenCV and OpenVINO own threads that a fork would cut off.
    context = multiprocessing.get_context("spawn")
    with _one_thread_each(), ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker) as pool:
        futures = [pool.submit(function, task) for task in tasks]
        try:
            for future in as_completed(futures, within_s):
                yield future.result()
        except TimeoutError:
            if within_s is None:
                raise
        except BrokenProcessPool:
            raise WorkerEnded("a worker ended (out of memory?); run the same command with fewer --workers") from None
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in multiprocessing.active_children():
                worker.terminate()  # only after an interruption one still runs


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Numeric libraries read their number of threads at import, from the environment that a worker inherits."""
    before = os.environ.get("OMP_NUM_THREADS")
    os.environ["OMP_NUM_THREADS"] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ["OMP_NUM_THREADS"]
        else:
            os.environ["OMP_NUM_THREADS"] = before


def _start_worker() -> None:
    begin_as_worker()  # before an import that takes its time
    import cv2

    cv2.setNumThreads(1)


_STATE = ("app/**/*.py", "core/**/*.py", "hardware/**/*.py", "resources/models/**/*.onnx")
"""What a trial or a frame depends on: the code, and the networks of the models."""
_TIMEOUT = "10s"
_WORKER = "-m dask worker {address} --nworkers 2 --nthreads 1"
_START = f"python {_WORKER} --preload lumenpilot" if is_installed() else f"in LumenPilot's folder: .venv/bin/python {_WORKER}"
_SCHEDULER = "python -m dask scheduler --preload lumenpilot" if is_installed() else ".venv/bin/python -m dask scheduler"
_GRAPH_UNREADABLE = "Error during deserialization"
"""How the scheduler's error begins when it does not find what a task calls."""


_PORT = re.compile(r":\d{1,5}/?$")


class ClusterError(UserError):
    """The cluster cannot be used; the message says what to do."""


def over_cluster(address: str, function: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[Result]:
    """Results as they come; closing the iterator cancels what has not begun.

    Raises
    ------
    ClusterError
        No scheduler answers, it has no workers, or a worker cannot run this code or has other code.
    """
    if not _PORT.search(address):  # the client would wait as for an answer
        raise ClusterError(f"--scheduler {address}: says no port; give it as HOST:PORT, as the scheduler tells it")
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # errors are one line of ours
    try:
        distributed = importlib.import_module("distributed")  # takes a second
    except ModuleNotFoundError as error:
        raise ClusterError(f"--scheduler: {import_problem(error) or error}") from None
    try:
        client = distributed.Client(address, timeout=_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        why = str(error).partition("\n")[0]
        raise ClusterError(
            f"--scheduler {address}: no Dask scheduler answers there ({why}); start one ({_SCHEDULER}), or use --workers"
        ) from None
    with client:
        _check_workers(client, address)
        futures = client.map(function, tasks, pure=False)
        try:
            for future in distributed.as_completed(futures, loop=client.loop):
                result = future.result()
                future.release()  # or its worker would keep it to the end
                yield result
        except distributed.KilledWorker:
            raise ClusterError(
                f"--scheduler {address}: a task ended its worker again and again (out of memory?); start fewer workers a machine"
            ) from None
        except (OSError, distributed.CancelledError) as error:
            why = str(error).partition("\n")[0]
            raise ClusterError(f"--scheduler {address}: the scheduler has gone ({why}); start it and its workers again") from None
        except RuntimeError as error:
            if not str(error).startswith(_GRAPH_UNREADABLE):
                raise
            where = "" if is_installed() else "in LumenPilot's folder: "
            raise ClusterError(f"--scheduler {address}: does not find LumenPilot; start it {where}{_SCHEDULER}") from None
        finally:
            client.cancel(futures)


def _check_workers(client: Any, address: str) -> None:
    """Raise ClusterError without workers, or with one of another version, whose results would not compare."""
    start = _START.format(address=address)
    if not client.scheduler_info(n_workers=-1)["workers"]:
        raise ClusterError(f"--scheduler {address}: has no workers; start some, {start}")

    def code() -> str | None:  # sent by value: a worker without LumenPilot could not import it
        try:
            workers = importlib.import_module("app.commands.workers")
        except ImportError:
            return None
        return str(workers.code_of_worker())

    found: dict[str, str | None] = client.run(code)
    without = sorted(worker for worker, its in found.items() if its is None)
    if without:
        raise ClusterError(f"--scheduler {address}: LumenPilot is not to be found by {', '.join(without)}; start them {start}")
    others = sorted(worker for worker, its in found.items() if its != code_of_worker())
    if others:
        raise ClusterError(
            f"--scheduler {address}: another version of LumenPilot runs on {', '.join(others)}; bring its folder to the state of "
            "this one, and start the worker again"
        )


@cache
def code_of_worker() -> str:
    """SHA-256 of the program's files and models, as they were at the first call in this process."""
    digest = hashlib.sha256()
    for pattern in _STATE:
        for path in sorted(ROOT.glob(pattern)):
            digest.update(f"{path.relative_to(ROOT).as_posix()} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()
