"""Writing a model folder, whole or not at all: what was there before stays until the new one is complete.

Weights of convolutions are kept in half precision: half the bytes on disk, and no visible difference. They are rounded before
anything is written, so that all files of a model hold the same network. ``model_file`` reads and checks what is written here.
"""

from __future__ import annotations

import hashlib
import math
import os
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from copy import deepcopy
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from core.bench.bench import PHANTOM_FILE, read_bench, was_moved
from core.config.models import SegmentationConfig
from core.devices import disk_errors
from core.files import replace_folder, sync_folder
from core.perception.inference import open_second_look, open_segmenter
from core.perception.model_file import (
    BENCH,
    HALF_SUFFIX,
    INFO,
    ONNX,
    ONNX_INT8,
    SECOND_LOOK,
    WEIGHTS,
    ModelError,
    ModelInfo,
    check_model,
    load_network,
    model_folder,
    read_model_info,
    second_look_of,
    sha256_of,
)
from core.perception.out_of_distribution import OutOfDistributionReference
from core.perception.quality import ConfidenceCalibration
from core.perception.segmentation import Probability, Segmenter
from core.perception.tip_refinement import Planes, refine_tips
from core.types import Image

if TYPE_CHECKING:
    from core.learning.quantization import EightBitUNet
    from core.perception.unet import DualUNet

_INFO_SCRATCH = f".{INFO}.new"
_PLANES = {"image": "RGB and the first look's vessel and robot, uint8 (1, H, W, 5), working pixels, values 0..255"}
_MOST_WINDOWS = 160
"""More of them say no more about the ranges of a tip refinement."""


def rounded(network: DualUNet) -> DualUNet:
    """A copy whose convolutions' weights are such as half precision can hold; biases and normalisations stay as they are."""
    copy = deepcopy(network)
    for parameter in copy.parameters():
        if parameter.dim() > 1:
            parameter.data = parameter.data.half().float()
    return copy


def weights_sha256(network: DualUNet) -> str:
    """Digest of the weights as safetensors, the convolutions' in half precision, as files of format 1 have them."""
    from safetensors.torch import save

    state = {
        name: (tensor.half() if tensor.is_floating_point() and tensor.dim() > 1 else tensor).cpu().contiguous()
        for name, tensor in network.state_dict().items()
    }
    return hashlib.sha256(save(state)).hexdigest()


def export_onnx(network: DualUNet | EightBitUNet, stride: int, path: Path) -> None:
    """Export with free height and width (multiples of `stride`); pre- and post-processing are inside the graph.

    Weights keep their names, so that training can begin with them: the normalisations are not folded into the convolutions.
    """
    import torch

    from core.perception.unet import Probabilities

    example = torch.zeros(1, stride * 2, stride * 2, network.shape.inputs, dtype=torch.uint8)
    was_training = network.training
    with warnings.catch_warnings():
        # The tracing exporter is the one that needs no further packages; its deprecation is noise to the user.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            Probabilities(network.eval()),
            (example,),
            str(path),
            input_names=["image"],
            output_names=["probabilities"],
            dynamic_axes={"image": {1: "height", 2: "width"}, "probabilities": {2: "height", 3: "width"}},
            opset_version=17,
            dynamo=False,
            training=torch.onnx.TrainingMode.PRESERVE,
        )
    network.train(was_training)
    pack_weights(path)


def pack_weights(path: Path) -> None:
    """Store the weights of an ONNX file in few bytes, and what makes float32 of them first.

    Those that are rounded to eight bits in the graph are stored so, as whole numbers of steps, the others in half precision.
    """
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    model = onnx.load(str(path))
    graph = model.graph
    initializers = {one.name: one for one in graph.initializer}
    quantizers = {node.input[0]: node for node in graph.node if node.op_type == "QuantizeLinear"}
    before: list[onnx.NodeProto] = []
    for name, weight in initializers.items():
        if weight.data_type != TensorProto.FLOAT or len(weight.dims) < 2:
            continue
        values = numpy_helper.to_array(weight)
        graph.initializer.remove(weight)
        if (node := quantizers.get(name)) is None:
            graph.initializer.append(numpy_helper.from_array(values.astype(np.float16), name + HALF_SUFFIX))
            before.append(helper.make_node("Cast", [name + HALF_SUFFIX], [name], to=TensorProto.FLOAT))
            continue
        axis = next(attribute.i for attribute in node.attribute if attribute.name == "axis")
        step = numpy_helper.to_array(initializers[node.input[1]]).reshape([-1 if k == axis else 1 for k in range(values.ndim)])
        whole = np.clip(np.rint(values / step), -128, 127).astype(np.int8)
        graph.initializer.extend([numpy_helper.from_array(whole, f"{name}.int8"), numpy_helper.from_array(step, f"{name}.step")])
        # Multiplied and quantised again by the graph: with DequantizeLinear alone OpenVINO rounds otherwise.
        before.append(helper.make_node("Cast", [f"{name}.int8"], [f"{name}.whole"], to=TensorProto.FLOAT))
        before.append(helper.make_node("Mul", [f"{name}.whole", f"{name}.step"], [name]))
    for place, made in enumerate(before):
        graph.node.insert(place, made)
    onnx.save(model, str(path))


def whole_strides(images: Sequence[Image], stride: int) -> list[Image]:
    """The pictures cropped to whole strides: padding would teach ranges edges that no camera shows. Smaller ones are left out."""
    cuts = (image[: image.shape[0] // stride * stride, : image.shape[1] // stride * stride] for image in images)
    return [cut for cut in cuts if cut.size]


def export_eight_bit(network: DualUNet, examples: Sequence[Image], path: Path) -> None:
    """Export a copy that learns its ranges and rounding from the `examples`, which are ``whole_strides`` of pictures."""
    import torch

    from core.learning.quantization import EightBitUNet

    eight_bit = EightBitUNet(network.eval()).eval()
    eight_bit.learn(torch.from_numpy(image.transpose(2, 0, 1)[None].copy()).float() / 255 for image in examples)
    export_onnx(eight_bit, network.shape.stride, path)


def save_model(
    network: DualUNet,
    folder: Path,
    *,
    training: dict[str, Any],
    figures: dict[str, Any],
    examples: Sequence[Image] = (),
    second_look: Path | None = None,
) -> ModelInfo:
    """Write ONNX and manifest. The folder appears whole or not at all; an older model of that name is replaced last.

    Raises ModelError: the folder is something else than a model, or cannot be written.

    Parameters
    ----------
    examples : typical RGB images at working size, or all planes of the input, from which an eight-bit copy learns ranges and
        rounding; none: there is no copy.
    second_look : folder of a tip refinement's network that is copied into the new one.
    """
    with _put_in_place(folder) as scratch:
        network = rounded(network)
        export_onnx(network, network.shape.stride, scratch / ONNX)
        cuts = whole_strides(examples, network.shape.stride)
        if cuts:
            export_eight_bit(network, cuts, scratch / ONNX_INT8)
        info = ModelInfo(
            format=2,
            name=folder.resolve().name,
            shape=network.shape.to_json(),
            stride=network.shape.stride,
            weights_sha256=weights_sha256(network),
            onnx_sha256=sha256_of(scratch / ONNX),
            onnx_int8_sha256=sha256_of(scratch / ONNX_INT8) if cuts else None,
            second_look_sha256=read_model_info(second_look, verify=()).weights_sha256 if second_look is not None else None,
            training=training,
            figures=figures,
            **_PLANES if network.shape.inputs == 5 else {},
        )
        (scratch / INFO).write_text(info.model_dump_json(indent=1) + "\n", encoding="utf-8")
        if second_look is not None:
            (scratch / SECOND_LOOK).mkdir()
            _copy(second_look, scratch / SECOND_LOOK)
    return info


def save_with_second_look(base: Path, network: DualUNet, folder: Path, **kwargs: Any) -> None:
    """Write `folder`: the model in `base` with `network` for its tip refinement. The rest of the arguments are ``save_model``'s.

    Figures and calibrations of `base` do not hold for the new model and are left out; Dice on held-out frames and the kinds of
    pictures that it knows are its own network's alone, and stay.
    """
    with _put_in_place(folder) as scratch:
        _copy(base, scratch)
        near = save_model(network, scratch / SECOND_LOOK, **kwargs)
        figures = read_model_info(scratch, verify=()).figures
        changes = {"figures": figures if figures.get("held_out") else {}, "calibration": None, "calibration_mirrored": None}
        _update(scratch, {"name": folder.resolve().name, "second_look_sha256": near.weights_sha256} | changes)


def install_model(made: Path, folder: Path, bench: Path | None = None) -> None:
    """Copy a finished model to its place, with the folder of its bench in it; an older model of that name is replaced last.

    Raises ModelError: the model is damaged, the folder is something else than a model, or cannot be written.
    """
    info = read_model_info(made)
    near = second_look_of(made)
    with _put_in_place(folder) as scratch:
        _copy(made, scratch)
        _update(scratch, {"name": folder.resolve().name, "figures": info.figures})
        if near is not None:
            (scratch / SECOND_LOOK).mkdir()
            _copy(near, scratch / SECOND_LOOK)
        if bench is not None:
            shutil.copytree(bench, scratch / BENCH)
            phantom = folder / BENCH / PHANTOM_FILE
            if phantom.is_file() and not (bench / PHANTOM_FILE).exists() and not was_moved(read_bench(bench), phantom.parent):
                shutil.copy2(phantom, scratch / BENCH)  # made again where there is a scale (hardware/twin/own_phantom.py)


@contextmanager
def changed(folder: Path) -> Iterator[Path]:
    """A copy of a model to work on, which takes its place in the end; whatever goes wrong leaves the model as it was.

    Raises ModelError: the model is damaged, or cannot be written.
    """
    read_model_info(folder)
    if (near := second_look_of(folder)) is not None:
        read_model_info(near)
    with _put_in_place(folder) as scratch:
        _copy(folder, scratch)
        if near is not None:
            (scratch / SECOND_LOOK).mkdir()
            _copy(near, scratch / SECOND_LOOK)
        yield scratch


@contextmanager
def _put_in_place(folder: Path) -> Iterator[Path]:
    """An empty folder that takes the model's place in the end; whatever goes wrong leaves that as it was. Raises ModelError."""
    check_can_write(folder)
    folder = folder.resolve()
    scratch = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        yield scratch
        scratch.chmod(0o755)
        # The older model is deleted for this one, which has to survive a power cut a moment later.
        for path in (*scratch.rglob("*"), scratch):
            if path.is_dir():
                with suppress(OSError):  # some file systems cannot
                    sync_folder(path)
            else:
                with path.open("rb") as file:
                    os.fsync(file.fileno())
        _replace(folder, scratch)
    except OSError as error:
        places = [Path(os.fsdecode(name)) for name in (error.filename, error.filename2) if name is not None]
        if places and not any(place in (scratch, folder) or scratch in place.parents for place in places):
            raise  # a file that is read is at fault
        reason = error.strerror or str(error)
        raise ModelError(f"{folder}: cannot be written ({reason}); make room, or choose another folder") from None
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _replace(folder: Path, scratch: Path) -> None:
    """Move a whole model to its place; where that fails, the one that was there before is there again.

    Other files in the old one's folder, notes or frames, are moved into the new one's.
    """
    if (aside := replace_folder(scratch, folder)) is not None:
        _carry_over(aside, folder)
        shutil.rmtree(aside, ignore_errors=True)


def _carry_over(old: Path, new: Path) -> None:
    """Move what is not the model's own to its new folder; raises ModelError for what cannot be moved and stays where it is."""
    with disk_errors(ModelError, old, "holds what lay in the older model's folder and cannot be moved"):
        for entry in list(old.iterdir()):
            if entry.name == SECOND_LOOK and entry.is_dir() and not entry.is_symlink():
                _carry_over(entry, new / SECOND_LOOK)
            elif entry.name == BENCH and (new / BENCH).exists():
                continue  # of the older model, taught before
            elif entry.name not in (WEIGHTS, ONNX, ONNX_INT8, INFO, _INFO_SCRATCH):
                new.mkdir(exist_ok=True)
                os.replace(entry, new / entry.name)


def _copy(folder: Path, to: Path) -> None:
    """Copy a model's own files, but not their modes: a read-only model may be worked on elsewhere."""
    for name in (WEIGHTS, ONNX, ONNX_INT8, INFO):
        if (folder / name).is_file():
            shutil.copyfile(folder / name, to / name)


def check_can_write(folder: Path) -> None:
    """Raise ModelError when `folder` is anything but a model, an empty folder, or not there: nothing else is ever replaced."""
    try:
        folder = Path(os.path.realpath(folder))  # Path.resolve raises something else on links in a loop
        if folder.is_symlink():
            raise ModelError(f"{folder}: is a link that leads nowhere but to itself; choose another folder")
        if folder.exists() and not (folder / INFO).is_file() and (not folder.is_dir() or any(folder.iterdir())):
            raise ModelError(f"{folder}: exists and is not a model; choose another folder")
        folder.parent.mkdir(parents=True, exist_ok=True)
        if not os.access(folder.parent, os.W_OK):
            raise ModelError(f"{folder.parent}: cannot be written; choose another folder")
    except OSError as error:
        raise ModelError(f"{folder}: cannot be written ({error.strerror}); choose another folder") from None


def check_can_change(name: str) -> None:
    """Raise ModelError when the manifest of the model of this name could not be rewritten after long work: damaged, or not ours."""
    check_model(name)
    folder = model_folder(name)
    if not os.access(folder, os.W_OK):
        raise ModelError(f"{folder}: cannot be written; copy the model to a folder of yours, and give that as --model")


def check_outside(out: Path, models: Sequence[Path]) -> None:
    """Raise ModelError when `out` lies within one of these models, which are read for it."""
    place = Path(os.path.realpath(out))
    if any(Path(os.path.realpath(folder)) in place.parents for folder in models):
        raise ModelError(f"{place}: lies within a model that is read for it; choose another --out")


def write_figures(folder: Path, figures: dict[str, Any]) -> None:
    """Store measured figures in the manifest of a model, atomically."""
    _update(folder, {"figures": figures})


def write_calibration(
    folder: Path,
    calibration: ConfidenceCalibration,
    mirrored: ConfidenceCalibration | None = None,
    *,
    second_looks: int = 1,
    familiarity: OutOfDistributionReference | None = None,
) -> None:
    """Store a calibration of the confidence in the manifest of a model, atomically; figures measured before are dropped.

    `mirrored` is for masks averaged over all orientations of a picture, refined `second_looks` times; None: the same.
    `familiarity`, the kinds of pictures that the model knows, None: not known.
    """
    changes: dict[str, Any] = {
        "calibration": calibration,
        "calibration_mirrored": mirrored,
        "mirrored_second_looks": second_looks,
        "familiarity": familiarity,
        "figures": {},
    }
    _update(folder, changes)


def _update(folder: Path, changes: dict[str, Any]) -> None:
    info = read_model_info(folder).model_copy(update=changes)
    scratch = folder / _INFO_SCRATCH
    with disk_errors(ModelError, folder / INFO, "cannot be written", "; copy the model to a folder of your own"):
        with scratch.open("wb") as file:
            file.write(info.model_dump_json(indent=1).encode() + b"\n")
            file.flush()
            os.fsync(file.fileno())  # or a power cut would leave an empty manifest, and with it no model
        os.replace(scratch, folder / INFO)


def write_eight_bit(folder: Path, examples: Sequence[Image]) -> None:
    """Replace the eight-bit copy of a model's network by one made from `examples`; figures measured before are dropped.

    Raises ModelError: the model is damaged, or there is no picture of the network's stride or more among the examples.
    """
    network = load_network(folder)[0]
    cuts = whole_strides(examples, network.shape.stride)
    if not cuts:
        raise ModelError("nothing to make an eight-bit copy from; give pictures that can be read and show a robot")
    export_eight_bit(network, cuts, folder / ONNX_INT8)
    _update(folder, {"onnx_int8_sha256": sha256_of(folder / ONNX_INT8), "figures": {}})


class _RecordingSegmenter(Segmenter):
    """A tip refinement's network that keeps its inputs."""

    def __init__(self, near: Segmenter) -> None:
        self._near = near
        self.inputs: list[Planes] = []

    @property
    def engine(self) -> str:
        return self._near.engine

    def __call__(self, image: Planes) -> tuple[Probability, Probability]:
        self.inputs.append(image)
        return self._near(image)


def renew_eight_bit(folder: Path, images: Sequence[Image], on_progress: Callable[[float], None] = lambda share: None) -> None:
    """Replace the eight-bit copies of a model by ones made from what its networks see of RGB `images` at working size.

    Its calibration does not hold any more. `on_progress` is given the share that is done, 0..1.

    Raises ModelError: the model is damaged, or sees nothing of a robot in these pictures.
    """
    # In fp32: the copies that are there may be damaged, or the reason for new ones.
    config = SegmentationConfig(model=str(folder), precision="fp32")
    near, where = open_second_look(config), second_look_of(folder)
    inputs: list[Planes] = []
    if near is not None:
        first, recording = open_segmenter(config), _RecordingSegmenter(near)
        for done, image in enumerate(images):
            refine_tips(image, first(image), recording)
            on_progress(0.2 * done / len(images))
        inputs = recording.inputs[:: max(1, math.ceil(len(recording.inputs) / _MOST_WINDOWS))]
    write_eight_bit(folder, images)
    on_progress(0.6)
    if where is not None:
        write_eight_bit(where, inputs)
    on_progress(1.0)
