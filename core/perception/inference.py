"""The engines that run a model's networks: OpenVINO on the CPU, torch where there is a CUDA device."""

from __future__ import annotations

import contextlib
import functools
import os
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
from core.perception.model_file import INFO, ONNX, ONNX_INT8, ModelError, check_files, model_folder, read_model_info, second_look_of
from core.perception.out_of_distribution import signature_of
from core.perception.segmentation import Probability, Segmentation, Segmenter
from core.program import import_problem
from core.types import Image

_Result = TypeVar("_Result")
_BATCH = 2
"""Images per call: two windows of 160 px in one call take 2.1 instead of 2.8 ms on two cores."""


def padded(image: Image, stride: int) -> Image:
    """Right and bottom filled up to multiples of `stride`; mirrored, because an edge of constant colour would look like a wall."""
    height, width = image.shape[:2]
    down, right = -height % stride, -width % stride
    if not down and not right:
        return image
    border = cv2.BORDER_REFLECT_101 if min(height, width) > stride else cv2.BORDER_REPLICATE
    return np.asarray(cv2.copyMakeBorder(image, 0, down, 0, right, border), np.uint8)


def _cropped(probability: Probability, image: Image) -> Probability:
    """A copy without the padding: the next call overwrites the engine's output."""
    return probability[: image.shape[0], : image.shape[1]].copy()


def _segmentation(image: Image, probabilities: Probability, deepest: NDArray[np.float32] | None) -> Segmentation:
    """Vessel and robot of the padded `probabilities` (2, H, W), and the signature."""
    signature = signature_of(deepest, probabilities[0]) if deepest is not None else None
    return _cropped(probabilities[0], image), _cropped(probabilities[1], image), signature


_core_lock = threading.Lock()
_PROCESSOR = (Path("/proc/cpuinfo"), Path("/sys/devices/system/cpu"))
"""Where Linux tells the processor's cores: OpenVINO's threads wait forever for a network where both are missing."""


@functools.cache
def _openvino_core() -> Any:
    """The one OpenVINO core of this process, never released; call with `_core_lock` held.

    Each core gives its thread a stack for signals (sigaltstack). Where two cores end in the order in which they began, the second
    restores the stack of the first, which is unmapped by then: the next signal that Python handles (Ctrl-C, SIGTERM, the end of a
    loader's process) kills this process with a memory fault.
    """
    # Importing openvino reports itself over the network; with its telemetry package blocked it takes a silent stub instead.
    sys.modules["openvino_telemetry"] = None  # type: ignore[assignment]
    with _interrupts_deferred():
        import openvino

    core = openvino.Core()
    # OpenVINO keeps compiled networks here: compiling takes three times as long as reading one. A folder that cannot be written,
    # and a file that was cut off, make it compile again.
    with contextlib.suppress(RuntimeError):  # a user without a home
        core.set_property({"CACHE_DIR": str(user_cache_path("lumenpilot") / "openvino")})
    return core


@contextlib.contextmanager
def _interrupts_deferred() -> Iterator[None]:
    """Ctrl-C takes effect afterwards: in the middle of such an import it is swallowed, or leaves half a module."""
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is None:
        yield
        return
    received: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _frame: received.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if received:
            signal.raise_signal(signal.SIGINT)


class OpenVinoSegmenter(Segmenter):
    """The ONNX network on the CPU through OpenVINO, in int8 where the model has it; compiled once per image size and number.

    Several threads may call it (the live view's, and one that examines a still again). They take turns, batch by batch.
    """

    _MAX_SIZES = 16

    def __init__(self, folder: Path, threads: int = 0, precision: str = "auto") -> None:
        self.info = read_model_info(folder, verify=())
        self.is_eight_bit = precision == "int8" or (precision == "auto" and self.info.onnx_int8_sha256 is not None)
        name = ONNX_INT8 if self.is_eight_bit else ONNX
        check_files(self.info, folder, (name,))
        if sys.platform == "linux" and not any(path.exists() for path in _PROCESSOR):
            raise ModelError("neither /proc nor /sys is there, which OpenVINO needs: mount -t proc proc /proc (in a chroot)")
        with _core_lock:
            self._core = _openvino_core()
        self._threads = threads or cores()
        try:
            self._model = self._core.read_model(folder / name)
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[-1]
            raise ModelError(f"{folder / name}: cannot be read ({reason}); restore the model folder") from None
        self._file = folder / name
        # Windows of the tip refinement are parts of pictures and have no signature.
        deepest = _deepest_output(self._model) if self.info.planes == 3 else None
        self._has_signature = deepest is not None
        if deepest is not None:
            self._model.add_outputs(deepest)
        self._robot_model = _without_vessel(self._model)
        self._requests: dict[tuple[tuple[int, ...], bool], Any] = {}
        self._lock = threading.Lock()

    @property
    def engine(self) -> str:
        return f"OpenVINO CPU {'int8' if self.is_eight_bit else 'fp32'}"

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        return self.segment_batch([image])[0]

    def segment_batch(self, images: Sequence[Image]) -> list[tuple[Probability, Probability]]:
        return self._infer(images, lambda image, found, _deepest: _segmentation(image, found, None)[:2])

    def segment_signed(self, images: Sequence[Image]) -> list[Segmentation]:
        return self._infer(images, _segmentation)

    def segment_robots(self, images: Sequence[Image]) -> list[Probability]:
        """One after the other: most often there is only one image, and each batch size must be compiled."""
        return [self._infer([one], lambda image, found, _: _cropped(found[-1], image), robot_alone=True)[0] for one in images]

    def _infer(
        self,
        images: Sequence[Image],
        convert: Callable[[Image, Probability, NDArray[np.float32] | None], _Result],
        *,
        robot_alone: bool = False,
    ) -> list[_Result]:
        """What `convert` makes of each image, its padded probabilities (2, H, W; `robot_alone`: 1, H, W), and the deepest level.

        `convert` copies what it keeps: the next call, perhaps from another thread, overwrites both arrays.
        """
        results: list[_Result] = []
        for first in range(0, len(images), _BATCH):
            some = images[first : first + _BATCH]
            batch = np.stack([padded(image, self.info.stride) for image in some])
            with self._lock:
                outputs = self._request(batch.shape[:3], robot_alone).infer({0: batch}, share_inputs=True, share_outputs=True)
                deepest = outputs[1] if self._has_signature and not robot_alone else [None] * len(some)
                results += map(convert, some, outputs[0], deepest)
        return results

    def _request(self, size: tuple[int, ...], robot_alone: bool) -> Any:
        """The inference request for this number of images, height and width; call with `_lock` held."""
        key = size, robot_alone
        if key in self._requests:
            self._requests[key] = self._requests.pop(key)  # to the end: the least recently used one goes first
        else:
            if len(self._requests) >= self._MAX_SIZES:
                self._requests.pop(next(iter(self._requests)))
            self._requests[key] = self._compile(size, robot_alone).create_infer_request()
        return self._requests[key]

    def _compile(self, size: tuple[int, ...], robot_alone: bool) -> Any:
        # Where a processor can, OpenVINO computes fp32 networks with 16 bits; the answers are to be the same everywhere.
        options = {"PERFORMANCE_HINT": "LATENCY", "INFERENCE_NUM_THREADS": self._threads, "INFERENCE_PRECISION_HINT": "f32"}
        model = (self._robot_model if robot_alone else self._model).clone()
        try:
            model.reshape([*size, self.info.planes])
            return self._core.compile_model(model, "CPU", options)
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[-1]
            raise ModelError(f"{self._file}: is no network of {INFO}'s shape ({reason}); restore the model folder") from None


def _without_vessel(model: Any) -> Any:
    """OpenVINO's graph without the vessel's decoder; the whole graph where it does not end as ``unet.Probabilities`` does."""
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
    return openvino.Model([opset13.sigmoid(logits)], model.get_parameters(), "robot")


def _deepest_output(model: Any) -> Any | None:
    """The output of the encoder's last level, with which both decoders begin, in OpenVINO's graph; None where there is no such."""
    inputs = [node.input_value(0) for node in model.get_ordered_ops() if node.get_type_name() == "ConvolutionBackpropData"]
    names = [found.get_node().get_friendly_name() for found in inputs]
    return next((found for found, name in zip(inputs, names, strict=True) if names.count(name) == 2), None)


class TorchSegmenter(Segmenter):
    """The same network in torch: half precision on a CUDA device where there is one, else fp32 on the CPU."""

    def __init__(self, folder: Path, threads: int = 0) -> None:
        try:
            import torch
        except ModuleNotFoundError as error:
            raise ModelError(import_problem(error) or str(error)) from None

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
        return _segmentation(image, self._run(image, self._network)[0], None)[:2]

    def segment_signed(self, images: Sequence[Image]) -> list[Segmentation]:
        return [_segmentation(image, *self._run(image, self._network.with_deepest)) for image in images]

    def segment_robots(self, images: Sequence[Image]) -> list[Probability]:
        return [_cropped(self._run(image, self._network.robot)[0][0], image) for image in images]

    def _run(self, image: Image, network: Callable[[Any], Any]) -> list[NDArray[np.float32]]:
        """The outputs of a part of the network for one padded image, without the batch axis."""
        torch = self._torch
        batch = torch.from_numpy(np.ascontiguousarray(padded(image, self.info.stride)))[None].to(self._device)
        with torch.inference_mode(), torch.autocast("cuda", torch.float16, enabled=self._device.type == "cuda"):
            outputs = network(batch)
        return [one[0].float().cpu().numpy() for one in (outputs if isinstance(outputs, tuple) else (outputs,))]


def cuda_present() -> bool:
    """Whether torch can use a CUDA device. The kernel is asked first, because importing torch to ask costs seconds."""
    if not Path("/proc/driver/nvidia/version").exists() and not Path("/dev/nvidia0").exists():
        return False
    try:
        import torch
    except ModuleNotFoundError:  # an extra
        return False
    return torch.cuda.is_available()


def cores() -> int:
    """Cores that this process may use; in a container fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def open_segmenter(config: SegmentationConfig) -> OpenVinoSegmenter | TorchSegmenter:
    """Load the configured model into the configured engine ("auto": torch where a CUDA device is present, else OpenVINO).

    Raises ModelError for a missing, cut or damaged model; the message says what to do.
    """
    return _open(model_folder(config.model), config)


def open_second_look(config: SegmentationConfig) -> OpenVinoSegmenter | TorchSegmenter | None:
    """The network of the configured model's tip refinement, which takes ``tip_refinement.Planes``; None: no such, or turned off.

    Raises ModelError, as ``open_segmenter`` does, and when the model has lost that network.
    """
    folder = second_look_of(model_folder(config.model)) if config.second_look else None
    return _open(folder, config, planes=5) if folder is not None else None


def _open(folder: Path, config: SegmentationConfig, planes: int = 3) -> OpenVinoSegmenter | TorchSegmenter:
    if (found := read_model_info(folder, verify=()).planes) != planes:
        raise ModelError(f"{folder / INFO}: the network takes {found} planes, not {planes}; restore the model folder")
    if config.device == "torch" or (config.device == "auto" and cuda_present()):
        return TorchSegmenter(folder, config.threads)
    return OpenVinoSegmenter(folder, config.threads, config.precision)
