"""What can go wrong on the servo bus, each with one line that says what to do."""

from __future__ import annotations

from core.devices import DeviceError


class ServoError(DeviceError):
    """Root of the servo bus's errors."""


class PortError(ServoError):
    """The serial port cannot be opened."""


class PortTaken(PortError):
    """Another program holds the port."""


class PortLost(ServoError):
    """The port vanished while it was open. The driver has closed it; ``open`` starts anew, disarmed and without zeros."""


class NoAnswer(ServoError):
    """A servo, or all of them, did not answer a request."""


class WrongServo(ServoError):
    """A servo is not the one that the configuration names, or cannot be set up as needed."""


class Refused(ServoError):
    """A servo answered a write with an error."""


class NotReady(ServoError):
    """Something has to be done first: open, zero or arm."""


class TorqueStillOn(ServoError):
    """The torque could not be proven to be off."""


class BusProcessLost(ServoError):
    """The process that owns the servo bus cannot be started, is gone, or does not answer."""
