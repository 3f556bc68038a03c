"""``benchmark --recording``: how much a recording slows perception down, measured in turns in one run."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from app.benchmark_command import quantiles
from app.long_work import progress_bar
from app.rig_engine import leaving_a_core
from core.config import Config, TwinConfig
from core.perception.pipeline import Pipeline, open_pipeline
from core.session.manifest import about_rig
from core.session.writer import SessionWriter
from core.study.bootstrap import MIN_GROUPS, RESAMPLES
from core.types import Frame, Image, Tick

FRAMES_PER_SECOND = 30.0
_BLOCK = 30
"""Frames until it is the other's turn: one second, so that a busy moment of the computer strikes both alike."""
_WARM_UP = 10
_STEPS = 24


def measure_recording(config: Config, frames: int) -> dict[str, Any]:
    """Perceive a paced stream of 640x480 pictures, a second without and a second with a recording, in turn.

    The recorder encodes, makes rows and writes to the system's temporary folder beside perception, as it does in the window; the
    network leaves a core to the rest of the program, as there.

    Parameters
    ----------
    frames : of each kind; rounded up to whole seconds.

    Returns
    -------
    dict
        ``without_ms`` and ``with_ms`` (of perceiving), ``slowdown`` (ratio of the medians; 1.0 = none) with a 95 % interval over
        the blocks, ``dropped`` frames, ``mb_per_minute``.
    """
    pipeline = open_pipeline(leaving_a_core(config.perception))
    images = one_way_and_back()
    settings = config.record.model_copy(update={"ring_s": 0.0, "stop_free_mb": 0.0})
    blocks = -(-frames // _BLOCK)
    without: list[list[float]] = []
    recorded: list[list[float]] = []
    with tempfile.TemporaryDirectory(prefix="lumenpilot_benchmark_") as folder, progress_bar() as bar:
        writer = SessionWriter(settings, about_rig(config, "SIM", "benchmark"), folder=Path(folder))
        task = bar.add_task("frames", total=2 * blocks * _BLOCK)
        try:
            writer.start()
            _stream(pipeline, images, _WARM_UP, 0, writer)
            for block in range(blocks):
                # the order changes, so that warming up or cooling down favours nobody
                for is_recorded in (False, True) if block % 2 else (True, False):
                    first = _WARM_UP + (2 * block + is_recorded) * _BLOCK
                    times = _stream(pipeline, images, _BLOCK, first, writer if is_recorded else None)
                    (recorded if is_recorded else without).append(times)
                    bar.advance(task, _BLOCK)
        finally:
            is_whole = writer.close()
        status = writer.status()
    minutes = max(status.frames, 1) / FRAMES_PER_SECOND / 60.0
    return {
        "without_ms": quantiles([ms for block in without for ms in block]),
        "with_ms": quantiles([ms for block in recorded for ms in block]),
        **_slowdown(without, recorded),
        "frames": blocks * _BLOCK,
        "recorded": status.frames,
        "dropped": status.dropped,
        "mb_per_minute": round(status.bytes / 1e6 / minutes, 1),
        "problem": status.problem or (None if is_whole else "the disk does not answer"),
        "engine": pipeline.engine,
        "cores": os.cpu_count(),
    }


def one_way_and_back() -> list[Image]:
    """A robot that goes in and comes back, as a stream shows it: unrelated pictures would cost more room."""
    from hardware.twin.world import TwinWorld

    world = TwinWorld(TwinConfig(), seed=0)
    way: list[Image] = []
    for step in range(_STEPS):
        world.insert(50.0 + 1.5 * step)
        way.append(world.frame().image)
    return way + way[-2:0:-1]


def _stream(pipeline: Pipeline, images: Sequence[Image], count: int, first: int, writer: SessionWriter | None) -> list[float]:
    """Perceive `count` frames at the camera's pace; milliseconds of each."""
    times: list[float] = []
    began_s = time.monotonic()
    for place in range(count):
        time.sleep(max(0.0, began_s + place / FRAMES_PER_SECOND - time.monotonic()))
        frame = Frame(first + place, time.monotonic(), images[place % len(images)])
        before_s = time.perf_counter()
        scene = pipeline.perceive_single(frame)
        times.append(1e3 * (time.perf_counter() - before_s))
        if writer is not None:
            writer.put(Tick(frame, scene, None, None, None, 0, FRAMES_PER_SECOND))
    return times


def _slowdown(without: list[list[float]], recorded: list[list[float]]) -> dict[str, Any]:
    """Ratio of the medians, with a percentile bootstrap over the blocks, drawn in pairs; None as interval of too few."""
    plain, beside = np.array(without), np.array(recorded)
    ratio = float(np.median(beside) / np.median(plain))
    if len(plain) < MIN_GROUPS:
        return {"slowdown": round(ratio, 3), "slowdown_ci95": None}
    rng = np.random.default_rng(0)
    draws = rng.integers(0, len(plain), (RESAMPLES, len(plain)))
    ratios = np.median(beside[draws].reshape(RESAMPLES, -1), axis=1) / np.median(plain[draws].reshape(RESAMPLES, -1), axis=1)
    low, high = np.percentile(ratios, (2.5, 97.5))
    return {"slowdown": round(ratio, 3), "slowdown_ci95": [round(float(low), 3), round(float(high), 3)]}
