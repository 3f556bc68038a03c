"""``rig list | show | board | calibrate``: texts, JSON, and one clear line for what cannot be."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import cv2
import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from app import cli
from app.commands.rig import behaviour_lines, calibrate_rig
from app.rig_wizard.board_print import BoardPrintError, paper_for
from core.calibration.camera import BoardError, BoardSpec, BoardView, find_board
from core.config.calibration import BehaviourConfig, CalibrationConfig, Estimate, ScaleConfig
from core.config.models import load_config
from core.config.rig_file import find_rig, make_rig, rig_path, with_rig, write_rig
from core.config.safety import ServosConfig
from core.devices import DeviceError, UserError
from hardware.calibration.rig_draft import RigDraft
from hardware.calibration.servo_identification import Zeros
from hardware.rig import RigKind
from hardware.servos.dynamixel_bus import ServoBus
from hardware.servos.eeprom import backups_folder
from hardware.twin.servos.bus import SoftServoBus
from tests.core import session_data

runner = CliRunner()


pytestmark = pytest.mark.usefixtures("own_folder")


def _run(*arguments: str) -> str:
    result = runner.invoke(cli.app, ["rig", *arguments])
    if isinstance(result.exception, UserError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


def test_rigs_are_listed() -> None:
    assert "no rig files" in _run("list")
    write_rig(make_rig(load_config(), "bench 1", None))
    rig_path("broken").write_text("format = ")
    lines = _run("list").splitlines()
    assert lines[0].startswith("bench 1: bench twin, its own servos; not calibrated; made ")
    assert "no TOML" in lines[1]
    found = json.loads(_run("list", "--json"))
    assert [(one["name"], one["problem"] is None) for one in found["rigs"]] == [("bench 1", True), ("broken", False)]


@pytest.fixture
def identified(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A session whose robot is identified at once."""
    one = {"value": 1.0, "low": 0.9, "high": 1.1}
    names = [name for name, field in BehaviourConfig.model_fields.items() if field.annotation is Estimate]
    found = BehaviourConfig.model_validate({"session": "jog", "head_p50_mm": 0.2, "head_p95_mm": 0.5, **dict.fromkeys(names, one)})
    monkeypatch.setattr("hardware.twin.identification.jog_of_session", lambda *_: None)
    monkeypatch.setattr("hardware.twin.identification.identify", lambda *_: found)
    session = session_data.record(tmp_path, [session_data.tick_of(0, 1.0)])
    manifest = json.loads((session / "manifest.json").read_text())
    manifest |= {"rig": "bench 1", "config": load_config().model_dump(mode="json")}
    (session / "manifest.json").write_text(json.dumps(manifest))
    return session


def test_what_was_identified_is_kept_where_it_was_asked_for(identified: Path) -> None:
    path = write_rig(make_rig(load_config(), "bench 1", None))
    before = path.read_bytes()
    assert "not kept" in _run("identify", str(identified)) and path.read_bytes() == before
    write_rig(make_rig(load_config(), "bench 2", None))
    with pytest.raises(UserError, match="is of the rig bench 1, not of bench 2"):
        _run("identify", str(identified), "--rig", "bench 2")
    result = json.loads(_run("identify", str(identified), "--rig", "Bench 1", "--json"))
    assert result["play_mm"] == {"value": 1.0, "low": 0.9, "high": 1.1} and result["kept"] == str(path)
    behaviour = find_rig("bench 1")[1].behaviour
    assert behaviour is not None and behaviour.head_p95_mm == 0.5
    assert make_rig(with_rig(load_config(), find_rig("bench 1")[1], path), "bench 1", None).behaviour == behaviour
    shown = _run("show", "bench 1")
    assert "play:                   1.000 mm (0.900 to 1.100)" in shown and "0.50 (95 %)" in shown and "another jog" not in shown
    doubtful = behaviour.model_copy(update={"head_p95_mm": 5.7})
    assert "above 1.5 mm some of this is wrong" in behaviour_lines(doubtful, load_config().servos)[-1]


def test_a_rig_is_shown() -> None:
    known = CalibrationConfig.model_validate(
        {
            "made_utc": "2025-01-01T00:00:00Z",
            "scale": {"mm_per_px": 0.32, "size_px": (640, 480), "method": "board", "uncertainty_share": 0.001},
        }
    )
    write_rig(make_rig(load_config(), "bench 1", known))
    text = _run("show", "bench 1")
    assert "scale: 0.3200 mm/px in the middle, ±0.10 % (by board)" in text
    assert "right +1, left +2" in text
    assert json.loads(_run("show", "bench 1", "--json"))["calibration"]["scale"]["mm_per_px"] == 0.32
    with pytest.raises(UserError, match="unknown rig 'x'; known: twin, realsense, webcam, basler, bench 1"):
        _run("show", "x")


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ((), r"^say the diameters of the drums before anything moves, .*--drums TENDONS,FEED,DELIVERY"),
        (("--drums", "12.7"), "^--drums 12.7: diameters in mm"),
        (("--drums", "12.7,20,x"), "^--drums 12.7,20,x: diameters in mm"),
    ],
)
def test_a_live_rig_is_not_moved_before_its_drums_are_known(arguments: tuple[str, ...], problem: str) -> None:
    config = load_config(overrides={"rig": {"camera": "webcam", "robot": "servos"}, "servos": {"port": "/dev/servos"}})
    write_rig(make_rig(config, "bench 1", None))
    with pytest.raises(UserError, match=problem):
        _run("calibrate", "bench 1", "--auto", "--steps", "servos", *arguments)


@pytest.mark.real_time
def test_servos_are_restored_as_they_were_before_the_program_changed_them(start_servos: Callable[..., SoftServoBus]) -> None:
    twin = start_servos(ServosConfig())
    config = load_config(overrides={"rig": {"camera": "webcam", "robot": "servos"}, "servos": {"port": twin.port}})
    write_rig(make_rig(config, "bench 1", None))
    with pytest.raises(UserError, match="there is no backup of these servos"):
        _run("restore-servos", "bench 1")
    bus = ServoBus(config.servos, backups=backups_folder())
    bus.open()
    bus.close()
    lines = _run("restore-servos", "bench 1").splitlines()
    assert len(lines) == 7
    assert "operating mode" in lines[0]
    assert all(twin.servo(joint.id).table["operating_mode"] == 3 for joint in ServosConfig().joints)


def test_a_rig_without_servos_has_none_to_restore() -> None:
    write_rig(make_rig(load_config(), "bench 1", None))
    with pytest.raises(UserError, match="rig bench 1 has no servos of its own"):
        _run("restore-servos", "bench 1")


def test_the_board_is_printed_at_true_size(tmp_path: Path) -> None:
    out = tmp_path / "board.png"
    assert _run("board", "--out", str(out), "--square-mm", "12", "--columns", "8", "--rows", "6").strip() == str(out)
    image = cv2.imread(str(out))
    assert image is not None
    spec = BoardSpec(8, 6, 12.0)
    view = find_board(np.asarray(cv2.resize(image, None, fx=0.2, fy=0.2, interpolation=cv2.INTER_AREA)), spec)
    first, last = np.argmin(view.board_mm.sum(axis=1)), np.argmax(view.board_mm.sum(axis=1))
    apart_px, apart_mm = (np.hypot(*(points[last] - points[first])) for points in (view.pixels, view.board_mm))
    assert apart_px / apart_mm == pytest.approx(0.2 * 600 / 25.4, rel=1e-3)  # 600 dots per inch
    pdf = tmp_path / "board.pdf"
    _run("board", "--out", str(pdf))
    assert b"841.8" in pdf.read_bytes()  # A4 across, in points
    with Image.open(out) as printed:
        assert printed.info["dpi"] == pytest.approx((600, 600), abs=0.1)
    file = pdf.read_bytes()
    places = [int(line[:10]) for line in file[int(file.split()[-2]) :].splitlines() if line.endswith(b" n ")]
    assert [file[place:].split()[:2] for place in places] == [[b"%d" % number, b"0"] for number in range(1, 6)]


def test_boards_that_cannot_be_printed(tmp_path: Path) -> None:
    assert [paper_for(BoardSpec()), paper_for(BoardSpec(10, 7, 30.0))] == ["A4", "A3"]
    with pytest.raises(BoardPrintError, match="fits on no paper"):
        _run("board", "--out", str(tmp_path / "b.pdf"), "--square-mm", "60")
    with pytest.raises(BoardPrintError, match=r"\.pdf or \.png"):
        _run("board", "--out", str(tmp_path / "b.jpg"))
    with pytest.raises(BoardPrintError, match="cannot be written"):
        _run("board", "--out", str(tmp_path / "none" / "b.pdf"))
    with pytest.raises(BoardError, match="40 x 4 squares needs 80 markers, and there are 50: take fewer squares"):
        _run("board", "--out", str(tmp_path / "b.pdf"), "--columns", "40", "--rows", "4", "--square-mm", "5")
    assert not (tmp_path / "b.pdf").exists()


def test_a_calibration_without_servos_finds_the_scale() -> None:
    said = _run("calibrate", "bench 1", "--auto", "--steps", "board", "--pictures", "2")
    assert "scale: 0.322" in said
    _, rig = find_rig("bench 1")
    assert rig.calibration.scale.mm_per_px == pytest.approx(1 / 3.1, rel=0.01)
    assert rig.calibration.steering is None


class _Bench:
    """Opened where none must be, or moves nothing."""

    def __init__(self) -> None:
        self.closed, self.kind = False, RigKind.SIM
        self.feed = SimpleNamespace(newest=None)

    def set_lens(self, lens: object) -> None: ...
    def warm_up(self) -> None: ...
    def close(self) -> None:
        self.closed = True


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> _Bench:
    made = _Bench()
    monkeypatch.setattr("hardware.calibration.bench.open_bench", lambda *_: made)
    monkeypatch.setattr("app.operator.rig_engine.quick_sight", lambda _: None)
    return made


def test_a_rig_that_cannot_be_saved_is_told_before_the_bench_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def open_bench(*_: object) -> None:
        raise AssertionError("opened")

    monkeypatch.setattr("hardware.calibration.bench.open_bench", open_bench)
    monkeypatch.setattr("app.operator.rig_engine.quick_sight", lambda _: None)
    rig_path("bench 1").mkdir(parents=True)
    with pytest.raises(UserError, match=r"bench 1.toml: cannot be saved \(Is a directory\)"):
        _run("calibrate", "bench 1", "--auto", "--from", "twin")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "file"))
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match=r"bench 1.toml: cannot be saved \(Not a directory\)"):
        _run("calibrate", "bench 1", "--auto")


@pytest.fixture
def board_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of all steps only the board succeeds."""

    def solve_boards(draft: RigDraft) -> None:
        draft.scale = ScaleConfig(mm_per_px=0.32, size_px=(640, 480), method="board", uncertainty_share=0.001)

    monkeypatch.setattr(RigDraft, "take_board", lambda draft: draft.views.append(cast("BoardView", None)))
    monkeypatch.setattr(RigDraft, "solve_boards", solve_boards)


@pytest.mark.usefixtures("board_alone")
def test_steps_that_were_done_before_one_failed_are_saved(bench: _Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def search_servos(_: RigDraft) -> None:
        raise DeviceError("6 servos answer, seven are needed")

    monkeypatch.setattr(RigDraft, "search_servos", search_servos)
    go_on = "rig calibrate 'bench 1' --auto --steps servos,zero,steering$"
    with pytest.raises(UserError, match=f"^6 servos answer, seven are needed; board saved in .*bench 1.toml; go on: {go_on}"):
        _run("calibrate", "bench 1", "--auto")
    assert bench.closed
    _, rig = find_rig("bench 1")
    assert rig.calibration.scale is not None
    with pytest.raises(UserError, match=r"^6 servos answer, seven are needed$"):
        _run("calibrate", "bench 2", "--auto", "--steps", "servos")
    assert not rig_path("bench 2").exists()


@pytest.mark.usefixtures("board_alone", "bench")
def test_an_interruption_keeps_what_was_done_and_tendons_are_kept_with_the_steering(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def learn_steering(_: RigDraft) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(RigDraft, "search_servos", lambda _: None)
    monkeypatch.setattr(RigDraft, "find_zeros", lambda _: Zeros((0.0,) * 4))
    monkeypatch.setattr(RigDraft, "learn_steering", learn_steering)
    with pytest.raises(KeyboardInterrupt):
        calibrate_rig("bench 1", auto=True, steps="board,zero,steering")
    assert "board saved in " in (told := capsys.readouterr().err)
    assert told.endswith("--steps zero,steering\n")
    assert find_rig("bench 1")[1].calibration is not None


@pytest.mark.usefixtures("board_alone", "bench")
def test_a_tendon_without_a_zero_ends_it_before_the_steering(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RigDraft, "search_servos", lambda _: None)
    monkeypatch.setattr(RigDraft, "find_zeros", lambda _: Zeros((0.0,) * 4, ("up: the head does not follow the wire",)))
    monkeypatch.setattr(RigDraft, "learn_steering", lambda _: pytest.fail("measured from nowhere"))
    with pytest.raises(
        UserError, match=r"no zero for all tendons: up: the head does not follow the wire; board saved in .*zero,steering"
    ):
        calibrate_rig("bench 1", auto=True, steps="board,zero,steering")


@pytest.mark.parametrize(("kind", "waits"), [(RigKind.LIVE, 1), (RigKind.SIM, 0)])
@pytest.mark.usefixtures("board_alone")
def test_nothing_moves_under_a_real_board(bench: _Bench, monkeypatch: pytest.MonkeyPatch, kind: RigKind, waits: int) -> None:
    done: list[str] = []
    bench.kind = kind
    monkeypatch.setattr(RigDraft, "wait_for_no_board", lambda _: done.append("waited"))
    monkeypatch.setattr(RigDraft, "search_servos", lambda _: done.append("searched"))
    monkeypatch.setattr(RigDraft, "find_zeros", lambda _: Zeros((0.0,) * 4))
    calibrate_rig("bench 1", auto=True, steps="board,zero")
    assert done == ["waited"] * waits + ["searched"]


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("bench 1",), "say --auto"),
        (("twin", "--auto"), "cannot be called twin"),
        (("bench 1", "--auto", "--steps", "board,dance"), "unknown step 'dance'"),
        (("bench 1", "--auto", "--steps", ","), "--steps names no step; known: board, servos, zero, steering"),
        (("bench 1", "--auto", "--from", "bench 9"), "unknown rig 'bench 9'"),
        (("bench 1", "--auto", "--from", "webcam", "--steps", "board"), "webcam"),
    ],
)
def test_what_cannot_be_calibrated_is_one_line(arguments: tuple[str, ...], problem: str) -> None:
    with pytest.raises(UserError, match=problem) as told:
        _run("calibrate", *arguments)
    assert "\n" not in str(told.value)
    assert not rig_path("bench 1").exists()
