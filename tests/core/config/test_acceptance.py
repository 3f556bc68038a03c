"""The acceptance of a rig: what is missing, what it no longer holds for, and its file."""

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from core.config.acceptance import (
    Acceptance,
    AcceptanceError,
    AcceptedServo,
    EstopRecord,
    ForceReading,
    StopTimes,
    acceptance_path,
    changes_since,
    force_problem,
    new_acceptance,
    problems_of,
    read_acceptance,
    write_acceptance,
)
from core.config.models import Config, load_config
from core.config.safety import JOINT_NAMES
from core.program import program_version

CONFIG = load_config(
    overrides={
        "rig": {"camera": "webcam", "robot": "servos"},
        "camera": {"device": "/dev/v4l/by-id/cam"},
        "servos": {"port": "/dev/serial/by-id/u2d2"},
    }
)


def accepted_rig(config: Config = CONFIG, **changes: Any) -> Acceptance:
    """A complete acceptance of a configuration."""
    servos = tuple(
        AcceptedServo(name=joint.name, id=joint.id, model=config.servos.model_of(joint).number, firmware=45)
        for joint in config.servos.joints
    )
    forces = tuple(
        ForceReading(name=joint.name, limit_n=joint.max_force_n, read_n=joint.max_force_n) for joint in config.servos.joints
    )
    stops = tuple(
        StopTimes.model_validate({"kind": kind, "joint": "advance", "speed_mm_s": 20.0, "times_ms": (40.0,) * 3, "way_mm": 0.9})
        for kind in ("STOP", "deadman")
    )
    estop = EstopRecord(cause="servo power lost", silent_ms=200.0, refused="no servo answers", refused_after="not zeroed")
    done: dict[str, Any] = {"servos": servos, "supply_v": (11.9, 12.1), "directions": JOINT_NAMES, "forces": forces, "stops": stops}
    return new_acceptance("Ada", config, "cam 1").model_copy(update=done | {"estop": estop} | changes)


def test_a_complete_acceptance_of_an_unchanged_rig_is_valid() -> None:
    accepted = accepted_rig()
    assert accepted.missing == ()
    assert problems_of(accepted, CONFIG, [45] * 7) == ()
    assert accepted.version == program_version() != "0"
    assert accepted.adapter == "/dev/serial/by-id/u2d2"


def test_without_one_nothing_is_accepted() -> None:
    assert problems_of(None, CONFIG) == ("no acceptance is recorded",)
    fresh = new_acceptance("Ada", CONFIG, "")
    assert fresh.missing[:2] == ("servos", "direction of right")
    assert fresh.missing[-3:] == ("STOP times", "deadman times", "E-stop")
    assert len(fresh.missing) == 1 + 7 + 7 + 3


@pytest.mark.parametrize(
    ("changes", "missing"),
    [
        ({"servos": ()}, "servos"),
        ({"supply_v": None}, "servos"),
        ({"directions": JOINT_NAMES[:6]}, "direction of delivery_2"),
        ({"forces": accepted_rig().forces[1:]}, "force of right"),
        ({"stops": accepted_rig().stops[:1]}, "deadman times"),
        ({"estop": None}, "E-stop"),
    ],
)
def test_each_step_that_is_not_done_is_named(changes: dict[str, Any], missing: str) -> None:
    accepted = accepted_rig(**changes)
    assert accepted.missing == (missing,)
    assert problems_of(accepted, CONFIG) == (f"not done: {missing}",)


def _joint(config: Config, place: int, **changes: Any) -> Config:
    joints = list(config.servos.joints)
    joints[place] = joints[place].model_copy(update=changes)
    return config.model_copy(update={"servos": config.servos.model_copy(update={"joints": tuple(joints)})})


def _servos(**changes: Any) -> Config:
    return CONFIG.model_copy(update={"servos": CONFIG.servos.model_copy(update=changes)})


@pytest.mark.parametrize(
    ("config", "problem"),
    [
        (_joint(CONFIG, 2, id=9), "id of up was 3 and is 9"),
        (_joint(CONFIG, 4, sign=-1), "sign of advance was 1 and is -1"),
        (_joint(CONFIG, 0, model=1030), "model of right was 1020 and is 1030"),
        (_joint(CONFIG, 1, mm_per_turn=62.8), "mm_per_turn of left was 40 and is 62.8"),
        (_joint(CONFIG, 5, max_force_n=31.0), "max_force_n of delivery_1 was 30 and is 31"),
        (_joint(CONFIG, 0, high_mm=3.2), "high_mm of right was 2.8 and is 3.2"),
        (_joint(CONFIG, 4, low_mm=-20.0), "low_mm of advance was -5 and is -20"),
        (_joint(CONFIG, 6, max_speed_mm_s=30.0), "max_speed_mm_s of delivery_2 was 20 and is 30"),
        (_joint(CONFIG, 3, max_acceleration_mm_s2=400.0), "max_acceleration_mm_s2 of down was 200 and is 400"),
        (_joint(CONFIG, 1, max_step_mm=0.9), "max_step_mm of left was 0.6 and is 0.9"),
        (_servos(pretension_mm=0.5), "pretension_mm was 0.3 and is 0.5"),
        (_servos(pretension_mm_s=2.0), "pretension_mm_s was 1 and is 2"),
        (_servos(max_pull_mm=2.5), "max_pull_mm was 2 and is 2.5"),
        (_servos(torque_off_on_stop=True), "torque_off_on_stop was False and is True"),
        (_servos(port="/dev/serial/by-id/other"), "adapter was /dev/serial/by-id/u2d2 and is /dev/serial/by-id/other"),
        (CONFIG.model_copy(update={"rig": CONFIG.rig.model_copy(update={"name": "b"})}), f"rig was {CONFIG.rig.name} and is b"),
        (
            CONFIG.model_copy(update={"safety": CONFIG.safety.model_copy(update={"deadman_timeout_s": 0.06})}),
            "deadman_timeout_s was 0.08 and is 0.06",
        ),
    ],
)
def test_what_was_changed_since_is_named(config: Config, problem: str) -> None:
    assert problems_of(accepted_rig(), config) == (problem,)


def test_firmware_counts_where_it_is_known_and_so_does_the_major_version(monkeypatch: pytest.MonkeyPatch) -> None:
    accepted = accepted_rig()
    assert problems_of(accepted, CONFIG, (45, 45, 45, 45, 47, 45, 45)) == ("firmware of advance was 45 and is 47",)
    older = accepted.model_copy(update={"basis": accepted.basis.model_copy(update={"major": "77"})})
    assert changes_since(older, CONFIG) == (f"version of the program was {accepted.version}",)


def test_an_acceptance_of_before_envelopes_and_speeds_were_recorded_is_named() -> None:
    """It opens, and is not taken for one of today's envelopes and speeds."""
    record = accepted_rig().model_dump(mode="json")
    del record["basis"]["limits"], record["basis"]["pull"]
    problems = problems_of(Acceptance.model_validate(record), CONFIG)
    assert problems == ("it does not say with which envelopes, speeds and pull it was made: main.py rig accept NAME",)


def test_a_force_ten_percent_above_the_limit_is_refused() -> None:
    assert force_problem("up", 22.0, 20.0) == ""
    assert "up pulled 22.1 N, at most 22 N" in force_problem("up", 22.1, 20.0)
    with pytest.raises(ValidationError, match="at most 22 N"):
        ForceReading(name="up", limit_n=20.0, read_n=22.1)


def test_a_stop_that_takes_longer_than_the_rules_allow_is_none() -> None:
    with pytest.raises(ValidationError, match="501 ms to stand-still, at most 500 ms"):
        StopTimes(kind="STOP", joint="advance", speed_mm_s=20.0, times_ms=(40.0, 501.0, 40.0), way_mm=3.0)


def test_it_is_kept_beside_the_rig_file_and_the_one_before_too(tmp_path: Path) -> None:
    rig = tmp_path / "bench 1.toml"
    assert read_acceptance(rig) is None
    assert write_acceptance(rig, accepted_rig()) == acceptance_path(rig) == tmp_path / "bench 1.acceptance.json"
    assert read_acceptance(rig) == accepted_rig().model_copy(update={"begun_utc": read_acceptance(rig).begun_utc})
    write_acceptance(rig, accepted_rig(estop=None), keeps_older=True)
    assert (tmp_path / "bench 1.acceptance.older.json").exists()
    assert read_acceptance(rig).estop is None


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("{", "Invalid JSON"),
        (accepted_rig().model_dump_json().replace('"read_n":20.0', '"read_n":200.0', 1), "right pulled 200 N, at most 22 N"),
        (accepted_rig(format=2).model_dump_json(), "format 2 is of a newer version"),
        ("x" * 200_001, "too large"),
    ],
)
def test_a_file_that_cannot_be_used_is_kept_and_named(tmp_path: Path, text: str, problem: str) -> None:
    rig = tmp_path / "bench 1.toml"
    acceptance_path(rig).write_text(text)
    with pytest.raises(AcceptanceError, match=problem):
        read_acceptance(rig)
    assert acceptance_path(rig).read_text() == text
