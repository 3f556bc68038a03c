"""Training of the dual-decoder U-Net: cross entropy + Dice for both tasks, Muon and AdamW at a falling rate, averaged weights.

Muon is K. Jordan et al., "Muon: an optimizer for hidden layers in neural networks", 2024. ``torch.optim.Muon`` takes matrices only
and computes in bf16, which is slow on processors without it.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.utils.data import DataLoader, Dataset

from core.learning.augmentation import Crop
from core.learning.dataset import WORKING_SIZE_PX, DatasetError, Sample
from core.learning.training_plan import TrainingPlan
from core.perception.inference import cores, padded
from core.perception.unet import DualUNet
from core.types import Image, Mask

_QUINTIC = (3.4445, -4.7750, 2.0315)
"""Coefficients of the Newton-Schulz iteration that drives all singular values into 0.7..1.2 within five rounds."""
_SMALL_AREA_PX = 50.0
"""Added to areas in a crop's Dice: in a crop with a smaller robot, a few pixels do not decide it."""
_MOST_LOADERS = 8
"""Processes that make the crops for a GPU, at most."""


def orthogonalised(matrix: Tensor, rounds: int = 5) -> Tensor:
    """The (rows, columns) matrix with its singular values brought near 1, by a Newton-Schulz iteration.

    Every round multiplies by a polynomial of the Gram matrix, and these commute: they are multiplied at the size of the shorter
    side, and the long matrix once instead of twice a round.
    """
    a, b, c = _QUINTIC
    x: Tensor = matrix / (matrix.norm() + 1e-7)
    tall = x.shape[0] > x.shape[1]
    if tall:
        x = x.T
    gram = x @ x.T
    unit = torch.eye(len(gram), dtype=gram.dtype, device=gram.device)
    product = unit
    for left in reversed(range(rounds)):
        factor = a * unit + b * gram + c * gram @ gram
        product = factor @ product
        if left:
            gram = factor @ gram @ factor
    x = product @ x
    return x.T if tall else x


class Muon(torch.optim.Optimizer):
    """Momentum with orthogonalised direction; steps of AdamW's root mean square (0.2 of the learning rate) for any kernel size."""

    def __init__(self, parameters: Iterable[Tensor], lr: float, momentum: float = 0.95, weight_decay: float = 0.01) -> None:
        super().__init__(parameters, {"lr": lr, "momentum": momentum, "weight_decay": weight_decay})

    @torch.no_grad()
    def step(self, closure: Callable[[], float] | None = None) -> None:  # type: ignore[override]
        """One step along the orthogonalised Nesterov momentum of every parameter that has a gradient."""
        for group in self.param_groups:
            for parameter in group["params"]:
                if parameter.grad is None:
                    continue
                state = self.state[parameter]
                if "momentum" not in state:
                    state["momentum"] = torch.zeros_like(parameter)
                state["momentum"].lerp_(parameter.grad, 1 - group["momentum"])
                direction = parameter.grad.lerp(state["momentum"], group["momentum"]).flatten(1)
                scale = 0.2 * max(direction.shape) ** 0.5
                parameter.mul_(1 - group["lr"] * group["weight_decay"])
                parameter.sub_(orthogonalised(direction).view_as(parameter), alpha=group["lr"] * scale)


def make_optimizers(network: nn.Module, learning_rate: float, weight_decay: float) -> list[torch.optim.Optimizer]:
    """Muon for the 3x3 kernels, AdamW at 0.3 of its learning rate for outputs, up-samplings, scales and offsets."""
    kernels = [m.weight for m in network.modules() if isinstance(m, nn.Conv2d) and m.kernel_size != (1, 1)]
    taken = {id(parameter) for parameter in kernels}
    rest = [parameter for parameter in network.parameters() if id(parameter) not in taken]
    return [Muon(kernels, learning_rate), torch.optim.AdamW(rest, learning_rate * 0.3, weight_decay=weight_decay)]


@dataclass(frozen=True, slots=True)
class TrainingProgress:
    """State of a running training: ``loss`` smoothed, ``images_per_s`` since the last report.

    ``steps`` is an estimate where the plan gives the time.
    """

    step: int
    steps: int
    loss: float
    vessel_dice: float
    robot_dice: float
    images_per_s: float


def loss_of(logits: Tensor, target: Tensor, robot_weight: float, end_weight: float = 0.0) -> tuple[Tensor, Tensor]:
    """Cross entropy + Dice of both tasks, and the plain soft Dice (2,) of both over the batch.

    ``target`` (N, 2 to 4, H, W) are vessel, robot, how near a pixel is to an end of the robot (0..1): in the loss it counts
    ``1 + end_weight`` times there; and where the robot's label is unsure (0, 1): there it does not count for the robot.

    Half of the Dice is taken over the batch, half over every crop by itself: over the batch alone, a crop whose robot is short or
    faint weighs next to nothing, and those are the crops in which a tip gets lost.
    """
    weights = logits.new_tensor([1.0, robot_weight])
    counts = 1 + end_weight * target[:, 2:3] if target.shape[1] > 2 else None
    sure = torch.cat([torch.ones_like(target[:, 3:4]), 1 - target[:, 3:4]], dim=1) if target.shape[1] > 3 else None
    if counts is not None and sure is not None:
        counts = counts * sure
    target = target[:, :2]
    entropies = torch.nn.functional.binary_cross_entropy_with_logits(logits, target, weight=counts, reduction="none")
    entropy = entropies.mean(dim=(0, 2, 3))
    probability = torch.sigmoid(logits)
    both, either = probability * target, probability + target
    if sure is not None:
        both, either = both * sure, either * sure
    plain = (2 * both.sum(dim=(0, 2, 3)) + 1) / (either.sum(dim=(0, 2, 3)) + 1)
    if counts is not None:
        both, either = probability * target * counts, (probability + target) * counts
    overlap, size = both.sum(dim=(2, 3)), either.sum(dim=(2, 3))
    dice = (2 * overlap.sum(dim=0) + 1) / (size.sum(dim=0) + 1)
    each = ((2 * overlap + _SMALL_AREA_PX) / (size + _SMALL_AREA_PX)).mean(dim=0)
    # The robot is some 2 % of the pixels: unweighted, its entropy would drown in the background's.
    entropy = entropy * logits.new_tensor([1.0, 5.0])
    return ((entropy + 1 - 0.5 * (dice + each)) * weights).sum(), plain.detach()


def computes_in_bf16(device: torch.device) -> bool:
    """Whether bf16 is native here: elsewhere it is emulated, and slower than float32."""
    if device.type == "cuda":
        return True
    able = torch.cpu.get_capabilities()
    return bool(able.get("avx512_bf16") or able.get("amx_bf16"))


class LoaderLost(DatasetError):
    """The process that reads the frames was ended; no frame is at fault."""


def _batches(crops: Dataset[Crop], plan: TrainingPlan, device: torch.device, failed: list[DatasetError]) -> Iterator[Crop]:
    """All batches, or those until a frame cannot be read or the process that reads them has ended: that goes into `failed`."""
    workers = min(cores(), _MOST_LOADERS) if device.type == "cuda" and plan.workers else plan.workers
    try:
        yield from DataLoader(crops, plan.batch, num_workers=workers, prefetch_factor=4 if workers else None)
    except DatasetError as error:
        # A worker's error comes with its traceback; the last line is its message.
        message = str(error).strip().splitlines()[-1].removeprefix(f"{DatasetError.__module__}.DatasetError: ")
        failed.append(DatasetError(message))
    except RuntimeError as error:
        if "DataLoader worker" not in str(error):
            raise
        failed.append(LoaderLost("the process that reads the frames was ended from outside; is there too little memory?"))


def train(
    network: DualUNet,
    crops: Dataset[Crop],
    plan: TrainingPlan,
    *,
    on_progress: Callable[[TrainingProgress], None] = lambda _: None,
    on_checkpoint: Callable[[DualUNet, int], None] = lambda _network, _step: None,
    on_last: Callable[[DualUNet, int], None] = lambda _network, _step: None,
    should_stop: Callable[[], bool] = lambda: False,
    report_every: int = 50,
    checkpoint_every: int = 1000,
) -> tuple[DualUNet, int]:
    """Train `network` in place; returns the network with averaged weights and the number of steps done.

    Parameters
    ----------
    crops : ``plan.steps * plan.batch`` crops with their labels.
    should_stop : asked after every step; what was learnt until then is returned.
    on_last : gets the network while the crops' workers still run: processes have broken down when these ended. It and
        `on_checkpoint` are given a network on the CPU.

    Raises
    ------
    DatasetError
        A frame cannot be read; `on_last` was given what was learnt until then.
    """
    torch.manual_seed(plan.seed)
    if plan.threads:
        torch.set_num_threads(plan.threads)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    network = network.to(device, memory_format=torch.channels_last).train()  # type: ignore[call-overload]
    if plan.keeps_statistics:
        for module in network.modules():
            if isinstance(module, torch.nn.BatchNorm2d):
                module.eval()
    average = copy.deepcopy(network).eval()
    optimizers = make_optimizers(network, plan.learning_rate, plan.weight_decay)
    groups = [(group, group["lr"] / plan.learning_rate) for optimizer in optimizers for group in optimizer.param_groups]
    averaged = list(zip(average.state_dict().values(), network.state_dict().values(), strict=True))
    smooth_loss, smooth_dice = torch.zeros((), device=device), torch.zeros(2, device=device)
    done, began, marked = 0, time.monotonic(), 0
    mark = began
    failed: list[DatasetError] = []
    for image, target in _batches(crops, plan, device, failed):
        rate = plan.learning_rate_at(done, time.monotonic() - began)
        for group, share in groups:
            group["lr"] = share * rate
        loss, dice = _step(network, optimizers, image, target, plan)
        _average(averaged, min(plan.average_decay, (1 + done) / (10 + done)))
        # Kept on the device: read after every step, a GPU would wait for the processor.
        blend = max(0.02, 1 / (done + 1))
        smooth_loss.lerp_(loss.detach(), blend)
        smooth_dice.lerp_(dice, blend)
        done += 1
        now = time.monotonic()
        share = plan.share_at(done, now - began)
        if done % report_every == 0 or share == 1.0:
            speed = (done - marked) * plan.batch / max(now - mark, 1e-9)
            vessel, robot = smooth_dice.tolist()
            on_progress(TrainingProgress(done, round(done / share), float(smooth_loss), vessel, robot, speed))
            mark, marked = now, done
        if done % checkpoint_every == 0 and share < 1.0:
            # A network on a GPU is copied: the original learns on there.
            on_checkpoint(average if device.type == "cpu" else copy.deepcopy(average).to("cpu"), done)
        if should_stop() or share == 1.0:
            on_last(average.to("cpu"), done)
            break
    if failed:
        if done:
            on_last(average.to("cpu"), done)
        raise failed[0]
    return average.to("cpu"), done


def _step(
    network: DualUNet, optimizers: Sequence[torch.optim.Optimizer], image: Tensor, target: Tensor, plan: TrainingPlan
) -> tuple[Tensor, Tensor]:
    """Learn from one batch; its loss, and the Dice of vessel and robot (2,)."""
    device = next(network.parameters()).device
    batch = (image.to(device).float() / 255).contiguous(memory_format=torch.channels_last)
    with torch.autocast(device.type, torch.bfloat16, enabled=computes_in_bf16(device)):
        logits = network(batch)
    labels = target.to(device).float()
    if labels.shape[1] > 2:
        labels[:, 2] /= 255
    loss, dice = loss_of(logits.float(), labels, plan.robot_weight, plan.end_weight)
    for optimizer in optimizers:
        optimizer.zero_grad(set_to_none=True)
    loss.backward()  # type: ignore[no-untyped-call]
    torch.nn.utils.clip_grad_norm_(network.parameters(), 5.0)
    for optimizer in optimizers:
        optimizer.step()
    return loss, dice


@torch.no_grad()
def _average(averaged: list[tuple[Tensor, Tensor]], decay: float) -> None:
    for kept, new in averaged:
        if kept.dtype.is_floating_point:
            kept.lerp_(new, 1 - decay)
        else:
            kept.copy_(new)


@dataclass(frozen=True, slots=True, eq=False)
class HeldOutFrame:
    """Picture and true masks of a frame at working size, and the masks that the network finds."""

    stem: str
    image: Image
    true_vessel: Mask
    true_robot: Mask
    vessel: Mask
    robot: Mask


@dataclass(frozen=True, slots=True, eq=False)
class HeldOutResult:
    """Frames that are not trained on, and Dice coefficients over the pixels of all of them together."""

    frames: tuple[HeldOutFrame, ...]
    vessel_dice: float
    robot_dice: float


@torch.no_grad()
def measure_held_out(network: DualUNet, samples: Sequence[Sample]) -> HeldOutResult:
    """Run the network, as it is, on whole frames; its mode is left as it was. Raises DatasetError."""
    device, frames = next(network.parameters()).device, []
    was_training = network.training
    network.eval()
    try:
        for sample in samples:
            image, vessel, robot = sample.load(WORKING_SIZE_PX)
            height, width = image.shape[:2]
            whole = padded(image, network.shape.stride)  # as perception does it, and cut back
            batch = torch.from_numpy(np.ascontiguousarray(whole.transpose(2, 0, 1)))[None].to(device).float() / 255
            found = (network(batch)[0] > 0).cpu().numpy()[:, :height, :width]
            frames.append(HeldOutFrame(sample.stem, image, vessel, robot, found[0], found[1]))
    finally:
        network.train(was_training)
    vessel_dice = dice([(frame.vessel, frame.true_vessel) for frame in frames])
    return HeldOutResult(tuple(frames), vessel_dice, dice([(frame.robot, frame.true_robot) for frame in frames]))


def dice(pairs: Sequence[tuple[Mask, Mask]]) -> float:
    """Dice coefficient of found and true masks over all pairs together; 1 where neither has any pixel."""
    both = sum(int((found & true).sum()) for found, true in pairs)
    total = sum(int(found.sum()) + int(true.sum()) for found, true in pairs)
    return 2.0 * both / total if total else 1.0
