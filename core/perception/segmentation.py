"""Stage 1: frame -> vessel and robot probabilities at working resolution (METHOD section 1)."""

from __future__ import annotations

import functools
import os
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config import SegmentationConfig
from core.learning.model_file import INFO, ONNX, ONNX_INT8, ModelError, check_files, model_folder, read_model_info, second_look_of
from core.types import Image

Probability = NDArray[np.float32]
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
        sums = np.zeros((2, *image.shape[:2]), np.float32)
        for turn in self._turns:
            turned = np.rot90(image, turn)
            found = see(self._segment, [np.ascontiguousarray(turned[:, ::step]) for step in (1, -1)])
            for step, one in zip((1, -1), found, strict=True):
                sums += np.rot90(np.stack(one)[:, :, ::step], -turn, axes=(1, 2))
        sums /= np.float32(2 * len(self._turns))
        return sums[0], sums[1]


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


def _padded(image: Image, stride: int) -> Image:
    """Right and bottom filled up to multiples of `stride`; mirrored, because an edge of constant colour would look like a wall."""
    height, width = image.shape[:2]
    down, right = -height % stride, -width % stride
    if not down and not right:
        return image
    border = cv2.BORDER_REFLECT_101 if min(height, width) > stride else cv2.BORDER_REPLICATE
    return np.asarray(cv2.copyMakeBorder(image, 0, down, 0, right, border), np.uint8)


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
    """The ONNX network on the CPU through OpenVINO, in int8 where the model has it; compiled once per image size and number."""

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
        self._requests: dict[tuple[int, int, int], Any] = {}

    @property
    def is_eight_bit(self) -> bool:
        return self._int8

    @property
    def engine(self) -> str:
        return f"OpenVINO CPU {'int8' if self._int8 else 'fp32'}"

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        return self._infer([image])[0]

    def together(self, images: Sequence[Image]) -> list[tuple[Probability, Probability]]:
        """Of each of the images, by twos: that keeps two cores busier than one after the other does."""
        pairs = (images[first : first + _AT_ONCE] for first in range(0, len(images), _AT_ONCE))
        return [found for pair in pairs for found in self._infer(pair)]

    def _infer(self, images: Sequence[Image]) -> list[tuple[Probability, Probability]]:
        """Of one or more images of one size."""
        height, width = images[0].shape[:2]
        padded = np.stack([_padded(image, self.info.stride) for image in images])
        request = self._request(padded.shape[:3])
        # The output tensor is reused by the next call, hence the copies.
        output = request.infer({0: padded}, share_inputs=True, share_outputs=True)[0]
        return [(one[0, :height, :width].copy(), one[1, :height, :width].copy()) for one in output]

    def _request(self, key: tuple[int, int, int]) -> Any:
        """To be asked about so many images of this height and width."""
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
        height, width = image.shape[:2]
        torch = self._torch
        batch = torch.from_numpy(np.ascontiguousarray(_padded(image, self.info.stride)))[None].to(self._device)
        with torch.inference_mode(), torch.autocast("cuda", torch.float16, enabled=self._device.type == "cuda"):
            output = self._network(batch)[0].float().cpu().numpy()
        return np.ascontiguousarray(output[0, :height, :width]), np.ascontiguousarray(output[1, :height, :width])


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
