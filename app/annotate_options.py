"""The command line of ``annotate``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class StudyOptions:
    """What the command line says about the study; None where it says nothing, ``asked`` "" for what lies outside studies."""

    asked: str | None = None
    rater: str | None = None
    repeats: int | None = None
    mirror: bool = False
    turn: bool = False
    seed: int | None = None
    order: str | None = None

    @property
    def name(self) -> str:
        """In which answers are given; "" outside studies."""
        return self.asked or ""


@dataclass(frozen=True, slots=True)
class AnnotateOptions:
    """The command line of ``annotate``."""

    paths: tuple[Path, ...]
    store: Path | None = None
    study: StudyOptions = StudyOptions()
    frames: int | None = None
    """Of each video; None: those that were taken before, or ``FRAMES`` new ones."""
    report: bool = False
    export: str | None = None
    imports: tuple[Path, ...] = ()
    joins: tuple[Path, ...] = ()
    names: tuple[str, ...] = ()
    """Of raters in the files of `joins`, as THERE=HERE."""
    salvage: bool = False
    out: Path | None = None
    as_json: bool = False
    model: str | None = None
    config_path: Path | None = None
