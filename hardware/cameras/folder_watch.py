"""Pictures as another program puts them into a folder."""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path

from core.devices import DeviceError
from core.images import ImageError, read_image
from core.learning.dataset import IMAGE_ENDINGS
from core.types import Image

_LOOK_EVERY_S = 0.05

_Print = tuple[int, int]
"""Size and time of change of a file."""


class FolderWatch:
    """Tells the newest picture that has come, or was written anew, since the last one it told.

    A file counts when two looks find it the same, so that one that is still being written is not read.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: dict[str, _Print] = {}
        self._growing: dict[str, _Print] = {}

    def begin(self) -> None:
        """What is there now is not new. DeviceError: it cannot be watched."""
        self._known, self._growing = self._list(), {}

    def next(self, timeout_s: float) -> Image | None:
        """The newest new picture; older new ones are passed over. None when none came in time."""
        until_s = time.monotonic() + timeout_s
        while True:
            image = self._look()
            left_s = until_s - time.monotonic()
            if image is not None or left_s <= 0.0:
                return image
            time.sleep(min(left_s, _LOOK_EVERY_S))

    def _look(self) -> Image | None:
        there = self._list()
        new = {name: stamp for name, stamp in there.items() if self._known.get(name) != stamp}
        whole = [name for name, stamp in new.items() if self._growing.get(name) == stamp]
        self._growing = new
        for name in sorted(whole, key=lambda name: (new[name][1], name), reverse=True):
            self._known |= {older: new[older] for older in whole if new[older][1] <= new[name][1]}
            try:
                return read_image(self._folder / name)
            except ImageError:
                continue  # no picture after all, or gone again
        return None

    def _list(self) -> dict[str, _Print]:
        found = {}
        try:
            with os.scandir(self._folder) as entries:
                for entry in entries:
                    if entry.name.lower().endswith(IMAGE_ENDINGS) and not entry.name.startswith("."):
                        with contextlib.suppress(FileNotFoundError):  # gone again meanwhile
                            stat = entry.stat()
                            found[entry.name] = (stat.st_size, stat.st_mtime_ns)
        except OSError as error:
            raise DeviceError(f"{self._folder}: cannot be watched ({error.strerror}): check the folder") from None
        return found
