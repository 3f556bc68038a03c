"""The vendor's port and packet handlers with their traps mended (dynamixel-sdk 4.1.0)."""

from __future__ import annotations

import contextlib
import errno
import os
import time

import serial
from dynamixel_sdk import PortHandler, Protocol2PacketHandler

from hardware.servos.errors import PortError, PortTaken

_BODY = 7
"""Where instruction and parameters begin, behind header, id and length."""
_READ_SLICE_S = 0.0005


class LockedPort(PortHandler):  # type: ignore[misc]
    """A serial port that only one program can hold, timed by the monotonic clock."""

    is_open: bool
    _late_bytes: int | None = None
    """What may still be read after the time for an answer is over: what had come by then. None: it is not over."""

    def getCurrentTime(self) -> float:  # noqa: N802 - the vendor's name
        """Milliseconds. The vendor takes the wall clock, which may jump."""
        return time.monotonic() * 1000.0

    def setupPort(self, cflag_baud: int) -> bool:  # noqa: N802
        """Open the port; called by ``openPort`` and ``setBaudRate``.

        Raises
        ------
        PortError
            With the reason and what to do.
        """
        if self.is_open:
            self.closePort()
        try:
            self.ser = serial.Serial(
                port=self.port_name,
                baudrate=self.baudrate,
                bytesize=serial.EIGHTBITS,
                # A short wait instead of the vendor's none: its loop around read() costs 15 % of a core else.
                timeout=_READ_SLICE_S,
                exclusive=True,
            )
        except (serial.SerialException, OSError, ValueError) as error:
            raise _port_error(self.port_name, error) from None
        self.is_open = True
        self.is_using = False
        # Not every port is a USB adapter: a pseudo-terminal has no such mode.
        with contextlib.suppress(ValueError, NotImplementedError):
            self.ser.set_low_latency_mode(True)
        self.ser.reset_input_buffer()
        self.tx_time_per_byte = 10_000.0 / self.baudrate
        return True

    def setPacketTimeout(self, packet_length: int) -> None:  # noqa: N802
        self._late_bytes = None
        super().setPacketTimeout(packet_length)

    def setPacketTimeoutMillis(self, msec: float) -> None:  # noqa: N802
        self._late_bytes = None
        super().setPacketTimeoutMillis(msec)

    def readPort(self, length: int) -> bytes:  # noqa: N802
        """What has come, at most `length` bytes; after the time for an answer only what is in the buffer already.

        The vendor's loop looks at the clock only when too little has come: on a line with noise it would never end, and this
        thread also has to stop the robot. A process that was kept waiting still finds its answer in the buffer.
        """
        if self.getTimeSinceStart() > self.packet_timeout:
            if self._late_bytes is None:
                self._late_bytes = self.ser.in_waiting
            length = min(length, self._late_bytes)
            self._late_bytes -= length
        return bytes(super().readPort(length)) if length > 0 else b""

    def writePort(self, packet: list[int]) -> int:  # noqa: N802
        """Write without waiting: a stuck adapter must not stop the thread that also has to stop the robot.

        pyserial's own write waits for ever, or with a time limit takes a stall of this process for a stuck port.

        Raises
        ------
        OSError
            When the port is gone, or does not take the packet whole though its buffer has room for many.
        """
        written = os.write(self.ser.fileno(), bytes(packet))
        if written != len(packet):
            raise OSError(errno.EIO, "the adapter takes no more bytes")
        return written


class StuffingHandler(Protocol2PacketHandler):  # type: ignore[misc]
    """Sends packets stuffed and reads them unstuffed."""

    def addStuffing(self, packet: list[int]) -> list[int]:  # noqa: N802
        """Stuff in place. The vendor's sender drops the list that the vendor's method returns."""
        packet[:] = super().addStuffing(packet)
        return packet

    def removeStuffing(self, packet: list[int]) -> list[int]:  # noqa: N802
        """Unstuff. The vendor's method compares with bytes that it has already overwritten, after the first FF FF FD FD."""
        end = _BODY + (packet[5] | packet[6] << 8) - 2
        body, kept = packet[_BODY:end], []
        for index, byte in enumerate(body):
            if not (byte == 0xFD and index >= 3 and body[index - 3 : index] == [0xFF, 0xFF, 0xFD]):
                kept.append(byte)
        length = len(kept) + 2
        return [*packet[:5], length & 0xFF, length >> 8, *kept, *packet[end : end + 2]]


def _port_error(port: str, error: Exception) -> PortError:
    code = getattr(error, "errno", None)
    if code == errno.ENOENT:
        return PortError(f"servo port {port} does not exist: plug the USB adapter in, or set servos.port")
    if code in {errno.EACCES, errno.EPERM}:
        return PortError(f"no permission for servo port {port}: add your user to the group dialout, then log in again")
    if code in {errno.EAGAIN, errno.EBUSY}:
        return PortTaken(f"servo port {port} is in use by another program: close that program first")
    if code in {errno.ENODEV, errno.ENXIO, errno.EIO}:
        return PortError(f"servo port {port} has no device behind it: unplug the USB adapter and plug it in again")
    return PortError(f"{port} cannot be used as servo port ({' '.join(str(error).split())}): set servos.port to the USB adapter")
