"""``replay`` of many sessions: over processes or a Dask cluster, with all their frames in sum."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from app.cluster import over_cluster
from app.long_work import Interrupt, progress_bar
from app.replay_command import prepare_out, write_replay
from app.replay_session import MOST_SHOWN, ReplayOptions, SessionReplay, Watch, change_to_json, replay_session, unwatched
from app.worker_pool import over_processes
from core.config import load_config
from core.errors import UserError
from core.learning.model_file import check_model
from core.names import name_as_text, name_of
from core.session.manifest import SessionError
from core.session.reader import check_is_session
from core.study.replay import Change, changed_most
from core.study.replay_tally import Tally

_SUMS = "replays.json"


@dataclass(frozen=True, slots=True)
class _Outcome:
    """What came of a session: its frames, or in one line why there are none."""

    session: Path
    done: SessionReplay | None
    problem: str = ""


@dataclass(slots=True)
class _Sums:
    """Of the sessions so far; of their frames only those that changed most."""

    results: dict[Path, dict[str, Any]] = field(default_factory=dict)
    problems: dict[Path, str] = field(default_factory=dict)
    tally: Tally = field(default_factory=lambda: Tally.of([]))
    worst: list[tuple[str, Change]] = field(default_factory=list)
    interrupted: bool = False
    broken: UserError | None = None
    """What ended it before its time: a worker, the cluster, a full disk."""

    def add(self, outcome: _Outcome) -> None:
        """A session that could not be perceived again is told, and the others go on."""
        done = outcome.done
        if done is None:
            self.problems[outcome.session] = outcome.problem
            return
        self.results[outcome.session] = done.result
        self.interrupted = self.interrupted or done.interrupted
        self.tally += Tally.of(done.changes)
        name = name_as_text(name_of(outcome.session))
        found = [*self.worst, *((name, change) for change in changed_most(done.changes, MOST_SHOWN))]
        self.worst = sorted(found, key=lambda one: -one[1].size_deg)[:MOST_SHOWN]


def sessions_in(paths: Sequence[Path]) -> list[Path]:
    """Each path that is a session, and the sessions in each that is a folder of them, by name; each once.

    Raises
    ------
    SessionError
        A path is neither.
    """
    found: dict[Path, Path] = {}
    for path in paths:
        try:
            check_is_session(path)
        except SessionError as error:
            inside = sorted(filter(_is_session, path.iterdir())) if path.is_dir() else []
            if not inside:
                raise SessionError(f"{error}, nor any session" if path.is_dir() else str(error)) from None
        else:
            inside = [path]
        for session in inside:
            found.setdefault(session.resolve(), session)
    return list(found.values())


def _is_session(path: Path) -> bool:
    try:
        check_is_session(path)
    except SessionError:
        return False
    return True


def run_replays(
    sessions: Sequence[Path], options: ReplayOptions, out: Path | None, *, workers: int, scheduler: str | None, as_json: bool
) -> None:
    """Replay them all and tell; raises UserError, and KeyboardInterrupt once all that was done is told.

    Parameters
    ----------
    options : for each of them; its session says nothing.
    """
    if options.jsonl is not None:
        raise UserError("--jsonl is for one session: give --out, which takes the frames of each")
    if options.model is not None or options.config_path is not None or options.preset is not None:
        check_model(load_config(options.config_path, options.preset, options.overrides).perception.segmentation.model)
    if out is not None:
        _prepare(out, sessions)
    if workers > 1 or scheduler is not None:  # one thread each: workers must not fight for the cores
        options = replace(options, threads=1)
    sums = _Sums()
    _run(sums, [session.absolute() for session in sessions], options, out, workers, scheduler)
    if sums.results:
        _tell(sums, len(sessions), out, with_diff=options.diff, as_json=as_json)
    if sums.broken is not None:
        raise sums.broken
    if sums.interrupted:
        raise KeyboardInterrupt
    if not sums.results:
        first = next(iter(sums.problems.values()))
        raise SessionError(f"none of {len(sessions)} sessions could be perceived again; the first: {first}")


def _prepare(out: Path, sessions: Sequence[Path]) -> None:
    """Each session has a folder in it, by its name."""
    name, count = Counter(map(name_of, sessions)).most_common(1)[0]
    if count > 1:
        raise UserError(
            f"{count} sessions are called {name_as_text(name)}, and --out has one folder for each name: replay them one by one"
        )
    for session in sessions:
        prepare_out(out / name_of(session))
    prepare_out(out)


def _run(sums: _Sums, sessions: list[Path], options: ReplayOptions, out: Path | None, workers: int, scheduler: str | None) -> None:
    with progress_bar() as bar, ExitStack() as stack:
        task = bar.add_task("sessions", total=len(sessions))
        if scheduler is None and workers <= 1:
            interrupt = stack.enter_context(Interrupt())
            frames = bar.add_task("frames", total=None)

            @contextmanager
            def watch(count: int) -> Iterator[Callable[[], bool]]:
                bar.reset(frames, total=count)

                def may_go_on() -> bool:
                    bar.advance(frames, 0 if interrupt.asked else 1)
                    return not interrupt.asked

                yield may_go_on

            outcomes: Iterator[_Outcome] = (replay_one(options, session, watch) for session in sessions)
        elif scheduler is not None:
            outcomes = over_cluster(scheduler, partial(replay_one, options), sessions)
        else:
            outcomes = over_processes(min(workers, len(sessions)), partial(replay_one, options), sessions)
        try:
            for outcome in outcomes:
                if outcome.done is not None and out is not None:
                    name = name_of(outcome.session)
                    write_replay(out / name, name_as_text(name), outcome.done.changes, outcome.done.result)
                sums.add(outcome)
                bar.advance(task)
                if sums.interrupted:
                    return
        except KeyboardInterrupt:
            sums.interrupted = True
        except UserError as error:
            sums.broken = error


def replay_one(options: ReplayOptions, session: Path, watch: Watch = unwatched) -> _Outcome:
    """One session, in this thread. A path must lead to it on each machine of a cluster."""
    try:
        return _Outcome(session, replay_session(replace(options, session=session), watch))
    except UserError as error:
        return _Outcome(session, None, str(error))


def _tell(sums: _Sums, count: int, out: Path | None, *, with_diff: bool, as_json: bool) -> None:
    results = [sums.results[session] for session in sorted(sums.results)]
    done = len(sums.results) + len(sums.problems)
    total: dict[str, Any] = {
        "sessions": len(results),
        "ended": "all sessions" if done == count and not sums.interrupted else f"ended after {done} of {count} sessions",
        **sums.tally.to_json(),
        "problems": list(sums.problems.values()),
    }
    if with_diff:
        total["changed_most"] = [{"session": name} | change_to_json(change) for name, change in sums.worst]
    if out is not None:
        try:
            text = json.dumps({"all": total, "each": results}, indent=1, allow_nan=False)
            (out / _SUMS).write_text(text + "\n", encoding="utf-8")
        except OSError as error:
            raise UserError(f"{out / _SUMS}: cannot be written ({error.strerror or error})") from None
    if as_json:
        sys.stdout.writelines(json.dumps(line, allow_nan=False) + "\n" for line in [*results, total])
    else:
        from app.replay_tables import print_replays

        print_replays(results, total, sums.worst if with_diff else None)
    notes = Counter(note for result in results for note in result["notes"])
    for note, often in notes.items():
        sys.stderr.write(f"note: {note} ({often} of {len(results)} sessions)\n")
    for problem in sums.problems.values():
        sys.stderr.write(f"{problem}\n")
    if out is not None:
        sys.stderr.write(f"figures and frames of each are in {out}\n")
