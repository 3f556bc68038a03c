"""The soak's own tools: samples, flatness, a short run over the whole program."""

from __future__ import annotations

import pytest

from tools.soak import ProcessSample, Soak, flatness


def samples(count: int, grow_mb: float = 0.0, threads: int = 0, files: int = 0) -> list[ProcessSample]:
    """Every ten seconds; what grows does so evenly."""
    return [
        ProcessSample(10.0 * n, 400.0 + grow_mb * n, 12 + threads * n // count, 20 + files * n // count, 1, 50.0)
        for n in range(count)
    ]


@pytest.mark.parametrize(
    ("given", "flat"),
    [
        (samples(300), True),
        (samples(300, grow_mb=0.02), True),
        (samples(300, grow_mb=0.5), False),
        (samples(300, threads=5, files=5), True),
        (samples(300, threads=12), False),
        (samples(300, files=30), False),
        (samples(5), None),
        ([], None),
    ],
)
def test_flat_after_ten_minutes(given: list[ProcessSample], flat: bool | None) -> None:
    assert flatness(given).flat is flat


@pytest.mark.real_time
def test_a_short_soak_sends_nothing_unsafe_and_loses_nothing() -> None:
    short = Soak(seed=1)
    short.run(6.0, lambda now: now.watch.report.goals < 200)
    summary = short.summary()
    assert summary["unsafe_texts"] == []
    assert summary["records"]["lost"] == 0
    assert summary["packets"] > 20
    assert summary["rigs_opened"] >= 1
