"""The part of the preflight that is looked at before the program may be handed over to, while the rig is open.

What the open rig knows itself better (its camera's pictures, its servos' answers) is not asked for again: their devices are in use.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import StrEnum

from core.config import Config
from hardware.checks import cameras, controls, machine, model, program, servos
from hardware.checks.check import Check

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
        lambda: cameras.check_camera(config),
        lambda: servos.check_latency(config.servos.port),
        lambda: controls.check_gamepad(config.gamepad),
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
