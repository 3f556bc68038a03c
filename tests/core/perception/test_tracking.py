"""What looks like a piece of robot and stays while the robot moves is none; what moves with it, or was robot, is."""

from dataclasses import dataclass, field

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from core.config.models import TrackingConfig
from core.perception.tracking import RouteMemory, StaticArtefacts
from core.types import Image, Mask, Point, RobotPath, Route

HEIGHT, WIDTH = 200, 400
ROW = 100
TEXT = (300, 330)
FRAME_S = 1 / 30
TRAVEL_PX = 15.0


def _stretch(*columns: tuple[float, float], row: int = ROW) -> Mask:
    """A mask of stretches along a row, 8 px wide."""
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    for left, right in columns:
        cv2.rectangle(mask, (round(left), row - 4), (round(right), row + 3), 1, cv2.FILLED)
    return mask.view(np.bool_)


def _path(head_x: float) -> RobotPath:
    points = np.column_stack([np.arange(0.0, head_x + 1.0), np.full(int(head_x) + 1, float(ROW))])
    return RobotPath(points, 0.9, None, True, 0.0, 4.0)


@dataclass
class Stream:
    """Frames in which the path up to ``head_x`` is believed. The board has a structure, and noise of 6 levels."""

    lookalikes: StaticArtefacts = field(default_factory=lambda: StaticArtefacts(TrackingConfig(lookalike_px=TRAVEL_PX)))
    now_s: float = 5.0
    head_x: float = 0.0
    window: tuple[int, int, int, int] | None = None
    board: NDArray[np.float64] = field(
        default_factory=lambda: 150.0 + 30.0 * np.sin(np.arange(WIDTH) / 9.0)[None, :, None] * np.ones((HEIGHT, WIDTH, 3))
    )
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(3))

    def image(self, *robots: tuple[float, float]) -> Image:
        """The board with the robot, dark, where it really is."""
        picture = self.board + self.rng.normal(0.0, 6.0, self.board.shape)
        picture[_stretch(*robots)] = 40.0
        return np.clip(picture, 0, 255).astype(np.uint8)

    def see(self, mask: Mask, head_x: float | None, *, after_s: float = FRAME_S, image: Image | None = None) -> Mask:
        """The mask without what is none; the picture shows the robot up to where its head was believed last."""
        self.now_s += after_s
        self.head_x = head_x if head_x is not None else self.head_x
        picture = self.image((0, self.head_x)) if image is None else image
        left = self.lookalikes.remove(mask, picture, self.now_s, self.window)
        if head_x is not None:
            self.lookalikes.learn(_path(head_x), self.now_s)
        return left

    def advance(self, first: int, last: int, *others: tuple[float, float]) -> Mask:
        """A robot whose end moves from one column to another, a pixel a frame, with other pieces that stay."""
        left = _stretch()
        for x in range(first, last + 1):
            left = self.see(_stretch((0, x), *others), x)
        return left


@pytest.fixture
def stream() -> Stream:
    return Stream()


def test_a_piece_that_stays_while_the_robot_moves_on_is_none(stream: Stream) -> None:
    assert np.array_equal(stream.advance(100, 110, TEXT), _stretch((0, 110), TEXT)), "not known yet"
    assert np.array_equal(stream.advance(111, 125, TEXT), _stretch((0, 125)))


def test_a_tip_that_shows_beyond_a_fitting_is_robot(stream: Stream) -> None:
    """The end that is seen stays at the fitting, and the tip moves."""
    for tip_x in range(260, 330):
        mask = _stretch((0, 200), (255, tip_x))
        assert np.array_equal(stream.see(mask, 200), mask)


@pytest.mark.parametrize("believed", ["always", "now and then"])
def test_a_tip_beyond_a_gap_that_is_bridged_is_robot(stream: Stream, believed: str) -> None:
    """A highlight hides a stretch of it; the path runs on to the tip, and its end moves with the tip."""
    for tip_x in range(235, 300):
        mask = _stretch((0, 200), (225, tip_x))
        head_x = tip_x if believed == "always" or tip_x % 2 else 200
        assert np.array_equal(stream.see(mask, head_x, image=stream.image((0, tip_x))), mask)


def test_where_the_robot_was_nothing_is_learnt(stream: Stream) -> None:
    """A reflection that cuts the robot in two, and a path that ends there for once."""
    stream.advance(200, 260)
    for x in range(150, 190):
        mask = _stretch((0, x), (225, 260))
        assert np.array_equal(stream.see(mask, x), mask)


def test_what_touches_the_border_or_is_large_is_another_robot_perhaps(stream: Stream) -> None:
    for x in range(100, 140):
        for other in (_stretch((370, WIDTH - 1)), _stretch((220, 300))):
            mask = _stretch((0, x)) | other
            assert np.array_equal(stream.see(mask, x), mask)


@pytest.mark.parametrize("text_level", [None, 45.0])
def test_a_robot_that_reaches_it_ends_where_the_picture_has_changed(stream: Stream, text_level: float | None) -> None:
    """Unless text and robot look alike: then nobody can tell, and all is robot."""
    if text_level is not None:
        stream.board[_stretch(TEXT)] = text_level
    stream.advance(100, 290, TEXT)
    assert np.array_equal(stream.see(_stretch((0, 290), TEXT), 290), _stretch((0, 290)))
    for head_x in range(291, TEXT[1] + 1):
        left = stream.see(_stretch((0, TEXT[1])), head_x)
        end_x = int(np.flatnonzero(left[ROW]).max())
        if text_level is None:
            assert end_x == pytest.approx(head_x, abs=5)
            assert left[ROW, : end_x + 1].all()
        else:
            assert end_x >= head_x, "a head behind the real one would be driven on"


def test_what_comes_out_over_it_is_robot_and_stays_so(stream: Stream) -> None:
    """A tip that a fitting hides from the rest."""
    stream.advance(100, 160, TEXT)
    mask = _stretch((0, 160), TEXT)
    for _ in range(60):
        assert np.array_equal(stream.see(mask, 160, image=stream.image((0, 160), TEXT)), mask)


def test_another_light_makes_it_robot_again_rather_than_hiding_one(stream: Stream) -> None:
    stream.advance(100, 160, TEXT)
    stream.board = stream.board - 40.0
    mask = _stretch((0, 160), TEXT)
    for _ in range(30):
        assert np.array_equal(stream.see(mask, 160), mask)


def test_a_camera_that_was_moved_hides_no_tip(stream: Stream) -> None:
    """The end that is seen and the tip beyond the fitting jump together, and the tip lies over its old place."""
    mask = _stretch((0, 200), (255, 300))
    for _ in range(10):
        stream.see(mask, 200, image=stream.image((0, 300)))
    stream.board = np.roll(stream.board, 18, axis=1)
    moved = _stretch((0, 218), (273, 318))
    for _ in range(30):
        left = stream.see(moved, 218, image=stream.image((0, 318)))
    assert np.array_equal(left, moved)


@pytest.mark.parametrize("is_doubted", [True, False])
def test_an_end_that_jumped_teaches_nothing(stream: Stream, is_doubted: bool) -> None:
    """A camera that was moved along the robot, over a board of one colour: nobody else sees it."""
    stream.board[:] = 150.0
    mask, moved = _stretch((0, 200), (255, 300)), _stretch((0, 236), (291, 336))
    for _ in range(10):
        stream.see(mask, 200, image=stream.image((0, 300)))
    for step in range(30):
        left = stream.see(moved, 236 if step > 15 else None, image=stream.image((0, 336)))
        if step <= 15 and is_doubted:
            stream.lookalikes.distrust()
    assert np.array_equal(left, moved) is is_doubted


def test_a_part_that_was_robot_is_robot_for_as_long_as_it_is_seen(stream: Stream) -> None:
    """The robot rests, and glare cuts its tip off for half a minute. Then the glare's edge creeps along the body."""
    stream.advance(240, 300)
    for _ in range(60):
        stream.see(_stretch((0, 200), (255, 300)), 200, after_s=0.5, image=stream.image((0, 300)))
    for x in range(200, 170, -1):
        mask = _stretch((0, x), (255, 300))
        assert np.array_equal(stream.see(mask, x, image=stream.image((0, 300))), mask)


def test_what_was_not_looked_at_was_not_seen_to_stay(stream: Stream) -> None:
    """Between two whole looks the mask outside the window is an old one."""
    stream.see(_stretch((0, 120), TEXT), 120)
    for x in range(121, 160):
        stream.window = (0, 0, x + 40, HEIGHT)
        mask = _stretch((0, x), TEXT)
        assert np.array_equal(stream.see(mask, x), mask)


def test_what_was_not_seen_for_long_is_forgotten(stream: Stream) -> None:
    stream.advance(100, 160, TEXT)
    stream.see(_stretch((0, 160)), 160, after_s=21.0)
    mask = _stretch((0, 160), TEXT)
    assert np.array_equal(stream.see(mask, 160), mask)


def test_a_stream_that_is_wound_back_begins_anew(stream: Stream) -> None:
    stream.advance(100, 160, TEXT)
    mask = _stretch((0, 160), TEXT)
    assert np.array_equal(stream.see(mask, 160, after_s=-1.0), mask)


def test_it_can_be_switched_off() -> None:
    stream = Stream(StaticArtefacts(TrackingConfig(lookalike_px=0.0)))
    mask = _stretch((0, 160), TEXT)
    stream.advance(100, 160, TEXT)
    assert stream.see(mask, 160) is mask


CONFIG = TrackingConfig(route_gap_px=40.0, route_reach_px=30.0)
TARGET: Point = (380.0, 100.0)
WHY = "no vessel that was found leads there"


def _route(start_x: float = 20.0) -> Route:
    points = np.linspace((start_x, 100.0), TARGET, 200)
    return Route(points, TARGET[0] - start_x, TARGET)


def _vessel(gap: tuple[int, int] = (0, 0)) -> NDArray[np.bool_]:
    vessel = np.zeros((200, 400), np.bool_)
    vessel[85:116] = True
    vessel[:, gap[0] : gap[1]] = False
    return vessel


@pytest.fixture
def memory() -> RouteMemory:
    """It has been found for half a second."""
    memory = RouteMemory(CONFIG)
    for at_s in (-CONFIG.memory_s, 0.0):
        found = _route()
        assert memory.update(found, (20.0, 100.0), TARGET, _vessel(), at_s) is found
    return memory


DETOUR = Route(np.array([(120.0, 100.0), (120.0, 10.0), (380.0, 10.0), TARGET]), 440.0, TARGET)
"""Round a loop there is another way when a reflection cuts this one."""
SHORT_CUT = Route(np.array([(120.0, 100.0), (200.0, 130.0), TARGET]), 150.0, TARGET)
"""Where another turn of the vessel seems to touch this one."""


def test_a_short_gap_ahead_does_not_undo_it(memory: RouteMemory) -> None:
    left = memory.update(WHY, (120.0, 106.0), TARGET, _vessel((200, 235)), 0.0)
    assert left.length_px == pytest.approx(260.0, abs=2.0)
    assert left.points[0] == pytest.approx((120.0, 100.0), abs=1.0)
    assert left.points[-1] == pytest.approx(TARGET, abs=1e-6)
    assert left.target == TARGET


def test_a_long_gap_does(memory: RouteMemory) -> None:
    assert memory.update(WHY, (120.0, 100.0), TARGET, _vessel((200, 250)), 0.0) == WHY
    assert isinstance(memory.update(WHY, (250.0, 100.0), TARGET, _vessel((200, 250)), 0.0), Route), "it lies behind the head now"


def test_a_head_that_is_elsewhere_has_no_way(memory: RouteMemory) -> None:
    assert memory.update(WHY, (120.0, 135.0), TARGET, _vessel((200, 230)), 0.0) == WHY


def test_another_target_has_to_be_found_itself(memory: RouteMemory) -> None:
    assert memory.update(WHY, (120.0, 100.0), (300.0, 100.0), _vessel(), 0.0) == WHY
    assert memory.update(WHY, (120.0, 100.0), TARGET, _vessel(), 0.0) == WHY, "and the old one is forgotten with it"


def test_what_is_found_anew_and_lasts_replaces_it(memory: RouteMemory) -> None:
    around = Route(np.linspace((120.0, 100.0), (120.0, 190.0), 50), 500.0, TARGET)
    assert memory.update(around, (120.0, 100.0), TARGET, _vessel(), 1.0) is not around
    assert memory.update(around, (120.0, 100.0), TARGET, _vessel(), 1.5) is around
    left = memory.update(WHY, (120.0, 120.0), TARGET, np.ones((200, 400), np.bool_), 1.6)
    assert left.points[-1] == pytest.approx((120.0, 190.0))


def test_a_way_that_was_found_for_a_moment_only_holds_over_nothing() -> None:
    """One frame in which two vessels seem to touch must not lead the robot for as long as nothing else is found."""
    memory = RouteMemory(CONFIG)
    head, cut = (120.0, 100.0), _vessel((200, 212))
    assert memory.update(SHORT_CUT, head, TARGET, _vessel(), 0.0) is SHORT_CUT
    assert memory.update(WHY, head, TARGET, cut, 0.03) == WHY
    found = _route(120.0)
    assert memory.update(found, head, TARGET, _vessel(), 0.06) is found, "and stands against nothing"
    for at_s in (0.1, 0.3, 0.5):
        assert memory.update(_route(120.0), head, TARGET, _vessel(), at_s)
        assert memory.update(WHY, head, TARGET, cut, at_s + 0.01) == WHY
    memory.update(_route(120.0), head, TARGET, _vessel(), 0.56)
    assert isinstance(memory.update(WHY, head, TARGET, cut, 0.6), Route), "found for half a second, but for moments"


def test_what_a_frame_found_that_was_not_believed_is_not_kept(memory: RouteMemory) -> None:
    memory.settle(is_believed=True)
    elsewhere = Route(np.linspace((120.0, 190.0), TARGET, 50), 280.0, TARGET)
    assert memory.update(elsewhere, (120.0, 190.0), TARGET, _vessel(), 0.1) is elsewhere, "it is shown"
    memory.settle(is_believed=False)
    memory.settle(is_believed=False)  # a frame in which nobody asked for a way
    left = memory.update(WHY, (120.0, 100.0), TARGET, _vessel((200, 235)), 0.2)
    assert left.length_px == pytest.approx(260.0, abs=2.0)


@pytest.mark.parametrize("other", [DETOUR, SHORT_CUT], ids=["detour", "short cut"])
def test_another_way_of_a_moment_is_not_taken(memory: RouteMemory, other: Route) -> None:
    head, cut = (120.0, 100.0), _vessel((200, 212))
    left = memory.update(other, head, TARGET, cut, 0.1)
    assert left.length_px == pytest.approx(260.0, abs=2.0)
    assert memory.update(other, head, TARGET, cut, CONFIG.memory_s + 0.1) is other, "what lasts is true: perhaps the way was none"
    assert memory.update(other, head, TARGET, cut, CONFIG.memory_s + 0.2) is other


_ARC = np.linspace(0.0, np.pi, 100)
ABOVE, BELOW = (
    Route(np.column_stack([250.0 - 130.0 * np.cos(_ARC), 100.0 + side * 60.0 * np.sin(_ARC)]), length_px, TARGET)
    for side, length_px in ((-1.0, 311.0), (1.0, 309.0))
)
"""Round a loop both ways are as long: which one is the shorter hangs on a pixel."""


def test_round_a_loop_the_way_does_not_change_from_frame_to_frame() -> None:
    memory, head = RouteMemory(CONFIG), (120.0, 100.0)
    vessel = np.ones((200, 400), np.bool_)
    for step in range(18):
        assert memory.update(ABOVE, head, TARGET, vessel, step / 30) is ABOVE
    for step in range(18, 60):
        told = memory.update((ABOVE, BELOW)[step % 2], head, TARGET, vessel, step / 30)
        assert told.points[50][1] == pytest.approx(40.0, abs=1.0), "above"
    for step in range(60, 80):
        told = memory.update(BELOW, head, TARGET, vessel, step / 30)
    assert told is BELOW, "what lasts is true"
