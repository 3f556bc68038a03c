"""The fault campaign: all 43 are there, and those that can be had in lock-step go as listed. ``main.py faults`` runs every one."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from app.faults.registry import COUNT, CampaignError, Kit, Seen, all_cases, fault, run_case
from app.faults.report import page_of, to_json
from app.faults_command import run_faults
from core.session.recording import Recording

CASES = {case.number: case for case in all_cases()}
HERE = (1, 3, 8, 9, 11, 12, 13, 15, 16, 30, 34, 38, 43)
"""What is not covered by a test of its own, or was once missing, and takes a second or two; the rest is the command's."""


def test_all_are_registered_once_each() -> None:
    assert list(CASES) == list(range(1, COUNT + 1))
    with pytest.raises(ValueError, match="twice"):
        fault(1, "again", injected="", wanted="")(lambda kit: Seen(""))


@pytest.mark.parametrize("number", HERE, ids=lambda number: CASES[number].name)
def test_it_goes_as_listed(number: int) -> None:
    assert CASES[number].quick
    result = run_case(CASES[number], live=False)
    assert result.seen.problems == ()


def test_on_a_slow_disk_the_encoder_too_slow_goes_as_listed_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def slow(name: str, act: Callable[..., object]) -> None:
        def later(self: Recording, *given: object) -> object:
            done = act(self, *given)
            time.sleep(0.3)
            return done

        monkeypatch.setattr(Recording, name, later)

    slow("begin", Recording.begin)
    slow("take_picture", Recording.take_picture)
    assert run_case(CASES[38], live=False).seen.problems == ()


def test_the_command_tells_one_fault_per_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_faults([14], None, quick=True, as_json=True) == 0
    (line,) = capsys.readouterr().out.splitlines()
    told = json.loads(line)
    assert (told["fault"], told["ok"], told["seen"].startswith("DISARM at")) == (14, True, True)
    assert "fault: robot outside the vessel" in told["events"]


def test_what_makes_no_sense_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="no fault 44"):
        run_faults([44], None, quick=False, as_json=False)
    with pytest.raises(CampaignError, match="whole list"):
        run_faults([1], tmp_path / "page.md", quick=False, as_json=False)


def test_a_fault_that_is_not_brought_about_is_not_ok() -> None:
    def broken(kit: Kit) -> Seen:
        raise CampaignError("no bench")

    case = CASES[1]
    result = run_case(type(case)(1, "x", "", "", broken, True), live=False)
    assert not result.seen.ok
    assert result.seen.problems == ("no bench",)
    assert "**NOT OK**: no bench" in page_of([result], live=True)
    assert to_json(result)["ok"] is False
