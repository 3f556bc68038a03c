"""Alerts over the picture, and their sounds by a player of the system."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import shiboken6
from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QAccessible, QAccessibleAnnouncementEvent, QMouseEvent
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot

from app.widgets.alerts import BRIEF_S, LINGER_S, LOOK, SOUNDS, AlertSounds, AlertStrip
from core.control.alerts import ALERTS, AlertKey, Priority
from core.control.drive_view import DriveView
from core.control.faults import Cause, Fault
from core.control.gate import RejectReason, Source
from core.control.modes import Hindrance, Mode
from tests.app.hand_clock import Clock
from tests.app.widgets.conftest import Own, alert, words

LEFT = Qt.MouseButton.LeftButton
OFF = DriveView(0.0)
ARMED = DriveView(0.0, Mode.ARMED, Source.OPERATOR, servos_on=True, deadman=False)
STOPPED = DriveView(0.0, Mode.STOPPED, latched=Fault(Cause.TRACKING, "0.8 mm"))


def test_alerts_say_what_is_the_matter_how_much_how_often_and_what_to_do(strip: AlertStrip) -> None:
    assert strip.isHidden()
    strip.show_alerts([alert(Cause.WARM, "pull left: 66 °C", times=3)])
    name, what_to_do = words(Cause.WARM).split(". ")
    assert strip.texts == [f"{name} (pull left: 66 °C) ×3. {what_to_do}"]
    strip.show_alerts([alert(Cause.WARM, "pull left: 67 °C")])
    assert strip.texts == [f"{name} (pull left: 67 °C) ×4. {what_to_do}"]
    assert len({LOOK[priority].sign for priority in Priority}) == len(Priority)
    assert strip.isVisible()
    assert strip.accessibleName().startswith(f"Alerts: {name}")


def test_the_most_urgent_three_are_shown_newest_first_among_equals(strip: AlertStrip) -> None:
    keys = [Hindrance.NO_TARGET, Cause.HOT, Cause.WARM, Cause.CONFIDENCE_LOW, Cause.STOP_PRESSED, Cause.VOLTAGE_LOW]
    strip.show_alerts([alert(key) for key in keys])
    assert strip.texts == [words(key) for key in (Cause.STOP_PRESSED, Cause.VOLTAGE_LOW, Cause.HOT)]


@pytest.mark.parametrize("key", [Hindrance.NO_TARGET, RejectReason.OVER_RATE, Cause.WARM])
def test_hints_and_warnings_go_away_by_themselves(strip: AlertStrip, clock: Clock, key: AlertKey) -> None:
    strip.show_alerts([alert(key)])
    clock.now_s += BRIEF_S[ALERTS[key].priority] - 0.1
    strip._expire()
    assert strip.texts
    clock.now_s += 0.1
    strip._expire()
    assert strip.texts == [] and strip.isHidden()
    assert not strip._timer.isActive()


def test_a_latched_fault_stays_until_it_is_acknowledged(strip: AlertStrip, clock: Clock) -> None:
    strip.show_alerts([alert(Cause.STOP_PRESSED)])
    stopped = DriveView(0.0, Mode.STOPPED, latched=Fault(Cause.STOP_PRESSED))
    for _ in range(10):
        strip.show_view(stopped)
        clock.now_s += 10.0
    strip.show_view(stopped)
    assert strip.texts
    strip.show_view(OFF)
    assert strip.texts == []


def test_acknowledging_takes_the_consequences_along_but_not_what_is_still_true(strip: AlertStrip) -> None:
    strip.show_alerts([alert(Cause.TRACKING), alert(Cause.BUS_NOISE), alert(Cause.CAMERA_LOST)])
    active = (Fault(Cause.CAMERA_LOST),)
    strip.show_view(DriveView(0.0, Mode.STOPPED, latched=Fault(Cause.TRACKING), active=active))
    assert len(strip.texts) == 3
    strip.show_view(DriveView(0.0, active=active))
    assert strip.texts == [words(Cause.CAMERA_LOST)]


def test_what_was_never_latched_lingers_after_it_is_over(strip: AlertStrip, clock: Clock) -> None:
    strip.show_alerts([alert(Cause.HEAD_LOST)])
    clock.now_s += 60.0
    strip.show_view(DriveView(0.0, Mode.HOLD, active=(Fault(Cause.HEAD_LOST),)))
    assert strip.texts
    clock.now_s += LINGER_S - 0.1
    strip.show_view(ARMED)
    assert strip.texts
    clock.now_s += 0.1
    strip.show_view(ARMED)
    assert strip.texts == []


def test_a_click_dismisses_one_and_the_next_in_line_takes_its_place(qtbot: QtBot, strip: AlertStrip) -> None:
    strip.show_alerts([alert(key) for key in (Cause.WARM, Cause.HOT, Cause.TRACKING, Cause.DISK_LOW)])
    qtbot.mouseClick(strip._rows[0], LEFT)
    assert strip.texts == [words(key) for key in (Cause.HOT, Cause.DISK_LOW, Cause.WARM)]
    strip.clear()
    assert strip.isHidden()


def test_a_double_click_dismisses_one_alert_and_not_the_next(qtbot: QtBot, strip: AlertStrip) -> None:
    strip.show_alerts([alert(key) for key in (Cause.WARM, Cause.TRACKING)])
    qtbot.mouseClick(strip._rows[0], LEFT)
    qtbot.mouseDClick(strip._rows[0], LEFT)
    qtbot.mouseRelease(strip._rows[0], LEFT)
    assert strip.texts == [words(Cause.WARM)]
    qtbot.mouseClick(strip._rows[0], LEFT)
    assert strip.texts == []


def test_a_click_on_an_alert_sets_no_target_behind_it(own: Own, qtbot: QtBot, clock: Clock) -> None:
    class Picture(QWidget):
        pressed = 0

        def mousePressEvent(self, event: QMouseEvent) -> None:
            self.pressed += 1

    picture = own(Picture(), 775, 408, show=True)
    strip = AlertStrip(picture, clock)
    strip.show_alerts([alert(Cause.WARM)])
    qtbot.mouseClick(strip._rows[0], LEFT)
    assert picture.pressed == 0


@pytest.mark.parametrize("size", [(480, 320), (600, 348), (775, 408), (1230, 768)])
def test_alerts_leave_three_quarters_of_the_picture_free(picture: QWidget, strip: AlertStrip, size: tuple[int, int]) -> None:
    strip.show_alerts([alert(key) for key in (Cause.WARM, Cause.HOT, Cause.TRACKING, Cause.DISK_LOW)])
    picture.resize(*size)
    assert 1 <= len(strip.texts) <= 3
    assert strip.height() <= 0.26 * picture.height()
    assert picture.rect().contains(strip.geometry())
    assert strip.texts[0] == words(Cause.TRACKING)


def test_screen_readers_are_told_once_and_urgently_what_interrupts(strip: AlertStrip, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[tuple[str, QAccessible.AnnouncementPoliteness]] = []

    def listen(event: QAccessibleAnnouncementEvent) -> None:
        told.append((event.message(), event.politeness()))

    monkeypatch.setattr(QAccessible, "updateAccessibility", listen)
    for _ in range(2):
        strip.show_alerts([alert(Cause.WARM), alert(Cause.TRACKING)])
    assert [message for message, _ in told] == [words(Cause.WARM), words(Cause.TRACKING)]
    polite, assertive = QAccessible.AnnouncementPoliteness.Polite, QAccessible.AnnouncementPoliteness.Assertive
    assert [politeness for _, politeness in told] == [polite, assertive]


posix_only = pytest.mark.skipif(sys.platform == "win32", reason="the fake player is a shell script")
Install = Callable[..., Path]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Puts a fake player on an otherwise empty path; it notes its arguments, then does what the test says."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))

    def make(name: str, then: str = "") -> Path:
        notes, player = tmp_path / f"{name}.txt", folder / name
        player.write_text(f'#!/bin/sh\necho "$@" >> "{notes}"\n{then}\n', encoding="utf-8")
        player.chmod(0o755)
        return notes

    return make


@pytest.fixture
def beeps(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    heard: list[int] = []
    monkeypatch.setattr(QApplication, "beep", lambda: heard.append(1))
    return heard


@pytest.fixture
def make_sounds(qapp: QApplication) -> Iterator[Callable[..., AlertSounds]]:
    made: list[AlertSounds] = []

    def make(*folder: Path) -> AlertSounds:
        made.append(AlertSounds(None, *folder))
        return made[-1]

    yield make
    for sounds in made:
        sounds.close()


def played(notes: Path) -> list[str]:
    """The names of the files that the player was given."""
    return [Path(line.split()[-1]).stem for line in notes.read_text(encoding="utf-8").splitlines()] if notes.exists() else []


def quiet(qtbot: QtBot, sounds: AlertSounds) -> None:
    qtbot.waitUntil(lambda: sounds.playing is None)


def test_every_alert_that_sounds_has_its_file() -> None:
    assert {spec.sound for spec in ALERTS.values()} - {None} == set(SOUNDS)


@posix_only
def test_a_more_urgent_sound_ends_the_running_one(qtbot: QtBot, install: Install, make_sounds: Callable[..., AlertSounds]) -> None:
    notes = install("aplay", 'case "$2" in *stop*) ;; *) exec /bin/sleep 60 ;; esac')
    sounds = make_sounds()
    sounds.play("hold")
    qtbot.waitUntil(lambda: played(notes) == ["hold"])
    sounds.play("disarm")
    sounds.play("stop")
    quiet(qtbot, sounds)
    assert played(notes) == ["hold", "stop"]


@posix_only
def test_nothing_is_heard_after_the_owner_is_gone(qtbot: QtBot, install: Install) -> None:
    notes = install("aplay", "exec /bin/sleep 60")
    owner = QObject()
    sounds = AlertSounds(owner)
    sounds.play("stop")
    qtbot.waitUntil(lambda: played(notes) == ["stop"])
    process = sounds._process.processId()
    shiboken6.delete(owner)  # a warning of Qt fails the test
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


@posix_only
def test_a_player_that_fails_is_given_up_once_and_the_next_one_plays(
    qtbot: QtBot, install: Install, make_sounds: Callable[..., AlertSounds], caplog: pytest.LogCaptureFixture
) -> None:
    broken = install("pw-play", "echo 'no server' >&2; exit 1")
    notes = install("aplay")
    sounds = make_sounds()
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            sounds.play("stop")
            quiet(qtbot, sounds)
    assert (played(broken), played(notes)) == (["stop"], ["stop", "stop"])
    assert len(caplog.records) == 1
    assert "pw-play gave up: no server" in caplog.text


@posix_only
@pytest.mark.parametrize("trouble", ["does not start", "hangs"])
def test_a_player_that_never_ends_well_is_given_up_too(
    qtbot: QtBot, install: Install, make_sounds: Callable[..., AlertSounds], beeps: list[int], tmp_path: Path, trouble: str
) -> None:
    install("aplay", "exec /bin/sleep 60")
    sounds = make_sounds()
    sounds._guard.setInterval(50)
    if trouble == "does not start":
        (tmp_path / "bin" / "aplay").unlink()
    sounds.play("stop")
    qtbot.waitUntil(lambda: beeps == [1])
    assert sounds.playing is None


def test_without_a_player_it_beeps_and_says_so_once(
    install: Install, make_sounds: Callable[..., AlertSounds], beeps: list[int], caplog: pytest.LogCaptureFixture
) -> None:
    sounds = make_sounds()
    with caplog.at_level(logging.WARNING):
        sounds.play("hold")
        sounds.play("stop")
    assert beeps == [1, 1]
    assert len(caplog.records) == 1


def test_a_missing_file_and_an_unknown_name_beep(
    install: Install, make_sounds: Callable[..., AlertSounds], beeps: list[int], tmp_path: Path
) -> None:
    install("aplay")
    make_sounds(tmp_path).play("stop")
    make_sounds().play("fanfare")
    assert beeps == [1, 1]
