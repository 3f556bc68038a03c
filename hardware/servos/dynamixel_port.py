"""The servo line: the vendor's port and packet handlers with their traps mended (dynamixel-sdk 4.1.0), and typed errors.

One thread owns a line. A request ends in bounded time with the bytes, or with an error that says in one line what to do.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import termios
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import StrEnum

import serial
from dynamixel_sdk import (
    BROADCAST_ID,
    COMM_RX_CORRUPT,
    COMM_RX_TIMEOUT,
    COMM_SUCCESS,
    GroupSyncWrite,
    PortHandler,
    Protocol2PacketHandler,
)

from core.devices import DeviceError
from hardware.processes import holders
from hardware.servos.registers import TAG_BYTES


class ServoError(DeviceError):
    """Root of the servo bus's errors."""


class PortError(ServoError):
    """The serial port cannot be opened."""


class PortTaken(PortError):
    """Another program holds the port."""


class PortLost(ServoError):
    """The port vanished while it was open. The driver has closed it; ``open`` starts again, disarmed and without zeros."""


class NoAnswer(ServoError):
    """A servo, or all of them, did not answer a request."""


class WrongServo(ServoError):
    """A servo is not the one that the configuration names, or cannot be set up as needed."""


class WriteRefused(ServoError):
    """A servo answered a write with an error."""


class NotReady(ServoError):
    """Something has to be done first: open, zero or arm."""


class TorqueStillOn(ServoError):
    """The torque could not be proven to be off."""


class StoppedMeanwhile(ServoError):
    """STOP came, or the application went, between two transactions of a request; what it had switched on is off again."""


class BusProcessLost(ServoError):
    """The process that owns the servo bus cannot be started, is gone, or does not answer."""


_BODY = 7
"""Where instruction and parameters begin, behind header, id and length."""
_CRC_BYTES = 2
"""At the end of a packet."""
_READ_SLICE_S = 0.0005


class LockedPort(PortHandler):  # type: ignore[misc]
    """A serial port that only one program can hold, timed by ``now_s``, the monotonic clock.

    Programs that ask for the lock (flock) are refused by it, all others by the terminal's exclusive mode: while it is on, the
    system refuses every further ``open``, but for those of root. One that had the port open before is looked for.
    """

    is_open: bool
    now_s: Callable[[], float] = staticmethod(time.monotonic)
    _late_bytes: int | None = None
    """What may still be read after the time for an answer is over: what had come by then. None: it is not over."""

    def getCurrentTime(self) -> float:  # noqa: N802 - the vendor's name
        """Milliseconds. The vendor takes the wall clock, which may jump."""
        return self.now_s() * 1000.0

    def setupPort(self, cflag_baud: int) -> bool:  # noqa: N802
        """Open the port; called by ``openPort`` and ``setBaudRate``. Raises PortError."""
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
            fcntl.ioctl(self.ser.fileno(), termios.TIOCEXCL)
        except (serial.SerialException, OSError, ValueError) as error:
            raise _port_error(self.port_name, error) from None
        self.is_open = True
        if holders(self.port_name):
            self.closePort()
            raise _port_taken(self.port_name)
        self.is_using = False
        # Not every port is a USB adapter: a pseudo-terminal has no such mode.
        with contextlib.suppress(ValueError, NotImplementedError):
            self.ser.set_low_latency_mode(True)
        self.ser.reset_input_buffer()
        self.tx_time_per_byte = 10_000.0 / self.baudrate
        return True

    def closePort(self) -> None:  # noqa: N802
        """Give the port back. A terminal that another program keeps open would stay exclusive."""
        try:
            with contextlib.suppress(OSError, termios.error):
                fcntl.ioctl(self.ser.fileno(), termios.TIOCNXCL)
        finally:
            super().closePort()

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

        Raises OSError: when the port is gone, or does not take the packet whole though its buffer has room for many.
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
        return PortError("servo port {port} does not exist: plug the USB adapter in, or set servos.port", port=port)
    if code in {errno.EACCES, errno.EPERM}:
        return PortError("no permission for servo port {port}: add your user to the group dialout, then log in again", port=port)
    if code in {errno.EAGAIN, errno.EBUSY}:
        return _port_taken(port)
    if code in {errno.ENODEV, errno.ENXIO, errno.EIO}:
        return PortError("servo port {port} has no device behind it: unplug the USB adapter and plug it in again", port=port)
    return PortError(
        "{port} cannot be used as servo port ({why}): set servos.port to the USB adapter",
        port=port,
        why=" ".join(str(error).split()),
    )


def _port_taken(port: str) -> PortTaken:
    """Names the programs that hold the port, as far as the system shows them to this user."""
    if who := ", ".join(holders(port)):
        return PortTaken("servo port {port} is in use by another program, {who}: close that program first", port=port, who=who)
    return PortTaken("servo port {port} is in use by another program: close that program first", port=port)


LATE_S = 0.04
"""An answer may come so much later than the request that gave up on it; a request before would take it for its own."""
ALERT_BIT = 0x80
_ERROR_TEXT = {
    1: "could not process it",
    2: "does not know the instruction",
    3: "received it damaged",
    4: "refused the value (bus watchdog tripped, or value out of range)",
    5: "refused its length",
    6: "refused the value as beyond its limits",
    7: "refused the access (torque on, or read-only)",
}
_STATUS_BODY = 9
"""Where a status packet's data begin: header, id, length, instruction, error."""
_ATTEMPTS = 3
_LONGEST_LINE = 1024
"""Bytes of a line of text; more without an end is noise."""
_PAUSE_SLICE_S = 0.01
"""Longest sleep of the line between two looks for STOP."""


class Miss(StrEnum):
    """Why a request has no answer."""

    SILENT = "no answer"
    CORRUPT = "damaged answer"
    WAITING = "a late answer may still come"
    BEHIND = "no answer, behind two silent servos"


@dataclass(slots=True)
class LineCounts:
    """What went wrong since the line was opened."""

    silent: int = 0
    corrupt: int = 0
    late: int = 0
    retries: int = 0


@dataclass(frozen=True, slots=True)
class GroupAnswer:
    """Data by id and reason by id of those without; every id asked for is in one of them."""

    data: dict[int, bytes]
    missed: dict[int, Miss]


@dataclass(slots=True)
class _Round:
    """One group request, and its answers so far."""

    waiting: list[int]
    length: int
    data: dict[int, bytes] = field(default_factory=dict)
    corrupt: int = 0


class ServoLine:
    """The port with the packet handler. All methods but the constructor raise ``PortLost`` when the port vanishes.

    ``interruptible`` lets a check raise between two transactions. `now_s` is the clock of the answers.
    """

    def __init__(self, port: str, baud: int, now_s: Callable[[], float] = time.monotonic) -> None:
        self.port, self.baud, self._now_s = port, baud, now_s
        self.counts = LineCounts()
        self._port: LockedPort | None = None
        self._handler = StuffingHandler()
        self._quiet_until: dict[int, float] = {}
        self._owner: int | None = None
        self._check: Callable[[], None] | None = None

    @contextlib.contextmanager
    def interruptible(self, check: Callable[[], None] | None) -> Iterator[None]:
        """While inside, `check` is called before every transaction and in every pause, and may raise.

        Once it has raised it is not called again: what was begun can be undone.
        """
        self._check = check
        try:
            yield
        finally:
            self._check = None

    def check(self) -> None:
        """Raises what the check of ``interruptible`` raises."""
        check, self._check = self._check, None
        if check is not None:
            check()
            self._check = check

    def pause(self, seconds: float) -> None:
        """Sleep, with checks meanwhile."""
        until_s = time.monotonic() + seconds
        while (left_s := until_s - time.monotonic()) > 0.0:
            self.check()
            time.sleep(min(left_s, _PAUSE_SLICE_S))

    @property
    def is_open(self) -> bool:
        return self._port is not None

    def open(self) -> None:
        """Open and lock the port.

        Raises PortError: missing, not permitted, not a serial port, not this speed; ``PortTaken`` when another program holds it.
        """
        self.close()
        port = LockedPort(self.port)
        port.now_s = self._now_s
        try:
            if not port.setBaudRate(self.baud):
                raise PortError(f"servos.baud {self.baud} is not a speed of these servos: use 57600, 115200, 1000000, 2000000 ...")
        except (OSError, termios.error) as error:
            with contextlib.suppress(OSError, termios.error, AttributeError):
                port.closePort()
            raise PortError(
                "servo port {port} vanished while it was opened ({why}): check the USB cable", port=self.port, why=error
            ) from None
        self._port, self._owner = port, threading.get_ident()
        self.counts = LineCounts()
        self._quiet_until.clear()

    def close(self) -> None:
        """Give the port back; never fails, and may be called twice."""
        port, self._port = self._port, None
        if port is not None:
            # A vanished port raises termios.error, which is no OSError.
            with contextlib.suppress(OSError, termios.error):
                port.closePort()

    @contextlib.contextmanager
    def _exchange(self) -> Iterator[LockedPort]:
        """The open port for one request. Whatever happens, its busy flag is reset, and a lost port is closed."""
        port = self._port
        if port is None:
            raise NotReady("the servo port is not open: open it first")
        if threading.get_ident() != self._owner:
            raise RuntimeError("the servo line belongs to the thread that opened it")
        self.check()
        try:
            yield port
        except (OSError, termios.error) as error:  # SerialException is an OSError, termios.error is not
            self.close()
            reason = " ".join(str(error).split())[:80]
            raise PortLost(
                "servo port {port} is lost ({why}): check the USB cable, then connect again", port=self.port, why=reason
            ) from None
        finally:
            port.is_using = False

    def ask(self, line: bytes, timeout_s: float) -> bytes | None:
        """A line of text, and the one that comes back, for drives that talk in lines; None when none is whole in time."""
        with self._exchange() as port:
            port.ser.reset_input_buffer()
            port.writePort(list(line))
            until_s, answer = time.monotonic() + timeout_s, b""
            while not answer.endswith(b"\n"):
                if time.monotonic() > until_s and not port.ser.in_waiting:
                    return None
                answer += port.ser.read(max(1, min(_LONGEST_LINE, port.ser.in_waiting)))
                if len(answer) > _LONGEST_LINE:
                    return None
            return answer

    def ping(self, servo_id: int) -> int | None:
        """Model number, or None without a (whole) answer."""
        self._let_late_answers_pass(servo_id)
        with self._exchange() as port:
            try:
                model, result, _ = self._handler.ping(port, servo_id)
            except IndexError:
                self.counts.corrupt += 1
                return None
        self._note(servo_id, result)
        return int(model) if result == COMM_SUCCESS else None

    def others(self) -> list[int]:
        """Ids of all servos that answer a broadcast ping; takes 0.8 s at 1 Mbps, so only for error messages."""
        with self._exchange() as port:
            try:
                found, _ = self._handler.broadcastPing(port)
            except IndexError:  # a damaged answer
                return []
        return sorted(found)

    def read(self, servo_id: int, address: int, length: int) -> bytes:
        """`length` bytes of the control table; two retries. Raises NoAnswer, WriteRefused.

        Three bytes are asked for at least: of an answer without data the vendor's handler takes the two bytes of its CRC for them.
        """
        asked = max(length, _CRC_BYTES + 1)
        data, error = self._request(servo_id, lambda port: self._handler.readTxRx(port, servo_id, address, asked), asked)
        if error & ~ALERT_BIT:
            raise WriteRefused(f"servo {servo_id} answered a read of register {address}: it {_error_text(error)}")
        return data[:length]

    def write(self, servo_id: int, address: int, data: bytes) -> None:
        """Write and wait for the servo's consent; two retries (a register write may be repeated). NoAnswer, WriteRefused."""

        def once(port: LockedPort) -> tuple[list[int], int, int]:
            result, error = self._handler.writeTxRx(port, servo_id, address, len(data), list(data))
            return [], result, error

        _, error = self._request(servo_id, once, 0)
        if error & ~ALERT_BIT:
            raise WriteRefused(f"servo {servo_id} did not take a write of register {address}: it {_error_text(error)}")

    def reboot(self, servo_id: int) -> None:
        """Restart a servo. Its answer is not waited for twice: a second request would restart it again."""
        self._let_late_answers_pass(servo_id)
        with self._exchange() as port, contextlib.suppress(IndexError):
            self._handler.reboot(port, servo_id)

    def write_unanswered(self, servo_id: int, address: int, data: bytes) -> None:
        """Write to a servo whose status return level lets it give no answer; read what was taken."""
        with self._exchange() as port:
            self._handler.writeTxOnly(port, servo_id, address, len(data), list(data))

    def broadcast(self, address: int, data: bytes) -> None:
        """Write to all servos in one packet, which has no answer."""
        with self._exchange() as port:
            self._handler.writeTxOnly(port, BROADCAST_ID, address, len(data), list(data))

    def group_write(self, address: int, data: dict[int, bytes]) -> None:
        """One packet with a register for each id; it has no answer, so read what was taken."""
        length = len(next(iter(data.values())))
        with self._exchange() as port:
            group = GroupSyncWrite(port, self._handler, address, length)
            for servo_id, value in data.items():
                group.addParam(servo_id, list(value))
            group.txPacket()

    def group_read(self, ids: list[int], address: int, length: int) -> GroupAnswer:
        """`length` bytes of each servo, in one request; at most two silences (35 ms each) are waited for, and one retry is made.

        A silent servo may also silence those after it in the list: the rest is asked again without it. A servo that was silent is
        left alone until its answer cannot come any more.
        """
        now = self._now_s()
        data: dict[int, bytes] = {}
        missed = {i: Miss.WAITING for i in ids if self._quiet_until.get(i, 0.0) > now}
        rest = [i for i in ids if i not in missed]
        silences = retries = 0
        while rest:
            round_ = self._group_round(rest, address, length)
            data.update(round_.data)
            rest = [i for i in rest if i not in round_.data]
            if rest and round_.corrupt:
                self.counts.corrupt += round_.corrupt
                if retries:
                    missed.update(dict.fromkeys(rest, Miss.CORRUPT))
                    break
                retries += 1
                self.counts.retries += 1
            elif rest:
                missed[rest[0]] = Miss.SILENT
                self._note(rest.pop(0), COMM_RX_TIMEOUT)
                silences += 1
                if silences == 2:
                    for servo_id in rest:
                        missed[servo_id] = Miss.BEHIND
                        self._note(servo_id, COMM_RX_TIMEOUT)
                    break
        return GroupAnswer(data, missed)

    def _group_round(self, ids: list[int], address: int, length: int) -> _Round:
        """Ask once and take what comes, until all have answered, or none comes any more.

        After a damaged answer the others are still taken: asking again at once would talk into them.
        """
        turn = _Round(list(ids), length)
        with self._exchange() as port:
            if self._handler.syncReadTx(port, address, length, turn.waiting, len(ids), False) != COMM_SUCCESS:
                return turn
            # The vendor's group read drops the error byte, stops at the first fault, and then reads as 0.
            while len(turn.data) + turn.corrupt < len(ids):
                try:
                    packet, result = self._handler.rxPacket(port, False)
                except IndexError:
                    turn.corrupt += 1
                    continue
                if result == COMM_RX_TIMEOUT:
                    break
                if result == COMM_SUCCESS:
                    self._take(turn, packet)
                else:
                    turn.corrupt += 1
        return turn

    def _take(self, turn: _Round, packet: list[int]) -> None:
        servo_id, data = packet[4], packet[_STATUS_BODY:-2]
        if servo_id not in turn.waiting or servo_id in turn.data:
            self.counts.late += 1
        elif packet[8] & ~ALERT_BIT or len(data) < turn.length - TAG_BYTES:
            turn.corrupt += 1
        elif len(data) != turn.length:
            self.counts.late += 1  # an answer to an earlier request: those ask for other lengths
        else:
            turn.data[servo_id] = bytes(data)

    def _request(self, servo_id: int, ask: Callable[[LockedPort], tuple[list[int], int, int]], length: int) -> tuple[bytes, int]:
        """A single servo's `length` bytes and error byte, asked for at most three times: these are not urgent."""
        miss = Miss.SILENT
        for attempt in range(_ATTEMPTS):
            self.counts.retries += attempt > 0
            self._let_late_answers_pass(servo_id)
            with self._exchange() as port:
                try:
                    data, result, error = ask(port)
                except IndexError:
                    data, result, error = [], COMM_RX_CORRUPT, 0
            if result == COMM_SUCCESS and (len(data) == length or error & ~ALERT_BIT):
                return bytes(data), error
            result = COMM_RX_CORRUPT if result == COMM_SUCCESS else result
            self._note(servo_id, result)
            miss = Miss.SILENT if result == COMM_RX_TIMEOUT else Miss.CORRUPT
        raise NoAnswer(
            "servo {a}: {miss}, {b} times: check its supply and cable, and that no two servos have the same id",
            a=servo_id,
            miss=miss,
            b=_ATTEMPTS,
        )

    def _note(self, servo_id: int, result: int) -> None:
        if result == COMM_RX_TIMEOUT:
            self.counts.silent += 1
            self._quiet_until[servo_id] = self._now_s() + LATE_S
        elif result != COMM_SUCCESS:
            self.counts.corrupt += 1

    def _let_late_answers_pass(self, servo_id: int) -> None:
        """Before a single request: the sender drops what has come until then."""
        self.pause(self._quiet_until.get(servo_id, 0.0) - self._now_s())


def _error_text(error: int) -> str:
    return _ERROR_TEXT.get(error & ~ALERT_BIT, f"answered with error {error & ~ALERT_BIT}")
