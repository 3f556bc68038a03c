"""Which servo draws too much current for too long. Pure.

A motor's current ripples: single readings below the limit say nothing against one that is far above it most of the time. Starting
a motor takes a peak. So what counts is half a second in which most readings are beyond the limit, with pauses no longer than those
of a ripple.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from core.servo_config import JOINT_NAMES, ServosConfig

STRAIN_S = 0.5
_RIPPLE_S, _RIPPLE_CYCLES = 0.06, 2.5
_ROUNDING_S = 1e-9


@dataclass(frozen=True, slots=True)
class CurrentSample:
    """The seven currents (mA, whatever their direction) at a moment; None where a servo tells none, or did not answer."""

    time_s: float
    currents_ma: tuple[float | None, ...]


def see_currents(
    samples: tuple[CurrentSample, ...], currents_ma: Sequence[float | None], now_s: float, servos: ServosConfig
) -> tuple[CurrentSample, ...]:
    """The samples with those of now, as far back as they matter."""
    oldest_s = STRAIN_S + 2.0 * _pause_s(servos)
    kept = tuple(sample for sample in samples if 0.0 <= now_s - sample.time_s <= oldest_s)
    return (*kept, CurrentSample(now_s, tuple(None if ma is None else abs(ma) for ma in currents_ma)))


def strained(samples: Sequence[CurrentSample], servos: ServosConfig) -> str:
    """The first joint that is strained as of the newest sample, and by how much; "" for none.

    A reading that is no number counts as too much; one that is missing counts as none, and does not prove anything.
    """
    for place, name in enumerate(JOINT_NAMES):
        found = [(sample.time_s, ma) for sample in samples if (ma := _at(sample, place)) is not None]
        beyond = [(time_s, ma) for time_s, ma in found if not ma <= servos.max_current_ma]
        if (run := _lasting([time_s for time_s, _ in beyond], samples[-1].time_s, _pause_s(servos))) is None:
            continue
        since = [ma for time_s, ma in found if time_s >= run]
        over = [ma for time_s, ma in beyond if time_s >= run]
        if 2 * len(over) >= len(since):
            lasted_ms = 1000.0 * (beyond[-1][0] - run)
            return f"{name} up to {max(over):.0f} mA for {lasted_ms:.0f} ms (at most {servos.max_current_ma:.0f} mA)"
    return ""


def _lasting(times_s: Sequence[float], now_s: float, pause_s: float) -> float | None:
    """Since when it has lasted, if for ``STRAIN_S`` at least and without a longer pause."""
    starts = [time_s for time_s in times_s if times_s[-1] - time_s >= STRAIN_S - _ROUNDING_S]
    if not starts:
        return None
    run = [*(time_s for time_s in times_s if time_s >= starts[-1]), now_s]
    pauses = (after - before for before, after in zip(run, run[1:], strict=False))
    return starts[-1] if max(pauses) <= pause_s + _ROUNDING_S else None


def _pause_s(servos: ServosConfig) -> float:
    return max(_RIPPLE_S, _RIPPLE_CYCLES / servos.bus_hz)


def _at(sample: CurrentSample, place: int) -> float | None:
    return sample.currents_ma[place] if place < len(sample.currents_ma) else None
