"""JSON lines out of files that nobody trusts: each line is a checked object, or it is named and skipped.

Every line that the recorder writes ends with the CRC-32 of what is before it: without it a flipped bit in a digit would pass as a
measurement. A line without one (made by hand) is taken as it is.
"""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from core.session.checked import Damaged

MAX_LINE_BYTES = 4_000_000
_CHUNK = 1 << 20
_SEAL = re.compile(rb',"crc":"([0-9a-f]{8})"}')
_SEAL_BYTES = 18


@dataclass(frozen=True, slots=True)
class Line:
    """A line of a file: its number from 1, where it begins, and its bytes without the line break; None when it is too long.

    ``is_cut`` tells that the file ends within it.
    """

    number: int
    offset: int
    data: bytes | None
    is_cut: bool


def sealed(line: str) -> str:
    """A JSON object as one line, with its checksum as last key."""
    return f'{line[:-1]},"crc":"{zlib.crc32(line[:-1].encode()):08x}"}}'


def is_sealed(line: Line) -> bool:
    """Does it carry a checksum, and the right one? Then it is what the recorder wrote."""
    seal = _seal(line.data) if line.data is not None else None
    return line.data is not None and seal is not None and seal == zlib.crc32(line.data[:-_SEAL_BYTES])


def _seal(data: bytes) -> int | None:
    found = _SEAL.fullmatch(data[-_SEAL_BYTES:])
    return int(found[1], 16) if found is not None else None


def parse_line(line: Line) -> dict[str, Any]:
    """The object in it. Raises Damaged: cut, checksum wrong, no JSON, NaN, nested too deeply, no object."""
    if line.data is None:
        raise Damaged(f"longer than {MAX_LINE_BYTES} bytes")
    return parse(line.data, is_cut=line.is_cut)


def parse(data: bytes, *, is_cut: bool = False) -> dict[str, Any]:
    """Like `parse_line`, of bytes."""
    seal = _seal(data)
    if seal is not None and seal != zlib.crc32(data[:-_SEAL_BYTES]):
        raise Damaged("checksum wrong")
    try:
        record = json.loads(data, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        if isinstance(error, Damaged):
            raise
        if is_cut:
            raise Damaged("cut off") from None
        raise Damaged("nested too deeply" if isinstance(error, RecursionError) else "not valid JSON") from None
    if type(record) is not dict:
        raise Damaged("not an object")
    return record


def _refuse(name: str) -> NoReturn:
    raise Damaged(f"{name} is no number")


def lines_of(path: Path) -> Iterator[Line]:
    """All lines that are not blank, in order, whatever is in the file; never more than a few MB in memory. Raises OSError."""
    number, offset = 1, 0
    with path.open("rb") as file:
        while data := file.readline(MAX_LINE_BYTES):
            size = len(data)
            is_long = False
            while not data.endswith(b"\n") and (more := file.readline(_CHUNK)):
                data, is_long = more, True
                size += len(more)
            is_cut = not data.endswith(b"\n")
            data = data.removesuffix(b"\n")
            if is_long or data.strip():
                yield Line(number, offset, None if is_long else data, is_cut)
            number, offset = number + 1, offset + size
