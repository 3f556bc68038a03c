"""``make setup`` throws away no .venv that works, with a stand-in for Python that installs nothing and may be offline."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
KERNELS = "core/perception"
PYTHON = """#!/usr/bin/env bash
here=$(cd "$(dirname "$0")" && pwd)
[[ -z ${PYTHONPATH:-}${PYTHONHOME:-} ]] || { echo "PYTHONPATH or PYTHONHOME is set" >&2; exit 1; }
[[ $* != main.py* || -z ${PYTHONSAFEPATH:-} ]] || { echo "PYTHONSAFEPATH is set" >&2; exit 1; }
case "$*" in
"-m venv"*) [[ $* != *--clear* ]] || rm -rf "${@: -1}"; mkdir -p "${@: -1}/bin" && cp "$0" "${@: -1}/bin/python" ;;
"-m pip install"*) [[ ! -e offline && $PIP_USER == 0 ]] && : >"$here/../packages" ;;
"-c from core.perception import kernels"*)
    [[ -z ${PYTHONSAFEPATH:-} && ! -e broken ]] || exit 1
    mkdir -p "$KERNELS/__pycache__" && touch "$KERNELS/__pycache__/kernels.thin-1.py311.nbi"
    echo >>"$here/../../compilations" && echo "$KERNELS/__pycache__" ;;
"-m pip uninstall"*) [[ ! -e record ]] || printf '%s\n' "$*" >>record ;;
-) [[ -e record ]] && exec "$REAL_PYTHON" - ; cat >/dev/null ;;
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
    (folder / KERNELS).mkdir(parents=True)
    (folder / KERNELS / "kernels.py").write_text("# as it was\n")
    python = folder / "my python" / "python3.11"
    python.parent.mkdir()
    python.write_text(PYTHON)
    python.chmod(0o755)
    return folder


def set_up(checkout: Path, **more: str) -> subprocess.CompletedProcess[str]:
    """With `PYTHON=""` an interpreter is looked for."""
    chosen = str(checkout / "my python" / "python3.11")
    env = {"PATH": os.environ["PATH"], "PYTHON": chosen, "REAL_PYTHON": sys.executable, "KERNELS": KERNELS, **more}
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
    assert {path.name for path in venv.iterdir()} == {"bin", "packages", ".ready", ".compiled"}
    (venv / "kept").touch()
    assert [renew(checkout, offline=True) for _ in range(3)] == [1, 1, 1]
    assert (venv / "packages").exists()
    assert renew(checkout, offline=False) == 0
    assert {path.name for path in venv.iterdir()} == {"bin", "packages", ".ready", ".compiled", "kept"}


def test_kernels_are_compiled_once_and_again_when_they_have_changed_or_the_machine_code_is_gone(checkout: Path) -> None:
    def compilations() -> int:
        assert set_up(checkout, PYTHONSAFEPATH="1").returncode == 0
        return len((checkout / "compilations").read_text().splitlines())

    assert [compilations(), compilations()] == [1, 1]
    (checkout / KERNELS / "kernels.py").write_text("# as it is\n")
    assert [compilations(), compilations()] == [2, 2]
    os.utime(checkout / KERNELS / "kernels.py", (1e9, 1e9))  # what is compiled goes by its time, too
    assert [compilations(), compilations()] == [3, 3]
    next((checkout / KERNELS / "__pycache__").glob("*.nbi")).unlink()
    assert [compilations(), compilations()] == [4, 4]
    assert renew(checkout, offline=False) == 0
    assert compilations() == 5
    checkout = checkout.rename(checkout.with_name("moved"))  # Numba goes by the place
    assert [compilations(), compilations()] == [6, 6]


def test_kernels_that_cannot_be_compiled_now_stop_nothing(checkout: Path) -> None:
    (checkout / "broken").touch()
    assert set_up(checkout).returncode == 0
    assert not (checkout / ".venv" / ".compiled").exists()
    (checkout / "broken").unlink()
    assert set_up(checkout).returncode == 0
    assert (checkout / ".venv" / ".compiled").exists()


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
    assert {path.name for path in (checkout / ".venv").iterdir()} == {"bin", "packages", ".ready", ".compiled"}


def test_a_chosen_python_is_the_only_candidate(checkout: Path) -> None:
    done = set_up(checkout, PYTHON=str(checkout / "my python" / "python3.10"))
    assert done.returncode == 1
    assert "my python/python3.10 is not one" in done.stderr


def test_what_the_lock_does_not_list_is_taken_out(checkout: Path) -> None:
    """The stand-in asks the tests' own interpreter, in which nothing is changed, what is installed."""
    (checkout / "record").touch()
    shutil.copy(ROOT / "requirements.lock", checkout)
    done = set_up(checkout)
    assert done.returncode == 0, done.stderr
    assert "taking out" not in done.stderr
    lines = (checkout / "requirements.lock").read_text().splitlines()
    (checkout / "requirements.lock").write_text("\n".join(line for line in lines if not line.startswith(("numpy==", "av=="))))
    done = set_up(checkout)
    assert "set-up: taking out what requirements.lock does not list: av numpy\n" in done.stderr
    *_, last = (checkout / "record").read_text().splitlines()
    assert last.startswith("-m pip uninstall ")
    assert last.endswith(" av numpy")
    (checkout / "record").write_text("")
    assert set_up(checkout).returncode == 0
    assert (checkout / "record").read_text() == "", "nothing is asked when nothing has changed"


def test_a_venv_that_works_is_renewed_without_another_python(checkout: Path) -> None:
    assert set_up(checkout).returncode == 0
    shutil.rmtree(checkout / "my python")
    assert renew(checkout, offline=False) == 0
