"""Foot pedal and gamepad, where they are configured."""

from __future__ import annotations

import os
import select
import time

from core.devices import DeviceError
from core.gamepad_config import GamepadConfig
from core.pedal_config import PedalConfig
from hardware.checks.check import NOT_CONFIGURED, Check, one_line

_LISTEN_S = 3.5
"""Opening the port restarts many boards; they talk again after some seconds."""


def check_pedal(config: PedalConfig, listen_s: float = _LISTEN_S) -> Check:
    """The pedal reports, and its STOP is not pressed."""
    name = "foot pedal"
    if config.port is None:
        return Check(name, True, NOT_CONFIGURED)
    try:
        from hardware.servos.pedal_port import open_pedal_port
        from hardware.servos.pedal_protocol import PedalParser

        port = open_pedal_port(config)
    except (ImportError, DeviceError) as error:
        return Check(name, False, one_line(error), "plug the pedal in, set pedal.port (ls /dev/serial/by-id), close other programs")
    parser, heard = PedalParser(), 0
    until_s = time.monotonic() + listen_s
    try:
        poll = select.poll()
        poll.register(port.fd, select.POLLIN)
        while (left_s := until_s - time.monotonic()) > 0.0:
            if not poll.poll(1000.0 * left_s):
                break
            data = port.read()
            heard += len(data)
            for line in parser.feed(data):
                if line is not None and line.stop:
                    return Check(
                        name, False, f"{config.port}: STOP is pressed, or its wire is broken", "release STOP; check its wire"
                    )
                if line is not None:
                    return Check(name, True, f"{config.port} reports; deadman {'pressed' if line.down else 'released'}")
    except DeviceError as error:
        return Check(name, False, one_line(error), "check its USB cable")
    finally:
        port.close()
    if heard:
        return Check(name, False, f"what comes from {config.port} is no pedal's report", "check pedal.port and pedal.baud")
    return Check(name, False, f"{config.port} is silent", "check the pedal's power and firmware, then plug it in again")


def check_gamepad(config: GamepadConfig) -> Check:
    """The configured gamepad is there; without one configured, none is missed."""
    name = "gamepad"
    if not config.enabled:
        return Check(name, True, NOT_CONFIGURED)
    from hardware.gamepad import GamepadError, find_gamepad

    try:
        found = find_gamepad(config)
    except GamepadError as error:
        return Check(name, False, one_line(error), "plug it in, sudo usermod -aG input $USER, or set gamepad.enabled = false")
    if found is None:
        return Check(name, True, f"{NOT_CONFIGURED}; none is plugged in")
    device, title, _ = found
    os.close(device)
    return Check(name, True, title)
