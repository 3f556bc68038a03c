"""Where a command writes: never over what it reads, nor over what somebody may still need."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from core.errors import UserError
from core.session.manifest import EVENTS, FRAMES, MANIFEST


def is_same(first: Path, second: Path) -> bool:
    """Whether both names lead to one file or folder, be it there already or not."""
    try:
        return first.samefile(second)
    except OSError:
        return os.path.realpath(first) == os.path.realpath(second)  # Path.resolve raises on links in a loop


def check_no_input(output: Path, inputs: Iterable[Path], option: str) -> None:
    """Raise UserError when `output`, given by `option`, is one of the `inputs`."""
    if any(is_same(output, path) for path in inputs):
        raise UserError(f"{output}: is an input, which {option} would overwrite; choose another one")


def check_apart(output: Path, others: Iterable[Path], option: str, writer: str) -> None:
    """Raise UserError when `output`, given by `option`, is one of the files that the option `writer` writes, too."""
    if any(is_same(output, path) for path in others):
        raise UserError(f"{output}: is written by {writer}, too; choose another file for {option}")


def check_can_write(output: Path, option: str) -> None:
    """Raise UserError when the file `output`, given by `option`, cannot be written: now, and not after long work.

    One that is not there yet is not made before there is something to write.
    """
    try:
        is_new = not output.exists()
        output.open("a").close()
        if is_new:
            output.unlink()
    except OSError as error:
        raise UserError(f"{output}: cannot be written ({error.strerror}); choose another {option}") from None


def check_no_session(folder: Path, option: str) -> None:
    """Raise UserError when `folder`, given by `option`, is a recorded session, whose files must stay as they are."""
    if any((folder / name).is_file() for name in (MANIFEST, FRAMES, EVENTS)) or any(folder.glob("video_*.mkv")):
        raise UserError(f"{folder}: is a recorded session, which {option} would damage; choose another folder")
