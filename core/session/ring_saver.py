"""Writes what the ring held as a session, in a thread of its own: a slow disk must not hold up the session that may be running."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

from core.record_config import RecordConfig
from core.session.events import Event, EventKind
from core.session.files import SessionFiles
from core.session.manifest import About, SessionError
from core.session.record_status import StatusBoard, look_at_disk
from core.session.ring import EncodedFrame
from core.session.video import VideoError


class RingSaver:
    """One saving at a time; how it went is on the board."""

    def __init__(self, parent: Path, config: RecordConfig, board: StatusBoard) -> None:
        self._parent = parent
        self._config = config
        self._board = board
        self._thread: threading.Thread | None = None

    def save(self, about: About, frames: list[EncodedFrame], events: list[Event], now_s: float) -> None:
        """Start to write; `now_s` is the frames' clock now."""
        if not frames:
            self._board.notice("nothing to save: no frames in memory yet")
        elif self._thread is not None and self._thread.is_alive():
            self._board.notice("the last seconds are still being saved")
        else:
            self._board.show(saving=True)
            arguments = (about, frames, events, now_s)
            self._thread = threading.Thread(target=self._write, args=arguments, name="ring saver", daemon=True)
            self._thread.start()

    def finish(self, within_s: float) -> bool:
        """Wait for it; False when the disk has not answered in time."""
        if self._thread is not None:
            self._thread.join(within_s)
        return self._thread is None or not self._thread.is_alive()

    def _write(self, about: About, frames: list[EncodedFrame], events: list[Event], now_s: float) -> None:
        files: SessionFiles | None = None
        problem, written = "an error of the program; its log says more", 0
        try:
            self._check_room()
            first_s = frames[0].captured_s
            files = SessionFiles(self._parent, about, self._config, first_s=first_s, now_s=now_s, origin="last seconds")
            files.dropped_before = frames[0].dropped
            for event in (*_beginning(frames[0], events), *events):
                files.write_event(event)
            for frame in frames:
                self._check_room()
                files.write_frame(frame)
                written += 1
            problem = ""
        except (VideoError, SessionError) as error:
            problem = str(error)
        except OSError as error:
            problem = f"{error.filename or self._parent}: {error.strerror or error}"
        finally:  # also after what nobody has thought of, which goes on to the log
            try:
                if files is not None:
                    # The folder itself says that it is not whole: a message in a window is soon forgotten.
                    lost = frames[-1].dropped - frames[0].dropped + len(frames) - written
                    at_end = files.close(problem or "saved from memory", lost)
                    problem = problem or at_end
            finally:
                self._tell(problem, files, written, len(frames))

    def _check_room(self) -> None:
        """The last room of a disk is not for this, as it is for no recording: what is open must still be closed. SessionError."""
        disk = look_at_disk(self._parent, self._config)
        if disk is not None and disk.full:
            raise SessionError(f"{disk.full}; make room and save them again")

    def _tell(self, problem: str, files: SessionFiles | None, written: int, frames: int) -> None:
        self._board.show(saving=False)
        if not problem:
            self._board.show(saved=files.folder if files is not None else None)
        elif not written:
            self._board.notice(f"the last seconds were not saved: {problem}")
        else:
            self._board.notice(f"of the last seconds only {written} of {frames} frames were saved: {problem}")


def _beginning(first: EncodedFrame, events: Sequence[Event]) -> Iterator[Event]:
    """Where driving stood at the first frame, as every session must tell by itself; nothing where the ring knows how it began."""
    drive = json.loads(first.row)["drive"]
    mode = next((event for event in events if event.kind is EventKind.MODE), None)
    if drive is None or (mode is not None and "from" not in mode.data):
        return
    yield Event(first.captured_s, EventKind.MODE, drive["mode"])
    for cause, detail in drive["active"]:
        yield Event(first.captured_s, EventKind.FAULT, cause, {"detail": detail})
