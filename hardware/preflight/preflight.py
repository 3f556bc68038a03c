"""The checks before driving in a process of their own: ``python -m hardware.preflight.preflight``, for the window, not for people.

Reads the configuration as JSON from standard input; writes each check as one JSON object a line as soon as it is made.

Everything that must be right before the bench is used, each with what to do when it is not.

The part of the preflight that is looked at before the program may be handed over to, while the rig is open.

What the open rig knows itself better (its camera's pictures, its servos' answers) is not asked for again: their devices are in use.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from enum import StrEnum

from pydantic import ValidationError

from core.config.models import Config
from hardware.preflight import checks as machine
from hardware.preflight import checks as model
from hardware.preflight import checks as program
from hardware.preflight import device_checks
from hardware.preflight.checks import Check

_WRONG_DATE = "the date is wrong"


class Level(StrEnum):
    """How much a check's finding matters to driving."""

    GOOD = "good"
    WARNING = "warning"
    BAD = "not ready"


def driving_checks(config: Config) -> Iterator[Check]:
    """The checks, one by one, each made when it is asked for. Nothing moves, nothing is set, no device in use is opened.

    Takes some seconds, most of them for the self-test of the network.
    """
    checks: tuple[Callable[[], Check], ...] = (
        program.check_packages,
        lambda: model.check_model(config.perception.segmentation.model),
        lambda: model.check_self_test(config.perception),
        lambda: device_checks.check_camera(config),
        lambda: device_checks.check_latency(config.servos.port),
        lambda: device_checks.check_gamepad(config.gamepad),
        lambda: machine.check_disk(config.record),
        machine.check_clock,
        machine.check_machine,
    )
    for check in checks:
        yield check()


_ONLY_WARN = frozenset({"recordings", "cores and memory", "gamepad"})
"""Who can do without: a disk that is nearly full stops a recording, not the robot."""


def level_of(check: Check) -> Level:
    """Whether a finding stands against driving, or only ought to be known."""
    if check.ok:
        return Level.GOOD
    only_warns = check.name in _ONLY_WARN or (check.name == "clock" and _WRONG_DATE in check.detail)
    return Level.WARNING if only_warns else Level.BAD


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


__all__ = ["Check", "run_checks"]


def run_checks(config: Config, environ: Mapping[str, str] | None = None) -> Iterator[Check]:
    """All checks, in an order that makes sense to read; each is made when it is asked for.

    Nothing moves and nothing is set: the servos are asked who and how they are, when a port is configured, and their torque stays
    as it is. A real camera is opened for a moment. Takes some seconds, most of them for the self-test of the network.

    Parameters
    ----------
    config : the rig to check.
    environ : default: the process's own.
    """
    environ = os.environ if environ is None else environ
    checks: tuple[Callable[[], Check], ...] = (
        *program.OF_THE_PROGRAM,
        lambda: program.check_display(environ),
        lambda: model.check_model(config.perception.segmentation.model),
        lambda: model.check_self_test(config.perception),
        device_checks.list_cameras,
        lambda: device_checks.check_camera(config),
        lambda: device_checks.check_picture(config),
        lambda: device_checks.check_servo_port(config.servos.port, wanted=config.rig.robot == "servos"),
        lambda: device_checks.check_servos(config.servos),
        lambda: device_checks.check_latency(config.servos.port),  # after the driver has had the port open
        lambda: device_checks.check_pedal(config.pedal),
        lambda: device_checks.check_gamepad(config.gamepad),
        lambda: machine.check_disk(config.record),
        machine.check_clock,
        machine.check_machine,
    )
    for check in checks:
        yield check()


if __name__ == "__main__":
    sys.exit(main())
