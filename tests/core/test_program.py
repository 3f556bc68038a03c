"""What the program says of itself, and which command it names for an optional package."""

import re
import sys
from pathlib import Path

import pytest

from core import program
from core.devices import UserError
from core.program import as_called, how_to_install, import_problem, need_package, program_commit, program_version


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """As if the program were the package in this folder."""
    monkeypatch.setattr(program, "ROOT", tmp_path)
    monkeypatch.setattr(program, "CALLED", "lumenpilot")
    return tmp_path


def test_a_checkout_says_version_and_commit() -> None:
    assert re.fullmatch(r"\d+\.\d+\.\d+", program_version())
    assert re.fullmatch(r"[0-9a-f]{12}\+?", program_commit() or "0" * 12)  # an unpacked archive knows none


def test_a_package_says_the_commit_that_it_was_built_from(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program, "COMMIT_FILE", installed / "commit")
    (installed / "commit").write_text("0123456789ab\n")
    assert program_commit() == "0123456789ab"
    (installed / "commit").write_text("")
    assert program_commit() is None


def test_messages_name_the_command_that_there_is(installed: Path) -> None:
    assert as_called("see main.py doctor") == "see lumenpilot doctor"
    (installed / "pyproject.toml").touch()
    assert as_called("see main.py doctor") == "see main.py doctor"


@pytest.mark.parametrize(
    ("has_pip", "receipt", "command"),
    [
        (True, False, f'{sys.executable} -m pip install "lumenpilot[train]"'),
        (False, False, f'uv pip install --python {sys.executable} "lumenpilot[train]"'),
        (False, True, 'uv tool install --force "lumenpilot[train]"'),
    ],
)
def test_a_missing_package_is_one_command(
    has_pip: bool, receipt: bool, command: str, installed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(program.util, "find_spec", lambda name: name if name == "pip" and has_pip else None)
    monkeypatch.setattr(sys, "prefix", str(installed))
    if receipt:
        (installed / "uv-receipt.toml").touch()
    assert how_to_install("torch") == command
    with pytest.raises(UserError) as told:
        need_package("torch")
    assert str(told.value) == f"this needs the package torch, which is not installed: {command}"
    (installed / "pyproject.toml").touch()
    assert how_to_install("torch") == "make setup"


def test_other_import_errors_are_no_import_problems() -> None:
    assert import_problem(ModuleNotFoundError("x", name="torch.nn")) is not None
    assert import_problem(ModuleNotFoundError("x", name="numpy")) is None
    assert import_problem(ImportError("libcudart.so", name="torch")) is None
