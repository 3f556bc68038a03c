from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.config.models import PerceptionConfig, QualityConfig
from core.perception import quality
from core.perception.quality import wall_blur_px
from core.perception.tracking import HEAD_AT_BORDER_S, TrackedPath, check_in_view, check_jump, recall, track
from core.types import Centerline, GraphEdge, Masks, Points, Reason, RobotPath, VesselGraph
from tests.core.drawing import depth, probability

CONFIG = PerceptionConfig()
LIMITS = CONFIG.quality
SHAPE = (120, 200)
LINE: Points = np.column_stack([np.arange(20.0, 121.0), np.full(101, 60.0)])
PIECE = Centerline(np.array([[100.0, 62.0], [140.0, 62.0]]), (120.0, 62.0), 20.0)


def path(line: Points = LINE, **more: float | None) -> RobotPath:
    values: dict[str, float | None] = {"score": 1.3, "runner_up": None, "bridged_px": 0.0, "radius_px": 4.0} | more
    return RobotPath(points=line, entry_on_border=True, **values)


def masks(vessel_from: int = 0, vessel_probability: float = 1.0, robot_probability: float = 1.0) -> Masks:
    """A vessel band from a column on, and the robot along ``LINE``."""
    vessel, robot = np.zeros(SHAPE, bool), np.zeros(SHAPE, bool)
    vessel[40:81, vessel_from:] = True
    robot[56:65, 20:121] = True
    return Masks(vessel, robot, (vessel * vessel_probability).astype(np.float32), (robot * robot_probability).astype(np.float32))


def softened(found: Masks, sigma_px: float) -> Masks:
    """The same masks, of a network that is less sure of the vessel's walls."""
    return replace(found, vessel_probability=cv2.GaussianBlur(found.vessel_probability, (0, 0), sigma_px))


def picture(kind: str) -> np.ndarray:
    image = np.full((480, 640, 3), 170, np.uint8)
    for x in range(60, 600, 90):
        cv2.line(image, (x, 40), (x + 40, 440), (70, 60, 60), 9, cv2.LINE_AA)
    match kind:
        case "black":
            return (image // 30).astype(np.uint8)
        case "white":
            return np.full_like(image, 254)
        case "blurred":
            return cv2.GaussianBlur(image, (0, 0), 25)
        case _:
            return image


@pytest.mark.parametrize(
    ("kind", "reason"), [("black", Reason.BLACK), ("white", Reason.WHITE), ("sharp", None), ("blurred", Reason.BLURRED)]
)
def test_images_that_show_nothing(kind: str, reason: Reason | None) -> None:
    refusal = quality.check_image(picture(kind), QualityConfig(min_sharpness=0.03))
    assert (refusal.reason if refusal else None) is reason


@pytest.mark.parametrize("scale_px", [1.0, 2.0, 4.0])
def test_wall_blur_is_the_width_of_the_doubt_at_a_wall(scale_px: float) -> None:
    beside = np.abs(np.arange(300.0) - 150.0) - 40.0
    probability = np.tile((1 / (1 + np.exp(beside / scale_px))).astype(np.float32)[:, None], (1, 300))
    found = Masks(probability >= 0.5, np.zeros((300, 300), bool), probability, np.zeros((300, 300), np.float32))
    turned = replace(found, vessel=np.ascontiguousarray(found.vessel.T), vessel_probability=probability.T.copy())
    # From 0.1 to 0.9: ln(9) scales to each side of the middle.
    assert wall_blur_px(found, (150.0, 150.0)) == pytest.approx(2 * np.log(9) * scale_px, rel=0.12)
    assert wall_blur_px(turned, (150.0, 150.0)) == pytest.approx(wall_blur_px(found, (150.0, 150.0)), rel=1e-3)


def test_wall_blur_is_of_what_lies_beside_the_head_and_known_everywhere() -> None:
    sharp = masks()
    assert wall_blur_px(sharp, (120.0, 60.0)) < 0.01
    assert wall_blur_px(softened(sharp, 3.0), (120.0, 60.0)) > 4.0
    away = replace(sharp, vessel_probability=sharp.vessel_probability.copy())
    away.vessel_probability[:, :40] = 0.5
    assert wall_blur_px(away, (120.0, 60.0)) < 0.01
    full = np.ones(SHAPE, np.float32)
    for head in ((0.0, 0.0), (-2.0, 60.0), (199.0, 119.0)):
        assert np.isfinite(wall_blur_px(sharp, head))
        assert wall_blur_px(Masks(full > 0, sharp.robot, full, sharp.robot_probability), head) == 0.0


def test_a_halo_is_no_vessel() -> None:
    halo = replace(masks(), vessel_probability=np.where(masks().vessel, np.float32(0.6), np.float32(0.3)))
    refusal = quality.check_walls(halo, (120.0, 60.0), LIMITS)
    assert refusal.reason is Reason.NO_VESSEL
    assert "(at most 12.0 px)" in refusal.detail
    assert quality.check_walls(halo, (120.0, 60.0), QualityConfig(enabled=False)) is None
    assert quality.check_walls(halo, (120.0, 60.0), QualityConfig(max_wall_blur_px=1000.0)) is None
    assert quality.check_walls(softened(masks(), 2.0), (120.0, 60.0), LIMITS) is None


def test_sharpness_is_only_asked_where_a_limit_is_set() -> None:
    assert quality.check_image(picture("blurred"), QualityConfig(min_sharpness=0.0)) is None


def test_sharpness_depends_on_blur_and_not_on_exposure_or_noise() -> None:
    sharp = picture("sharp")
    values = [quality.sharpness(cv2.GaussianBlur(sharp, (0, 0), sigma)) for sigma in (0.5, 2.0, 5.0, 12.0)]
    assert values == sorted(values, reverse=True)
    assert values[0] > 2 * values[2]
    assert values[0] > 3 * values[3]
    assert quality.sharpness((sharp // 3).astype(np.uint8)) == pytest.approx(quality.sharpness(sharp), rel=0.1)
    noise = np.random.default_rng(0).normal(0, 6, sharp.shape)
    noisy = np.clip(cv2.GaussianBlur(sharp, (0, 0), 12.0) + noise, 0, 255).astype(np.uint8)
    assert quality.sharpness(noisy) < 2 * values[3] + 0.02


def test_empty_masks_say_which() -> None:
    found, nothing = masks(), np.zeros(SHAPE, bool)
    assert quality.check_masks(found) is None
    no_vessel = quality.check_masks(Masks(nothing, found.robot, found.vessel_probability * 0.4, found.robot_probability))
    no_robot = quality.check_masks(Masks(found.vessel, nothing, found.vessel_probability, found.robot_probability * 0.3))
    assert str(no_vessel) == "no vessel: highest vessel probability 0.40"
    assert str(no_robot) == "no robot: highest robot probability 0.30"


def test_a_mask_of_which_cleaning_left_nothing_is_called_specks() -> None:
    found, nothing = masks(), np.zeros(SHAPE, bool)
    refusal = quality.check_masks(Masks(nothing, found.robot, found.vessel_probability, found.robot_probability))
    assert str(refusal) == "no vessel: highest vessel probability 1.00, but only in specks"


def test_what_covers_half_of_the_image_is_no_robot() -> None:
    found, everywhere = masks(), np.ones(SHAPE, bool)
    everywhere[: SHAPE[0] // 2] = False
    refusal = quality.check_masks(Masks(found.vessel, everywhere, found.vessel_probability, found.robot_probability))
    assert str(refusal) == "no robot: what looks like it covers 50 % of the image (at most 30 %)"


def test_no_graph_is_no_vessel_where_the_graph_is_asked() -> None:
    nothing = VesselGraph(np.empty((0, 2)), ())
    some = VesselGraph(LINE[[0, -1]], (GraphEdge(0, 1, LINE, np.full(len(LINE), 20.0)),))
    refusal = quality.check_graph(nothing, CONFIG.vectors)
    assert refusal.reason is Reason.NO_VESSEL
    assert quality.check_graph(some, CONFIG.vectors) is None
    assert quality.check_graph(nothing, CONFIG.vectors.model_copy(update={"vessel_rule": "window"})) is None


@pytest.mark.parametrize(
    ("found", "where", "text"),
    [
        (path(), masks(), None),
        (path(LINE[:20]), masks(), "robot too short: 19 px long (at least 20 px)"),
        (path(bridged_px=50.0), masks(), "repaired gap too long: 50 % of the robot is bridged (at most 40 %)"),
        (path(), masks(vessel_from=101), "robot outside vessel: 49 % of its last 40 px lie in the vessel (at least 60 %)"),
        (path(), masks(vessel_from=95), None),  # 26 of 41
    ],
)
def test_paths_that_are_refused_say_the_value_and_its_limit(found: RobotPath, where: Masks, text: str | None) -> None:
    refusal = quality.check_path(found, where, CONFIG)
    assert (None if refusal is None else str(refusal)) == text


def test_no_centerline_and_two_that_fit_alike() -> None:
    assert quality.check_centerline(PIECE, PIECE.nearest, LIMITS) is None
    missing = quality.check_centerline(None, PIECE.nearest, LIMITS)
    tied = quality.check_centerline(Centerline(PIECE.piece, PIECE.nearest, 20.0, ambiguity=0.85), PIECE.nearest, LIMITS)
    clearer = quality.check_centerline(Centerline(PIECE.piece, PIECE.nearest, 20.0, ambiguity=0.75), PIECE.nearest, LIMITS)
    assert clearer is None
    assert missing.reason is Reason.NO_VESSEL
    assert tied.reason is Reason.AMBIGUOUS_BRANCH
    assert "85 %" in tied.detail
    assert "80 %" in tied.detail


def test_a_head_farther_from_the_centerline_than_any_lumen_reaches_is_in_a_vessel_that_was_not_found() -> None:
    assert quality.check_centerline(PIECE, (120.0, 115.0), LIMITS) is None  # 53 px of 2.5 * 20 + 4
    far = quality.check_centerline(PIECE, (120.0, 163.0), LIMITS)
    assert str(far) == "robot outside vessel: its head is 101 px from the nearest centerline (at most 54 px)"
    assert quality.check_centerline(PIECE, (120.0, 163.0), QualityConfig(enabled=False)) is None


def test_confidence_is_one_when_nothing_speaks_against() -> None:
    assert quality.uncalibrated_confidence(path(), PIECE, masks(), CONFIG) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("found", "piece", "where"),
    [
        (path(), PIECE, masks(robot_probability=0.7)),
        (path(), PIECE, masks(vessel_probability=0.7)),
        (path(), PIECE, masks(vessel_from=95)),
        (path(bridged_px=30.0), PIECE, masks()),
        (path(runner_up=1.25), PIECE, masks()),
        (path(), Centerline(PIECE.piece, PIECE.nearest, 20.0, ambiguity=0.8), masks()),
    ],
)
def test_each_doubt_lowers_the_confidence(found: RobotPath, piece: Centerline, where: Masks) -> None:
    assert 0.0 <= quality.uncalibrated_confidence(found, piece, where, CONFIG) < 0.9


def test_low_confidence_is_refused_with_both_numbers() -> None:
    assert quality.check_confidence(0.3, LIMITS) is None
    assert str(quality.check_confidence(0.21, LIMITS)) == "low confidence: 21 % (at least 30 %)"


# ---- memory of a stream ----

TRACKING = CONFIG.tracking
MEMORY = TrackedPath(path(), captured_s=10.0)


@pytest.mark.parametrize(("now_s", "kept"), [(10.0, True), (10.03, True), (10.5, True), (10.51, False), (9.9, False)])
def test_the_memory_fades_and_does_not_look_into_the_future(now_s: float, kept: bool) -> None:
    assert (recall(MEMORY, now_s, TRACKING).path is MEMORY.path) is kept


def test_no_memory_and_tracking_switched_off() -> None:
    assert recall(None, 10.0, TRACKING).path is None
    assert recall(MEMORY, 10.0, TRACKING.model_copy(update={"enabled": False})).path is None


def test_a_head_cannot_jump_farther_than_the_robot_moves() -> None:
    limit_px = TRACKING.max_head_speed_px_s / 30 + 12
    for shift, refused in ((0.0, False), (limit_px - 1, False), (limit_px + 1, True)):
        jump = check_jump(path(LINE + [shift, 0.0]), MEMORY, 10.0 + 1 / 30, TRACKING)
        assert (jump is not None) is refused
        assert jump is None or jump.reason is Reason.HEAD_JUMP
    far = path(LINE + [70.0, 0.0])
    assert check_jump(far, MEMORY, 11.0, TRACKING) is None  # the memory has faded: the new place is accepted
    assert check_jump(far, None, 10.0, TRACKING) is None


def test_a_head_that_has_met_the_border_for_longer_than_a_moment_may_be_out_of_view() -> None:
    inside, outside = (np.array([[20.0, 240.0], [tip, 240.0]]) for tip in (600.0, 639.0))
    memory: TrackedPath | None = None
    told = []
    for step, line in enumerate([inside, *[outside] * 5, *[inside] * 3, *[outside] * 5]):
        mask = probability(depth(line + [[0.0, 0.0], [2.0, 0.0]], 4.0)) >= 0.5
        memory = track(path(line), mask, memory, 0.09 * step, CONFIG)
        refusal = check_in_view(memory, CONFIG)
        assert refusal is None or refusal.reason is Reason.AMBIGUOUS_PATH
        told.append(refusal is None)
    assert told == [True, True, True, True, True, False, False, True, True, True, True, True, True, False]
    # A gap in which nothing was found brings it back no more than a frame does; after a long one it has arrived anew.
    assert check_in_view(track(path(outside), mask, memory, 9.0, CONFIG), CONFIG) is not None
    assert track(path(outside), mask, memory, 12.0, CONFIG).border_s == 12.0
    assert check_in_view(TrackedPath(path(outside), 9.0, 5.0), PerceptionConfig(quality=QualityConfig(enabled=False))) is None


def test_only_a_head_that_was_seen_well_within_the_picture_came_from_there() -> None:
    within, beside, border = (np.array([[300.0, 240.0], [tip, 240.0]]) for tip in (580.0, 630.0, 639.0))
    mask = probability(depth(border, 4.0)) >= 0.5
    memory: TrackedPath | None = None
    told = []
    seen = ((0.0, beside), (0.1, border), (0.2, within), (0.3, beside), (0.4, border), (2.0, border), (4.0, within[::-1]))
    for at_s, line in seen:
        memory = track(path(line), mask, memory, at_s, CONFIG)
        told.append(memory.came_from_within)
    assert told == [False, False, True, True, True, True, True], "also over a gap, where it is the same one"
    went_on = track(path(beside), mask, track(path(within), mask, None, 0.0, CONFIG), 3.0, CONFIG)
    assert went_on.came_from_within, "in a gap it has gone on along itself"
    assert not track(path(beside[::-1] + [327.0, 0.0]), mask, memory, 6.0, CONFIG).came_from_within, "another one may be none"
    assert not track(path(border), mask, memory, 20.0, CONFIG).came_from_within


@pytest.mark.parametrize("frame_s", [1 / 30, 0.05, 0.2])
def test_a_mask_that_flickers_at_the_border_shows_no_head(frame_s: float) -> None:
    """Its end is cut off in single frames: the head is where it was, out of view or at the border, and does not come and go."""
    outside, cut_off = (np.array([[20.0, 240.0], [tip, 240.0]]) for tip in (639.0, 622.0))
    flicker = [cut_off if step % 3 == 2 else outside for step in range(30)]
    memory: TrackedPath | None = None
    told = []
    for step, line in enumerate([*flicker, *[cut_off] * 6]):
        mask = probability(depth(line + [[0.0, 0.0], [2.0, 0.0]], 4.0)) >= 0.5
        memory = track(path(line), mask, memory, frame_s * step, CONFIG)
        told.append(check_in_view(memory, CONFIG) is None)
    refused = told.index(False)
    assert frame_s * refused == pytest.approx(HEAD_AT_BORDER_S, abs=frame_s)
    assert not any(told[refused:30])
    assert told[-2:] == [True, True], "it has come back"


def test_a_head_beside_the_border_that_touches_it_in_single_frames_is_in_view() -> None:
    short_of_it, touching = (np.array([[20.0, 240.0], [tip, 240.0]]) for tip in (628.0, 639.0))
    memory: TrackedPath | None = None
    for step in range(40):
        line = touching if step % 5 == 4 else short_of_it
        mask = probability(depth(line + [[0.0, 0.0], [2.0, 0.0]], 4.0)) >= 0.5
        memory = track(path(line), mask, memory, step / 30, CONFIG)
        assert check_in_view(memory, CONFIG) is None
