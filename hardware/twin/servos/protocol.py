"""DYNAMIXEL Protocol 2.0 (header, stuffing, length, CRC) and the used part of the control table of an X servo (XM430).

Written from the protocol's description (Robotis e-Manual), not from the vendor's SDK, so that driver and twin check each other. The
parser accepts any bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from core.config.servo_models import SERVO_MODELS, ServoModel

HEADER = b"\xff\xff\xfd"
BROADCAST = 0xFE
MAX_ID = 252
MAX_PACKET = 1024
_BODY = 7
_STATUS = 0x55


class Instruction(IntEnum):
    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REBOOT = 0x08
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83


class ErrorCode(IntEnum):
    """Error byte of a status packet, without the alert bit."""

    NONE = 0
    RESULT_FAIL = 1
    INSTRUCTION = 2
    DATA_RANGE = 4
    DATA_LENGTH = 5
    DATA_LIMIT = 6
    ACCESS = 7


ALERT = 0x80


@dataclass(frozen=True, slots=True)
class InstructionPacket:
    """A whole, valid, unstuffed packet."""

    id: int
    instruction: int
    parameters: bytes


def crc16(data: bytes) -> int:
    """CRC-16 with polynomial 0x8005, start 0, no reflection."""
    crc = 0
    for byte in data:
        crc = (crc << 8 & 0xFFFF) ^ _CRC_TABLE[(crc >> 8) ^ byte]
    return crc


def _crc_of_byte(byte: int) -> int:
    crc = byte << 8
    for _ in range(8):
        crc = (crc << 1 ^ 0x8005) & 0xFFFF if crc & 0x8000 else crc << 1
    return crc


_CRC_TABLE = tuple(_crc_of_byte(byte) for byte in range(256))


def stuff(body: bytes) -> bytes:
    """Put FD behind every FF FF FD."""
    return body.replace(HEADER, HEADER + b"\xfd")


def unstuff(body: bytes) -> bytes | None:
    """Take the stuffing out; None when a bare FF FF FD shows that the sender did not stuff."""
    plain = body.replace(HEADER + b"\xfd", HEADER)
    return plain if stuff(plain) == body else None


def packet(servo_id: int, body: bytes) -> bytes:
    """A packet with header, id, length, `body` (instruction first) and CRC."""
    stuffed = stuff(body)
    head = HEADER + bytes([0, servo_id]) + (len(stuffed) + 2).to_bytes(2, "little") + stuffed
    return head + crc16(head).to_bytes(2, "little")


def status_packet(servo_id: int, error: int, data: bytes = b"") -> bytes:
    """A servo's answer."""
    return packet(servo_id, bytes([_STATUS, error]) + data)


class PacketParser:
    """Finds packets in a stream of bytes. ``rejected`` counts damaged ones."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.rejected = 0

    def reset(self) -> None:
        """Drop half a packet, as a servo does after a pause on the line."""
        self._buffer.clear()

    @property
    def is_midway(self) -> bool:
        return bool(self._buffer)

    def feed(self, data: bytes) -> list[InstructionPacket]:
        """All packets that are complete with `data`."""
        self._buffer += data
        found = []
        while self._find_header():
            end = _BODY + int.from_bytes(self._buffer[5:7], "little")
            if not _BODY + 3 <= end <= MAX_PACKET or self._buffer[4] > BROADCAST:
                self._skip(len(HEADER))
                continue
            if len(self._buffer) < end:
                break
            whole = bytes(self._buffer[:end])
            body = unstuff(whole[_BODY:-2])
            if body is None:
                # A header without stuffing starts a new packet.
                self._skip(whole.index(HEADER, _BODY) if HEADER in whole[_BODY:-2] else len(HEADER))
            elif crc16(whole[:-2]) != int.from_bytes(whole[-2:], "little"):
                self._skip(len(HEADER))
            else:
                del self._buffer[:end]
                found.append(InstructionPacket(whole[4], body[0], body[1:]))
        return found

    def _find_header(self) -> bool:
        """Drop the bytes before a header; True when one is there with id and length."""
        while (at := self._buffer.find(HEADER)) >= 0:
            del self._buffer[:at]
            if bytes(self._buffer[3:4]) in {b"", b"\0"}:
                return len(self._buffer) >= _BODY
            del self._buffer[: len(HEADER)]  # stuffed data, or no header of this protocol
        del self._buffer[: max(0, len(self._buffer) - 2)]  # the start of a header may be there
        return False

    def _skip(self, size: int) -> None:
        del self._buffer[:size]
        self.rejected += 1


def group_items(parameters: bytes) -> tuple[int, list[tuple[int, bytes]]]:
    """Address of a group write, and its items (servo id, data); no items when it is malformed."""
    address, length = int.from_bytes(parameters[:2], "little"), int.from_bytes(parameters[2:4], "little")
    items = parameters[4:]
    if length == 0 or len(items) % (length + 1):
        return address, []
    return address, [(items[at], items[at + 1 : at + 1 + length]) for at in range(0, len(items), length + 1)]


SIZE = 662
INDIRECT_ADDRESS, INDIRECT_DATA, INDIRECT_COUNT = 168, 224, 28
SMALL_INDIRECT_DATA, SMALL_INDIRECT_COUNT = 208, 20
WATCHDOG_TRIPPED = -1
POSITION, EXTENDED_POSITION, CURRENT_POSITION = 3, 4, 5
POSITION_MODES = frozenset({POSITION, EXTENDED_POSITION, CURRENT_POSITION})
"""Operating modes that follow Goal Position(116); the last two count 256 turns in both directions."""
CURRENT_MODES = frozenset({0, CURRENT_POSITION})
"""Operating modes that need a goal current."""
RAM_START = 64
WATCHDOG_SINCE, STARTUP_SINCE, SMALL_STARTUP_SINCE = 38, 45, 46
"""Firmware of the X430 and X540 from which there are a bus watchdog, and a startup configuration with backup; that of the X330."""
MAX_TICKS = 256 * 4096 - 1


@dataclass(frozen=True, slots=True)
class Register:
    """``eeprom`` registers are locked while the torque is on. ``low`` and ``high`` limit written values; None: read-only.

    ``limit`` names the register whose value the amount must not exceed; ``since`` is the firmware of the X430 that has it.
    """

    name: str
    address: int
    size: int
    initial: int
    low: int | None = None
    high: int | None = None
    eeprom: bool = False
    limit: str = ""
    since: int = 0


_REGISTERS = (
    Register("model_number", 0, 2, 1020, eeprom=True),
    Register("model_information", 2, 4, 0, eeprom=True),
    Register("firmware", 6, 1, 46, eeprom=True),
    Register("id", 7, 1, 1, 0, 252, eeprom=True),
    Register("baud_rate", 8, 1, 3, 0, 7, eeprom=True),
    Register("return_delay", 9, 1, 250, 0, 254, eeprom=True),
    Register("drive_mode", 10, 1, 0, 0, 13, eeprom=True),
    Register("operating_mode", 11, 1, 3, 0, 16, eeprom=True),
    Register("secondary_id", 12, 1, 255, 0, 255, eeprom=True),
    Register("protocol", 13, 1, 2, 1, 2, eeprom=True),
    Register("homing_offset", 20, 4, 0, -1_044_479, 1_044_479, eeprom=True),
    Register("moving_threshold", 24, 4, 10, 0, 1023, eeprom=True),
    Register("temperature_limit", 31, 1, 80, 0, 100, eeprom=True),
    Register("max_voltage_limit", 32, 2, 160, 95, 160, eeprom=True),
    Register("min_voltage_limit", 34, 2, 95, 95, 160, eeprom=True),
    Register("pwm_limit", 36, 2, 885, 0, 885, eeprom=True),
    Register("current_limit", 38, 2, 1193, 0, 1193, eeprom=True),
    Register("velocity_limit", 44, 4, 200, 0, 1023, eeprom=True),
    Register("max_position", 48, 4, 4095, 0, 4095, eeprom=True),
    Register("min_position", 52, 4, 0, 0, 4095, eeprom=True),
    Register("startup", 60, 1, 0, 0, 3, eeprom=True, since=STARTUP_SINCE),
    Register("shutdown", 63, 1, 52, 0, 255, eeprom=True),
    Register("torque", 64, 1, 0, 0, 1),
    Register("led", 65, 1, 0, 0, 1),
    Register("status_return", 68, 1, 2, 0, 2),
    Register("registered", 69, 1, 0),
    Register("hardware_error", 70, 1, 0),
    Register("velocity_i_gain", 76, 2, 1920, 0, 16383),
    Register("velocity_p_gain", 78, 2, 100, 0, 16383),
    Register("position_d_gain", 80, 2, 0, 0, 16383),
    Register("position_i_gain", 82, 2, 0, 0, 16383),
    Register("position_p_gain", 84, 2, 800, 0, 16383),
    Register("feedforward_2nd", 88, 2, 0, 0, 16383),
    Register("feedforward_1st", 90, 2, 0, 0, 16383),
    Register("watchdog", 98, 1, 0, 0, 127, since=WATCHDOG_SINCE),
    Register("goal_pwm", 100, 2, 885, -885, 885, limit="pwm_limit"),
    Register("goal_current", 102, 2, 1193, -1193, 1193, limit="current_limit"),
    Register("goal_velocity", 104, 4, 0, -1023, 1023, limit="velocity_limit"),
    Register("profile_acceleration", 108, 4, 0, 0, 32767),
    Register("profile_velocity", 112, 4, 0, 0, 32767, limit="velocity_limit"),
    Register("goal_position", 116, 4, 0, -MAX_TICKS, MAX_TICKS),
    Register("tick_ms", 120, 2, 0),
    Register("moving", 122, 1, 0),
    Register("moving_status", 123, 1, 0),
    Register("present_pwm", 124, 2, 0),
    Register("present_current", 126, 2, 0),
    Register("present_velocity", 128, 4, 0),
    Register("present_position", 132, 4, 0),
    Register("velocity_trajectory", 136, 4, 0),
    Register("position_trajectory", 140, 4, 0),
    Register("voltage", 144, 2, 120),
    Register("temperature", 146, 1, 25),
    *(
        Register(f"indirect_address_{n + 1}", INDIRECT_ADDRESS + 2 * n, 2, INDIRECT_DATA + n, 64, SIZE - 1)
        for n in range(INDIRECT_COUNT)
    ),
)
BY_NAME = {register.name: register for register in _REGISTERS}
_BACKED_UP = (
    "velocity_i_gain", "velocity_p_gain", "position_d_gain", "position_i_gain", "position_p_gain", "feedforward_2nd",
    "feedforward_1st", "profile_acceleration", "profile_velocity",
)  # fmt: skip
GOALS = frozenset({"goal_pwm", "goal_current", "goal_velocity", "goal_position"})
_SIGNED = {register.name for register in _REGISTERS if register.low is not None and register.low < 0} | {
    "watchdog", "present_pwm", "present_current", "present_velocity", "present_position", "velocity_trajectory",
    "position_trajectory",
}  # fmt: skip


class ControlTable:
    """One servo's registers. Values go in and out as signed numbers by name, or as bytes over the line.

    A model of the 330 size has its indirect data behind 20 addresses instead of 28; one that reports a load has neither goal
    current nor the modes that use it.

    Attributes
    ----------
    backed_up : what a backup holds of the RAM.
    startup_since : firmware from which there is a startup configuration with backup.
    """

    def __init__(self, model: ServoModel = SERVO_MODELS[1020]) -> None:
        self._data, self._count = (SMALL_INDIRECT_DATA, SMALL_INDIRECT_COUNT) if model.is_small else (INDIRECT_DATA, INDIRECT_COUNT)
        self._has_current_mode = model.has_current_mode
        self.startup_since = SMALL_STARTUP_SINCE if model.is_small else STARTUP_SINCE
        self._since = {WATCHDOG_SINCE: model.watchdog_firmware, STARTUP_SINCE: self.startup_since}
        absent = set() if model.has_current_mode else {"current_limit", "goal_current"}
        addresses = [f"indirect_address_{n + 1}" for n in range(INDIRECT_COUNT)]
        absent.update(addresses[self._count :])
        self._registers = [register for register in _REGISTERS if register.name not in absent]
        self._by_address = {register.address: register for register in self._registers}
        self.backed_up = (*_BACKED_UP, *addresses[: self._count])
        self._bytes = bytearray(SIZE)
        for register in self._registers:
            self.reset(register.name)

    def __getitem__(self, name: str) -> int:
        register = BY_NAME[name]
        value = int.from_bytes(self._bytes[register.address : register.address + register.size], "little")
        return value - (1 << 8 * register.size) if name in _SIGNED and value >> (8 * register.size - 1) else value

    def __setitem__(self, name: str, value: int) -> None:
        """Set a register without a check of access rights, as the servo itself does."""
        register = BY_NAME[name]
        bits = value & (1 << 8 * register.size) - 1
        self._bytes[register.address : register.address + register.size] = bits.to_bytes(register.size, "little")

    def reset(self, name: str) -> None:
        """Set a register to its initial value."""
        register = BY_NAME[name]
        points_at = self._data + (register.address - INDIRECT_ADDRESS) // 2
        self[name] = points_at if name.startswith("indirect_address") else register.initial

    def reset_ram(self) -> None:
        """Set the RAM as after power-up; the EEPROM stays."""
        for register in self._registers:
            if not register.eeprom:
                self.reset(register.name)
        self._bytes[self._data : self._data + self._count] = bytes(self._count)

    def read(self, address: int, length: int) -> tuple[ErrorCode, bytes]:
        """Bytes of the table; indirect data come from their indirect addresses."""
        if length == 0:
            return ErrorCode.DATA_LENGTH, b""
        if address + length > SIZE:
            return ErrorCode.ACCESS, b""
        return ErrorCode.NONE, bytes(self._bytes[self._resolved(at)] for at in range(address, address + length))

    def _resolved(self, at: int) -> int:
        if not self._data <= at < self._data + self._count:
            return at
        pointer = INDIRECT_ADDRESS + 2 * (at - self._data)
        return min(SIZE - 1, int.from_bytes(self._bytes[pointer : pointer + 2], "little"))

    def write(self, address: int, data: bytes) -> tuple[ErrorCode, list[str]]:
        """Check and write whole registers, all or none of them; returns their names.

        Indirect data take a byte as long as their indirect address is their own; what it would do elsewhere is refused.
        """
        if self._data <= address and data and address + len(data) <= self._data + self._count:
            if any(self._resolved(at) != at for at in range(address, address + len(data))):
                return ErrorCode.ACCESS, []
            self._bytes[address : address + len(data)] = data
            return ErrorCode.NONE, []
        values: list[tuple[Register, int]] = []
        at = 0
        while at < len(data):
            register = self._by_address.get(address + at)
            if register is None:
                return ErrorCode.ACCESS, []
            part = data[at : at + register.size]
            if len(part) < register.size:
                return ErrorCode.DATA_LENGTH, []
            error, value = self._check(register, part)
            if error:
                return error, []
            values.append((register, value))
            at += register.size
        if not values:
            return ErrorCode.DATA_LENGTH, []
        for register, value in values:
            self[register.name] = value
        return ErrorCode.NONE, [register.name for register, _ in values]

    def _check(self, register: Register, part: bytes) -> tuple[ErrorCode, int]:
        if (
            register.low is None
            or register.high is None
            or (register.eeprom and self["torque"])
            or self["firmware"] < self._since.get(register.since, 0)
        ):
            return ErrorCode.ACCESS, 0
        value = int.from_bytes(part, "little", signed=register.low < 0)
        if register.name in GOALS and self["watchdog"] == WATCHDOG_TRIPPED:
            return ErrorCode.DATA_RANGE, 0
        if register.name == "operating_mode" and value in CURRENT_MODES and not self._has_current_mode:
            return ErrorCode.DATA_RANGE, 0
        if not register.low <= value <= register.high:
            return ErrorCode.DATA_RANGE, 0
        if register.limit and abs(value) > self[register.limit]:
            return ErrorCode.DATA_LIMIT, 0
        return ErrorCode.NONE, value
