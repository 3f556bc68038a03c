"""The engines that compute a model's networks: OpenVINO on the CPU, torch where there is a CUDA device.

Networks as OpenVINO has compiled them for this machine, in the user's cache: compiling takes eight times as long as reading.

OpenVINO can keep them by itself, but it believes every byte of what it has kept: a weight in which a bit has turned would go past
the digests of the model's manifest. So each file begins with the digest of the rest, and one that does not fit is not there.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import platform
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from platformdirs import user_cache_path

from core.config.models import SegmentationConfig
from core.files import sweep_unfinished, write_whole
from core.perception.model_file import (
    INFO,
    ONNX,
    ONNX_INT8,
    ModelError,
    check_files,
    model_folder,
    read_model_info,
    second_look_of,
    sha256_of,
)
from core.perception.out_of_distribution import signature_of
from core.perception.segmentation import Probability, Recognised
from core.types import Image

_MOST = 32
"""Some 3 MB each; a start of the window takes five. Those that were not used for longest go."""
_ENDING = ".network"
_DIGEST_BYTES = hashlib.sha256().digest_size


def name_of(*told: object) -> str:
    """What the network is kept under that was compiled from all that is `told`, on this machine."""
    return hashlib.sha256(repr((told, _machine())).encode()).hexdigest()[:32]


def read(name: str) -> bytes | None:
    """The compiled network; None when it is not there, or not as it was written."""
    try:
        path = _folder() / (name + _ENDING)
        data = path.read_bytes()
    except (OSError, RuntimeError):
        return None
    if hashlib.sha256(data[_DIGEST_BYTES:]).digest() != data[:_DIGEST_BYTES]:
        return None
    with contextlib.suppress(OSError):  # one that may only be read is as good
        os.utime(path)
    return data[_DIGEST_BYTES:]


def keep(name: str, compiled: bytes) -> None:
    """Keep it for the next start. Where that cannot be written, the next start compiles again."""
    with contextlib.suppress(OSError, RuntimeError):
        path = _folder() / (name + _ENDING)
        path.parent.mkdir(parents=True, exist_ok=True)
        sweep_unfinished(path.parent)
        write_whole(path, hashlib.sha256(compiled).digest() + compiled)
        others = (other for other in path.parent.glob("*" + _ENDING) if other != path)
        # A file that another process has just removed has no time any more, and ends this: the next one to be kept goes on.
        for old in sorted(others, key=lambda other: other.stat().st_mtime)[: 1 - _MOST]:
            old.unlink()


def _folder() -> Path:
    """Where they are; RuntimeError for a user without a home."""
    return user_cache_path("lumenpilot") / "networks"


@functools.cache
def _machine() -> str:
    """The processor with all that it can: a home may be shared with another one."""
    try:
        told = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").split("\n\n")[0].splitlines()
        return "\n".join(line for line in told if line.startswith(("model name", "flags", "Features")))
    except OSError:
        return f"{platform.machine()} {platform.processor()}"


_Taken = TypeVar("_Taken")
_AT_ONCE = 2
"""Two windows of 160 px in one call take 2.1 instead of 2.8 ms on two cores."""


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


def _alone(probabilities: NDArray[np.float32], image: Image) -> Probability:
    """The robot, which comes last, in the same way."""
    height, width = image.shape[:2]
    return probabilities[-1, :height, :width].copy()


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
    with _interrupts_kept():
        import openvino

    return openvino.Core()


@contextlib.contextmanager
def _interrupts_kept() -> Iterator[None]:
    """Ctrl-C is heard afterwards: in the middle of such an import it is swallowed, or leaves half a module."""
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is None:
        yield
        return
    came: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _frame: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if came:
            signal.raise_signal(signal.SIGINT)


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
        self._robot = _robot_alone(self._model)
        self._requests: dict[tuple[tuple[int, ...], bool], Any] = {}
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

    def robots(self, images: Sequence[Image]) -> list[Probability]:
        """The robot alone in each of the images, one after the other: most often there is but one, and each number is compiled."""
        return [self._infer([image], lambda image, found, _deepest: _alone(found, image), robot_alone=True)[0] for image in images]

    def _infer(
        self,
        images: Sequence[Image],
        take: Callable[[Image, Probability, NDArray[np.float32] | None], _Taken],
        *,
        robot_alone: bool = False,
    ) -> list[_Taken]:
        """What `take` makes of each image (of one size), its probabilities (2, H, W) with padding, and the deepest level.

        `robot_alone`: of the robot's, which comes last, and no deepest level. `take` keeps copies: the next question, maybe another
        thread's, overwrites both.
        """
        taken: list[_Taken] = []
        for first in range(0, len(images), _AT_ONCE):
            some = images[first : first + _AT_ONCE]
            batch = np.stack([padded(image, self.info.stride) for image in some])
            with self._asking:
                request = self._request(batch.shape[:3], robot_alone)
                results = request.infer({0: batch}, share_inputs=True, share_outputs=True)
                deepest = results[1] if self._recognises and not robot_alone else [None] * len(some)
                taken += map(take, some, results[0], deepest)
        return taken

    def _request(self, size: tuple[int, ...], robot_alone: bool) -> Any:
        """To be asked about so many images of this height and width, with `_asking` held."""
        key = size, robot_alone
        if key in self._requests:
            self._requests[key] = self._requests.pop(key)  # last in the row: whoever was asked least recently goes first
        else:
            if len(self._requests) >= self._MAX_SIZES:
                self._requests.pop(next(iter(self._requests)))
            self._requests[key] = self._compiled(size, robot_alone).create_infer_request()
        return self._requests[key]

    def _compiled(self, size: tuple[int, ...], robot_alone: bool) -> Any:
        """The network, or the part of it that shows the robot, for so many images of this size; kept from start to start."""
        import openvino

        # Where a processor can, OpenVINO takes 16 bits for what is said to have 32; the answers are to be the same everywhere.
        options = {
            "PERFORMANCE_HINT": "LATENCY",
            "INFERENCE_NUM_THREADS": self._threads,
            "INFERENCE_PRECISION_HINT": "f32",
        }
        sha256 = self.info.onnx_int8_sha256 if self._int8 else self.info.onnx_sha256
        name = name_of(sha256, _this_file(), openvino.get_version(), options, robot_alone, size)
        if (kept := read(name)) is not None:
            with contextlib.suppress(RuntimeError):  # whole, and yet not to be read: it is compiled again
                return self._core.import_model(kept, "CPU", options)
        model = (self._robot if robot_alone else self._model).clone()
        try:
            model.reshape([*size, self.info.planes])
            compiled = self._core.compile_model(model, "CPU", options)
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[-1]
            raise ModelError(f"{self._file}: is no network of {INFO}'s shape ({reason}); restore the model folder") from None
        with contextlib.suppress(RuntimeError):  # it runs, whether it can be kept or not
            keep(name, compiled.export_model().getvalue())
        return compiled


@functools.cache
def _this_file() -> str:
    """Digest of this source, which says what a network's file is made into before it is compiled."""
    return sha256_of(Path(__file__))


def _robot_alone(model: Any) -> Any:
    """OpenVINO's graph without what only the vessel needs; all of it where it does not end as ``unet.Probabilities`` does."""
    import openvino
    from openvino import opset13

    end = model.outputs[0].get_node().input_value(0).get_node()
    joined = end.input_value(0).get_node() if end.get_type_name() == "Sigmoid" else end
    if end is joined or joined.get_type_name() != "Concat" or joined.get_input_size() != 2:
        return model
    logits = joined.input_value(1)
    shape = logits.get_partial_shape()
    if shape.rank.is_dynamic or len(shape) != 4 or shape[1].to_string() != "1" or joined.get_attributes()["axis"] not in (1, -3):
        return model
    robot = opset13.sigmoid(logits)
    return openvino.Model([robot], model.get_parameters(), "robot")


def _deepest(model: Any) -> Any | None:
    """The output of the encoder's last level, with which both decoders begin, in OpenVINO's graph; None where none is such."""
    inputs = [node.input_value(0) for node in model.get_ordered_ops() if node.get_type_name() == "ConvolutionBackpropData"]
    names = [found.get_node().get_friendly_name() for found in inputs]
    return next((found for found, name in zip(inputs, names, strict=True) if names.count(name) == 2), None)


class TorchSegmenter:
    """The same network in torch: half precision on a CUDA device where there is one, else fp32 on the CPU."""

    def __init__(self, folder: Path, threads: int = 0) -> None:
        import torch

        from core.perception.model_file import load_network
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

    def robots(self, images: Sequence[Image]) -> list[Probability]:
        """The robot alone in each of the images."""
        found = (self._ask(image, self._network.robot) for image in images)
        return [_alone(seen[0].float().cpu().numpy(), image) for image, seen in zip(images, found, strict=True)]

    def _infer(self, image: Image) -> tuple[Any, Any]:
        """Probabilities (2, H, W) with padding, and the deepest level, on the device."""
        probabilities, deepest = self._ask(image, self._network.with_deepest)
        return probabilities[0], deepest[0]

    def _ask(self, image: Image, network: Callable[[Any], Any]) -> Any:
        """What a part of the `network` says of the image with padding, on the device."""
        torch = self._torch
        batch = torch.from_numpy(np.ascontiguousarray(padded(image, self.info.stride)))[None].to(self._device)
        with torch.inference_mode(), torch.autocast("cuda", torch.float16, enabled=self._device.type == "cuda"):
            return network(batch)


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
