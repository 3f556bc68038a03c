"""A RealSense recording (``.bag``) as a camera, played at its own pace or as fast as it is read."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import pyrealsense2 as rs

from core.devices import DeviceError, EndOfStream
from core.types import Frame, Image
from hardware.cameras.pacing import Pacer
from hardware.cameras.realsense import colour_image, describe_device

_WAIT_MS = 200
_GIVE_UP_AFTER = 50
"""Waits in a row without a frame, though the library says that it plays: ten seconds."""
_END_AFTER = 3
"""Waits in a row without a frame once the library has read the file to its end. Its last frames may still be on their way then,
and on a machine that stands still for a moment one wait can pass before they come."""


class RealSenseRecording:
    """A ``Camera`` over the colour stream of a recording.

    With `paced` late frames are skipped; without, every frame is given, and ``captured_s`` is seconds from the first one on.
    ``Frame.lost`` counts the frames that are missing in the recording.
    """

    def __init__(self, path: Path, *, paced: bool = True) -> None:
        self._path, self._paced = path, paced
        self._pipeline: Any = None
        self._playback: Any = None
        self._reset()

    def _reset(self) -> None:
        self._pacer: Pacer[tuple[Image, int, int]] = Pacer()
        self._index, self._lost = -1, 0
        self._number: int | None = None
        self._first_s: float | None = None
        self._at_s = 0.0

    @property
    def name(self) -> str:
        return self._path.name

    @property
    def is_live(self) -> bool:
        return False

    @property
    def recorded_with(self) -> str:
        """The camera that it was recorded with."""
        return describe_device(self._playback).describe() if self._playback is not None else ""

    def open(self) -> None:
        self.close()
        if not self._path.is_file():
            raise DeviceError(f"{self._path}: no such recording")
        config = rs.config()
        pipeline = rs.pipeline()
        try:
            rs.config.enable_device_from_file(config, str(self._path), repeat_playback=False)
            config.enable_stream(rs.stream.color)
            # At the library's own pace frames are dropped while we look at one; and also those that it hands out before it is told.
            self._playback = config.resolve(rs.pipeline_wrapper(pipeline)).get_device().as_playback()
            self._playback.set_real_time(False)
            pipeline.start(config)
        except RuntimeError as error:
            reason = " ".join(str(error).split())[:120]
            raise DeviceError(f"{self._path}: cannot be played as a RealSense recording with colour ({reason})") from None
        self._pipeline = pipeline

    def read(self, timeout_s: float) -> Frame | None:
        if not self._paced:
            (image, index, lost), at_s = self._next()
            return Frame(index, at_s, image, lost)
        due = self._pacer.next(self._next, timeout_s)
        if due is None:
            return None
        (image, index, lost), captured_s = due
        return Frame(index, captured_s, image, lost)

    def _next(self) -> tuple[tuple[Image, int, int], float]:
        """The next picture with its index and the frames lost until then; and its seconds from the first one on."""
        frame = self._wait()
        stamp_s, number = frame.get_timestamp() / 1000.0, int(frame.get_frame_number())
        if self._number is not None:
            self._lost += max(0, number - self._number - 1)  # the count may also go back
        self._number = number
        self._index += 1
        self._first_s = stamp_s if self._first_s is None else self._first_s
        self._at_s = max(self._at_s, stamp_s - self._first_s)
        return (colour_image(frame), self._index, self._lost), self._at_s

    def _wait(self) -> Any:
        if self._pipeline is None:
            raise DeviceError(f"{self._path}: not open")
        ended = 0
        for _ in range(_GIVE_UP_AFTER):
            try:
                came, frames = self._pipeline.try_wait_for_frames(_WAIT_MS)
            except RuntimeError as error:
                raise DeviceError(f"{self._path}: cannot be played on ({' '.join(str(error).split())[:120]})") from None
            frame = frames.get_color_frame() if came else None
            if frame:
                return frame
            # Nothing came in time: so the end looks, too.
            ended = ended + 1 if not came and self._playback.current_status() == rs.playback_status.stopped else 0
            if ended == _END_AFTER:
                raise EndOfStream(f"{self._path}: end of the recording")
        raise DeviceError(f"{self._path}: gives no more pictures; it may be damaged")

    def close(self) -> None:
        pipeline, self._pipeline, self._playback = self._pipeline, None, None
        if pipeline is not None:
            with contextlib.suppress(RuntimeError):
                pipeline.stop()
        self._reset()
