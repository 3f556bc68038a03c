"""The plugins of docs/development.md, installed from a folder as a package, each used as the program uses it."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

import pytest

from app.commands.session import export
from core.config.models import Config, ConfigError, load_config
from core.config.rig_file import make_rig, read_rig, write_rig
from core.config.schema import settings_by_key
from core.control.policies import make_policy
from core.devices import DeviceError
from core.plugins import PluginError
from core.types import Speed
from hardware.preflight.device_checks import check_camera
from hardware.rig import RigKind, find_devices, open_rig, rig_config, with_camera
from hardware.servos.bus_process import make_bus
from hardware.servos.drive import DriveBus
from hardware.servos.registers import ServoState
from tests.core.driving_scenes import STRAIGHT, scene_at
from tests.core.robots import THREE

ROOT = Path(__file__).resolve().parent.parent
SESSION = ROOT / "tests/data/golden_session"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the package ``lab-bench``, which is on the path: what pip makes of the example."""
    text = (ROOT / "docs/development.md").read_text(encoding="utf-8")
    section = text[text.index("## Plugins") : text.index("## Add a servo model")]
    (points,) = re.findall(r"```toml\n(.*?)```", section, re.DOTALL)
    lines: list[str] = []
    for group, entries in tomllib.loads(points)["project"]["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {target}" for name, target in entries.items())]
    site = tmp_path / "site"
    info = site / "lab_bench-0.1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lab-bench\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text("\n".join(lines))
    (site / "lab_bench.py").write_text("".join(re.findall(r"```python\n(.*?)```", section, re.DOTALL)))
    monkeypatch.syspath_prepend(site)
    monkeypatch.delitem(sys.modules, "lab_bench", raising=False)
    return site


@pytest.mark.usefixtures("installed", "own_folder")
def test_a_camera_of_a_plugin_is_a_live_rig() -> None:
    (found,) = [camera for camera in find_devices().cameras if camera.kind == "lab_camera"]
    config = with_camera(load_config(), found)
    assert check_camera(config).ok
    assert rig_config("lab_camera", None, None)[1] is RigKind.LIVE
    rig = open_rig(config)
    frame = rig.camera.read(1.0)
    rig.close()
    assert (rig.kind, rig.robot) == (RigKind.LIVE, None)
    assert frame.image.shape == (480, 640, 3)
    path = write_rig(make_rig(config, "with a plugin", None))
    assert read_rig(path).kind == "lab_camera"
    tall = config.model_copy(update={"camera": config.camera.model_copy(update={"height_px": 3000})})
    with pytest.raises(DeviceError, match=r"^the lab camera has 2000 lines"):
        open_rig(tall)


@pytest.mark.usefixtures("installed")
def test_a_drive_of_a_plugin_is_zeroed_armed_and_moved_by_the_guarded_bus() -> None:
    servos = type(THREE).model_validate({**THREE.model_dump(), "driver": "lab_drive", "port": "/dev/lab"})
    bus = make_bus(servos, None)
    assert isinstance(bus, DriveBus)
    bus.open()
    bus.set_zero()
    bus.arm()
    bus.write((0.1, 0.0, 0.0, 0.5))
    states = [reading.position_mm for reading in bus.read() if isinstance(reading, ServoState)]
    assert states[:4] == pytest.approx([0.1, 0.0, 0.0, 0.5], abs=0.02)
    bus.torque_off()
    bus.close()


@pytest.mark.usefixtures("installed")
def test_a_policy_of_a_plugin_advises_and_stops_at_the_target() -> None:
    config = load_config(overrides={"policy": {"name": "lab_policy"}})
    assert "lab_policy" in settings_by_key()["policy.name"].choices
    policy = make_policy(config.policy.name, config)
    on_the_way, there = (policy(scene_at(STRAIGHT, (x, 100), (380, 100))) for x in (200, 375))
    assert (on_the_way.speed, there.speed) == (Speed.SLOW, Speed.STOP)


@pytest.mark.usefixtures("installed")
def test_an_exporter_of_a_plugin_writes_its_ending(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "run.theta"
    export(SESSION, [out])
    assert capsys.readouterr().out == f"{out}: 20 items\n"
    assert all(len(line.split()) == 2 for line in out.read_text().splitlines())


def test_a_name_whose_package_is_not_installed_is_one_line(installed: Path) -> None:
    for overrides in ({"policy": {"name": "lab"}}, {"rig": {"camera": "lab"}}, {"servos": {"driver": "lab"}}):
        with pytest.raises(
            ConfigError, match=r": must be one of .*, lab_\w+; others come with the package of a plugin, got 'lab'$"
        ):
            load_config(overrides=overrides)
    (installed / "lab_bench.py").write_text("import no_such_sdk")
    with pytest.raises(PluginError, match=r"^plugin lab_policy of the package lab-bench 0\.1 failed \(ModuleNotFoundError: "):
        make_policy("lab_policy", Config())
