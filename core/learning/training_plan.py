"""How a network is to be trained. Apart from the training, so that a command line that makes no sense need not wait for it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class TrainingPlan:
    """How to train. ``crop`` is (height, width) in working pixels; ``clutter_share`` of the samples show nothing of ours,
    ``look_share`` of them are changed in exposure, colour, sharpness and noise, and in ``strip_share`` of the first look's ones
    clips lie over the robot. ``stop_after`` ends before the learning rate has come down: for a run that another one goes on from.
    ``focus_share`` of the samples are drawn by difficulty. The robot's loss counts ``robot_weight`` times the vessel's, and around
    the robot's true ends a pixel ``1 + end_weight`` times: theta and state are measured there. With ``keeps_statistics`` the
    normalisation stays as it was learnt: that of a few frames alike would ruin it for all others."""

    steps: int = 6000
    batch: int = 12
    learning_rate: float = 1e-2
    weight_decay: float = 1e-4
    warmup_steps: int = 100
    crop: tuple[int, int] = (256, 256)
    clutter_share: float = 0.03
    average_decay: float = 0.998
    robot_weight: float = 1.5
    look_share: float = 1.0
    strip_share: float = 0.0
    focus_share: float = 0.0
    end_weight: float = 0.0
    keeps_statistics: bool = False
    stop_after: int | None = None
    seed: int = 0
    workers: int = 1
    threads: int = 0

    def to_json(self) -> dict[str, Any]:
        return asdict(self)
