"""The serial port of a foot pedal: opening, locking, reading, and what can go wrong, each with one line that says what to do."""

from __future__ import annotations

import contextlib
import errno
import os
import termios

import serial

from core.devices import DeviceError
from core.pedal_config import PedalConfig

_CHUNK = 4096


class PedalError(DeviceError):
    """Root of the foot pedal's errors."""


class PedalPortError(PedalError):
    """The port cannot be opened."""


class PedalPortTaken(PedalPortError):
    """Another program holds the port."""


class PedalLost(PedalError):
    """The port vanished while it was open."""


class PedalUnheard(PedalError):
    """The port is open, and no report comes."""


class PedalPort:
    """An open serial port that only this program holds. Made by ``open_pedal_port``."""

    def __init__(self, name: str, port: serial.Serial) -> None:
        self.name = name
        self._port = port
        self.fd: int = port.fileno()

    def read(self) -> bytes:
        """What has come; at least one byte when the port is readable.

        Raises
        ------
        PedalLost
            An adapter that was pulled out reads as an error, or as readable without a byte.
        """
        try:
            data = os.read(self.fd, _CHUNK)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise PedalLost(f"the pedal at {self.name} is gone ({error.strerror}): plug its USB cable in") from None
        if not data:
            raise PedalLost(f"the pedal at {self.name} is gone: plug its USB cable in")
        return data

    def close(self) -> None:
        """Give the port back at once: a plug that comes back while it is held gets another name. Never fails."""
        with contextlib.suppress(OSError, termios.error):  # a vanished port raises termios.error, which is no OSError
            self._port.close()


def open_pedal_port(config: PedalConfig) -> PedalPort:
    """Open and lock the pedal's port; what has come before is dropped.

    Raises
    ------
    PedalPortError
        None set, missing, not permitted, not a serial port, not this speed; ``PedalPortTaken`` when another program holds it.
    """
    if config.port is None:
        raise PedalPortError("no pedal is configured: set pedal.port to its path in /dev/serial/by-id")
    try:
        port = serial.Serial(config.port, config.baud, timeout=0, exclusive=True)
    except (OSError, ValueError, termios.error) as error:  # SerialException is an OSError
        raise _port_error(config, error) from None
    # An FTDI chip keeps bytes back for 16 ms otherwise. Not every port is one: a pseudo-terminal has no such mode.
    with contextlib.suppress(ValueError, NotImplementedError, OSError):
        port.set_low_latency_mode(True)
    return PedalPort(config.port, port)


def _port_error(config: PedalConfig, error: Exception) -> PedalPortError:
    port, code = config.port, getattr(error, "errno", None)
    if code == errno.ENOENT:
        return PedalPortError(f"pedal port {port} does not exist: plug the pedal in, or set pedal.port")
    if code in {errno.EACCES, errno.EPERM}:
        return PedalPortError(f"no permission for pedal port {port}: add your user to the group dialout, then log in again")
    if code in {errno.EAGAIN, errno.EBUSY}:
        return PedalPortTaken(
            f"pedal port {port} is in use by another program, or by the servos: close it there, or set pedal.port"
        )
    if code in {errno.ENODEV, errno.ENXIO, errno.EIO}:
        return PedalPortError(f"pedal port {port} has no device behind it: unplug the pedal and plug it in again")
    reason = " ".join(str(error).split())[:120]
    return PedalPortError(f"{port} cannot be used as pedal port at {config.baud} baud ({reason}): set pedal.port and pedal.baud")
