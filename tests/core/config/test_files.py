"""Settings files: only what differs is written, and no user data is lost."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

from core.config.files import (
    changed_keys,
    own_config,
    own_settings_path,
    read_settings,
    settings_of_windows,
    settings_text,
    usable_part,
    write_settings,
)
from core.config.models import Config, ConfigError, load_config
from core.config.schema import settings_by_key, value_at, with_value

BASE = load_config()


def config_with(**changes: Any) -> Config:
    """Dotted paths with __ for the dot."""
    data = BASE.model_dump(mode="json")
    for key, value in changes.items():
        data = with_value(data, key.replace("__", "."), value)
    return Config.model_validate(data)


def asides(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.bad-*"))


WIDE = config_with(perception__pose__d_allow_px=9.0)
DEEP = b"a = " + b"[" * 5000 + b"]" * 5000
LONG = b"a = " + b"9" * 5000


# ---- texts


def test_only_what_differs_is_written() -> None:
    text, is_lossless = settings_text("", WIDE)
    assert tomllib.loads(text) == {"perception": {"pose": {"d_allow_px": 9.0}}}
    assert text.startswith("# LumenPilot's settings")
    assert is_lossless


def test_comments_order_and_unknown_keys_stay() -> None:
    old = '# my bench\n[future]\nx = 1\n\n[perception.pose]\nd_allow_px = 7.5  # measured\ntheta_allow_deg = 10\nnewer = "a"\n'
    text, is_lossless = settings_text(old, WIDE)
    assert text == old.replace("7.5", "9.0")
    assert is_lossless


def test_what_is_a_default_again_goes_out_of_the_file_and_what_says_the_default_stays() -> None:
    old = "[perception.pose]\nd_allow_px = 7.5\ntheta_allow_deg = 10 # as the paper\n[window]\ntheme = 'light'\n"
    text, _ = settings_text(old, BASE)
    assert text == "[perception.pose]\ntheta_allow_deg = 10 # as the paper\n"


def test_none_is_a_missing_key() -> None:
    text, _ = settings_text("[camera]\nexposure_ms = 3.5\ngain = 2\n", config_with(camera__gain=2))
    assert tomllib.loads(text) == {"camera": {"gain": 2}}


def test_joints_are_written_all_seven_and_their_unknown_keys_stay() -> None:
    changed = config_with(servos__joints__2__id=33)
    text, _ = settings_text("", changed)
    assert [joint["id"] for joint in tomllib.loads(text)["servos"]["joints"]] == [1, 2, 33, 4, 5, 6, 7]
    marked = text.replace("id = 33", 'id = 33  # the new one\nbought = "May"')
    # an unknown key within a joint makes the list one that cannot be used, so it is set right and the old text is kept aside
    again, is_lossless = settings_text(marked, changed)
    assert read_back(again) == changed
    assert not is_lossless
    plain, is_lossless = settings_text(text.replace("id = 33", "id = 33  # the new one"), config_with(servos__joints__2__id=34))
    assert "id = 34  # the new one" in plain
    assert is_lossless
    assert "joints" not in settings_text(text, BASE)[0]


@pytest.mark.parametrize(
    "old",
    [
        "perception.pose.d_allow_px = 3.0 # dotted\n",
        "perception = {pose = {d_allow_px = 3.0}}\n",
        "[perception.pose]\nd_allow_px = 3.0\n[twin]\nphantom = 's_curve'\n[perception.gaps]\nmax_turn_deg = 3\n",
        "[perception]\nworking_size_px = 320\n[perception.tracking]\n[perception.pose]\n",
        "\ufeff".encode().decode("utf-8-sig") + "[window]\r\ntheme = 'light'\r\n",
        "[[servos.joints]]\nname = 'right'\n",
        "perception = 3\n",
        "window = [1, 2]\n",
    ],
)
def test_whatever_form_the_old_file_has_the_new_one_says_the_configuration(old: str) -> None:
    wanted = config_with(perception__pose__d_allow_px=9.0, window__theme="light", twin__phantom="y_branch")
    text, _ = settings_text(old, wanted)
    assert read_back(text) == wanted


def read_back(text: str) -> Config:
    return load_config(overrides=tomllib.loads(text))


def test_every_setting_can_be_written_and_read_back() -> None:
    """All of them at once, at allowed values that are not the defaults."""
    data, changed = BASE.model_dump(mode="json"), set()
    for key, setting in settings_by_key().items():
        for value in other_values(setting, value_at(data, key)):
            candidate = with_value(data, key, value)
            try:
                Config.model_validate(candidate)
            except ValueError:
                continue  # it does not go together with its neighbours
            data = candidate
            changed.add(key)
            break
    config = Config.model_validate(data)
    assert read_back(settings_text("", config)[0]) == config
    assert set(changed_keys(BASE, config)) == changed
    assert len(changed) > 0.9 * len(settings_by_key())


def other_values(setting: Any, default: Any) -> list[Any]:
    low, high = setting.bounds.low, setting.bounds.high
    if isinstance(default, bool):
        return [not default]
    if setting.choices:
        return [choice for choice in setting.choices if choice != default]
    if low is not None and high is not None:
        tried = [low + (high - low) * 0.37]
        if isinstance(default, int | float):
            tried.append(default + (low - default) * 0.1)  # a ceiling with real servos is lower than what a twin may have
        found = [round(value) if setting.kind.value == "whole number" else value for value in tried]
        return [value for value in found if value != default]
    return ["ABCD", "other"]


# ---- files


def test_a_folder_in_the_way_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("", encoding="utf-8")
    with pytest.raises(ConfigError, match="cannot be written"):
        write_settings(tmp_path / "a" / "settings.toml", WIDE)


def test_values_that_are_not_allowed_are_kept_aside_when_written(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    path.write_text("[safety]\npose_hold_s = 99\n", encoding="utf-8")
    note = write_settings(path, WIDE)
    (aside,) = asides(tmp_path)
    assert aside.read_text(encoding="utf-8") == "[safety]\npose_hold_s = 99\n"
    assert aside.name in note
    assert read_settings(path).config == WIDE


def test_what_somebody_else_wrote_meanwhile_is_kept_aside(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    path.write_text("[twin]\nphantom = 's_curve'\n", encoding="utf-8")
    note = write_settings(path, WIDE, seen="")
    assert "changed meanwhile" in note
    assert asides(tmp_path)[0].read_text(encoding="utf-8") == "[twin]\nphantom = 's_curve'\n"
    assert write_settings(path, BASE, seen=path.read_text(encoding="utf-8")) == ""


@pytest.mark.parametrize("data", [b"\xff\xfe[broken", DEEP, LONG])
def test_a_file_that_became_no_toml_meanwhile_is_kept_aside(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "settings.toml"
    path.write_bytes(data)
    assert "was no TOML" in write_settings(path, WIDE)
    assert asides(tmp_path)[0].read_bytes() == data
    assert read_settings(path).config == WIDE


# ---- reading


def test_a_missing_file_is_empty(tmp_path: Path) -> None:
    file = read_settings(tmp_path / "none.toml")
    assert (file.config, file.text, file.problems) == (BASE, None, ())


@pytest.mark.parametrize("data", [b"[perception\n", b"\xff\xfe\x00", b"a = 1\na = 2\n", DEEP, LONG])
def test_a_broken_file_is_set_aside_with_a_message(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "settings.toml"
    path.write_bytes(data)
    file = read_settings(path)
    assert file.config == BASE
    (aside,) = asides(tmp_path)
    assert aside.read_bytes() == data
    assert not path.exists()
    (problem,) = file.problems
    assert aside.name in problem
    assert "\n" not in problem


def test_a_broken_file_that_may_not_be_moved_stays(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text("[perception\n", encoding="utf-8")
    assert "is no TOML" in read_settings(path, may_move=False).problems[0]
    assert [file.name for file in tmp_path.iterdir()] == ["study.toml"]


def test_a_limit_of_an_older_file_that_is_too_loose_now_is_not_used_and_told(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    path.write_text("[safety]\nmin_confidence = 0.2\nhealthy_s = 2.0\n", encoding="utf-8")
    file = read_settings(path)
    assert (file.config.safety.min_confidence, file.config.safety.healthy_s) == (0.5, 2.0)
    assert file.problems == (f"{path}: safety.min_confidence: Input should be greater than or equal to 0.5; the default is used",)


def test_a_port_is_not_opened_with_the_packets_of_another_drive() -> None:
    """The package of the drive is gone: nothing else may talk to what is on its port."""
    used, (problem,) = usable_part({"servos": {"driver": "of_a_package_that_is_gone", "port": "/dev/ttyUSB0", "baud": 57600}})
    assert used == {"servos": {"baud": 57600}}
    assert problem.startswith("servos.driver: ") and problem.endswith("no servo port is opened")


def test_what_can_be_used_is_used_and_the_rest_is_told(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    text = (
        "future = 1\n[perception.pose]\nd_allow_px = 9\ntheta_allow_deg = 720\nwhat = 2\n"
        "[safety]\npose_hold_s = 0.15\npose_disarm_s = 0.12\n[servos]\njoints = []\n"
    )
    path.write_text(text, encoding="utf-8")
    file = read_settings(path)
    assert file.config == WIDE
    assert file.text == text
    told = "\n".join(file.problems)
    for words in (
        "future: unknown key, kept but not used",
        "perception.pose.what: unknown key",
        "perception.pose.theta_allow_deg: ",
        "safety: pose_hold_s must be below pose_disarm_s; the default is used",
        "servos.joints: ",
    ):
        assert words in told
    assert path.read_text(encoding="utf-8") == text


def test_an_unreadable_file_is_told_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    path.mkdir()
    file = read_settings(path)
    assert file.config == BASE
    assert "cannot be read" in file.problems[0]
    assert path.is_dir()


def test_the_windows_begin_with_the_users_own_settings_or_a_named_file(tmp_path: Path) -> None:
    assert settings_of_windows().path == own_settings_path()
    assert own_settings_path().name == "settings.toml"
    named = tmp_path / "study.toml"
    named.write_text("[broken", encoding="utf-8")
    assert settings_of_windows(named).problems
    assert named.is_file(), "a named file is never moved"
    assert own_config() == load_config()
