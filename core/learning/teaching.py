"""Frames that teach a bench: picked from a stream, with robot masks by difference to the empty bench, checked, and split.

A window or a command does it in steps: ``FrameSelection`` takes the pictures of a stream and keeps diverse ones, ``propose`` makes
the masks of each, ``check`` rejects those that are not plausible, ``choose`` picks the most diverse of the rest and holds a quarter
out, and ``write_teaching_set`` writes them for the training. Between ``check`` and ``choose`` a person may reject and correct.
"""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from core.bench.bench import BESIDE_PX, Bench, reachable, read_bench, write_bench
from core.bench.difference import beside_network, combined, disagreement, distance_to_empty, robot_by_difference, without_rim
from core.bench.registration import lab_of, register
from core.config.section import first_problem
from core.devices import UserError
from core.files import write_atomic
from core.learning.dataset import IMAGE_ENDINGS, DatasetError, Sample, png, sample_at, write_mask, write_png
from core.messages import message
from core.perception.segmentation import Probability
from core.types import Image, Mask, Refusal

MASKS_VERSION = 2
"""Of what ``propose`` makes. Raise it when that, the registration or the difference changes: kept masks are made again."""
Segment = Callable[[Image], tuple[Probability, Probability]]
"""Vessel and robot probabilities, float32 (h, w) each, of a picture (h, w, 3)."""
FEWEST = 8
"""Frames that a bench is taught with, at least: six to learn from and two held out."""
HELD_OUT_SHARE = 4
"""One of so many frames is held out."""
_SPARE = 12
"""Pictures that are kept beside twice the frames that are wanted: some are rejected."""
_QUICK_PX = 160
"""Longer side at which pictures of a stream are compared."""
_QUICK_CONTRAST = 0.06
"""Change of a pixel's logarithmic brightness beyond that of its surroundings that shows a robot in a small picture."""
_SAME_SHARE = 0.04
"""Distance of two small pictures' robots (0..1) below which they are near-duplicates."""
_MOVED_SHARE = 0.35
"""Share of the vessel that a camera changes when it is moved by more than some pixels; pictures that change more are registered."""
_STILL_SHARE = 0.15
"""Distance of the two most different robots below which it has not moved."""
_SHADE = 8.0
"""Added to grey levels before their logarithm: noise in dark places counts less."""

MOST_COMPONENTS, LARGEST_SHARE = 4, 0.45
"""A robot's mask has no more components, and the largest one has this share of its area."""
LEAST_INSIDE, INSIDE_MARGIN_PX = 0.6, 4
"""Share of a robot's mask that lies in the vessel, widened by the margin."""
_SPECK_SHARE = 0.05
"""A component of the robot's mask with a smaller share of its area is left out."""
_CELL_PX, _KNOWN_SHARE = 40, 0.5
"""Side of a cell in which structure is compared, and the share of it that must be known."""
_STRONG_SHARE, _LEAST_STRUCTURE = 0.9, 0.009
"""In a cell the strongest tenth of the pixels counts, where its structure is such a share of the brightness."""
_NOISE_TIMES = 1.5
"""And where it exceeds the noise in brightness so many times: the noise that is left in an empty picture is no structure."""
_HIDDEN, _MOST_HIDDEN = 0.4, 0.12
"""A cell with less than this share of the focus is hidden; share of the cells: at most 0.07 in 80 frames of four benches with
robots, glare, shadows and cables, above 0.2 with a hand in them."""
_WIDTHS = (0.4, 2.2)
"""Width of a robot against the median of all frames."""
_LARGEST_AREA = 3.5
"""Area of a robot against the median of all frames; the smallest is a matter of how far it was inserted."""
_LEAST_AREA_PX = 120
"""Of a robot: 40 px of length, which its direction needs, 3 px wide."""
_ENTRY_SHARE, _BORDER_PX = 0.6, 6
"""Where so many frames have the robot, all must have it: within this distance from the border it enters there."""
_INNER = np.s_[_BORDER_PX:-_BORDER_PX, _BORDER_PX:-_BORDER_PX]
_ENTRY_REACH_PX = 12
"""Distance from there within which a robot's mask must begin."""
_WAY_PX, _WAY_RIM_PX = 15, 6
"""Half the width of the robot's way from the picture's border, and by how much what is not known there begins before its end."""
_LEAST_FOCUS = 0.3
"""Fine structure of a frame against the empty picture's."""
_MOST_DOUBT = 0.6
"""Share of the robot's mask that may be doubtful."""
_GHOST_SHARE, _GHOST_PX = 0.9, 60
"""Share of the frames in which an area of the vessel, of this size at least, differs from the empty picture: all or none of them
has the robot there."""
_GONE_LEVELS = 14.0
"""Grey levels of Lab by which a place differs where something lay on the empty bench."""
_STATE = "teaching.json"
_REJECTED = "rejected"
_NETWORK = "network"


class TeachingError(UserError):
    """The pictures do not teach a bench; the message is one line and says what to do."""


@dataclass(frozen=True, slots=True, eq=False)
class TeachingPicture:
    """A picture of a stream at working size, RGB uint8 (h, w, 3), with its name for people and a unique stem for files."""

    name: str
    stem: str
    image: Image


@dataclass(frozen=True, slots=True, eq=False)
class TeachingFrame:
    """A frame with its masks, bool (h, w).

    Attributes
    ----------
    picture : the frame.
    vessel, robot : masks; the vessel is the bench's, moved as the camera was.
    doubtful : where the robot's mask is unsure: it is not trained on there.
    focus, hidden_share : how much structure of the bench is seen, and the share of it that is hidden (``structure_of``).
    reason : why the frame is rejected; empty: it is not.
    is_held_out : it is not trained on.
    differs : where the frame shows something else than the empty picture; None: not compared.
    """

    picture: TeachingPicture
    vessel: Mask
    robot: Mask
    doubtful: Mask
    focus: float = 1.0
    hidden_share: float = 0.0
    reason: str = ""
    is_held_out: bool = False
    differs: Mask | None = None

    @property
    def doubtful_share(self) -> float:
        """Of the robot's area."""
        return float((self.doubtful & self.robot).sum() / max(1, self.robot.sum()))


class FrameSelection:
    """Keeps diverse pictures of a stream: near-duplicates are skipped, and of too many the most different stay.

    The `bench` has an empty picture. Some more than `count` frames are kept, because some will be rejected.
    """

    def __init__(self, bench: Bench, count: int) -> None:
        self._bench = bench
        self._empty = _small_logarithm(bench.empty)
        near = np.ones(bench.known.shape, bool) if bench.vessel is None else _widened(bench.vessel, 2 * INSIDE_MARGIN_PX)
        self._near = _small(near.astype(np.uint8)) > 0
        self._room = 2 * count + _SPARE
        self._kept: list[tuple[TeachingPicture, NDArray[np.float32]]] = []
        self.seen = 0
        """Pictures that were added."""
        self.refused: list[TeachingFrame] = []
        """The first pictures that are of another bench, or taken after the camera was moved."""

    def add(self, picture: TeachingPicture) -> bool:
        """Whether it is kept for now; raises ValueError for a picture of another size than the bench's."""
        robot = self._quick_robot(picture.image)
        self.seen += 1
        if robot.sum() > _MOVED_SHARE * self._near.sum() and isinstance(refusal := register(picture.image, self._bench), Refusal):
            if len(self.refused) < self._room:
                self.refused.append(_rejected(picture, str(refusal)))
            return False
        if any(_distance(robot, other) < _SAME_SHARE for _, other in self._kept[-self._room :]):
            return False
        self._kept.append((picture, robot))
        if len(self._kept) >= 2 * self._room:
            self._kept = [self._kept[index] for index in sorted(farthest([one for _, one in self._kept], self._room))]
        return True

    def pictures(self) -> list[TeachingPicture]:
        """The pictures kept, in their order.

        Raises TeachingError: there are no pictures, they are of another bench, or the robot lies still in all of them.
        """
        if not self._kept:
            if self.refused:
                first = self.refused[0]
                raise TeachingError(f"the empty picture does not fit {first.picture.name}: {first.reason}")
            raise TeachingError("no picture shows the bench: give a session, a video or a folder of pictures of it")
        robots = [robot for _, robot in self._kept]
        if max(_distance(robots[0], other) for other in robots) < _STILL_SHARE:
            if isinstance(refusal := register(self._kept[0][0].image, self._bench), Refusal):
                raise TeachingError(f"the empty picture does not fit {self._kept[0][0].name}: {refusal}")
            raise TeachingError(f"the robot never moves in {self.seen} pictures: move it through all branches, and bend it")
        chosen = sorted(farthest(robots, self._room))
        return [self._kept[index][0] for index in chosen]

    def _quick_robot(self, image: Image) -> NDArray[np.float32]:
        """Blurred robot of a small picture, (h, w) 0..1: what changes beyond its surroundings, as shadows do not."""
        change = _small_logarithm(image) - self._empty
        change -= cv2.blur(change, (25, 25))
        found = (np.abs(change).max(axis=2) > _QUICK_CONTRAST) & self._near
        return np.asarray(cv2.GaussianBlur(found.astype(np.float32), (0, 0), 1.5))


def _small(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = pixels.shape[:2]
    scale = _QUICK_PX / max(height, width)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)


def _small_logarithm(image: Image) -> NDArray[np.float32]:
    return np.asarray(np.log(_small(image).astype(np.float32) + np.float32(_SHADE)))


def _widened(mask: Mask, margin_px: int) -> Mask:
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * margin_px + 1, 2 * margin_px + 1))
    return np.asarray(cv2.dilate(mask.view(np.uint8), disc) > 0)


def _distance(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """0: the same; 1: nothing in common."""
    return float(np.abs(one - other).sum() / max(float(one.sum() + other.sum()), 1.0))


def farthest(robots: Sequence[NDArray[np.float32]], count: int) -> list[int]:
    """Places of `count` robots, blurred masks of one shape, in the order in which each is farthest from those before it.

    It begins with the largest robot, which reaches deepest.
    """
    if not robots:
        return []
    chosen = [int(np.argmax([float(robot.sum()) for robot in robots]))]
    nearest = np.full(len(robots), np.inf)
    while len(chosen) < min(count, len(robots)):
        last = robots[chosen[-1]]
        nearest = np.minimum(nearest, [_distance(last, robot) for robot in robots])
        nearest[chosen] = -1.0
        chosen.append(int(np.argmax(nearest)))
    return chosen


def _rejected(picture: TeachingPicture, reason: str) -> TeachingFrame:
    """A frame without masks."""
    blank = np.zeros(picture.image.shape[:2], bool)
    return TeachingFrame(picture, blank, blank, blank, reason=reason)


def propose(picture: TeachingPicture, bench: Bench, segment: Segment | None = None) -> TeachingFrame:
    """A frame with masks by difference; one that is of another bench, is blurred, shows a hand or no robot is rejected.

    `segment`: a network that completes what differs little, such as a grey robot on grey.
    """
    view = register(picture.image, bench)
    if isinstance(view, Refusal):
        return _rejected(picture, str(view))
    difference = robot_by_difference(picture.image, view)
    vessel = view.vessel if view.vessel is not None else np.zeros(picture.image.shape[:2], bool)
    robot, doubtful = difference.probability >= np.float32(0.5), difference.doubtful
    if segment is not None:
        network = segment(picture.image)[1]
        difference = beside_network(difference, network, picture.image, view)
        doubtful = difference.doubtful
        both = combined(network, difference, view) >= np.float32(0.5)
        core = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
        both = without_rim(network, difference, both & view.known & ~difference.unusable)
        robot = cv2.morphologyEx(both.view(np.uint8), cv2.MORPH_OPEN, core) > 0
        doubtful = doubtful | disagreement(network, difference, robot)
    specks = _specks(robot)
    robot, doubtful = robot & ~specks, doubtful | _widened(specks, 2)
    focus, hidden = structure_of(picture.image, view.placed, view.known, view.noise)
    gone = distance_to_empty(picture.image, view, with_gone=True) > np.float32(_GONE_LEVELS)
    frame = TeachingFrame(picture, vessel, robot, doubtful, focus, hidden, differs=robot | (gone & view.known))
    if focus < _LEAST_FOCUS:
        return replace(frame, reason=message("blurred: {a:.0f} % of the empty picture's fine structure", a=100 * focus))
    if hidden > _MOST_HIDDEN:
        return replace(frame, reason=message("a hand or a shadow: {a:.0f} % of the bench are hidden", a=100 * hidden))
    if robot.sum() < _LEAST_AREA_PX:
        return replace(frame, reason="no robot: nothing in the vessel differs from the empty bench")
    return frame


def _specks(robot: Mask) -> Mask:
    """Components that are a small share of the mask (h, w): dust, glare, or a piece of robot; nothing is learnt from them."""
    count, labels, statistics, _ = cv2.connectedComponentsWithStats(robot.view(np.uint8), connectivity=8)
    areas = statistics[:, cv2.CC_STAT_AREA]
    small = areas < _SPECK_SHARE * max(1, int(robot.sum()))
    small[0] = False
    return np.asarray(small[labels]) if count > 1 else np.zeros_like(robot)


def structure_of(image: Image, empty: Image, known: Mask, noise: NDArray[np.float32]) -> tuple[float, float]:
    """How much fine structure of the `empty` picture `image` shows, both (h, w, 3), where it is `known` (h, w).

    Returns the focus (the median over cells, 1 where both are alike; `noise` (h, w), one picture's standard deviation in grey
    levels, does not count), and the share of cells that are hidden: they show less than ``_HIDDEN`` of it.
    """
    seen, there = _fine_structure(image), _fine_structure(empty)
    floor = np.float32(_NOISE_TIMES) * noise / (cv2.cvtColor(empty, cv2.COLOR_RGB2GRAY).astype(np.float32) + np.float32(_SHADE))
    shares = []
    for y in range(0, image.shape[0] - _CELL_PX + 1, _CELL_PX):
        for x in range(0, image.shape[1] - _CELL_PX + 1, _CELL_PX):
            cell = np.s_[y : y + _CELL_PX, x : x + _CELL_PX]
            inside = known[cell]
            if inside.mean() < _KNOWN_SHARE:
                continue
            now, before = seen[cell][inside], there[cell][inside]
            strong = np.abs(before) >= np.quantile(np.abs(before), _STRONG_SHARE)
            if np.abs(before[strong]).mean() >= max(_LEAST_STRUCTURE, float(floor[cell][inside].mean())):
                shares.append(float(np.median(now[strong] / before[strong])))
    if not shares:
        return 1.0, 0.0
    focus = float(np.median(shares))
    return focus, float(np.mean(np.array(shares) < _HIDDEN * focus))


def _fine_structure(image: Image) -> NDArray[np.float32]:
    """Of the logarithm of the brightness, in which light is added."""
    levels = np.log(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32) + np.float32(_SHADE))
    return np.asarray(cv2.GaussianBlur(levels, (0, 0), 1.0) - cv2.GaussianBlur(levels, (0, 0), 3.0), np.float32)


def check(frames: Sequence[TeachingFrame], bench: Bench, *, has_pictures: bool = True) -> list[TeachingFrame]:
    """The frames, those whose masks are not plausible beside the others' with a reason.

    `has_pictures`: the bench is made from empty pictures, which may wrongly show the robot.

    Raises TeachingError: an empty picture shows the robot.
    """
    usable = [frame for frame in frames if not frame.reason]
    if not usable:
        return list(frames)
    if has_pictures:
        _check_empty(usable, bench)
    width = float(np.median([_width_px(frame.robot) for frame in usable]))
    area = float(np.median([frame.robot.sum() for frame in usable]))
    entry = _entry_of(usable)
    checked = []
    for frame in frames:
        why = frame.reason or _problem(frame, width, area, entry)
        checked.append(replace(frame, reason=why) if why != frame.reason else frame)
    return checked


def _problem(frame: TeachingFrame, width_px: float, area_px: float, entry: Mask | None) -> str:
    """Why a frame's mask is not plausible, from medians over all frames and where the robot enters; empty: it is."""
    robot = frame.robot
    area = int(robot.sum())
    statistics = cv2.connectedComponentsWithStats(robot.view(np.uint8), connectivity=8)[2][1:]
    parts = statistics[:, cv2.CC_STAT_AREA]
    largest = float(parts.max()) / area
    found_width = _width_px(robot)
    if frame.vessel.any():
        inside = float((robot & _widened(frame.vessel, INSIDE_MARGIN_PX)).sum()) / area
        if inside < LEAST_INSIDE:
            return message(
                "beside the vessel: {a:.0f} % of the robot's mask lie in it (at least {b:.0f} %)",
                a=100 * inside,
                b=100 * LEAST_INSIDE,
            )
    if len(parts) > MOST_COMPONENTS or largest < LARGEST_SHARE:
        return message("in pieces: the robot's mask has {a}, the largest {b:.0f} % of it", a=len(parts), b=100 * largest)
    if area > _LARGEST_AREA * area_px:
        return message("a hand or a shadow: the mask has {a:.1f} times the usual area", a=area / area_px)
    if not _WIDTHS[0] * width_px <= found_width <= _WIDTHS[1] * width_px:
        return message("of another width: the mask has {a:.1f} px, the others {b:.1f} px", a=found_width, b=width_px)
    if entry is not None and not (robot & entry).any():
        return "no tail: the robot is not seen where it enters in the other frames"
    if frame.doubtful_share > _MOST_DOUBT:
        return message(
            "doubtful: {a:.0f} % of the robot's mask (at most {b:.0f} %)", b=100 * _MOST_DOUBT, a=100 * frame.doubtful_share
        )
    return ""


def _entry_of(frames: Sequence[TeachingFrame]) -> Mask | None:
    """Where the robot's tail is: at the picture's border, or else somewhere where nearly all frames have the robot."""
    occupied = np.mean([_widened(frame.robot, 3) for frame in frames], axis=0)
    inner = np.zeros(occupied.shape, bool)
    inner[_INNER] = True
    for place in ((occupied >= _ENTRY_SHARE) & ~inner, occupied >= _ENTRY_SHARE):
        if place.any():
            return _widened(place, _ENTRY_REACH_PX)
    return None


def without_hidden_way(bench: Bench, frames: Sequence[TeachingFrame]) -> Bench:
    """The bench, not known on the robot's way from the picture's border to where the frames begin to show it beside the vessel.

    A robot that cannot be drawn out of the picture lies there in the empty picture, too, and never differs from it.
    """
    if bench.vessel is None or not frames:
        return bench
    apart = cv2.distanceTransform((~bench.vessel).view(np.uint8), cv2.DIST_L2, 5)
    count, labels = cv2.connectedComponents((reachable(bench.vessel) & (apart > BESIDE_PX + 1)).view(np.uint8))
    common = np.mean([_widened(frame.robot, 3) for frame in frames], axis=0) >= _ENTRY_SHARE
    y, x = np.indices(common.shape, np.float32)
    known = bench.known.copy()
    for label in range(1, count):
        way = labels == label
        shown = common & way
        if not shown.any() or shown[_INNER].sum() < shown.sum():
            continue
        nearest = np.argwhere(common & _widened(shown, 3 * _WAY_PX))[:, ::-1].astype(np.float32)
        along_x, along_y, at_x, at_y = cv2.fitLine(nearest, cv2.DIST_L2, 0, 0.01, 0.01).ravel().tolist()
        across = np.abs((x - at_x) * along_y - (y - at_y) * along_x)
        known &= ~(way & (across <= _WAY_PX) & (apart > apart[shown].max() - _WAY_RIM_PX))
    return replace(bench, known=known)


def _width_px(mask: Mask) -> float:
    """Mean width of thin shapes: twice their area over their outline."""
    outlines, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    around = sum(cv2.arcLength(outline, True) for outline in outlines)
    return 2.0 * float(mask.sum()) / max(around, 1.0)


def _check_empty(frames: Sequence[TeachingFrame], bench: Bench) -> None:
    """Raise TeachingError where the empty picture shows the robot.

    Nearly all frames differ from it in a place then, where it stands out clearly from the vessel around, and more than they do.
    """
    vessel = bench.vessel
    if vessel is None:
        return
    common = np.mean([frame.robot if frame.differs is None else frame.differs for frame in frames], axis=0) >= _GHOST_SHARE
    count, labels, statistics, _ = cv2.connectedComponentsWithStats((common & vessel).view(np.uint8), connectivity=8)
    pictures = [bench.empty, *(frame.picture.image for frame in frames)]
    for index in range(1, count):
        if statistics[index, cv2.CC_STAT_AREA] < _GHOST_PX:
            continue
        part = labels == index
        ring = _widened(part, 8) & ~_widened(part, 3) & vessel
        if ring.sum() < _GHOST_PX:
            continue
        # of each frame by itself: the bands of a robot are in other places in each
        apart = [float(np.abs(lab[part].mean(axis=0) - lab[ring].mean(axis=0)).max()) for lab in map(lab_of, pictures)]
        if apart[0] > max(_GONE_LEVELS, float(np.median(apart[1:]))):
            x, y = (int(statistics[index, key]) for key in (cv2.CC_STAT_LEFT, cv2.CC_STAT_TOP))
            raise TeachingError(f"the empty picture shows the robot near ({x}, {y}): take it again without the robot")


def choose(frames: Sequence[TeachingFrame], count: int) -> list[TeachingFrame]:
    """The `count` most diverse frames that are not rejected, a quarter of them held out, in their order.

    Raises TeachingError: too few frames are usable; the message names the most frequent reason.
    """
    usable = [frame for frame in frames if not frame.reason]
    if len(usable) < FEWEST:
        reasons = Counter(frame.reason.partition(":")[0] for frame in frames if frame.reason)
        most = f"; most of the others: {reasons.most_common(1)[0][0]}" if reasons else ""
        raise TeachingError(
            f"{len(usable)} of {len(frames)} frames are usable, {FEWEST} are needed{most}; record more of the moving robot"
        )
    blurred = [cv2.GaussianBlur(frame.robot.astype(np.float32), (0, 0), 6.0)[::4, ::4] for frame in usable]
    order = farthest([np.asarray(one, np.float32) for one in blurred], count)
    # The first of the order are the most unusual: learnt from, not held out.
    held_out = set(order[HELD_OUT_SHARE - 1 :: HELD_OUT_SHARE])
    return [replace(usable[index], is_held_out=index in held_out) for index in sorted(order)]


class _FrameRow(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    stem: str
    name: str
    held_out: bool = False
    reason: str = ""


class _TeachingState(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    frames: tuple[_FrameRow, ...]
    seen: int


@dataclass(frozen=True, slots=True)
class TeachingSet:
    """A written set of one bench: frames to learn from and frames held out. ``rejected``: (name, reason); ``seen``: pictures."""

    folder: Path
    train: tuple[Sample, ...]
    held_out: tuple[Sample, ...]
    rejected: tuple[tuple[str, str], ...]
    seen: int

    @property
    def bench(self) -> Path:
        """The folder of the bench."""
        return self.folder / "bench"

    @property
    def network(self) -> Path:
        """The folder in which a model is trained on these frames."""
        return self.folder / _NETWORK


def is_teaching_set(folder: Path) -> bool:
    """Whether ``write_teaching_set`` wrote this folder."""
    return (folder / _STATE).is_file()


def write_teaching_set(
    folder: Path, bench: Bench, chosen: Sequence[TeachingFrame], rejected: Sequence[TeachingFrame], seen: int
) -> TeachingSet:
    """Write frames and bench as ``train --data`` reads them, rejected frames in a folder of their own; an older set is replaced.

    A network that was trained on other frames is removed: it may have learnt from those that are held out now. What the empty
    picture may hide of the robot is not known of the bench that is written, and doubtful (``without_hidden_way``).

    Raises TeachingError: the folder is something else, or cannot be written.
    """
    if folder.exists() and not is_teaching_set(folder) and (not folder.is_dir() or any(folder.iterdir())):
        raise TeachingError(f"{folder}: exists and holds no frames of a bench; choose another --out")
    bench = without_hidden_way(bench, chosen)
    try:
        if (folder / _NETWORK).exists() and not _is_split_as(folder, chosen):
            shutil.rmtree(folder / _NETWORK)
        for name in ("images", "masks", _REJECTED):
            shutil.rmtree(folder / name, ignore_errors=True)
        for place, frames in ((folder, chosen), (folder / _REJECTED, rejected)):
            for name in ("images", "masks"):
                (place / name).mkdir(parents=True, exist_ok=True)
            for frame in frames:
                stem = frame.picture.stem
                write_png(place / "images" / f"{stem}.png", frame.picture.image)
                doubtful = frame.doubtful | (~bench.known & ~frame.robot)
                for name, mask in (("vessel", frame.vessel), ("robot", frame.robot), ("doubtful", doubtful)):
                    write_mask(place / "masks" / f"{stem}_{name}.png", mask)
        write_bench(bench, folder / "bench")
        rows = [
            _FrameRow(stem=frame.picture.stem, name=frame.picture.name, held_out=frame.is_held_out, reason=frame.reason)
            for frame in (*chosen, *rejected)
        ]
        state = _TeachingState(frames=tuple(rows), seen=seen)
        write_atomic(folder / _STATE, state.model_dump_json(indent=1).encode() + b"\n")
    except OSError as error:
        raise TeachingError(
            f"{error.filename or folder}: cannot be written ({error.strerror}); make room, or choose another --out"
        ) from None
    return read_teaching_set(folder)


def _is_split_as(folder: Path, chosen: Sequence[TeachingFrame]) -> bool:
    """Whether a set has the same pictures, and holds the same ones out."""
    try:
        state = _TeachingState.model_validate_json((folder / _STATE).read_bytes())
        was_held_out = {row.stem: row.held_out for row in state.frames}
        images = {path.name: path.read_bytes() for path in (folder / "images").iterdir()}
    except (OSError, ValidationError):
        return False
    return images == {f"{frame.picture.stem}.png": png(frame.picture.image) for frame in chosen} and all(
        was_held_out.get(frame.picture.stem) is frame.is_held_out for frame in chosen
    )


def read_teaching_set(folder: Path) -> TeachingSet:
    """A set as it is now: frames whose pictures were removed count as rejected, and masks may have been corrected.

    Raises TeachingError, DatasetError, BenchError: it is damaged, or too few frames are left.
    """
    path = folder / _STATE
    try:
        state = _TeachingState.model_validate_json(path.read_bytes())
    except OSError as error:
        raise TeachingError(f"{path}: cannot be read ({error.strerror}); teach again from the pictures") from None
    except ValidationError as error:
        raise TeachingError(f"{path}: damaged ({first_problem(error)}); teach again from the pictures") from None
    read_bench(folder / "bench")
    rows = {row.stem: row for row in state.frames}
    images = [path for path in sorted((folder / "images").glob("*")) if path.suffix.lower() in IMAGE_ENDINGS]
    samples = [sample_at(image, folder / "masks") for image in images]
    for sample in samples:
        for mask in (sample.vessel, sample.robot):
            if not mask.is_file():
                raise DatasetError(f"{sample.image}: its mask {mask.name} is missing; draw it, or remove the picture")
    held_out = [sample for sample in samples if sample.stem in rows and rows[sample.stem].held_out]
    train = [sample for sample in samples if sample not in held_out]
    if len(samples) < FEWEST or not held_out:
        raise TeachingError(f"{folder}: {len(samples)} frames, {len(held_out)} of them held out; {FEWEST} are needed: teach again")
    there = {sample.stem for sample in samples}
    rejected = [(row.name, row.reason or "removed by hand") for row in state.frames if row.stem not in there]
    return TeachingSet(folder, tuple(train), tuple(held_out), tuple(rejected), state.seen)
