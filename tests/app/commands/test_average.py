"""``average`` on the command line: what it writes, and what it refuses in one line."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
import torch
from typer.testing import CliRunner

from app.cli import app
from app.commands.average import run_average
from core.devices import UserError
from core.perception.model_file import INFO, MODELS, ONNX, SECOND_LOOK, WEIGHTS, load_network, read_model_info, sha256_of


@pytest.fixture
def twin_of_default(tmp_path: Path) -> Path:
    return Path(shutil.copytree(MODELS / "default", tmp_path / "mine"))


def test_the_shipped_model_and_its_copy(twin_of_default: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["average", "default", str(twin_of_default), "--out", str(tmp_path / "mean")])
    assert done.exit_code == 0, done.output
    assert f"calibrate SET --eight-bit --model {tmp_path / 'mean'}" in done.output
    info = read_model_info(tmp_path / "mean", verify=(WEIGHTS, ONNX))
    assert info.training == {"mean_of": [sha256_of(MODELS / "default" / WEIGHTS)] * 2}
    for part in ("", SECOND_LOOK):
        mean, one = (load_network(folder / part)[0].state_dict() for folder in (tmp_path / "mean", MODELS / "default"))
        for name, tensor in mean.items():
            torch.testing.assert_close(tensor, one[name], rtol=2**-11, atol=1e-7)  # in half precision, if the shipped one is not


def test_what_has_no_mean(twin_of_default: Path, tmp_path: Path) -> None:
    before = json.loads((twin_of_default / INFO).read_text())
    with pytest.raises(UserError, match="name two models at least"):
        run_average(["default"], tmp_path / "mean")
    with pytest.raises(UserError, match="is its own mean"):
        run_average(["default", str(MODELS / "default")], tmp_path / "mean")
    for within in (twin_of_default / "mean", twin_of_default / "second_look"):
        with pytest.raises(UserError, match="lies within a model that is read for it; choose another --out"):
            run_average(["default", str(twin_of_default)], within)
    third = Path(shutil.copytree(twin_of_default, tmp_path / "third"))
    for already in (twin_of_default, third):
        with pytest.raises(UserError, match="is a model already; choose another --out"):
            run_average(["default", str(twin_of_default)], already)
    with pytest.raises(UserError, match="no model 'nobody'"):
        run_average(["default", "nobody"], tmp_path / "mean")
    assert json.loads((twin_of_default / INFO).read_text()) == before
    assert not (tmp_path / "mean").exists()


def test_a_bare_name_is_told_as_the_folder_that_it_is(
    twin_of_default: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Else the advice would lead to the shipped model of that name."""
    (tmp_path / "my lab").mkdir()
    monkeypatch.chdir(tmp_path / "my lab")
    run_average(["default", str(twin_of_default)], Path("default"))
    assert f"--eight-bit --model '{tmp_path / 'my lab' / 'default'}'\n" in capsys.readouterr().err
    assert read_model_info(tmp_path / "my lab" / "default").training["mean_of"]
