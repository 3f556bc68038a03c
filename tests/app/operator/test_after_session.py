"""After a recording: evaluate, annotate, play. The evaluation is a real process and its report is opened."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.annotator.sources import image_files
from app.operator.recording import AfterSession
from app.operator.startup import WindowServices
from app.operator.window import OperatorWindow
from app.widgets.messages import OfferStrip
from core.annotation.store import DEFAULT_NAME
from tests.app.annotated import measure
from tests.app.fakes import until
from tests.core.session_data import record, tick_of

LONG_MS = 120_000


@pytest.fixture
def strip(qtbot: QtBot) -> Iterator[OfferStrip]:
    parent = QWidget()
    parent.resize(780, 440)
    qtbot.addWidget(parent)
    parent.show()
    yield OfferStrip(parent)


@pytest.fixture
def shown() -> list[Path]:
    return []


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def after(strip: OfferStrip, shown: list[Path], said: list[str]) -> Iterator[AfterSession]:
    def show(path: Path) -> bool:
        shown.append(path)
        return True

    after = AfterSession(strip, show)
    after.said.connect(lambda line, _: said.append(line))
    yield after
    after.close()


def session_in(folder: Path) -> Path:
    size = (320, 240)  # measured in working pixels, which are twice as many
    return record(folder, (tick_of(index, 100.0 + index / 10, size=size) for index in range(12)))


def test_one_click_evaluates_what_was_measured_by_hand_and_opens_the_report(
    after: AfterSession, strip: OfferStrip, shown: list[Path], said: list[str], qtbot: QtBot, tmp_path: Path
) -> None:
    session = session_in(tmp_path)
    images = image_files([session], 48)
    assert len(images) == 12
    measure(session / DEFAULT_NAME, images[:3], [0.0, 10.0, 20.0])
    after.offer(session)
    assert list(strip.answers) == ["Evaluate", "Annotate", "Play", "\N{MULTIPLICATION SIGN}"]
    strip.answers["Evaluate"].click()
    assert "Evaluating" in strip.text
    qtbot.waitUntil(lambda: bool(shown), timeout=LONG_MS)
    assert shown == [session / "evaluation" / "report.html"]
    assert "the recorded configuration is lost; the default one is taken" in shown[0].read_text(), "this one kept none"
    metrics = json.loads((session / "evaluation" / "metrics.json").read_text())
    assert metrics["images"]["measured"] == 3
    assert f"0 of 3 pictures answered. Report opened: {shown[0]}" in said[-1]  # there is no robot in these pictures
    assert strip.text == ""


def test_without_anything_measured_it_leads_to_the_annotation_tool(
    after: AfterSession, strip: OfferStrip, shown: list[Path], qtbot: QtBot, tmp_path: Path
) -> None:
    session = session_in(tmp_path)
    after.evaluate(session)
    assert "Nothing is measured by hand yet" in strip.text
    assert "48 pictures, evenly over the session" in strip.text
    assert "Annotate" in strip.answers
    assert shown == []


def test_what_cannot_be_evaluated_is_one_line(
    after: AfterSession, strip: OfferStrip, said: list[str], qtbot: QtBot, tmp_path: Path
) -> None:
    session = session_in(tmp_path)
    (session / DEFAULT_NAME).write_bytes(b"no database, but long enough to be looked at " * 40)
    after.evaluate(session)
    qtbot.waitUntil(lambda: bool(said), timeout=LONG_MS)
    assert said[0].startswith("Not evaluated: ")
    assert "not an annotation file" in said[0]
    assert strip.text == ""


def test_an_evaluation_can_be_cancelled(
    after: AfterSession, strip: OfferStrip, shown: list[Path], said: list[str], qtbot: QtBot, tmp_path: Path
) -> None:
    session = session_in(tmp_path)
    measure(session / DEFAULT_NAME, image_files([session], 48)[:1], [5.0])
    after.evaluate(session)
    child = after._evaluation
    assert child is not None
    strip.answers["Cancel"].click()
    qtbot.waitUntil(lambda: not child.is_running, timeout=LONG_MS)
    assert said == ["Evaluation cancelled"]
    assert shown == []


def test_a_window_that_fails_says_why(after: AfterSession, said: list[str], qtbot: QtBot, tmp_path: Path) -> None:
    after.play(tmp_path / "no_session")
    qtbot.waitUntil(lambda: len(said) == 2, timeout=LONG_MS)
    assert "no_session" in said[1]


def test_the_window_offers_it_when_a_recording_ends_and_takes_it_back_when_the_next_begins(
    running: OperatorWindow, qtbot: QtBot, tmp_path: Path
) -> None:
    side = WindowServices(running, tmp_path / "state")
    strip = running.panels.offers
    running.recorder.toggle()
    until(qtbot, lambda: running.recorder.status.frames >= 3)
    running.recorder.toggle()
    until(qtbot, lambda: "Session saved" in strip.text)
    live = running.panels.live
    assert strip.geometry().bottom() < live.height(), "over the picture's lower edge"
    assert strip.width() <= live.width()
    assert running.panels.toast.geometry().bottom() < strip.y(), "no message over the offer"
    assert side.after.session is not None
    running.recorder.toggle()
    until(qtbot, lambda: strip.text == "")
    side.close()


def test_a_double_click_answers_one_offer_and_not_the_next_that_nobody_has_read(strip: OfferStrip, qtbot: QtBot) -> None:
    from app.widgets.messages import Offer, OfferButton  # what is offered

    done: list[str] = []
    for key in "ab":
        strip.offer(Offer(key, f"Session {key}", answers=(OfferButton("Never ask again", lambda key=key: done.append(key)),)))
    left = Qt.MouseButton.LeftButton
    qtbot.mouseClick(strip.answers["Never ask again"], left)
    assert strip.text == "Session b"
    button = strip.answers["Never ask again"]
    qtbot.mouseDClick(button, left)
    qtbot.mouseRelease(button, left)
    assert done == ["a"]
    qtbot.mouseClick(button, left)
    assert done == ["a", "b"]


def test_the_strip_shows_one_offer_at_a_time_and_fits_a_small_picture(strip: OfferStrip, qtbot: QtBot, tmp_path: Path) -> None:
    from app.widgets.messages import Offer, OfferButton  # what is offered

    done: list[str] = []
    strip.offer(
        Offer("a", "First", "detail " * 40, (OfferButton("Do it", lambda: done.append("a")),), dismissed=lambda: done.append("x"))
    )
    strip.offer(Offer("b", "Second", answers=(OfferButton("Do that", lambda: done.append("b")),)))
    parent = strip.parentWidget()
    parent.resize(QSize(460, 300))
    assert parent.rect().contains(strip.geometry())
    assert strip.text.startswith("First")
    strip.answers["\N{MULTIPLICATION SIGN}"].click()
    assert strip.text == "Second"
    strip.answers["Do that"].click()
    assert done == ["x", "b"]
    assert not strip.isVisible()
