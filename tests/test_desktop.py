"""``make install`` puts three files into a home folder and ``make uninstall`` leaves it as it was."""

from __future__ import annotations

import configparser
import os
import re
import shlex
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parent.parent
SCRIPT = ROOT / "scripts" / "desktop.sh"
ODD = 'a "home" of $MINE `x` 100% \\'


def run(what: str, home: Path, **more: str) -> subprocess.CompletedProcess[str]:
    env = {"PATH": os.environ["PATH"], "HOME": str(home), **more}
    return subprocess.run(["bash", str(SCRIPT), what], env=env, capture_output=True, text=True, check=False, timeout=60)


def tree(home: Path) -> dict[str, str]:
    return {str(path.relative_to(home)): path.read_text() if path.is_file() else "" for path in sorted(home.rglob("*"))}


@pytest.fixture(params=["home", ODD])
def home(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    folder = tmp_path / request.param
    folder.mkdir()
    return folder


def entry_of(path: Path) -> configparser.SectionProxy:
    parser = configparser.ConfigParser(interpolation=None, comment_prefixes=("#",))
    parser.optionxform = str
    parser.read_string(path.read_text())
    return parser["Desktop Entry"]


def program_of(exec_line: str) -> str:
    """As a desktop reads it: the escapes of the file, then the quoted argument with its own, then %%."""
    line = exec_line.replace("\\\\", "\\")
    assert (line[0], line[-1]) == ('"', '"')
    return re.sub(r'\\(["`$\\])', r"\1", line[1:-1]).replace("%%", "%")


def test_a_home_is_as_it_was_after_uninstall(home: Path) -> None:
    (home / ".local" / "share").mkdir(parents=True)
    (home / ".local" / "share" / "notes").write_text("mine")
    before = tree(home)
    assert run("install", home).returncode == 0
    assert set(tree(home)) > set(before)
    assert run("uninstall", home).returncode == 0
    assert tree(home) == before


def test_the_desktop_finds_launcher_and_icon(home: Path) -> None:
    assert run("install", home).returncode == 0
    launcher = home / ".local" / "bin" / "lumenpilot"
    entry = entry_of(home / ".local" / "share" / "applications" / "lumenpilot.desktop")
    assert program_of(entry["Exec"]) == str(launcher)
    assert entry["TryExec"].replace("\\\\", "\\") == str(launcher)
    assert (entry["Type"], entry["Name"], entry["Terminal"]) == ("Application", "LumenPilot", "false")
    assert entry["Categories"].endswith(";")
    assert os.access(launcher, os.X_OK)
    icon = home / ".local" / "share" / "icons" / "hicolor" / "scalable" / "apps" / f"{entry['Icon']}.svg"
    assert ElementTree.parse(icon).getroot().tag.endswith("svg")


def test_the_launcher_starts_this_checkout_with_what_it_is_given(home: Path) -> None:
    assert run("install", home).returncode == 0
    launcher = home / ".local" / "bin" / "lumenpilot"
    text = launcher.read_text()
    assert f"checkout={shlex.quote(str(ROOT))}" in text or f"checkout={ROOT}" in text
    checkout = home / "moved"
    (checkout / ".venv" / "bin").mkdir(parents=True)
    fake = checkout / ".venv" / "bin" / "python"
    fake.write_text('#!/bin/sh\nprintf "%s\\n" "$@" $PYTHONPATH $PYTHONHOME\n')
    fake.chmod(0o755)
    launcher.write_text(re.sub(r"^checkout=.*$", lambda _found: f"checkout={shlex.quote(str(checkout))}", text, flags=re.MULTILINE))
    ros = {**os.environ, "PYTHONPATH": "/opt/ros/lib", "PYTHONHOME": "/opt/ros"}
    done = subprocess.run([launcher, "perceive", "my picture.png"], env=ros, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [str(checkout / "main.py"), "perceive", "my picture.png"]
    fake.unlink()
    lost = subprocess.run([launcher], capture_output=True, text=True, check=False)
    assert lost.returncode == 1
    assert "make install" in lost.stderr


def test_a_package_brings_its_own_launcher(home: Path) -> None:
    """It is neither written nor taken away."""
    command = home / "tools" / "lumenpilot"
    command.parent.mkdir()
    command.write_text("of the package")
    before = tree(home)
    done = run("install", home, LUMENPILOT_COMMAND=str(command))
    assert done.returncode == 0, done.stderr
    entry = entry_of(home / ".local" / "share" / "applications" / "lumenpilot.desktop")
    assert program_of(entry["Exec"]) == str(command)
    assert not (home / ".local" / "bin").exists()
    assert run("uninstall", home, LUMENPILOT_COMMAND=str(command)).returncode == 0
    assert tree(home) == before


def test_what_is_not_ours_is_left_alone(tmp_path: Path) -> None:
    launcher = tmp_path / ".local" / "bin" / "lumenpilot"
    launcher.parent.mkdir(parents=True)
    launcher.write_text("somebody else's")
    before = tree(tmp_path)
    done = run("install", tmp_path)
    assert done.returncode == 1
    assert str(launcher) in done.stderr
    assert tree(tmp_path) == before, "nothing was begun"
    assert "left" in run("uninstall", tmp_path).stdout
    assert tree(tmp_path) == before
