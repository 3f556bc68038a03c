"""A model on disk: ``network.onnx``, perhaps ``network_int8.onnx``, and ``model.json`` with their SHA-256.

The network of its tip refinement (``tip_refinement.py``), if it has one, is a model of its own in a folder within.

``network.onnx`` holds the weights by name, so that training begins with them. Folders of format 1 keep them in
``weights.safetensors``. Nothing is loaded before its hash agrees, and nothing is ever unpickled.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import platformdirs
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from core.config.models import RESOURCES
from core.devices import UserError, disk_errors
from core.perception.out_of_distribution import OutOfDistributionReference
from core.perception.quality import ConfidenceCalibration
from core.program import import_problem

if TYPE_CHECKING:
    from core.perception.unet import DualUNet


WEIGHTS, ONNX, ONNX_INT8, INFO = "weights.safetensors", "network.onnx", "network_int8.onnx", "model.json"
SECOND_LOOK = "second_look"
"""The folder within a model that holds the network of its tip refinement, where it has one."""
BENCH = "bench"
"""The folder within a model that holds the bench that it was taught on, where it was."""
ONNX_PREFIX, HALF_SUFFIX = "network.", ".half"
"""Weights of ``network.onnx`` are called as in the torch network, with this prefix; with this suffix where in half precision."""
MODELS = RESOURCES / "models"


class ModelError(UserError):
    """A model cannot be used; the message is one line and says what to do."""


class ModelInfo(BaseModel):
    """What ``model.json`` says. Image height and width must be multiples of ``stride``; ``figures`` are measured.

    Attributes
    ----------
    weights_sha256 : of the weights as safetensors in half precision, whichever file they are in.
    second_look_sha256 : ``weights_sha256`` of its tip refinement; None: it has none, or is older than this entry.
    mirrored_second_looks : how often a picture seen in all orientations was refined for ``calibration_mirrored``, 1 in a manifest
        older than this entry. Perception refines as often: a confidence holds for no other number.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: int = Field(1, ge=1, le=2)
    name: str
    shape: dict[str, Any]
    stride: int = Field(ge=1, le=256)
    image: str = "RGB uint8 (1, H, W, 3), longer side 640, values 0..255"
    output: str = "probabilities float32 (1, 2, H, W): vessel, robot"
    weights_sha256: str = Field(pattern="^[0-9a-f]{64}$")
    onnx_sha256: str = Field(pattern="^[0-9a-f]{64}$")
    onnx_int8_sha256: str | None = Field(None, pattern="^[0-9a-f]{64}$")
    second_look_sha256: str | None = Field(None, pattern="^[0-9a-f]{64}$")
    training: dict[str, Any] = {}
    calibration: ConfidenceCalibration | None = None
    calibration_mirrored: ConfidenceCalibration | None = None
    familiarity: OutOfDistributionReference | None = None
    mirrored_second_looks: int = Field(1, ge=1, le=4)  # tip_refinement.MAX_PASSES, which cannot be imported from here
    figures: dict[str, Any] = {}

    @property
    def planes(self) -> int:
        """Of its input: 3 of a picture, 5 with probabilities."""
        return int(self.shape.get("inputs", 3))

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the files beside ``model.json``."""
        eight_bit = (ONNX_INT8,) if self.onnx_int8_sha256 is not None else ()
        return (WEIGHTS, ONNX, *eight_bit) if self.format == 1 else (ONNX, *eight_bit)

    @model_validator(mode="after")
    def _check_shape(self) -> Self:
        fold, inputs = self.shape.get("fold"), self.shape.get("inputs", 3)
        if type(fold) is not int or self.stride != 16 * fold:
            raise ValueError(f"stride {self.stride} is not 16 times the shape's fold {fold!r}")
        if type(inputs) is not int or inputs not in (3, 5):
            raise ValueError(f"the shape's inputs are 3 or 5, not {inputs!r}")
        widths = self.shape.get("widths")
        deepest = widths[-1] if isinstance(widths, list | tuple) and widths else None
        if self.familiarity is not None and (not isinstance(deepest, int) or self.familiarity.size != 2 * deepest):
            raise ValueError("familiarity is of another network; run calibrate again")
        return self


def sha256_of(path: Path) -> str:
    """SHA-256 of a file as lower-case hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def own_models() -> Path:
    """Where the user's own models are; they are called by their names as the shipped ones are."""
    return Path(platformdirs.user_data_dir("LumenPilot")) / "models"


def model_folder(name: str) -> Path:
    """The folder of a model: the name of a shipped or of the user's own, or a path. Raises ModelError with the known names."""
    for folder in (MODELS / name, own_models() / name, Path(name)):
        with disk_errors(ModelError, folder, "cannot be read"):
            if (folder / INFO).is_file():
                return folder
    known = ", ".join(sorted(found.name for place in (MODELS, own_models()) for found in models_in(place))) or "none"
    raise ModelError(f"no model {name!r} (looked for {INFO} in {MODELS / name} and {Path(name)}); installed models: {known}")


def models_in(place: Path) -> list[Path]:
    """Folders of models, by name; without those that are being made."""
    return sorted(path.parent for path in place.glob(f"*/{INFO}") if not path.parent.name.startswith("."))


def read_model_info(folder: Path, *, verify: Sequence[str] | None = None) -> ModelInfo:
    """Read ``model.json`` and check the files named in `verify`, by default all but the eight-bit copy; raises ModelError."""
    path = folder / INFO
    try:
        info = ModelInfo.model_validate_json(path.read_bytes())
    except OSError as error:
        raise ModelError(f"{path}: cannot be read ({error.strerror}); restore the model folder") from None
    except ValidationError as error:
        first: Any = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        reason = first["msg"].removeprefix("Value error, ")
        raise ModelError(f"{path}: damaged ({key + ': ' if key else ''}{reason}); restore the model folder") from None
    check_files(info, folder, [name for name in info.files if name != ONNX_INT8] if verify is None else verify)
    return info


def check_files(info: ModelInfo, folder: Path, names: Sequence[str]) -> None:
    """Raise ModelError when one of the named files is missing, damaged, or not part of the model."""
    wanted = {WEIGHTS: info.weights_sha256, ONNX: info.onnx_sha256, ONNX_INT8: info.onnx_int8_sha256}
    for name in names:
        file = folder / name
        if wanted[name] is None:
            raise ModelError(f"{folder / INFO}: the model has no {name}; choose precision fp32, or train it again")
        with disk_errors(ModelError, file, "cannot be read", "; restore the model folder"):
            found = sha256_of(file)
        if found != wanted[name]:
            raise ModelError(f"{file}: SHA-256 differs from {INFO}: the file is cut or damaged; restore the model folder")


def second_look_of(folder: Path) -> Path | None:
    """The folder of a model's tip refinement, None when it has none; ModelError when it is gone or of another model."""
    expected = read_model_info(folder, verify=()).second_look_sha256
    near = folder / SECOND_LOOK
    if not (near / INFO).is_file():
        if expected is not None:
            raise ModelError(f"{near / INFO}: missing, and the model does not see well without; restore the model folder")
        return None
    if expected is not None and read_model_info(near, verify=()).weights_sha256 != expected:
        raise ModelError(f"{near}: is of another model than {folder / INFO} says; restore the model folder")
    return near


def check_model(name: str) -> None:
    """Raise ModelError when the model of this name is gone or damaged, before anything begins that needs it."""
    folder = model_folder(name)
    check_all_files(folder)
    if (near := second_look_of(folder)) is not None:
        check_all_files(near)


def check_all_files(folder: Path) -> list[str]:
    """The names of the files of one network, all of them whole. Raises ModelError."""
    info = read_model_info(folder, verify=())
    check_files(info, folder, info.files)
    return [INFO, *info.files]


def load_network(folder: Path) -> tuple[DualUNet, ModelInfo]:
    """The torch network in evaluation mode with its weights; raises ModelError."""
    from safetensors import SafetensorError
    from safetensors.torch import load

    from core.perception.unet import DualUNet, UNetShape

    info = read_model_info(folder, verify=())
    name = WEIGHTS if info.format == 1 else ONNX
    check_files(info, folder, (name,))
    try:
        network = DualUNet(UNetShape.from_json(info.shape))
        data = (folder / name).read_bytes()
        state = load(data) if info.format == 1 else _state_of_onnx(data)
        missing, unexpected = network.load_state_dict(state, strict=False)
        # ONNX leaves out how many batches the normalisation has seen, which nothing uses.
        wrong = [*unexpected, *(key for key in missing if not key.endswith("num_batches_tracked"))]
        if wrong:
            raise ValueError(f"weights {wrong[0]}")
    except (KeyError, TypeError, ValueError, RuntimeError, SafetensorError) as error:
        reason = str(error).splitlines()[0]
        raise ModelError(f"{folder / name}: does not fit the shape in {INFO} ({reason}); restore the model folder") from None
    return network.eval(), info


def _state_of_onnx(data: bytes) -> dict[str, Any]:
    """The initializers of an ONNX file as tensors, under their names in the torch network; raises ModelError, ValueError."""
    import torch

    try:
        import onnx
        from google.protobuf.message import DecodeError  # type: ignore[import-untyped]
        from onnx import numpy_helper
    except ImportError as error:
        raise ModelError(
            import_problem(error)
            or f"networks are read with the package onnx, which does not load ({error}): make clean && make setup"
        ) from None
    try:
        graph = onnx.load_model_from_string(data).graph
    except DecodeError as error:
        raise ValueError(str(error)) from None
    state = {}
    for one in graph.initializer:
        name = one.name.removeprefix(ONNX_PREFIX).removesuffix(HALF_SUFFIX)
        state[name] = torch.from_numpy(numpy_helper.to_array(one).copy()).float()
    return state
