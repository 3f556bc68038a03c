"""Trainings: what they begin with, when their network is saved, and what is reported."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from rich.progress import Progress
from torch import Tensor
from torch.utils.data import Dataset

from app.commands.progress import Interrupt
from app.commands.train import TrainOptions, run_train
from app.commands.trainer import FrameTraining, HeldOutMonitor, TipTraining, Trainer
from core.learning.dataset import DatasetError, find_samples, write_mask, write_png
from core.learning.model_writer import save_model, save_with_second_look
from core.learning.training_plan import TrainingPlan
from core.perception.inference import OpenVinoSegmenter
from core.perception.model_file import ONNX, SECOND_LOOK, ModelError
from core.perception.unet import DualUNet, UNetShape
from tests.core.learning.toy_scene import toy_scene
from tests.core.learning.toy_set import toy_set

SMALL = UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2)
STEPS = 21
PLAN = TrainingPlan(steps=STEPS, batch=1, crop=(64, 64), workers=0, warmup_steps=1)


@pytest.mark.parametrize("place", [".", SECOND_LOOK])
@pytest.mark.parametrize("task", [FrameTraining, TipTraining])
def test_a_model_with_a_damaged_part_is_refused_before_the_training(tmp_path: Path, place: str, task: Any) -> None:
    small, whole = tmp_path / "small", tmp_path / "whole"
    save_model(DualUNet(SMALL), small, training={}, figures={})
    save_with_second_look(small, TipTraining([], str(small)).network, whole, training={}, figures={})
    file = whole / place / ONNX
    file.write_bytes(file.read_bytes()[:-1] + b"?")
    with pytest.raises(ModelError, match=f"{ONNX}: SHA-256 differs") as raised:
        task([], str(whole))
    assert len(str(raised.value).splitlines()) == 1


class _BlankCrops(Dataset[tuple[Tensor, Tensor]]):
    def __len__(self) -> int:
        return STEPS

    def __getitem__(self, index: int) -> tuple[Tensor, Tensor]:
        if index >= STEPS:
            raise IndexError
        return torch.zeros(3, 64, 64, dtype=torch.uint8), torch.zeros(2, 64, 64, dtype=torch.uint8)


class _Task:
    """Remembers the steps at which it was saved; making the eight-bit copy fails."""

    measures_held_out = True

    def __init__(self) -> None:
        self.network = DualUNet(SMALL)
        self.saved: list[int] = []

    def crop_size(self, crop: tuple[int, int]) -> tuple[int, int]:
        return crop

    def crops(self, plan: TrainingPlan, bar: Progress, interrupt: Interrupt) -> _BlankCrops:
        return _BlankCrops()

    def save(self, network: DualUNet, out: Path, training: dict[str, Any], figures: dict[str, Any], *, whole: bool) -> None:
        if whole:
            raise MemoryError("no room for the eight-bit copy")
        self.saved.append(training["steps_done"])


def _run(task: _Task, out: Path, log: list[str], bar: Progress) -> int | None:
    monitor = HeldOutMonitor(None, out, None, log.append)
    return Trainer(out, {}, log.append, None, bar, Interrupt(), monitor).run(task, PLAN)


def test_the_network_is_saved_before_the_eight_bit_copy_is_made(tmp_path: Path) -> None:
    task = _Task()
    with Progress(disable=True) as bar, pytest.raises(MemoryError):
        _run(task, tmp_path / "out", [], bar)
    assert task.saved == [STEPS]


def test_a_checkpoint_that_cannot_be_written_does_not_end_the_training(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    task, log = _Task(), list[str]()
    full = [True]

    def save(network: DualUNet, out: Path, training: dict[str, Any], figures: dict[str, Any], *, whole: bool) -> None:
        assert all(parameter.device.type == "cpu" for parameter in network.parameters())
        if full and full.pop():
            raise ModelError(f"{out}: cannot be written (no space); make room, or choose another folder")
        task.saved.append(training["steps_done"])

    monkeypatch.setattr(task, "save", save)
    monkeypatch.setattr("app.commands.trainer._KEEP_EVERY", 7)
    with Progress(disable=True) as bar:
        assert _run(task, tmp_path / "out", log, bar) == STEPS
    assert task.saved == [14, STEPS, STEPS]
    assert [line for line in log if "step 7 could not be kept: " in line and "cannot be written (no space)" in line]


@pytest.fixture
def options(tmp_path: Path) -> TrainOptions:
    for name in ("images", "masks"):
        (tmp_path / "set" / name).mkdir(parents=True)
    write_png(tmp_path / "set" / "images" / "a.png", np.full((48, 64, 3), 90, np.uint8))
    for target in ("vessel", "robot"):
        write_mask(tmp_path / "set" / "masks" / f"a_{target}.png", np.zeros((48, 64), bool))
    return TrainOptions(tmp_path / "model", [tmp_path / "set"], base=4)


def test_a_training_that_is_interrupted_before_its_first_step_is_no_success(
    options: TrainOptions, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Trainer, "run", lambda *_: None)
    with pytest.raises(KeyboardInterrupt):
        run_train(options, TrainingPlan(steps=1))
    assert "interrupted before the first step" in capsys.readouterr().err
    assert not options.out.exists()


def test_a_gpu_without_room_for_a_batch_is_one_line(options: TrainOptions, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(*_: object) -> None:
        raise torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 20.00 MiB.\nMore lines.")

    monkeypatch.setattr(Trainer, "run", run)
    with pytest.raises(DatasetError, match=r"^the GPU has too little memory for this --batch and --crop; give smaller ones$"):
        run_train(options, TrainingPlan(steps=1))


@pytest.mark.parametrize("kind", ["scenes", "both"])
def test_an_eight_bit_copy_learns_from_what_was_trained_on(tmp_path: Path, kind: str) -> None:
    scene = tmp_path / "000000.npz"
    scene.write_bytes(toy_scene().to_bytes())
    samples = [] if kind == "scenes" else find_samples([toy_set(tmp_path / "set", 4)])
    task = FrameTraining(samples, None, 4, examples=4, scenes=[scene])
    task.network = network = DualUNet(SMALL).eval()
    with Progress(disable=True) as bar:
        task.crops(replace(PLAN, steps=60), bar, Interrupt())
    task.save(network, tmp_path / "model", {}, {}, whole=True)
    whole, eight_bit = (OpenVinoSegmenter(tmp_path / "model", 1, precision) for precision in ("fp32", "int8"))
    image = np.ascontiguousarray(np.random.default_rng(0).integers(0, 256, (64, 96, 3)), np.uint8)
    for exact, rounded in zip(whole(image), eight_bit(image), strict=True):
        assert np.abs(exact - rounded).mean() < 0.1
