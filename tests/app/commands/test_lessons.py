"""What ``train`` teaches: the shapes that its networks begin with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from rich.progress import Progress

from app.commands import train
from app.commands.progress import Interrupt
from app.commands.train import Classroom, FrameLesson, HeldOutWatch, SecondLookLesson
from core.devices import UserError
from core.learning.augmentation import FrameCrops, NearCrops
from core.learning.dataset import Sample, find_samples, write_mask, write_png
from core.learning.gpu_batches import DeviceCrops, DeviceWindows
from core.learning.model_writer import save_model, save_with_second_look
from core.learning.training_plan import TrainingPlan
from core.perception.model_file import ONNX, ONNX_INT8, SECOND_LOOK, WEIGHTS, ModelError, load_network, read_model_info
from core.perception.unet import DualUNet, UNetShape

SMALL = UNetShape((4, 4, 8, 8, 200), (4, 4, 4, 80), 1, 2)


@pytest.fixture
def small(tmp_path: Path) -> Path:
    torch.manual_seed(1)
    save_model(DualUNet(SMALL), tmp_path / "small", training={}, figures={})
    return tmp_path / "small"


def test_a_second_look_is_made_wider_once(small: Path, tmp_path: Path) -> None:
    plain = SecondLookLesson([], str(small), deepen=False).network
    wider = SecondLookLesson([], str(small), deepen=False, widen=True).network
    assert plain.shape.widths == SMALL.widths
    # A level that is wider than the shipped one already stays so.
    assert wider.shape.widths == (32, 64, 80, 128, 200)
    assert wider.shape.decoder_widths == (32, 48, 48, 80)
    picture = torch.rand(1, 5, 64, 64)
    with torch.no_grad():
        torch.testing.assert_close(wider.eval()(picture), plain.eval()(picture), rtol=1e-4, atol=1e-4)
    whole = tmp_path / "whole"
    save_with_second_look(small, wider, whole, training={}, figures={})
    assert load_network(whole / "second_look")[0].shape == wider.shape
    with pytest.raises(UserError, match="as wide already; leave --widen out"):
        SecondLookLesson([], str(whole), deepen=False, widen=True)


@pytest.mark.parametrize("name", [WEIGHTS, ONNX])
@pytest.mark.parametrize("place", [".", SECOND_LOOK])
@pytest.mark.parametrize("lesson", ["frames", "second look"])
def test_a_model_with_a_damaged_part_is_refused_before_anything_is_taught(
    small: Path, tmp_path: Path, name: str, place: str, lesson: str
) -> None:
    whole = tmp_path / "whole"
    save_with_second_look(small, SecondLookLesson([], str(small), deepen=False).network, whole, training={}, figures={})
    file = whole / place / name
    file.write_bytes(file.read_bytes()[:-1] + b"?")
    with pytest.raises(ModelError, match=f"{name}: SHA-256 differs") as raised:
        if lesson == "frames":
            FrameLesson([], str(whole), None, deepen=False, shallow=False)
        else:
            SecondLookLesson([], str(whole), deepen=False)
    assert len(str(raised.value).splitlines()) == 1


@pytest.fixture
def samples(tmp_path: Path) -> list[Sample]:
    rng = np.random.default_rng(0)
    for part in ("images", "masks"):
        (tmp_path / "set" / part).mkdir(parents=True)
    for number in range(3):
        vessel, robot = np.zeros((480, 640), bool), np.zeros((480, 640), bool)
        vessel[200:240], robot[216:224, : 200 + 100 * number] = True, True
        picture = rng.integers(0, 60, (480, 640, 3), np.uint8)
        picture[vessel] += 90
        picture[robot] += 90
        write_png(tmp_path / "set" / "images" / f"{number}.png", picture)
        write_mask(tmp_path / "set" / "masks" / f"{number}_vessel.png", vessel)
        write_mask(tmp_path / "set" / "masks" / f"{number}_robot.png", robot)
    return find_samples([tmp_path / "set"])


def test_where_there_is_a_gpu_it_makes_the_crops_of_both_lessons(
    small: Path, samples: list[Sample], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []
    monkeypatch.setattr(train, "_gpu", lambda count, batch: asked.append(count + batch) or torch.device("cpu"))
    monkeypatch.setattr(train, "_EXAMPLES", 2)
    plan = TrainingPlan(steps=2, batch=2, crop=(64, 64), warmup_steps=1, focus_share=0.4, end_weight=4)
    log: list[str] = []
    with Progress(disable=True) as bar:
        for out, lesson in (
            ("first", FrameLesson(samples, str(small), None, deepen=False, shallow=False)),
            ("near", SecondLookLesson(samples, str(small), deepen=False)),
        ):
            watch = HeldOutWatch(None, tmp_path / out, None, log.append)
            shown = lesson.crops(plan, bar, Interrupt())
            assert isinstance(shown, DeviceCrops if out == "first" else DeviceWindows)
            assert Classroom(tmp_path / out, {}, log.append, None, bar, Interrupt(), watch).teach(lesson, plan) == 2
    assert asked == [3 + 2] * 4
    assert len([line for line in log if "the GPU makes the crops" in line]) == 2
    assert read_model_info(tmp_path / "first").training["steps_done"] == 2
    assert (tmp_path / "near" / SECOND_LOOK / ONNX_INT8).is_file(), "its examples come from the GPU's windows"
    assert len([line for line in log if "step 2 loss" in line]) == 2


def test_what_a_gpu_cannot_take_is_the_processors(
    small: Path, samples: list[Sample], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, interrupt = TrainingPlan(steps=1, batch=1, crop=(64, 64)), Interrupt()
    whole = FrameLesson(samples, str(small), None, deepen=False, shallow=False)
    with Progress(disable=True) as bar:
        monkeypatch.setattr(train, "_gpu", lambda *_: None)
        assert isinstance(whole.crops(plan, bar, interrupt), FrameCrops), "there is none, or it has no room"
        monkeypatch.setattr(train, "_gpu", lambda *_: torch.device("cpu"))
        monkeypatch.setattr(train, "WINDOW_PX", 600)
        near = SecondLookLesson(samples, str(small), deepen=False)
        assert isinstance(near.crops(plan, bar, interrupt), NearCrops), "its windows are cut from larger pictures only"
        interrupt.asked = True
        assert near.crops(plan, bar, interrupt) is None
        assert not isinstance(whole.crops(plan, bar, interrupt), DeviceCrops)
