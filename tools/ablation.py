"""``ablation``: from the paper taken literally to ours, step by step, on one labelled set and, if asked, on streams of the twin.

The part of ``ablation`` that needs a stream: consecutive frames of the twin, with and without tracking.

The tables of ``ablation`` on screen and in Markdown, from its result (the same object that ``--json`` prints).

What each step of the method is worth: variants between the paper taken literally and ours, compared on the same frames.

A variant is a configuration, nothing else: the preset ``paper`` with some steps' settings as ours has them. The *cumulative*
variants switch the steps on one after the other; the ones *without* a step are ours with that step alone switched back.

The numbers of the ablation's table: values over frames, and differences between variants with paired bootstrap intervals.

Each difference comes with a 95 % interval (percentile method); the same frames are drawn for both variants.

How true and steady perception is in a stream: errors, swaps of head and tail, the head's jumps, the lag and jitter of theta.
"""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from app.commands.options import ConfigOption, JsonOption, ModelOption, check_masks
from app.commands.perceive import LeftOut
from app.commands.progress import progress_bar
from core.config.models import PerceptionConfig, TwinConfig, choose_model, load_config
from core.devices import UserError
from core.evaluation.accuracy import WRONG_DEG, WRONG_PX, FrameScore, TrueMasks, score_frame
from core.files import name_as_text
from core.perception.segmentation import Probability, Segmentation, Segmenter
from core.types import Frame, Image, Mask, Point, Scene

if TYPE_CHECKING:
    from core.learning.dataset import Sample
    from core.perception.pipeline import Pipeline


PAPER = "paper, literally"
OURS = "ours"
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
    """One row of the table. ``compared_with`` is the index of the row that its differences refer to (None: the first row)."""

    name: str
    kind: Literal["cumulative", "without"]
    config: PerceptionConfig
    compared_with: int | None


def make_variants(paper: PerceptionConfig, ours: PerceptionConfig, steps: Sequence[AblatedStep] = STEPS) -> list[Variant]:
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


JUMP_PX = 20.0
LAGS = np.arange(-4.0, 8.01, 0.25)
"""Lags that are tried, in frames."""
LAG_CAP_DEG = 10.0
"""Larger errors count like this one: a wrong branch says nothing about the lag."""
MIN_LAG_SAMPLES = 30
MIN_TURN_DEG = 0.1
"""Where the true theta changes by less than this per frame, no lag can be told."""


@dataclass(frozen=True, slots=True)
class StreamFrame:
    """One frame of a stream: what was found (None: no answer) and what is true (None: no pose). Points in source px."""

    head: Point | None
    tail: Point | None
    theta_signed_deg: float | None
    state: str | None
    true_head: Point | None
    true_tail: Point | None
    true_theta_signed_deg: float | None
    true_state: str | None

    @property
    def is_swapped(self) -> bool:
        """Whether the answer took the tail for the head."""
        if self.head is None or self.tail is None or self.true_head is None or self.true_tail is None:
            return False
        right = _gap(self.head, self.true_head) + _gap(self.tail, self.true_tail)
        return _gap(self.head, self.true_tail) + _gap(self.tail, self.true_head) < right


def stream_frame(scene: Scene, truth: dict[str, Any]) -> StreamFrame:
    """What `scene` answered beside a truth row as ``synth`` writes it."""
    pose, path = scene.pose, scene.path
    has_pose = truth.get("state") is not None
    answered = pose is not None and path is not None
    return StreamFrame(
        head=scene.to_source(path.head) if answered and path is not None else None,
        tail=scene.to_source(path.tail) if answered and path is not None else None,
        theta_signed_deg=pose.theta_signed_deg if pose is not None else None,
        state=pose.state.value if pose is not None else None,
        true_head=_pair(truth["head_xy"]) if has_pose else None,
        true_tail=_pair(truth["tail_xy"]) if has_pose else None,
        true_theta_signed_deg=float(truth["theta_signed_deg"]) if has_pose else None,
        true_state=truth["state"] if has_pose else None,
    )


def stream_figures(streams: Sequence[Sequence[StreamFrame]]) -> dict[str, float | int | None]:
    """The sums over several streams of consecutive frames.

    Returns
    -------
    ``frames`` with a true pose; ``answered_share``; ``state_agreement`` with the true state, which knows no hysteresis;
    ``theta_median_deg``, ``theta_mean_deg``, ``head_median_px`` of the absolute errors; ``wrong_share`` of the answers, by more
    than 10 degrees or 15 px; ``swapped_frames``, answers that took the tail for the head; ``jumps``, answers whose head moved by
    more than ``JUMP_PX`` other than the true head did since the answer before; ``theta_lag_frames``, the delay of the true theta
    that fits the found one best (None: it moved too little to tell); ``theta_jitter_deg`` and ``head_jitter_px``, the robust
    standard deviation of the error's change from frame to frame; ``state_changes`` and ``true_state_changes``.
    """
    frames = [frame for stream in streams for frame in stream if frame.true_state is not None]
    answered = [frame for frame in frames if frame.state is not None]
    head_moves = [move for stream in streams for move in _head_moves(stream)]
    theta_moves = [_turn(b, a) for stream in streams for a, b in _pairs(_theta_errors(stream))]
    steady = [move for move in head_moves if move <= JUMP_PX]
    errors = np.array([error for stream in streams for error in _errors(stream)], np.float64).reshape(-1, 2)
    theta, head = errors.T
    is_wrong = (theta > WRONG_DEG) | (head > WRONG_PX)
    return {
        "frames": len(frames),
        "answered_share": len(answered) / len(frames) if frames else None,
        "state_agreement": sum(f.state == f.true_state for f in answered) / len(answered) if answered else None,
        "theta_median_deg": float(np.median(theta)) if len(theta) else None,
        "theta_mean_deg": float(theta.mean()) if len(theta) else None,
        "head_median_px": float(np.median(head)) if len(head) else None,
        "wrong_share": float(is_wrong.mean()) if len(theta) else None,
        "swapped_frames": sum(frame.is_swapped for frame in answered),
        "jumps": len(head_moves) - len(steady),
        "theta_lag_frames": _lag(streams),
        "theta_jitter_deg": _spread(theta_moves, 1.4826),
        "head_jitter_px": _spread(steady, 1.0 / 1.1774),
        "state_changes": sum(_changes([f.state for f in stream]) for stream in streams),
        "true_state_changes": sum(_changes([f.true_state for f in stream]) for stream in streams),
    }


def _pair(values: Sequence[float]) -> Point:
    return float(values[0]), float(values[1])


def _gap(a: Point, b: Point) -> float:
    return float(np.hypot(a[0] - b[0], a[1] - b[1]))


def _turn(to: float, since: float) -> float:
    return (to - since + 180.0) % 360.0 - 180.0


def _spread(changes: Sequence[float], scale: float) -> float | None:
    """Standard deviation from the median size of changes: `scale` is 1.4826 for a number, 1/1.1774 for the length of a 2-D step."""
    return scale * float(np.median(np.abs(changes))) if changes else None


def _errors(stream: Sequence[StreamFrame]) -> list[tuple[float, float]]:
    """By how much theta (degrees) and the head (px) of each answer are off."""
    thetas = _theta_errors(stream)
    return [
        (abs(theta), _gap(frame.head, frame.true_head))
        for theta, frame in zip(thetas, stream, strict=True)
        if theta is not None and frame.head is not None and frame.true_head is not None
    ]


def _head_moves(stream: Sequence[StreamFrame]) -> list[float]:
    """How much the head's error changed between each answer and the one before it, in px."""
    errors = [
        (frame.head[0] - frame.true_head[0], frame.head[1] - frame.true_head[1])
        for frame in stream
        if frame.head is not None and frame.true_head is not None
    ]
    return [_gap(a, b) for a, b in zip(errors, errors[1:], strict=False)]


def _theta_errors(stream: Sequence[StreamFrame]) -> list[float | None]:
    return [
        None
        if frame.theta_signed_deg is None or frame.true_theta_signed_deg is None
        else _turn(frame.theta_signed_deg, frame.true_theta_signed_deg)
        for frame in stream
    ]


def _pairs(values: Sequence[float | None]) -> list[tuple[float, float]]:
    """Values of frames that follow each other."""
    return [(a, b) for a, b in zip(values, values[1:], strict=False) if a is not None and b is not None]


def _changes(states: Sequence[str | None]) -> int:
    shown = [state for state in states if state is not None]
    return sum(a != b for a, b in zip(shown, shown[1:], strict=False))


def _lag(streams: Sequence[Sequence[StreamFrame]]) -> float | None:
    costs, moves = [], []
    for stream in streams:
        true = np.array([np.nan if f.true_theta_signed_deg is None else f.true_theta_signed_deg for f in stream], np.float64)
        found = np.array([np.nan if f.theta_signed_deg is None else f.theta_signed_deg for f in stream], np.float64)
        costs.append(_lag_costs(true, found))
        moves += [abs(_turn(b, a)) for a, b in zip(true, true[1:], strict=False) if np.isfinite(a + b)]
    cost = np.concatenate(costs) if costs else np.empty((0, len(LAGS)))
    if len(cost) < MIN_LAG_SAMPLES or float(np.mean(moves)) < MIN_TURN_DEG:
        return None
    mean = cost.mean(axis=0)
    best = int(np.argmin(mean))
    if best in (0, len(LAGS) - 1):
        return float(LAGS[best])
    before, here, after = mean[best - 1 : best + 2].tolist()
    curvature = before - 2.0 * here + after
    shift = 0.5 * (before - after) / curvature if curvature > 0.0 else 0.0
    return float(LAGS[best] + shift * (LAGS[1] - LAGS[0]))


def _lag_costs(true: NDArray[np.float64], found: NDArray[np.float64]) -> NDArray[np.float64]:
    """Capped squared difference between the found theta and the true one of `LAGS` frames ago, shape (frames, lags)."""
    first, last = int(np.ceil(LAGS[-1])), len(true) - 1 - int(np.ceil(-LAGS[0]))
    rows = []
    for frame in range(first, last + 1):
        places = frame - LAGS
        low = np.floor(places).astype(int)
        high = np.minimum(low + 1, len(true) - 1)
        turn = (true[high] - true[low] + 180.0) % 360.0 - 180.0
        then = true[low] + (places - low) * turn
        error = np.abs((found[frame] - then + 180.0) % 360.0 - 180.0)
        if np.isfinite(error).all():
            rows.append(np.minimum(error, LAG_CAP_DEG) ** 2)
    return np.array(rows, np.float64).reshape(-1, len(LAGS))


_FEED_MM_S = 12.0
_START_MM = 35.0
_WANDER = 0.6
LIVE = f"{OURS}, as the window has it"


def measure_streams(
    configs: Mapping[str, PerceptionConfig],
    pipeline_of: Callable[[PerceptionConfig], Pipeline],
    masks: SameMasks,
    *,
    live: Pipeline | None,
    frames: int,
    phantoms: Sequence[str],
    seed: int,
) -> tuple[dict[str, Any] | None, bool]:
    """The same frames of the twin, in order, through pipelines of all `configs`, and through one that looks as the window does.

    Parameters
    ----------
    configs : by the variant's name, ``OURS`` among them: its settings tell the truth.
    pipeline_of : makes a new pipeline that looks through `masks`.
    masks : what all pipelines share.
    live : a pipeline as the window has it, which looks for itself, mostly around the head; None: it is left out.
    frames : to be divided among the `phantoms`.
    seed : of the twin.

    Returns
    -------
    The phantoms that were driven through and ``stream_figures`` by variant (None when there is none); whether it was interrupted.
    """
    each = -(-frames // len(phantoms))
    names = [*configs, *([LIVE] if live is not None else [])]
    streams: dict[str, list[list[StreamFrame]]] = {name: [] for name in names}
    driven: list[str] = []
    interrupted = False
    with progress_bar() as bar:
        task = bar.add_task("frames of the twin", total=each * len(phantoms))
        try:
            for look, phantom in enumerate(phantoms):
                pipelines = {name: pipeline_of(config) for name, config in configs.items()}
                if live is not None:
                    live.reset()
                    pipelines[LIVE] = live
                seen: dict[str, list[StreamFrame]] = {name: [] for name in names}
                for frame, row in _stream(phantom, look, each, seed, configs[OURS], masks):
                    for name, pipeline in pipelines.items():
                        seen[name].append(stream_frame(pipeline(frame), row))
                    bar.advance(task)
                driven.append(phantom)
                for name, part in seen.items():
                    streams[name].append(part)
        except KeyboardInterrupt:
            interrupted = True
    if not driven:
        return None, interrupted
    rows = [{"name": name, "figures": stream_figures(parts[: len(driven)])} for name, parts in streams.items()]
    return {"phantoms": driven, "frames_each": each, "rows": rows}, interrupted


def _stream(
    phantom: str, look: int, frames: int, seed: int, config: PerceptionConfig, masks: SameMasks
) -> Iterator[tuple[Frame, dict[str, Any]]]:
    """Consecutive frames of a robot that is driven along its longest route with a slow wander, and their truth."""
    from hardware.twin.truth import RouteFollower
    from hardware.twin.world import TwinWorld

    world = TwinWorld(TwinConfig(phantom=phantom, appearance_seed=look), perception=config, seed=seed)
    routes = (RouteFollower(world.phantom, node, wander=_WANDER, seed=seed) for node in world.phantom.targets)
    follower = max(routes, key=lambda route: route.length_mm)
    world.insert(_START_MM)
    world.robot.connect()
    period_s = 1.0 / world.config.frames_per_second
    for _ in range(frames):
        world.robot.send(follower.command(world.physics.robot_points_mm(), _FEED_MM_S, period_s))
        world.advance(period_s)
        frame = world.frame()
        picture = world.picture(world.physics.robot_points_mm(), world.physics.delivery_mm)
        masks.next_frame(picture.vessel, picture.robot)
        yield frame, world.truth().to_json()


RESAMPLES = 1000
MIN_DEFINED = 0.9
"""A difference that is undefined in more resamples than the rest of these (a row that hardly answers) has no interval."""
MIN_GROUPS = 10
"""Frames of one phantom are alike, so whole phantoms are drawn; with fewer than this many of them there is no interval."""


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

    def to_json(self) -> dict[str, float | None]:
        return {"value": self.value, "difference": self.difference, "low": self.low, "high": self.high}


def figures(
    scores: Sequence[Sequence[FrameScore]], compared_with: Sequence[int | None], groups: Sequence[Hashable], seed: int = 0
) -> list[dict[str, Figure]]:
    """The table's numbers: for each variant and ``Measure.key`` a figure.

    Parameters
    ----------
    scores : for each variant the scores of the same frames in the same order.
    compared_with : for each variant the index of the one that its differences refer to.
    groups : for each frame what it belongs to (its phantom); whole groups are drawn, see ``MIN_GROUPS``.
    seed : of the bootstrap.
    """
    expected = [index for index, score in enumerate(scores[0]) if score.expected]
    drawn_from = [groups[index] for index in expected]
    weights = draw_weights(drawn_from, seed) if are_enough(drawn_from) else np.zeros((1, len(expected)), np.int64)
    once = np.ones((1, len(expected)), np.int64)
    columns = [{measure.of: _column([row[i] for i in expected], measure.of) for measure in MEASURES} for row in scores]
    table: list[dict[str, Figure]] = [{} for _ in scores]
    for measure in MEASURES:
        values = [column[measure.of] for column in columns]
        plain = [float(estimate(value, once, measure.quantile)[0]) for value in values]
        drawn = [estimate(value, weights, measure.quantile) for value in values]
        for index, other in enumerate(compared_with):
            table[index][measure.key] = _figure(plain, drawn, index, other)
    return table


def _figure(plain: list[float], drawn: list[NDArray[np.float64]], index: int, other: int | None) -> Figure:
    value = _ablation_figures_number(plain[index])
    if other is None:
        return Figure(value)
    difference = _ablation_figures_number(plain[index] - plain[other])
    differences = drawn[index] - drawn[other]
    defined = differences[np.isfinite(differences)]
    if difference is None or len(defined) < MIN_DEFINED * len(differences):
        return Figure(value, difference)
    low, high = np.percentile(defined, (2.5, 97.5))
    return Figure(value, difference, float(low), float(high))


def _ablation_figures_number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def are_enough(groups: Sequence[Hashable]) -> bool:
    """Whether there are groups enough for intervals."""
    return len(set(groups)) >= MIN_GROUPS


def draw_weights(groups: Sequence[Hashable], seed: int, resamples: int = RESAMPLES) -> NDArray[np.int64]:
    """How often each frame is in each bootstrap resample of whole groups, shape (resamples, frames)."""
    place = {name: index for index, name in enumerate(dict.fromkeys(groups))}
    member = np.array([place[group] for group in groups], np.int64)
    count = int(member.max(initial=-1)) + 1
    if count == 0:
        return np.zeros((resamples, 0), np.int64)
    drawn = np.random.default_rng(seed).multinomial(count, np.full(count, 1.0 / count), size=resamples)
    return np.asarray(drawn[:, member], np.int64)


def estimate(values: NDArray[np.float64], weights: NDArray[np.int64], quantile: float | None) -> NDArray[np.float64]:
    """Mean or quantile of `values` (N,) repeated as often as each row of `weights` (B, N) says; NaN values are left out.

    The quantile is the one of ``numpy.quantile`` on the repeated values. Shape (B,); NaN where a row holds no value.
    """
    known = np.isfinite(values)
    values, weights = values[known], weights[:, known]
    total = weights.sum(axis=1)
    result = np.full(len(weights), np.nan)
    some = total > 0
    if not some.any():
        return result
    if quantile is None:
        result[some] = (weights[some] @ values) / total[some]
        return result
    order = np.argsort(values, kind="stable")
    values, upto = values[order], np.cumsum(weights[some][:, order], axis=1)
    position = quantile * (total[some] - 1)
    below = np.floor(position).astype(np.int64)
    above = np.minimum(below + 1, total[some] - 1)
    first, second = (values[(upto <= rank[:, None]).sum(axis=1)] for rank in (below, above))
    result[some] = first + (position - below) * (second - first)
    return result


def _column(scores: Sequence[FrameScore], of: str) -> NDArray[np.float64]:
    """One value per frame; NaN where the frame says nothing about it."""
    return np.array([_value(score, of) for score in scores], np.float64)


def _value(score: FrameScore, of: str) -> float:
    if of == "answered":
        return float(score.answered)
    if score.theta_error_deg is None or score.head_error_px is None:
        return np.nan
    theta, head = abs(score.theta_error_deg), score.head_error_px
    wrong = theta > WRONG_DEG or head > WRONG_PX
    return float({"theta": theta, "head": head, "agreed": score.state == score.true_state, "wrong": wrong}[of])


def refusals(scores: Sequence[FrameScore]) -> dict[str, int]:
    """How often each reason was given for no answer, where the truth has a pose."""
    counted: dict[str, int] = {}
    for score in scores:
        if score.expected and score.reason is not None:
            counted[score.reason.value] = counted.get(score.reason.value, 0) + 1
    return dict(sorted(counted.items(), key=lambda item: (-item[1], item[0])))


def frame_rows(variants: Sequence[Variant], scores: Sequence[Sequence[FrameScore]]) -> list[dict[str, Any]]:
    """What each variant found in each frame, as plain rows for a CSV."""
    return [
        {
            "stem": score.stem,
            "variant": variant.name,
            "theta_error_deg": score.theta_error_deg,
            "head_error_px": score.head_error_px,
            "state": score.state,
            "true_state": score.true_state,
            "confidence": score.confidence if score.answered else None,
            "reason": score.reason.value if score.reason is not None else None,
        }
        for variant, row in zip(variants, scores, strict=True)
        for score in row
    ]


_MINUS = "\N{MINUS SIGN}"
_CUMULATIVE, _WITHOUT = "each step added to the ones above", "ours without one step"
_STREAM_COLUMNS = (
    ("frames", "frames"),
    ("answered_share", "answered"),
    ("state_agreement", "state agrees"),
    ("theta_median_deg", "theta median, deg"),
    ("theta_mean_deg", "theta mean, deg"),
    ("head_median_px", "head median, px"),
    ("wrong_share", "wrong"),
    ("swapped_frames", "head-tail swaps"),
    ("jumps", f"jumps > {JUMP_PX:.0f} px"),
    ("theta_lag_frames", "theta lag, frames"),
    ("theta_jitter_deg", "theta jitter, deg"),
    ("head_jitter_px", "head jitter, px"),
    ("state_changes", "state changes"),
    ("true_state_changes", "true changes"),
)


def value_table(result: dict[str, Any]) -> Table:
    """One row per variant, one column per measure."""
    table = Table(title=_title(result), caption=None if not result.get("interrupted") else "interrupted: not all frames of the set")
    for title in _headings():
        table.add_column(title, justify="left" if title == "variant" else "right", no_wrap=title == "variant")
    for row, cells in _with_cells(result, lambda figure, measure: _number(figure.value, measure)):
        table.add_row(row["name"], *cells, f"{row['after_network_ms']:.1f}" if "after_network_ms" in row else "-")
        if _ends_part(result, row):
            table.add_section()
    return table


def difference_table(result: dict[str, Any]) -> Table:
    """What each step changed, with its interval; a star where the interval leaves out zero."""
    caption = "difference to the row before, or to ours; below it its 95 % bootstrap interval; * zero lies outside it; = the same"
    table = Table(title=f"differences, drawn: {result['drawn']}", caption=caption)
    for title in _headings()[:-1]:
        table.add_column(title, justify="left" if title == "variant" else "right", no_wrap=title == "variant")
    for row, cells in _with_cells(result, _difference):
        if row.get("compared_with") is not None:
            table.add_row(row["name"], *cells)
        if _ends_part(result, row):
            table.add_section()
    return table


def stream_table(stream: dict[str, Any]) -> Table:
    """Errors and steadiness in a stream, one row per variant."""
    table = Table(title=f"streams of {stream['frames_each']} frames in each of: {', '.join(stream['phantoms'])}")
    table.add_column("variant", no_wrap=True)
    for _, title in _STREAM_COLUMNS:
        table.add_column(title, justify="right")
    for row in stream["rows"]:
        table.add_row(row["name"], *_stream_cells(row["figures"]))
    return table


def markdown(result: dict[str, Any]) -> str:
    """All tables for a document."""
    parts = []
    if "rows" in result:
        brackets = f"the difference to the row before (below: to ours) and its 95 % bootstrap interval over {result['drawn']}"
        parts.append(f"{_title(result)}; in brackets {brackets}; * zero lies outside it.\n")
        parts.append(_markdown_table(_headings(), [_full_row(row) for row in result["rows"]]))
    if result.get("stream"):
        stream = result["stream"]
        phantoms = ", ".join(stream["phantoms"])
        parts.append(f"Streams of the twin, {stream['frames_each']} frames in each of: {phantoms} ({result['masks']}).\n")
        rows = [[row["name"], *_stream_cells(row["figures"])] for row in stream["rows"]]
        parts.append(_markdown_table(["variant", *(title for _, title in _STREAM_COLUMNS)], rows))
    return "\n".join(parts)


def _title(result: dict[str, Any]) -> str:
    without = f", {result['left_out']} frames left out that cannot be read" if result.get("left_out") else ""
    return f"{result['set']}: {result['expected']} frames with a pose{without}; the same masks for all rows ({result['masks']})"


def _headings() -> list[str]:
    return ["variant", *(measure.title + (", %" if measure.is_share else "") for measure in MEASURES), "ms after network"]


def _with_cells(result: dict[str, Any], show: Any) -> list[tuple[dict[str, Any], list[str]]]:
    """Each row with its cells; a row without numbers has its note in the first cell."""
    rows = []
    for row in result["rows"]:
        if "figures" in row:
            cells = [show(Figure(**row["figures"][measure.key]), measure) for measure in MEASURES]
        else:
            cells = ["needs a stream", *["-"] * (len(MEASURES) - 1)]
        rows.append((row, cells))
    return rows


def _full_row(row: dict[str, Any]) -> list[str]:
    if "figures" not in row:
        return [row["name"], row["note"], *[""] * len(MEASURES)]
    cells = []
    for measure in MEASURES:
        figure = Figure(**row["figures"][measure.key])
        change = _difference(figure, measure).replace("\n", ", ")
        cells.append(_number(figure.value, measure) + (f" ({change})" if change not in ("-", "=") else ""))
    return [row["name"], *cells, f"{row['after_network_ms']:.1f}"]


def _markdown_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [headings, ["---"] * len(headings), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _ends_part(result: dict[str, Any], row: dict[str, Any]) -> bool:
    following = result["rows"][result["rows"].index(row) + 1 :]
    return bool(following) and following[0]["kind"] != row["kind"]


def _number(value: float | None, measure: AblationColumn, *, signed: bool = False) -> str:
    if value is None:
        return "-"
    shown = f"{100.0 * value:{'+' if signed else ''}.1f}" if measure.is_share else f"{value:{'+' if signed else ''}.2f}"
    return shown.replace("-", _MINUS)


def _difference(figure: Figure, measure: AblationColumn) -> str:
    if figure.difference is None:
        return "-"
    if figure.difference == figure.low == figure.high == 0.0:
        return "="
    star = "*" if figure.is_clear else ""
    low, high = (_number(value, measure, signed=True) for value in (figure.low, figure.high))
    return f"{_number(figure.difference, measure, signed=True)}{star}\n{low} to {high}"


def _stream_cells(figures: dict[str, Any]) -> list[str]:
    cells = []
    for key, _ in _STREAM_COLUMNS:
        value = figures[key]
        if value is None:
            cells.append("-")
        elif key in ("answered_share", "state_agreement", "wrong_share"):
            cells.append(f"{100.0 * value:.1f} %")
        else:
            cells.append(f"{value:.2f}".replace("-", _MINUS) if isinstance(value, float) else str(value))
    return cells


ALONE = "needs a stream: each frame of the set stands alone (measure it with --sequence N)"
_WIDTH = 170
"""Columns of the tables where the output is no terminal."""


class AblationError(UserError):
    """The ablation cannot be run; the message is one line and says what to do."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What to run. ``folder`` and ``sequence`` (frames of the twin) may each be missing; ``phantoms`` empty: all named ones."""

    folder: Path | None
    model: str | None = None
    config_path: Path | None = None
    true_masks: bool = False
    sequence: int = 0
    phantoms: tuple[str, ...] = ()
    seed: int = 0
    out: Path | None = None


def run_ablation(plan: Plan, *, as_json: bool) -> None:
    """Run it and print the tables; raises UserError. An interruption (Ctrl-C) prints what was measured until then."""
    from core.perception.pipeline import open_pipeline

    if plan.folder is None and not plan.sequence:
        raise AblationError("nothing to measure on: give a labelled set (as synth writes it), --sequence N, or both")
    overrides = choose_model(plan.model)
    ours = load_config(plan.config_path, None, overrides).perception
    paper = load_config(plan.config_path, "paper", overrides).perception
    samples, truth = _labelled(plan.folder) if plan.folder is not None else ([], {})
    phantoms = _known_phantoms(plan.phantoms)
    _make_folder(plan.out)
    masks, pipeline_of = _open_masks(ours, plan.true_masks)
    source = "true masks" if plan.true_masks else f"model {ours.segmentation.model}, {masks.engine}"
    result: dict[str, Any] = {"set": name_as_text(plan.folder) if plan.folder else None, "masks": source, "seed": plan.seed}
    interrupted, frames = False, []
    if samples:
        variants = make_variants(paper, ours, [step for step in STEPS if step.name != TRACKING])
        pipelines = [pipeline_of(variant.config) for variant in variants]
        left_out = LeftOut()
        scores, latency_ms, interrupted = _measure_set(samples, truth, pipelines, masks, ours.working_size_px, left_out)
        groups = [truth[score.stem].get("seed", score.stem) for score in scores[0]]
        result |= _described(variants, scores, latency_ms, groups, plan.seed) | {"left_out": len(left_out)}
        frames = frame_rows(variants, scores)
    if plan.sequence and not interrupted:
        named = {variant.name: variant.config for variant in make_variants(paper, ours)}
        chosen = {name: named[name] for name in (PAPER, f"{OURS} without {TRACKING}")} | {OURS: ours}
        result["stream"], interrupted = measure_streams(
            chosen,
            pipeline_of,
            masks,
            live=None if plan.true_masks else open_pipeline(ours),
            frames=plan.sequence,
            phantoms=phantoms,
            seed=plan.seed,
        )
    result["interrupted"] = interrupted
    try:
        _tell(result, as_json)
    finally:  # neither costs the other
        if plan.out is not None:
            _write(result, frames, plan.out)
    if interrupted:
        raise KeyboardInterrupt


def _labelled(folder: Path) -> tuple[list[Sample], dict[str, dict[str, Any]]]:
    from core.learning.dataset import POSE_KEYS, DatasetError, find_labelled

    samples, truth = find_labelled(folder, POSE_KEYS)
    if all(truth[sample.stem].get("state") is None for sample in samples):
        raise DatasetError(f"{folder}: no frame of truth.jsonl has a pose; nothing can be compared")
    return samples, truth


def _known_phantoms(names: tuple[str, ...]) -> tuple[str, ...]:
    from hardware.twin.phantom import PHANTOM_TITLES

    for name in names:
        if name not in PHANTOM_TITLES:
            raise AblationError(f"unknown phantom {name!r}; known: {', '.join(PHANTOM_TITLES)}")
    return names or tuple(PHANTOM_TITLES)


def _make_folder(out: Path | None) -> None:
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise AblationError(f"{out}: cannot be made ({error.strerror}); choose another --out") from None


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
    pipelines: Sequence[Pipeline],
    masks: SameMasks,
    working_size_px: int,
    left_out: LeftOut,
) -> tuple[list[list[FrameScore]], list[list[float]], bool]:
    """For each pipeline the scores of all frames and the milliseconds after the network, and whether it was interrupted."""
    from core.learning.dataset import DatasetError
    from core.perception.segmentation import to_working

    scores: list[list[FrameScore]] = [[] for _ in pipelines]
    latency_ms: list[list[float]] = [[] for _ in pipelines]
    interrupted = False
    with progress_bar() as bar:
        try:
            for sample in bar.track(samples, description=f"frames x {len(pipelines)} variants"):
                try:
                    image, *true = sample.load()
                except DatasetError as error:
                    left_out.add(error)
                    continue
                masks.next_frame(true[0], true[1])
                vessel, robot = (to_working(mask.astype(np.uint8) * 255, working_size_px)[0] > 127 for mask in true)
                for place, pipeline in enumerate(pipelines):
                    scene = pipeline.perceive_single(Frame(0, 0.0, image))
                    scores[place].append(score_frame(sample.stem, scene, vessel, robot, truth[sample.stem]))
                    spent = scene.latency_ms
                    latency_ms[place].append(spent["total"] - spent.get("prepare", 0.0) - spent.get("network", 0.0))
        except KeyboardInterrupt:
            interrupted = True
    count = len(latency_ms[-1])  # an interruption leaves the last frame with some of the pipelines only
    has_pose = any(score.expected for score in scores[-1][:count])
    if interrupted and not has_pose:
        raise KeyboardInterrupt
    left_out.tell(count)
    if not has_pose:
        raise AblationError("no frame with a pose can be read; nothing can be compared")
    return [row[:count] for row in scores], [row[:count] for row in latency_ms], interrupted


def _described(
    variants: Sequence[Variant],
    scores: Sequence[Sequence[FrameScore]],
    latency_ms: Sequence[Sequence[float]],
    groups: Sequence[Any],
    seed: int,
) -> dict[str, Any]:
    table = figures(scores, [variant.compared_with for variant in variants], groups, seed)
    rows: list[dict[str, Any]] = []
    for place, variant in enumerate(variants):
        row: dict[str, Any] = {"name": variant.name, "kind": variant.kind}
        row["compared_with"] = None if variant.compared_with is None else variants[variant.compared_with].name
        row["figures"] = {key: figure.to_json() for key, figure in table[place].items()}
        row["after_network_ms"] = float(np.median(latency_ms[place]))
        row["refused"] = refusals(scores[place])
        rows.append(row)
    last = next(place for place, row in enumerate(rows) if row["kind"] == "without")
    rows.insert(last, {"name": f"+ {TRACKING}", "kind": "cumulative", "note": ALONE})
    rows.append({"name": f"{OURS} without {TRACKING}", "kind": "without", "note": ALONE})
    expected = [group for group, score in zip(groups, scores[0], strict=True) if score.expected]
    drawn = f"{len(set(expected))} phantoms{'' if are_enough(expected) else ' (too few for intervals)'}"
    return {"frames": len(scores[0]), "expected": len(expected), "drawn": drawn, "rows": rows}


def _tell(result: dict[str, Any], as_json: bool) -> None:
    if as_json:
        sys.stdout.write(json.dumps(result, allow_nan=False) + "\n")
    else:
        console = Console(markup=False, emoji=False) if sys.stdout.isatty() else Console(width=_WIDTH, markup=False, emoji=False)
        if "rows" in result:
            console.print(value_table(result), difference_table(result))
        if result.get("stream"):
            console.print(stream_table(result["stream"]))


def _write(result: dict[str, Any], frames: list[dict[str, Any]], out: Path) -> None:
    try:
        (out / "ablation.json").write_text(json.dumps(result, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        (out / "ablation.md").write_text(markdown(result), encoding="utf-8")
    except OSError as error:
        raise AblationError(f"{out}: cannot be written ({error.strerror}); choose another --out") from None
    if frames:
        _write_frames(out / "ablation_frames.csv", frames)


def _write_frames(path: Path, rows: list[dict[str, Any]]) -> None:
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(row | {"stem": name_as_text(row["stem"])} for row in rows)
    except OSError as error:
        raise AblationError(f"{path}: cannot be written ({error.strerror}); choose another --out") from None


def main(
    labelled: Annotated[Path | None, typer.Argument(metavar="SET", help="labelled set as synth writes it")] = None,
    json: JsonOption = False,
    out: Annotated[Path | None, typer.Option(help="folder for ablation.json, ablation.md and ablation_frames.csv")] = None,
    true_masks: Annotated[bool, typer.Option("--true-masks", help="the true masks instead of the network's")] = False,
    sequence: Annotated[int, typer.Option(min=0, max=100_000, help="also measure streams, of so many frames of the twin")] = 0,
    phantom: Annotated[list[str] | None, typer.Option(help="named phantom of these frames; default: all, in turn")] = None,
    seed: Annotated[int, typer.Option(min=0, help="of the bootstrap and of the twin")] = 0,
    model: ModelOption = None,
    config: ConfigOption = None,
) -> None:
    """What each step is worth: from the paper taken literally to ours, on the same masks of the same frames.

    And, in streams, perception as the window has it, which looks for itself.
    """
    check_masks(model, true_masks=true_masks)
    plan = Plan(labelled, model, config, true_masks, sequence, tuple(phantom or ()), seed, out)
    run_ablation(plan, as_json=json)


if __name__ == "__main__":
    typer.run(main)
