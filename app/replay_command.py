"""``replay``: perceive recorded sessions again, with another model or configuration, and show what changed."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from app.long_work import Interrupt, progress_bar
from app.outputs import check_apart, check_no_input, check_no_session
from app.perceive_command import _make_folder
from app.replay_session import MOST_SHOWN, ReplayOptions, change_to_json, replay_session
from core.errors import UserError
from core.names import name_as_text, name_of
from core.session.manifest import FRAMES, MANIFEST
from core.session.reader import check_is_session
from core.study.replay import Change

_CHANGES = "changes.jsonl"
_WRITTEN = ("replay.json", _CHANGES, "replay.svg", "replay.pdf")
"""What ``--out`` gets."""


def run_replay(options: ReplayOptions, out: Path | None = None, *, as_json: bool = False) -> None:
    """Replay one session and tell; raises UserError, and KeyboardInterrupt once all is told."""
    check_is_session(options.session)
    if out is not None:
        prepare_out(out)
    if options.jsonl is not None:
        own = [options.config_path] if options.config_path is not None else []
        check_no_input(options.jsonl, [*options.session.iterdir(), *own], "--jsonl")
        if out is not None:
            check_apart(options.jsonl, [out / name for name in _WRITTEN], "--jsonl", "--out")
    done = replay_session(options, _watched)
    if out is not None:
        write_replay(out, name_as_text(name_of(options.session)), done.changes, done.result)
    _tell(done.result, done.changes, with_diff=options.diff, as_json=as_json)
    if out is not None:
        sys.stderr.write(f"figures and frames are in {out}\n")
    if done.interrupted:
        raise KeyboardInterrupt


@contextmanager
def _watched(count: int) -> Iterator[Callable[[], bool]]:
    """A bar, and Ctrl-C keeps what is done."""
    with Interrupt() as interrupt, progress_bar() as bar:
        task = bar.add_task("frames", total=count)

        def may_go_on() -> bool:
            if not interrupt.asked:
                bar.advance(task)
            return not interrupt.asked

        yield may_go_on


def prepare_out(out: Path) -> None:
    """Make the folder; raises UserError where it is a session, or cannot be written."""
    if (out / "replay.json").is_file() and not (out / MANIFEST).exists():
        (out / FRAMES).unlink(missing_ok=True)  # what earlier versions wrote there made the folder look like a session
    check_no_session(out, "--out")
    _make_folder(out)


def write_replay(out: Path, name: str, changes: Sequence[Change], result: dict[str, Any]) -> None:
    """A session's files in the folder; raises UserError."""
    from app.evaluation_figures import save_figure
    from app.replay_figure import draw_replay

    try:
        (out / "replay.json").write_text(json.dumps(result, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        with (out / _CHANGES).open("w", encoding="utf-8") as file:
            file.writelines(json.dumps(change_to_json(change), allow_nan=False) + "\n" for change in changes)
        figure = draw_replay(changes, result["states"]["matrix"], name)
        for ending in (".svg", ".pdf"):
            save_figure(figure, out / f"replay{ending}")
    except OSError as error:
        raise UserError(f"{error.filename or out}: cannot be written ({error.strerror or error})") from None


def _tell(result: dict[str, Any], changes: Sequence[Change], *, with_diff: bool, as_json: bool) -> None:
    from app.replay_tables import print_replay

    if as_json:
        sys.stdout.write(json.dumps(result, allow_nan=False) + "\n")
    else:
        print_replay(result, changes, with_diff=with_diff, count=MOST_SHOWN)
    for note in result["notes"]:
        sys.stderr.write(f"note: {note}\n")
    if result["without_picture"] or result["without_row"]:
        sys.stderr.write(f"note: {result['without_picture']} pictures and {result['without_row']} rows are lost\n")
