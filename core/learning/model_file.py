"""A model on disk: ``weights.safetensors``, ``network.onnx``, perhaps ``network_int8.onnx``, and ``model.json`` with their SHA-256.

The network of its second look (``core/perception/second_look.py``), where it has one, is a model of its own in the folder within.

Nothing is loaded before its hash agrees, and nothing is ever unpickled: a cut, bit-flipped or foreign file is one clear error.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import platformdirs
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from core.config import RESOURCES
from core.errors import UserError
from core.learning.onnx_export import export_eight_bit, export_onnx, whole_strides
from core.perception.evidence import Calibration
from core.perception.familiarity import Familiarity
from core.types import Image

if TYPE_CHECKING:
    from core.perception.unet import DualUNet

WEIGHTS, ONNX, ONNX_INT8, INFO = "weights.safetensors", "network.onnx", "network_int8.onnx", "model.json"
SECOND_LOOK = "second_look"
"""The folder within a model that holds the network of its second look, where it has one."""
_INFO_SCRATCH = f".{INFO}.new"
MODELS = RESOURCES / "models"


_PLANES = {"image": "RGB and the first look's vessel and robot, uint8 (1, H, W, 5), working pixels, values 0..255"}


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
    calibration: Calibration | None = None
    calibration_mirrored: Calibration | None = None
    familiarity: Familiarity | None = None
    mirrored_second_looks: int = Field(1, ge=1, le=4)  # second_look.MOST_LOOKS, which cannot be imported from here
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


def save_model(
    network: DualUNet,
    folder: Path,
    *,
    training: dict[str, Any],
    figures: dict[str, Any],
    examples: Sequence[Image] = (),
    second_look: Path | None = None,
) -> ModelInfo:
    """Write weights, ONNX and manifest. The folder appears whole or not at all; an older model of that name is replaced last.

    From `examples`, typical RGB images at working size, an eight-bit copy learns ranges and rounding; without them there is none.
    `second_look` is the folder of a second look's network that comes along as it is.

    Raises
    ------
    ModelError
        The folder is something else than a model, or cannot be written.
    """
    from safetensors.torch import save

    with _put_in_place(folder) as scratch:
        state = {name: tensor.detach().cpu().contiguous() for name, tensor in network.state_dict().items()}
        (scratch / WEIGHTS).write_bytes(save(state))
        export_onnx(network, network.shape.stride, scratch / ONNX)
        cuts = whole_strides(examples, network.shape.stride)
        if cuts:
            export_eight_bit(network, cuts, scratch / ONNX_INT8)
        info = ModelInfo(
            format=1,
            name=folder.resolve().name,
            shape=network.shape.to_json(),
            stride=network.shape.stride,
            weights_sha256=sha256_of(scratch / WEIGHTS),
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


@contextmanager
def _put_in_place(folder: Path) -> Iterator[Path]:
    """An empty folder that takes the model's place in the end; whatever goes wrong leaves that as it was. Raises ModelError."""
    check_can_write(folder)
    folder = folder.resolve()
    scratch = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        yield scratch
        scratch.chmod(0o755)
        _put(scratch, folder)
    except OSError as error:
        places = [Path(os.fsdecode(name)) for name in (error.filename, error.filename2) if name is not None]
        if places and not any(place in (scratch, folder) or scratch in place.parents for place in places):
            raise  # a file that is read is at fault
        reason = error.strerror or str(error)
        raise ModelError(f"{folder}: cannot be written ({reason}); make room, or choose another folder") from None
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _put(scratch: Path, folder: Path) -> None:
    """Move a whole model to its place; where that fails, the one that was there before is there again.

    What else lay in the old one's folder, somebody's notes or frames, lies in the new one's then.
    """
    aside = scratch.with_name(scratch.name + ".old")
    # Aside first, deleted last: whenever this is interrupted, one of the two is whole.
    if folder.exists():
        os.replace(folder, aside)
    try:
        os.replace(scratch, folder)
    except BaseException:
        if aside.exists():
            os.replace(aside, folder)
        raise
    if aside.exists():
        _carry_over(aside, folder)
        shutil.rmtree(aside, ignore_errors=True)


def _carry_over(old: Path, new: Path) -> None:
    """Move what is not the model's own to its new folder; what cannot be moved stays where it is, and is told."""
    own = {WEIGHTS, ONNX, ONNX_INT8, INFO, _INFO_SCRATCH}
    try:
        for entry in list(old.iterdir()):
            if entry.name == SECOND_LOOK and entry.is_dir() and not entry.is_symlink():
                _carry_over(entry, new / SECOND_LOOK)
            elif entry.name not in own:
                new.mkdir(exist_ok=True)
                os.replace(entry, new / entry.name)
    except OSError as error:
        raise ModelError(f"{old}: holds what lay in the older model's folder and cannot be moved ({error.strerror})") from None


def save_with_second_look(base: Path, network: DualUNet, folder: Path, **kwargs: Any) -> None:
    """Write `folder`: the model in `base` with `network` for its second look. The rest of the arguments are ``save_model``'s.

    What was measured of `base`, figures and calibrations, is not true of the new model and left out; but Dice on held-out frames
    and the kinds of pictures that it knows are its network's alone, and stay.
    """
    with _put_in_place(folder) as scratch:
        _copy(base, scratch)
        save_model(network, scratch / SECOND_LOOK, **kwargs)
        figures = read_model_info(scratch, verify=()).figures
        held_out = figures if figures.get("held_out") else {}
        near_sha256 = sha256_of(scratch / SECOND_LOOK / WEIGHTS)
        changes: dict[str, Any] = {"calibration": None, "calibration_mirrored": None, "figures": held_out}
        _update(scratch, {"name": folder.resolve().name, "second_look_sha256": near_sha256} | changes)


@contextmanager
def changed(folder: Path) -> Iterator[Path]:
    """A copy of a model to work on, which takes its place in the end; whatever goes wrong leaves the model as it was.

    Raises
    ------
    ModelError
        The model is damaged, or cannot be written.
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


def _copy(folder: Path, to: Path) -> None:
    """A model's own files, but not their modes: a model that is read only may be worked on elsewhere."""
    for name in (WEIGHTS, ONNX, ONNX_INT8, INFO):
        if (folder / name).is_file():
            shutil.copyfile(folder / name, to / name)


def write_eight_bit(folder: Path, examples: Sequence[Image]) -> None:
    """Make the eight-bit copy of a model's network anew from `examples`, as ``save_model`` does; its figures are no longer true.

    Raises
    ------
    ModelError
        The model is damaged, or there is no picture of the network's stride or more among the examples.
    """
    network = load_network(folder)[0]
    cuts = whole_strides(examples, network.shape.stride)
    if not cuts:
        raise ModelError("nothing to make an eight-bit copy from; give pictures that can be read and show a robot")
    export_eight_bit(network, cuts, folder / ONNX_INT8)
    _update(folder, {"onnx_int8_sha256": sha256_of(folder / ONNX_INT8), "figures": {}})


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


def check_outside(out: Path, models: Sequence[Path]) -> None:
    """Raise ModelError when `out` lies within one of these models: what is read there would be changed, or go with it one day."""
    place = Path(os.path.realpath(out))
    if any(Path(os.path.realpath(folder)) in place.parents for folder in models):
        raise ModelError(f"{place}: lies within a model that is read for it; choose another --out")


def write_figures(folder: Path, figures: dict[str, Any]) -> None:
    """Store measured figures in the manifest of a model, atomically."""
    _update(folder, {"figures": figures})


def write_calibration(
    folder: Path,
    calibration: Calibration,
    mirrored: Calibration | None = None,
    *,
    second_looks: int = 1,
    familiarity: Familiarity | None = None,
) -> None:
    """Store how evidence becomes confidence in the manifest of a model, atomically. Figures measured before are no longer true.

    `mirrored` is for masks averaged over all orientations of a picture, looked at closely `second_looks` times; None: the same.
    `familiarity` is what kind of pictures the model knows; None: nobody has looked.
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
    try:
        scratch.write_text(info.model_dump_json(indent=1) + "\n", encoding="utf-8")
        os.replace(scratch, folder / INFO)
    except OSError as error:
        raise ModelError(f"{folder / INFO}: cannot be written ({error.strerror}); copy the model to a folder of your own") from None
