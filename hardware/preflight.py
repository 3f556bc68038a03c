"""Everything that must be right before the bench is used, each with what to do when it is not."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping

from core.config import Config
from hardware.checks import cameras, controls, machine, model, program, servos
from hardware.checks.check import Check

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
        cameras.list_cameras,
        lambda: cameras.check_camera(config),
        lambda: cameras.check_picture(config),
        lambda: servos.check_servo_port(config.servos.port, wanted=config.rig.robot == "servos"),
        lambda: servos.check_servos(config.servos),
        lambda: servos.check_latency(config.servos.port),  # after the driver has had the port open
        lambda: controls.check_pedal(config.pedal),
        lambda: controls.check_gamepad(config.gamepad),
        lambda: machine.check_disk(config.record),
        machine.check_clock,
        machine.check_machine,
    )
    for check in checks:
        yield check()
