"""The schema of the configuration, read from its models: sections, and for every setting unit, range and description."""

from __future__ import annotations

import re
import types
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from core.config.models import Config
from core.config.safety import JOINT_NAMES
from core.messages import message
from core.plugins import PluginKind

# Ends of names, longest first where one ends in the other.
_UNITS = (
    ("_per_mm", "px/mm"),
    ("_per_turn", "mm/turn"),
    ("frames_per_second", "1/s"),
    ("_rate_per_s", "1/s"),
    ("_mm_s2", "mm/s²"),
    ("_mm_s", "mm/s"),
    ("_px_s", "px/s"),
    ("_mbit_s", "Mbit/s"),
    ("_area_px", "px²"),
    ("_px", "px"),
    ("_mm", "mm"),
    ("_deg", "°"),
    ("_ms", "ms"),
    ("_ma", "mA"),
    ("_hz", "Hz"),
    ("_mb", "MB"),
    ("_frames", "frames"),
    ("_s", "s"),
    ("_n", "N"),
    ("_k", "K"),
    ("_c", "°C"),
    ("_v", "V"),
    ("baud", "bit/s"),
)
JOINTS = "servos.joints"
"""The one list: always written as a whole."""
_KEPT_ENDS = ("frames_per_second", "_per_mm", "_per_turn", "_rate_per_s", "_frames", "baud")
"""Units that stay in the title."""
_SPELLING = {"px": "px", "mm": "mm", "id": "ID", "cpu": "CPU", "crf": "CRF", "theta": "θ", "d": "d", "usb": "USB"}
_TITLES = {  # of sections, and of settings whose name says little without its unit
    "camera": "Camera (real)",
    "twin": "Bench twin",
    "perception.gaps": "Gap repair",
    "perception.path": "Robot path",
    "perception.vectors": "Line fits",
    "perception.pose": "Pose state",
    "perception.quality": "Quality gate",
    "policy.drive": "Advice to command",
    "hand": "Driving by hand",
    "pedal": "Foot pedal",
    "record": "Recording",
    "stream": "Live output",
    "stream.lsl": "LSL",
    "record.max_mbit_s": "Max bit rate",
    "record.split_s": "Split after",
    "record.sync_s": "Sync every",
    "record.ring_s": "Ring length",
    "record.ring_mb": "Ring size",
    "servos.bus_hz": "Bus rate",
    "safety.min_confidence": "Min confidence to drive",
    "perception.pose.d_allow_px": "Allowed distance",
    "perception.pose.theta_allow_deg": "Allowed angle",
    "perception.pose.hysteresis_px": "Hysteresis, distance",
    "perception.pose.hysteresis_deg": "Hysteresis, angle",
}
_SOURCE = re.compile(r" \(METHOD section \d\)")
"""Reference to the method, for readers of the code."""


class FieldKind(StrEnum):
    """How a value is entered."""

    SWITCH = "switch"
    WHOLE = "whole number"
    NUMBER = "number"
    CHOICE = "choice"
    TEXT = "text"


class Effect(StrEnum):
    """When a changed setting begins to act."""

    NOW = "acts at once"
    RIG = "from the next start of the rig"
    PROGRAM = "from the next start of the program"


@dataclass(frozen=True, slots=True)
class Bounds:
    """An allowed range; None: open. ``low_open`` and ``high_open`` exclude the end itself; ``step``: multiples of it only."""

    low: float | None = None
    high: float | None = None
    low_open: bool = False
    high_open: bool = False
    step: float | None = None

    def text(self, unit: str = "") -> str:
        """In words, with the unit at the end."""
        low = "" if self.low is None else f"{'above' if self.low_open else 'at least'} {_plain(self.low)}"
        high = "" if self.high is None else f"{'below' if self.high_open else 'at most'} {_plain(self.high)}"
        both = f"{low} and {high}" if low and high else low or high
        if self.low is not None and self.high is not None and not (self.low_open or self.high_open):
            both = message("{a} to {rest}", a=_plain(self.low), rest=_plain(self.high))
        both = f"{both} {unit}" if both and unit else both
        return f"{both}, a multiple of {_plain(self.step)}" if both and self.step is not None else both


@dataclass(frozen=True, slots=True)
class Setting:
    """One setting. ``key`` is its dotted path, with the index in a list (``servos.joints.0.id``)."""

    key: str
    title: str
    kind: FieldKind
    unit: str = ""
    description: str = ""
    bounds: Bounds = Bounds()
    options: tuple[Any, ...] | PluginKind = ()
    is_optional: bool = False
    effect: Effect = Effect.RIG

    @property
    def name(self) -> str:
        """The key in its section."""
        return self.key.rpartition(".")[2]

    @property
    def choices(self) -> tuple[Any, ...]:
        """The values of a choice, those of plugins included."""
        return self.options.names if isinstance(self.options, PluginKind) else self.options

    @property
    def range_text(self) -> str:
        """What may be entered; empty for switches and free text."""
        if self.kind is FieldKind.CHOICE:
            return ", ".join(str(choice) for choice in self.choices)
        return self.bounds.text(self.unit)


@dataclass(frozen=True, slots=True)
class Section:
    """Settings of one section, and the sections within."""

    key: str
    title: str
    description: str
    settings: tuple[Setting, ...]
    sections: tuple[Section, ...] = ()

    def walk(self) -> Iterator[Section]:
        """This section and all within, in order."""
        yield self
        for section in self.sections:
            yield from section.walk()

    def all_settings(self) -> Iterator[Setting]:
        """Its settings and those of all sections within."""
        for section in self.walk():
            yield from section.settings


@cache
def schema() -> Section:
    """The whole configuration as one section without a key."""
    return _section(Config, "")


@cache
def settings_by_key() -> dict[str, Setting]:
    """All settings, in order."""
    return {setting.key: setting for setting in schema().all_settings()}


def effect_of(key: str) -> Effect:
    """When a change of this setting acts. Perception reads its thresholds for every frame, and its network once."""
    top, _, rest = key.partition(".")
    if key == "window.language":
        return Effect.PROGRAM
    if top == "window" or (top == "perception" and rest not in _LOADED_ONCE):
        return Effect.NOW
    return Effect.PROGRAM if top in _AT_START else Effect.RIG


_LOADED_ONCE = {"working_size_px"} | {
    f"segmentation.{name}" for name in ("model", "device", "precision", "threads", "mirrored", "second_look")
}
_AT_START = {"rig", "record", "pedal", "gamepad", "stream"}


def value_at(data: Any, key: str) -> Any:
    """The value at a dotted path of nested dictionaries and lists. Raises KeyError."""
    for part in key.split("."):
        if isinstance(data, list) and part.isdecimal() and int(part) < len(data):
            data = data[int(part)]
        elif isinstance(data, dict) and part in data:
            data = data[part]
        else:
            raise KeyError(key)
    return data


def setting_at(data: Any, key: str) -> Any:
    """The value of a setting; None for one of a joint that a robot of another shape does not have."""
    try:
        return value_at(data, key)
    except KeyError:
        return None


def with_value(data: dict[str, Any], key: str, value: Any) -> dict[str, Any]:
    """A copy of nested dictionaries and lists with one value replaced."""

    def replaced(data: Any, parts: list[str]) -> Any:
        if not parts:
            return value
        if isinstance(data, list):
            place = int(parts[0])
            return [replaced(item, parts[1:]) if k == place else item for k, item in enumerate(data)]
        inner = data.get(parts[0], {}) if isinstance(data, dict) else {}
        return {**data, parts[0]: replaced(inner, parts[1:])}

    return replaced(data, key.split("."))  # type: ignore[no-any-return]


def _section(model: type[BaseModel], key: str, title: str | None = None) -> Section:
    settings: list[Setting] = []
    sections: list[Section] = []
    for name, info in model.model_fields.items():
        if info.exclude:  # of older files, read and not used
            continue
        path = f"{key}.{name}" if key else name
        kind = info.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            sections.append(_section(kind, path))
        elif path == JOINTS:
            (item, *_) = get_args(kind)
            sections.extend(_section(item, f"{path}.{k}", f"Joint {name.replace('_', ' ')}") for k, name in enumerate(JOINT_NAMES))
        elif not key.startswith(JOINTS) or name not in ("name", "kind", "angle_deg"):  # a joint's place says what it is
            settings += _setting(path, info)
    text = _SOURCE.sub("", " ".join((model.__doc__ or "").split())) if model.__doc__ != BaseModel.__doc__ else ""
    shown = title or _TITLES.get(key) or _title(key.rpartition(".")[2])
    return Section(key, shown, text, tuple(settings), tuple(sections))


def _setting(key: str, info: FieldInfo) -> list[Setting]:
    """The setting of a field; none for a field that is not one value that can be typed or chosen."""
    name, kind, is_optional = key.rpartition(".")[2], info.annotation, False
    if get_origin(kind) in (Union, types.UnionType):
        kinds = [one for one in get_args(kind) if one is not type(None)]
        kind, is_optional = kinds[0], len(kinds) < len(get_args(kind))
    unit = next((unit for end, unit in _UNITS if name.endswith(end)), "")
    common: dict[str, Any] = {
        "title": _TITLES.get(key) or _title(name),
        "description": info.description or "",
        "is_optional": is_optional,
        "effect": effect_of(key),
    }
    if get_origin(kind) is Literal:
        return [Setting(key, kind=FieldKind.CHOICE, options=get_args(kind), **common)]
    if plugins := [item for item in info.metadata if isinstance(item, PluginKind)]:
        return [Setting(key, kind=FieldKind.CHOICE, options=plugins[0], **common)]
    if kind is bool:
        return [Setting(key, kind=FieldKind.SWITCH, **common)]
    if kind in (int, float):
        limits = ("ge", "gt", "le", "lt", "multiple_of")
        found = {name: value for item in info.metadata for name in limits if (value := getattr(item, name, None)) is not None}
        low, high = found.get("gt", found.get("ge")), found.get("lt", found.get("le"))
        bounds = Bounds(low, high, "gt" in found, "lt" in found, found.get("multiple_of"))
        return [Setting(key, kind=FieldKind.WHOLE if kind is int else FieldKind.NUMBER, unit=unit, bounds=bounds, **common)]
    return [Setting(key, kind=FieldKind.TEXT, **common)] if kind is str else []


def _title(name: str) -> str:
    """A name from the file in words, without its unit."""
    for end, _ in _UNITS:
        if name.endswith(end):
            if end not in _KEPT_ENDS:
                name = name.removesuffix(end) + ("_area" if end == "_area_px" else "")
            break
    words = [_SPELLING.get(word, word) for word in name.split("_") if word]
    text = " ".join(words)
    return text[:1].upper() + text[1:] if words and words[0] not in ("d", "θ", "px", "mm") else text


def _plain(value: float) -> str:
    """Without an exponent where possible: 100000, 0.05, 2147483647."""
    return str(int(value)) if float(value).is_integer() and abs(value) < 1e15 else f"{value:g}"
