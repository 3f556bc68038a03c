"""Thresholds of a running rig can be changed between two frames; the network is loaded once."""

from __future__ import annotations

import pytest

from app import rig_engine
from app.rig_engine import EngineMaker
from app.window_command import window_config
from core.config import Config, PerceptionConfig
from core.learning.model_file import ModelError
from core.perception.pipeline import Pipeline
from core.types import Frame
from hardware.rig import Rig, RigKind
from tests.core.test_pipeline import CONFIG, DrawnNetwork, frame

WIDE = CONFIG.model_copy(update={"pose": CONFIG.pose.model_copy(update={"d_allow_px": 77.0})})
OTHER_NETWORK = CONFIG.model_copy(update={"segmentation": CONFIG.segmentation.model_copy(update={"precision": "fp32"})})


class _Camera:
    def read(self, timeout_s: float) -> Frame:
        return frame()

    def close(self) -> None: ...


@pytest.fixture
def loaded(monkeypatch: pytest.MonkeyPatch) -> list[PerceptionConfig]:
    """What a network was loaded for."""
    seen: list[PerceptionConfig] = []

    def load(config: PerceptionConfig) -> Pipeline:
        seen.append(config)
        network = DrawnNetwork()
        network.draw_up_to(300)
        return Pipeline(network, config)

    monkeypatch.setattr(rig_engine, "open_pipeline", load)
    monkeypatch.setattr(rig_engine, "open_rig", lambda config: Rig("drawn", RigKind.PLAYBACK, _Camera(), None))  # type: ignore[arg-type]
    return seen


def config_of(perception: PerceptionConfig, camera: str = "video_file") -> Config:
    one_thread = perception.segmentation.model_copy(update={"threads": 1})
    whole = Config.model_validate({"rig": {"camera": camera, "robot": "none", "source": "x"}})
    return whole.model_copy(update={"perception": perception.model_copy(update={"segmentation": one_thread})})


@pytest.mark.parametrize("camera", ["video_file", "image_folder"])
def test_thresholds_act_from_the_next_frame_on(loaded: list[PerceptionConfig], camera: str) -> None:
    engine = EngineMaker()(config_of(CONFIG, camera))
    first = engine.step(0.1)
    strict = CONFIG.model_copy(update={"quality": CONFIG.quality.model_copy(update={"min_robot_length_px": 640.0})})
    assert engine.set_perception(strict)
    second = engine.step(0.1)
    assert first is not None
    assert second is not None
    assert first.scene.pose is not None
    assert second.scene.refusal is not None
    assert len(loaded) == 1
    engine.close()


def test_a_rig_that_is_started_again_keeps_the_network_unless_it_is_another_one(loaded: list[PerceptionConfig]) -> None:
    maker = EngineMaker()
    for perception, count in ((CONFIG, 1), (WIDE, 1), (CONFIG, 1), (OTHER_NETWORK, 2), (WIDE, 3)):
        maker(config_of(perception)).close()
        assert len(loaded) == count


def test_the_last_frame_of_a_rig_that_is_over_can_be_perceived_again(loaded: list[PerceptionConfig]) -> None:
    maker = EngineMaker()
    assert maker.perceive_again(frame(), None, WIDE) is None, "no network yet"
    maker(config_of(CONFIG)).close()
    scene = maker.perceive_again(frame(), None, WIDE)
    assert scene is not None
    assert scene.pose is not None


def test_without_a_network_there_is_nothing_to_try_out(loaded: list[PerceptionConfig], monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_config: PerceptionConfig) -> Pipeline:
        raise ModelError("no model")

    monkeypatch.setattr(rig_engine, "open_pipeline", fail)
    engine = EngineMaker()(config_of(CONFIG))
    assert not engine.set_perception(WIDE)
    engine.close()


def test_the_users_own_settings_are_under_what_the_command_line_says() -> None:
    own = {"twin": {"phantom": "s_curve"}, "servos": {"port": "/dev/ttyUSB3"}, "window": {"theme": "light"}}
    config, _ = window_config(None, None, None, own)
    assert (config.twin.phantom, config.window.theme) == ("s_curve", "light")
    config, kind = window_config("webcam", None, None, own)
    assert (config.rig.robot, kind) == ("servos", RigKind.LIVE)
    config, _ = window_config(None, None, None)
    assert config.window.theme == "dark", "what is measured knows nothing of them"
