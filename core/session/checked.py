"""Values out of a file that may be damaged: each is what it should be, or it is named. And finite numbers into one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import Any, TypeVar

import numpy as np

from core.types import Point, Points

Choice = TypeVar("Choice", bound=StrEnum)

MAX_POINTS = 20_000
_MAX_TEXT = 20_000
_LONGEST_S = 1e9


class Damaged(ValueError):
    """A record is not what it should be; the message names the value."""


def finite(value: float | None, digits: int) -> float | None:
    """Rounded; None when it is missing or no finite number, as JSON knows none."""
    return round(float(value), digits) if value is not None and math.isfinite(value) else None


def finite_tree(value: Any) -> Any:
    """Plain JSON values, rounded; a number that is not finite becomes None, what JSON does not know its text."""
    if isinstance(value, dict):
        return {str(key): finite_tree(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [finite_tree(inner) for inner in value]
    if isinstance(value, bool) or value is None:
        return value
    if isinstance(value, float):
        return finite(value, 5)
    if isinstance(value, int):
        return int(value)
    return str(value)


def number(value: Any, name: str) -> float:
    """A finite number."""
    if type(value) not in (int, float):
        raise Damaged(f"{name}: not a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise Damaged(f"{name}: not a finite number")
    return number


def moment(value: Any, name: str) -> float:
    """Seconds of a monotonic clock: no computer has run for thirty years."""
    seconds = number(value, name)
    if abs(seconds) > _LONGEST_S:
        raise Damaged(f"{name}: no time of a clock")
    return seconds


def maybe_number(value: Any, name: str) -> float | None:
    return None if value is None else number(value, name)


def count(value: Any, name: str) -> int:
    """A whole number from 0 on that fits 63 bits."""
    if type(value) is not int or not 0 <= value < 2**63:
        raise Damaged(f"{name}: not a count")
    return value


def flag(value: Any, name: str) -> bool:
    if type(value) is not bool:
        raise Damaged(f"{name}: neither true nor false")
    return value


def text(value: Any, name: str) -> str:
    if type(value) is not str or len(value) > _MAX_TEXT:
        raise Damaged(f"{name}: not a text")
    # Half a character, which JSON may name, is none, and brings down who draws or writes it.
    return value if value.isascii() else value.encode("utf-8", "backslashreplace").decode()


def choice(kind: type[Choice], value: Any, name: str) -> Choice:
    """One of the values of an enumeration."""
    try:
        return kind(text(value, name))
    except ValueError:
        raise Damaged(f"{name}: unknown ({str(value)[:40]!r})") from None


def group(value: Any, name: str) -> dict[str, Any]:
    """A JSON object."""
    if type(value) is not dict:
        raise Damaged(f"{name}: not an object")
    return value


def items(value: Any, name: str) -> list[Any]:
    if type(value) is not list or len(value) > MAX_POINTS:
        raise Damaged(f"{name}: not a list")
    return value


def numbers(value: Any, name: str, length: int | None = None) -> Sequence[float]:
    """A list of finite numbers, of this length if one is given."""
    found = items(value, name)
    if length is not None and len(found) != length:
        raise Damaged(f"{name}: {len(found)} numbers instead of {length}")
    return [number(inner, name) for inner in found]


def point(value: Any, name: str) -> Point:
    x, y = numbers(value, name, 2)
    return x, y


def points(value: Any, name: str) -> Points:
    """(N, 2) out of a list of pairs."""
    pairs = [point(inner, name) for inner in items(value, name)]
    return np.array(pairs, np.float64).reshape(-1, 2)
