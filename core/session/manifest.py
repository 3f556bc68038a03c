"""``manifest.json``: what a session is. Written when it begins and when it ends, each time atomically, and read with suspicion."""

from __future__ import annotations

import contextlib
import json
import platform
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator

from core.calibration_config import CalibrationConfig
from core.config import Config
from core.errors import UserError
from core.learning.model_file import ModelError, model_folder, read_model_info
from core.rig_file import RigFileError, calibration_of
from core.whole_file import write_whole

MANIFEST, FRAMES, EVENTS = "manifest.json", "frames.jsonl", "events.jsonl"
PREFIX, RECOVERED = "session_", "_recovered"
FORMAT = 1
_MAX_BYTES = 8_000_000
_PACKAGES = ("av", "mujoco-core", "numba", "numpy", "opencv-python-headless", "openvino", "scikit-image", "scipy", "torch")

Kind = Literal["SIM", "LIVE", "PLAYBACK", "UNKNOWN"]
"""What the banner said; UNKNOWN only where a damaged manifest, or one with the word of a later version, cannot tell."""
Origin = Literal["recorded", "last seconds"]


class SessionError(UserError):
    """A session cannot be written, read, recovered or exported; the message is one line that says what to do."""


@dataclass(frozen=True, slots=True)
class About:
    """Where the pictures come from. ``calibration`` is whatever the rig knows of px and mm (None: not calibrated)."""

    kind: Kind
    rig: str
    config: dict[str, Any] = field(default_factory=dict)
    model: dict[str, str | None] = field(default_factory=dict)
    calibration: dict[str, Any] | None = None


class Counts(BaseModel):
    """What was written, and what was not."""

    model_config = ConfigDict(extra="ignore")

    frames: int = Field(0, ge=0)
    events: int = Field(0, ge=0)
    videos: int = Field(0, ge=0)
    dropped: int = Field(0, ge=0, description="frames that the recorder could not take")
    bytes: int = Field(0, ge=0)


class Loss(BaseModel):
    """What a recovered copy lacks. ``origin`` is the folder of the damaged original."""

    model_config = ConfigDict(extra="ignore")

    origin: str
    recovered_utc: str
    seconds: float = Field(ge=0, allow_inf_nan=False)
    rows: int = Field(ge=0)
    pictures: int = Field(ge=0)
    problems: tuple[str, ...] = ()


class Manifest(BaseModel):
    """A session. ``started_utc`` and ``started_monotonic_s`` are one moment; rows and events count by the latter's clock.

    ``closed`` is True only when the session ended properly; ``ended`` then says why.
    """

    model_config = ConfigDict(extra="ignore")

    format: int = Field(FORMAT, ge=1)
    id: str = Field(max_length=64)
    kind: Kind
    rig: str = ""
    origin: Origin = "recorded"
    started_utc: datetime
    started_monotonic_s: float = Field(allow_inf_nan=False)
    codec: str = ""
    model: dict[str, str | None] = {}
    versions: dict[str, str] = {}
    calibration: dict[str, Any] | None = None
    config: dict[str, Any] = {}
    closed: bool = False
    ended_utc: datetime | None = None
    ended: str = ""
    counts: Counts = Counts()
    recovered: Loss | None = None

    @field_validator("kind", "origin", mode="before")
    @classmethod
    def _of_a_later_version(cls, value: Any, info: ValidationInfo) -> Any:
        """A word that this version does not know costs no session its manifest."""
        if not isinstance(value, str):
            return value
        known, otherwise = (get_args(Kind), "UNKNOWN") if info.field_name == "kind" else (get_args(Origin), "recorded")
        return value if value in known else otherwise

    @property
    def known(self) -> CalibrationConfig | None:
        """The rig's calibration; None when it had none, or none that this version understands."""
        with contextlib.suppress(ValidationError):
            return CalibrationConfig.model_validate(self.calibration) if self.calibration is not None else None
        return None


def about_rig(config: Config, kind: Kind, rig: str, calibration: dict[str, Any] | None = None) -> About:
    """What is known of a rig from its configuration; a model that cannot be read has no hashes. `calibration`: the rig file's."""
    name = config.perception.segmentation.model
    model: dict[str, str | None] = {"name": name}
    try:
        info = read_model_info(model_folder(name), verify=())
    except ModelError as error:
        model["problem"] = str(error)
    else:
        model["sha256"] = info.weights_sha256
        model["onnx_sha256"], model["onnx_int8_sha256"] = info.onnx_sha256, info.onnx_int8_sha256
        model["second_look_sha256"] = info.second_look_sha256
    if calibration is None:
        with contextlib.suppress(RigFileError):  # whoever opens the rig is told
            known = calibration_of(config)
            calibration = known.model_dump(mode="json") if known is not None else None
    return About(kind, rig, config.model_dump(mode="json"), model, calibration)


def package_versions() -> dict[str, str]:
    """Versions of all that decides what is seen and written."""
    versions = {"python": platform.python_version(), "system": f"{platform.system()} {platform.machine()}"}
    for name in _PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return versions


def new_manifest(about: About, session_id: str, started: datetime, monotonic_s: float, codec: str) -> Manifest:
    """The manifest of a session that begins."""
    return Manifest(
        id=session_id,
        kind=about.kind,
        rig=about.rig,
        started_utc=started.astimezone(UTC),
        started_monotonic_s=monotonic_s,
        codec=codec,
        model=about.model,
        versions=package_versions(),
        calibration=about.calibration,
        config=about.config,
    )


def write_manifest(folder: Path, manifest: Manifest) -> int:
    """Write it atomically: whenever the process or the power goes, the old or the new one is there. Returns its bytes; OSError."""
    data = (manifest.model_dump_json(indent=1) + "\n").encode()
    write_whole(folder / MANIFEST, data, durable=True)
    return len(data)


def read_manifest(folder: Path) -> Manifest:
    """Raises SessionError: not there, damaged, or of a newer version."""
    path = folder / MANIFEST
    try:
        with path.open("rb") as file:
            data = file.read(_MAX_BYTES + 1)
    except FileNotFoundError:
        raise SessionError(f"{path}: missing") from None
    except OSError as error:
        raise SessionError(f"{path}: cannot be read ({error.strerror})") from None
    if len(data) > _MAX_BYTES:
        raise SessionError(f"{path}: too large for a manifest")
    try:
        content = json.loads(data)
        version = content.get("format") if isinstance(content, dict) else None
        if type(version) is int and version > FORMAT:
            raise SessionError(f"{path}: format {version} is of a newer version (this one knows {FORMAT}); update the program")
        return Manifest.model_validate(content)
    except ValidationError as error:
        first: Any = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise SessionError(f"{path}: damaged ({key + ': ' if key else ''}{first['msg']})") from None
    except (ValueError, RecursionError):
        raise SessionError(f"{path}: damaged (not valid JSON)") from None
