"""The stages together, behind a network that returns what each test has drawn."""

import cv2
import numpy as np
import pytest

from core.config.models import Config, PerceptionConfig, TrackingConfig
from core.control.frame_reports import is_sound
from core.perception import quality
from core.perception.inference import OpenVinoSegmenter
from core.perception.model_file import ModelInfo
from core.perception.pipeline import CalibratedSegmenter, NoPerception, Pipeline, open_pipeline
from core.perception.quality import ConfidenceFeatures
from core.perception.segmentation import OrientationAverage, Segmenter, to_working
from core.perception.tracking import TURN_S
from core.types import Frame, Image, Masks, Points, PoseState, Reason, Scene
from hardware.twin.world import TwinWorld
from tests.core.drawing import SIZE, curve, depth, probability

CONFIG = PerceptionConfig()
STAGES = ["prepare", "network", "masks", "skeletons", "gaps", "graph", "path", "pose", "total"]
VESSEL = curve((-30, 240), (200, 220), (420, 260), (680, 230))
LUMEN = probability(depth(VESSEL, 22.0))
NOTHING = np.zeros((SIZE[1], SIZE[0]), np.float32)
FRAME_S = 1 / 30


class DrawnNetwork(Segmenter):
    """Gives what was drawn last, in the size of the image, and counts how often it is asked."""

    info = ModelInfo(name="drawn", shape={"fold": 1}, stride=16, weights_sha256="0" * 64, onnx_sha256="0" * 64)
    engine = "drawn by hand"

    def __init__(self) -> None:
        self.vessel = LUMEN
        self.robot = NOTHING
        self.shapes: list[tuple[int, ...]] = []

    def draw(self, *lines: Points) -> None:
        self.robot = probability(*(depth(line, 4.0) for line in lines)) if lines else NOTHING

    def draw_up_to(self, x: float) -> None:
        """A robot along the vessel, its head at about this column."""
        self.draw(VESSEL[VESSEL[:, 0] <= x] + [0.0, 3.0])

    def __call__(self, image: Image) -> tuple[np.ndarray, np.ndarray]:
        self.shapes.append(image.shape)
        size = image.shape[1], image.shape[0]
        return cv2.resize(self.vessel, size), cv2.resize(self.robot, size)


@pytest.fixture
def network() -> DrawnNetwork:
    network = DrawnNetwork()
    network.draw_up_to(300)
    return network


@pytest.fixture
def pipeline(network: DrawnNetwork) -> Pipeline:
    return Pipeline(network, CONFIG)


def frame(captured_s: float = 0.0, size: tuple[int, int] = SIZE, grey: int = 120) -> Frame:
    return Frame(round(captured_s * 30), captured_s, np.full((size[1], size[0], 3), grey, np.uint8))


def reason(scene: Scene) -> Reason | None:
    assert (scene.pose is None) is (scene.refusal is not None), "exactly one of the two"
    return scene.refusal.reason if scene.refusal is not None else None


def test_a_frame_goes_through_all_stages_in_order(pipeline: Pipeline) -> None:
    scene = pipeline.perceive_single(frame(2.0))
    assert reason(scene) is None
    assert list(scene.latency_ms) == STAGES
    assert sum(scene.latency_ms[stage] for stage in STAGES[:-1]) <= scene.latency_ms["total"]
    assert (scene.frame_index, scene.captured_s, scene.source_size, scene.scale) == (60, 2.0, SIZE, 1.0)
    assert scene.path.head[0] == pytest.approx(300, abs=1.5)
    assert scene.pose.d_head_px == pytest.approx(3, abs=1)
    assert scene.pose.theta_deg < 5.0
    assert pipeline.engine == "drawn by hand"


@pytest.mark.parametrize(("grey", "expected"), [(0, Reason.BLACK), (255, Reason.WHITE)])
def test_a_frame_that_shows_nothing_never_reaches_the_network(
    pipeline: Pipeline, network: DrawnNetwork, grey: int, expected: Reason
) -> None:
    scene = pipeline(frame(grey=grey))
    assert reason(scene) is expected
    assert network.shapes == []
    assert list(scene.latency_ms) == ["prepare", "total"]


def test_a_refusal_keeps_what_was_found_before_it(pipeline: Pipeline, network: DrawnNetwork) -> None:
    network.draw()
    scene = pipeline.perceive_single(frame())
    assert reason(scene) is Reason.NO_ROBOT
    assert scene.masks is not None
    assert scene.skeletons is None
    assert list(scene.latency_ms) == ["prepare", "network", "masks", "total"]


def test_a_vessel_without_clear_walls_is_none_and_is_kept_to_be_looked_at(pipeline: Pipeline, network: DrawnNetwork) -> None:
    network.vessel = cv2.GaussianBlur(network.vessel, (0, 0), 7.0)
    scene = pipeline.perceive_single(frame())
    assert reason(scene) is Reason.NO_VESSEL
    assert "blurred over" in str(scene.refusal)
    assert scene.masks is not None
    assert scene.path is not None
    assert scene.vessel_vector is not None


# ---- how steady an answer is ----


def swings(network: DrawnNetwork) -> tuple[float, float]:
    """Of theta and head, as they lie in the evidence."""
    scene = Pipeline(network, CONFIG, single=CalibratedSegmenter(network, sensitivity=True)).perceive_single(frame())
    assert reason(scene) is None
    assert list(scene.latency_ms) == [*STAGES[:-1], "sensitivity", "total"]
    named = dict(zip(ConfidenceFeatures.names(), scene.evidence, strict=True))
    return named["theta_swing"], named["head_swing"]


def test_a_clear_answer_stays_as_it_is_whatever_number_draws_the_edges(network: DrawnNetwork) -> None:
    theta, head = swings(network)
    assert 0.0 <= theta < np.log1p(1.0)
    assert 0.0 <= head < np.log1p(1.0)


def test_an_answer_that_hangs_on_that_number_is_told_by_its_swing(network: DrawnNetwork) -> None:
    """Beyond the head lies a bent piece that two of the four ways take for robot."""
    bent = curve((270, 239), (300, 243), (325, 258), (345, 278))
    network.robot = np.maximum(network.robot, np.float32(0.45) * probability(depth(bent, 4.0)))
    theta, head = swings(network)
    assert theta > np.log1p(10.0) / 3
    assert head > np.log1p(20.0) / 3
    assert len(network.shapes) == 1, "the network is not asked again"


def test_an_answer_that_is_lost_counts_as_the_largest_swing() -> None:
    same, lost = (
        quality.threshold_sensitivity(((10.0, 10.0), 5.0), [((10.0, 10.0), 5.0)]),
        quality.threshold_sensitivity(((10.0, 10.0), 5.0), [None]),
    )
    assert same == (0.0, 0.0)
    assert lost == quality.threshold_sensitivity(((10.0, 10.0), 5.0), [((500.0, 10.0), 120.0)])
    assert quality.threshold_sensitivity(((0.0, 0.0), 179.0), [((3.0, 4.0), -179.0)]) == pytest.approx((np.log(3.0), np.log(6.0)))


def test_edges_are_drawn_wider_and_narrower_all_four_ways() -> None:
    shares = np.linspace(0.0, 1.0, 101, dtype=np.float32)[None]
    masks = Masks(shares >= 0.5, shares >= 0.5, shares, shares)
    edges = [tuple(round(float(shares[p >= 0.5].min()), 2) for p in ways) for ways in quality.shifted_probabilities(masks)]
    assert sorted(edges) == [(0.34, 0.34), (0.34, 0.67), (0.67, 0.34), (0.67, 0.67)]


def test_in_a_stream_what_is_known_to_be_no_robot_does_not_lower_the_confidence(network: DrawnNetwork) -> None:
    """The same stream with printed text ahead and without gives the same evidence, and so the same confidence."""
    text = VESSEL[(VESSEL[:, 0] >= 420) & (VESSEL[:, 0] <= 450)]
    told = []
    for others in ((), (text,)):
        pipeline = Pipeline(network, CONFIG)
        for k, x in enumerate(range(270, 411, 5)):
            network.draw(VESSEL[VESSEL[:, 0] <= x], *others)
            scene = pipeline(frame(k * FRAME_S))
        told.append((scene.evidence, scene.pose.confidence))
        if others:
            assert scene.masks.robot_probability[:, 420:450].max() > 0.9, "it is still shown"
    (without, sure), (beside, as_sure) = told
    assert beside == pytest.approx(without, abs=0.01)
    assert as_sure == pytest.approx(sure, abs=0.01)


# ---- single images and streams ----

STEM = [(-20.0, 240.0), (120.0, 240.0), (200.0, 240.0)]
UP, DOWN = curve(*STEM, (260, 215), (330, 180)), curve(*STEM, (260, 265), (330, 300))


@pytest.mark.parametrize(
    ("which", "pitch_px", "expected", "reached"),
    [
        ("vessel", 4, Reason.NO_VESSEL, "masks"),
        ("robot", 4, Reason.NO_ROBOT, "masks"),
        ("vessel", 40, Reason.NO_VESSEL, "graph"),
        ("robot", 40, Reason.AMBIGUOUS_PATH, "path"),
    ],
)
def test_a_hopeless_mask_is_refused_by_name_and_early(
    pipeline: Pipeline, network: DrawnNetwork, which: str, pitch_px: int, expected: Reason, reached: str
) -> None:
    net = np.zeros((SIZE[1], SIZE[0]), np.float32)
    for width in range(max(1, pitch_px // 8)):
        net[width::pitch_px] = net[:, width::pitch_px] = 1.0
    setattr(network, which, net)
    scene = pipeline.perceive_single(frame())
    assert reason(scene) is expected
    assert list(scene.latency_ms)[-2] == reached


def test_the_last_frame_decides_in_a_stream_and_not_in_a_single_image(pipeline: Pipeline, network: DrawnNetwork) -> None:
    network.vessel = np.ones_like(NOTHING)
    network.draw(UP, DOWN)
    alone = pipeline.perceive_single(frame()).path
    chosen_alone_is_up = alone.head[1] < 240
    before, other = (DOWN, UP) if chosen_alone_is_up else (UP, DOWN)
    network.draw(before)
    pipeline(frame(0.0))
    network.draw(UP, DOWN)
    in_stream = pipeline(frame(FRAME_S)).path
    assert in_stream.head == pytest.approx(tuple(before[-1]), abs=2.0)
    again = pipeline.perceive_single(frame(FRAME_S)).path
    assert again.head == pytest.approx(tuple(other[-1]), abs=2.0)


def test_a_jump_is_refused_until_the_memory_has_faded(pipeline: Pipeline, network: DrawnNetwork) -> None:
    assert reason(pipeline(frame(0.0))) is None
    network.draw_up_to(450)
    jumped = pipeline(frame(FRAME_S))
    assert reason(jumped) is Reason.HEAD_JUMP
    assert jumped.path is not None, "it is still drawn"
    assert reason(pipeline.perceive_single(frame(FRAME_S))) is None
    network.draw_up_to(305)
    assert reason(pipeline(frame(2 * FRAME_S))) is None, "the refused place was not remembered"
    network.draw_up_to(450)
    assert reason(pipeline(frame(3 * FRAME_S))) is Reason.HEAD_JUMP
    assert reason(pipeline(frame(2 * FRAME_S + CONFIG.tracking.memory_s + 0.01))) is None


@pytest.mark.parametrize(
    ("vessel_x", "robot_x", "lost"),
    [(-30.0, -25.0, range(0)), (60.0, 65.0, range(0)), (-30.0, 70.0, range(30, 50))],
    ids=["comes in at the border", "from a fitting at the vessel's end", "out of a sheath in a vessel, with a gap of a second"],
)
def test_a_head_that_has_left_the_picture_is_refused_within_half_a_second_until_it_comes_back(
    pipeline: Pipeline, network: DrawnNetwork, vessel_x: float, robot_x: float, lost: range
) -> None:
    network.vessel = probability(depth(VESSEL[VESSEL[:, 0] >= vessel_x], 22.0))
    robot = VESSEL[VESSEL[:, 0] >= robot_x] + [0.0, 3.0]
    heads = [*range(560, 680, 8), *[680] * 60, *range(660, 560, -8)]
    scenes = []
    for step, head_x in enumerate(heads):
        network.draw(*([robot[robot[:, 0] <= head_x]] if step not in lost else []))
        scenes.append(pipeline(frame(0.05 * step)))
        if scenes[-1].pose is not None:
            assert scenes[-1].path.head[0] == pytest.approx(min(head_x, SIZE[0] - 1), abs=3.0), "the tail was never taken for it"
    answered = [scene.pose is not None for scene in scenes]
    arrived = next(index for index, head_x in enumerate(heads) if head_x > SIZE[0])
    assert all(answered[: arrived + 4]), "a head that has just arrived is there"
    assert not any(answered[arrived + 10 : 75])
    assert {reason(scenes[step]) for step in range(arrived + 10, 75) if step not in lost} == {Reason.AMBIGUOUS_PATH}
    assert all(answered[-3:])


def _draw_tapered(network: DrawnNetwork, left_x: float, right_x: float, *, thick: str) -> None:
    """A robot both of whose ends lie in the picture, thicker at one of them: by itself that one is taken for the tail."""
    line = VESSEL[(VESSEL[:, 0] >= left_x) & (VESSEL[:, 0] <= right_x)]
    middle_x = 0.5 * (left_x + right_x)
    part = line[line[:, 0] < middle_x] if thick == "left" else line[line[:, 0] > middle_x]
    network.robot = probability(depth(line, 3.0), depth(part, 5.0))


@pytest.mark.parametrize("lost_s", [0.2, 1.0])
@pytest.mark.parametrize("lost", ["not seen", "refused"])
def test_frames_that_were_lost_do_not_make_the_tail_the_head(
    pipeline: Pipeline, network: DrawnNetwork, lost: str, lost_s: float
) -> None:
    _draw_tapered(network, 180.0, 420.0, thick="left")
    before = pipeline(frame(0.0))
    assert before.path.head[0] == pytest.approx(420.0, abs=3.0)
    clear = network.vessel
    for step in range(1, round(lost_s / FRAME_S)):
        if lost == "refused":
            network.vessel = cv2.GaussianBlur(clear, (0, 0), 7.0)
        else:
            network.draw()
        assert reason(pipeline(frame(step * FRAME_S))) is not None
    network.vessel = clear
    _draw_tapered(network, 200.0, 430.0, thick="right")
    alone, after = pipeline.perceive_single(frame(lost_s)).path, pipeline(frame(lost_s)).path
    assert alone.head[0] == pytest.approx(200.0, abs=3.0)
    assert after.head[0] == pytest.approx(430.0, abs=3.0)


@pytest.mark.parametrize("change", ["long ago", "elsewhere", "wound back", "switched off"])
def test_a_robot_that_may_have_turned_about_is_judged_by_itself(network: DrawnNetwork, change: str) -> None:
    memory_s = 0.0 if change == "switched off" else CONFIG.tracking.memory_s
    pipeline = Pipeline(network, PerceptionConfig(tracking=TrackingConfig(memory_s=memory_s)))
    left_x, right_x = (20.0, 170.0) if change == "elsewhere" else (180.0, 420.0)
    _draw_tapered(network, left_x, right_x, thick="left")
    assert pipeline(frame(20.0)).path is not None
    _draw_tapered(network, 200.0, 430.0, thick="right")
    later_s = {"long ago": TURN_S + 0.1, "wound back": -1.0}.get(change, 1.0)
    path = pipeline(frame(20.0 + later_s)).path
    assert path.head[0] == pytest.approx(200.0, abs=3.0)


def test_after_a_reset_any_place_is_accepted(pipeline: Pipeline, network: DrawnNetwork) -> None:
    pipeline(frame(0.0))
    network.draw_up_to(450)
    pipeline.reset()
    assert reason(pipeline(frame(FRAME_S))) is None


def test_without_tracking_each_frame_stands_alone(network: DrawnNetwork) -> None:
    pipeline = Pipeline(network, CONFIG.model_copy(update={"tracking": TrackingConfig(enabled=False)}))
    pipeline(frame(0.0))
    network.draw_up_to(450)
    assert reason(pipeline(frame(FRAME_S))) is None


# ---- sizes ----


def test_a_larger_frame_gives_the_same_answer_in_its_own_pixels(pipeline: Pipeline, network: DrawnNetwork) -> None:
    small, large = pipeline.perceive_single(frame()), pipeline.perceive_single(frame(size=(2560, 1920)))
    assert network.shapes == [(480, 640, 3)] * 2
    assert large.scale == 0.25
    assert large.path.head == pytest.approx(small.path.head)
    assert large.to_source(large.path.head) == pytest.approx([4 * value + 1.5 for value in small.path.head])


def test_a_frame_of_another_size_in_the_stream_is_a_new_stream(pipeline: Pipeline, network: DrawnNetwork) -> None:
    assert reason(pipeline(frame(0.0))) is None
    portrait = pipeline(frame(FRAME_S, size=(360, 640)))  # the head lies elsewhere in it, and that is no jump
    assert portrait.source_size == (360, 640)
    assert network.shapes[-1] == (640, 360, 3)
    assert reason(portrait) is not Reason.HEAD_JUMP
    assert reason(pipeline(frame(2 * FRAME_S))) is None


@pytest.mark.parametrize("size", [SIZE, (1280, 960), (3000, 2251)])
def test_a_target_in_source_pixels_becomes_a_route(pipeline: Pipeline, network: DrawnNetwork, size: tuple[int, int]) -> None:
    branch = curve((380, 252), (450, 330), (520, 440))
    network.vessel = probability(depth(VESSEL, 22.0), depth(branch, 18.0))
    target = 500 * size[0] / 640, 408 * size[1] / 480
    scene = pipeline(frame(size=size), target)
    assert scene.to_source(scene.route.target) == pytest.approx(target, abs=8 * size[0] / 640)
    assert scene.route.points[-1] == pytest.approx((500, 408), abs=8.0)
    assert scene.route.points[0] == pytest.approx((300, 244), abs=12.0)
    assert pipeline(frame(size=size)).route is None


@pytest.mark.parametrize("value", [np.nan, -np.inf])
@pytest.mark.parametrize("which", ["vessel", "robot"])
def test_numbers_that_are_none_are_refused_before_any_geometry(
    pipeline: Pipeline, network: DrawnNetwork, which: str, value: float
) -> None:
    """In a part of the picture, as a broken layer gives them; the rig must not end for them."""
    whole = getattr(network, which)
    for seed in range(2):
        random = np.random.default_rng(seed)
        broken = whole.copy()
        if seed % 2:
            broken[random.random(broken.shape) < 0.002] = value
        else:
            top, left = random.integers(150, 260), random.integers(100, 400)
            broken[top : top + 60, left : left + 60] = value
        setattr(network, which, broken)
        for see in (pipeline, pipeline.perceive_single):
            scene = see(frame(seed * FRAME_S))
            assert str(scene.refusal) == "low confidence: the network's output is not finite"
            assert not is_sound(scene)
    setattr(network, which, whole)
    assert pipeline(frame(1.0)).pose is not None


def test_a_target_beside_the_vessel_leaves_the_pose_and_says_why(pipeline: Pipeline) -> None:
    scene = pipeline(frame(), (600.0, 40.0))
    assert scene.pose is not None
    assert scene.route is None
    assert "px beside the vessel" in scene.route_problem
    assert pipeline(frame()).route_problem == ""


def _cut_at(vessel: np.ndarray, left: int, right: int) -> np.ndarray:
    cut = vessel.copy()
    cut[:, left:right] = 0.0
    return cut


def test_in_a_stream_a_way_that_was_seen_holds_over_a_gap(pipeline: Pipeline, network: DrawnNetwork) -> None:
    target, whole = (560.0, 246.0), network.vessel
    for step in range(17, 0, -1):
        first = pipeline(frame(1.0 - step * FRAME_S), target)
        assert first.route is not None
    network.vessel = _cut_at(whole, 440, 465)
    later = pipeline(frame(1.0), target)
    assert later.route_problem == ""
    assert later.route.length_px == pytest.approx(first.route.length_px, abs=6.0)
    alone = pipeline.perceive_single(frame(1.0 + FRAME_S), target)
    assert alone.route is None
    assert alone.route_problem == "no vessel that was found leads there"
    pipeline.reset()
    assert pipeline(frame(1.0 + 2 * FRAME_S), target).route is None
    network.vessel = whole
    assert pipeline(frame(1.0 + 3 * FRAME_S), target).route is not None
    network.vessel = _cut_at(whole, 440, 465)
    assert pipeline(frame(1.0 + 4 * FRAME_S), target).route is None, "it was seen for one frame only"


@pytest.mark.parametrize("wrong", ["a jump", "not believed"])
def test_in_a_stream_a_frame_that_is_refused_does_not_undo_the_way_that_was_seen(
    pipeline: Pipeline, network: DrawnNetwork, wrong: str
) -> None:
    """What makes a head jump for a frame, a reflection, cuts the vessel or joins two of them in the same moment."""
    target, whole = (560.0, 246.0), network.vessel
    for step in range(20):
        first = pipeline(frame(step * FRAME_S), target)
    network.draw_up_to(450 if wrong == "a jump" else 320)
    if wrong == "not believed":
        network.vessel = cv2.GaussianBlur(whole, (0, 0), 7.0)
    refused = pipeline(frame(20 * FRAME_S), target)
    assert reason(refused) is (Reason.HEAD_JUMP if wrong == "a jump" else Reason.NO_VESSEL)
    network.draw_up_to(300)
    network.vessel = _cut_at(whole, 440, 465)
    later = pipeline(frame(21 * FRAME_S), target)
    assert later.route.length_px == pytest.approx(first.route.length_px, abs=6.0)


# ---- without a model ----


def test_without_a_model_every_frame_is_refused_with_what_to_do() -> None:
    scene = NoPerception("no model 'x'; known: default")(frame(1.0, size=(800, 600)), target=(1.0, 2.0))
    assert str(scene.refusal) == "no model: no model 'x'; known: default"
    assert reason(scene) is Reason.NO_MODEL
    assert (scene.source_size, scene.captured_s, scene.latency_ms) == ((800, 600), 1.0, {"total": 0.0})


def test_all_eight_orientations_are_asked_about_and_turned_back() -> None:
    class Copies(Segmenter):
        engine = "copies"

        def __init__(self) -> None:
            self.shown: list[np.ndarray] = []

        def __call__(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            assert image.flags.c_contiguous
            self.shown.append(image)
            return image[:, :, 0].astype(np.float32), image[:, :, 1].astype(np.float32)

    image = np.random.default_rng(0).integers(0, 256, (4, 6, 3), dtype=np.uint8)
    copies = Copies()
    turned = OrientationAverage(copies)
    vessel, robot = turned(image)
    assert len({(shown.shape, shown.tobytes()) for shown in copies.shown}) == 8
    assert vessel == pytest.approx(image[:, :, 0])
    assert robot == pytest.approx(image[:, :, 1])
    assert turned.engine == "copies, 8 orientations"


@pytest.mark.parametrize(("mirrored", "stream", "single"), [("pictures", 1, 8), ("never", 1, 1)])
def test_the_configuration_says_what_is_seen_in_all_orientations(
    mirrored: str, stream: int, single: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = PerceptionConfig.model_validate({"segmentation": {"mirrored": mirrored, "device": "openvino"}})
    pipeline = open_pipeline(config)
    seen: list[tuple[int, ...]] = []
    infer = OpenVinoSegmenter._infer

    def counted(self: OpenVinoSegmenter, images: list[np.ndarray], *take: object) -> object:
        seen.extend(image.shape for image in images)
        return infer(self, images, *take)

    monkeypatch.setattr(OpenVinoSegmenter, "_infer", counted)
    image = np.random.default_rng(0).integers(60, 200, (120, 160, 3), dtype=np.uint8)
    pipeline(Frame(0, 0.0, image))
    assert len(seen) == stream
    pipeline.perceive_single(Frame(0, 0.0, image))
    assert len(seen) - stream == single


def test_a_stream_that_is_seen_in_all_orientations_tells_what_its_confidence_needs() -> None:
    """The calibration of all orientations asks for swings; without them the confidence is no number, and refuses nothing."""
    config = PerceptionConfig.model_validate({"segmentation": {"mirrored": "always"}, "tracking": {"window_px": 0}})
    world = TwinWorld(Config().twin)
    world.insert(40.0)
    pipeline = open_pipeline(config)
    for same in (pipeline, pipeline.with_config(config)):
        scene = same(world.frame())
        assert 0.0 <= scene.pose.confidence <= 1.0


@pytest.mark.parametrize("later_s", [-2.0, 2.0])
def test_after_a_pause_the_state_of_before_is_not_shown(pipeline: Pipeline, network: DrawnNetwork, later_s: float) -> None:
    for index in range(4):
        before = pipeline(frame(5.0 + index * FRAME_S))
    assert before.pose.state is PoseState.A
    network.draw(curve((-20, 240), (150, 235), (240, 225), (280, 216)))
    after, alone = pipeline(frame(5.0 + later_s)), pipeline.perceive_single(frame(5.0 + later_s))
    assert after.pose.state is alone.pose.state is not PoseState.A


def test_after_the_warm_up_a_stream_meets_no_size_for_the_first_time() -> None:
    """Every size that is met for the first time costs a compilation, in the middle of a stream."""
    pipeline = open_pipeline(CONFIG)
    pipeline.warm_up()
    networks = [pipeline._stream.segment._first, pipeline._stream.segment._near]
    known = [set(network._requests) for network in networks]
    assert all(known)
    world = TwinWorld(Config().twin)
    world.insert(60.0)
    image = world.frame().image
    for index in range(4):
        scene = pipeline(Frame(index, 0.05 * index, image))
    assert scene.window is not None, "the last ones were windows around the head"
    assert [set(network._requests) for network in networks] == known


def test_other_thresholds_act_with_the_same_networks_and_no_memory(pipeline: Pipeline, network: DrawnNetwork) -> None:
    wide = CONFIG.pose.model_copy(update={"d_allow_px": 200.0, "theta_allow_deg": 180.0})
    other = pipeline.with_config(CONFIG.model_copy(update={"pose": wide}))
    scenes = [one.perceive_single(frame()) for one in (pipeline, other, pipeline)]
    assert scenes[1].pose.state is PoseState.A, "everything is allowed"
    assert scenes[0].pose == scenes[2].pose, "the first one is as it was"
    assert other.engine == pipeline.engine


@pytest.mark.parametrize("change", ["none", "picture size", "working size"])
def test_a_stream_goes_on_under_other_thresholds_with_the_same_head(pipeline: Pipeline, network: DrawnNetwork, change: str) -> None:
    """What lies in other pixels is not known any more."""
    _draw_tapered(network, 180.0, 420.0, thick="left")
    assert pipeline(frame(0.0)).pose is not None
    other = CONFIG.model_copy(update={"pose": CONFIG.pose.model_copy(update={"d_allow_px": 9.0})})
    if change == "working size":
        other = other.model_copy(update={"working_size_px": 704})
    after = pipeline.with_config(other)
    after.follow_on(pipeline)
    _draw_tapered(network, 190.0, 424.0, thick="right")
    scene = after(frame(FRAME_S, size=(1280, 960) if change == "picture size" else SIZE))
    head_x = scene.to_source(scene.path.head)[0] * SIZE[0] / scene.source_size[0]
    assert head_x == pytest.approx(424.0 if change == "none" else 190.0, abs=3.0)


@pytest.mark.parametrize("size", [SIZE, (1280, 960)])
@pytest.mark.parametrize(("port_x", "head_x"), [(150.0, 450.0), (450.0, 150.0)])
def test_the_end_at_the_insertion_port_is_the_tail(
    network: DrawnNetwork, port_x: float, head_x: float, size: tuple[int, int]
) -> None:
    """A robot whose ends both lie inside the image; the port is told as a share of the picture, whatever its size."""
    network.draw(VESSEL[(VESSEL[:, 0] >= 150) & (VESSEL[:, 0] <= 450)] + [0.0, 3.0])
    port_y = VESSEL[np.argmin(np.abs(VESSEL[:, 0] - port_x)), 1]
    place = {"port_x_share": port_x / (SIZE[0] - 1), "port_y_share": port_y / (SIZE[1] - 1)}
    path = CONFIG.path.model_copy(update=place)
    scene = Pipeline(network, CONFIG.model_copy(update={"path": path})).perceive_single(frame(size=size))
    assert scene.path.head[0] == pytest.approx(head_x, abs=6.0)
    assert scene.path.entry_on_border


def scene_of(width: int, height: int) -> Scene:
    # One channel is enough to see where a picture's pixels go.
    image, scale_xy = to_working(np.zeros((height, width, 1), np.uint8)[..., 0], 640)
    assert scale_xy == (image.shape[1] / width, image.shape[0] / height)
    return Scene(0, 0.0, (width, height), 640 / max(width, height), scale_xy=scale_xy)


@pytest.mark.parametrize(("width", "height"), [(3000, 1007), (7680, 4321), (5000, 7), (1007, 3000), (640, 480), (320, 200)])
def test_the_pictures_corners_map_onto_each_other(width: int, height: int) -> None:
    """Both sides are rounded to whole working pixels, each by itself: the corners of the picture stay its corners."""
    scene = scene_of(width, height)
    across, down = max(1, round(width * scene.scale)), max(1, round(height * scene.scale))
    corners = np.array([[-0.5, -0.5], [across - 0.5, down - 0.5], [across / 2 - 0.5, down / 2 - 0.5]])
    expected = [[-0.5, -0.5], [width - 0.5, height - 0.5], [width / 2 - 0.5, height / 2 - 0.5]]
    np.testing.assert_allclose(scene.points_to_source(corners), expected, atol=0.01)
    for corner, source in zip(corners.tolist(), expected, strict=True):
        assert scene.to_source(tuple(corner)) == pytest.approx(source, abs=0.01)
        assert scene.to_working(tuple(source)) == pytest.approx(corner, abs=0.01)
