"""Starting a rig again: what the operator has not acknowledged is still there."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import NoReturn, cast

import pytest

from app.operator import rig_engine
from app.operator.rig_engine import EngineMaker, RigEngine, leaving_a_core
from core.config.calibration import CalibrationConfig, ScaleConfig
from core.config.models import Config, PerceptionConfig, PolicyName, PoseConfig
from core.config.rig_file import make_rig, read_rig, with_rig, write_rig
from core.control.engine import Perceive
from core.control.faults import Cause, Fault
from core.control.frame_reports import kept_view
from core.control.health import ModelReport
from core.control.modes import OF_THE_RIG, Act, Hindrance, Mode
from core.control.pilot import Pilot
from core.control.policies import Policy, make_policy
from core.devices import DeviceError
from core.perception.model_file import ModelError
from core.perception.pipeline import Pipeline
from core.types import Frame, Point, Reason, Refusal, Scene
from hardware.rig import START_INSERTION_MM, Rig, RigKind
from hardware.twin.process import PrestartedProcesses
from tests.core.control.test_engine import _Camera
from tests.core.control.test_frame_reports import BOARD, moved
from tests.core.perception.test_pipeline import DrawnNetwork, _draw_tapered, frame
from tests.core.pilot_bench import Robot


class _Maker(EngineMaker):
    """Loads no network."""

    def _perception(self, config: PerceptionConfig) -> tuple[Perceive, ModelReport]:
        def perceive(frame: Frame, target: Point | None = None) -> Scene:
            return Scene(frame.index, frame.captured_s, (4, 4), 1.0, refusal=Refusal(Reason.BLACK))

        return perceive, ModelReport(True)


Open = Callable[[], RigEngine]


@pytest.fixture
def robots() -> list[Robot]:
    return []


@pytest.fixture
def open_engine(monkeypatch: pytest.MonkeyPatch, robots: list[Robot]) -> Open:
    """Opens the twin's rig, again and again; the robots that it opened are kept."""
    maker = _Maker()

    def open_rig(config: Config, _ahead: object) -> Rig:
        robots.append(Robot())
        return Rig("twin", RigKind.SIM, _Camera([]), robots[-1])

    monkeypatch.setattr(rig_engine, "open_rig", open_rig)
    return lambda: maker(Config())


def test_the_twins_servos_are_switched_on_at_the_start(open_engine: Open, robots: list[Robot]) -> None:
    engine = open_engine()
    engine.pilot._requests._worker.submit(lambda: None).result(5.0)
    engine.close()
    assert "arm" in robots[0].calls


def test_starting_again_clears_no_stop(open_engine: Open, robots: list[Robot]) -> None:
    engine = open_engine()
    engine.pilot.stop()
    engine.close()
    for _ in range(2):  # and neither does a second time
        engine = open_engine()
        view = engine.pilot.view
        assert (view.mode, view.latched) == (Mode.STOPPED, Fault(Cause.STOP_PRESSED))
        engine.close()
    assert all("arm" not in robot.calls for robot in robots[1:])
    engine = open_engine()
    engine.pilot.ask(Act.ACKNOWLEDGE)
    engine.pilot.tick()
    engine.close()
    again = open_engine()
    assert again.pilot.view.mode is Mode.ADVISORY
    again.close()


def test_the_policy_and_the_watch_over_stalls_use_the_rigs_own_scale(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """0.2 mm a pixel at 1280 px are 2.5 working pixels a millimetre."""
    scale = ScaleConfig(mm_per_px=0.2, size_px=(1280, 960), method="board", uncertainty_share=0.001)
    known = CalibrationConfig(made_utc=datetime(2025, 3, 4, tzinfo=UTC), scale=scale)
    path = write_rig(make_rig(Config(), "bench 1", known), tmp_path / "bench 1.toml")
    told: list[float] = []

    def make(name: PolicyName, config: Config) -> Policy:
        told.append(config.policy.pursuit.pixels_per_mm)
        return make_policy(name, config)

    monkeypatch.setattr(rig_engine, "make_policy", make)
    monkeypatch.setattr(rig_engine, "open_rig", lambda config, _ahead: Rig("twin", RigKind.SIM, _Camera([]), Robot()))
    engine = _Maker()(with_rig(Config(), read_rig(path), path))
    told.append(engine.pilot._config.policy.pursuit.pixels_per_mm)
    engine.close()
    assert told == [pytest.approx(2.5)] * 2


class _Grey(_Camera):
    """Pictures that are neither black nor white."""

    def read(self, timeout_s: float) -> Frame | None:
        given = super().read(timeout_s)
        return frame(given.captured_s) if given is not None else None


def test_a_live_rigs_camera_is_compared_with_its_calibration_unless_it_has_a_bench(tmp_path: Path) -> None:
    known = CalibrationConfig(made_utc=datetime(2025, 3, 4, tzinfo=UTC), view=kept_view(BOARD))
    path = write_rig(make_rig(Config(), "lab", known), tmp_path / "lab.toml")
    config = with_rig(Config(), read_rig(path), path)
    with_bench = config.model_copy(update={"perception": config.perception.model_copy(update={"bench": "lab"})})
    for kind, used, drift_px in ((RigKind.LIVE, config, 40.0), (RigKind.LIVE, with_bench, None), (RigKind.SIM, config, None)):
        engine = RigEngine(
            Rig("lab", kind, _Grey([0]), Robot()), Pipeline(DrawnNetwork(), PerceptionConfig()), used, ModelReport(True)
        )
        found = engine.pilot._reports._landmarks.drift_px(moved(BOARD, 40.0), 0.0, 1.0)
        engine.close()
        assert found == (None if drift_px is None else pytest.approx(drift_px, abs=0.6))


@pytest.mark.parametrize("kind", [RigKind.SIM, RigKind.LIVE])
def test_a_live_rig_that_nothing_was_learnt_of_is_advisory_only_and_a_twin_is_not(kind: RigKind) -> None:
    config = Config.model_validate({"policy": {"name": "random"}})
    engine = RigEngine(
        Rig("bench", kind, _Grey([0]), Robot()), Pipeline(DrawnNetwork(), PerceptionConfig()), config, ModelReport(True)
    )
    pilot = engine.pilot
    until_s = time.monotonic() + 10.0
    while pilot.view.time_s == 0.0 or not pilot.view.against_arming:
        assert time.monotonic() < until_s
    view = pilot.view
    engine.close()
    lacks = {
        Hindrance.DRUMS_UNKNOWN,
        Hindrance.DIRECTIONS_UNKNOWN,
        Hindrance.STEERING_UNKNOWN,
        Hindrance.MODEL_UNTAUGHT,
        Hindrance.POLICY_BLIND,
        Hindrance.NOT_ACCEPTED,
    }
    assert set(view.against_arming) & OF_THE_RIG == (lacks if kind is RigKind.LIVE else set())
    assert view.keyboard_deadman is (kind is RigKind.SIM)


def test_checks_that_are_switched_off_on_an_open_live_rig_stand_against_a_hand_over_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They acted at once, and the rig stayed as ready as it was when it was opened."""
    told: list[tuple[Hindrance, ...]] = []
    monkeypatch.setattr(Pilot, "set_readiness", lambda _pilot, readiness: told.append(readiness.hindrances))
    for kind in (RigKind.LIVE, RigKind.SIM):
        pipeline = Pipeline(DrawnNetwork(), PerceptionConfig())
        engine = RigEngine(Rig("drawn", kind, _Grey([0]), Robot()), pipeline, Config(), ModelReport(True))
        engine.use_network(pipeline, knows_past=True)
        for quality in ({"enabled": False}, {"max_novelty": 900.0}, {}):
            assert engine.set_perception(PerceptionConfig.model_validate({"quality": quality}))
        engine.close()
    assert [Hindrance.CHECKS_OFF in hindrances for hindrances in told] == [True, True, False]


@pytest.mark.parametrize(("knows_past", "head_x"), [(True, 424.0), (False, 190.0)])
def test_other_thresholds_do_not_turn_the_robot_about(knows_past: bool, head_x: float) -> None:
    """The second picture by itself shows the robot the other way round; pictures without a past have no head to go on with."""
    network = DrawnNetwork()
    pipeline = Pipeline(network, PerceptionConfig())
    rig = Rig("drawn", RigKind.LIVE, _Grey([0, 1]), None)
    engine = RigEngine(rig, pipeline if knows_past else pipeline.perceive_single, Config(), ModelReport(True))
    engine.use_network(pipeline, knows_past=knows_past)
    _draw_tapered(network, 180.0, 420.0, thick="left")
    first = engine.step(0.0)
    assert engine.set_perception(PerceptionConfig(pose=PoseConfig(d_allow_px=9.0)))
    _draw_tapered(network, 190.0, 424.0, thick="right")
    second = engine.step(0.0)
    engine.close()
    found = [tick.scene.path.head[0] for tick in (first, second) if tick is not None and tick.scene.path is not None]
    assert found == [pytest.approx(420.0, abs=3.0), pytest.approx(head_x, abs=3.0)]


def test_a_rig_that_cannot_be_opened_acknowledges_nothing(open_engine: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    engine = open_engine()
    engine.pilot.stop()
    engine.close()
    works = rig_engine.open_rig

    def broken(config: Config, _ahead: object) -> Rig:
        raise DeviceError("no camera")

    monkeypatch.setattr(rig_engine, "open_rig", broken)
    with pytest.raises(DeviceError):
        open_engine()
    monkeypatch.setattr(rig_engine, "open_rig", works)
    engine = open_engine()
    assert engine.pilot.view.mode is Mode.STOPPED
    engine.close()


def test_what_was_started_ahead_is_the_first_rigs(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[object] = []

    def open_rig(config: Config, ahead: object) -> Rig:
        given.append(ahead)
        return Rig("twin", RigKind.SIM, _Camera([]), Robot())

    monkeypatch.setattr(rig_engine, "open_rig", open_rig)
    ahead = cast(PrestartedProcesses, SimpleNamespace())
    maker = _Maker(ahead)
    for _ in range(2):
        maker(Config()).close()
    assert given == [ahead, None]


def test_a_network_that_cannot_be_warmed_up_does_not_take_the_place_of_the_one_before(monkeypatch: pytest.MonkeyPatch) -> None:
    good, broken = PerceptionConfig(), PerceptionConfig.model_validate({"segmentation": {"model": "b"}})

    def warm_up(pipeline: Pipeline) -> None:
        if pipeline._config == broken:
            raise ModelError("wrong outputs")

    monkeypatch.setattr(Pipeline, "warm_up", warm_up)
    monkeypatch.setattr(rig_engine, "open_pipeline", lambda config: Pipeline(DrawnNetwork(), config))
    maker = EngineMaker()
    first, _ = maker._perception(good)
    assert maker._perception(broken)[1] == ModelReport(False, "wrong outputs")
    again, report = maker._perception(good)
    assert isinstance(first, Pipeline) and isinstance(again, Pipeline)
    assert again._stream is first._stream and report == ModelReport(True)


def test_twin_and_network_begin_before_the_rig_is_opened_which_reports_what_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded: list[PerceptionConfig] = []
    begun: list[object] = []

    def open_pipeline(config: PerceptionConfig) -> NoReturn:
        loaded.append(config)
        raise ModelError("no such model")

    def begin(config: Config, insertion_mm: float) -> NoReturn:
        begun.append((config, insertion_mm))
        raise DeviceError("no memory")

    monkeypatch.setattr(rig_engine, "open_pipeline", open_pipeline)
    monkeypatch.setattr(rig_engine, "open_rig", lambda *_: Rig("twin", RigKind.SIM, _Camera([]), Robot()))
    maker = EngineMaker(cast(PrestartedProcesses, SimpleNamespace(begin=begin)))
    maker.begin_twin(Config())
    maker.begin_network(Config())
    engine = maker(Config())
    assert begun == [(Config(), START_INSERTION_MM)]
    assert loaded == [leaving_a_core(Config().perception)] * 2, "one that is not there is looked for again"
    assert engine.pilot is not None
    assert engine._perceive(frame()).refusal.reason is Reason.NO_MODEL
    engine.close()
