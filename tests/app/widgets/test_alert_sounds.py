"""Sounds by a player of the system: a fake one writes down what it is asked to play."""

from __future__ import annotations

import logging
import os
import runpy
import sys
import wave
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import shiboken6
from PySide6.QtCore import QObject
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.widgets.alerts import SOUNDS, AlertSounds
from core.config.models import RESOURCES
from core.control.alerts import ALERTS

FOLDER = RESOURCES / "sounds"
SCRIPT = Path(__file__).resolve().parents[3] / "tools" / "make_sounds.py"
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


# ---- the files


@pytest.mark.parametrize("name", SOUNDS)
def test_sounds_are_short_small_and_plain(name: str) -> None:
    path = FOLDER / f"{name}.wav"
    assert path.stat().st_size < 40_000
    with wave.open(str(path), "rb") as file:
        assert (file.getnchannels(), file.getsampwidth()) == (1, 2)
        assert 0.2 < file.getnframes() / file.getframerate() < 1.0
        samples = np.frombuffer(file.readframes(file.getnframes()), "<i2")
    assert 0.5 * 32767 < np.abs(samples).max() < 0.8 * 32767
    assert abs(int(samples[0])) < 300 and abs(int(samples[-1])) < 300, "no click at the ends"


def test_every_alert_that_sounds_has_its_file() -> None:
    assert {spec.sound for spec in ALERTS.values()} - {None} == set(SOUNDS)


def test_the_script_makes_what_is_committed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", [str(SCRIPT), str(tmp_path)])
    runpy.run_path(str(SCRIPT), run_name="__main__")
    for name in SOUNDS:
        with wave.open(str(tmp_path / f"{name}.wav")) as new, wave.open(str(FOLDER / f"{name}.wav")) as old:
            assert new.getparams() == old.getparams()
            fresh, kept = (np.frombuffer(file.readframes(file.getnframes()), "<i2").astype(int) for file in (new, old))
        assert np.abs(fresh - kept).max() <= 1, "another machine's sine may round otherwise"


def test_sounds_are_told_apart_by_rhythm() -> None:
    """Number of tones: hold 2, disarm 3, stop 6."""
    counts = {}
    for name in SOUNDS:
        with wave.open(str(FOLDER / f"{name}.wav")) as file:
            samples = np.frombuffer(file.readframes(file.getnframes()), "<i2").astype(float)
        loudness = np.sqrt(np.convolve(samples**2, np.ones(220) / 220, "same"))
        loud = loudness > 0.1 * loudness.max()
        counts[name] = int(np.count_nonzero(np.diff(loud.astype(int)) == 1) + loud[0])
    assert counts == {"hold": 2, "disarm": 3, "stop": 6}


# ---- playing


@posix_only
@pytest.mark.parametrize(
    ("player", "arguments"),
    [("pw-play", []), ("paplay", []), ("aplay", ["-q"]), ("afplay", [])],
)
def test_whatever_player_there_is_gets_the_file(
    qtbot: QtBot, install: Install, make_sounds: Callable[..., AlertSounds], player: str, arguments: list[str]
) -> None:
    notes = install(player)
    sounds = make_sounds()
    sounds.play("disarm")
    assert sounds.playing == "disarm"
    quiet(qtbot, sounds)
    assert notes.read_text(encoding="utf-8").split() == [*arguments, str(FOLDER / "disarm.wav")]


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
def test_an_equal_or_milder_sound_does_not_interrupt(
    qtbot: QtBot, install: Install, make_sounds: Callable[..., AlertSounds]
) -> None:
    notes = install("aplay", "exec /bin/sleep 60")
    sounds = make_sounds()
    sounds.play("disarm")
    qtbot.waitUntil(lambda: played(notes) == ["disarm"])
    for name in ("hold", "disarm"):
        sounds.play(name)
    assert sounds.playing == "disarm"
    sounds.close()
    assert sounds.playing is None
    assert played(notes) == ["disarm"]


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
def test_a_player_that_does_not_start_is_given_up_too(
    qtbot: QtBot, install: Install, make_sounds: Callable[..., AlertSounds], beeps: list[int], tmp_path: Path
) -> None:
    install("aplay")
    sounds = make_sounds()
    (tmp_path / "bin" / "aplay").unlink()
    sounds.play("stop")
    qtbot.waitUntil(lambda: beeps == [1])
    assert sounds.playing is None


@posix_only
def test_a_player_that_hangs_is_ended(
    qtbot: QtBot, install: Install, make_sounds: Callable[..., AlertSounds], beeps: list[int]
) -> None:
    notes = install("aplay", "exec /bin/sleep 60")
    sounds = make_sounds()
    sounds._guard.setInterval(50)
    sounds.play("stop")
    qtbot.waitUntil(lambda: beeps == [1])
    assert len(played(notes)) <= 1


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
