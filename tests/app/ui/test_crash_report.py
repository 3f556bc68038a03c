"""An error that nobody foresaw: servos stop, the recording is whole, a report lies where the dialog says. With real processes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from app.ui.crash_report import Crash, CrashWatch, crash_of_last_run, scrubbed
from core.program import program_version
from core.session.manifest import read_manifest
from core.session.reader import SessionReader

CHILD = Path(__file__).parents[1] / "crashing_window.py"


def run(which: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(CHILD), which, str(folder)], capture_output=True, text=True, timeout=120, check=False
    )


def test_errors_stop_the_servos_end_the_recording_and_are_reported_once(tmp_path: Path) -> None:
    done = run("errors", tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["acts"][0] == "stop"
    assert len(told["boxes"]) == 1, "two errors, one dialog"
    assert told["modal"] == [False], "STOP stays within reach"
    assert "ZeroDivisionError" in told["boxes"][0]
    (report,) = (tmp_path / "crashes").glob("*.txt")
    assert str(report) in told["boxes"][0]
    session = Path(told["saved"])
    manifest = read_manifest(session)
    assert manifest.closed
    assert manifest.ended == "the program met an unforeseen error"
    with SessionReader(session) as reader:
        assert reader.wait(10.0)
        assert len(reader) >= 5
        assert not reader.problems
    text = report.read_text()
    wanted = ("== versions", f"lumenpilot {program_version()}", "openvino", "== configuration", '"perception"', "in fail")
    for part in (*wanted, "thread helper", "== error 2", "== last lines of the log"):
        assert part in text
    assert str(Path.home()) not in text
    assert not list((tmp_path / "crashes").glob("*.fault"))


def test_a_memory_fault_is_mentioned_at_the_next_start_once(tmp_path: Path) -> None:
    done = run("fault", tmp_path)
    assert done.returncode < 0
    assert done.stdout == "going\n"
    crash = crash_of_last_run(tmp_path / "crashes")
    assert "Segmentation fault" in crash.what
    text = crash.report.read_text()
    assert "crashing_window.py" in text
    assert "openvino" in text
    assert crash_of_last_run(tmp_path / "crashes") is None
    assert crash.report.is_file()
    (session,) = (tmp_path / "sessions").glob("session_*")  # what the next start offers to recover
    assert not read_manifest(session).closed


# ---- the watch by itself


@pytest.fixture
def watch(tmp_path: Path) -> Iterator[CrashWatch]:
    watch = CrashWatch(tmp_path, lambda: {"rig": {"name": "twin"}})
    yield watch
    watch.remove()


def error(text: str = "broken") -> Any:
    try:
        raise RuntimeError(text)
    except RuntimeError:
        return sys.exc_info()


def test_the_robot_is_made_safe_before_the_report_is_written(watch: CrashWatch, tmp_path: Path) -> None:
    seen: list[object] = []
    watch.on_error = lambda _is_first: seen.append(list(tmp_path.glob("*.txt")))
    watch.on_report = seen.append
    watch.report(error(), "gui")
    assert seen[0] == []
    assert isinstance(seen[1], Crash)
    assert seen[1].what == "RuntimeError: broken"
    assert seen[1].report in list(tmp_path.glob("*.txt"))


def test_what_fails_while_it_is_made_safe_hinders_no_report(watch: CrashWatch) -> None:
    told: list[Crash] = []

    def also_broken(_is_first: bool) -> None:
        raise ValueError("no pilot")

    watch.on_error, watch.on_report = also_broken, told.append
    watch.report(error(), "gui")
    assert told[0].report is not None


def test_without_a_folder_it_is_still_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    watch = CrashWatch(tmp_path / "file" / "crashes", dict)
    told: list[Crash] = []
    watch.on_report = told.append
    watch.install()
    try:
        watch.report(error(), "gui")
    finally:
        watch.remove()
    assert told[0].report is None


def test_an_error_that_comes_with_every_repaint_makes_the_robot_safe_and_does_not_fill_the_disk(
    watch: CrashWatch, tmp_path: Path
) -> None:
    told: list[Crash] = []
    asked: list[bool] = []
    watch.on_error = asked.append
    watch.on_report = told.append
    for _ in range(200):
        watch.report(error(), "gui")
    (report,) = tmp_path.glob("*.txt")
    assert report.read_text().count("== error") == 20
    assert len(told) == 1
    assert asked == [True] + 199 * [False]


def test_a_run_that_goes_on_or_was_killed_is_no_crash(tmp_path: Path) -> None:
    (tmp_path / f"crash_20260101T000000Z_{os.getpid()}.fault").write_text("not yet finished")
    dead = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True, check=True)
    killed = tmp_path / f"crash_20260101T000000Z_{dead.stdout.strip()}.fault"
    killed.write_text("")
    assert crash_of_last_run(tmp_path) is None
    assert not killed.exists()
    assert len(list(tmp_path.iterdir())) == 1


def test_personal_paths_are_left_out() -> None:
    assert scrubbed(f"open {Path.home()}/videos/x.mkv") == "open ~/videos/x.mkv"
    assert "<python>" in scrubbed(f"{sys.prefix}/lib/python3.11/site-packages/cv2")
