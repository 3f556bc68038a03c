"""A lesson is kept as soon as it is learnt."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from rich.progress import Progress
from torch import Tensor
from torch.utils.data import Dataset

from app.commands.progress import Interrupt
from app.commands.train import Classroom, HeldOutWatch, TrainInputs, TrainOutputs, run_train
from core.learning.dataset import DatasetError, write_mask, write_png
from core.learning.training_plan import TrainingPlan
from core.perception.model_file import ModelError
from core.perception.unet import DualUNet, UNetShape

_STEPS = 21


class _Crops(Dataset[tuple[Tensor, Tensor]]):
    def __len__(self) -> int:
        return _STEPS

    def __getitem__(self, index: int) -> tuple[Tensor, Tensor]:
        if index >= _STEPS:
            raise IndexError
        return torch.zeros(3, 64, 64, dtype=torch.uint8), torch.zeros(2, 64, 64, dtype=torch.uint8)


class _Lesson:
    """Remembers what was to be kept; the last, whole copy breaks down."""

    def __init__(self) -> None:
        self.network = DualUNet(UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2))
        self.kept: list[int] = []

    def sides(self, crop: tuple[int, int]) -> tuple[int, int]:
        return crop

    def crops(self, plan: TrainingPlan, bar: Progress, interrupt: Interrupt) -> _Crops:
        return _Crops()

    def save(self, network: DualUNet, out: Path, training: dict[str, Any], figures: dict[str, Any], *, whole: bool) -> None:
        if whole:
            raise MemoryError("no room for the eight-bit copy")
        self.kept.append(training["steps_done"])


def test_what_was_learnt_is_kept_before_the_eight_bit_copy_is_made(tmp_path: Path) -> None:
    lesson = _Lesson()
    watch = HeldOutWatch(None, tmp_path / "out", None, lambda _: None)
    with Progress(disable=True) as bar:
        room = Classroom(tmp_path / "out", {}, lambda _: None, None, bar, Interrupt(), watch)
        with pytest.raises(MemoryError):
            room.teach(lesson, TrainingPlan(steps=_STEPS, batch=1, crop=(64, 64), workers=0, warmup_steps=1))
    assert lesson.kept == [_STEPS]


def test_a_checkpoint_that_cannot_be_written_does_not_end_the_training(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lesson, told = _Lesson(), list[str]()
    full = [True]

    def save(network: DualUNet, out: Path, training: dict[str, Any], figures: dict[str, Any], *, whole: bool) -> None:
        assert all(parameter.device.type == "cpu" for parameter in network.parameters())
        if full and full.pop():
            raise ModelError(f"{out}: cannot be written (no space); make room, or choose another folder")
        lesson.kept.append(training["steps_done"])

    monkeypatch.setattr(lesson, "save", save)
    monkeypatch.setattr("app.commands.train._KEPT_EVERY", 7)
    watch = HeldOutWatch(None, tmp_path / "out", None, lambda _: None)
    with Progress(disable=True) as bar:
        room = Classroom(tmp_path / "out", {}, told.append, None, bar, Interrupt(), watch)
        assert room.teach(lesson, TrainingPlan(steps=_STEPS, batch=1, crop=(64, 64), workers=0, warmup_steps=1)) == _STEPS
    assert lesson.kept == [14, _STEPS, _STEPS]
    assert [line for line in told if "step 7 could not be kept: " in line and "cannot be written (no space)" in line]


def test_the_bar_moves_in_a_short_training_and_says_that_it_saves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lesson, shown = _Lesson(), list[tuple[int, str]]()
    monkeypatch.setattr(lesson, "save", lambda *_, **__: None)
    watch = HeldOutWatch(None, tmp_path / "out", None, lambda _: None)
    with Progress(disable=True) as bar:
        monkeypatch.setattr(bar, "update", lambda _, completed, description, **__: shown.append((completed, description)))
        room = Classroom(tmp_path / "out", {}, lambda _: None, None, bar, Interrupt(), watch)
        room.teach(lesson, TrainingPlan(steps=_STEPS, batch=1, crop=(64, 64), workers=0, warmup_steps=1))
    *moves, last = shown
    assert [step for step, _ in moves] == [*range(2, _STEPS, 2), _STEPS]
    assert last == (_STEPS, "saving ...")


def test_a_training_that_is_interrupted_before_its_first_step_is_no_success(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("images", "masks"):
        (tmp_path / "set" / name).mkdir(parents=True)
    write_png(tmp_path / "set" / "images" / "a.png", np.full((48, 64, 3), 90, np.uint8))
    for target in ("vessel", "robot"):
        write_mask(tmp_path / "set" / "masks" / f"a_{target}.png", np.zeros((48, 64), bool))
    monkeypatch.setattr(Classroom, "teach", lambda *_: None)
    with pytest.raises(KeyboardInterrupt):
        run_train(TrainOutputs(tmp_path / "model"), TrainInputs([tmp_path / "set"]), None, 4, TrainingPlan(steps=1))
    assert "interrupted before the first step" in capsys.readouterr().err
    assert not (tmp_path / "model").exists()


def test_a_gpu_without_room_for_a_batch_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("images", "masks"):
        (tmp_path / "set" / name).mkdir(parents=True)
    write_png(tmp_path / "set" / "images" / "a.png", np.full((48, 64, 3), 90, np.uint8))
    for target in ("vessel", "robot"):
        write_mask(tmp_path / "set" / "masks" / f"a_{target}.png", np.zeros((48, 64), bool))

    def teach(*_: object) -> None:
        raise torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 20.00 MiB.\nMore lines.")

    monkeypatch.setattr(Classroom, "teach", teach)
    with pytest.raises(DatasetError, match=r"the GPU has too little memory for this --batch and --crop; give smaller ones$"):
        run_train(TrainOutputs(tmp_path / "model"), TrainInputs([tmp_path / "set"]), None, 4, TrainingPlan(steps=1))
