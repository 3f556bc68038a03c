"""``phantom``: a drawing becomes a phantom; what is missing is one line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import app
from core.devices import UserError
from core.learning.dataset import write_png
from hardware.twin.own_phantom import read_phantom

PAGE = '<svg xmlns="http://www.w3.org/2000/svg" width="{width}" viewBox="0 0 320 240">{content}</svg>'
STROKES = '<path d="M0 120 H280 M120 120 C150 120 160 200 240 200" fill="none" stroke="#c00" stroke-width="20"/>'


@pytest.mark.parametrize(("width", "options"), [("160mm", []), ("320", ["--width-mm", "160"])])
def test_an_svg_of_strokes_becomes_a_phantom(tmp_path: Path, width: str, options: list[str]) -> None:
    drawing = tmp_path / "tree.svg"
    drawing.write_text(PAGE.format(width=width, content=STROKES))
    result = CliRunner().invoke(app, ["phantom", str(tmp_path / "own"), "--svg", str(drawing), "--json", *options])
    about = json.loads(result.stdout)
    assert about["targets"] == 2 and about["port_xy"][0] < 0
    assert about["diameter_mm"] == pytest.approx([10.0, 12.0], abs=2.0)
    assert read_phantom(f"bench:{tmp_path / 'own'}").title == "own"


def test_a_mask_of_any_size_becomes_a_phantom(tmp_path: Path) -> None:
    mask = np.zeros((960, 1280), np.uint8)
    mask[400:480, :1000] = 255
    write_png(tmp_path / "mask.png", mask)
    words = ["phantom", str(tmp_path / "own"), "--outline", str(tmp_path / "mask.png"), "--width-mm", "160", "--json"]
    about = json.loads(CliRunner().invoke(app, words).stdout)
    assert about["targets"] == 1 and about["diameter_mm"] == pytest.approx([10.0, 10.0], abs=0.7)


def test_what_is_missing_is_one_line(tmp_path: Path) -> None:
    def error(*options: str) -> str:
        result = CliRunner().invoke(app, ["phantom", str(tmp_path / "own"), *options])
        assert isinstance(result.exception, UserError)
        return str(result.exception)

    drawing = tmp_path / "tree.svg"
    drawing.write_text(PAGE.format(width="320", content=STROKES))
    assert "no scale" in error("--svg", str(drawing))
    assert "no bench there" in error("--width-mm", "100")
    drawing.write_text("no drawing")
    assert "is no SVG drawing" in error("--svg", str(drawing))
    assert "one of --outline" in error("--svg", str(drawing), "--csv", str(drawing))
    assert not (tmp_path / "own").exists()
