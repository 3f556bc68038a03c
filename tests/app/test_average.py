"""``average`` on the command line: what it writes, and what it refuses in one line."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.average_command import run_average
from app.cli import app
from core.errors import UserError
from core.learning.model_file import INFO, MODELS, ONNX, WEIGHTS, read_model_info, sha256_of


@pytest.fixture
def twin_of_default(tmp_path: Path) -> Path:
    return Path(shutil.copytree(MODELS / "default", tmp_path / "mine"))


def test_the_shipped_model_and_its_copy(twin_of_default: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["average", "default", str(twin_of_default), "--out", str(tmp_path / "mean")])
    assert done.exit_code == 0, done.output
    assert f"calibrate SET --eight-bit --model {tmp_path / 'mean'}" in done.output
    info = read_model_info(tmp_path / "mean", verify=(WEIGHTS, ONNX))
    assert info.training == {"mean_of": ["default", "mine"]}
    assert sha256_of(tmp_path / "mean" / WEIGHTS) == sha256_of(MODELS / "default" / WEIGHTS)


def test_what_has_no_mean(twin_of_default: Path, tmp_path: Path) -> None:
    before = json.loads((twin_of_default / INFO).read_text())
    with pytest.raises(UserError, match="name two models at least"):
        run_average(["default"], tmp_path / "mean")
    with pytest.raises(UserError, match="is its own mean"):
        run_average(["default", str(MODELS / "default")], tmp_path / "mean")
    with pytest.raises(UserError, match="is a model already; choose another --out"):
        run_average(["default", str(twin_of_default)], twin_of_default)
    with pytest.raises(UserError, match="no model 'nobody'"):
        run_average(["default", "nobody"], tmp_path / "mean")
    assert json.loads((twin_of_default / INFO).read_text()) == before
    assert not (tmp_path / "mean").exists()
