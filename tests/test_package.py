"""The package that ``pip install .`` makes, and the program without the optional packages."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from email import message_from_bytes
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from hatchling import build

from app.cli import main
from app.commands import synth
from core import program
from core.files import write_atomic
from core.learning.dataset import png
from core.program import EXTRAS, program_version

ROOT = Path(__file__).resolve().parent.parent
MAX_BYTES = 40_000_000
"""What a wheel may have."""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built without isolation, by the backend that pyproject.toml names; some seconds."""
    folder, before = tmp_path_factory.mktemp("wheel"), Path.cwd()
    os.chdir(ROOT)
    try:
        return folder / build.build_wheel(str(folder))
    finally:
        os.chdir(before)


def test_the_wheel_holds_all_that_the_program_needs_and_nothing_else(wheel: Path) -> None:
    names = set(ZipFile(wheel).namelist())
    wanted = {
        "lumenpilot/__init__.py",
        "lumenpilot/__main__.py",
        "lumenpilot/api.py",
        "lumenpilot/gym.py",
        "lumenpilot/main.py",
        "lumenpilot/commit",
    }
    wanted |= {"lumenpilot/scripts/desktop.sh"}
    for layer in ("app", "core", "hardware", "resources"):
        files = (path for path in (ROOT / layer).rglob("*") if path.is_file() and "__pycache__" not in path.parts)
        wanted |= {f"lumenpilot/{path.relative_to(ROOT).as_posix()}" for path in files}
    assert {name for name in names if ".dist-info/" not in name} == wanted
    assert any(name.endswith("licenses/resources/fonts/OFL.txt") for name in names)
    assert wheel.stat().st_size < MAX_BYTES


def test_each_optional_package_comes_with_its_extra_alone(wheel: Path) -> None:
    with ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        metadata = message_from_bytes(archive.read(name))
    assert metadata["Version"] == program_version()
    lines = metadata.get_all("Requires-Dist") or []
    for package, extra in EXTRAS.items():
        distribution = "scikit_image" if package == "skimage" else package
        found = [line for line in lines if line.replace("-", "_").startswith(distribution)]
        assert all("extra ==" in line for line in found), package
        comes_by_another = package in ("dask", "mcap")
        assert comes_by_another or any(f"extra == '{extra}'" in line for line in found), package


def test_the_unpacked_wheel_runs_elsewhere(wheel: Path, tmp_path: Path) -> None:
    """Command, module, and what finds the program by ``import lumenpilot`` alone, as Dask workers do."""
    ZipFile(wheel).extractall(tmp_path / "site")
    env = {**os.environ, "PYTHONPATH": str(tmp_path / "site")}
    with_module = [sys.executable, "-m", "lumenpilot"]
    told = subprocess.run([*with_module, "--version"], cwd=tmp_path, env=env, capture_output=True, text=True, check=True).stdout
    assert told.startswith(f"lumenpilot {program_version()}")
    help_page = subprocess.run([*with_module, "rig", "--help"], cwd=tmp_path, env=env, capture_output=True, text=True, check=True)
    assert help_page.stdout.startswith("Usage: lumenpilot rig ")
    code = "import lumenpilot, app.commands.workers as w; print(w.ROOT, w.code_of_worker())"
    alone = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=env, capture_output=True, text=True, check=True)
    checkout = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    (where, one), (_, other) = alone.stdout.split(), checkout.stdout.split()
    assert Path(where) == tmp_path / "site" / "lumenpilot"
    assert one == other, "workers of a package and of a checkout of the same state work together"


BLOCKED = """
import importlib, sys
from importlib.abc import MetaPathFinder

blocked = sys.argv[1].split(",")

class Block(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in blocked:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Block())
of_linux = ("fcntl", "termios", "pty", "tty", "resource", "grp", "pwd")
sys.modules |= dict.fromkeys(of_linux)
from app.cli import COMMANDS, main
for name in ("annotate", "evaluate", "perceive", "train", "play", "session"):
    importlib.import_module(COMMANDS[name][0])
for module in ("app.annotator.window", "app.player.window", "app.commands.evaluation_report"):
    importlib.import_module(module)
words = sys.argv[2:]
sys.argv = ["main.py", "session", "info", "tests/data/golden_session"]
main()
sys.argv = ["main.py", *words]
main()
for name in of_linux:
    del sys.modules[name]
for module, _ in COMMANDS.values():
    importlib.import_module(module)
for module in ("app.operator.window", "hardware.rig", "hardware.twin.server"):
    importlib.import_module(module)
"""


def test_the_base_runs_without_the_optional_packages_and_what_raters_need_without_linux(tmp_path: Path) -> None:
    picture = tmp_path / "noise.png"
    write_atomic(picture, png(np.random.default_rng(0).integers(0, 255, (120, 160, 3), np.uint8)))
    command = [sys.executable, "-c", BLOCKED, ",".join(EXTRAS), "perceive", str(picture), "--jsonl", str(tmp_path / "told.jsonl")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=240)
    assert done.returncode == 0, done.stderr
    assert "golden_session" in done.stdout
    assert '"network"' in (tmp_path / "told.jsonl").read_text()


RATERS = """
import sys
from pathlib import Path

sys.modules |= dict.fromkeys(("fcntl", "termios", "pty", "tty", "resource", "grp", "pwd"))
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

wait = QApplication.exec

def shown_for_a_moment(_application):
    def close():
        print("shown:", *(type(window).__name__ for window in QApplication.topLevelWidgets() if window.isVisible()))
        QApplication.closeAllWindows()

    QTimer.singleShot(1000, close)
    return wait()

QApplication.exec = shown_for_a_moment
from app.cli import main
frames, folder = sys.argv[1], Path(sys.argv[2])
for words in (
    ("annotate", folder / "golden_session"),
    ("play", folder / "golden_session"),
    ("train", "--data", frames, "--steps", "2", "--batch", "1", "--crop", "64", "--base", "4", "--out", folder / "model"),
    ("evaluate", frames, "--out", folder / "report"),
):
    sys.argv = ["main.py", *map(str, words)]
    try:
        main()
    except SystemExit as end:
        assert not end.code, words
"""


@pytest.mark.slow
def test_raters_annotate_play_train_and_evaluate_where_python_has_no_modules_of_posix(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "tests/data/golden_session", tmp_path / "golden_session")
    synth.make_set(tmp_path / "set", 4, seed=5)
    command = [sys.executable, "-c", RATERS, str(tmp_path / "set"), str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "shown: AnnotatorWindow" in done.stdout
    assert "shown: PlayerWindow" in done.stdout
    assert (tmp_path / "model" / "model.json").is_file()
    assert any((tmp_path / "report").iterdir())


_NOT_THERE = "the package {}, which is not installed: make setup"
_SYNTH = ("synth", "--out", "x", "--count", "4")


@pytest.mark.parametrize(
    ("missing", "words", "needed"),
    [
        ("torch", ("train", "--synthetic", "4", "--out", "x"), _NOT_THERE.format("torch")),
        ("onnx", _SYNTH, _NOT_THERE.format("onnx")),
        ("fcntl", _SYNTH, "Linux, as all that drives does; annotate, evaluate, perceive, train, play and session run here, too"),
    ],
)
def test_what_is_missing_is_one_line(
    missing: str, words: tuple[str, ...], needed: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Asked for before long work begins, or found missing by the import itself."""

    def fail(*_: object, **__: object) -> None:
        raise ModuleNotFoundError(f"No module named {missing!r}", name=missing)

    monkeypatch.setattr(program.util, "find_spec", lambda name: None)
    monkeypatch.setattr(synth, "make_set", fail)
    monkeypatch.setattr(sys, "argv", ["main.py", *words])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 2
    assert capsys.readouterr().err == f"error: this needs {needed}\n"
