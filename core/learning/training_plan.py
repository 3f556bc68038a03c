"""How a network is to be trained. Imports no torch, so that a command line that makes no sense is refused at once."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class TrainingPlan:
    """Options of a training.

    Attributes
    ----------
    crop : (height, width) in working pixels.
    clutter_share : share of the crops that show neither vessel nor robot.
    look_share : share of the crops that are changed in exposure, colour, sharpness and noise.
    scene_share : share of the crops that are painted from scenes, where there are labelled frames, too.
    robot_weight : weight of the robot's loss beside the vessel's.
    end_weight : around the robot's true ends a pixel counts ``1 + end_weight`` times: theta and state are measured there.
    keeps_statistics : the normalisation stays as it was learnt: statistics of a few frames alike would ruin it for all others.
    seconds : time that the training takes, whatever the machine: the learning rate falls with the time, and `steps` is the most.
    workers : processes that make the crops; 0: this one. For a GPU it is as many as there are cores, up to eight.
    """

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
    scene_share: float = 0.5
    end_weight: float = 0.0
    keeps_statistics: bool = False
    seconds: float | None = None
    seed: int = 0
    workers: int = 1
    threads: int = 0

    def share_at(self, step: int, elapsed_s: float) -> float:
        """The share of the training that is done, 0..1, after `step` steps and `elapsed_s`."""
        share = step / self.steps
        return min(1.0, share if self.seconds is None else max(share, elapsed_s / self.seconds))

    def learning_rate_at(self, step: int, elapsed_s: float = 0.0) -> float:
        """Rises over the warm-up steps, then falls linearly to a hundredth."""
        if step < self.warmup_steps:
            return self.learning_rate * (step + 1) / self.warmup_steps
        reached = step if self.seconds is None else max(step, self.steps * elapsed_s / self.seconds)
        share = (reached - self.warmup_steps) / max(1, self.steps - self.warmup_steps)
        return self.learning_rate * max(0.01, 1.0 - share)

    def to_json(self) -> dict[str, Any]:
        return asdict(self)
