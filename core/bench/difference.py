"""The robot as what differs from the empty bench, within the vessel and where the robot enters it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.bench.bench import Bench, BenchError
from core.bench.registration import BenchView, gradient_of, lab_of, register
from core.perception.segmentation import Probability
from core.types import Image, Mask

_SLACK_PX = 0.4
"""An edge of the bench that lies this far off is no difference."""
_COLOR = 1.5
"""Weight of the colour channels of Lab: shadows and light change colour less than brightness."""
_LIGHT_PX = 4
"""Light is compared at 1 / this of the size."""
_LIGHT_WINDOW = 13
"""Side of the median window, at that size, that follows shadows with their edges: wider than twice the widest robot."""
_LEAST_HIGH, _LEAST_LOW = 14.0, 6.0
"""Least difference (grey levels of Lab, 0 to 255) of a robot's clearest parts, and of its faintest."""
_HIGH_SIGMAS, _LOW_SIGMAS = 9.0, 4.0
"""The same in deviations of what the rest of the vessel differs by."""
_SMOOTHED_FROM = 4.0
"""Noise of the difference above which it is smoothed: the thresholds would exceed a robot's contrast."""
_NOISY, _NOISY_LEVELS = 6.0, 3.0
"""Noise of the difference, and of the camera, above which the smoothed outlines are too rough, and the network's count."""
_SMOOTH_PX, _HIGH_SMOOTH_SIGMAS, _LOW_SMOOTH_SIGMAS = 1.0, 4.0, 2.3
"""Standard deviation of that smoothing, and the thresholds then: noise alone has no long tail. In the noisiest `tank` the robot's
Dice rises from 0 to .85."""
_EDGE_SHARE = 0.4
"""The robot's edge lies at this share of its contrast there."""
_CONTRAST_PX = 9
"""Side of the surroundings whose clearest place is the contrast."""
_LEAST_AREA_PX = 40
"""A smaller part is noise or a bubble."""
_LEAST_ELONGATION = 2.0
"""A robot's area, in squares of its width; a blob, such as a reflection, has less."""
_GAP_PX, _CLEAR_SHARE = 20, 0.6
"""A short part so near to a long one is robot, too, when it is as clear as this share of that."""
_RIM_PX = 7
"""Diameter of the disc by which the robot's blurred rim is wider than the robot; it is background."""
_CLOSE_PX = 7
"""Gaps across the robot that are closed: its middle may look like the bench."""


@dataclass(frozen=True, slots=True, eq=False)
class Difference:
    """What differs from the empty bench.

    ``probability``: of the robot, float32 (h, w). ``evidence``: how much a pixel differs, whatever is around it, float32 (h, w):
    0.5 at an edge of the robot. ``doubtful``: bool (h, w), places that count neither as robot nor as background
    when a network is trained. ``unusable``: bool (h, w), where a difference says nothing: around a lamp's reflection, and
    over what goes on outside the drawn vessel, such as a cable or a hand. ``chained``: bool (h, w), short parts of the robot that
    are near others only, bands or a row of bubbles. ``excess``: float32 (h, w), by how many deviations more differs than in most of
    the vessel: perhaps too little for a robot. ``is_noisy``: its outlines are rough.
    """

    probability: NDArray[np.float32]
    evidence: NDArray[np.float32]
    doubtful: Mask
    unusable: Mask
    chained: Mask
    excess: NDArray[np.float32]
    is_noisy: bool = False


def distance_to_empty(image: Image, view: BenchView, *, with_gone: bool = False, smooth_px: float = 0.0) -> NDArray[np.float32]:
    """How much each pixel differs from the empty bench, float32 (h, w), in grey levels of Lab.

    `with_gone`: also where something lay on the empty bench that is gone. `smooth_px`: standard deviation of a smoothing.
    """
    seen = lab_of(image)
    apart = np.asarray(cv2.subtract(seen, view.lab, dtype=cv2.CV_32F), np.float32)
    apart -= _light(apart)
    if smooth_px:
        apart = np.asarray(cv2.GaussianBlur(apart, (0, 0), smooth_px), np.float32)
    slack, drawn = view.gradient, gradient_of(seen[..., 0])
    brightness, red, yellow = cv2.split(apart)  # sums along an axis of three take ten times as long
    colored = cv2.magnitude(brightness, _COLOR * cv2.magnitude(red, yellow))
    # what an edge that is a part of a pixel off explains does not count
    distance = np.maximum(colored - np.float32(_SLACK_PX) * slack, np.float32(0.0))
    if with_gone:
        return np.asarray(distance, np.float32)
    # nor the outline of what lay on the empty bench and is gone: a robot has edges of its own
    before, now = cv2.blur(slack, (_GONE_PX, _GONE_PX)), cv2.blur(drawn, (_GONE_PX, _GONE_PX))
    distance[(before > _GONE_TIMES * now) & (before > _GONE_EDGE)] = 0.0
    return np.asarray(distance, np.float32)


_GONE_PX, _GONE_TIMES, _GONE_EDGE = 7, 2.0, 2.0
"""Side of the square in which edges are compared, how much stronger the empty picture's must be, and their least mean in it."""


def _light(apart: NDArray[np.float32]) -> NDArray[np.float32]:
    """The part (h, w, 3) of a difference that light and shadows make: smooth, or with one edge; a robot has two."""
    height, width = apart.shape[:2]
    size = max(1, width // _LIGHT_PX), max(1, height // _LIGHT_PX)
    steps = np.clip(cv2.resize(apart, size, interpolation=cv2.INTER_AREA) * 2.0 + 128.5, 0, 255).astype(np.uint8)
    rim = _LIGHT_WINDOW // 2
    framed = cv2.copyMakeBorder(steps, rim, rim, rim, rim, cv2.BORDER_REFLECT)
    # medianBlur of three channels takes each by itself
    middle = cv2.medianBlur(framed, _LIGHT_WINDOW)[rim:-rim, rim:-rim].astype(np.float32)
    return np.asarray(cv2.resize((middle - 128.0) / 2.0, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)


def robot_by_difference(image: Image, view: BenchView) -> Difference:
    """The robot in `image` (h, w, 3), a picture at working size that was registered as `view`."""
    probability, evidence, doubtful = np.zeros(image.shape[:2], np.float32), np.zeros(image.shape[:2], np.float32), ~view.known
    x, y, width, height = cv2.boundingRect(view.reachable.view(np.uint8))
    if not width:
        return Difference(probability, evidence, doubtful, np.zeros_like(doubtful), np.zeros_like(doubtful), evidence)
    distance = distance_to_empty(image, view)
    unusable = _glare(image)
    box = np.s_[y : y + height, x : x + width]
    allowed = view.reachable[box] & view.known[box] & ~unusable[box]
    noise, sigmas = _deviation(distance[box], allowed), (_HIGH_SIGMAS, _LOW_SIGMAS)
    is_noisy = noise > _NOISY and float(np.median(view.noise[box][::4, ::4])) > _NOISY_LEVELS
    if noise > _SMOOTHED_FROM:
        distance = distance_to_empty(image, view, smooth_px=_SMOOTH_PX)
        noise, sigmas = _deviation(distance[box], allowed), (_HIGH_SMOOTH_SIGMAS, _LOW_SMOOTH_SIGMAS)
    excess = np.zeros_like(evidence)
    excess[box] = _excess(distance[box], allowed)
    high, low = max(_LEAST_HIGH, sigmas[0] * noise), max(_LEAST_LOW, sigmas[1] * noise)
    strong = np.where(allowed, distance[box], np.float32(0.0))
    cut = np.maximum(_EDGE_SHARE * _contrast(strong), np.float32(low))
    if view.vessel is not None:
        differs = ~view.reachable & view.known & (distance > high)
        differs[box] |= strong > cut
        unusable |= (foreign := _foreign(differs, view.reachable))
        strong[foreign[box]] = 0.0
    parts, hopped = _robot_parts(strong, strong > cut, high)
    mask = _with_ends(parts, strong, cut, high)
    mask = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_CLOSE, _disc(_CLOSE_PX)) > 0
    values = np.clip(strong / (2.0 * cut), 0.0, 1.0)
    bridge = _bridge(mask, view.gradient[box]) & allowed & ~mask
    mask |= bridge
    values[bridge] = np.maximum(values[bridge], np.float32(_UNSEEN))
    evidence[box] = values
    around = cv2.dilate(mask.view(np.uint8), _disc(5)) > 0
    probability[box] = np.where(mask, np.maximum(values, 0.6), np.where(around, np.minimum(values, 0.49), 0.0))
    if view.window is None:
        _continue_to_border(probability, view.reachable)
    rim = cv2.dilate((probability >= np.float32(0.5)).view(np.uint8), _disc(_RIM_PX)) > 0
    doubtful |= (distance > np.where(view.reachable, low, high)) & ~rim | unusable
    chained = np.zeros_like(doubtful)
    if hopped.any():  # with its bridges
        count, labels, _, _ = _components((probability[box] >= np.float32(0.5)) & ~(parts & ~hopped))
        is_chained = np.bincount(labels[hopped], minlength=count) > 0
        is_chained[0] = False
        chained[box] = is_chained[labels]
    return Difference(probability, evidence, doubtful, unusable, chained, excess, is_noisy)


def _deviation(distance: NDArray[np.float32], allowed: Mask) -> float:
    """What pixels (h, w) where a robot may lie differ by, most of which show none: of a normal distribution, by the median."""
    inside = distance[::2, ::2][allowed[::2, ::2]]
    return 1.4826 * float(np.median(inside)) if inside.size else 0.0


def _excess(distance: NDArray[np.float32], allowed: Mask) -> NDArray[np.float32]:
    """By how many deviations a pixel (h, w) differs more than most of the vessel, from its surroundings of 3 px."""
    little = cv2.blur(distance, (3, 3))
    inside = little[::2, ::2][allowed[::2, ::2]]
    if not inside.size:
        return np.zeros_like(distance)
    middle = float(np.median(inside))
    spread = max(1.4826 * float(np.median(np.abs(inside - middle))), _LEAST_SPREAD)
    return np.asarray(np.where(allowed, np.minimum((little - middle) / spread, _MOST_EXCESS), 0.0), np.float32)


_LEAST_SPREAD, _MOST_EXCESS = 1.0, 8.0
"""Least deviation, in grey levels, and the excess that counts at most."""


def _foreign(differs: Mask, reachable: Mask) -> Mask:
    """Where what `differs` (h, w) is no robot, since much of it lies outside the vessel: a cable, a hand; widened by its rim."""
    beyond = differs & ~reachable
    if np.count_nonzero(beyond) < _LEAST_AREA_PX:
        return np.zeros(differs.shape, np.bool_)
    count, labels, stats, _ = _components(differs)
    outside = np.bincount(labels[beyond], minlength=count)
    foreign = (outside >= _LEAST_AREA_PX) & (outside > _OUTSIDE_SHARE * stats[:, cv2.CC_STAT_AREA])
    foreign[0] = False
    if not foreign.any():
        return np.zeros(differs.shape, np.bool_)
    return np.asarray(cv2.dilate(foreign[labels].view(np.uint8), _square(_RIM_PX)) > 0)


_OUTSIDE_SHARE = 0.3
"""Of what differs: a robot's shadow, or a reflection of it, lies outside the drawn vessel to a lesser share."""


def _robot_parts(strong: NDArray[np.float32], candidate: Mask, high: float) -> tuple[Mask, Mask]:
    """Of what differs (h, w), the long parts that are clear somewhere, and the short ones near them that are as clear.

    The second mask is of the short ones that are near other short ones only.
    """
    count, labels, stats, _ = _components(candidate)
    has_clear = np.bincount(labels[candidate & (strong >= high)], minlength=count) > 0
    peaks, result = {}, np.zeros(candidate.shape, np.bool_)
    for label in range(1, count):
        x, y, width, height, area = stats[label].tolist()
        if not has_clear[label] or area < _LEAST_AREA_PX // 2:
            continue
        box = np.s_[y : y + height, x : x + width]
        part = labels[box] == label
        depth = cv2.distanceTransform(np.pad(part.view(np.uint8), 1), cv2.DIST_L2, 3)
        peaks[label] = float(strong[box][part].max())
        if area >= max(_LEAST_AREA_PX, _LEAST_ELONGATION * (2.0 * float(depth.max())) ** 2):
            # what is much thinner than the robot is a shadow's edge that touches it; a strip's mean depth is a quarter of its width
            side = round(_THIN_SHARE * 4.0 * float(depth[depth > 0].mean()))
            if side >= 3:
                whole = cv2.morphologyEx(np.pad(part.view(np.uint8), side, mode="edge"), cv2.MORPH_OPEN, _disc(side))
                part &= whole[side:-side, side:-side] > 0
            result[box] |= part
            peaks[label] = -peaks[label]  # taken
    clear = [-peak for peak in peaks.values() if peak < 0.0]
    least = max(high, _CLEAR_SHARE * float(np.median(clear))) if clear else high
    hops, box, added = np.zeros(count, np.int32), np.s_[:, :], result
    for hop in itertools.count(1):  # from one band of a banded robot to the next
        near = cv2.dilate(added.view(np.uint8), _square(2 * _GAP_PX + 1)) > 0
        beside = np.flatnonzero(np.bincount(labels[box][near], minlength=count)).tolist()
        names = [label for label in beside if peaks.pop(label, 0.0) >= least]
        if not names:
            break
        hops[names] = hop
        (x, y), (right, bottom) = stats[names, :2].min(axis=0).tolist(), (stats[names, :2] + stats[names, 2:4]).max(axis=0).tolist()
        box = np.s_[max(0, y - _GAP_PX) : bottom + _GAP_PX, max(0, x - _GAP_PX) : right + _GAP_PX]
        added = (hops == hop)[labels[box]]
    taken = hops[labels]
    return result | (taken > 0), taken > 1


def _with_ends(mask: Mask, strong: NDArray[np.float32], cut: NDArray[np.float32], high: float) -> Mask:
    """The robot's `mask` (h, w) with ends of another colour, which differ less than its body; `cut` is lowered there, in place."""
    if not mask.any():
        return mask
    width = _width_px(mask)
    body = cv2.dilate(mask.view(np.uint8), _disc(2 * _END_RIM_PX + 1)) > 0
    around = cv2.dilate(mask.view(np.uint8), _square(2 * round(_END_REACH * width) + 1)) > 0
    rest = np.where(around & ~body, strong, np.float32(0.0))
    differs = rest > _EDGE_SHARE * _contrast(rest)
    clear = max(_END_CLEAR * high, _END_CONTRAST * float(np.median(strong[mask])))
    found = cv2.morphologyEx((differs & (rest > np.float32(high / 2.0))).view(np.uint8), cv2.MORPH_OPEN, _disc(3))
    if not found.any():
        return mask
    count, labels, stats, centers = _components(found)
    side = 2 * round(_END_REACH * width) + 1
    beside = cv2.blur(mask.view(np.uint8).astype(np.float32), (side, side))
    mask = mask.copy()
    for label in range(1, count):
        x, y, box_width, box_height, area = stats[label].tolist()
        column, row = (round(value) for value in centers[label].tolist())
        is_small = area < _END_AREA * width**2
        if is_small or max(box_width, box_height) > _END_LENGTH * width or beside[row, column] > _END_BESIDE:
            continue
        box = np.s_[max(0, y - 4) : y + box_height + 4, max(0, x - 4) : x + box_width + 4]
        part = labels[box] == label
        touches = (cv2.dilate(part.view(np.uint8), _square(5)) > 0) & body[box]
        if float(rest[box][part].max()) < clear or not touches.any():
            continue
        near = cv2.dilate(part.view(np.uint8), _disc(2 * _END_RIM_PX + 3)) > 0
        level = np.float32(_END_EDGE * float(np.quantile(strong[box][part], 0.9)))
        cut[box] = np.where(near, np.minimum(cut[box], level), cut[box])
        mask[box] |= near & (strong[box] > cut[box])
    return mask


_END_RIM_PX = 2
"""Width of the rim of the robot's body, where its blurred edge is no end of another colour."""
_END_REACH, _END_LENGTH = 1.5, 2.0
"""How far beside the body ends are looked for, and their greatest length, in widths of the body."""
_END_AREA = 0.12
"""Least area of an end, in squares of the body's width."""
_END_CLEAR, _END_CONTRAST = 1.5, 0.22
"""Least difference of an end: of the robot's clearest parts' least, and of what the body differs by."""
_END_EDGE = 0.5
"""An end's edge lies at this share of its own contrast."""
_END_BESIDE = 0.15
"""Most of the surroundings of an end that is body: beside the body, where its shadow lies, it is more."""


def beside_network(difference: Difference, network: Probability, image: Image, view: BenchView) -> Difference:
    """The `difference` of an `image` (h, w, 3), corrected by what the `network` (h, w) sees.

    Without the robot's shadow, and with the parts of the robot that the network sees and that differ little.
    """
    return _with_faint(_without_shadow(difference, network, image, view), network, view)


def _with_faint(difference: Difference, network: Probability, view: BenchView) -> Difference:
    """The same with what the `network` (h, w) sees of the robot beyond what was found, where it differs a little.

    It goes on from what was found, or else is long, and no edge of the bench shows in it, which a robot would hide. It is doubtful
    where not most of it differs clearly.
    """
    found = difference.probability >= np.float32(0.5)
    seen = (network >= np.float32(0.5)) & view.reachable & view.known & ~difference.unusable
    apart = (seen & (cv2.dilate(found.view(np.uint8), _square(_APART_PX)) == 0)).view(np.uint8)
    if not cv2.morphologyEx(apart, cv2.MORPH_OPEN, _square(2)).any():
        return difference
    side = (_FAINT_PX, _FAINT_PX)
    all_seen = cv2.blur(seen.astype(np.float32), side)
    excess = cv2.blur(np.where(seen, difference.excess, np.float32(0.0)), side)
    robot = seen & (excess > np.float32(_FAINT_EXCESS) * all_seen)
    apart = cv2.morphologyEx((robot & (apart > 0)).view(np.uint8), cv2.MORPH_OPEN, _square(2))
    robot &= cv2.dilate(apart, _square(_APART_PX + 2)) > 0
    count, labels, _, _ = _components(cv2.dilate((robot | found).view(np.uint8), _square(_GAP_PX)))
    areas = np.bincount(labels[robot], minlength=count)
    goes_on = np.bincount(labels[found], minlength=count) > 0 if found.any() else areas >= _LEAST_FAINT_PX
    robot &= goes_on[labels]
    count, labels, stats, _ = _components(robot & ~found)
    for label in range(1, count):
        x, y, width, height = stats[label, :4].tolist()
        box = np.s_[y : y + height, x : x + width]
        part = labels[box] == label
        if float(np.quantile(view.gradient[box][part], 0.9)) > _BRIDGE_EDGE:
            robot[box] &= ~part
    clear = cv2.blur((seen & (difference.excess > np.float32(_CLEAR_EXCESS))).astype(np.float32), side)
    doubtful = difference.doubtful | (robot & (clear < np.float32(_CLEAR_PART) * all_seen))
    probability, evidence = (
        np.where(robot, np.maximum(of_it, _FAINT), of_it) for of_it in (difference.probability, difference.evidence)
    )
    return replace(difference, probability=probability, evidence=evidence, doubtful=doubtful)


_FAINT_PX, _FAINT_EXCESS = 21, 2.0
"""Side of the square in which what the network sees must have this excess on average."""
_CLEAR_EXCESS, _CLEAR_PART = 3.0, 0.8
"""Excess of a pixel that differs by itself, and the share of such pixels where a network may learn that this is a robot."""
_APART_PX = 9
"""Side of the square around what differs in which the network adds nothing: its outline may be too wide."""
_LEAST_FAINT_PX = 240
"""Area of a robot that differs a little all along: 60 px of length, 4 px wide."""
_FAINT = np.float32(0.55)
"""Probability and evidence of what differs little."""


def _without_shadow(difference: Difference, network: Probability, image: Image, view: BenchView) -> Difference:
    """The `difference` without a lamp's shadow of the robot along one side of what the `network` (h, w) sees of it.

    In a shadow the bench is seen darker, in its own colours, but otherwise than the robot, and the network sees no robot. Beside it
    the network's robot counts, too: a bright robot may differ less than its shadow.
    """
    mask = difference.probability >= np.float32(0.5)
    unseen, least = mask & (network < np.float32(_SHADOW_UNSEEN)), _SHADOW_LEAST * np.count_nonzero(mask)
    if np.count_nonzero(unseen) <= least:
        return difference
    x, y, width, height = cv2.boundingRect(mask.view(np.uint8))
    rim = _SHADOW_NEAR_PX // 2
    box = np.s_[max(0, y - rim) : y + height + rim, max(0, x - rim) : x + width + rim]
    unseen, around = unseen[box], cv2.dilate(mask[box].view(np.uint8), _square(_SHADOW_NEAR_PX)) > 0
    robot = (network[box] >= np.float32(0.5)) & view.reachable[box] & around
    clear = robot & (mask[box] | (difference.excess[box] > np.float32(_CLEAR_EXCESS)))
    if not clear.any() or clear.sum() < _SHADOW_CLEAR * robot.sum():
        return difference
    seen, there = (cv2.medianBlur(np.ascontiguousarray(lab), 3).astype(np.float32) for lab in (lab_of(image[box]), view.lab[box]))
    share = (seen[..., 0] + np.float32(_LAB_BLACK)) / (there[..., 0] + np.float32(_LAB_BLACK))
    colors = seen[..., 1:] - 128.0 - share[..., None] * (there[..., 1:] - 128.0)
    in_its_colors = np.square(colors).sum(axis=2) < np.float32(_SHADOW_COLOR**2)
    across = _width_px(robot)
    apart, nearest = cv2.distanceTransformWithLabels((~robot).view(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    darker = unseen & (share > _SHADOW_SHARE[0]) & (share < _SHADOW_SHARE[1]) & in_its_colors & (apart < _SHADOW_REACH * across)
    count, labels, stats, _ = _components(cv2.morphologyEx(darker.view(np.uint8), cv2.MORPH_OPEN, _square(2)))
    # of the robot about three rows lie within the square's reach
    contact_px = np.bincount(cv2.dilate(labels, _square(9))[clear], minlength=count) / 3.0
    is_long = (contact_px > _SHADOW_CONTACT * across) & (stats[:, cv2.CC_STAT_AREA] >= _LEAST_AREA_PX // 2)
    is_long[0] = False
    shadow = is_long[labels]
    if np.count_nonzero(shadow) <= least or _one_sidedness(darker, robot, np.asarray(nearest, np.int32)) < _SHADOW_SIDE:
        return difference
    levels = seen - there
    of_shadow, of_robot = (np.median(levels[part], axis=0) for part in (shadow, clear))
    if float(np.linalg.norm(of_shadow - of_robot)) < _SHADOW_CONTRAST:
        return difference
    beside = (cv2.dilate(shadow.view(np.uint8), _disc(2 * round(across) + 1)) > 0) & view.reachable[box]
    is_like_it = (np.square(levels - of_shadow) - np.square(levels - of_robot)).sum(axis=2) < 0
    shadow |= (cv2.dilate(shadow.view(np.uint8), _square(5)) > 0) & (network[box] < 0.5) & is_like_it
    rest = (mask[box] | robot) & ~shadow
    thin = rest & ~robot & (cv2.morphologyEx(rest.view(np.uint8), cv2.MORPH_OPEN, _disc(3)) == 0)
    shadow |= thin & (cv2.dilate(shadow.view(np.uint8), _square(5)) > 0)  # the shadow's blurred rim
    probability, evidence, doubtful = difference.probability.copy(), difference.evidence.copy(), difference.doubtful.copy()
    for values in (probability, evidence):
        part = values[box]
        part[beside] = np.maximum(part, network[box])[beside]
        part[shadow] = network[box][shadow]
    doubtful[box] &= ~shadow
    return replace(difference, probability=probability, evidence=evidence, doubtful=doubtful)


def _one_sidedness(beside: Mask, strand: Mask, nearest: NDArray[np.int32]) -> float:
    """How much alike the directions are from a `strand` to what lies `beside` it, (h, w) both: 1, all the same in the picture.

    `nearest`: labels of the strand's nearest pixel.
    """
    places = np.zeros((int(nearest.max()) + 1, 2))
    places[nearest[strand]] = np.argwhere(strand)
    away = np.argwhere(beside) - places[nearest[beside]]
    return float(np.linalg.norm(away.mean(axis=0)) / max(float(np.linalg.norm(away, axis=1).mean()), 1e-6))


def _bridge(mask: Mask, gradient: NDArray[np.float32]) -> Mask:
    """Where the robot's `mask` (h, w) goes on from one wide piece to the next, as across a band of the bench's colour.

    It is the convex hull of the two ends that face each other, if that is about as wide as the robot, and no edge of the bench
    shows in it, which a robot would hide. `gradient`: of the empty bench, grey levels per px (h, w).
    """
    bridge = np.zeros(mask.shape, np.bool_)
    if not mask.any():
        return bridge
    depth = cv2.distanceTransform(mask.view(np.uint8), cv2.DIST_L2, 3)
    width = 2.0 * float(np.quantile(depth[mask], _WIDE_QUANTILE))
    wide = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_OPEN, _disc(max(3, round(_WIDE_SHARE * width))))
    found = cv2.findContours(wide, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    pieces = [(np.asarray(outline[:, 0], np.int32), cv2.boundingRect(outline)) for outline in found]
    hulls = []
    for first, second in itertools.combinations(range(len(pieces)), 2):
        (outline, box), (next_outline, next_box) = pieces[first], pieces[second]
        if any(
            abs(2 * (box[k] - next_box[k]) + box[k + 2] - next_box[k + 2]) > box[k + 2] + next_box[k + 2] + 2 * _BRIDGE_PX
            for k in (0, 1)
        ):
            continue
        one, other = _points_near(outline, next_box, _BRIDGE_PX + width), _points_near(next_outline, box, _BRIDGE_PX + width)
        if not len(one) or not len(other):
            continue
        apart = cv2.magnitude(*(np.subtract.outer(one[:, axis], other[:, axis]).astype(np.float32) for axis in (0, 1)))
        gap = float(apart.min())
        if gap > _BRIDGE_PX:
            continue
        near = gap + width / 2.0
        ends = one[apart.min(axis=1) <= near], other[apart.min(axis=0) <= near]
        hull = cv2.convexHull(np.concatenate(ends))
        along = ends[1].mean(axis=0) - ends[0].mean(axis=0)
        across = hull[:, 0] @ np.array([-along[1], along[0]]) / max(float(np.linalg.norm(along)), 1.0)
        if np.ptp(across) <= _BRIDGE_WIDTHS * width:
            hulls.append((gap, first, second, hull))
    strand, bridges = list(range(len(pieces))), [0] * len(pieces)
    for _, first, second, hull in sorted(hulls, key=lambda one: one[:3]):
        x, y, columns, rows = cv2.boundingRect(hull)
        place = np.s_[y : y + rows, x : x + columns]
        between = (cv2.fillConvexPoly(np.zeros((rows, columns), np.uint8), hull - (x, y), 1) > 0) & ~mask[place]
        is_new = strand[first] != strand[second]
        if not between.any() or (is_new and max(bridges[first], bridges[second]) > 1):
            continue
        if (is_new or bridge[place][between].mean() > _BRIDGED_SHARE) and np.quantile(gradient[place][between], 0.9) < _BRIDGE_EDGE:
            bridge[place] |= between
            if is_new:
                strand = [strand[first] if name == strand[second] else name for name in strand]
                bridges[first], bridges[second] = bridges[first] + 1, bridges[second] + 1
    return bridge


def _points_near(points: NDArray[np.int32], box: Sequence[int], reach_px: float) -> NDArray[np.int32]:
    """Those of the `points` (N, 2) at most so far from a box (x, y, width, height)."""
    least = np.array(box[:2]) - reach_px
    return np.asarray(points[((points >= least) & (points <= least + np.array(box[2:]) + 2.0 * reach_px)).all(axis=1)], np.int32)


_WIDE_QUANTILE, _WIDE_SHARE = 0.95, 0.6
"""Of the depths in a mask, half of the robot's width; a wide piece has this share of that width everywhere."""
_BRIDGE_PX, _BRIDGE_WIDTHS = 24.0, 1.4
"""Greatest gap between two pieces that is bridged, and the greatest width of the bridge in widths of the robot."""
_BRIDGED_SHARE = 0.3
"""Of a bridge between pieces that are joined already: it makes that wider, and is no ladder between two strands of the robot."""
_BRIDGE_EDGE = 25.0
"""Of the bench, grey levels per px: at most 23 in 160 gaps between bands of robots, 30 and more in 22 at opaque clips."""


def _width_px(mask: Mask) -> float:
    """The width of a strip that `mask` (h, w) shows: its mean depth is a quarter of it."""
    return 4.0 * float(cv2.distanceTransform(mask.view(np.uint8), cv2.DIST_L2, 3)[mask].mean())


_LAB_BLACK = 16.0 * 255.0 / 100.0
"""L* + 16, a* and b* are proportional to the cube root of the light (CIE 1976)."""
_SHADOW_SHARE = 0.4, 0.97
"""Of that root, in a robot's shadow: darker is no shadow, lighter is no difference."""
_SHADOW_COLOR = 10.0
"""Greatest distance of a shadow's colour from the bench's, in levels of Lab."""
_SHADOW_LEAST, _SHADOW_CONTACT, _SHADOW_NEAR_PX = 0.1, 2.0, 11
"""Least share of a shadow in what differs, and how far it touches the robot, in widths of that; the side of the square around what
differs in which the network's robot counts."""
_SHADOW_CLEAR, _SHADOW_CONTRAST = 0.6, 4.0
"""Share of what the network sees that must differ: else it is something beside the robot. Least distance, in levels of Lab, of what
shadow and robot differ by from the bench: else it is the robot's other side."""
_SHADOW_UNSEEN, _SHADOW_REACH = 0.25, 2.5
"""The network's probability of a robot there is less; how far from what it sees a shadow reaches, in widths of that."""
_SHADOW_SIDE = 0.7
"""Least one-sidedness: 0.74 and more in nine of ten frames with a shadow, of four benches of the twin."""


def _contrast(strong: NDArray[np.float32]) -> NDArray[np.float32]:
    """The clearest difference around each pixel (h, w)."""
    return np.asarray(cv2.blur(cv2.dilate(strong, _square(_CONTRAST_PX)), (5, 5)), np.float32)


def _components(mask: NDArray[Any]) -> tuple[int, NDArray[np.uint16], NDArray[np.int32], NDArray[np.float64]]:
    """Count, labels (h, w), statistics and centers of the components; labels of 16 bits take a third of the time."""
    count, labels, stats, centers = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8, ltype=cv2.CV_16U)
    return count, np.asarray(labels, np.uint16), np.asarray(stats, np.int32), np.asarray(centers, np.float64)


def _darkest(image: Image) -> NDArray[np.uint8]:
    """The least of the three channels, uint8 (h, w)."""
    red, green, blue = cv2.split(image)
    return np.asarray(cv2.min(cv2.min(red, green), blue), np.uint8)


def _glare(image: Image) -> Mask:
    """Where a lamp is reflected, bool (h, w): what is overexposed and round; a white robot is long."""
    bright = (_darkest(image) > _GLARE_LEVEL).view(np.uint8)
    result = np.zeros(bright.shape, np.uint8)
    if not bright.any():
        return result > 0
    bright = np.asarray(cv2.morphologyEx(bright, cv2.MORPH_OPEN, _disc(7)), np.uint8)
    count, labels, stats, _ = _components(bright)
    for label in range(1, count):
        x, y, width, height, area = stats[label].tolist()
        part = np.pad((labels[y : y + height, x : x + width] == label).view(np.uint8), 1)
        if area < _LEAST_ELONGATION * (2.0 * float(cv2.distanceTransform(part, cv2.DIST_L2, 3).max())) ** 2:
            result[y : y + height, x : x + width] |= part[1:-1, 1:-1]
    return np.asarray(cv2.dilate(result, _square(_HALO_PX)) > 0) if result.any() else result > 0


def _continue_to_border(probability: NDArray[np.float32], reachable: Mask) -> None:
    """Continue a robot that ends just before the picture's border, where a frame or a collimator hides it, straight to it."""
    for turn in range(4):
        turned, area = np.rot90(probability, turn), np.rot90(reachable, turn)  # views: the left border of each is one of the four
        inner, strip = turned[:, _BORDER_PX], turned[:, :_BORDER_PX]
        reaches = cv2.dilate((strip[:, 0] >= 0.5).astype(np.uint8)[:, None], np.ones((41, 1), np.uint8))[:, 0] > 0
        goes_on = (inner >= 0.5) & ~reaches
        if goes_on.any():
            strip[goes_on] = np.where(area[goes_on, :_BORDER_PX], np.maximum(strip[goes_on], inner[goes_on, None]), strip[goes_on])


_GLARE_LEVEL, _HALO_PX = 240, 55
"""Grey level of all channels in a lamp's reflection, and the side of the square by which its halo is wider."""
_THIN_SHARE = 0.4
"""Of the robot's width: thinner parts are no robot."""
_BORDER_PX = 12
"""Width of the picture's rim across which a robot is continued."""


def check_without_robot(bench: Bench, robot: Probability, frames: Sequence[Image]) -> None:
    """Raise BenchError where a robot lay in the empty picture.

    Parameters
    ----------
    robot : the network's robot probability (h, w) of ``bench.empty``, which may be wrong.
    frames : RGB (h, w, 3) at working size. A robot that lay in the empty picture has moved since in most of them.
    """
    seen = (robot >= np.float32(0.5)) & bench.known
    if np.count_nonzero(seen) < _LEAST_ROBOT_PX:
        return
    moved = []
    for frame in frames:
        if isinstance(view := register(frame, bench), BenchView):
            moved.append(float(np.mean(distance_to_empty(frame, view, with_gone=True)[seen] > _LEAST_HIGH)))
    if moved and float(np.median(moved)) > _MOVED_SHARE:
        raise BenchError("the robot lies in the empty picture: take another without it")


_LEAST_ROBOT_PX, _MOVED_SHARE = 400, 0.5
"""Least area of what the network takes for a robot, and the share of it that has changed when it was one."""


def combined(network: Probability, difference: Difference, view: BenchView, *, is_taught: bool = False) -> Probability:
    """The robot's probability (h, w): what differs from the empty bench, and what the `network` (h, w) sees beside that.

    Where the empty bench is not known, and where the difference is unusable, the network alone counts. In noise the difference says
    only where the robot is about; its outline is the network's. With `is_taught`, a network that was taught on a bench, both are
    averaged: what that network does not see, such as a shadow beside the robot, must differ more.
    """
    differs = (difference.probability >= np.float32(0.5)) & ~_unsupported(network, difference)
    near = cv2.dilate(differs.view(np.uint8), _square(_NEAR_PX)) > 0 if difference.is_noisy or is_taught else differs
    outline = np.asarray(np.where(near | ~view.known | difference.unusable, network, np.float32(0.0)), np.float32)
    if difference.is_noisy:
        return outline
    beside = cv2.dilate(differs.view(np.uint8), _square(_BESIDE_PX)) > 0
    seen = np.where(network + difference.evidence >= np.float32(_BOTH), network, np.minimum(network, np.float32(0.49)))
    robot = np.where(differs, np.maximum(network, difference.probability), np.where(beside, seen, np.float32(0.0)))
    robot = np.asarray(np.where(view.known & ~difference.unusable, robot, network), np.float32)
    return robot + np.float32(_TAUGHT_SHARE) * (outline - robot) if is_taught else robot


def disagreement(network: Probability, difference: Difference, robot: Mask) -> Mask:
    """Where the `network` (h, w) and the difference contradict each other about the outline of the `robot` (h, w).

    A shadow beside the robot differs from the empty bench, and a tip as bright as the bench hardly does: beyond an end of it a
    weak sign is enough. What the network overlooks in half of the robot's width and more is no outline: there the difference
    is believed, but for chained parts that it supports nowhere.
    """
    if not robot.any():
        return robot
    width = _width_px(robot)
    side = 2 * round(_END_REACH * width) + 1
    beside = cv2.blur(robot.view(np.uint8).astype(np.float32), (side, side))
    is_beyond = ~robot & (beside < np.float32(_BEYOND)) & (beside > 0.0)
    unsure = np.abs(network - difference.evidence) > np.float32(_CONTRADICT)
    signs = (network > np.float32(_WEAK_SIGN)) | (cv2.blur(difference.evidence, (5, 5)) > np.float32(_WEAK_EVIDENCE))
    unsure |= is_beyond & signs
    unsure &= cv2.dilate(robot.view(np.uint8), _square(2 * round(width) + 1)) > 0
    return np.asarray(unsure & ~_overlooked(network, robot, width) | _unsupported(network, difference))


def _unsupported(network: Probability, difference: Difference) -> Mask:
    """Of the chained parts, what is not near one of which the `network` (h, w) sees a little."""
    if not difference.chained.any():
        return difference.chained
    seen = difference.chained & (network >= np.float32(_SUPPORT))
    return difference.chained & ~(cv2.dilate(seen.view(np.uint8), _square(2 * _GAP_PX + 1)) > 0)


def without_rim(network: Probability, difference: Difference, robot: Mask) -> Mask:
    """The `robot` (h, w) without the rim in which neither the `network` (h, w) nor the difference shows it clearly.

    Narrow gaps across it are no rim.
    """
    if not robot.any():
        return robot
    unseen = network + difference.evidence < np.float32(_UNSEEN)
    kept = robot & ~(unseen & ~_overlooked(network, robot, _width_px(robot)))
    return robot & (cv2.morphologyEx(kept.view(np.uint8), cv2.MORPH_CLOSE, _disc(_CLOSE_PX)) > 0)


def _overlooked(network: Probability, robot: Mask, width: float) -> Mask:
    """What the network overlooks of the robot in half of its `width` and more."""
    overlooked = robot & (network < np.float32(0.5))
    wide = cv2.morphologyEx(overlooked.view(np.uint8), cv2.MORPH_OPEN, _disc(max(3, 2 * round(width / 4.0) + 1)))
    return overlooked & (cv2.dilate(wide, _disc(3)) > 0)


_UNSEEN = 0.6
"""Sum of the network's probability and the difference's evidence below which a rim is no robot: the union of both is too wide.
A bridge's evidence is that. To 0.8 the masks of robots that the network sees half become too thin."""
_SUPPORT = 0.3
"""Probability by the network at which a chained part, and what is near it, is robot."""
_CONTRADICT = 0.5
"""Difference of the network's probability and the difference's evidence above which they contradict each other."""
_BEYOND, _WEAK_SIGN, _WEAK_EVIDENCE = 0.22, 0.05, 0.2
"""Beyond an end of the robot a lesser share of the surroundings is robot than beside it; there a greater probability, or mean
evidence around it, is a sign. A camera's noise mostly stays below that: the background around the robot is learnt."""
_BESIDE_PX = 9
"""Side of the square around what differs within which the network adds to the robot: a part that looks like the bench."""
_NEAR_PX = 41
"""Side of the square around what differs in which the network is believed where its outline counts."""
_TAUGHT_SHARE = 0.4
"""Weight of a taught network's outline. From 0.5 on a robot that it has not learnt to see would be lost."""
_BOTH = 1.0
"""There the network's probability and the difference's evidence add up to this at least; a blurred rim or a shadow is no robot."""


def _square(side: int) -> NDArray[np.uint8]:
    """For large sides: OpenCV takes it row by row and column by column, and a disc of 41 px a hundred times as long."""
    return np.ones((side, side), np.uint8)


def _disc(side: int) -> NDArray[np.uint8]:
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)), np.uint8)
