"""Rehearsing in the operator window: the button, progress, result, cancelling, and the hand-over that needs one."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from pytestqt.qtbot import QtBot

from app.operator.rehearsal_card import RehearsalCard, advice_of
from app.operator.rehearsing import RehearsalController
from app.operator.window import OperatorWindow
from app.ui.texts import OperatorStep
from core.config.models import Config
from core.evaluation.rehearsal import RehearsalResult, rehearsal_of
from core.types import Point
from hardware.preflight.preflight import Level
from hardware.rig import RigKind
from tests.app.fakes import until

FOUND: dict[str, Any] = {
    "target_xy": [300.0, 200.0],
    "size_px": [640, 480],
    "runs": 50,
    "arrived": {"share": 0.96, "low": 0.865, "high": 0.989},
    "outcomes": {"reached": 48, "stuck": 2},
    "states": {"A": 0.7, "B": 0.1, "C": 0.1, "D": 0.1},
    "time_s": {"median": 14.2, "p95": 19.0},
    "wall_force_n": {"p95": 0.06, "max": 0.31},
    "weakest": {"xy": [200.0, 180.0], "along_mm": 75.0, "turn_deg": 40.0, "ended_here": 2, "wall_force_p95_n": 0.2},
    "way": {
        "along_mm": [20.0, 22.5, 25.0],
        "xy": [[100, 180], [110, 180], [120, 181]],
        "low_xy": [[100, 175], [110, 175], [120, 175]],
        "high_xy": [[100, 185], [110, 185], [120, 185]],
        "wall_force_n": [0.0, 0.1, 0.6],
        "time_s": [[0, 0.5, 1], [1, 1.5, 2], [2, 2.5, 3]],
        "runs": [50, 50, 50],
    },
    "way_per_feed": [0.98, 1.0, 1.02],
    "sharp": [{"xy": [200.0, 180.0], "turn_deg": 74.0, "limit_deg": 61.0}],
    "speed_mm_s": 8.0,
    "recommended_speed_mm_s": 5.6,
    "based_on": {"pictures": 240, "missing": 0.05, "robot": "twin"},
}
WAITS = "sleep 60"
TARGET: Point = (300.0, 200.0)
MakeController = Callable[..., RehearsalController]


def said(*records: dict[str, Any], then: str = "") -> list[str]:
    """A command that stands for ``rehearse``: it keeps what it is given, and says these."""
    lines = "\n".join(json.dumps(record) for record in records)
    return ["/bin/sh", "-c", f"cat > $GIVEN; cat <<'END'\n{lines}\nEND\n{then}"]


@pytest.fixture
def given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GIVEN", str(tmp_path / "given.json"))
    return tmp_path / "given.json"


@pytest.fixture
def make(make_window: Callable[..., OperatorWindow], qtbot: QtBot) -> Iterator[MakeController]:
    made: list[RehearsalController] = []

    def one(
        command: list[str], kind: RigKind = RigKind.SIM, *, is_needed: bool = False, bench: Path | None = None
    ) -> RehearsalController:
        perception = {"bench": str(bench)} if bench is not None else {}
        config = Config.model_validate(
            {"record": {"ring_s": 0}, "window": {"needs_rehearsal": is_needed}, "perception": perception}
        )
        window = make_window(config=config, kind=kind)
        window.start()
        until(qtbot, lambda: window.shown_tick is not None)
        made.append(RehearsalController(window, lambda *_options: command))
        return made[-1]

    yield one
    for controller in made:
        controller.close()


def card_of(controller: RehearsalController) -> RehearsalCard:
    return controller._window.panels.rehearsal


def test_a_target_is_rehearsed_and_forgotten_with_it(make: MakeController, given: Path, qtbot: QtBot) -> None:
    so_far = FOUND | {"runs": 12}
    controller = make(said({"done": 12, "total": 50}, {"so_far": so_far}, FOUND))
    window, card = controller._window, card_of(controller)
    assert card.isHidden()
    window.set_target(TARGET)
    assert card.button.text() == "Rehearse  (T)" and card.text == ""
    card.button.click()
    assert card.button.text() == "Cancel"
    until(qtbot, lambda: controller.result is not None and controller._child is None)
    target = window.recorder._target
    assert target is not None and rehearsal_of(target) == controller.result
    told = json.loads(given.read_text())
    assert told["size_px"] == [640, 480] and Config.model_validate(told["config"]) == window.rig.config
    assert "96 % of 50 runs arrived" in card.text and "86 to 99 %" in card.text
    assert "A branch on the way turns off more sharply" in card.text
    assert card.text.endswith("Go at 70 % of the set speeds: advice.fast_mm_s = 5.6")
    shapes = window.panels.live._marks.rehearsal
    assert shapes is not None and [text for _, text in shapes.notes] == ["turns by 74°, the head by 61°; 2 runs ended here"]
    assert len(window.panels.overlay_bar._shown) == 11
    card.cross.click()
    assert card.isHidden() and window.panels.live._marks.rehearsal is not None
    controller.toggle()
    assert not card.isHidden()
    window.set_target((310.0, 200.0))
    assert controller.result is None and window.panels.live._marks.rehearsal is None
    assert card.button.text() == "Rehearse  (T)" and len(window.panels.overlay_bar._shown) == 10
    window.clear_target()
    assert card.isHidden()


def test_it_is_cancelled_at_once(make: MakeController, given: Path, qtbot: QtBot) -> None:
    controller = make(said({"so_far": FOUND | {"runs": 3}}, then=f"exec {WAITS}"))
    window, card = controller._window, card_of(controller)
    window.set_target(TARGET)
    controller.toggle()
    until(qtbot, lambda: window.panels.live._marks.rehearsal is not None)
    assert "Looking at the way: 0 %" in card.text
    child = controller._child
    assert child is not None and child.pid is not None and os.getpriority(os.PRIO_PROCESS, child.pid) > 10
    card.button.click()
    assert card.button.text() == "Rehearse  (T)" and window.panels.live._marks.rehearsal is None
    until(qtbot, lambda: not child.is_running)
    assert controller.result is None


def test_slower_speeds_are_named_while_they_are_tried(make: MakeController, given: Path, qtbot: QtBot) -> None:
    card = card_of(controller := make(said({"speed": 0.7}, {"done": 3, "total": 50}, then=f"exec {WAITS}")))
    controller._window.set_target(TARGET)
    controller.toggle()
    until(qtbot, lambda: card.text == "At 70 % of the set speeds: 3 of 50")
    controller.forget()
    card = card_of(controller := make(said({"done": 1, "total": 3}, then=f"exec {WAITS}")))  # pictures of the way, before the runs
    controller._window.set_target(TARGET)
    controller.toggle()
    until(qtbot, lambda: card.text == "Looking at the way: 33 %")
    controller._on_told({"speed": 1.0})
    assert card.text == "Rehearsing: 0 of 50"


def test_what_prevents_it_is_one_line(make: MakeController, given: Path, qtbot: QtBot) -> None:
    controller = make(["/bin/sh", "-c", "echo error: the target is not in the vessel >&2; exit 1"])
    window = controller._window
    controller.toggle()
    assert window.panels.toast.text() == "First click the target, then rehearse"
    window.set_target(TARGET)
    controller.toggle()
    until(qtbot, lambda: controller._child is None)
    assert window.panels.toast.text() == "Not rehearsed: the target is not in the vessel"
    assert card_of(controller).button.text() == "Rehearse  (T)"
    live = make(said(FOUND), RigKind.LIVE)
    live._window.set_target(TARGET)
    assert card_of(live).isHidden()
    live.toggle()
    assert live._window.panels.toast.text().startswith("Not rehearsed: no phantom of this bench for the twin")


def test_a_hand_over_may_need_one(make: MakeController, given: Path, qtbot: QtBot) -> None:
    assert make(said(FOUND)).finding is None
    controller = make(said(FOUND), is_needed=True)
    rig, window = controller._window.rig, controller._window
    assert controller.finding is not None and controller.finding.detail == "no target yet"
    window.set_target(TARGET)
    finding = controller.finding
    assert finding is not None and (finding.level, finding.detail) == (Level.WARNING, "this target was not rehearsed")
    assert rig.may_ask(OperatorStep.ARM) and not rig.may_ask(OperatorStep.HAND_OVER)
    assert window.panels.toast.text() == ("Not handed over: this target was not rehearsed. Press T: two minutes beside the window.")
    controller.toggle()
    until(qtbot, lambda: controller.result is not None and controller._child is None)
    assert rig.may_ask(OperatorStep.HAND_OVER)
    finding = controller.finding
    assert finding is not None and finding.level is Level.WARNING and finding.fix.startswith("Go at 70 %")
    controller._on_told(FOUND | {"recommended_speed_mm_s": 8.0})
    assert controller.finding is not None and controller.finding.level is Level.GOOD
    window.set_target((310.0, 200.0))
    assert not rig.may_ask(OperatorStep.HAND_OVER)


def test_a_hand_over_waits_for_the_rehearsal_that_goes_on(make: MakeController, given: Path) -> None:
    controller = make(said(then=f"exec {WAITS}"), is_needed=True)
    window = controller._window
    window.set_target(TARGET)
    controller.toggle()
    assert not window.rig.may_ask(OperatorStep.HAND_OVER)
    assert window.panels.toast.text() == "Not handed over: the rehearsal is not finished. Wait for its result."


def test_the_result_is_read_as_it_is_written() -> None:
    assert RehearsalResult.model_validate(FOUND).model_dump(mode="json") | {"size_px": [640, 480]} == FOUND


def test_the_card_says_whose_robot_it_was_and_what_to_do(make: MakeController) -> None:
    card = card_of(make(said(FOUND)))
    result = RehearsalResult.model_validate(FOUND)
    card.show_result(result)
    assert "rig identify" not in card.text and ", no answer in 5 % of the pictures" in card.text
    for runs, advice in ((50, "No speed that was tried is good"), (12, "Too few runs ended to recommend a speed")):
        assert advice_of(result.model_copy(update={"runs": runs, "recommended_speed_mm_s": None}))[0].startswith(advice)
    card.show_result(result, is_real=True)
    assert "With the nominal robot: rig identify measures yours" in card.text
    card.show_result(result.model_copy(update={"based_on": {"robot": "identified"}}), is_real=True)
    assert "rig identify" not in card.text and "no answer" not in card.text


def test_a_real_bench_is_rehearsed_on_its_own_phantom(make: MakeController, tmp_path: Path) -> None:
    controller = make(said(FOUND), RigKind.LIVE, bench=tmp_path)
    controller._window.set_target(TARGET)
    assert card_of(controller).isHidden()
    (tmp_path / "phantom.json").touch()
    controller._look_again()
    assert card_of(controller).button.text() == "Rehearse  (T)"
    assert controller._bench is not None and controller._bench[0] == ("--bench", str(tmp_path))
    recorder = controller._window.recorder
    controller._on_told(FOUND)
    controller._on_ended(0, "")
    controller._look_again()
    assert controller.result is not None and recorder._target is not None and rehearsal_of(recorder._target) is not None
    os.utime(tmp_path / "phantom.json", (0, 0))
    controller._look_again()
    assert controller.result is None, "of another phantom"
    assert rehearsal_of(recorder._target) is None and recorder._target.data["xy"] == list(TARGET)
