"""``record`` and ``session`` as a user calls them; a camera that goes away is never called a complete recording."""

from __future__ import annotations

import csv
import json
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import av
import pytest
from mcap.reader import make_reader

from app.commands import record as record_command
from app.commands.progress import Interrupt
from app.commands.session import describe, info
from core.config.safety import AtClose
from core.devices import DeviceError, UserError
from core.program import program_line
from core.session.manifest import event_of_target, read_manifest
from core.session.reader import SessionReader
from core.types import Tick
from hardware.servos.bus_ipc import BusStatus
from hardware.twin.identification import Explanation
from tests.app.bus_status import bus, servo
from tests.app.fakes import FakePilot
from tests.app.program import run
from tests.core.session.test_rehearsed_run import FOUND
from tests.core.session_data import record as record_session
from tests.core.session_data import set_open, tick_of
from tests.hardware.twin.test_identification import behaviour

# a small picture and one thread: the machine that runs the tests may be busy
CONFIG = """
[twin]
image_width_px = 320
image_height_px = 240
[perception]
working_size_px = 320
[perception.segmentation]
threads = 1
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("config") / "small.toml"
    path.write_text(CONFIG)
    return path


@pytest.fixture(scope="module")
def recorded(config: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, object]]:
    """A session of the twin, and what ``record --json`` said."""
    out = tmp_path_factory.mktemp("sessions")
    about = ("--operator", "Ana", "--condition", "alone", "--tag", "pilot")
    done = run("record", "--seconds", 1.5, "--out", out / "new folder", "--config", config, "--json", *about)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    return Path(result["session"]), result


def test_recording_the_twin_writes_a_session_of_its_rig(recorded: tuple[Path, dict[str, object]]) -> None:
    session, result = recorded
    manifest = read_manifest(session)
    assert (manifest.kind, manifest.rig, manifest.closed, manifest.ended) == ("SIM", "twin", True, "all recorded")
    assert manifest.config["twin"]["image_width_px"] == 320
    assert len(manifest.model["sha256"] or "") == 64
    with SessionReader(session) as reader:
        reader.wait(20.0)
        assert reader.problems == ()
        assert len(reader) == result["frames"] == manifest.counts.frames > 0
        ticks = [reader.tick(place) for place in (0, len(reader) // 2, len(reader) - 1)]
        assert all(tick is not None and tick.frame.image.shape == (240, 320, 3) for tick in ticks)
        assert all(tick is not None and tick.status is not None for tick in ticks)
        row = reader.row(0)
        assert row.drive is not None
    assert result["dropped"] == 0
    assert float(str(result["seconds"])) >= 1.4


def test_info_is_one_object_and_a_table(recorded: tuple[Path, dict[str, object]]) -> None:
    table = run("session", "info", recorded[0])
    assert table.returncode == 0
    assert "all recorded" in table.stdout
    assert "ADVISORY" in table.stdout


def test_info_explains_a_rehearsed_run_by_what_was_identified(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    way = {name: tuple((x, 32.0) for x in (10.0, 20.0, 30.0, 40.0, 48.0)) for name in ("xy", "low_xy", "high_xy")}
    found = FOUND.model_copy(update={"target_xy": (49.0, 32.0), "way": FOUND.way.model_copy(update=way)})
    chosen = event_of_target((49.0, 32.0), 9.0, found.model_dump(mode="json"))
    ticks = [tick_of(place, 10.0 + 0.1 * place, full=True) for place in range(3)]
    with pytest.raises(UserError, match="no run of this session was rehearsed"):
        info(record_session(tmp_path / "none", ticks), explain=True)
    session = record_session(tmp_path / "one", ticks, events=[chosen])
    with pytest.raises(UserError, match="its robot was not identified"):
        info(session, explain=True)
    monkeypatch.setattr("app.commands.session.has_rig", lambda _name: True)
    monkeypatch.setattr("app.commands.session.find_rig", lambda name: (Path(name), SimpleNamespace(behaviour=behaviour())))
    for name in ("bench_of_session", "motion_of_session"):
        monkeypatch.setattr(f"hardware.twin.identification.{name}", lambda *_: MagicMock())
    for values, told in (({"play_mm": 0.3}, "play_mm = 0.3 would explain it (0.2 mm left)"), ({}, "no single parameter explains")):
        explanation = Explanation(1.5, 0.2, values)
        monkeypatch.setattr("hardware.twin.identification.explained", lambda *_, found=explanation: found)
        info(session, explain=True)
        assert f"its replay in the identified twin is 1.5 mm off: {told}" in " ".join(
            capsys.readouterr().out.replace("│", "").split()
        )
    monkeypatch.setattr("hardware.twin.identification.explained", MagicMock(side_effect=FloatingPointError("no such twin")))
    info(session, explain=True)
    assert "note: no such twin" in capsys.readouterr().err


def test_what_a_session_is_about_is_given_and_changed(recorded: tuple[Path, dict[str, object]]) -> None:
    session, result = recorded
    for changes, expected in (
        ((), {"operator": "Ana", "condition": "alone", "phantom": "tree", "task": None, "tags": ["pilot"]}),
        (
            ("--task", "loop", "--condition", " ", "--tag", "b", "--untag", "pilot"),
            {"condition": None, "task": "loop", "tags": ["b"]},
        ),
    ):
        assert run("session", "describe", session, *changes).returncode == 0
        info = json.loads(run("session", "info", session, "--json").stdout)
        assert {key: info[key] for key in expected} == expected
    assert info["program"] == program_line()
    assert (info["rows"], info["kind"], info["ended"], info["problems"]) == (result["frames"], "SIM", "all recorded", [])
    assert read_manifest(session).description.tags == ("pilot",), "the manifest is as it was recorded"


def test_export_writes_all_formats(recorded: tuple[Path, dict[str, object]], tmp_path: Path) -> None:
    session, result = recorded
    outs = [tmp_path / f"x.{ending}" for ending in ("mp4", "csv", "mcap", "ros2.mcap")]
    done = run("session", "export", session, *(word for out in outs for word in ("--out", out)), "--json")
    assert done.returncode == 0, done.stderr
    written = json.loads(done.stdout)["written"]
    assert written[str(outs[0])] == written[str(outs[1])] == result["frames"]
    with av.open(str(outs[0])) as container:
        frame = next(container.decode(video=0))
        # overlays are drawn larger than the picture, with a caption below
        assert frame.width >= 1280
        assert frame.height > frame.width * 3 / 4
    with outs[1].open(newline="") as file:
        assert len(list(csv.DictReader(file))) == result["frames"]
    for out, topics in ((outs[2], {"/camera/video", "/measured_js"}), (outs[3], {"/camera/image/compressed", "/measured_js"})):
        with out.open("rb") as mcap:
            assert {channel.topic for _, channel, _ in make_reader(mcap).iter_messages()} >= topics
    told = run("session", "export", session, "--out", tmp_path / "y.csv", "--progress-json")
    assert {json.loads(line)["what"] for line in told.stdout.splitlines()} == {"rows"}
    again = run("session", "export", session, "--out", outs[0])
    assert again.returncode == 2
    assert "there already" in again.stderr


def test_a_recording_that_was_killed_is_recovered_by_the_command(tmp_path: Path) -> None:
    session = record_session(tmp_path, [tick_of(k, 1000.0 + k / 30) for k in range(8)])
    set_open(session)
    info = run("session", "info", session, "--json")
    assert json.loads(info.stdout)["ended"] == "cut"
    done = run("session", "recover", session, "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["frames"], result["lost"]["rows"]) == (8, 0)
    assert json.loads(run("session", "info", result["session"], "--json").stdout)["problems"] == []


def test_a_recovery_that_a_window_ends_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = record_session(tmp_path, [tick_of(0, 1000.0)])
    set_open(session)
    monkeypatch.setattr("core.session.recovery._salvage", lambda *_: signal.raise_signal(signal.SIGTERM))
    with Interrupt():  # a request that the command does not take ends no test
        done = run("session", "recover", session, "--progress-json")
    assert done.returncode == 130, done.stderr
    assert list(tmp_path.iterdir()) == [session]


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("record", "--seconds", 1, "--out", "{file}"), "choose another folder"),
        (("record", "--seconds", 1, "--out", "{folder}", "--config", "{no_model}"), "no model 'nope'"),
        (("record", "--seconds", 1, "--out", "{folder}", "--config", "{no_bench}"), "bench.json: cannot be read"),
        (("session", "recover", "{folder}/nothing"), "no such session"),
        (("session", "export", "{folder}", "--out", "{folder}/x.avi"), "must be one of .mp4, .csv, .mcap, .ros2.mcap, .lerobot"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path: Path, arguments: tuple[object, ...], why: str) -> None:
    folder, file, no_model = tmp_path / "folder", tmp_path / "file", tmp_path / "no_model.toml"
    no_bench = tmp_path / "no_bench.toml"
    no_bench.write_text('[perception]\nbench = "gone"\n')
    folder.mkdir()
    file.write_text("= not toml")
    no_model.write_text('[perception.segmentation]\nmodel = "nope"\n')
    done = run(*(str(word).format(folder=folder, file=file, no_model=no_model, no_bench=no_bench) for word in arguments))
    assert done.returncode == 2
    assert why in done.stderr
    assert "Traceback" not in done.stderr
    assert list(folder.iterdir()) == []


LOST = "the camera was unplugged; plug it in again"
SMALL = "[record]\nstop_free_mb = 0.0\nwarn_free_mb = 0.0\nmax_queue = 1000\n"


class FlakyEngine:
    """Sends a picture every 20 ms of its own clock but for the times between which its camera is gone; seconds since its start."""

    pilot = None

    def __init__(self, gone: tuple[float, float], failure: str = "") -> None:
        self.problem: str | None = None
        self._gone, self._failure = gone, failure
        self._index = 0

    def monotonic(self) -> float:
        return 1000.0 + 0.02 * self._index

    def step(self, timeout_s: float) -> Tick | None:
        self._index += 1
        away = self._gone[0] <= self.monotonic() - 1000.0 < self._gone[1]
        if away and self._failure:
            raise DeviceError(self._failure)
        self.problem = LOST if away else None
        return None if away else tick_of(self._index, self.monotonic())

    def bus_status(self) -> None:
        return None

    def close(self) -> None:
        pass


@pytest.fixture
def record_flaky(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[FlakyEngine, float], Path]]:
    config = tmp_path / "small.toml"
    config.write_text(SMALL)
    monkeypatch.setattr(record_command, "_GAP_S", 0.2)

    def record(engine: FlakyEngine, seconds: float) -> Path:
        monkeypatch.setattr(record_command, "EngineMaker", lambda: lambda _config: engine)
        monkeypatch.setattr(record_command, "time", engine)
        record_command.record(seconds, tmp_path / "out", as_json=True, config_path=config)
        return only_session(tmp_path)

    return record


def only_session(folder: Path) -> Path:
    (session,) = (folder / "out").glob("session_*")
    return session


def test_a_camera_that_is_gone_at_the_end_is_an_error_that_names_what_was_recorded(
    record_flaky: Callable[[FlakyEngine, float], Path], tmp_path: Path
) -> None:
    with pytest.raises(DeviceError, match=rf"^{LOST}; what was written is in .*session_"):
        record_flaky(FlakyEngine((0.3, 99.0)), 0.8)
    manifest = read_manifest(only_session(tmp_path))
    assert (manifest.closed, manifest.ended) == (True, LOST)
    assert manifest.counts.frames > 0


def test_one_that_comes_back_is_waited_for_and_its_absence_is_told(
    record_flaky: Callable[[FlakyEngine, float], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    session = record_flaky(FlakyEngine((0.3, 0.8)), 1.2)
    said = json.loads(capsys.readouterr().out)
    assert said["ended"] == read_manifest(session).ended == "all recorded"
    assert said["without_picture_s"] >= 0.4
    with SessionReader(session) as reader:
        assert reader.wait(10.0)
        first, last = (reader.row(place) for place in (0, len(reader) - 1))
        assert last.captured_s - first.captured_s > 0.8


class InterruptedEngine(FlakyEngine):
    """Ctrl-C is pressed at the fifth picture."""

    def step(self, timeout_s: float) -> Tick | None:
        if self._index == 4:
            signal.raise_signal(signal.SIGINT)
        return super().step(timeout_s)


def test_ctrl_c_ends_the_recording_properly(
    record_flaky: Callable[[FlakyEngine, float], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    session = record_flaky(InterruptedEngine((9.0, 9.0)), 600.0)
    manifest = read_manifest(session)
    assert (json.loads(capsys.readouterr().out)["ended"], manifest.ended, manifest.closed) == ("interrupted", "interrupted", True)
    assert manifest.counts.frames > 0


class LosingEngine(FlakyEngine):
    """Whose camera loses two frames before each that comes, as it does on a cable that is too slow."""

    def step(self, timeout_s: float) -> Tick | None:
        tick = super().step(timeout_s)
        if tick is not None:
            tick = replace(tick, frame=replace(tick.frame, lost=2 * self._index))
        return tick


def test_what_the_camera_lost_is_told_and_can_be_asked_for_afterwards(
    record_flaky: Callable[[FlakyEngine, float], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    session = record_flaky(LosingEngine((99.0, 99.0)), 0.3)
    said = json.loads(capsys.readouterr().out)
    assert said["camera_lost"] == 2 * (said["frames"] - 1) > 0
    with SessionReader(session) as reader:
        assert reader.wait(10.0)
        assert describe(reader)["camera_lost"] == said["camera_lost"]


def test_a_device_that_fails_ends_the_session_with_the_reason(
    record_flaky: Callable[[FlakyEngine, float], Path], tmp_path: Path
) -> None:
    with pytest.raises(DeviceError, match=r"^the bus is gone; what was written is in .*session_"):
        record_flaky(FlakyEngine((0.3, 99.0), failure="the bus is gone"), 60.0)
    assert read_manifest(only_session(tmp_path)).ended == "the bus is gone"


# ---- servos that hold at the end


class HoldingEngine:
    """A LIVE rig of which only the servos are there."""

    def __init__(self, torque: bool = True) -> None:
        self.pilot = FakePilot()
        self.torque = torque

    def bus_status(self) -> BusStatus:
        if "relax" in self.pilot.asked or "torque off" in self.pilot.asked:
            self.torque = False
        return bus(*(servo(place, torque=self.torque) for place in range(7)))


class Terminal:
    """What a person types, line by line; then the end of the input."""

    def __init__(self, *lines: str, is_terminal: bool = True) -> None:
        self._lines, self._is_terminal = list(lines), is_terminal
        self.encoding, self.errors = "utf-8", "strict"

    def isatty(self) -> bool:
        return self._is_terminal

    def readline(self) -> str:
        return f"{self._lines.pop(0)}\n" if self._lines else ""


@pytest.mark.parametrize(
    ("at_close", "terminal", "asked"),
    [
        ("ask", Terminal("r"), ["relax"]),
        ("ask", Terminal("off"), ["torque off"]),
        ("ask", Terminal("what?", "R"), ["relax"]),
        ("ask", Terminal(""), []),
        ("ask", Terminal(), []),
        ("ask", Terminal("r", is_terminal=False), []),
        ("hold", Terminal("r"), []),
        ("relax", Terminal(is_terminal=False), ["relax"]),
        ("torque off", Terminal("h"), ["torque off"]),
    ],
)
def test_what_becomes_of_servos_that_hold(
    monkeypatch: pytest.MonkeyPatch, at_close: AtClose, terminal: Terminal, asked: list[str]
) -> None:
    engine, lines = HoldingEngine(), list[str]()
    monkeypatch.setattr(sys, "stdin", terminal)
    record_command.leave_servos(engine, at_close, lines.append)
    assert engine.pilot.asked == asked
    assert any("not proven" in line for line in lines) is False
