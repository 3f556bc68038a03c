"""Keeps where the joints are, in memory and in a file, so that a restart of servos or program costs no zero.

It lives in the bus process, which outlives a killed application. A thread of its own writes the file, as a disk may take longer
than a cycle of the bus.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Sequence
from pathlib import Path

from pydantic import ValidationError

from core.config.calibration import ZeroConfig
from core.config.safety import TICKS_PER_TURN, JointName, ServosConfig
from core.control.kept_zero import KeptJoint, KeptZeros, ZeroOffer, keep, zero_offer
from core.files import sweep_unfinished, write_atomic
from hardware.servos.registers import ServoReading, ServoState

_log = logging.getLogger(__name__)

_FAR_TICKS, _MOVED_TICKS = TICKS_PER_TURN // 16, TICKS_PER_TURN // 512
"""Since the file was written: so far is on the way to the quarter of a turn that is too far for an offer; less is noise at rest."""
_SOON_S, _SLOW_S = 0.25, 2.0
"""The file is written so often at most while a joint is that far, and while one has moved at all."""
_MOST_BYTES = 100_000
_END_S = 2.0
"""For the writing thread at the end."""


class ZeroKeeper:
    """What is kept of each joint, and the offers that follow from it. One thread uses it, but for the writing.

    Without a `path` it is in memory only, as in the twin, whose servos are new each time. The zeros of the rig file, of the
    last search for slack, count for tendons where they are newer.
    """

    def __init__(self, servos: ServosConfig, path: Path | None, searched: ZeroConfig | None = None) -> None:
        self._joints = servos.joints
        self._is_absolute = servos.driver == "dynamixel"  # else a restart begins at another place
        self._models = {joint.name: servos.model_of(joint).number for joint in servos.joints}
        self._path, self._searched, self._is_loaded = path, searched, False
        self._kept: dict[JointName, KeptJoint] = {}
        self._written: dict[JointName, int] = {}
        self._written_s = 0.0
        self._lock, self._due = threading.Lock(), threading.Event()
        self._content: bytes | None = None
        self._is_ending = False
        self._thread: threading.Thread | None = None
        if path is not None:
            self._thread = threading.Thread(target=self._write_always, name="zero keeper", daemon=True)
            self._thread.start()

    def load(self) -> None:
        """Read the file, once the port is ours: the process that had it has written its last word then. Later calls do nothing."""
        if self._is_loaded:
            return
        self._is_loaded = True
        if self._path is not None:
            self._kept = _read(self._path)
        if self._searched is not None:
            self._take_searched(self._searched)
        self._written = {name: one.ticks for name, one in self._kept.items()}

    def _take_searched(self, searched: ZeroConfig) -> None:
        found_s = searched.found_utc.timestamp() if searched.found_utc is not None else 0.0
        for joint, ticks in zip(self._joints, searched.ticks, strict=True):
            known = self._kept.get(joint.name)
            if joint.is_tendon and (known is None or not known.is_of(joint, self._models[joint.name]) or known.kept_s < found_s):
                self._kept[joint.name] = keep(joint, self._models[joint.name], ticks, 0.0, found_s)

    @property
    def has_file(self) -> bool:
        return self._path is not None

    def kept(self, name: JointName) -> KeptJoint | None:
        return self._kept.get(name)

    def offers(self, readings: Sequence[ServoReading]) -> tuple[ZeroOffer, ...]:
        """Where the joints that told their position register stand by what is kept of them."""
        if not self._is_absolute:
            return ()
        found = (
            zero_offer(joint, self._models[joint.name], self._kept.get(joint.name), reading.ticks)
            for joint, reading in zip(self._joints, readings, strict=False)
            if isinstance(reading, ServoState)
        )
        return tuple(offer for offer in found if offer is not None)

    def update(self, readings: Sequence[ServoReading], now_s: float) -> None:
        """Keep where the zeroed joints are; `now_s` is monotonic. The file is written at times."""
        far, moved = False, False
        for joint, reading in zip(self._joints, readings, strict=False):
            if not isinstance(reading, ServoState) or reading.position_mm is None:
                continue
            known = self._kept.get(joint.name)
            if known is None or known.ticks != reading.ticks or known.position_mm != reading.position_mm:
                self._kept[joint.name] = keep(joint, self._models[joint.name], reading.ticks, reading.position_mm, time.time())
            before = self._written.get(joint.name)
            far = far or before is None or abs(reading.ticks - before) > _FAR_TICKS
            moved = moved or before is None or abs(reading.ticks - before) > _MOVED_TICKS
        if (far and now_s - self._written_s >= _SOON_S) or (moved and now_s - self._written_s >= _SLOW_S):
            self.write(now_s)

    def forget(self, names: Sequence[JointName]) -> None:
        for name in names:
            self._kept.pop(name, None)

    def write(self, now_s: float) -> None:
        """Have the file written as soon as the disk takes it."""
        if self._path is None:
            return
        self._written = {name: one.ticks for name, one in self._kept.items()}
        self._written_s = now_s
        zeros = KeptZeros(joints=tuple(self._kept[one.name] for one in self._joints if one.name in self._kept))
        with self._lock:
            self._content = zeros.model_dump_json().encode()
        self._due.set()

    def close(self, now_s: float) -> None:
        """Write the file a last time, and wait for it."""
        if self._thread is not None:
            self.write(now_s)
            self._is_ending = True
            self._due.set()
            self._thread.join(_END_S)

    def _write_always(self) -> None:
        assert self._path is not None
        with contextlib.suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            sweep_unfinished(self._path.parent)
        is_told = False
        while True:
            self._due.wait()
            self._due.clear()
            is_last = self._is_ending
            with self._lock:
                content, self._content = self._content, None
            if content is not None:
                try:
                    write_atomic(self._path, content, durable=True)
                    is_told = False
                except OSError as error:  # driving goes on; the next start has older positions to offer
                    if not is_told:
                        _log.warning("%s: where the joints are cannot be kept (%s)", self._path, error.strerror)
                    is_told = True
            if is_last:
                return


def _read(path: Path) -> dict[JointName, KeptJoint]:
    """What a file keeps; nothing, and a warning, where it cannot be read."""
    try:
        with path.open("rb") as file:
            zeros = KeptZeros.model_validate_json(file.read(_MOST_BYTES))
    except FileNotFoundError:
        return {}
    except (OSError, ValidationError) as error:
        _log.warning("%s: no kept zeros (%s)", path, str(error).splitlines()[0])
        return {}
    return {one.name: one for one in zeros.joints}
