"""The preflight: everything that must be right before the bench is used, in one table, ``CHECKS``.

``python -m hardware.preflight.preflight`` makes the checks before driving in a process of their own, for the window: it reads the
configuration as JSON from standard input, and writes each check as one JSON object a line as soon as it is made.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from enum import StrEnum

from pydantic import ValidationError

from core.config.models import Config
from hardware.preflight import checks, device_checks, model_checks
from hardware.preflight.checks import NOT_CONFIGURED, Check


class Level(StrEnum):
    """How much a check's finding matters to driving."""

    GOOD = "good"
    UNUSED = "not used"
    """Nothing of the kind is configured, so there is nothing to be good."""
    WARNING = "warning"
    BAD = "not ready"


CHECKS: dict[str, tuple[Callable[[Config], Check], Level | None]] = {
    "python": (lambda config: checks.check_python(), None),
    "packages": (lambda config: checks.check_packages(), Level.BAD),
    "system libraries": (lambda config: checks.check_libraries(), None),
    "display": (lambda config: checks.check_display(os.environ), None),
    "model": (lambda config: model_checks.check_model(config.perception.segmentation.model), Level.BAD),
    "self-test": (lambda config: model_checks.check_self_test(config.perception), Level.BAD),
    "driving by program": (device_checks.check_readiness, None),
    "acceptance": (device_checks.check_acceptance, None),
    "cameras found": (lambda config: device_checks.list_cameras(), None),
    "camera": (device_checks.check_camera, Level.BAD),
    "picture": (device_checks.check_picture, None),
    "servo port": (lambda config: device_checks.check_servo_port(config.servos.port, wanted=config.rig.robot == "servos"), None),
    "servos": (lambda config: device_checks.check_servos(config.servos), None),
    "forces": (lambda config: device_checks.check_forces(config.servos), None),
    # after the driver has had the port open
    "adapter latency": (lambda config: device_checks.check_latency(config.servos.port), Level.BAD),
    "bus speed": (lambda config: device_checks.check_bus_speed(config.servos), Level.WARNING),
    "adapter power": (lambda config: device_checks.check_adapter_power(config.servos.port), Level.WARNING),
    "screen lock": (lambda config: device_checks.check_screen_lock(config.rig.robot), Level.WARNING),
    "foot pedal": (lambda config: device_checks.check_pedal(config.pedal), None),
    "gamepad": (lambda config: device_checks.check_gamepad(config.gamepad), Level.WARNING),
    "recordings": (lambda config: checks.check_disk(config.record), Level.WARNING),  # a full disk stops a recording, not the robot
    "clock": (lambda config: checks.check_clock(), Level.WARNING),
    "cores and memory": (lambda config: checks.check_machine(), Level.WARNING),
}
"""By name, in an order that makes sense to read: what makes the check, and what its failure means for driving.

None: it is not made before driving, as it does not matter then, or the open rig has its device in use and knows the answer itself.
"""


def run_checks(config: Config) -> Iterator[Check]:
    """All checks; each is made when it is asked for.

    Nothing moves and nothing is set: the servos are asked who and how they are, when a port is configured, and their torque stays
    as it is. A real camera is opened for a moment. Takes some seconds, most of them for the self-test of the network.
    """
    return (make(config) for make, _ in CHECKS.values())


def driving_checks(config: Config) -> Iterator[Check]:
    """The checks before the program may drive. Nothing moves, nothing is set, no device in use is opened."""
    return (make(config) for make, level in CHECKS.values() if level is not None)


def level_of(check: Check) -> Level:
    """Whether a finding stands against driving, or is only worth knowing."""
    if check.ok:
        return Level.UNUSED if check.detail.startswith(NOT_CONFIGURED) else Level.GOOD
    return (CHECKS[check.name][1] if check.name in CHECKS else None) or Level.BAD


def main() -> int:
    """Returns 2 when the configuration cannot be read."""
    try:
        config = Config.model_validate_json(sys.stdin.read())
    except ValidationError as error:
        sys.stderr.write(f"error: the configuration cannot be read ({error.error_count()} errors)\n")
        return 2
    for check in driving_checks(config):
        sys.stdout.write(json.dumps(check.to_json()) + "\n")
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
