"""Options that several commands share, and what they check together."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from core.devices import UserError

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
SourceOption = Annotated[
    Path | None, typer.Option("--source", help="video, picture or folder to look at instead of a rig's camera")
]
JsonOption = Annotated[bool, typer.Option("--json", help="one JSON object on standard output, nothing else there")]
ProgressOption = Annotated[
    bool, typer.Option("--progress-json", help="progress as JSON objects on standard output, one a line, for other programs")
]
SessionArgument = Annotated[Path, typer.Argument(metavar="SESSION", help="folder of a recorded session")]


def check_masks(model: str | None, *, true_masks: bool) -> None:
    """Raise UserError for a `model` that ``--true-masks`` would not use."""
    if true_masks and model is not None:
        raise UserError("--true-masks looks through no network: leave --model out")
