"""Random draws that all families of looks share: numbers, greys, hues, choices."""

from __future__ import annotations

import colorsys
from typing import Any

from numpy.random import Generator

Knobs = dict[str, Any]
Rgb = tuple[float, float, float]


def uniform(rng: Generator, low: float, high: float) -> float:
    """A number between `low` and `high`."""
    return float(rng.uniform(low, high))


def grey(rng: Generator, low: float, high: float, cast: float = 0.03) -> Rgb:
    """A grey with a slight colour cast."""
    level = rng.uniform(low, high)
    r, g, b = (float(min(max(level + rng.uniform(-cast, cast), 0.0), 1.0)) for _ in range(3))
    return r, g, b


def hue(rng: Generator, hue: float, spread: float, saturation: tuple[float, float], value: tuple[float, float]) -> Rgb:
    """A colour near a hue (0..1)."""
    return colorsys.hsv_to_rgb((hue + rng.uniform(-spread, spread)) % 1.0, rng.uniform(*saturation), rng.uniform(*value))


def any_hue(rng: Generator, saturation: tuple[float, float], value: tuple[float, float]) -> Rgb:
    """A colour of any hue."""
    return hue(rng, float(rng.random()), 0.0, saturation, value)


def pick(rng: Generator, *choices: Any) -> Any:
    """One of the `choices`."""
    return choices[int(rng.integers(len(choices)))]
