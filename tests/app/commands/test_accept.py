"""``rig accept``: all steps on software servos, what is kept when one fails, and one clear line for what cannot be."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app import cli
from app.commands import accept
from core.config.acceptance import STOP_TRIES, EstopRecord, StopTimes, read_acceptance
from core.config.models import load_config
from core.config.rig_file import make_rig, read_rig, write_rig
from core.config.safety import JOINT_NAMES, ServosConfig
from core.devices import UserError
from hardware.calibration import acceptance
from hardware.calibration.acceptance import AcceptanceBench, ScalePull
from hardware.twin.servos.bus import SoftServoBus
from tests.core.robots import ROTATION, THREE, TURNED, robot, tendons

pytestmark = [pytest.mark.real_time, pytest.mark.usefixtures("own_folder", "no_process_stays_behind")]

FORCES = [f"--force={name}={19 if name in JOINT_NAMES[:4] else 29}" for name in JOINT_NAMES]
runner = CliRunner()


@pytest.fixture
def servos(start_servos: Callable[..., SoftServoBus]) -> SoftServoBus:
    return start_servos(ServosConfig(), wire_time=True)


@pytest.fixture
def path(servos: SoftServoBus) -> Path:
    config = load_config(overrides={"rig": {"camera": "webcam", "robot": "servos"}, "servos": {"port": servos.port}})
    return write_rig(make_rig(config, "bench 1", None))


def _run(*arguments: str, answers: str = "") -> str:
    result = runner.invoke(cli.app, ["rig", "accept", "bench 1", *arguments], input=answers)
    if isinstance(result.exception, UserError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


class _Bench(AcceptanceBench):
    """The servos without the motions, which have tests of their own."""

    moved: list[str]

    def show_direction(self, joint: Any) -> None:
        self.moved.append(f"direction {joint.name}")

    def pull(self, joint: Any) -> ScalePull:
        self.moved.append(f"pull {joint.name}")
        return ScalePull(joint.max_force_n, True)

    def stop_times(self, kind: str, joint: Any, report: Any) -> StopTimes:
        self.moved.append(kind)
        times = {"times_ms": (50.0,) * STOP_TRIES, "way_mm": 0.5, "speed_mm_s": 20.0}
        return StopTimes.model_validate({"kind": kind, "joint": joint.name} | times)

    def estop(self, say: Any, within_s: float) -> EstopRecord:
        self.moved.append("E-stop")
        return EstopRecord(cause="servo power lost", silent_ms=180.0, refused="no servo answers", refused_after="not zeroed")


@pytest.fixture
def moved(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    moved: list[str] = []
    monkeypatch.setattr(_Bench, "moved", moved, raising=False)
    monkeypatch.setattr(acceptance, "AcceptanceBench", _Bench)
    return moved


YES = "\ny\n" * 7
ENTERS = "\n" * 20


def test_a_rig_is_accepted_step_by_step_and_the_record_says_what_was_done(path: Path, moved: list[str]) -> None:
    told = json.loads(_run("--operator", "Ada", *FORCES, "--json", answers=YES + ENTERS))
    assert told["valid"] is True
    assert told["problems"] == []
    assert told["path"] == str(path.with_name("bench 1.acceptance.json"))
    record = told["acceptance"]
    assert record["operator"] == "Ada"
    assert record["supply_v"] == [12.0, 12.0]
    assert [one["read_n"] for one in record["forces"]] == [19.0] * 4 + [29.0] * 3
    assert record["finished_utc"] is not None
    assert moved == [*(f"direction {n}" for n in JOINT_NAMES), *(f"pull {n}" for n in JOINT_NAMES), "STOP", "deadman", "E-stop"]
    again = _run("--show")
    assert "acceptance by Ada" in again
    assert ": valid" in again
    shown = runner.invoke(cli.app, ["rig", "show", "bench 1"]).stdout
    assert "right 19 of 20 N" in shown


def test_what_was_done_before_a_step_failed_is_kept_and_goes_on_there(path: Path, moved: list[str]) -> None:
    with pytest.raises(
        UserError, match=r"direction of up is wrong.*what was done is kept in .*go on: main.py rig accept 'bench 1'"
    ):
        _run("--operator", "Ada", answers="\ny\n\ny\n\nn\n")
    assert read_acceptance(path).directions == ("right", "left")
    with pytest.raises(UserError, match=r"right pulled 22.5 N, at most 22 N"):
        _run(answers="\ny\n" * 5 + "\n22,5\n")
    assert read_acceptance(path).forces == ()
    with pytest.raises(UserError, match="no answer on standard input"):
        _run(answers="\n19\n\n18.5\n")
    assert [one.read_n for one in read_acceptance(path).forces] == [19.0, 18.5]
    assert moved.count("direction right") == 1


def test_ctrl_c_keeps_what_was_done(path: Path, moved: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> ScalePull:
        raise KeyboardInterrupt

    monkeypatch.setattr(_Bench, "pull", interrupt)
    result = runner.invoke(cli.app, ["rig", "accept", "bench 1", "--operator", "Ada"], input=YES + ENTERS)
    assert result.exit_code != 0
    assert "what was done is kept" in result.stderr
    assert read_acceptance(path).directions == JOINT_NAMES


def test_a_rig_that_was_changed_is_accepted_again_from_the_start(path: Path, moved: list[str]) -> None:
    _run("--operator", "Ada", *FORCES, answers=YES + ENTERS)
    rig = read_rig(path)
    joints = (rig.servos.joints[0].model_copy(update={"mm_per_turn": 62.8}), *rig.servos.joints[1:])
    write_rig(rig.model_copy(update={"servos": rig.servos.model_copy(update={"joints": joints})}), path)
    assert "NOT valid: mm_per_turn of right was 40 and is 62.8" in _run("--show")
    with pytest.raises(UserError, match="no answer"):
        _run("--operator", "Bo")
    begun = read_acceptance(path)
    assert (begun.operator, begun.directions, len(begun.servos)) == ("Bo", (), 7)
    assert "Ada" in path.with_name("bench 1.acceptance.older.json").read_text()


def test_forces_that_were_read_before_need_no_pull(path: Path, moved: list[str]) -> None:
    _run("--operator", "Ada", *FORCES, "--no-pull", answers=YES + ENTERS)
    assert not any(line.startswith("pull") for line in moved)


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("--force", "up"), "say AXIS=NEWTONS"),
        (("--force", "tail=3"), "axes: right, left"),
        (("--force", "up=much"), "'much' is no force in newtons"),
        ((), "no answer on standard input"),
    ],
)
def test_what_cannot_be_is_one_line(path: Path, arguments: tuple[str, ...], problem: str) -> None:
    with pytest.raises(UserError, match=problem):
        _run(*arguments)


def test_a_rig_of_the_twin_has_nothing_to_accept() -> None:
    write_rig(make_rig(load_config(), "bench 1", None))
    with pytest.raises(UserError, match="rig bench 1 has no servos of its own"):
        _run()
    assert accept.acceptance_lines(None, load_config()) == ["acceptance: none; main.py rig accept NAME"]


def _write(servos: ServosConfig) -> None:
    config = load_config(overrides={"rig": {"camera": "webcam", "robot": "servos"}}).model_copy(update={"servos": servos})
    write_rig(make_rig(config, "bench 1", None))


@pytest.mark.parametrize("shape", [TURNED], ids=["turned"])
def test_a_robot_of_another_shape_is_accepted(
    start_servos: Callable[..., SoftServoBus], shape: ServosConfig, moved: list[str]
) -> None:
    bus = start_servos(shape)
    _write(shape.model_copy(update={"port": bus.port}))
    forces = [f"--force={joint.name}={joint.max_force_n}" for joint in shape.joints]
    result = runner.invoke(cli.app, ["rig", "accept", "bench 1", "--operator", "Ada", *forces], input="\ny\n" * 4 + ENTERS)
    assert ": valid" in result.stdout, result.stderr
    assert "rotation 80 of 80 N mm" in result.stdout
    for question in (
        "bend the head at 270° (0: its right, 90: the camera)? y or n",
        "direction of rotation: look at the robot; Enter moves it by 15 ° and back",
        "did the shaft turn to the left, seen from behind (from the robot's right towards the camera)?",
        "by a lever on the shaft; Enter pulls with 80 N mm",
    ):
        assert question in result.stderr
    assert moved[-3:] == ["STOP", "deadman", "E-stop"]


@pytest.mark.parametrize(
    "servos",
    [
        THREE.model_copy(update={"driver": "stepper board", "port": "/dev/null"}),
        robot(*tendons(90.0, 270.0), ROTATION).model_copy(update={"port": "/dev/null"}),
    ],
    ids=["another drive", "no feed"],
)
def test_what_cannot_be_accepted_stays_advisory(servos: ServosConfig) -> None:
    _write(servos)
    with pytest.raises(UserError, match=r"rig bench 1 has another drive than DYNAMIXEL servos, or no feed: .* stays advisory"):
        _run()
