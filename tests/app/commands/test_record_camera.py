"""``record`` without a window: a camera that goes away is never called a complete recording."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from app.commands import record as record_command
from app.commands.session import describe
from core.devices import DeviceError
from core.session.manifest import read_manifest
from core.session.reader import SessionReader
from core.types import Tick
from tests.core.session_data import tick_of

LOST = "the camera was unplugged; plug it in again"
SMALL = "[record]\nstop_free_mb = 0.0\nwarn_free_mb = 0.0\n"


class FlakyEngine:
    """Sends a picture every 20 ms but for the times between which its camera is gone; seconds since the first turn."""

    pilot = None

    def __init__(self, gone: tuple[float, float], failure: str = "") -> None:
        self.problem: str | None = None
        self._gone, self._failure = gone, failure
        self._began_s, self._index = time.monotonic(), 0

    def step(self, timeout_s: float) -> Tick | None:
        time.sleep(0.02)
        away = self._gone[0] <= time.monotonic() - self._began_s < self._gone[1]
        if away and self._failure:
            raise DeviceError(self._failure)
        self.problem = LOST if away else None
        self._index += 1
        return None if away else tick_of(self._index, time.monotonic())

    def bus_status(self) -> None:
        return None

    def close(self) -> None:
        pass


@pytest.fixture
def recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[FlakyEngine, float], Path]]:
    config = tmp_path / "small.toml"
    config.write_text(SMALL)
    monkeypatch.setattr(record_command, "_GAP_S", 0.2)

    def record(engine: FlakyEngine, seconds: float) -> Path:
        monkeypatch.setattr(record_command, "EngineMaker", lambda: lambda _config: engine)
        record_command.record(seconds, tmp_path / "out", as_json=True, config_path=config)
        return only_session(tmp_path)

    return record


def only_session(folder: Path) -> Path:
    (session,) = (folder / "out").glob("session_*")
    return session


def test_a_camera_that_is_gone_at_the_end_is_an_error_that_names_what_was_recorded(
    recorded: Callable[[FlakyEngine, float], Path], tmp_path: Path
) -> None:
    with pytest.raises(DeviceError, match=rf"^{LOST}; what was written is in .*session_"):
        recorded(FlakyEngine((0.3, 99.0)), 0.8)
    manifest = read_manifest(only_session(tmp_path))
    assert (manifest.closed, manifest.ended) == (True, LOST)
    assert manifest.counts.frames > 3


def test_one_that_comes_back_is_waited_for_and_its_absence_is_told(
    recorded: Callable[[FlakyEngine, float], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    session = recorded(FlakyEngine((0.3, 0.8)), 1.2)
    said = json.loads(capsys.readouterr().out)
    assert said["ended"] == read_manifest(session).ended == "all recorded"
    assert said["without_picture_s"] >= 0.4
    with SessionReader(session) as reader:
        assert reader.wait(10.0)
        first, last = (reader.row(place) for place in (0, len(reader) - 1))
        assert first is not None
        assert last is not None
        assert last.captured_s - first.captured_s > 0.8


class SilentEngine(FlakyEngine):
    """Whose camera gives nothing from some picture on, and does not say why."""

    def step(self, timeout_s: float) -> Tick | None:
        tick = super().step(timeout_s)
        self.problem = None
        return tick


def test_a_silence_that_lasts_to_the_end_is_told_as_well(
    recorded: Callable[[FlakyEngine, float], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    recorded(SilentEngine((0.3, 99.0)), 1.0)
    said = json.loads(capsys.readouterr().out)
    assert said["without_picture_s"] >= 0.5


class LosingEngine(FlakyEngine):
    """Whose camera loses two frames before each that comes, as it does on a cable that is too slow."""

    def step(self, timeout_s: float) -> Tick | None:
        tick = super().step(timeout_s)
        if tick is not None:
            tick = replace(tick, frame=replace(tick.frame, lost=2 * self._index))
        return tick


def test_what_the_camera_lost_is_told_and_can_be_asked_for_afterwards(
    recorded: Callable[[FlakyEngine, float], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    session = recorded(LosingEngine((99.0, 99.0)), 0.3)
    said = json.loads(capsys.readouterr().out)
    assert said["camera_lost"] == 2 * (said["frames"] - 1) > 0
    with SessionReader(session) as reader:
        assert reader.wait(10.0)
        assert describe(reader)["camera_lost"] == said["camera_lost"]


def test_a_device_that_fails_ends_the_session_with_the_reason(
    recorded: Callable[[FlakyEngine, float], Path], tmp_path: Path
) -> None:
    with pytest.raises(DeviceError, match=r"^the bus is gone; what was written is in .*session_"):
        recorded(FlakyEngine((0.3, 99.0), failure="the bus is gone"), 60.0)
    assert read_manifest(only_session(tmp_path)).ended == "the bus is gone"


def test_what_the_rig_file_knows_of_the_rig_is_recorded_as_it_was_used(
    recorded: Callable[[FlakyEngine, float], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        record_command,
        "as_calibrated",
        lambda config: config.model_copy(
            update={
                "perception": config.perception.model_copy(
                    update={"path": config.perception.path.model_copy(update={"port_x_share": 0.03})}
                )
            }
        ),
    )
    session = recorded(FlakyEngine((99.0, 99.0)), 0.3)
    assert read_manifest(session).config["perception"]["path"]["port_x_share"] == 0.03
