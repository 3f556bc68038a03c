"""The pictures of the documents: each is made by the command, and the stage behind them is the same every time."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from core.config.models import Config
from core.control.modes import Mode
from core.control.motion import Jog
from core.devices import UserError
from core.types import Frame, Point, Reason, Refusal, Scene
from tools import screenshots as stage_module
from tools.screenshots import NAMES, Scenery, Stage, run_screenshots

ROOT = Path(__file__).resolve().parents[2]


class Blind:
    """Perception that never sees anything, at once."""

    def reset(self) -> None: ...

    def __call__(self, frame: Frame, target: Point | None = None) -> Scene:
        height, width = frame.image.shape[:2]
        return Scene(frame.index, frame.captured_s, (width, height), 1.0, refusal=Refusal(Reason.NO_ROBOT))


def stage_of(**scenery: object) -> Stage:
    config = Config.model_validate({"record": {"ring_s": 0}})
    return Stage(config, Blind(), Scenery(**{"phantom": "y_branch", "start_mm": 20.0, **scenery}))  # type: ignore[arg-type]


def test_every_picture_of_the_documents_is_made_by_the_command() -> None:
    documents = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    shown = {name for path in documents for name in re.findall(r"pictures/(\w+)\.png", path.read_text(encoding="utf-8"))}
    assert shown == set(NAMES)


def test_an_unknown_picture_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no picture is called 'sunset'; there are: operator_window, "):
        run_screenshots(tmp_path / "out", ["sunset"], None)
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be made"):
        run_screenshots(tmp_path / "file" / "out", [], None)


def test_the_stage_gives_the_same_pictures_every_time() -> None:
    images = []
    for _ in range(2):
        stage = stage_of()
        images.append(stage.run(3).frame.image)
        stage.close()
    assert np.array_equal(*images)


def test_the_stage_moves_the_robot_as_it_is_asked_to() -> None:
    stage = stage_of()
    stage.switch_on()
    assert stage.pilot.view.mode is Mode.ADVISORY
    before = stage.run(1).status
    stage.jog = Jog(advance=1.0)
    after = stage.run(25).status
    stage.close()
    assert before is not None and after is not None
    assert after.insertion_mm > before.insertion_mm + 1.0


def test_what_never_comes_is_told_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = stage_of()
    stage.switch_on()
    monkeypatch.setattr(stage_module, "_PATIENCE_TURNS", 5)
    with pytest.raises(UserError, match=r"did not get there: well enough to arm; .*"):
        stage.hand_over((100.0, 100.0))
    stage.close()


def test_a_session_is_recorded(tmp_path: Path) -> None:
    stage = stage_of()
    stage.switch_on()
    stage.record(tmp_path)
    stage.run(5)
    folder = stage.end_recording()
    stage.close()
    assert {"manifest.json", "frames.jsonl", "events.jsonl", "video_0000.mkv"} <= {path.name for path in folder.iterdir()}
