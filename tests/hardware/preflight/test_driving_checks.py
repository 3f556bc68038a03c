"""What is looked at before the program may be handed over to, and what of it stands against driving."""

from __future__ import annotations

import pytest

from core.config.models import Config
from hardware.preflight.checks import Check
from hardware.preflight.preflight import Level, driving_checks, level_of


@pytest.mark.parametrize(
    ("name", "detail", "level"),
    [
        ("model", "network.onnx: SHA-256 differs", Level.BAD),
        ("self-test", "gives no pose", Level.BAD),
        ("camera", "USB 2", Level.BAD),
        ("adapter latency", "16 ms", Level.BAD),
        ("packages", "numpy 1 instead of 2", Level.BAD),
        ("clock", "monotonic, now 1970-01-01 00:00 UTC: the date is wrong, and sessions are named by it", Level.WARNING),
        ("recordings", "0.1 GB free", Level.WARNING),
        ("cores and memory", "1 core", Level.WARNING),
        ("gamepad", "no permission", Level.WARNING),
    ],
)
def test_only_what_driving_needs_stands_against_it(name: str, detail: str, level: Level) -> None:
    assert level_of(Check(name, False, detail, "mend it")) is level
    assert level_of(Check(name, True, "as it should be")) is Level.GOOD


def test_a_damaged_model_and_a_lost_camera_are_found_without_opening_any_device() -> None:
    config = Config.model_validate(
        {
            "perception": {"segmentation": {"model": "no_such_model"}},
            "rig": {"camera": "webcam", "robot": "none"},
            "camera": {"device": "/dev/no_such_camera"},
            "servos": {"port": "/dev/no_such_port"},
        }
    )
    found = {check.name: check for check in driving_checks(config)}
    assert {"model", "self-test", "camera", "recordings", "clock"} <= found.keys()
    assert not {"picture", "servos", "servo port", "foot pedal"} & found.keys(), "the open rig has these in use"
    for name in ("model", "self-test", "camera"):
        assert level_of(found[name]) is Level.BAD
        assert found[name].fix
