"""What ``train`` can teach: the network that looks at whole pictures, or the one of a model's second look."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch
from rich.progress import Progress
from torch import Tensor
from torch.utils.data import Dataset

from core.config import SegmentationConfig
from core.errors import UserError
from core.learning.crops import FrameCrops, Looks, NearCrops
from core.learning.dataset import WORKING_SIZE_PX, DatasetError, Sample
from core.learning.device_crops import DeviceCrops
from core.learning.device_frames import DeviceFrames, fits
from core.learning.device_windows import DeviceWindows, first_looks
from core.learning.growing import deepened, widened, with_first_look
from core.learning.model_file import SECOND_LOOK, check_model, load_network, model_folder, second_look_of
from core.learning.model_writing import save_model, save_with_second_look
from core.learning.training_plan import TrainingPlan
from core.perception.engines import open_second_look, open_segmenter
from core.perception.second_look import WINDOW_PX, Planes
from core.perception.segmentation import Turned
from core.perception.unet import DualUNet, UNetShape
from core.study.difficulty import difficulty
from core.types import Image

if TYPE_CHECKING:
    from app.long_work import Interrupt

_EXAMPLES = 40
"""Training frames from which an eight-bit network learns its ranges."""
_MOST_THREADS = 64
"""As many as perception takes (``perception.segmentation.threads``)."""
_SECOND_LOOK_CONVOLUTIONS = ((3, 3, 3, 4, 4), 2)
"""Of each encoder level, and of every decoder level: a faint tip is decided on the fine ones."""
_SECOND_LOOK_WIDTHS = ((32, 64, 80, 128, 192), (32, 48, 48, 64))
"""Of its encoder and its decoders: half of the wrong states are decided by a pixel or a few degrees, which the fine levels see."""


class Lesson(Protocol):
    """A network to be trained, what it is shown, and how it is kept."""

    network: DualUNet

    def sides(self, crop: tuple[int, int]) -> tuple[int, int]:
        """The crops' height and width where these are asked for."""
        ...

    def crops(self, plan: TrainingPlan, bar: Progress, interrupt: Interrupt) -> Dataset[tuple[Tensor, Tensor]] | None:
        """What the network is shown; None when interrupted."""
        ...

    def save(self, network: DualUNet, out: Path, training: dict[str, Any], figures: dict[str, Any], *, whole: bool) -> None:
        """Write the model; without its eight-bit copy unless `whole`."""
        ...


class FrameLesson:
    """The network that looks at whole pictures: from nothing, or from the model `init`."""

    def __init__(self, samples: list[Sample], init: str | None, base: int | None, *, deepen: bool, shallow: bool) -> None:
        self._samples, self._init = samples, init
        self._second_look: Path | None = None
        if init is None:
            self.network = DualUNet(UNetShape.of_base(base) if base else default_shape(deep=not shallow))
            return
        self.network = load_network(model_folder(init))[0]
        check_model(init)  # its second look comes along as it is, and hours of training would end in a model that nobody can open
        self._second_look = second_look_of(model_folder(init))
        if deepen:
            if self.network.shape.encoder_convolutions == default_shape().encoder_convolutions:
                raise UserError(f"{init} is as deep already; leave --deepen out")
            images = [sample.load(WORKING_SIZE_PX)[0] for sample in _some(samples)]
            self.network = deepened(self.network, default_shape().encoder_convolutions, images)

    def sides(self, crop: tuple[int, int]) -> tuple[int, int]:
        stride = self.network.shape.stride
        return -(-crop[0] // stride) * stride, -(-crop[1] // stride) * stride

    def crops(self, plan: TrainingPlan, bar: Progress, interrupt: Interrupt) -> FrameCrops | DeviceCrops | None:
        if (frames := _on_device(self._samples, plan, bar, interrupt)) is not None:
            return DeviceCrops(frames, plan)
        if self._init is None or plan.focus_share == 0:
            return FrameCrops(self._samples, plan)
        segment = open_segmenter(_seen_by(self._init, plan))
        found = []
        for sample in bar.track(self._samples, description="finding hard frames"):
            if interrupt.asked:
                return None
            found.append(difficulty(sample, segment))
        return FrameCrops(self._samples, plan, np.array(found))

    def save(self, network: DualUNet, out: Path, training: dict[str, Any], figures: dict[str, Any], *, whole: bool) -> None:
        examples = list(_readable(_some(self._samples))) if whole else []
        save_model(network, out, training=training, figures=figures, examples=examples, second_look=self._second_look)


class SecondLookLesson:
    """The network of a model's second look, from the one that it has, or else from its network for whole pictures."""

    def __init__(self, samples: list[Sample], init: str | None, *, deepen: bool, widen: bool = False) -> None:
        if init is None:
            raise UserError("--second-look needs --init MODEL, whose first look it looks again after")
        self._samples, self._init, self._deepen = samples, init, deepen
        self._base = model_folder(init)
        check_model(init)  # both networks, whichever learns: what was learnt could not be kept beside a damaged one
        self._has_one = has_second_look(init)
        self.network = load_network(self._base / SECOND_LOOK)[0] if self._has_one else with_first_look(load_network(self._base)[0])
        shape = self.network.shape
        has = (*shape.encoder_convolutions, shape.decoder_convolutions)
        wanted = (*_SECOND_LOOK_CONVOLUTIONS[0], _SECOND_LOOK_CONVOLUTIONS[1])
        if deepen and (has == wanted or any(one > other for one, other in zip(has, wanted, strict=True))):
            raise UserError(f"the second look of {init} is as deep already; leave --deepen out")
        if widen:
            widths, decoder_widths = _SECOND_LOOK_WIDTHS
            wider = _each_larger(shape.widths, widths), _each_larger(shape.decoder_widths, decoder_widths)
            if wider == (shape.widths, shape.decoder_widths):
                raise UserError(f"the second look of {init} is as wide already; leave --widen out")
            self.network = widened(self.network, *wider)
        self._shown: NearCrops | DeviceWindows | None = None

    def sides(self, crop: tuple[int, int]) -> tuple[int, int]:
        return WINDOW_PX, WINDOW_PX

    def crops(self, plan: TrainingPlan, bar: Progress, interrupt: Interrupt) -> NearCrops | DeviceWindows | None:
        frames = None if self._deepen else _on_device(self._samples, plan, bar, interrupt, least_px=WINDOW_PX)
        if frames is not None:
            first, info = load_network(self._base)
            found = first_looks(first, info.stride, frames, _until_asked(len(frames), "first look", bar, interrupt))
            self._shown = None if found is None else DeviceWindows(frames, *found, plan)
            return self._shown
        plain = open_segmenter(_seen_by(self._init, plan))
        # Streams look once at the whole, single pictures eight times: the second look has to get on with both. Two stand for
        # eight here, where thousands of frames are looked at.
        ways = (plain, Turned(plain, turns=(0,)))
        # What the second look still gets wrong is worth more of its time than what only the first one did, and what it has seen it
        # may look at once more.
        near = open_second_look(_seen_by(self._init, plan)) if self._has_one else None
        looks: dict[Path, Looks] = {}  # a sample that is shown more often is looked at once
        for index, sample in enumerate(bar.track(self._samples, description="first look")):
            if interrupt.asked:
                return None
            if sample.image not in looks:
                looks[sample.image] = Looks.at(sample, ways[index % 2], near)
        self._shown = NearCrops(self._samples, [looks[sample.image] for sample in self._samples], plan)
        if self._deepen and not interrupt.asked:
            depths = _SECOND_LOOK_CONVOLUTIONS
            self.network = deepened(self.network, depths[0], self._examples(), decoder_convolutions=depths[1])
        return None if interrupt.asked else self._shown

    def save(self, network: DualUNet, out: Path, training: dict[str, Any], figures: dict[str, Any], *, whole: bool) -> None:
        examples = self._examples() if whole else []
        save_with_second_look(self._base, network, out, training=training, figures=figures, examples=examples)

    def _examples(self) -> list[Planes]:
        """Windows from all over the training."""
        examples: list[Planes] = []
        if isinstance(self._shown, DeviceWindows):
            return self._shown.examples(4 * _EXAMPLES)
        if self._shown is not None:
            step = max(1, len(self._shown) // (4 * _EXAMPLES))
            for index in range(0, len(self._shown), step):
                with suppress(DatasetError):  # as in _readable
                    examples.append(np.ascontiguousarray(self._shown[index][0].numpy().transpose(1, 2, 0)))
        return examples


def _gpu(frames: int, batch: int) -> torch.device | None:
    """A GPU with room for so many frames and the crops of a batch, if there is one."""
    device = torch.device("cuda")
    return device if torch.cuda.is_available() and fits(frames, batch, device) else None


def _on_device(
    samples: list[Sample], plan: TrainingPlan, bar: Progress, interrupt: Interrupt, least_px: int = 0
) -> DeviceFrames | None:
    """The frames in a GPU's memory, which makes its crops itself then.

    None: there is no GPU or no room, they are of several sizes or smaller than `least_px`, or it was interrupted.
    """
    count = len({sample.image for sample in samples})
    if (device := _gpu(count, plan.batch)) is None:
        return None
    frames = DeviceFrames.load(samples, device, _until_asked(count, "frames to the GPU", bar, interrupt))
    return frames if frames is not None and min(frames.size) >= least_px and not interrupt.asked else None


def _until_asked(count: int, what: str, bar: Progress, interrupt: Interrupt) -> Iterator[int]:
    """The numbers below `count`, told by a bar, until somebody interrupts."""
    for number in bar.track(range(count), description=what):
        if interrupt.asked:
            return
        yield number


def _seen_by(model: str, plan: TrainingPlan) -> SegmentationConfig:
    """How frames are looked at before the training, on as many threads as this has."""
    return SegmentationConfig(model=model, threads=min(plan.threads, _MOST_THREADS))


def has_second_look(model: str) -> bool:
    """Whether a model has a network for a second look; raises ModelError when there is no such model."""
    return second_look_of(model_folder(model)) is not None


def default_shape(*, deep: bool = True) -> UNetShape:
    """The shipped network: chosen in docs/method.md by accuracy against time on two cores without bf16."""
    return UNetShape((16, 32, 64, 128, 192), (16, 24, 48, 64), 1, 2, (2, 2, 3, 4, 4) if deep else (2, 2, 2, 2, 2))


def _each_larger(some: tuple[int, ...], others: tuple[int, ...]) -> Any:
    """The larger one at each place."""
    return tuple(max(one, other) for one, other in zip(some, others, strict=True))


def _some(samples: list[Sample]) -> list[Sample]:
    """From all over the sets."""
    return samples[:: max(1, len(samples) // _EXAMPLES)]


def _readable(samples: list[Sample]) -> Iterator[Image]:
    for sample in samples:
        with suppress(DatasetError):  # the training says it, and then wants to keep what was learnt without that frame
            yield sample.load(WORKING_SIZE_PX)[0]
