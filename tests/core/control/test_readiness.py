"""What a LIVE rig needs before the program may drive it: each lack by itself, and what a complete rig file gives."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from core.config.acceptance import Acceptance, write_acceptance
from core.config.calibration import DrumsConfig
from core.config.models import Config, load_config
from core.config.rig_file import RigFile, as_calibrated, make_rig, read_rig, with_rig, write_rig
from core.config.safety import TENDONS, wiring_of
from core.control.modes import OF_THE_RIG, Hindrance
from core.control.readiness import READY, Readiness, read_readiness, readiness_of
from core.perception.model_file import ModelInfo, model_folder, read_model_info
from tests.core.config.test_acceptance import accepted_rig

LIVE = load_config(
    overrides={
        "rig": {"name": "lab", "camera": "webcam", "robot": "servos"},
        "camera": {"device": "/dev/v4l/by-id/cam"},
        "servos": {"port": "/dev/serial/by-id/u2d2"},
    }
)
DRUMS = {"tendons_mm": 12.0, "advance_mm": 20.0, "delivery_mm": 15.0}
LIVE = LIVE.model_copy(update={"servos": DrumsConfig.model_validate(DRUMS).applied(LIVE.servos)})
STEERING = {
    "heading_deg": 0.0,
    "roll_deg": 3.0,
    "disagreement_deg": 1.0,
    "turn_deg_per_mm": 38.0,
    "tendons": [{"name": name, "moved_px": 8.0, "px_per_mm": 20.0} for name in TENDONS],
}
SHIPPED = read_model_info(model_folder("default"), verify=())
ACCEPTED = accepted_rig(LIVE)
TAUGHT = SHIPPED.model_copy(update={"name": "mine", "training": {"taught": {"bench": "lab", "frames": 18}}})


def _rig(changes: dict[str, Any] | None = None, **calibration: Any) -> RigFile:
    known = {"made_utc": datetime(2026, 1, 1, tzinfo=UTC), "wiring": wiring_of(LIVE.servos)}
    known |= {"drums": DRUMS, "steering": STEERING} | calibration
    rig = make_rig(LIVE, "lab", None).model_dump() | {"calibration": known, "bench": "/benches/lab", "model": "mine"}
    return RigFile.model_validate(rig | (changes or {}))


def _config(rig: RigFile, overrides: dict[str, Any] | None = None) -> Config:
    config = with_rig(load_config(overrides=overrides), rig, Path("lab.toml"))
    return config.model_copy(update={"perception": config.perception.model_copy(update={"bench": rig.bench})})


def _lacks(rig: RigFile | None, model: ModelInfo | None = TAUGHT, overrides: dict[str, Any] | None = None) -> set[Hindrance]:
    config = _config(rig if rig is not None else _rig(), overrides)
    return set(readiness_of(config, rig, model, ACCEPTED).hindrances)


def test_a_rig_that_was_calibrated_and_taught_is_ready() -> None:
    assert readiness_of(_config(_rig()), _rig(), TAUGHT, ACCEPTED, [45] * 7) == Readiness((), keyboard_deadman=False)


@pytest.mark.parametrize(
    ("calibration", "lack"),
    [
        ({"drums": None}, Hindrance.DRUMS_UNKNOWN),
        ({"drums": {**DRUMS, "advance_mm": 12.0}}, Hindrance.DRUMS_UNKNOWN),  # mm_per_turn was changed by hand since
        ({"wiring": None}, Hindrance.DIRECTIONS_UNKNOWN),
        ({"wiring": ((2, 1), (1, 1), *wiring_of(LIVE.servos)[2:])}, Hindrance.DIRECTIONS_UNKNOWN),
        ({"wiring": (*wiring_of(LIVE.servos)[:4], (5, -1), *wiring_of(LIVE.servos)[5:])}, Hindrance.DIRECTIONS_UNKNOWN),
        ({"steering": None}, Hindrance.STEERING_UNKNOWN),
        ({"steering": {**STEERING, "turn_deg_per_mm": None}}, Hindrance.STEERING_UNKNOWN),  # a file of an earlier version
        ({"steering": {**STEERING, "roll_deg": 180.0}}, Hindrance.STEERING_WRONG),  # right and left swapped, or seen from below
        ({"steering": {**STEERING, "roll_deg": -45.1}}, Hindrance.STEERING_WRONG),
    ],
)
def test_what_was_not_learnt_of_the_servos_is_named(calibration: dict[str, Any], lack: Hindrance) -> None:
    assert _lacks(_rig(**calibration)) == {lack}


def test_a_drive_that_cannot_limit_its_force_is_driven_by_hand_only() -> None:
    config = _config(_rig())
    steppers = config.model_copy(update={"servos": config.servos.model_copy(update={"driver": "stepper board"})})
    assert set(readiness_of(steppers, _rig(), TAUGHT, ACCEPTED).hindrances) == {Hindrance.FORCE_UNLIMITED}


def test_a_roll_of_45_degrees_is_the_most_and_a_model_that_cannot_be_read_is_another_checks_matter() -> None:
    assert _lacks(_rig(steering={**STEERING, "roll_deg": 45.0})) == set()
    assert _lacks(_rig(), None) == set()
    assert READY == Readiness((), keyboard_deadman=True)


def test_what_was_assumed_of_the_directions_is_confirmed_by_the_acceptance_or_in_the_wizard() -> None:
    rig = _rig(assumed=("up", "down"))
    assert _lacks(rig) == set()
    found = set(readiness_of(_config(rig), rig, TAUGHT, None).hindrances)
    assert found == {Hindrance.DIRECTIONS_ASSUMED, Hindrance.NOT_ACCEPTED}


@pytest.mark.parametrize(
    ("rig", "model", "lack"),
    [
        ({}, TAUGHT.model_copy(update={"calibration": None}), Hindrance.MODEL_UNCALIBRATED),
        ({}, TAUGHT.model_copy(update={"familiarity": None}), Hindrance.MODEL_UNCALIBRATED),
        ({"model": None, "bench": None}, SHIPPED, Hindrance.MODEL_UNTAUGHT),
        ({"model": "mine", "bench": None}, TAUGHT, Hindrance.MODEL_UNTAUGHT),
        ({}, SHIPPED, Hindrance.MODEL_UNTAUGHT),
    ],
)
def test_the_model_must_be_calibrated_and_taught_on_this_bench(rig: dict[str, Any], model: ModelInfo, lack: Hindrance) -> None:
    assert _lacks(_rig(rig), model) == {lack}


def test_another_model_than_the_rigs_is_not_the_taught_one() -> None:
    config = _config(_rig())
    segmentation = config.perception.segmentation.model_copy(update={"model": "before"})
    config = config.model_copy(update={"perception": config.perception.model_copy(update={"segmentation": segmentation})})
    assert set(readiness_of(config, _rig(), TAUGHT, ACCEPTED).hindrances) == {Hindrance.MODEL_UNTAUGHT}


@pytest.mark.parametrize("bench", [None, "/benches/other"])
def test_a_model_that_was_taught_on_another_bench_than_the_one_in_force_is_not_the_taught_one(bench: str | None) -> None:
    config = _config(_rig())
    config = config.model_copy(update={"perception": config.perception.model_copy(update={"bench": bench})})
    assert set(readiness_of(config, _rig(), TAUGHT, ACCEPTED).hindrances) == {Hindrance.MODEL_UNTAUGHT}


def test_a_reference_of_pictures_of_another_size_says_nothing() -> None:
    assert _lacks(_rig(), overrides={"perception": {"working_size_px": 512}}) == {Hindrance.MODEL_UNCALIBRATED}


@pytest.mark.parametrize("name", ["random", "push"])
def test_a_policy_that_does_not_look_never_drives(name: str) -> None:
    assert _lacks(_rig(), overrides={"policy": {"name": name}}) == {Hindrance.POLICY_BLIND}
    assert _lacks(_rig(), overrides={"policy": {"name": "table"}}) == set()


@pytest.mark.parametrize("quality", [{"enabled": False}, {"max_novelty": 1.3}])
def test_perceptions_own_checks_must_be_on(quality: dict[str, Any]) -> None:
    assert _lacks(_rig(), overrides={"perception": {"quality": quality}}) == {Hindrance.CHECKS_OFF}


def test_without_a_rig_file_nothing_was_learnt() -> None:
    unknown = {Hindrance.DRUMS_UNKNOWN, Hindrance.DIRECTIONS_UNKNOWN, Hindrance.STEERING_UNKNOWN}
    assert _lacks(None) == unknown | {Hindrance.MODEL_UNTAUGHT}
    assert not readiness_of(LIVE, None, TAUGHT, ACCEPTED).keyboard_deadman


@pytest.mark.parametrize(
    ("accepted", "firmware", "lack"),
    [
        (None, (), Hindrance.NOT_ACCEPTED),
        (accepted_rig(LIVE, estop=None), (), Hindrance.NOT_ACCEPTED),
        (ACCEPTED, (45, 45, 45, 45, 45, 45, 46), Hindrance.ACCEPTANCE_OUTDATED),
        (accepted_rig(LIVE, basis=ACCEPTED.basis.model_copy(update={"major": "77"})), (), Hindrance.ACCEPTANCE_OUTDATED),
    ],
)
def test_a_rig_that_was_not_accepted_as_it_is_stays_advisory(
    accepted: Acceptance | None, firmware: tuple[int, ...], lack: Hindrance
) -> None:
    assert readiness_of(_config(_rig()), _rig(), TAUGHT, accepted, firmware).hindrances == (lack,)
    assert lack in OF_THE_RIG


def test_every_lack_is_one_of_the_rig() -> None:
    rig = _rig({"model": None}, drums=None, wiring=None, steering=None)
    overrides = {"policy": {"name": "push"}, "perception": {"quality": {"enabled": False}}}
    assert _lacks(rig, SHIPPED, overrides) <= OF_THE_RIG


@pytest.mark.usefixtures("own_folder")
def test_the_keyboard_is_a_deadman_where_the_rig_file_says_so(tmp_path: Path) -> None:
    path = write_rig(_rig({"model": None, "bench": None}), tmp_path / "lab.toml")
    config = as_calibrated(with_rig(load_config(), read_rig(path), path))
    assert not read_readiness(config).keyboard_deadman
    path.write_text(path.read_text().replace("keyboard_deadman = false", "keyboard_deadman = true"))
    assert read_readiness(config).keyboard_deadman
    assert set(read_readiness(config).hindrances) == {Hindrance.MODEL_UNTAUGHT, Hindrance.NOT_ACCEPTED}
    write_acceptance(path, accepted_rig(config))
    assert set(read_readiness(config).hindrances) == {Hindrance.MODEL_UNTAUGHT}
    assert set(read_readiness(config, (46,) * 7).hindrances) == {Hindrance.MODEL_UNTAUGHT, Hindrance.ACCEPTANCE_OUTDATED}
    again = make_rig(config, "lab", read_rig(path).calibration)
    assert again.keyboard_deadman, "a rig that is calibrated again keeps it"
