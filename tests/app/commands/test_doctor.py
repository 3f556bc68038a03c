"""``doctor`` as a script and as a person call it."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from app.commands.doctor import doctor
from core.config.models import Config
from core.config.rig_file import RigFileError
from core.devices import UserError
from hardware.preflight.checks import Check
from hardware.rig import RigKind, rig_config
from tests.app.program import run, run_apart


def _exit_code(*, as_json: bool) -> object:
    with pytest.raises(SystemExit) as left:
        doctor(as_json)
    return left.value.code


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "bench.toml"
    path.write_text(
        "[gamepad]\nenabled = false\n"
        f'[record]\nfolder = "{tmp_path}"\nwarn_free_mb = 0\nwarn_free_share = 0\n'
        '[perception.segmentation]\ndevice = "openvino"\nthreads = 1\n'
    )
    return path


@pytest.mark.slow
def test_a_script_gets_one_json_object_and_the_exit_code(config: Path) -> None:
    done = run_apart("doctor", "--json", "--config", config)
    checks = json.loads(done.stdout)["checks"]
    assert all(check.keys() == {"name", "ok", "detail", "fix"} for check in checks)
    assert done.returncode == (0 if all(check["ok"] for check in checks) else 1)
    found = {check["name"]: check for check in checks}
    assert found["self-test"]["ok"], found["self-test"]
    assert found["servos"] == {"name": "servos", "ok": True, "detail": "not configured", "fix": ""}


@pytest.mark.parametrize("arguments", [("--rig", "moon"), ("--config", "gone.toml")])
def test_bad_input_is_one_line_and_exit_code_2(arguments: tuple[str, ...]) -> None:
    done = run("doctor", "--json", *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1


def test_people_get_a_table_and_what_to_do(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    long = "echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer   # and so on, far beyond the width of a terminal"
    checks = [Check("clock", True, "monotonic"), Check("adapter latency", False, "16 ms", long)]
    monkeypatch.setattr("hardware.preflight.preflight.run_checks", lambda _config: iter(checks))
    assert _exit_code(as_json=False) == 1
    lines = capsys.readouterr().out.splitlines()
    assert any(line.split() == ["NOT", "OK", "adapter", "latency", "16", "ms"] for line in lines)
    assert any(line.split() == ["ok", "clock", "monotonic"] for line in lines)
    assert lines[-2:] == ["What to do:", f"  adapter latency: {long}"]
    checks.pop()
    assert _exit_code(as_json=False) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "All is well."


def test_a_package_that_does_not_load_is_told_without_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "hardware.preflight.preflight", None)
    assert _exit_code(as_json=False) == 1
    told = " ".join(capsys.readouterr().out.split())
    assert "NOT OK all others not made, since the program does not load: import of hardware.preflight.preflight halted" in told


# --- which rig a command means ---------------------------------------------------------------------------------------------------


def _bench(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "rig.toml"
    path.write_text(text)
    return path


def test_without_a_name_the_configured_rig_is_meant(tmp_path: Path) -> None:
    config, kind = rig_config(None, None, None)
    assert (config.rig.camera, kind) == ("twin", RigKind.SIM)
    path = _bench(tmp_path, '[rig]\nname = "bench 2"\ncamera = "webcam"\nrobot = "none"\n')
    config, kind = rig_config(None, path, None)
    assert (config.rig.name, kind) == ("bench 2", RigKind.LIVE)
    assert rig_config("webcam", path, None)[0] == config


@pytest.mark.parametrize("name", ["realsense", "webcam", "basler"])
def test_a_real_camera_drives_servos_only_when_their_port_is_known(name: str, tmp_path: Path) -> None:
    config, kind = rig_config(name, None, None)
    assert (config.rig.name, config.rig.camera, config.rig.robot, kind) == (name, name, "none", RigKind.LIVE)
    config, kind = rig_config(name, _bench(tmp_path, '[servos]\nport = "/dev/ttyUSB7"\n'), None)
    assert (config.rig.robot, config.servos.port, kind) == ("servos", "/dev/ttyUSB7", RigKind.LIVE)


def test_the_twin_never_touches_the_bench(tmp_path: Path) -> None:
    path = _bench(tmp_path, '[rig]\ncamera = "realsense"\nrobot = "servos"\n[servos]\nport = "/dev/ttyUSB7"\n')
    config, kind = rig_config("twin", path, None)
    assert (config.rig.camera, config.rig.robot, config.servos.port, kind) == ("twin", "twin", None, RigKind.SIM)


def test_a_realsense_recording_is_to_be_converted(tmp_path: Path) -> None:
    (tmp_path / "run.bag").touch()
    with pytest.raises(UserError, match=r"run\.bag: RealSense recordings are not played: rs-convert -c -i "):
        rig_config(None, None, tmp_path / "run.bag")


def test_an_unknown_rig_names_the_known_ones() -> None:
    with pytest.raises(RigFileError, match="unknown rig 'moon'; known: twin, realsense, webcam, basler"):
        rig_config("moon", None, None)
    assert Config().rig.camera == "twin"
