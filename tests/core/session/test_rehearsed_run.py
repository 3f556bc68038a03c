"""A run of a session beside the rehearsal of its target."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from core.control.modes import Mode
from core.evaluation.rehearsal import RehearsalResult, place_beside, rehearsal_of
from core.session.manifest import Event, EventKind, event_of_target
from core.session.reader import SessionReader
from core.session.rehearsed_run import beside_line, runs_beside
from core.types import Command, PoseState

XS = [100.0, 110.0, 120.0, 130.0, 140.0]
FOUND = RehearsalResult.model_validate(
    {
        "target_xy": [140, 200],
        "size_px": [640, 480],
        "runs": 50,
        "arrived": {"share": 1.0, "low": 0.93, "high": 1.0},
        "states": {"A": 0.8, "B": 0.1, "C": 0.1, "D": 0.0},
        "wall_force_n": {"p95": 0.05, "max": 0.2},
        "way": {
            "along_mm": [30, 40, 50, 60, 70],
            "xy": [[x, 200] for x in XS],
            "low_xy": [[x, 203] for x in XS],
            "high_xy": [[x, 195] for x in XS],
            "wall_force_n": [0, 0, 0.1, 0, 0],
            "time_s": [[t, t + 1, t + 2] for t in range(5)],
            "runs": [50] * 5,
        },
        "speed_mm_s": 8.0,
    }
)


def test_a_head_beside_the_way() -> None:
    inside = place_beside(FOUND, (121.0, 197.0))
    assert inside is not None and (inside.along_mm, inside.outside_px, inside.wall_force_n) == (51.0, 0.0, 0.1)
    assert inside.time_s == (2.0, 3.0, 4.0)
    for y, away in ((190.0, 5.0), (210.0, 7.0)):
        beside = place_beside(FOUND, (121.0, y))
        assert beside is not None and beside.outside_px == pytest.approx(away)
    assert place_beside(FOUND, (90.0, 200.0)) is None
    for x, away in ((148.0, 0.0), (165.0, 15.0)):  # the last place is at 140, the one before at 130
        beyond = place_beside(FOUND, (x, 199.0))
        assert beyond is not None and (beyond.along_mm, beyond.outside_px) == (70.0, pytest.approx(away))


def reader_of(heads: list[tuple[float, float]], events: list[Event], driven_from: int, fed_mm_s: float = 0.0) -> SessionReader:
    """A row every 0.1 s."""
    times = 10.0 + 0.1 * np.arange(len(heads))
    mode = np.where(np.arange(len(heads)) >= driven_from, list(Mode).index(Mode.AUTONOMOUS), 0)

    sent = Command(advance_mm_s=fed_mm_s)

    def row(place: int) -> Any:
        scene = SimpleNamespace(
            path=SimpleNamespace(head=heads[place]), pose=SimpleNamespace(state=PoseState.A), to_source=lambda point: point
        )
        return SimpleNamespace(scene=scene, captured_s=times[place], status=SimpleNamespace(wall_contact_n=0.01 * place), sent=sent)

    line = SimpleNamespace(time_s=times, mode=mode)
    return cast(SessionReader, SimpleNamespace(timeline=lambda: line, events=tuple(events), row=row))


def test_a_run_that_left_the_band_says_when() -> None:
    xs = np.linspace(98.0, 140.0, 22)
    ys = np.where((xs > 115) & (xs < 130), 215.0, 200.0)  # seven rows: 0.7 s outside
    ys[3] = 230.0  # one picture is no leaving
    heads = list(zip(xs.tolist(), ys.tolist(), strict=True))
    chosen = event_of_target((140.0, 200.0), 9.0)
    rehearsed = event_of_target((140.0, 200.0), 9.5, FOUND.model_dump(mode="json"))
    (run,) = runs_beside(reader_of(heads, [chosen, rehearsed], 2))
    assert run["arrived"] and run["seconds"] == pytest.approx(1.9 - 0.1 * 2) and run["runs"] == 50
    assert run["rehearsed_seconds"] == [3.0, 4.0, 5.0]
    assert [(one["time_s"], one["along_mm"]) for one in run["left_band"]] == [(0.9, 46.0)]
    assert run["inside_share"] == pytest.approx(1 - 8 / 18, abs=1e-3) and run["wall_force_max_n"] == 0.19
    assert run["states"]["A"] == 1.0 and run["rehearsed_states"]["A"] == 0.8


@pytest.mark.parametrize(("fed_mm_s", "explains_s"), [(10.0, None), (10.3, None), (12.5, 0.78), (8.0, -0.98)])
def test_another_feed_explains_its_share_of_the_time(fed_mm_s: float, explains_s: float | None) -> None:
    known = FOUND.model_copy(update={"way_per_feed": (0.98, 1.0, 1.02), "target_xy": (170.0, 200.0)})
    heads = [(x, 200.0) for x in np.arange(101.0, 140.5, 1.0).tolist()]  # 10 mm/s, 39 mm
    rehearsed = event_of_target((170.0, 200.0), 9.0, known.model_dump(mode="json"))
    (run,) = runs_beside(reader_of(heads, [rehearsed], 0, fed_mm_s))
    assert run["way_per_feed"] == pytest.approx(10.0 / fed_mm_s, abs=1e-3) and run["feed_explains_s"] == (
        explains_s and pytest.approx(explains_s)
    )
    assert ("the feed slips or is another" in beside_line(run)) is (explains_s is not None)


def test_the_end_of_the_rehearsed_way_is_no_target() -> None:
    stuck = FOUND.model_copy(update={"target_xy": (180.0, 200.0)})  # no run came there
    rehearsed = event_of_target((180.0, 200.0), 9.0, stuck.model_dump(mode="json"))
    for last_px, arrived in ((150.0, False), (180.0, True)):
        heads = [(x, 200.0) for x in np.arange(110.0, last_px + 1.0, 2.0).tolist()]
        assert [run["arrived"] for run in runs_beside(reader_of(heads, [rehearsed], 0))] == [arrived]


def test_a_target_without_a_rehearsal_has_no_run() -> None:
    chosen = event_of_target((140.0, 200.0), 9.0)
    assert rehearsal_of(chosen) is None and runs_beside(reader_of([(120.0, 200.0)], [chosen], 0)) == []
    damaged = Event(9.0, EventKind.TARGET, "", {"rehearsal": {"runs": 3}})
    assert runs_beside(reader_of([(120.0, 200.0)], [damaged], 0)) == []
    rehearsed = event_of_target((140.0, 200.0), 9.0, FOUND.model_dump(mode="json"))
    assert runs_beside(reader_of([(50.0, 200.0)], [rehearsed], 0)) == []
