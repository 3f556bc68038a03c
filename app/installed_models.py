"""Which models there are, shipped and the user's own, and what is known of each. No Qt here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.language import tr
from core.learning.model_file import MODELS, ModelError, ModelInfo, models_in, own_models, read_model_info


@dataclass(frozen=True, slots=True)
class InstalledModel:
    """A model by the name it is called. ``problem``: why it cannot be used, "" when it can."""

    name: str
    folder: Path
    is_own: bool
    info: ModelInfo | None
    problem: str = ""

    @property
    def figures(self) -> str:
        """How good it was measured to be, in one line."""
        return figures_line(self.info) if self.info is not None else self.problem


def installed_models() -> list[InstalledModel]:
    """All models, shipped ones first; a damaged one is named as such. Hashes are checked when one is opened, not here."""
    found = []
    for place, is_own in ((MODELS, False), (own_models(), True)):
        for folder in models_in(place):
            try:
                info, problem = read_model_info(folder, verify=()), ""
            except ModelError as error:
                info, problem = None, str(error)
            found.append(InstalledModel(folder.name, folder, is_own, info, problem))
    return found


def figures_line(info: ModelInfo) -> str:
    """Dice of vessel and robot, on what; and whether it was taught what its confidence means."""
    figures: dict[str, Any] = info.figures
    parts = []
    if "vessel_dice" in figures and "robot_dice" in figures:
        parts.append(
            tr("Dice vessel {vessel}, robot {robot}", vessel=_figure(figures, "vessel_dice"), robot=_figure(figures, "robot_dice"))
        )
        what = (
            tr("held-out pictures")
            if figures.get("held_out")
            else tr("pictures of {name}", name=figures.get("set", tr("a test set")))
        )
        parts[0] += tr(" on {count} {what}", count=figures.get("frames", "?"), what=what)
    else:
        parts.append(tr("not measured"))
    if "state_agreement" in figures:
        parts.append(tr("state {share:.0f} %", share=100 * figures["state_agreement"]))
    if info.calibration is None:
        parts.append(tr("confidence not calibrated"))
    return ", ".join(parts)


def _figure(figures: dict[str, Any], name: str) -> str:
    """Now, and before training where that is known."""
    before = figures.get("before")
    now = f"{figures[name]:.2f}"
    return f"{before[name]:.2f} \N{RIGHTWARDS ARROW} {now}" if isinstance(before, dict) and name in before else now
