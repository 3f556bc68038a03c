"""The servo port, the servos behind it, and the adapter's latency. Only looks: no torque, no goal, no setting is ever written."""

from __future__ import annotations

import errno
import fcntl
import grp
import os
import stat
from collections.abc import Sequence
from pathlib import Path

from core.servo_config import ServosConfig
from hardware.checks.check import NOT_CONFIGURED, RENEW, Check, one_line
from hardware.usb import SYS, latency_timer

_MAX_LATENCY_MS = 2
_TORQUE, _ERROR, _VOLTAGE = 64, 70, 144


def check_servo_port(port: str | None, *, wanted: bool = False) -> Check:
    """There, permitted, a serial port, and no other program on it; `wanted` by a rig with servos."""
    name = "servo port"
    if port is None and wanted:
        return Check(name, False, "the rig has servos, but no port", "set servos.port (ls /dev/serial/by-id)")
    if port is None:
        return Check(name, True, NOT_CONFIGURED)
    path = Path(port)
    try:
        mode = path.stat().st_mode
    except OSError as error:
        reason = "is not there" if error.errno in {errno.ENOENT, errno.ENOTDIR} else f"cannot be seen ({error.strerror})"
        return Check(name, False, f"{port} {reason}", "plug the USB adapter in, or set servos.port (ls /dev/serial/by-id)")
    if not stat.S_ISCHR(mode):
        return Check(name, False, f"{port} is no serial port", "set servos.port (ls /dev/serial/by-id)")
    if not os.access(path, os.R_OK | os.W_OK):
        return Check(name, False, f"no permission for {port} (group {_group(path)})", _join(_group(path)))
    return _check_lock(name, port)


def _check_lock(name: str, port: str) -> Check:
    try:
        handle = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        busy = error.errno == errno.EBUSY
        fix = f"close the program that has it (fuser -v {port})" if busy else "unplug the USB adapter and plug it in again"
        return Check(name, False, f"{port} cannot be opened ({error.strerror})", fix)
    try:
        if not os.isatty(handle):
            return Check(name, False, f"{port} is no serial port", "set servos.port (ls /dev/serial/by-id)")
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        fix = f"close the program that has it (fuser -v {port}); it may be LumenPilot itself"
        return Check(name, False, f"{port} is in use by another program", fix)
    finally:
        os.close(handle)
    target = os.path.realpath(port)
    return Check(name, True, f"{port} is free" + (f" ({target})" if target != port else ""))


def _group(path: Path) -> str:
    number = path.stat().st_gid
    try:
        return grp.getgrgid(number).gr_name
    except KeyError:
        return str(number)


def _join(group: str) -> str:
    """What makes the port permitted for good. Root's own group is a port that udev has not seen."""
    return f"sudo usermod -aG {'dialout' if group in {'root', '0'} else group} $USER, then log in again"


def check_servos(config: ServosConfig) -> Check:
    """All seven answer, are the configured model, and report no trouble."""
    name = "servos"
    if config.port is None:
        return Check(name, True, NOT_CONFIGURED)
    try:
        from hardware.servos.errors import PortError, ServoError
        from hardware.servos.line import ServoLine
        from hardware.servos.setup import identify
    except ImportError as error:
        return Check(name, False, one_line(error), RENEW)
    line = ServoLine(config.port, config.baud)
    try:
        line.open()
        found = identify(line, config)
        readings = [
            (joint.name, *_reading(line.read(joint.id, _TORQUE, 7), line.read(joint.id, _VOLTAGE, 3))) for joint in config.joints
        ]
    except PortError as error:
        return Check(name, False, f"not asked: {one_line(error)}", "see the servo port")
    except ServoError as error:
        return Check(name, False, one_line(error), "switch the servos' 12 V on, check the cables, servos.baud and the joints' ids")
    finally:
        line.close()
    firmware = sorted({identity.firmware for identity in found})
    return _judge(name, config, readings, f"{len(found)} answer, model {config.model}, firmware {', '.join(map(str, firmware))}")


def _reading(status: bytes, supply: bytes) -> tuple[bool, int, float, float]:
    """Torque, hardware error, volts, degrees Celsius from registers 64 to 70 and 144 to 146."""
    return status[0] == 1, status[_ERROR - _TORQUE], int.from_bytes(supply[:2], "little") / 10.0, float(supply[2])


def _judge(name: str, config: ServosConfig, readings: Sequence[tuple[str, bool, int, float, float]], what: str) -> Check:
    from hardware.servos.status_block import HardwareError, describe

    volts, degrees = min(reading[3] for reading in readings), max(reading[4] for reading in readings)
    torque = [reading[0] for reading in readings if reading[1]]
    torque_text = f"torque on: {', '.join(torque)}" if torque else "torque off"
    detail = f"{what}; {volts:.1f} V at least, {degrees:.0f} \N{DEGREE SIGN}C at most, {torque_text}"
    if broken := [f"{reading[0]}: {describe(HardwareError(reading[2]))}" for reading in readings if reading[2]]:
        fix = "find the reason (jam, heat, supply), then restart that servo in the servo table"
        return Check(name, False, f"hardware error, {'; '.join(broken)}", fix)
    if volts < config.min_voltage_v:
        return Check(name, False, detail, f"the supply must give {config.min_voltage_v:g} V or more at every servo")
    if degrees > config.max_temperature_c:
        return Check(name, False, detail, f"let it cool below {config.max_temperature_c:g} \N{DEGREE SIGN}C")
    return Check(name, True, detail)


def check_latency(port: str | None, sys: Path = SYS) -> Check:
    """How long an FTDI adapter keeps bytes back. The driver sets it when it opens the port, so it is looked at after that."""
    name = "adapter latency"
    if port is None:
        return Check(name, True, NOT_CONFIGURED)
    timer = latency_timer(Path(port), sys)
    if timer is None:
        return Check(name, True, f"{port} has no latency timer to set")
    try:
        latency_ms = int(timer.read_text(encoding="ascii"))
    except (OSError, ValueError) as error:
        return Check(name, False, f"{timer} cannot be read ({one_line(error)})", "unplug the USB adapter and plug it in again")
    detail = f"{latency_ms} ms ({timer})"
    if latency_ms > _MAX_LATENCY_MS:
        return Check(name, False, f"{detail}: the bus needs 1 ms for 50 cycles a second", f"echo 1 | sudo tee {timer}")
    return Check(name, True, detail)
