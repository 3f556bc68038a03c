"""Snapshots are written away from the GUI thread; a folder that cannot be written is one clear line."""

from __future__ import annotations

import json
from datetime import datetime
from pathlib import Path

import cv2
import numpy as np
import platformdirs
import pytest
from pytestqt.qtbot import QtBot

from app.ui.snapshot import Origin, SnapshotWriter, pictures_folder, write_snapshot
from tests.app.fakes import make_pose, make_scene, make_tick

NOW = datetime(2025, 3, 4, 5, 6, 7, 89_000)


def test_folder_is_the_users_pictures_unless_configured(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(platformdirs, "user_pictures_dir", lambda: str(tmp_path))
    assert pictures_folder(None) == tmp_path / "LumenPilot"
    assert pictures_folder("/data/shots") == Path("/data/shots")
    assert pictures_folder("~/shots") == Path.home() / "shots"


def test_three_files_are_written(tmp_path: Path) -> None:
    tick = make_tick(make_scene(make_pose(), index=41, captured_s=12.5))
    first = write_snapshot(tmp_path / "new" / "folder", tick, Origin("SIM", "tree", "default"), NOW)
    assert first.name == "2025-03-04_05-06-07_089.png"
    raw = cv2.imread(str(first))
    np.testing.assert_array_equal(raw[:, :, ::-1], tick.frame.image)
    overlay = cv2.imread(str(first.with_name("2025-03-04_05-06-07_089_overlay.png")))
    assert overlay.shape[1] == 1280
    record = json.loads(first.with_suffix(".json").read_text())
    assert record["state"] == "C"
    assert record["theta_signed_deg"] == pytest.approx(18.4)
    origin = {"rig": "SIM", "phantom": "tree", "model": "default", "frame": 41, "captured_s": 12.5}
    assert {key: record[key] for key in origin} == origin


def test_a_snapshot_of_the_same_moment_takes_no_others_place(tmp_path: Path) -> None:
    """Two keys within a millisecond, two windows, or a clock that was set back; any of the three files may be there."""
    first = write_snapshot(tmp_path, make_tick(), Origin("SIM"), NOW)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    (tmp_path / f"{first.stem}_2.json").write_text("another's own")
    third = write_snapshot(tmp_path, make_tick(), Origin("LIVE"), NOW)
    assert third.name == f"{first.stem}_3.png"
    assert json.loads(third.with_suffix(".json").read_text())["rig"] == "LIVE"
    assert {path: path.read_bytes() for path in before} == before
    assert {path.name for path in tmp_path.glob("*_2*")} == {f"{first.stem}_2.json"}


def test_writer_says_where_it_wrote(qtbot: QtBot, tmp_path: Path) -> None:
    writer = SnapshotWriter(tmp_path)
    with qtbot.waitSignal(writer.saved) as signal:
        writer.write(make_tick(), Origin("SIM"))
    assert str(tmp_path) in signal.args[0]
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize("obstacle", ["a file in the way", "a folder without a disk"])
def test_unwritable_folder_is_one_clear_line(qtbot: QtBot, tmp_path: Path, obstacle: str) -> None:
    if obstacle == "a file in the way":
        (tmp_path / "file").write_text("x")
        folder = tmp_path / "file" / "pictures"
    else:
        folder = Path("/proc/nothing/pictures")
    writer = SnapshotWriter(folder)
    with qtbot.waitSignal(writer.failed) as signal:
        writer.write(make_tick(), Origin("SIM"))
    message = signal.args[0]
    assert message.startswith("Snapshot not saved: ")
    assert "\n" not in message
    assert str(folder.parent) in message
