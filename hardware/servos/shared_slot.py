"""A slot of depth one between two processes: the newest value wins, and neither side ever waits for the other."""

from __future__ import annotations

import mmap
import struct
import zlib

_HEAD = struct.Struct("<QII")  # sequence number from 1, length, CRC over both and the data
_KEY = struct.Struct("<QI")
_TRIES = 4


class SharedSlot:
    """One writer, one reader, in shared memory.

    Parameters
    ----------
    memory : mapped in both processes.
    offset, capacity : the slot's place, and how many bytes a value may have.

    Notes
    -----
    No lock: a process that is stopped or killed while it holds one stops the other. Values go in turn into two halves, each with a
    checksum; a half that is being written, or was left half-written, is no value, and the other one still holds the value before.
    """

    def __init__(self, memory: mmap.mmap, offset: int, capacity: int) -> None:
        self._memory = memory
        self._offset = offset
        self._capacity = capacity
        self._written = 0
        self._read: tuple[int, bytes] | None = None

    @staticmethod
    def size(capacity: int) -> int:
        """Bytes of memory for values of `capacity` bytes."""
        return 2 * (_HEAD.size + capacity)

    def put(self, data: bytes) -> None:
        """Replace the value.

        Raises
        ------
        ValueError
            When it is longer than the slot.
        """
        if len(data) > self._capacity:
            raise ValueError(f"{len(data)} bytes do not fit into a slot of {self._capacity}")
        self._written += 1
        at = self._half(self._written)
        check = zlib.crc32(data, zlib.crc32(_KEY.pack(self._written, len(data))))
        self._memory[at : at + _HEAD.size] = bytes(_HEAD.size)
        self._memory[at + _HEAD.size : at + _HEAD.size + len(data)] = data
        self._memory[at : at + _HEAD.size] = _HEAD.pack(self._written, len(data), check)

    def newest(self) -> tuple[int, bytes] | None:
        """Number and bytes of the newest whole value; None before the first."""
        known = self._read[0] if self._read is not None else 0
        for _ in range(_TRIES):
            numbers = sorted(((self._number(half), half) for half in (0, 1)), reverse=True)
            if numbers[0][0] == known:
                break
            found = next((value for _, half in numbers if (value := self._whole(half)) is not None), None)
            if found is not None and found[0] >= known:
                self._read = found
                break
        return self._read

    def _number(self, half: int) -> int:
        """What a half says it holds; 0 while it is being written."""
        at = self._half(half)
        number: int = _HEAD.unpack(self._memory[at : at + _HEAD.size])[0]
        return number

    def _half(self, number: int) -> int:
        return self._offset + (number % 2) * (_HEAD.size + self._capacity)

    def _whole(self, half: int) -> tuple[int, bytes] | None:
        at = self._half(half)
        number, length, check = _HEAD.unpack(self._memory[at : at + _HEAD.size])
        if number == 0 or length > self._capacity:
            return None
        data = self._memory[at + _HEAD.size : at + _HEAD.size + length]
        return (number, data) if zlib.crc32(data, zlib.crc32(_KEY.pack(number, length))) == check else None
