"""Rehearsal: the target, branches that are too sharp, a run without pictures, the weakest place."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from core.config.calibration import Estimate
from core.config.models import Config, TwinConfig
from core.types import Frame, GraphEdge, Scene, VesselGraph
from hardware.twin.phantom import Phantom
from hardware.twin.rehearsal import (
    Rehearsal,
    RehearsalPicture,
    RehearsalPlan,
    SeenHeads,
    is_good,
    is_hopeless,
    seen_heads,
    slowed,
)
from hardware.twin.trial import TargetError, TrialPlan, target_near
from hardware.twin.view import CameraView
from hardware.twin.world import TwinWorld
from tests.hardware.twin.test_identification import behaviour

VIEW = CameraView(np.diag([3.2, 3.2, 1.0]), (640, 480))


def forked(turn_deg: float, radius_mm: float) -> Phantom:
    """A straight trunk to the right, and a branch at 60 mm."""
    turn = np.radians(turn_deg)
    fork, end, tip = (60.0, 75.0), (140.0, 75.0), (60.0 + 50.0 * np.cos(turn), 75.0 + 50.0 * np.sin(turn))
    edges = tuple(
        GraphEdge(a, b, np.linspace(start, stop, 200), np.full(200, radius_mm))
        for a, b, start, stop in ((0, 1, (0.0, 75.0), fork), (1, 2, fork, end), (1, 3, fork, tip))
    )
    return Phantom("forked", "Forked", VesselGraph(np.array([(0.0, 75.0), fork, end, tip]), edges), 0, VIEW)


def picture_of(phantom: Phantom, click_px: tuple[float, float] = (320.0, 240.0)) -> RehearsalPicture:
    return RehearsalPicture(phantom, VIEW, target_near(phantom, VIEW, click_px), click_px)


def test_the_target_lies_in_the_vessel_nearest_to_the_click() -> None:
    phantom = forked(50.0, 5.0)
    target = target_near(phantom, VIEW, (3.2 * 100, 3.2 * 77))
    assert (target.node, target.at_mm) == (2, pytest.approx(100, abs=0.5))
    assert target.click_px == pytest.approx((320, 240), abs=1.0)
    with pytest.raises(TargetError, match="not in the vessel"):
        target_near(phantom, VIEW, (320, 100))
    with pytest.raises(TargetError, match="from the port"):
        target_near(phantom, VIEW, (3.2 * 10, 240))


@pytest.mark.parametrize(
    ("turn_deg", "radius_mm", "count"),
    [(70.0, 3.0, 0), (70.0, 7.0, 1), (85.0, 3.0, 1), (50.0, 7.0, 0)],
)
def test_a_branch_is_too_sharp_by_its_turn_and_the_lumen_s_width(turn_deg: float, radius_mm: float, count: int) -> None:
    phantom = forked(turn_deg, radius_mm)
    x, y = VIEW.project(phantom.graph.nodes[3:4])[0] - (0, 10)
    picture = picture_of(phantom, (x, y))
    found = picture.sharp(Config())
    assert len(found) == count
    if found:
        assert found[0].turn_deg == pytest.approx(turn_deg, abs=1.0) and found[0].xy == pytest.approx((3.2 * 60, 3.2 * 75), abs=0.1)
    assert picture_of(phantom).sharp(Config()) == []  # straight on
    stiff = behaviour(bend_left_deg_per_mm=Estimate(value=20.0, low=18.0, high=22.0))
    assert len(picture.sharp(Config(twin=TwinConfig(behaviour=stiff)))) == 1  # a robot that bends less


def seen(heads_mm: list[tuple[float, float]], error_mm: tuple[float, float], confidence: float = 1.0) -> SeenHeads:
    return SeenHeads(np.array(heads_mm), np.array([error_mm] * len(heads_mm)), np.full(len(heads_mm), confidence))


HERE, NO_ANSWER = [(40.0 + x, 75.0) for x in range(16)], (math.nan, math.nan)
RIGHT = seen([(0.0, 75.0)], (0.0, 0.0))


@pytest.fixture
def plan(monkeypatch: pytest.MonkeyPatch) -> RehearsalPlan:
    monkeypatch.setattr("hardware.twin.trial.make_phantom", lambda _name: forked(50.0, 5.0))
    return RehearsalPlan(TrialPlan(Config(), max_seconds=0.7, look="bench", own=True, target_px=(320.0, 240.0)), RIGHT)


def test_a_run_is_the_same_for_its_seed_and_has_the_errors_of_pictures(plan: RehearsalPlan) -> None:
    errors = SeenHeads.joined([seen(HERE[::3], (0.5, 0.0)), seen(HERE[1::3], (0.0, -0.5)), seen(HERE[2::3], NO_ANSWER)])
    rows = [Rehearsal(replace(plan, seen=one), 3).run() for one in (errors, errors, seen(HERE, NO_ANSWER), RIGHT)]
    assert rows[0] == rows[1] and rows[0]["outcome"] == "time out"
    assert 0.2 < rows[0]["answered_share"] < 1.0 and rows[0]["head_error_median_px"] == pytest.approx(0.5 * 3.2, abs=0.01)
    assert rows[2]["answered_share"] == 0.0
    assert rows[3]["answered_share"] == 1.0 and rows[3]["head_error_median_px"] == 0.0


def test_a_run_perceives_as_in_the_pictures_of_its_place(plan: RehearsalPlan) -> None:
    """A clip over the first part of the way: no answer there, and beyond it an end that is seen too short and to the left."""
    covered, beyond = seen([(x - 40.0, y) for x, y in HERE], NO_ANSWER), seen([(x + 20.0, y) for x, y in HERE], (-1.0, -0.5), 0.4)
    run = Rehearsal(replace(plan, seen=SeenHeads.joined([covered, beyond])), 3)
    run._world.insert(10.0, target=run.target.node)
    assert run._perceive(run._read()).refusal is not None
    run._world.insert(65.0, target=run.target.node)
    plain = Rehearsal(plan, 3)
    plain._world = run._world
    frame = run._read()
    scene, true = run._perceive(frame), plain._perceive(frame)
    assert scene.path is not None and true.path is not None and scene.pose is not None and scene.pose.confidence == 0.4
    assert np.subtract(scene.path.head, true.path.head) == pytest.approx((-3.2, -1.6), abs=0.4)
    assert scene.path.tail == true.path.tail
    assert scene.masks is not None and scene.masks.vessel[240, 320] and not scene.masks.vessel[5, 5], "what lies in sight counts"


def test_a_head_that_rests_sees_what_any_picture_of_its_place_showed(plan: RehearsalPlan) -> None:
    looks = SeenHeads.joined([seen(HERE[::2], NO_ANSWER)] * 3 + [seen(HERE[::4], (0.0, 0.0)), seen(HERE[1::2], (0.0, 0.0))])
    run = Rehearsal(replace(plan, seen=looks), 3)
    shares = []
    for head_mm in ((40.0, 75.0), (41.0, 75.0), (42.0, 75.0)):
        run._world.physics = SimpleNamespace(head_mm=head_mm, robot_points_mm=lambda: np.array([(20.0, 75.0), (45.0, 75.0)]))
        frame = Frame(0, 0.0, np.zeros((1, 1, 3), np.uint8))
        shares.append(np.mean([run._perceive(frame).refusal is None for _ in range(200)]))
    assert shares == [pytest.approx(0.25, abs=0.1), 1.0, 0.0]


def test_looking_again_where_perception_failed_does_not_flatter_it(plan: RehearsalPlan) -> None:
    """As ``seen_heads`` does: up to five pictures of a place, until one is answered. A head that moves by sees the first."""
    rng, places = np.random.default_rng(4), [(40.0 + 0.05 * number, 75.0) for number in range(400)]
    parts: list[SeenHeads] = []
    for place in places:
        for _ in range(5):
            parts.append(seen([place], NO_ANSWER if rng.random() < 0.3 else (0.0, 0.0)))
            if not np.isnan(parts[-1].errors_mm).any():
                break
    looks = SeenHeads.joined(parts)
    assert looks.missing == pytest.approx(0.3, abs=0.05)
    run, refused = Rehearsal(replace(plan, seen=looks), 3), 0
    for place in places[::2]:
        run._world.physics = SimpleNamespace(head_mm=place, robot_points_mm=lambda: np.array([(20.0, 75.0), (45.0, 75.0)]))
        refused += run._perceive(Frame(0, 0.0, np.zeros((1, 1, 3), np.uint8))).refusal is not None
    assert refused / 200 == pytest.approx(0.3, abs=0.07)


def test_perception_is_measured_in_pictures_along_the_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """The pipeline sees the true head 4 px to the right, is not sure of every third picture, and sees nothing beyond 50 mm."""
    for module in ("world", "trial"):
        monkeypatch.setattr(f"hardware.twin.{module}.make_phantom", lambda _name: forked(50.0, 5.0))
    frames: list[Frame] = []

    class Watched(TwinWorld):
        def frame(self, captured_s: float | None = None) -> Frame:
            true_eye._world = self
            return super().frame(captured_s)

    def perceive(frame: Frame, _click: tuple[float, float]) -> Scene:
        frames.append(frame)
        scene = true_eye._perceive(frame)
        if scene.path is None or true_eye._world.physics.head_mm[0] > 50.0:
            return replace(scene, pose=None)
        assert scene.pose is not None
        pose = replace(scene.pose, confidence=0.4 if len(frames) % 3 == 0 else 1.0)
        return replace(scene, pose=pose, path=replace(scene.path, points=scene.path.points + (0.0, 4.0)))

    config = Config()
    true_eye = Rehearsal(RehearsalPlan(TrialPlan(config, look="bench", own=True, target_px=(230.0, 240.0)), RIGHT), 0)
    monkeypatch.setattr("hardware.twin.rehearsal.TwinWorld", Watched)
    monkeypatch.setattr("hardware.twin.rehearsal.open_pipeline", lambda _config: perceive)
    nices: list[int] = []
    monkeypatch.setattr("hardware.twin.rehearsal.os.setpriority", lambda _which, _who, nice: nices.append(nice))
    found = seen_heads(config, target_near(forked(50.0, 5.0), VIEW, (230.0, 240.0)), 0.0)
    answered = ~np.isnan(found.errors_mm[:, 0])
    assert nices[0] >= 10, "at low priority"
    assert len(frames) == len(found.confidence) > 20 and frames[0].image.std() > 10.0
    assert answered.tolist() == (found.heads_mm[:, 0] <= 50.0).tolist() and 0.3 < found.missing < 0.9
    assert found.errors_mm[answered] == pytest.approx(np.array([(0.0, 4.0 / 3.2)] * answered.sum()), abs=0.25)
    assert np.diff(found.heads_mm[:, 0]).max() < 3.0 and (np.diff([frame.captured_s for frame in frames]) > 0.0).all()
    counts = np.unique(found.heads_mm[answered][:, 0], return_counts=True)[1]
    assert set(counts) == {1, 2}, "a second picture where the first was not sure"
    assert set(np.unique(found.heads_mm[~answered][:, 0], return_counts=True)[1]) == {5}, "five where no picture is answered"


def test_another_robot_of_each_run_is_within_what_was_identified(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hardware.twin.trial.make_phantom", lambda _name: forked(50.0, 5.0))
    known = behaviour()
    config = Config(twin=TwinConfig(behaviour=known))
    plan = RehearsalPlan(TrialPlan(config, look="bench", own=True, target_px=(320.0, 240.0)), RIGHT)
    ratios, bends = [], []
    for seed in range(3):
        physics = Rehearsal(plan, seed)._world.physics
        ratios.append(physics.specimen.shaft_ei / physics.specimen.tip_ei)
        bends.append(physics._drive.gain[0] * physics.specimen.bend_deg_per_mm)
    for values, one in ((ratios, known.shaft_to_head), (bends, known.bend_right_deg_per_mm)):
        assert len(set(values)) == 3 and all(one.low <= value <= one.high for value in values)


def test_slower_is_a_share_of_all_advised_speeds() -> None:
    config = Config()
    assert slowed(config, 0.5).advice.fast_mm_s == 0.5 * config.advice.fast_mm_s


def row(reached: bool, x_mm: list[float], forces_n: list[float]) -> dict[str, Any]:
    return {"reached": reached, "track": {"x_mm": x_mm, "y_mm": [75.0] * len(x_mm), "wall_contact_n": forces_n}}


def test_the_weakest_place_is_where_runs_end_or_else_where_the_force_is() -> None:
    picture = picture_of(forked(50.0, 5.0))
    good = row(True, [20, 45, 95], [0.0, 0.3, 0.1])
    place = picture.weakest([good])
    assert place is not None and (place.along_mm, place.wall_force_p95_n, place.ended_here) == (45.0, 0.3, 0)
    assert place.xy == pytest.approx((3.2 * 45, 3.2 * 75), abs=0.2) and place.turn_deg == 0.0
    place = picture.weakest([good, row(False, [20, 62], [0.0, 0.1])])
    assert place is not None and (place.along_mm, place.ended_here) == (65.0, 1)
    assert picture.weakest([]) is None


def test_a_speed_is_good_within_the_limits() -> None:
    sums = {"reached_share": 0.96, "wall_force_p95_n": 0.1, "wall_force_max_n": 0.3}
    assert is_good(sums)
    assert not any(is_good(sums | bad) for bad in ({"reached_share": 0.9}, {"wall_force_p95_n": 0.2}, {"wall_force_max_n": 0.6}))


def test_the_band_of_head_paths_and_the_force_along_the_way() -> None:
    rows = []
    for number in range(21):  # side by side, 0.1 mm apart; all but one turn back at 90 mm; one goes astray
        x = np.arange(30.0, 120.0 if number == 0 else 90.0, 1.0)
        track = {"x_mm": [*x, 60.0], "y_mm": [*np.full(len(x), 74.0 + 0.1 * number), 100.0], "time_s": [*(x / 10.0), 99.0]}
        rows.append({"track": track | {"wall_contact_n": [*np.where(abs(x - 60.0) < 1.0, 0.01 * number, 0.0), 5.0]}})
    picture = picture_of(forked(50.0, 5.0))
    way = picture.way(rows)
    at = way.along_mm.index(60.0)
    assert way.xy[at] == pytest.approx((3.2 * 60.0, 3.2 * 75.0), abs=0.5) and way.runs[at] == 21
    assert sorted([way.low_xy[at][1], way.high_xy[at][1]]) == pytest.approx([3.2 * 74.1, 3.2 * 75.9], abs=0.1)
    assert way.wall_force_n[at] == pytest.approx(0.19) and way.wall_force_n[at + 2] == 0.0
    assert way.time_s[at] == pytest.approx((5.9, 5.9, 5.9), abs=0.11)
    assert (way.runs[-1], way.along_mm[-1]) == (1, 120.0) and way.along_mm[0] == 30.0
    assert picture.way([]).along_mm == ()


def test_a_speed_is_given_up_when_it_cannot_be_good_any_more() -> None:
    good, failed, hard = ({"reached": ok, "wall_contact_n": {"max": n}} for ok, n in ((True, 0.1), (False, 0.1), (True, 0.6)))
    assert not is_hopeless([good, failed, failed], 50) and is_hopeless([failed] * 3, 50)
    assert is_hopeless([good, hard], 50) and not is_hopeless([failed], 20)
