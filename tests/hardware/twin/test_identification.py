"""Identification of the robot: stages by hand, a fit through the physics, and sessions that tell nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from core.config.calibration import BehaviourConfig, Estimate
from core.config.models import Config
from core.config.safety import ServosConfig
from core.session.manifest import Manifest
from core.session.reader import SessionReader
from core.types import Pose, PoseState, Reason, Refusal, RobotPath, Scene
from hardware.twin.identification import (
    PARAMETERS,
    Floats,
    JogError,
    JogRecord,
    bench_of_session,
    carried_mm,
    check_jog,
    explained,
    first_guess,
    jog_of_session,
    predicted,
    refined,
    target_of,
    turn_deg,
)
from hardware.twin.phantoms import make_phantom
from hardware.twin.physics import MAX_PULL_MM, DriveProperties
from tools.identified_twins import jog_at

NAMES = tuple(PARAMETERS)
TRUE = {
    "bend_right_deg_per_mm": 50.0,
    "bend_left_deg_per_mm": 40.0,
    "slack_right_mm": 0.1,
    "slack_left_mm": 0.05,
    "play_mm": 0.12,
    "shaft_to_head": 2.5,
    "feed_share": 1.08,
    "feed_slip": 0.05,
    "delay_s": 0.12,
    "start_mm": 40.0,
    "friction": 0.1,
    "set_deg": 0.0,
}


def behaviour(**changes: Estimate) -> BehaviourConfig:
    values: dict[str, Any] = {name: Estimate(value=v, low=0.9 * v, high=1.1 * v) for name, v in list(TRUE.items())[:9]}
    return BehaviourConfig(session="s", head_p50_mm=0.2, head_p95_mm=0.5, **values | changes)


def free_jog() -> JogRecord:
    """A minute of the tool's jog by a robot that bends as an arc, touches nothing and follows ``TRUE``."""
    joint_s = np.arange(0.0, 60.0, 0.02)
    pull, speed = np.array([jog_at(t) for t in joint_s]).T
    fed = np.concatenate([[0.0], np.cumsum(speed[:-1] * 0.02)])
    time_s = np.arange(0.5, 59.5, 0.1)
    at = carried_mm(pull, TRUE["play_mm"])
    way = np.concatenate([[0.0], np.cumsum(np.diff(fed) * np.where(np.diff(fed) > 0.0, 0.95, 1.0) * TRUE["feed_share"])])
    late_s = time_s - TRUE["delay_s"]
    at, length = np.interp(late_s, joint_s, at), TRUE["start_mm"] + 1.25 + np.interp(late_s, joint_s, way)
    deg = TRUE["bend_right_deg_per_mm"] * np.maximum(0.0, at - TRUE["slack_right_mm"])
    deg -= TRUE["bend_left_deg_per_mm"] * np.maximum(0.0, -at - TRUE["slack_left_mm"])
    return JogRecord(time_s, np.array([arc(one) for one in deg]), length, joint_s, pull, fed)


def arc(bend_deg: float) -> Floats:
    """Places of a robot along x whose last 21.25 mm bend down (to its right), but for the nose."""
    steps = np.arange(0.0, 25.01, 0.01)  # from the shaft to the head
    share = np.clip((steps - 3.75) / 20.0, 0.0, 1.0)
    angle = np.radians(bend_deg) * share
    line = np.column_stack([np.cumsum(np.cos(angle)), np.cumsum(np.sin(angle))]) * 0.01
    return line[::-1][[0, 500, 1000, 1500, 2000, 2500]]


def test_the_turn_is_positive_to_the_right_and_play_keeps_what_it_carries() -> None:
    assert turn_deg(np.array([arc(40.0), arc(-20.0)])) == pytest.approx([0.94 * 40.0, 0.94 * -20.0], rel=0.03)
    assert carried_mm(np.array([0.0, 0.3, 0.25, 0.1, -0.3]), 0.2).tolist() == pytest.approx([0.0, 0.2, 0.2, 0.2, -0.2])


def test_without_walls_each_parameter_shows_by_itself() -> None:
    found = dict(zip(NAMES, first_guess(free_jog()).tolist(), strict=True))
    for name, true in TRUE.items():
        if name not in ("shaft_to_head", "friction", "set_deg"):  # nothing to lean on
            assert found[name] == pytest.approx(true, rel=0.04, abs=0.012), name


def test_the_fit_through_the_physics_comes_near_the_robot() -> None:
    phantom, true, whole = make_phantom("s_curve"), np.array([TRUE[name] for name in NAMES]), free_jog()
    joint_s = whole.joint_s - 9.0  # begins with bends
    jog = JogRecord(whole.time_s[:25], whole.body_mm[:25], whole.length_mm[:25], joint_s, whole.bend_mm, whole.feed_mm)
    target = target_of(phantom, jog)
    true[NAMES.index("start_mm")] = 25.0
    jog = replace(jog, body_mm=predicted(phantom, target, jog, true))
    start = true * np.array([1.3, *[1.0] * 11])
    found, errors = refined(phantom, target, jog, start)
    away = [predicted(phantom, target, jog, values) - jog.body_mm for values in (start, found)]
    before, after = (float(np.abs(one - one.mean(axis=0)).max()) for one in away)
    assert after < 0.5 * before and found[0] == pytest.approx(true[0], rel=0.06)
    assert np.isfinite(errors).all() and (errors >= 0.0).all()


def test_what_was_identified_drives_the_twin_in_its_own_millimetres() -> None:
    drive = DriveProperties.identified(behaviour(), 2.0 * MAX_PULL_MM, 45.0)  # a robot of twice the pull
    assert drive.gain == pytest.approx((2.0 * 50.0 / 45.0, 2.0 * 40.0 / 45.0))
    assert (drive.backlash_mm, drive.dead_zone_mm, drive.dead_zone_left_mm) == pytest.approx((0.06, 0.05, 0.025))
    assert (drive.feed_share, drive.feed_slip, drive.delay_s) == (1.08, 0.05, 0.12)


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({}, set()),
        ({"play_mm": 0.01}, set()),  # within what is known
        ({"bend_left_deg_per_mm": -12.0}, {"bend_left_deg_per_mm"}),
        ({"feed_slip": 0.2}, {"feed_slip", "feed_share"}),  # alike where the robot is never drawn back
        ({"slack_right_mm": 0.1, "delay_s": 0.1}, set()),  # neither one alone
    ],
)
def test_a_run_is_explained_by_the_parameter_that_is_another_now(
    monkeypatch: pytest.MonkeyPatch, changed: dict[str, float], named: set[str]
) -> None:
    time_s, rng = np.arange(0.0, 10.0, 0.1), np.random.default_rng(0)
    moves = {name: np.cumsum(rng.normal(0.0, 0.03, (100, 6, 2)), axis=0) for name in NAMES}
    moves["feed_share"] = -moves["feed_slip"]
    moves["friction"] = moves["set_deg"] = moves["start_mm"] = np.zeros((100, 6, 2))
    lengths, joints = np.full(100, TRUE["start_mm"] + 1.25), (time_s, time_s, time_s)

    def linear(_phantom: object, _target: int, _jog: JogRecord, values: Any) -> Any:
        steps = (values - [TRUE[name] for name in NAMES]) / [PARAMETERS[name].step for name in NAMES]
        return np.asarray(50.0 + sum(step * moves[name] for step, name in zip(steps, NAMES, strict=True)))

    monkeypatch.setattr("hardware.twin.identification.predicted", linear)
    seen = linear(None, 0, JogRecord(*[time_s] * 6), np.array([TRUE[name] + changed.get(name, 0.0) for name in NAMES]))
    run = JogRecord(time_s, seen + rng.normal(0.0, 0.1, seen.shape), lengths, *joints)
    found = explained(make_phantom("s_curve"), run, behaviour(), ServosConfig())
    assert set(found.values) == named
    for name in set(changed) & named:
        assert found.values[name] == pytest.approx(TRUE[name] + changed[name], rel=0.1) and found.left_mm < 0.3 * found.away_mm


class Session:
    """As much of a reader as a jog needs: the default twin's, with a picture and the servos each 0.1 s."""

    def __init__(self, seconds: float = 60.0, *, refusal: Refusal | None = None, bends: bool = True, servos: bool = True) -> None:
        self.folder = Path("session")
        config = Config().model_dump(mode="json")
        self.manifest = Manifest(
            id="x", kind="SIM", rig="twin", started_utc="2026-01-01T00:00:00Z", started_monotonic_s=0.0, config=config
        )
        line = np.column_stack([np.arange(0.0, 200.0, 2.0), np.full(100, 240.0)])
        pose = Pose(1.0, 1.0, 0.0, 0.0, False, PoseState.A, 0.9)
        scene = Scene(0, 0.0, (640, 480), 1.0, path=RobotPath(line, 1.0, None, True, 0.0, 4.0), pose=pose)
        if refusal is not None:
            scene = Scene(0, 0.0, (640, 480), 1.0, refusal=refusal)
        self.rows = []
        for time_s in np.arange(0.0, seconds, 0.1).tolist():
            pull, _ = jog_at(time_s) if bends else (0.0, 0.0)
            at_mm = (0.3 + pull, 0.3 - pull, 0.3, 0.3, 10.0 + 10.0 * np.sin(time_s), 0.0, 0.0)
            bus = {"servos": [{"time_s": time_s, "position_mm": value} for value in at_mm] if servos else []}
            self.rows.append(SimpleNamespace(captured_s=time_s, scene=scene, bus=bus))

    def wait(self) -> bool:
        return True

    def __len__(self) -> int:
        return len(self.rows)

    def row(self, place: int) -> Any:
        return self.rows[place]


def read(session: Session) -> JogRecord:
    reader = cast(SessionReader, session)
    return jog_of_session(reader, bench_of_session(reader))


def test_a_session_becomes_a_jog_by_its_servos_and_pictures() -> None:
    jog = read(Session())
    assert len(jog.time_s) == 600 and jog.bend_mm.max() == pytest.approx(1.7, abs=0.1)
    assert jog.body_mm[0, 0, 0] - jog.body_mm[0, 1, 0] == pytest.approx(5.0)
    assert np.ptp(jog.feed_mm) == pytest.approx(20.0, abs=0.1)


@pytest.mark.parametrize(
    ("session", "problem"),
    [
        (Session(20.0), "seen for 20 s"),
        (Session(refusal=Refusal(Reason.NO_ROBOT)), "seen for 0 s"),
        (Session(refusal=Refusal(Reason.BENCH_MOVED)), "moved"),
        (Session(servos=False), "no positions of the servos"),
        (Session(bends=False), "first half the head was pulled 0.0 mm to the right"),
    ],
)
def test_a_session_that_tells_nothing_is_refused_in_a_line(session: Session, problem: str) -> None:
    with pytest.raises(JogError, match=problem):
        read(session)


def test_a_session_of_another_rig_or_without_a_scale_is_refused() -> None:
    session = Session()
    with pytest.raises(JogError, match="is of the rig twin, not of bench 1"):
        bench_of_session(cast(SessionReader, session), "bench 1")
    session.manifest = session.manifest.model_copy(update={"kind": "LIVE"})
    with pytest.raises(JogError, match="without a scale"):
        bench_of_session(cast(SessionReader, session))
    with pytest.raises(JogError, match="second half"):
        jog = read(Session())
        check_jog(replace(jog, bend_mm=np.where(jog.joint_s < 30.0, jog.bend_mm, 0.0)), "session")
