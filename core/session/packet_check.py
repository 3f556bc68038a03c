"""Which packets of a video can be trusted: those that are as they were written, and whose picture builds on such ones only.

Decoders conceal damage: they show something. What they show must not be measured, so every row of a session carries the checksum of
its picture's packet.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

_START = re.compile(b"\x00\x00\x00?\x01")


class PictureRow(NamedTuple):
    """What the rows tell of a picture: place of its row among the good ones, the row's own number, and the checksum of the packet
    (None: the row has none)."""

    place: int
    number: int
    crc: int | None


Known = Callable[[int], PictureRow | None]
"""Time in ms -> its picture's row. None: no row has it."""


def checksum_with_codes(packet: bytes) -> int:
    """CRC-32 of the NAL units of an H.264 packet as the encoder gives it, with start codes."""
    return _checksum(unit for unit in _START.split(packet) if unit)


def checksum_with_lengths(packet: bytes) -> int:
    """The same of a packet as Matroska stores it, with lengths of four bytes."""
    return _checksum(_with_lengths(packet))


def _checksum(units: Iterable[bytes]) -> int:
    total = 0
    for unit in units:
        # zeros at the end belong to the next start code
        total = zlib.crc32(unit.rstrip(b"\x00"), total)
    return total


def _with_lengths(packet: bytes) -> Iterator[bytes]:
    at = 0
    while at + 4 <= len(packet):
        size = int.from_bytes(packet[at : at + 4], "big")
        yield packet[at + 4 : at + 4 + size]
        at += 4 + size


class PacketCheck:
    """Follows the packets of one file in order, from the beginning or from a seek on."""

    def __init__(self, known: Known) -> None:
        self._known = known
        self._last: PictureRow | None = None
        self._unknown = 0
        self._is_whole = False

    def take(self, pts_ms: int, data: bytes, *, is_key: bool, is_corrupt: bool = False) -> bool:
        """Can the picture of this packet be trusted? After a damaged or missing one none can until the next key picture."""
        found = self._known(pts_ms)
        if found is not None:
            if self._last is not None and not self._follows(self._last, found):
                self._is_whole = False
            if is_corrupt or (found.crc is not None and checksum_with_lengths(data) != found.crc):
                self._is_whole = False
                return False
            self._last, self._unknown = found, 0
        elif is_corrupt:
            self._is_whole = False
            return False
        else:
            self._unknown += 1
        self._is_whole = self._is_whole or is_key
        return self._is_whole

    def _follows(self, last: PictureRow, found: PictureRow) -> bool:
        """Is no picture missing in between? Where rows are lost, too, their pictures must have come by."""
        return found.place == last.place + 1 and found.number - last.number - 1 <= self._unknown

    def fail(self) -> None:
        """The decoder refused the packet."""
        self._is_whole = False
