"""Ablation: what each step of the method is worth, from the paper taken literally to ours: ``python -m tools.ablation SET``.

A variant is a configuration: the preset ``paper`` with the settings of the first steps as ours has them. All variants see the same
masks of the same frames. Each difference has a 95 % interval (paired percentile bootstrap over whole phantoms).
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Hashable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import typer

from app.commands.options import ConfigOption, JsonOption, ModelOption, check_masks
from app.commands.progress import progress_bar
from core.config.models import PerceptionConfig, choose_model, load_config
from core.devices import UserError
from core.evaluation.accuracy import WRONG_DEG, WRONG_PX, FrameScore, TrueMasks, score_frame
from core.evaluation.metrics import Floats, are_too_few, bootstrap_rows, members
from core.files import name_as_text
from core.perception.segmentation import Probability, Segmentation, Segmenter
from core.types import Frame, Image, Mask
from tools.run import run_tool

if TYPE_CHECKING:
    from core.learning.dataset import Sample
    from core.perception.pipeline import Pipeline


PAPER = "paper, literally"
TRACKING = "tracking"


@dataclass(frozen=True, slots=True)
class AblatedStep:
    """A step of the method and the settings that switch it: ``section.key``, or a section for what no other step names."""

    name: str
    settings: tuple[str, ...]


STEPS = (
    AblatedStep("gap repair", ("gaps",)),
    AblatedStep("spur pruning", ("cleaning.prune_spurs",)),
    AblatedStep("end extension", ("cleaning.extend_ends",)),
    AblatedStep("path score", ("path",)),
    AblatedStep("sub-pixel path", ("path.smoothing_px",)),
    AblatedStep("vessel piece along the graph", ("vectors.vessel_rule",)),
    AblatedStep("junction rebuild", ("cleaning.rebuild_junctions",)),
    AblatedStep("line fit", ("vectors.line_fit",)),
    AblatedStep("half-size thinning", ("cleaning.half_size_thinning",)),
    AblatedStep("quality gate", ("quality",)),
    AblatedStep(TRACKING, ("tracking",)),
)
"""In the order of the table; the last one acts in a stream only."""


@dataclass(frozen=True, slots=True)
class Variant:
    """One row of the table; its differences refer to the row before."""

    name: str
    config: PerceptionConfig


def make_variants(paper: PerceptionConfig, ours: PerceptionConfig, steps: Sequence[AblatedStep] = STEPS) -> list[Variant]:
    """The variants from `paper` to ours.

    Parameters
    ----------
    paper, ours : the two ends.
    steps : the steps to switch; settings of the others stay as in `ours` in all variants.

    Raises
    ------
    ValueError
        When the two differ in a setting that no step of ``STEPS`` switches.
    """
    off = _differences(paper, ours)
    names = [PAPER, *(f"+ {step.name}" for step in steps)]
    still_off = [[key for step in steps[done:] for key in off[step.name]] for done in range(len(names))]
    return [Variant(name, _switched(ours, paper, keys)) for name, keys in zip(names, still_off, strict=True)]


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


class SameMasks(Segmenter):
    """Runs the network once per frame, whoever asks: all variants work on the very same probabilities."""

    def __init__(self, network: Segmenter) -> None:
        self._network = network
        self._kept: Segmentation | None = None

    @property
    def engine(self) -> str:
        return self._network.engine

    def next_frame(self, vessel: Mask, robot: Mask) -> None:
        """The next image is another frame; its true masks (H, W) are for ``TrueMasks`` in the network's place."""
        self._kept = None
        if isinstance(self._network, TrueMasks):
            self._network.show(vessel, robot)

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        return self.segment_signed([image])[0][:2]

    def segment_signed(self, images: Sequence[Image]) -> list[Segmentation]:
        """Of the frame's one image."""
        if self._kept is None:
            (self._kept,) = self._network.segment_signed(images)
        return [self._kept]


@dataclass(frozen=True, slots=True)
class AblationColumn:
    """A column of the table: the mean or a quantile of one value per frame."""

    key: str
    title: str
    of: Literal["theta", "head", "agreed", "answered", "wrong"]
    quantile: float | None
    is_share: bool = False


MEASURES = (
    AblationColumn("theta_median_deg", "theta median, deg", "theta", 0.5),
    AblationColumn("theta_mean_deg", "theta mean", "theta", None),
    AblationColumn("theta_p95_deg", "theta p95", "theta", 0.95),
    AblationColumn("head_median_px", "head median, px", "head", 0.5),
    AblationColumn("head_p95_px", "head p95", "head", 0.95),
    AblationColumn("state_agreement", "state agrees", "agreed", None, is_share=True),
    AblationColumn("answered_share", "answered", "answered", None, is_share=True),
    AblationColumn("wrong_share", "answered and wrong", "wrong", None, is_share=True),
)


@dataclass(frozen=True, slots=True)
class Figure:
    """A value, its difference to the row it is compared with, and that difference's 95 % interval; None where not defined."""

    value: float | None
    difference: float | None = None
    low: float | None = None
    high: float | None = None

    @property
    def is_clear(self) -> bool:
        """Whether the interval leaves out zero."""
        return self.low is not None and self.high is not None and (self.low > 0.0 or self.high < 0.0)


def figures(scores: Sequence[Sequence[FrameScore]], groups: Sequence[Hashable], seed: int = 0) -> list[dict[str, Figure]]:
    """The table's numbers: for each variant and ``AblationColumn.key`` a figure.

    Parameters
    ----------
    scores : for each variant the scores of the same frames in the same order.
    groups : for each frame what it belongs to (its phantom): whole groups are drawn, and too few of them make no interval.
    seed : of the bootstrap.
    """
    expected = [index for index, score in enumerate(scores[0]) if score.expected]
    group = members([groups[index] for index in expected])
    table: list[dict[str, Figure]] = [{} for _ in scores]
    for measure in MEASURES:

        def differences(*columns: Floats, quantile: float | None = measure.quantile) -> dict[str, Floats]:
            values = [_estimate(column, quantile) for column in columns]
            return {str(place): after - before for place, (before, after) in enumerate(pairwise(values), 1)}

        columns = tuple(np.array([_value(row[index], measure.of) for index in expected]) for row in scores)
        intervals = bootstrap_rows(differences, columns, seed, group)
        values = [float(_estimate(column, measure.quantile)) for column in columns]
        for place, value in enumerate(values):
            difference = value - values[place - 1] if place else math.nan
            interval = intervals.get(str(place)) if math.isfinite(difference) else None
            table[place][measure.key] = Figure(_finite(value), _finite(difference), *(interval or ()))
    return table


def _estimate(values: Floats, quantile: float | None) -> Floats:
    """Mean or quantile along the last axis, without the frames that say nothing (NaN); NaN where none says anything."""
    last = np.maximum(np.isfinite(values).sum(-1) - 1, 0)
    if quantile is None:
        return np.asarray(np.where(np.isnan(values).all(-1), np.nan, np.nansum(values, -1) / (last + 1)))
    ordered, position = np.sort(values, -1), quantile * last  # NaN comes last
    below = position.astype(np.int64)
    first, second = (np.take_along_axis(ordered, at[..., None], -1)[..., 0] for at in (below, np.minimum(below + 1, last)))
    return np.asarray(first + (position - below) * (second - first))


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _value(score: FrameScore, of: str) -> float:
    if of == "answered":
        return float(score.answered)
    if score.theta_error_deg is None or score.head_error_px is None:
        return math.nan
    theta, head = abs(score.theta_error_deg), score.head_error_px
    wrong = theta > WRONG_DEG or head > WRONG_PX
    return float({"theta": theta, "head": head, "agreed": score.state == score.true_state, "wrong": wrong}[of])


_MINUS = "\N{MINUS SIGN}"


def markdown(result: dict[str, Any]) -> str:
    """The table, for a document or a terminal."""
    brackets = f"the difference to the row before and its 95 % bootstrap interval over {result['drawn']}"
    headings = ["variant", *(column.title + (", %" if column.is_share else "") for column in MEASURES), "ms after network"]
    return (
        f"{result['set']}: {result['expected']} frames with a pose; the same masks for all rows ({result['masks']}); "
        f"in brackets {brackets}; * zero lies outside it.\n\n"
    ) + _markdown_table(headings, [_row_cells(row) for row in result["rows"]])


def _row_cells(row: dict[str, Any]) -> list[str]:
    figures_of_row = [(Figure(**row["figures"][column.key]), column) for column in MEASURES]
    cells = [_number(figure.value, column) + _difference(figure, column) for figure, column in figures_of_row]
    return [row["name"], *cells, f"{row['after_network_ms']:.1f}"]


def _markdown_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [headings, ["---"] * len(headings), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _number(value: float | None, measure: AblationColumn, *, signed: bool = False) -> str:
    if value is None:
        return "-"
    shown = f"{100.0 * value:{'+' if signed else ''}.1f}" if measure.is_share else f"{value:{'+' if signed else ''}.2f}"
    return shown.replace("-", _MINUS)


def _difference(figure: Figure, measure: AblationColumn) -> str:
    if figure.difference is None or figure.difference == figure.low == figure.high == 0.0:
        return ""
    star = "*" if figure.is_clear else ""
    low, high = (_number(value, measure, signed=True) for value in (figure.low, figure.high))
    return f" ({_number(figure.difference, measure, signed=True)}{star}, {low} to {high})"


def run_ablation(
    folder: Path,
    *,
    model: str | None = None,
    config_path: Path | None = None,
    true_masks: bool = False,
    seed: int = 0,
    out: Path | None = None,
) -> dict[str, Any]:
    """Measure on a labelled set; write ``ablation.json`` and ``.md`` to `out`.

    Raises
    ------
    UserError
        In one line, where there is nothing to measure on or the results cannot be written.
    """
    overrides = choose_model(model)
    ours = load_config(config_path, None, overrides).perception
    paper = load_config(config_path, "paper", overrides).perception
    samples, truth = _labelled(folder)
    try:
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
        masks, pipeline_of = _open_masks(ours, true_masks)
        source = "true masks" if true_masks else f"model {ours.segmentation.model}, {masks.engine}"
        result: dict[str, Any] = {"set": name_as_text(folder), "masks": source, "seed": seed}
        variants = make_variants(paper, ours, [step for step in STEPS if step.name != TRACKING])
        result |= _measure_set(samples, truth, variants, pipeline_of, masks, ours.working_size_px, seed)
        if out is not None:
            (out / "ablation.json").write_text(json.dumps(result, indent=1, allow_nan=False) + "\n", encoding="utf-8")
            (out / "ablation.md").write_text(markdown(result), encoding="utf-8")
    except OSError as error:
        raise UserError(f"{out}: cannot be written ({error.strerror}); choose another --out") from None
    return result


def _labelled(folder: Path) -> tuple[list[Sample], dict[str, dict[str, Any]]]:
    from core.learning.dataset import POSE_KEYS, find_labelled

    samples, truth = find_labelled(folder, POSE_KEYS)
    if all(truth[sample.stem].get("state") is None for sample in samples):
        raise UserError(f"{folder}: no frame of truth.jsonl has a pose; nothing can be compared")
    return samples, truth


def _open_masks(config: PerceptionConfig, true_masks: bool) -> tuple[SameMasks, Callable[[PerceptionConfig], Pipeline]]:
    """Where all variants get their masks from, and how a pipeline on them is made."""
    from core.perception.pipeline import Pipeline, open_calibrated

    if true_masks:
        masks = SameMasks(TrueMasks())
        return masks, lambda settings: Pipeline(masks, settings)
    network = open_calibrated(config)[0]
    masks = SameMasks(network.segment)
    return masks, lambda settings: Pipeline(replace(network, segment=masks), settings)


def _measure_set(
    samples: Sequence[Sample],
    truth: dict[str, dict[str, Any]],
    variants: Sequence[Variant],
    pipeline_of: Callable[[PerceptionConfig], Pipeline],
    masks: SameMasks,
    working_size_px: int,
    seed: int,
) -> dict[str, Any]:
    """``frames``, ``expected`` (with a pose), ``drawn`` (of what the bootstrap draws) and ``rows``, one for each variant."""
    from core.perception.segmentation import to_working

    pipelines = [pipeline_of(variant.config) for variant in variants]
    scores: list[list[FrameScore]] = [[] for _ in variants]
    latency_ms: list[list[float]] = [[] for _ in variants]
    with progress_bar() as bar:
        for sample in bar.track(samples, description=f"frames x {len(variants)} variants"):
            image, *true = sample.load()
            masks.next_frame(true[0], true[1])
            vessel, robot = (to_working(mask.astype(np.uint8) * 255, working_size_px)[0] > 127 for mask in true)
            for place, pipeline in enumerate(pipelines):
                scene = pipeline.perceive_single(Frame(0, 0.0, image))
                scores[place].append(score_frame(sample.stem, scene, vessel, robot, truth[sample.stem]))
                spent = scene.latency_ms
                latency_ms[place].append(spent["total"] - spent.get("prepare", 0.0) - spent.get("network", 0.0))
    groups = [truth[sample.stem].get("seed", sample.stem) for sample in samples]
    rows: list[dict[str, Any]] = [
        {
            "name": variant.name,
            "figures": {key: asdict(figure) for key, figure in row.items()},
            "after_network_ms": float(np.median(latency_ms[place])),
        }
        for place, (variant, row) in enumerate(zip(variants, figures(scores, groups, seed), strict=True))
    ]
    expected = [group for group, score in zip(groups, scores[0], strict=True) if score.expected]
    drawn = f"{len(set(expected))} phantoms{' (too few for intervals)' if are_too_few(members(expected)) else ''}"
    return {"frames": len(samples), "expected": len(expected), "drawn": drawn, "rows": rows}


def ablation(
    labelled: Annotated[Path, typer.Argument(metavar="SET", help="labelled set as synth writes it")],
    as_json: JsonOption = False,
    out: Annotated[Path | None, typer.Option(help="folder for ablation.json and ablation.md")] = None,
    true_masks: Annotated[bool, typer.Option("--true-masks", help="the true masks instead of the network's")] = False,
    seed: Annotated[int, typer.Option(min=0, help="of the bootstrap")] = 0,
    model: ModelOption = None,
    config: ConfigOption = None,
) -> None:
    """Measure what each step is worth, on the same masks of the same frames."""
    check_masks(model, true_masks=true_masks)
    result = run_ablation(labelled, model=model, config_path=config, true_masks=true_masks, seed=seed, out=out)
    sys.stdout.write(json.dumps(result, allow_nan=False) + "\n" if as_json else markdown(result))


if __name__ == "__main__":
    run_tool(ablation)
