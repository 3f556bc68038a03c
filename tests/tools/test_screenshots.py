"""The pictures of the documents: each is made by the tool, and the engine behind them is the same every time."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from core.config.models import Config
from core.control.modes import Mode
from core.control.motion import Jog
from core.devices import UserError
from core.types import Frame, Point, Reason, Refusal, Scene
from tools import screenshots
from tools.screenshots import PICTURES, LockStepEngine

ROOT = Path(__file__).resolve().parents[2]


class Blind:
    """Perception that finds nothing, at once."""

    def reset(self) -> None: ...

    def __call__(self, frame: Frame, target: Point | None = None) -> Scene:
        height, width = frame.image.shape[:2]
        return Scene(frame.index, frame.captured_s, (width, height), 1.0, refusal=Refusal(Reason.NO_ROBOT))


def make_engine() -> LockStepEngine:
    config = Config.model_validate({"record": {"ring_s": 0}})
    return LockStepEngine(config, Blind(), "y_branch", start_mm=20.0)


def test_every_picture_of_the_documents_is_made_by_the_command() -> None:
    documents = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    shown = {name for path in documents for name in re.findall(r"pictures/(\w+)\.png", path.read_text(encoding="utf-8"))}
    assert shown == set(PICTURES)


def test_an_unknown_picture_and_a_folder_that_cannot_be_made_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    with pytest.raises(UserError, match="no picture is called 'sunset'; there are: operator_window, "):
        screenshots.main(tmp_path / "out", ["sunset"], None)
    assert not (tmp_path / "out").exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be made"):
        screenshots.main(tmp_path / "file" / "out", [], None)


def test_the_engine_moves_the_robot_as_it_is_asked_to() -> None:
    engine = make_engine()
    engine.switch_on()
    assert engine.pilot.view.mode is Mode.ADVISORY
    before = engine.run(1).status
    engine.jog = Jog(advance=1.0)
    after = engine.run(25).status
    engine.close()
    assert before is not None and after is not None
    assert after.insertion_mm > before.insertion_mm + 1.0


def test_a_session_is_recorded(tmp_path: Path) -> None:
    engine = make_engine()
    engine.switch_on()
    engine.record(tmp_path)
    engine.run(5)
    folder = engine.end_recording()
    engine.close()
    assert {"manifest.json", "frames.jsonl", "events.jsonl", "video_0000.mkv"} <= {path.name for path in folder.iterdir()}
