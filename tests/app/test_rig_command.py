"""``rig list | show | board | calibrate``: texts, JSON, and one clear line for what cannot be."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from app import cli
from app.board_print import BoardPrintError, paper_for
from core.calibration.board import BoardError, BoardSpec, find_board
from core.calibration_config import CalibrationConfig
from core.config import load_config
from core.errors import UserError
from core.rig_file import find_rig, make_rig, rig_path, write_rig

runner = CliRunner()


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))


def _run(*arguments: str) -> str:
    result = runner.invoke(cli.app, ["rig", *arguments])
    if isinstance(result.exception, UserError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


def test_rigs_are_listed() -> None:
    assert "no rig files" in _run("list")
    write_rig(make_rig(load_config(), "bench 1", None))
    rig_path("broken").write_text("format = ")
    lines = _run("list").splitlines()
    assert lines[0].startswith("bench 1: bench twin, its own servos; not calibrated; made ")
    assert "no TOML" in lines[1]
    found = json.loads(_run("list", "--json"))
    assert [(one["name"], one["problem"] is None) for one in found["rigs"]] == [("bench 1", True), ("broken", False)]


def test_a_rig_is_shown() -> None:
    known = CalibrationConfig.model_validate(
        {
            "made_utc": "2025-01-01T00:00:00Z",
            "scale": {"mm_per_px": 0.32, "size_px": (640, 480), "method": "board", "uncertainty_share": 0.001},
        }
    )
    write_rig(make_rig(load_config(), "bench 1", known))
    text = _run("show", "bench 1")
    assert "scale: 0.3200 mm/px in the middle, ±0.10 % (by board)" in text
    assert "right +1, left +2" in text
    assert json.loads(_run("show", "bench 1", "--json"))["calibration"]["scale"]["mm_per_px"] == 0.32
    with pytest.raises(UserError, match="unknown rig 'x'; known: twin, realsense, webcam, bench 1"):
        _run("show", "x")


def test_the_board_is_printed_at_true_size(tmp_path: Path) -> None:
    out = tmp_path / "board.png"
    assert _run("board", "--out", str(out), "--square-mm", "12", "--columns", "8", "--rows", "6").strip() == str(out)
    image = cv2.imread(str(out))
    assert image is not None
    spec = BoardSpec(8, 6, 12.0)
    view = find_board(np.asarray(cv2.resize(image, None, fx=0.2, fy=0.2, interpolation=cv2.INTER_AREA)), spec)
    first, last = np.argmin(view.board_mm.sum(axis=1)), np.argmax(view.board_mm.sum(axis=1))
    apart_px, apart_mm = (np.hypot(*(points[last] - points[first])) for points in (view.pixels, view.board_mm))
    assert apart_px / apart_mm == pytest.approx(0.2 * 600 / 25.4, rel=1e-3)  # 600 dots per inch
    pdf = tmp_path / "board.pdf"
    _run("board", "--out", str(pdf))
    assert b"841.8" in pdf.read_bytes()  # A4 across, in points


def test_boards_that_cannot_be_printed(tmp_path: Path) -> None:
    assert [paper_for(BoardSpec()), paper_for(BoardSpec(10, 7, 30.0))] == ["A4", "A3"]
    with pytest.raises(BoardPrintError, match="fits on no paper"):
        _run("board", "--out", str(tmp_path / "b.pdf"), "--square-mm", "60")
    with pytest.raises(BoardPrintError, match=r"\.pdf or \.png"):
        _run("board", "--out", str(tmp_path / "b.jpg"))
    with pytest.raises(BoardPrintError, match="cannot be written"):
        _run("board", "--out", str(tmp_path / "none" / "b.pdf"))
    with pytest.raises(BoardError, match="40 x 4 squares needs 80 markers, and there are 50: take fewer squares"):
        _run("board", "--out", str(tmp_path / "b.pdf"), "--columns", "40", "--rows", "4", "--square-mm", "5")
    assert not (tmp_path / "b.pdf").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux's full device")
@pytest.mark.parametrize("ending", [".pdf", ".png"])
def test_a_full_disk_is_one_line(tmp_path: Path, ending: str) -> None:
    (tmp_path / f"b{ending}").symlink_to("/dev/full")
    with pytest.raises(BoardPrintError, match=r"cannot be written \(No space left on device\)"):
        _run("board", "--out", str(tmp_path / f"b{ending}"))


def test_a_calibration_without_servos_finds_the_scale() -> None:
    said = _run("calibrate", "bench 1", "--auto", "--steps", "board", "--pictures", "2")
    assert "scale: 0.322" in said
    _, rig = find_rig("bench 1")
    assert rig.calibration is not None
    assert rig.calibration.scale is not None
    assert rig.calibration.scale.mm_per_px == pytest.approx(1 / 3.1, rel=0.01)
    assert rig.calibration.steering is None


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("bench 1",), "say --auto"),
        (("twin", "--auto"), "cannot be called twin"),
        (("bench 1", "--auto", "--steps", "board,dance"), "unknown step 'dance'"),
        (("bench 1", "--auto", "--steps", ","), "--steps names no step; known: board, servos, zero, steering"),
        (("bench 1", "--auto", "--from", "bench 9"), "unknown rig 'bench 9'"),
        (("bench 1", "--auto", "--from", "webcam", "--steps", "board"), "webcam"),
    ],
)
def test_what_cannot_be_calibrated_is_one_line(arguments: tuple[str, ...], problem: str) -> None:
    with pytest.raises(UserError, match=problem) as told:
        _run("calibrate", *arguments)
    assert "\n" not in str(told.value)
    assert not rig_path("bench 1").exists()
