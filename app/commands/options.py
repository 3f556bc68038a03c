"""Options that several commands share, and what they check together."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from core.devices import UserError

if TYPE_CHECKING:
    from core.config.models import Config

ConfigOption = Annotated[Path | None, typer.Option("--config", help="TOML file; keys that differ from the defaults are enough")]
PresetOption = Annotated[str | None, typer.Option("--preset", help="'paper' takes the paper literally")]
ModelOption = Annotated[str | None, typer.Option(help="model name or folder")]
SchedulerOption = Annotated[str | None, typer.Option(help="address of a Dask scheduler that takes the place of --workers")]
RigOption = Annotated[
    str | None,
    typer.Option(
        "--rig", help="twin (needs no hardware), realsense, webcam, basler, or a name of rig list; default: the configured one"
    ),
]
BenchOption = Annotated[
    str | None, typer.Option("--bench", help="the twin in the phantom of your bench (see phantom): its folder, model, or rig")
]
SourceOption = Annotated[
    Path | None, typer.Option("--source", help="video, picture or folder to look at instead of a rig's camera")
]
StreamOption = Annotated[
    int | None,
    typer.Option(
        "--stream",
        metavar="[PORT]",
        min=0,
        max=65_535,
        help="live stream for Foxglove on this computer; default port: stream.port of the settings, 8765",
    ),
]
LslOption = Annotated[bool, typer.Option("--lsl", help="pose and markers to the lab streaming layer")]
JsonOption = Annotated[bool, typer.Option("--json", help="one JSON object on standard output, nothing else there")]
ProgressOption = Annotated[
    bool, typer.Option("--progress-json", help="progress as JSON objects on standard output, one a line, for other programs")
]
OperatorOption = Annotated[str | None, typer.Option(help="who recorded it")]
TaskOption = Annotated[str | None, typer.Option(help="what was done")]
ConditionOption = Annotated[str | None, typer.Option(help="under which condition, such as the arm of a study")]
PhantomOption = Annotated[str | None, typer.Option(help="what lay before the camera; the twin knows it by itself")]
NotesOption = Annotated[str | None, typer.Option(help="anything else")]
TagOption = Annotated[list[str] | None, typer.Option("--tag", help="to find it by in the library; may be repeated")]
SessionArgument = Annotated[Path, typer.Argument(metavar="SESSION", help="folder of a recorded session")]


def check_masks(model: str | None, *, true_masks: bool) -> None:
    """Raise UserError for a `model` that ``--true-masks`` would not use."""
    if true_masks and model is not None:
        raise UserError("--true-masks looks through no network: leave --model out")


def point_option(text: str) -> tuple[float, float]:
    """The place that ``X,Y`` names. Raises UserError."""
    match = re.fullmatch(r"\s*(-?\d+(?:\.\d+)?)\s*,\s*(-?\d+(?:\.\d+)?)\s*", text)
    if match is None:
        raise UserError(f"{text}: give a place as X,Y, in pixels of the bench's picture")
    return float(match[1]), float(match[2])


def with_outputs(config: Config, stream: int | None, *, lsl: bool) -> Config:
    """The configuration with what ``--stream`` and ``--lsl`` switch on; a port of 0 is the configured one."""
    changes: dict[str, Any] = ({} if stream is None else {"foxglove": True}) | ({"port": stream} if stream else {})
    changes |= {"lsl": True} if lsl else {}
    return config.model_copy(update={"stream": config.stream.model_copy(update=changes)})


def bare_stream(words: Sequence[str]) -> list[str]:
    """Command line in which ``--stream`` without a port has port 0, the configured one: Typer knows no optional values."""
    pairs = zip(words, [*words[1:], ""], strict=False)
    return [f"{word}=0" if word == "--stream" and not after.isdigit() else word for word, after in pairs]
