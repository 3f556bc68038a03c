"""A scripted hand outlines vessels: events and Dice of the annotator's tube and region tools.

``python -m tools.outline_hand --benches FOLDER --out DIR`` outlines the empty picture of each bench in a folder, and phantoms of
the twin with four branches, from an empty start and from the network's proposal, and writes pictures of the result. The hand knows
the true mask's centerlines and widths; its places and widths are off by 1.5 px (standard deviation). An event is a drag, a click, a
notch of the wheel, or a key.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Annotated

import cv2
import numpy as np
import typer

from app.annotator.editing import RADIUS_NOTCH
from core import geometry
from core.annotation.masks import polygons_of
from core.annotation.model import Annotation, MaskTarget
from core.annotation.outline import VesselOutline
from core.annotation.tube import drawn_tube
from core.config.models import CleaningConfig, PerceptionConfig
from core.files import read_image
from core.learning.dataset import write_png
from core.perception import skeleton
from core.perception.vessel_graph import build_graph
from core.types import Frame, Image, Mask, Point, Points, VesselGraph
from tools.run import run_tool

NOISE_PX = 1.5
_WOBBLE_PX = 15.0
"""Length over which the hand's error along a drag stays alike."""
_START_RADIUS_PX = 12.0
_TURN_NOTCHES = 1.2
"""The hand turns the wheel when the width is off by more than this."""
_EVENT_LIMIT = 40
_GOOD_DICE = 0.95
"""Corrections end here."""
_TWIN_SEEDS = (7002, 7003, 7004, 7011, 7015, 7018)
"""Random phantoms with four ends."""
_TWIN_LOOKS = ("bench", "silicone_white", "backlit", "drape", "resin", "fluoroscopy")


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A vessel from one end to a junction or another end: ``points`` (N, 2) and true ``radius`` (N,)."""

    points: Points
    radius: np.ndarray


def dice(a: Mask, b: Mask) -> float:
    """Overlap of two masks, 1 for equal ones."""
    return 2.0 * float((a & b).sum()) / max(float(a.sum() + b.sum()), 1.0)


def true_lines(mask: Mask) -> list[Line]:
    """The centerlines of a mask, the longest way through it first, then its branches, each from what is there outwards."""
    thin = skeleton.without_spurs(skeleton.thin(mask), mask)
    graph = build_graph(thin, mask, CleaningConfig())
    left, reached, lines = set(range(len(graph.edges))), set[int](), list[Line]()
    while left:
        found = max(
            (_longest_way(graph, node, left, reached) for node in reached or range(len(graph.nodes))),
            key=lambda way: sum(_length(graph, edge) for edge, _ in way),
            default=[],
        )
        if not found:
            reached = set()  # another tree of the same picture
            continue
        parts = [(graph.edges[edge].points[::step], graph.edges[edge].radius[::step]) for edge, step in found]
        lines.append(Line(np.concatenate([points for points, _ in parts]), np.concatenate([radius for _, radius in parts])))
        for edge, _ in found:
            left.discard(edge)
            reached |= {graph.edges[edge].start, graph.edges[edge].end}
    return lines


def _length(graph: VesselGraph, edge: int) -> float:
    return float(geometry.arc_length(graph.edges[edge].points)[-1])


def _longest_way(graph: VesselGraph, node: int, left: set[int], reached: set[int]) -> list[tuple[int, int]]:
    """The longest way from a node over edges of `left`, as edges and directions; it ends where it meets `reached`."""
    best: list[tuple[int, int]] = []
    best_px = 0.0
    for edge in left:
        start, end = graph.edges[edge].start, graph.edges[edge].end
        for step, here, there in ((1, start, end), (-1, end, start)):
            if here == node:
                onward = [] if there in reached else _longest_way(graph, there, left - {edge}, reached)
                length = _length(graph, edge) + sum(_length(graph, other) for other, _ in onward)
                if length > best_px:
                    best, best_px = [(edge, step), *onward], length
    return best


class ScriptedHand:
    """Draws on an outline, and counts its input events."""

    def __init__(self, outline: VesselOutline, truth: Mask, seed: int = 0) -> None:
        self.outline, self._truth = outline, truth
        self._random = np.random.default_rng(seed)
        self.radius_px = _START_RADIUS_PX
        self.events = 0
        self.slowest_s = 0.0
        """Processor time of the slowest gesture."""

    def draw_all(self) -> None:
        """A drag along every vessel."""
        for line in true_lines(self._truth):
            self._drag(line)

    def correct(self) -> None:
        """Mend the worst fault again and again, until the outline is good or there were too many events.

        A vessel that lacks more than any one place is dragged along, once. A proposal that has far too much is begun again. What
        makes it worse is undone; such a click ends the corrections.
        """
        lines = true_lines(self._truth)
        mask = self.outline.mask
        too_much, too_little = int((mask & ~self._truth).sum()), int((self._truth & ~mask).sum())
        if not self.events and dice(mask, self._truth) < _GOOD_DICE and too_much > too_little:
            self.events += 1
            self.outline.edit("clear", Annotation())
            self.draw_all()
            lines = []
        helps = True
        while helps and self.events < _EVENT_LIMIT and dice(self.outline.mask, self._truth) < _GOOD_DICE:
            mask = self.outline.mask
            missing, surplus = self._truth & ~mask, mask & ~self._truth
            fault, erase = max(((_largest(missing), False), (_largest(surplus), True)), key=lambda one: int(one[0].sum()))
            lacking = [int((drawn_tube(line.points, line.radius).area(self.outline.size) & missing).sum()) for line in lines]
            if lacking and max(lacking) > fault.sum():
                self._drag(lines.pop(int(np.argmax(lacking))))
                if dice(self.outline.mask, self._truth) < dice(mask, self._truth):
                    self.outline.undo()
                    self.events += 1
                continue
            depth = cv2.distanceTransform(np.pad(fault.view(np.uint8), 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
            row, column = divmod(int(depth.argmax()), depth.shape[1])
            self._click((column, row), float(depth.max()), erase=erase)
            helps = dice(self.outline.mask, self._truth) > dice(mask, self._truth)
            if not helps:
                self.outline.undo()
                self.events += 1

    def _turn_wheel(self, radius_px: float, most_off: float) -> None:
        off = math.log(radius_px / self.radius_px) / math.log(RADIUS_NOTCH)
        if abs(off) > most_off:
            self.radius_px *= RADIUS_NOTCH ** round(off)
            self.events += abs(round(off))

    def _drag(self, line: Line) -> None:
        points = geometry.resample(line.points, 3.0)
        count = len(points)
        places = np.linspace(0.0, 1.0, count)
        radius = np.interp(places, np.linspace(0.0, 1.0, len(line.radius)), line.radius)
        radius = np.maximum(radius + 0.5 * NOISE_PX * self._random.normal(), 3.0)
        along = geometry.arc_length(points)
        for end in (along, along[-1] - along):  # in a junction, or a corner at the border, there is no width to be seen
            near = end < 1.2 * radius[int(end.argmin())]
            if near.any() and not near.all():
                radius[near] = radius[~near][int(end[~near].argmin())]
        kernel = cv2.getGaussianKernel(61, _WOBBLE_PX / 3.0).ravel()
        wobble = np.stack([np.convolve(axis, kernel, "valid") for axis in self._random.normal(size=(2, count + 60))], axis=1)
        stroke = points + wobble * (NOISE_PX / float(np.sqrt((kernel**2).sum())))
        drawn = np.zeros(count)
        for place in range(count):
            self._turn_wheel(float(radius[place]), _TURN_NOTCHES if place else 0.5)
            drawn[place] = self.radius_px
        self.events += 1
        begin = process_time()
        self.outline.add_tube(stroke, drawn)
        self.slowest_s = max(self.slowest_s, process_time() - begin)

    def _click(self, point: Point, radius_px: float, *, erase: bool) -> None:
        self._turn_wheel(max(radius_px, 3.0), 2.0)
        x, y = (point + self._random.normal(size=2) * min(NOISE_PX, 0.3 * radius_px)).tolist()
        self.events += 1
        begin = process_time()
        self.outline.click_region((x, y), self.radius_px, erase=erase)
        self.slowest_s = max(self.slowest_s, process_time() - begin)


def _largest(mask: Mask) -> Mask:
    """The largest component."""
    count, parts, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8))
    return parts == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax()) if count > 1 else mask


def _bench_pictures(folder: Path) -> Iterator[tuple[str, Image, Mask]]:
    for truth in sorted(folder.glob("*/truth.json")):
        frames = json.loads(truth.read_text(encoding="utf-8"))["frames"]
        frame = next(frame for frame in frames if frame["use"] == "empty")
        mask = cv2.imread(str(truth.parent / frame["vessel_mask"]), cv2.IMREAD_GRAYSCALE)
        yield truth.parent.name, read_image(truth.parent / frame["image"]), np.asarray(mask) > 127


def twin_picture(seed: int, look: str) -> tuple[Image, Mask]:
    """An empty bench of the twin, and its true mask."""
    from hardware.twin.phantoms import make_phantom
    from hardware.twin.rendering.appearance import named_appearance
    from hardware.twin.rendering.renderer import Renderer

    rendered = Renderer(make_phantom(f"random:{seed}"), named_appearance(look, seed), (640, 480), seed).render(None)
    return rendered.image, rendered.vessel


def _write_picture(path: Path, image: Image, truth: Mask, outline: Mask) -> None:
    """The picture twice as large, with the true outline in green and the drawn one in red."""
    shown = cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
    for mask, colour in ((truth, (0, 220, 0)), (outline, (255, 40, 40))):
        for polygon in polygons_of(mask, MaskTarget.VESSEL, 0.0):
            points = np.round((np.array(polygon.points) + 0.5) * 2 - 0.5).astype(np.int32)
            cv2.polylines(shown, [points], True, colour, 1, cv2.LINE_AA)
    write_png(path, shown)


def outline_hand(
    benches: Annotated[Path | None, typer.Option(help="folder of benches with truth.json; without it the twin alone")] = None,
    out: Annotated[Path | None, typer.Option(help="folder for pictures of the results")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="hands per picture")] = 1,
    as_json: Annotated[bool, typer.Option("--json")] = False,
) -> None:
    """Outline vessels by a scripted hand, from nothing and from the network's proposal."""
    from core.perception.pipeline import open_pipeline

    pipeline = open_pipeline(PerceptionConfig())
    pictures = list(_bench_pictures(benches)) if benches is not None else []
    pictures += [(f"twin {seed} {look}", *twin_picture(seed, look)) for seed, look in zip(_TWIN_SEEDS, _TWIN_LOOKS, strict=True)]
    for name, image, truth in pictures:
        scene = pipeline.perceive_single(Frame(0, 0.0, image))
        proposal = scene.masks.vessel if scene.masks is not None else None
        for begin in (None, proposal):
            for seed in range(seeds):
                hand = ScriptedHand(VesselOutline(image, begin), truth, seed)
                before = dice(hand.outline.mask, truth)
                if begin is None:
                    hand.draw_all()
                drawn = dice(hand.outline.mask, truth), hand.events
                hand.correct()
                mask, start = hand.outline.mask, "empty" if begin is None else "proposal"
                row = {"picture": name, "start": start, "seed": seed, "dice_before": round(before, 3)}
                row |= {"dice_drawn": round(drawn[0], 3), "events_drawn": drawn[1]}
                row |= {"dice": round(dice(mask, truth), 3), "events": hand.events, "slowest_ms": round(1e3 * hand.slowest_s)}
                typer.echo(json.dumps(row) if as_json else "  ".join(f"{key} {value}" for key, value in row.items()))
                if out is not None and seed == 0:
                    out.mkdir(parents=True, exist_ok=True)
                    _write_picture(out / f"{name.replace(' ', '_')}_{start}.png", image, truth, mask)


if __name__ == "__main__":
    run_tool(outline_hand)
