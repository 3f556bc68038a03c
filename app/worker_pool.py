"""Work over processes of this machine: ``--workers``."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TypeVar

from core.errors import UserError
from core.parent_process import begin_as_worker

Task = TypeVar("Task")
Result = TypeVar("Result")


class WorkerEnded(UserError):
    """A process was ended from outside."""


def over_processes(workers: int, function: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[Result]:
    """Results as they come, of so many processes with one thread each. What runs when the iterator is closed is ended.

    Raises
    ------
    WorkerEnded
        A process was ended from outside.
    """
    # Spawned, not forked: physics, OpenCV and OpenVINO own threads that a fork would cut off.
    context = multiprocessing.get_context("spawn")
    with _one_thread_each(), ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker) as pool:
        futures = [pool.submit(function, task) for task in tasks]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BrokenProcessPool:
            raise WorkerEnded("a worker ended (out of memory?); run the same command with fewer --workers") from None
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in multiprocessing.active_children():
                worker.terminate()  # nothing runs any more unless it was interrupted


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Numeric libraries read their number of threads once, at import: it must be in the environment that a worker inherits."""
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
