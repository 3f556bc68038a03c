"""A picture, or a folder of pictures, as a camera: each is shown for a moment, the last one stays. Or a folder that is watched."""

from __future__ import annotations

import time
from pathlib import Path

from core.devices import DeviceError
from core.images import ImageError, read_image
from core.learning.dataset import IMAGE_ENDINGS
from core.types import Frame, Image
from hardware.cameras.folder_watch import FolderWatch


class ImageFolder:
    """A ``Camera`` over pictures, in name order. Unreadable ones are skipped; none readable is an error at ``open``.

    With `watch` only pictures that come later are shown, the newest first in line and each once; there need not be any at ``open``.
    """

    def __init__(self, path: Path, *, period_s: float = 0.5, watch: bool = False) -> None:
        self._path = path
        self._period_s = period_s
        self._watch = FolderWatch(path) if watch else None
        self._files: list[Path] = []
        self._image: Image | None = None
        self._next = 0
        self._index = -1
        self._due_s = 0.0

    @property
    def name(self) -> str:
        return self._path.name

    @property
    def is_live(self) -> bool:
        return False

    def open(self) -> None:
        if self._watch is not None:
            self._watch.begin()
            return
        if self._path.is_dir():
            self._files = sorted(p for p in self._path.iterdir() if p.suffix.lower() in IMAGE_ENDINGS)
        elif self._path.exists():
            self._files = [self._path]
        if not self._files:
            raise DeviceError(f"{self._path}: no picture there (looked for {', '.join(IMAGE_ENDINGS)})")
        self._advance()
        if self._image is None:
            raise DeviceError(f"{self._path}: none of {len(self._files)} pictures can be read")

    def read(self, timeout_s: float) -> Frame | None:
        if self._watch is not None:
            image = self._watch.next(timeout_s)
            self._index += image is not None
            return None if image is None else Frame(self._index, time.monotonic(), image)
        wait = self._due_s - time.monotonic()
        if wait > timeout_s:
            time.sleep(timeout_s)
            return None
        time.sleep(max(0.0, wait))
        if self._index >= 0:
            self._advance()
        self._index += 1
        self._due_s = time.monotonic() + self._period_s
        assert self._image is not None
        return Frame(self._index, time.monotonic(), self._image)

    def _advance(self) -> None:
        """Load the next readable picture; at the end the last one stays."""
        while self._next < len(self._files):
            path = self._files[self._next]
            self._next += 1
            try:
                self._image = read_image(path)
                return
            except ImageError:
                continue

    def close(self) -> None:
        self._image = None
        self._files = []
