"""Stage 1: frame -> vessel and robot probabilities at working resolution (METHOD section 1)."""

from __future__ import annotations

import functools
import os
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar, runtime_checkable

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config import SegmentationConfig
from core.learning.model_file import INFO, ONNX, ONNX_INT8, ModelError, check_files, model_folder, read_model_info, second_look_of
from core.perception.familiarity import Signature, signature_of
from core.types import Image

Probability = NDArray[np.float32]
_Taken = TypeVar("_Taken")
_AT_ONCE = 2
"""Two windows of 160 px in one call take 2.1 instead of 2.8 ms on two cores."""


class Segmenter(Protocol):
    """Gives vessel and robot probabilities, float32 (h, w) each, of an RGB uint8 image (h, w, 3) of any size.

    The network of the second look takes ``second_look.Planes`` in its place.
    """

    @property
    def engine(self) -> str: ...
    def __call__(self, image: Image) -> tuple[Probability, Probability]: ...


@runtime_checkable
class Pairing(Protocol):
    """A segmenter that sees several images of one size in less time than one after the other."""

    def together(self, images: Sequence[Image]) -> list[tuple[Probability, Probability]]: ...


Recognised = tuple[Probability, Probability, Signature | None]
"""Probabilities of vessel and robot, and the picture's signature; None: the network's deepest level is not to be had."""
Seen = tuple[Probability, Probability] | Recognised


@runtime_checkable
class Recognising(Protocol):
    """A segmenter that also tells what kind of pictures it sees (``familiarity.py``)."""

    def recognise(self, images: Sequence[Image]) -> list[Recognised]: ...


def recognise(segmenter: Segmenter, images: Sequence[Image]) -> list[Recognised]:
    """What `segmenter` finds in each of the images (of one size), and their signatures where it is able to tell."""
    if isinstance(segmenter, Recognising):
        return segmenter.recognise(images)
    return [(*found, None) for found in see(segmenter, images)]


def see(segmenter: Segmenter, images: Sequence[Image]) -> list[tuple[Probability, Probability]]:
    """What `segmenter` finds in each of the images (of one size), at once where it is able to."""
    return segmenter.together(images) if isinstance(segmenter, Pairing) else [segmenter(image) for image in images]


class Turned:
    """The mean over a picture and its mirror image, each in some quarter turns (test-time augmentation): surer than any alone.

    Parameters
    ----------
    segmenter : gives vessel and robot probabilities of an image (h, w, channels).
    turns : by how many quarters the picture is turned; it is asked twice for each. (0,): the picture and its mirror image.
    """

    def __init__(self, segmenter: Segmenter, turns: Sequence[int] = (0, 1, 2, 3)) -> None:
        self._segment, self._turns = segmenter, tuple(turns)

    @property
    def engine(self) -> str:
        return f"{self._segment.engine}, {2 * len(self._turns)} orientations"

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        return self._look(image, see)[:2]

    def recognise(self, images: Sequence[Image]) -> list[Recognised]:
        """The signature is that of the picture as it was first shown: one turned upside down is of another kind, a bit."""
        return [self._look(image, recognise) for image in images]

    def _look(self, image: Image, first: Callable[[Segmenter, Sequence[Image]], Sequence[Seen]]) -> Recognised:
        """The mean, and what else `first` told of the picture where it was asked first."""
        sums = np.zeros((2, *image.shape[:2]), np.float32)
        signature: Signature | None = None
        for turn in self._turns:
            turned = np.rot90(image, turn)
            pair = [np.ascontiguousarray(turned[:, ::step]) for step in (1, -1)]
            found: Sequence[Seen] = (first if turn == self._turns[0] else see)(self._segment, pair)
            if len(found[0]) == 3:
                signature = found[0][2]
            for step, (vessel, robot, *_) in zip((1, -1), found, strict=True):
                sums += np.rot90(np.stack([vessel, robot])[:, :, ::step], -turn, axes=(1, 2))
        sums /= np.float32(2 * len(self._turns))
        return sums[0], sums[1], signature


def to_working(image: Image, working_size_px: int) -> tuple[Image, tuple[float, float]]:
    """Scale an image so that its longer side is `working_size_px`; returns it and working pixels per source pixel in x and y.

    The two differ a little, because the shorter side is rounded to whole pixels.
    """
    height, width = image.shape[:2]
    scale = working_size_px / max(height, width)
    if scale == 1.0:
        return image, (1.0, 1.0)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    # Area averaging keeps thin structures when shrinking; it would show blocks when enlarging.
    resized = cv2.resize(image, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    return np.asarray(resized, np.uint8), (size[0] / width, size[1] / height)


def padded(image: Image, stride: int) -> Image:
    """Right and bottom filled up to multiples of `stride`; mirrored, because an edge of constant colour would look like a wall."""
    height, width = image.shape[:2]
    down, right = -height % stride, -width % stride
    if not down and not right:
        return image
    border = cv2.BORDER_REFLECT_101 if min(height, width) > stride else cv2.BORDER_REPLICATE
    return np.asarray(cv2.copyMakeBorder(image, 0, down, 0, right, border), np.uint8)


def _cropped(probabilities: NDArray[np.float32], image: Image) -> tuple[Probability, Probability]:
    """Vessel and robot without the padding. Copies: the next call uses the engine's output again."""
    height, width = image.shape[:2]
    return probabilities[0, :height, :width].copy(), probabilities[1, :height, :width].copy()


_making_core = threading.Lock()


@functools.cache
def _core() -> Any:
    """The one OpenVINO of this process, which is never given back; to be asked for with `_making_core` held.

    Each OpenVINO lends its thread a stack for signals (sigaltstack). Where two end in the order in which they began, the second
    gives back to the thread the stack of the first, which is unmapped by then: the next signal that Python handles (Ctrl-C,
    SIGTERM, the end of a loader's process) kills this process as a memory fault.
    """
    # Importing openvino reports itself over the network; with its telemetry package blocked it takes a silent stub instead.
    sys.modules["openvino_telemetry"] = None  # type: ignore[assignment]
    import openvino

    return openvino.Core()


class OpenVinoSegmenter:
    """The ONNX network on the CPU through OpenVINO, in int8 where the model has it; compiled once per image size and number.

    Several threads may ask: the feed's, and one that looks at a still again. They take turns, picture by picture.
    """

    _MAX_SIZES = 6

    def __init__(self, folder: Path, threads: int = 0, precision: str = "auto") -> None:
        self.info = read_model_info(folder, verify=())
        self._int8 = precision == "int8" or (precision == "auto" and self.info.onnx_int8_sha256 is not None)
        name = ONNX_INT8 if self._int8 else ONNX
        check_files(self.info, folder, (name,))
        with _making_core:
            self._core = _core()
        self._threads = threads or cores()
        try:
            self._model = self._core.read_model(folder / name)
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[-1]
            raise ModelError(f"{folder / name}: cannot be read ({reason}); restore the model folder") from None
        self._file = folder / name
        # The second look's windows are parts of pictures, of which nobody asks what kind they are.
        deepest = _deepest(self._model) if self.info.planes == 3 else None
        self._recognises = deepest is not None
        if deepest is not None:
            self._model.add_outputs(deepest)
        self._requests: dict[tuple[int, int, int], Any] = {}
        self._asking = threading.Lock()

    @property
    def is_eight_bit(self) -> bool:
        return self._int8

    @property
    def engine(self) -> str:
        return f"OpenVINO CPU {'int8' if self._int8 else 'fp32'}"

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        return self.together([image])[0]

    def together(self, images: Sequence[Image]) -> list[tuple[Probability, Probability]]:
        """Of each of the images, by twos: that keeps two cores busier than one after the other does."""
        return self._infer(images, lambda image, probabilities, _deepest: _cropped(probabilities, image))

    def recognise(self, images: Sequence[Image]) -> list[Recognised]:
        """The same, and each image's signature."""

        def take(image: Image, probabilities: Probability, deepest: NDArray[np.float32] | None) -> Recognised:
            return (*_cropped(probabilities, image), signature_of(deepest, probabilities[0]) if deepest is not None else None)

        return self._infer(images, take)

    def _infer(
        self, images: Sequence[Image], take: Callable[[Image, Probability, NDArray[np.float32] | None], _Taken]
    ) -> list[_Taken]:
        """What `take` makes of each image (of one size), its probabilities (2, H, W) with padding, and the deepest level.

        `take` keeps copies: the next question, maybe another thread's, overwrites both.
        """
        taken: list[_Taken] = []
        for first in range(0, len(images), _AT_ONCE):
            some = images[first : first + _AT_ONCE]
            batch = np.stack([padded(image, self.info.stride) for image in some])
            with self._asking:
                results = self._request(batch.shape[:3]).infer({0: batch}, share_inputs=True, share_outputs=True)
                deepest = results[1] if self._recognises else [None] * len(some)
                taken += map(take, some, results[0], deepest)
        return taken

    def _request(self, key: tuple[int, int, int]) -> Any:
        """To be asked about so many images of this height and width, with `_asking` held."""
        if key not in self._requests:
            if len(self._requests) >= self._MAX_SIZES:
                self._requests.pop(next(iter(self._requests)))
            model = self._model.clone()
            options = {"PERFORMANCE_HINT": "LATENCY", "INFERENCE_NUM_THREADS": self._threads}
            try:
                model.reshape([*key, self.info.planes])
                self._requests[key] = self._core.compile_model(model, "CPU", options).create_infer_request()
            except RuntimeError as error:
                reason = str(error).strip().splitlines()[-1]
                raise ModelError(f"{self._file}: is no network of {INFO}'s shape ({reason}); restore the model folder") from None
        return self._requests[key]


def _deepest(model: Any) -> Any | None:
    """The output of the encoder's last level, with which both decoders begin, in OpenVINO's graph; None where none is such."""
    inputs = [node.input_value(0) for node in model.get_ordered_ops() if node.get_type_name() == "ConvolutionBackpropData"]
    names = [found.get_node().get_friendly_name() for found in inputs]
    return next((found for found, name in zip(inputs, names, strict=True) if names.count(name) == 2), None)


class TorchSegmenter:
    """The same network in torch: half precision on a CUDA device where there is one, else fp32 on the CPU."""

    def __init__(self, folder: Path, threads: int = 0) -> None:
        import torch

        from core.learning.model_file import load_network
        from core.perception.unet import Probabilities

        network, self.info = load_network(folder)
        self._torch = torch
        self._device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        if self._device.type == "cpu":
            torch.set_num_threads(threads or cores())
        self._network = Probabilities(network).to(self._device, memory_format=torch.channels_last)  # type: ignore[call-overload]

    @property
    def engine(self) -> str:
        return f"torch {self._device.type.upper()}"

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        return _cropped(self._infer(image)[0].float().cpu().numpy(), image)

    def recognise(self, images: Sequence[Image]) -> list[Recognised]:
        """Of each of the images, with its signature."""
        found = ([part.float().cpu().numpy() for part in self._infer(image)] for image in images)
        return [
            (*_cropped(seen, image), signature_of(deepest, seen[0])) for image, (seen, deepest) in zip(images, found, strict=True)
        ]

    def _infer(self, image: Image) -> tuple[Any, Any]:
        """Probabilities (2, H, W) with padding, and the deepest level, on the device."""
        torch = self._torch
        batch = torch.from_numpy(np.ascontiguousarray(padded(image, self.info.stride)))[None].to(self._device)
        with torch.inference_mode(), torch.autocast("cuda", torch.float16, enabled=self._device.type == "cuda"):
            probabilities, deepest = self._network.with_deepest(batch)
        return probabilities[0], deepest[0]


def cuda_present() -> bool:
    """Whether torch can use a CUDA device. The kernel is asked first, because importing torch to ask costs seconds."""
    if not Path("/proc/driver/nvidia/version").exists() and not Path("/dev/nvidia0").exists():
        return False
    import torch

    return torch.cuda.is_available()


def cores() -> int:
    """Cores that this process may use; in a container fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def open_segmenter(config: SegmentationConfig) -> OpenVinoSegmenter | TorchSegmenter:
    """Load the configured model into the configured engine ("auto": torch where a CUDA device is present, else OpenVINO).

    Raises
    ------
    ModelError
        Missing, cut or damaged model; the message says what to do.
    """
    return _open(model_folder(config.model), config)


def open_second_look(config: SegmentationConfig) -> OpenVinoSegmenter | TorchSegmenter | None:
    """The network of the configured model's second look, which takes ``second_look.Planes``; None: it has none, or none is wanted.

    Raises ModelError, as ``open_segmenter`` does, and when the model has lost its second look.
    """
    folder = second_look_of(model_folder(config.model)) if config.second_look else None
    return _open(folder, config, planes=5) if folder is not None else None


def _open(folder: Path, config: SegmentationConfig, planes: int = 3) -> OpenVinoSegmenter | TorchSegmenter:
    if (found := read_model_info(folder, verify=()).planes) != planes:
        raise ModelError(f"{folder / INFO}: the network takes {found} planes, not {planes}; restore the model folder")
    if config.device == "torch" or (config.device == "auto" and cuda_present()):
        return TorchSegmenter(folder, config.threads)
    return OpenVinoSegmenter(folder, config.threads, config.precision)
