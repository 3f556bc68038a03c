"""The layers of the configuration, and how wrong files are reported."""

import json
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel, ValidationError

from core.config.models import Config, ConfigError, choose_model, load_config
from core.config.safety import SafetyConfig, ServosConfig


def _write(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_defaults_and_presets_load() -> None:
    assert load_config().twin.phantom == "tree"
    paper = load_config(preset="paper").perception
    assert paper.gaps.rule == "every_pair"
    assert paper.path.cosine == "absolute"
    assert not paper.cleaning.extend_ends


def test_files_with_settings_that_are_not_used_any_more_open(tmp_path: Path) -> None:
    assert load_config(_write(tmp_path, "[policy.pursuit]\ncontact_slow_n = 0.1\nretry_mm = 8.0\n")).policy.pursuit.retry_mm == 8.0


def test_a_users_file_wins_over_the_preset_and_keeps_the_rest(tmp_path: Path) -> None:
    path = _write(tmp_path, "[perception.gaps]\ngap_threshold_px = 12\n")
    config = load_config(path, preset="paper")
    assert config.perception.gaps.gap_threshold_px == 12
    assert config.perception.gaps.rule == "every_pair"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[perception.pose]\nd_allow_px = -3\n", ["perception.pose.d_allow_px", "> 0 and <= 200", "-3"]),
        ("[perception.pose]\nd_allow = 3\n", ["perception.pose.d_allow", "unknown key"]),
        ("[perception.pose]\nd_allow_px = 'wide'\n", ["perception.pose.d_allow_px", "'wide'"]),
        ("[perception.pose]\nd_allow_px = nan\n", ["perception.pose.d_allow_px"]),
        ("[perception.gaps]\nrule = 'nearest'\n", ["perception.gaps.rule", "components", "every_pair"]),
        ("[perception\n", ["not valid TOML"]),
        (
            "[servos]\nport = '/dev/ttyUSB0'\nheartbeat_timeout_s = 3.0\n",
            ["servos: ", "heartbeat_timeout_s must be 0.5 at most with real servos"],
        ),
        ("[servos]\nport = '/dev/ttyUSB0'\nwatchdog_s = 2.0\n", ["watchdog_s must be 0.5 at most with real servos"]),
        ("[servos]\nport = '/dev/ttyUSB0'\nbus_hz = 5.0\nwatchdog_s = 0.4\n", ["bus_hz must be 20 at least with real servos"]),
        ("perception = 3\n", ["perception"]),
        ("[[servos.joints]]\nname = 'right'\nid = 999\n", ["servos.joints.0.id: must be >= 0 and <= 252, got 999"]),
        ("[perception.pose]\nd_allow_px = true", ["d_allow_px: must be ", "got True"]),
        ('[perception.pose]\nd_allow_px = "6"', ["d_allow_px: must be ", "got '6'"]),
        ("[perception.tracking]\nwindow_px = 33", ["window_px: must be ", "a multiple of 32, got 33"]),
        ("x = " + "[" * 5000 + "]" * 5000, ["not valid TOML: nested too deeply"]),
        ("x = " + "9" * 5000, ["not valid TOML"]),
    ],
)
def test_a_bad_file_is_one_line_with_file_key_and_range(tmp_path: Path, text: str, words: list[str]) -> None:
    path = _write(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    for word in words:
        assert word in message


def test_the_twins_servos_may_be_more_patient(tmp_path: Path) -> None:
    assert load_config(_write(tmp_path, "[servos]\nheartbeat_timeout_s = 3.0\n")).servos.heartbeat_timeout_s == 3.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"forces": {"up": 61.0}}, "joint up: max_force_n must be 60 at most with real servos"),
        ({"forces": {"delivery_2": 101.0}}, "joint delivery_2: max_force_n must be 100 at most with real servos"),
        ({"forces": {"up": 60.0, "advance": 100.0}}, ""),
        ({"tracking_error_mm": 50.0}, "tracking_error_mm must be 3 at most with real servos"),
        ({"joints": {"right": 50.0}}, "joint right: max_step_mm must be 1 at most with real servos"),
        ({"joints": {"advance": 2.1}}, "joint advance: max_step_mm must be 2 at most with real servos"),
        ({"joints": {"right": 1.0, "advance": 2.0}, "tracking_error_mm": 3.0}, ""),
    ],
)
def test_what_a_joint_may_do_has_a_ceiling_with_real_servos(changes: dict[str, Any], words: str) -> None:
    changes = dict(changes)
    steps, forces = changes.pop("joints", {}), changes.pop("forces", {})
    joints = [
        joint.model_copy(
            update={
                "max_step_mm": steps.get(joint.name, joint.max_step_mm),
                "max_force_n": forces.get(joint.name, joint.max_force_n),
            }
        )
        for joint in ServosConfig().joints
    ]
    assert ServosConfig.model_validate({**changes, "joints": joints}).too_loose == words


@pytest.mark.parametrize(
    ("name", "changes", "words"),
    [
        ("advance", {"max_speed_mm_s": 28.0}, ""),
        ("advance", {"max_speed_mm_s": 200.0}, "joint advance: it brakes from full speed in 100 mm, at most 2 with real servos"),
        ("up", {"max_acceleration_mm_s2": 10.0}, "joint up: it brakes from full speed in 5 mm, at most 1 with real servos"),
    ],
)
def test_a_joint_stops_within_what_one_order_may_take(name: str, changes: dict[str, float], words: str) -> None:
    joints = [joint.model_copy(update=changes if joint.name == name else {}) for joint in ServosConfig().joints]
    assert ServosConfig.model_validate({"joints": joints}).too_loose.partition(": lower its")[0] == words


def test_a_joint_of_an_older_file_gets_the_force_of_its_kind(tmp_path: Path) -> None:
    joints = [{k: v for k, v in joint.items() if k != "max_force_n"} for joint in _joints_with("up", id=30)]
    text = "[servos]\nmax_current_ma = 600.0\n" + "".join(
        "[[servos.joints]]\n" + "".join(f"{k} = {json.dumps(v)}\n" for k, v in joint.items() if v is not None) for joint in joints
    )
    servos = load_config(_write(tmp_path, text)).servos
    assert [joint.max_force_n for joint in servos.joints] == [20.0] * 4 + [30.0] * 3
    assert servos.joints[2].id == 30
    assert "max_current_ma" not in servos.model_dump()


def test_missing_file_and_unknown_preset_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such configuration file"):
        load_config(tmp_path / "none.toml")
    with pytest.raises(ConfigError, match=r"unknown preset 'papre'; known: paper"):
        load_config(preset="papre")
    (tmp_path / "x.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="UTF-8"):
        load_config(tmp_path / "x.toml")


def test_the_configuration_cannot_be_changed_in_place() -> None:
    with pytest.raises(ValueError, match="frozen"):
        Config().twin = None


def _joints_with(name: str, **changes: float) -> list[dict[str, object]]:
    joints = [joint.model_dump() for joint in ServosConfig().joints]
    return [{**joint, **changes} if joint["name"] == name else joint for joint in joints]


@pytest.mark.parametrize(
    ("section", "values", "words"),
    [
        (ServosConfig, {"pretension_mm": 5.0}, "joint right: pretension_mm must lie between low_mm and high_mm"),
        (ServosConfig, {"joints": _joints_with("advance", low_mm=100.0)}, "joint advance: zero must lie between"),
        (ServosConfig, {"joints": _joints_with("delivery_2", high_mm=-1.0)}, "delivery_2"),
        (ServosConfig, {"watchdog_s": 0.02}, "watchdog_s must be two cycles of the bus"),
        (ServosConfig, {"bus_hz": 5.0}, "watchdog_s must be two cycles of the bus"),
        (ServosConfig, {"max_temperature_c": 85.0}, "80"),
        (SafetyConfig, {"frame_loss_min_frames": 300}, "loss is never seen"),
    ],
)
def test_limits_that_contradict_each_other_are_refused(section: type[BaseModel], values: dict[str, object], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        section.model_validate(values)


def test_a_name_that_is_no_text_is_one_clear_error() -> None:
    with pytest.raises(ConfigError, match=r"command line: 'm\\udcff' is no text in UTF-8; rename that file or folder"):
        load_config(overrides=choose_model("m\udcff"))


# ---- the thresholds of gate and supervisor


def test_the_thresholds_are_those_of_the_rules() -> None:
    safety = Config().safety
    assert safety == SafetyConfig()
    assert (safety.command_max_age_s, safety.pose_hold_s, safety.pose_disarm_s) == (0.1, 0.15, 0.5)
    assert (safety.frame_hold_s, safety.frame_disarm_s, safety.healthy_s, safety.hold_clear_s) == (0.15, 0.5, 1.0, 0.5)
    assert (safety.clock_gap_s, safety.tracking_time_s, safety.bus_errors, safety.missed_answers) == (1.0, 0.2, 5, 3)
    assert (safety.equal_frames, safety.dark_frames, safety.head_lost_frames, safety.broken_results) == (5, 3, 3, 3)


@pytest.mark.parametrize(
    "changes",
    [
        {"command_max_age_s": 0.11},
        {"pose_hold_s": 0.16},
        {"pose_disarm_s": 0.6},
        {"frame_disarm_s": 0.6},
        {"clock_gap_s": 1.1},
        {"healthy_s": 0.9},
        {"hold_clear_s": 0.6},
        {"deadman_timeout_s": 0.1},
        {"equal_frames": 6},
        {"tracking_time_s": 0.3},
        {"bus_errors": 6},
        {"missed_answers": 4},
        {"min_confidence": 0.49},
        {"max_drift_px": 11.0},
    ],
)
def test_the_rules_numbers_may_be_tightened_never_loosened(changes: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match=f"safety.{next(iter(changes))}"):
        load_config(overrides={"safety": changes})


@pytest.mark.parametrize("changes", [{"command_max_age_s": 0.04}, {"deadman_timeout_s": 0.04}])
def test_nor_may_they_be_tightened_below_what_it_takes_to_repeat_a_thing(changes: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match=rf"safety.{next(iter(changes))}.* 0.05") as told:
        load_config(overrides={"safety": changes})
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"pose_hold_s": 0.15, "pose_disarm_s": 0.15}, "pose_hold_s must be below pose_disarm_s"),
        ({"frame_hold_s": 0.15, "frame_disarm_s": 0.12}, "frame_hold_s must be below frame_disarm_s"),
        ({"bus_hold_s": 0.15, "bus_disarm_s": 0.12}, "bus_hold_s must be below bus_disarm_s"),
        ({"frame_loss_warn_share": 0.1, "frame_loss_hold_share": 0.1}, "frame_loss_warn_share must be below"),
        ({"min_confidence": 0.98}, "must not exceed 1"),
    ],
)
def test_thresholds_that_contradict_each_other(changes: dict[str, float], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        load_config(overrides={"safety": changes})


def test_a_file_that_asks_for_a_twin_without_servos_gets_one_with_servos() -> None:
    assert load_config(overrides={"servos": {"driver": "direct"}}).servos.driver == "dynamixel"
