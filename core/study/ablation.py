"""What each step of the method is worth: variants between the paper taken literally and ours, compared on the same frames.

A variant is a configuration, nothing else: the preset ``paper`` with some steps' settings as ours has them. The *cumulative*
variants switch the steps on one after the other; the ones *without* a step are ours with that step alone switched back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from core.config import PerceptionConfig
from core.perception.segmentation import Probability, Recognised, Segmenter, recognise
from core.study.accuracy import TrueMasks
from core.types import Image, Mask

PAPER = "paper, literally"
OURS = "ours"
TRACKING = "tracking"


@dataclass(frozen=True, slots=True)
class Step:
    """A step of the method and the settings that switch it: ``section.key``, or a section for what no other step names."""

    name: str
    settings: tuple[str, ...]


STEPS = (
    Step("gap repair", ("gaps",)),
    Step("spur pruning", ("cleaning.prune_spurs",)),
    Step("end extension", ("cleaning.extend_ends",)),
    Step("path score", ("path",)),
    Step("sub-pixel path", ("path.smoothing_px",)),
    Step("vessel piece along the graph", ("vectors.vessel_rule",)),
    Step("junction rebuild", ("cleaning.rebuild_junctions",)),
    Step("line fit", ("vectors.line_fit",)),
    Step("half-size thinning", ("cleaning.half_size_thinning",)),
    Step("quality gate", ("quality",)),
    Step(TRACKING, ("tracking",)),
)
"""In the order of the table; the last one acts in a stream only."""


@dataclass(frozen=True, slots=True)
class Variant:
    """One row of the table. ``compared_with`` is the index of the row that its differences refer to (None: the first row)."""

    name: str
    kind: Literal["cumulative", "without"]
    config: PerceptionConfig
    compared_with: int | None


def make_variants(paper: PerceptionConfig, ours: PerceptionConfig, steps: Sequence[Step] = STEPS) -> list[Variant]:
    """The cumulative variants from `paper` to ours, then ours without each of the steps.

    Parameters
    ----------
    paper, ours : the two ends.
    steps : the steps to switch; settings of the others stay as in `ours` in all variants.

    Raises
    ------
    ValueError
        When the two differ in a setting that no step of ``STEPS`` switches.
    """
    by_step = _differences(paper, ours)
    off = {step.name: by_step[step.name] for step in steps}
    everything = [key for step in steps for key in off[step.name]]
    variants = [Variant(PAPER, "cumulative", _switched(ours, paper, everything), None)]
    for done, step in enumerate(steps, 1):
        still_off = [key for later in steps[done:] for key in off[later.name]]
        variants.append(Variant(f"+ {step.name}", "cumulative", _switched(ours, paper, still_off), done - 1))
    last = len(variants) - 1
    for step in steps:
        variants.append(Variant(f"{OURS} without {step.name}", "without", _switched(ours, paper, off[step.name]), last))
    return variants


def _differences(paper: PerceptionConfig, ours: PerceptionConfig) -> dict[str, list[tuple[str, str]]]:
    """For each step the settings (section, key) in which the two configurations differ."""
    step_of = {setting: step.name for step in STEPS for setting in step.settings}
    found: dict[str, list[tuple[str, str]]] = {step.name: [] for step in STEPS}
    literal, own = paper.model_dump(), ours.model_dump()
    for section, values in own.items():
        if section == "segmentation":  # all rows are measured on the same masks
            continue
        if not isinstance(values, dict):
            if values != literal[section]:
                raise ValueError(f"no step of the ablation switches {section}")
            continue
        for key, value in values.items():
            if value == literal[section][key]:
                continue
            name = step_of.get(f"{section}.{key}") or step_of.get(section)
            if name is None:
                raise ValueError(f"no step of the ablation switches {section}.{key}")
            found[name].append((section, key))
    return found


def _switched(ours: PerceptionConfig, paper: PerceptionConfig, settings: Sequence[tuple[str, str]]) -> PerceptionConfig:
    values, literal = ours.model_dump(), paper.model_dump()
    for section, key in settings:
        values[section][key] = literal[section][key]
    return PerceptionConfig.model_validate(values)


class SameMasks:
    """Runs the network once per frame, whoever asks: all variants work on the very same probabilities."""

    def __init__(self, network: Segmenter) -> None:
        self._network = network
        self._kept: Recognised | None = None

    @property
    def engine(self) -> str:
        return self._network.engine

    def next_frame(self, vessel: Mask, robot: Mask) -> None:
        """The next image is another frame; its true masks (H, W) are for ``TrueMasks`` in the network's place."""
        self._kept = None
        if isinstance(self._network, TrueMasks):
            self._network.show(vessel, robot)

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        return self.recognise([image])[0][:2]

    def recognise(self, images: Sequence[Image]) -> list[Recognised]:
        """Of the frame's one image."""
        if self._kept is None:
            (self._kept,) = recognise(self._network, images)
        return [self._kept]
