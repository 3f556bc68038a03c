"""The Python API: the notebook, annotations, what importing the package loads, and another package called core."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lumenpilot
from core.annotation.store import DEFAULT_NAME
from core.devices import UserError
from tests.app.annotated import SIZE, annotate_masks, measure

ROOT = Path(__file__).resolve().parent.parent


def test_the_notebook_runs_from_its_first_cell_to_its_last(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("MPLBACKEND", "agg")
    book = json.loads((ROOT / "resources/examples/python_api.ipynb").read_text(encoding="utf-8"))
    names: dict[str, Any] = {}
    for cell in book["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            exec("".join(cell["source"]), names)
    import matplotlib.pyplot as plt

    plt.close("all")
    assert names["seen"].vessel.shape == names["picture"].shape[:2]
    assert names["seen"].pose is not None
    assert names["seen"].robot.any()
    assert len(names["line"].time_s) == 20
    assert names["rows"][0]["policy"] == "pursuit"
    perceiver = names["perceiver"]
    with pytest.raises(UserError, match="a picture is an array of uint8"):
        perceiver(np.zeros((10, 10)))


def test_annotations_are_lines_and_answers(tmp_path: Path) -> None:
    annotate_masks(tmp_path, 2)
    (picture, *_) = sorted(tmp_path.glob("*.png"))
    measure(tmp_path / DEFAULT_NAME, [picture], [20.0], rater="bea")
    mask, other, line = lumenpilot.read_annotations(tmp_path)
    assert (mask.image, mask.rater, mask.status, mask.theta_deg, len(mask.robot)) == (picture.name, "ann", "begun", None, 0)
    assert other.image != picture.name
    assert (line.rater, line.size, line.robot.shape[1]) == ("bea", SIZE, 2)
    assert line.theta_deg == pytest.approx(26.6, abs=1.0)


def test_what_cannot_be_opened_is_one_line(tmp_path: Path) -> None:
    for wrong in (
        lambda: lumenpilot.open_session(tmp_path),
        lambda: lumenpilot.read_annotations(tmp_path),
        lambda: lumenpilot.run_trials([0], policy="magic"),
        lambda: lumenpilot.run_trials([0], look="magic"),
        lambda: lumenpilot.Perceiver("magic"),
    ):
        with pytest.raises(UserError):
            wrong()


IMPORT = """
import sys
before = set(sys.modules)
import lumenpilot
assert not {name.partition(".")[0] for name in set(sys.modules) - before} & {"app", "core", "hardware", "numpy", "PySide6", "torch"}
lumenpilot.Session
assert not {"PySide6", "torch", "openvino", "mujoco"} & set(sys.modules)
"""
FOREIGN = """
import sys
sys.path.insert(0, sys.argv[1])
import lumenpilot
import core
assert core.THEIRS
try:
    lumenpilot.Perceiver
except ImportError as error:
    print(error)
"""


def test_importing_loads_little_and_leaves_another_package_called_core_alone(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-c", IMPORT], cwd=ROOT, check=True)
    (tmp_path / "core").mkdir()
    (tmp_path / "core/__init__.py").write_text("THEIRS = True")
    command = [sys.executable, "-c", FOREIGN, str(tmp_path)]
    told = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert told.startswith(f"another package called core comes first ({tmp_path}")
