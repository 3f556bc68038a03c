"""Does ``rig identify`` find what a twin hides? ``python -m tools.identified_twins --count 20 --keep FOLDER``.

Each twin has another phantom, robot, play, slack, bend per pull, feed and delay. Its jog of a minute is perceived in its pictures.
"""

from __future__ import annotations

import json
import math
import sys
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from hardware.twin.identification import IdentifiedBench, JogRecord, body_of, identify, seen_robot
from hardware.twin.physics import MAX_PULL_MM, ROBOT_RADIUS_MM, DriveProperties, Specimen, TwinPhysics
from tools.run import run_tool

STOPS_MM = (0.0, 0.4, 0.8, 1.2, 0.8, 0.4, 0.0, -0.4, -0.8, -1.2, -0.8, -0.4, 0.0, 0.25, -0.25, 0.25, 0.0, 1.7, -1.7, 0.0)
"""Pulls to the right that the jog goes to one after the other, with a rest at each."""
_PULL_MM_S, _REST_S, _HALF_S = 1.6, 0.35, 30.0
_START_MM, _STEP_S, _PICTURE_STEPS = 40.0, 0.02, 8


def jog_at(time_s: float) -> tuple[float, float]:
    """Pull (mm) and feed (mm/s) of the jog, the same in both halves of a minute: feed, bends with rests, feed."""
    within_s = time_s % _HALF_S
    for end_s, speed_mm_s in ((3.0, 6.0), (4.0, 0.0), (7.0, -6.0), (8.0, 0.0)):
        if within_s < end_s:
            return 0.0, speed_mm_s
    if within_s >= 26.0:
        return 0.0, 9.0 if within_s < 28.0 else -9.0
    left_s = within_s - 8.0
    for before, after in zip(STOPS_MM[:-1], STOPS_MM[1:], strict=True):
        way_s = abs(after - before) / _PULL_MM_S
        if left_s < way_s:
            return before + math.copysign(_PULL_MM_S * left_s, after - before), 0.0
        left_s -= way_s
        if left_s < _REST_S:
            return after, 0.0
        left_s -= _REST_S
    return 0.0, 0.0


def hidden_robot(seed: int) -> tuple[DriveProperties, Specimen, dict[str, float]]:
    """A robot, and its parameters as ``rig identify`` names them."""
    draw = np.random.default_rng([seed, 50021]).uniform
    head = 8e3 * draw(0.9, 1.15)
    drive = DriveProperties(
        backlash_mm=draw(0.05, 0.2),
        dead_zone_mm=draw(0.03, 0.15),
        dead_zone_left_mm=draw(0.03, 0.15),
        gain=(draw(0.8, 1.2), draw(0.8, 1.2)),
        feed_share=draw(0.9, 1.1),
        feed_slip=draw(0.0, 0.1),
        delay_s=draw(0.02, 0.15),
    )
    robot = Specimen(draw(2.0, 4.0) * head, head, friction=draw(0.06, 0.15), tip_set_deg=draw(-4.0, 4.0))
    assert drive.dead_zone_left_mm is not None
    deg_per_mm = robot.bend_deg_per_mm
    return drive, robot, {
        "bend_right_deg_per_mm": drive.gain[0] * deg_per_mm,
        "bend_left_deg_per_mm": drive.gain[1] * deg_per_mm,
        "slack_right_mm": drive.dead_zone_mm,
        "slack_left_mm": drive.dead_zone_left_mm,
        "play_mm": drive.backlash_mm,
        "shaft_to_head": robot.shaft_ei / robot.tip_ei,
        "feed_share": drive.feed_share,
        "feed_slip": drive.feed_slip,
        "delay_s": drive.delay_s,
    }  # fmt: skip


def recorded_jog(seed: int, *, perceived: bool, noise_mm: float = 0.1) -> tuple[IdentifiedBench, JogRecord]:
    """The jog of a hidden robot in the phantom of a trial, perceived in pictures, or its true places with noise."""
    from core.config.models import Config
    from core.perception.pipeline import open_pipeline
    from core.types import Command
    from hardware.twin.phantoms import make_phantom
    from hardware.twin.physics import port_of
    from hardware.twin.truth import with_caps
    from hardware.twin.world import TwinWorld

    config = Config()
    drive, robot, _ = hidden_robot(seed)
    world = TwinWorld(config.twin, phantom=make_phantom(f"random:{2_000_000 + seed}"), perception=config.perception, drive=drive)
    world.physics = TwinPhysics(world.phantom, 0, drive, specimen=robot)
    bench, physics = IdentifiedBench(world.phantom, port_of(world.phantom), world.view), world.physics
    pipeline = open_pipeline(config.perception) if perceived else None
    world.insert(_START_MM)
    rng, fed_mm, pictures, joints = np.random.default_rng(seed), 0.0, [], [(0.0, 0.0, 0.0)]
    for step in range(round(2 * _HALF_S / _STEP_S)):
        time_s = step * _STEP_S
        pull_mm, speed_mm_s = jog_at(time_s)
        if step % _PICTURE_STEPS == 0:
            seen = None
            if pipeline is not None:
                seen = seen_robot(pipeline(world.frame(time_s), None), bench)
            else:
                body = body_of(with_caps(physics.robot_points_mm(), ROBOT_RADIUS_MM))
                seen = body + rng.normal(0.0, noise_mm, body.shape), physics.insertion_mm + ROBOT_RADIUS_MM
            if seen is not None:
                pictures.append((time_s, *seen))
        physics.step(Command(bend=pull_mm / MAX_PULL_MM, advance_mm_s=speed_mm_s), _STEP_S)
        fed_mm += speed_mm_s * _STEP_S
        joints.append((time_s + _STEP_S, pull_mm, fed_mm))
    return bench, JogRecord(*(np.array(part) for part in (*zip(*pictures, strict=True), *zip(*joints, strict=True))))


def found_of(keep: Path, seed: int) -> dict[str, Any]:
    """Truth and estimates of one twin; its jog is kept in the folder."""
    from core.config.safety import ServosConfig
    from hardware.twin.phantoms import make_phantom

    file = keep / f"jog_{seed}.npz"
    if not file.exists():
        _, jog = recorded_jog(seed, perceived=True)
        np.savez(file, *(getattr(jog, name) for name in JogRecord.__dataclass_fields__))
    with np.load(file) as stored:
        jog = JogRecord(*(stored[name] for name in stored.files))
    truth = hidden_robot(seed)[2]
    found = identify(make_phantom(f"random:{2_000_000 + seed}"), jog, str(seed), ServosConfig())
    row: dict[str, Any] = {"seed": seed, "pictures": len(jog.time_s), "head_p95_mm": found.head_p95_mm}
    for name, true in truth.items():
        one = getattr(found, name)
        row[name] = {"true": true, "value": one.value, "low": one.low, "high": one.high}
    return row


def identified_twins(
    keep: Annotated[Path, typer.Option(help="folder for the jogs, which are recorded once, and the results")],
    count: Annotated[int, typer.Option(min=1, max=1000, help="twins")] = 20,
    first: Annotated[int, typer.Option(min=0, help="seed of the first")] = 0,
    workers: Annotated[int, typer.Option(min=1, max=256, help="processes")] = 2,
) -> None:
    """Identify hidden twins from a perceived jog of a minute: how many parameters are within 10 %, and within their intervals."""
    from app.commands.workers import over_processes

    keep.mkdir(parents=True, exist_ok=True)
    rows = []
    for row in over_processes(workers, partial(found_of, keep), range(first, first + count)):
        rows.append(row)
        (keep / f"found_{row['seed']}.json").write_text(json.dumps(row, indent=1))
    for name in hidden_robot(0)[2]:
        parts = [row[name] for row in rows]
        near = sum(abs(one["value"] - one["true"]) <= 0.1 * abs(one["true"]) for one in parts)
        inside = sum(one["low"] <= one["true"] <= one["high"] for one in parts)
        away = float(np.median([abs(one["value"] - one["true"]) for one in parts]))
        half = float(np.median([one["high"] - one["low"] for one in parts])) / 2
        sys.stdout.write(
            f"{name}: {near} of {len(rows)} within 10 %, {inside} within the interval; error {away:.3g} (median), "
            f"interval +- {half:.3g} (median)\n"
        )
    heads = [row["head_p95_mm"] for row in rows]
    sys.stdout.write(f"head path of the held-out half, p95: {np.median(heads):.2f} mm (median), {max(heads):.2f} (largest)\n")


if __name__ == "__main__":
    run_tool(identified_twins)
