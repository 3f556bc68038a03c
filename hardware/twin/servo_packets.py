"""DYNAMIXEL Protocol 2.0 as a strict servo understands it: header, stuffing, length, CRC. Pure; no bytes make it fail.

Written from the protocol's description (Robotis e-Manual), not from the vendor's SDK, so that driver and twin check each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

HEADER = b"\xff\xff\xfd"
BROADCAST = 0xFE
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
    """What a status packet's error byte says, beside the alert bit."""

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
    """Finds packets in a stream of bytes. ``rejected`` counts what looked like a packet and was none."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.rejected = 0

    def reset(self) -> None:
        """Forget half a packet, as a servo does after a pause on the line."""
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
                # A bare header inside: the line's word for the start of a packet.
                self._skip(whole.index(HEADER, _BODY) if HEADER in whole[_BODY:-2] else len(HEADER))
            elif crc16(whole[:-2]) != int.from_bytes(whole[-2:], "little"):
                self._skip(len(HEADER))
            else:
                del self._buffer[:end]
                found.append(InstructionPacket(whole[4], body[0], body[1:]))
        return found

    def _find_header(self) -> bool:
        """Drop what comes before a header; True when one is there with id and length."""
        while (at := self._buffer.find(HEADER)) >= 0:
            del self._buffer[:at]
            if bytes(self._buffer[3:4]) in {b"", b"\0"}:
                return len(self._buffer) >= _BODY
            del self._buffer[: len(HEADER)]  # stuffed data, or no header of this protocol
        del self._buffer[: max(0, len(self._buffer) - 2)]  # a header's beginning may be there
        return False

    def _skip(self, size: int) -> None:
        del self._buffer[:size]
        self.rejected += 1
