"""A model on disk: ``weights.safetensors``, ``network.onnx``, perhaps ``network_int8.onnx``, and ``model.json`` with their SHA-256.

The network of its tip refinement (``core/perception/tip_refinement.py``), if it has one, is a model of its own in a folder within.

Nothing is loaded before its hash agrees, and nothing is ever unpickled: a cut, bit-flipped or foreign file is one clear error.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import platformdirs
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from core.config.models import RESOURCES
from core.devices import UserError
from core.perception.out_of_distribution import OutOfDistributionReference
from core.perception.quality import ConfidenceCalibration

if TYPE_CHECKING:
    from core.perception.unet import DualUNet


WEIGHTS, ONNX, ONNX_INT8, INFO = "weights.safetensors", "network.onnx", "network_int8.onnx", "model.json"
SECOND_LOOK = "second_look"
"""The folder within a model that holds the network of its second look, where it has one."""
MODELS = RESOURCES / "models"


class ModelError(UserError):
    """A model cannot be used; the message is one line and says what to do."""


class ModelInfo(BaseModel):
    """What ``model.json`` says. Image height and width must be multiples of ``stride``; ``figures`` are measured.

    ``second_look_sha256`` is of the weights of its second look; None: it has none, or is older than this entry.
    ``mirrored_second_looks`` is how often a picture seen in all orientations was looked at closely for ``calibration_mirrored``, 1
    in a manifest older than this entry. Perception looks as often: a confidence is true of no other way of looking.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: int = Field(1, ge=1, le=1)
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
        """Of its input: 3 of a picture, 5 with a first look's probabilities."""
        return int(self.shape.get("inputs", 3))

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
        try:
            if (folder / INFO).is_file():
                return folder
        except OSError as error:
            raise ModelError(f"{folder}: cannot be read ({error.strerror})") from None
    known = ", ".join(sorted(found.name for place in (MODELS, own_models()) for found in models_in(place))) or "none"
    raise ModelError(f"no model {name!r} (looked for {INFO} in {MODELS / name} and {Path(name)}); installed models: {known}")


def models_in(place: Path) -> list[Path]:
    """Folders of models, by name; those that are being made (``_put_in_place``) are none yet."""
    return sorted(path.parent for path in place.glob(f"*/{INFO}") if not path.parent.name.startswith("."))


def read_model_info(folder: Path, *, verify: tuple[str, ...] = (WEIGHTS, ONNX)) -> ModelInfo:
    """Read ``model.json`` and check the hashes of the files named in `verify`; raises ModelError."""
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
    check_files(info, folder, verify)
    return info


def check_files(info: ModelInfo, folder: Path, names: Sequence[str]) -> None:
    """Raise ModelError when one of the named files is missing, damaged, or not part of the model."""
    wanted = {WEIGHTS: info.weights_sha256, ONNX: info.onnx_sha256, ONNX_INT8: info.onnx_int8_sha256}
    for name in names:
        file = folder / name
        if wanted[name] is None:
            raise ModelError(f"{folder / INFO}: the model has no {name}; choose precision fp32, or train it again")
        try:
            found = sha256_of(file)
        except OSError as error:
            raise ModelError(f"{file}: cannot be read ({error.strerror}); restore the model folder") from None
        if found != wanted[name]:
            raise ModelError(f"{file}: SHA-256 differs from {INFO}: the file is cut or damaged; restore the model folder")


def trained_without(folder: Path) -> tuple[str, ...]:
    """The families of looks that none of its networks was trained with, as their ``model.json`` say. Raises ModelError."""
    networks = [folder, *([near] if (near := second_look_of(folder)) is not None else [])]
    told = [read_model_info(one, verify=()).training.get("without") for one in networks]
    left_out = [[str(look) for look in looks] if isinstance(looks, list) else [] for looks in told]
    return tuple(look for look in left_out[0] if all(look in others for others in left_out))


def second_look_of(folder: Path) -> Path | None:
    """The folder of a model's second look, None when it has none; ModelError when it is gone or not the one it belongs to."""
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
    """The files of one network, all of them whole. Raises ModelError."""
    info = read_model_info(folder, verify=())
    files = [WEIGHTS, ONNX, *([ONNX_INT8] if info.onnx_int8_sha256 is not None else [])]
    check_files(info, folder, files)
    return [INFO, *files]


def load_network(folder: Path) -> tuple[DualUNet, ModelInfo]:
    """The torch network in evaluation mode with its weights; raises ModelError."""
    from safetensors import SafetensorError
    from safetensors.torch import load

    from core.perception.unet import DualUNet, UNetShape

    info = read_model_info(folder, verify=(WEIGHTS,))
    try:
        network = DualUNet(UNetShape.from_json(info.shape))
        network.load_state_dict(load((folder / WEIGHTS).read_bytes()))
    except (KeyError, TypeError, ValueError, RuntimeError, SafetensorError) as error:
        reason = str(error).splitlines()[0]
        raise ModelError(f"{folder / WEIGHTS}: does not fit the shape in {INFO} ({reason}); restore the model folder") from None
    return network.eval(), info
