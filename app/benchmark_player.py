"""``benchmark --player``: how fast the player opens a long session and seeks in it, and what it needs of memory."""

from __future__ import annotations

import json
import multiprocessing
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from app.benchmark_command import quantiles
from app.benchmark_recording import FRAMES_PER_SECOND, one_way_and_back
from core.config import Config
from core.errors import UserError
from core.parent_process import begin_as_worker

_CYCLE = 300
"""Frames that are perceived and encoded; the session repeats them, which takes seconds and not the hour."""
_SEEKS = 60
_WAIT_S = 120.0


def measure_player(config: Config, minutes: float) -> dict[str, Any]:
    """Make a session of so many minutes, open it in the player window, and seek in it at random.

    Returns
    -------
    dict
        ``opens_s`` until the first picture is on the screen and ``known_s`` until every row can be reached, both from when the
        reader gets the folder; ``seek_ms`` from the wish to that row's picture on the screen; ``memory_mb`` of this process at the
        end, which did not make the session; and the session's size.
    """
    with tempfile.TemporaryDirectory(prefix="lumenpilot_benchmark_") as parent:
        child = multiprocessing.get_context("spawn").Process(target=_make_session, args=(config, minutes, parent))
        child.start()
        try:
            child.join()
        finally:
            child.terminate()  # nothing runs any more unless it was interrupted
        if child.exitcode:
            raise UserError(f"{parent}: the session could not be made (exit code {child.exitcode}); is the disk full?")
        (folder,) = Path(parent).iterdir()
        size_mb = sum(file.stat().st_size for file in folder.iterdir()) / 1e6
        return _measure(folder, config) | {"minutes": minutes, "size_mb": round(size_mb, 1)}


def _make_session(config: Config, minutes: float, parent: str) -> None:
    begin_as_worker()
    from core.perception.pipeline import open_pipeline
    from core.session.files import SessionFiles
    from core.session.manifest import about_rig
    from core.session.ring import EncodedFrame
    from core.session.rows import row_of
    from core.session.video import FrameEncoder
    from core.types import Frame, Tick

    pipeline, images = open_pipeline(config.perception), one_way_and_back()
    height, width = images[0].shape[:2]
    encoder = FrameEncoder((width, height), config.record)
    cycle = []
    for place in range(_CYCLE):
        frame = Frame(place, place / FRAMES_PER_SECOND, images[place % len(images)])
        tick = Tick(frame, pipeline(frame), None, None, None, 0, FRAMES_PER_SECOND)
        packet = encoder.encode(frame.image, frame.captured_s, force_key=place == 0)
        cycle.append((packet, row_of(tick, None)))
    files = SessionFiles(Path(parent), about_rig(config, "SIM", "benchmark"), config.record, first_s=0.0, now_s=0.0)
    for index in range(round(60.0 * minutes * FRAMES_PER_SECOND)):
        packet, row = cycle[index % _CYCLE]
        at_s = index / FRAMES_PER_SECOND
        packet = replace(packet, pts_ms=round(1000.0 * at_s))
        line = json.dumps(row | {"index": index, "captured_s": round(at_s, 6)}, allow_nan=False, separators=(",", ":"))
        files.write_frame(EncodedFrame(at_s, packet, encoder, line))
    problem = files.close("benchmark", 0)
    encoder.close()
    if problem:
        raise SystemExit(problem)


def _measure(folder: Path, config: Config) -> dict[str, Any]:
    from PySide6.QtCore import QEvent

    from app.application import make_application
    from app.player_window import PlayerWindow
    from core.session.reader import SessionReader

    application = make_application()

    def until(condition: Callable[[], bool]) -> float:
        """Seconds until it is true, while the window runs."""
        began_s = time.monotonic()
        while not condition():
            if time.monotonic() - began_s > _WAIT_S:
                raise UserError(f"the player did not show what was asked for within {_WAIT_S:.0f} s")
            application.processEvents()
            time.sleep(0.0005)
        return time.monotonic() - began_s

    began_s = time.monotonic()
    with SessionReader(folder) as reader:
        window = PlayerWindow(reader, config)
        window.show()
        window.start()
        until(lambda: window.place >= 0)
        opens_s = time.monotonic() - began_s
        until(lambda: reader.wait(0.0) and window.rows == len(reader))
        known_s = time.monotonic() - began_s
        rng, seeks_ms = np.random.default_rng(0), []
        for place in rng.integers(0, window.rows, _SEEKS).tolist():
            window.go(place)
            seeks_ms.append(1000.0 * until(lambda wanted=place: window.place == wanted))  # type: ignore[misc]
        rows, memory_mb = window.rows, psutil.Process().memory_info().rss / 2**20
        window.close()
        window.deleteLater()
        application.sendPostedEvents(window, QEvent.Type.DeferredDelete.value)
    return {
        "opens_s": round(opens_s, 2),
        "known_s": round(known_s, 2),
        "seek_ms": quantiles(seeks_ms),
        "memory_mb": round(memory_mb, 1),
        "rows": rows,
    }
