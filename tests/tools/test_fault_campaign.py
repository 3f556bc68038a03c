"""The fault campaign: all are there, and those that run quickly in lock-step go as listed."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import pytest

from core.devices import UserError
from tools.fault_campaign.__main__ import Result, page_of, run_case, run_faults, to_json
from tools.fault_campaign.registry import CASES, COUNT, FAULTS, CampaignError, FaultCase, Kit, Observation, fault

HERE = (3, 8, 9, 11, 15, 16, 30, 34)  # not covered by another test, and a second or two each


def test_all_are_registered_once_each() -> None:
    assert sorted(CASES) == list(range(1, COUNT + 1))
    with pytest.raises(ValueError, match="twice"):
        fault(1)(lambda kit: Observation(""))


@pytest.mark.parametrize("number", HERE, ids=lambda number: FAULTS[number].name)
def test_it_goes_as_listed(number: int) -> None:
    assert FAULTS[number].quick
    result = run_case(CASES[number], live=False)
    assert result.seen.problems == ()


def test_the_command_tells_one_fault_per_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_faults([14], None, quick=True, as_json=True) == 0
    (line,) = capsys.readouterr().out.splitlines()
    told = json.loads(line)
    assert (told["fault"], told["ok"], told["seen"].startswith("DISARM at")) == (14, True, True)
    assert "fault: robot outside the vessel" in told["events"]


def test_what_makes_no_sense_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match=f"no fault {COUNT + 1}"):
        run_faults([COUNT + 1], None, quick=False, as_json=False)
    with pytest.raises(CampaignError, match="whole list"):
        run_faults([1], tmp_path / "page.md", quick=False, as_json=False)
    with pytest.raises(UserError, match="choose another --out"):
        run_faults([], tmp_path / "no folder" / "f.md", quick=False, as_json=False)


def test_ctrl_c_keeps_the_results_so_far(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(case: FaultCase, *, live: bool) -> Result:
        if case.number == 3:
            signal.raise_signal(signal.SIGINT)
        return Result(case, Observation("HOLD"), 0.1, 1)

    monkeypatch.setattr("tools.fault_campaign.__main__.run_case", run)
    page = tmp_path / "f.md"
    with pytest.raises(KeyboardInterrupt):
        run_faults([], page, quick=False, as_json=False)
    assert capsys.readouterr().out.splitlines()[-1] == f"3 of 3 as listed ({COUNT} in the list)"
    assert "was interrupted" in page.read_text()
    assert "| 3 | " in page.read_text()


def test_a_fault_that_is_not_brought_about_is_not_ok() -> None:
    def broken(kit: Kit) -> Observation:
        raise CampaignError("no bench")

    result = run_case(FaultCase(1, FAULTS[1], broken), live=False)
    assert not result.seen.ok
    assert result.seen.problems == ("no bench",)
    assert "**NOT OK**: no bench" in page_of([result], live=True)
    assert to_json(result)["ok"] is False
