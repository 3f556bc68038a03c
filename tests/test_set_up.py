"""``make setup`` throws away no .venv that works, with a stand-in for Python that installs nothing and may be offline."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PYTHON = """#!/usr/bin/env bash
here=$(cd "$(dirname "$0")" && pwd)
[[ -z ${PYTHONPATH:-}${PYTHONHOME:-} ]] || { echo "PYTHONPATH or PYTHONHOME is set" >&2; exit 1; }
case "$*" in
"-m venv"*) [[ $* != *--clear* ]] || rm -rf "${@: -1}"; mkdir -p "${@: -1}/bin" && cp "$0" "${@: -1}/bin/python" ;;
"-m pip install"*) [[ ! -e offline ]] && : >"$here/../packages" ;;
-) cat >/dev/null ;;
esac
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """With the script, the interpreter in a folder with a blank in its name, and a lock of nothing."""
    folder = tmp_path / "a checkout"
    (folder / "scripts").mkdir(parents=True)
    for name in ("Makefile", "scripts/set_up.sh"):
        shutil.copy(ROOT / name, folder / name)
    (folder / "requirements.lock").write_text("# nothing\n")
    python = folder / "my python" / "python3.11"
    python.parent.mkdir()
    python.write_text(PYTHON)
    python.chmod(0o755)
    return folder


def set_up(checkout: Path, **more: str) -> subprocess.CompletedProcess[str]:
    env = {"PATH": os.environ["PATH"], "PYTHON": str(checkout / "my python" / "python3.11"), **more}
    script = ["bash", str(checkout / "scripts" / "set_up.sh")]
    return subprocess.run(script, env=env, capture_output=True, text=True, check=False, timeout=60)


def renew(checkout: Path, *, offline: bool) -> int:
    """Another version of the packages is wanted; the exit code."""
    with (checkout / "requirements.lock").open("a") as lock:
        lock.write("# newer\n")
    (checkout / "offline").touch() if offline else (checkout / "offline").unlink(missing_ok=True)
    return set_up(checkout).returncode


def test_a_venv_that_works_outlives_a_renewal_without_network(checkout: Path) -> None:
    assert set_up(checkout).returncode == 0
    venv = checkout / ".venv"
    assert {path.name for path in venv.iterdir()} == {"bin", "packages", ".ready"}
    (venv / "kept").touch()
    assert [renew(checkout, offline=True) for _ in range(3)] == [1, 1, 1]
    assert (venv / "packages").exists()
    assert renew(checkout, offline=False) == 0
    assert {path.name for path in venv.iterdir()} == {"bin", "packages", ".ready", "kept"}


def test_one_that_was_begun_and_never_worked_is_made_anew(checkout: Path) -> None:
    assert renew(checkout, offline=True) == 1
    left = checkout / ".venv" / "half_a_package"
    left.touch()
    assert renew(checkout, offline=False) == 0
    assert not left.exists()


def test_one_whose_python_is_gone_is_made_anew(checkout: Path) -> None:
    assert set_up(checkout).returncode == 0
    (checkout / ".venv" / "bin" / "python").unlink()
    (checkout / ".venv" / "of_another_python").touch()
    done = set_up(checkout)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in (checkout / ".venv").iterdir()} == {"bin", "packages", ".ready"}


def test_a_chosen_python_is_the_only_candidate(checkout: Path) -> None:
    done = set_up(checkout, PYTHON=str(checkout / "my python" / "python3.10"))
    assert done.returncode == 1
    assert "my python/python3.10 is not one" in done.stderr


def test_what_a_ros_set_up_exports_reaches_neither_script_nor_program(checkout: Path) -> None:
    ros = {"PYTHONPATH": "/opt/ros/lib", "PYTHONHOME": "/opt/ros"}
    done = set_up(checkout, **ros)
    assert done.returncode == 0, done.stderr
    env = {"PATH": os.environ["PATH"], **ros}
    ran = subprocess.run(["make", "-C", checkout, "run"], env=env, capture_output=True, text=True, check=False, timeout=60)
    assert ran.returncode == 0, ran.stderr
