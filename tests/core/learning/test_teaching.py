"""Frames that teach a bench: which are picked and rejected, and what is written."""

import errno
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.bench.bench import Bench, bench_from_pictures, read_bench
from core.devices import UserError
from core.evaluation.accuracy import dice
from core.learning import teaching
from core.learning.dataset import find_samples
from core.learning.teaching import (
    FEWEST,
    FrameSelection,
    TeachingError,
    TeachingFrame,
    TeachingPicture,
    check,
    choose,
    farthest,
    is_teaching_set,
    propose,
    read_teaching_set,
    write_teaching_set,
)
from core.perception.segmentation import Probability, Segmenter
from core.types import Image, Mask
from tests.core.learning.toy_bench import SIZE, toy_picture, toy_robot, toy_stream, toy_vessel


def _bench(*pictures: Image) -> Bench:
    return bench_from_pictures(pictures or (toy_picture(seed=900), toy_picture(seed=901)), toy_vessel(), "toy", SIZE[0])


@pytest.fixture(scope="module")
def bench() -> Bench:
    return _bench()


@pytest.fixture(scope="module")
def frames(bench: Bench) -> list[TeachingFrame]:
    return check([propose(picture, bench) for picture in toy_stream(16)], bench)


def test_masks_by_difference_are_the_robots_and_all_frames_are_usable(frames: list[TeachingFrame]) -> None:
    assert [frame.reason for frame in frames] == [""] * 16
    true = [toy_robot(index // 8, 0.35 + 0.6 * (index % 8) / 8) for index in range(16)]
    assert np.mean([dice(frame.robot, robot) for frame, robot in zip(frames, true, strict=True)]) > 0.85
    assert all((frame.vessel == toy_vessel()).mean() > 0.99 for frame in frames)


def test_near_duplicates_are_skipped_and_the_most_different_are_kept(bench: Bench) -> None:
    selection = FrameSelection(bench, 2)  # keeps twice as many, and some spare ones
    moving = toy_stream(40)
    kept = [selection.add(picture) for picture in moving for _ in range(3)]
    assert selection.seen == 120
    assert sum(kept) <= 40
    names = [picture.name for picture in selection.pictures()]
    assert len(names) <= 2 * 2 + teaching._SPARE
    indices = [int(name.split()[1]) for name in names]
    assert indices == sorted(indices)
    assert {index // 20 for index in indices} == {0, 1}, "both branches"
    assert np.ptp([index % 20 for index in indices]) > 14, "near and far"


def test_the_farthest_come_first() -> None:
    robots = [np.zeros((4, 8), np.float32) for _ in range(4)]
    for robot, columns in zip(robots, (3, 4, 8, 1), strict=True):
        robot[0, :columns] = 1
    assert farthest(robots, 3) == [2, 3, 0]
    assert farthest([], 3) == []


def test_a_robot_that_never_moves_is_one_line(bench: Bench) -> None:
    selection = FrameSelection(bench, 8)
    for index in range(6):
        selection.add(TeachingPicture("same", "same", toy_picture(toy_robot(0, 0.7), seed=index)))
    with pytest.raises(TeachingError, match=r"^the robot never moves in 6 pictures: move it through all branches"):
        selection.pictures()
    with pytest.raises(TeachingError, match=r"^no picture shows the bench"):
        FrameSelection(bench, 8).pictures()


def test_a_camera_that_was_moved_half_way_does_not_displace_the_frames_before(bench: Bench) -> None:
    selection = FrameSelection(bench, 8)
    for index, picture in enumerate(toy_stream(40)):
        selection.add(replace(picture, image=_moved(picture.image)) if index % 20 >= 10 else picture)
    assert {int(picture.stem) % 20 < 10 for picture in selection.pictures()} == {True}
    assert {int(frame.picture.stem) % 20 >= 10 for frame in selection.refused} == {True}
    assert all(frame.reason for frame in selection.refused)


def _hand(image: Image) -> Image:
    covered = image.copy()
    cv2.ellipse(covered, (200, 200), (110, 80), 20, 0, 360, (225, 180, 150), -1, cv2.LINE_AA)
    return covered


def _moved(image: Image) -> Image:
    return np.asarray(cv2.warpAffine(image, np.array([[1.0, 0, 40], [0, 1, 25]]), SIZE, borderMode=cv2.BORDER_REPLICATE), np.uint8)


def _blurred(image: Image) -> Image:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 5.0), np.uint8)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (_hand, "hand"),
        (_moved, ""),
        (_blurred, "blurred"),
        (lambda image: toy_picture(seed=3), "no robot"),
        (lambda image: toy_picture(toy_robot(0, 0.8), board=7), ""),
    ],
    ids=["hand", "moved", "blurred", "empty", "other bench"],
)
def test_a_frame_that_is_not_plausible_is_rejected_by_name(
    bench: Bench, frames: list[TeachingFrame], change: Callable[[Image], Image], reason: str
) -> None:
    picture = frames[6].picture
    changed = propose(replace(picture, image=change(picture.image)), bench)
    checked = check([*frames, changed], bench)
    assert [frame.reason for frame in checked[:-1]] == [""] * len(frames)
    assert checked[-1].reason
    assert reason in checked[-1].reason
    assert len(checked[-1].reason.splitlines()) == 1


def _plain(robot: Mask | None, seed: int) -> Image:
    """A bench without structure but its lumen and a few labels, in the noise of a camera that smooths it."""
    picture = np.where(toy_vessel()[:, :, None], np.float32(160), np.float32(110)) * np.ones(3, np.float32)
    for x, y in ((30, 30), (130, 40), (60, 200), (160, 200), (240, 215), (250, 120)):
        cv2.rectangle(picture, (x, y), (x + 24, y + 14), (210, 210, 190), 3)
    if robot is not None:
        picture[robot] = (30, 40, 60)
    noise = np.random.default_rng(seed).normal(0, 1, picture.shape).astype(np.float32)
    noise = cv2.GaussianBlur(noise, (0, 0), 0.8)
    return np.asarray(np.clip(cv2.GaussianBlur(picture, (0, 0), 1.0) + noise * (3.0 / noise.std()), 0, 255), np.uint8)


def test_noise_left_in_the_empty_pictures_is_no_structure_that_a_frame_could_hide() -> None:
    bench = _bench(_plain(None, 900), _plain(None, 901))
    for index in range(4):
        image = _plain(toy_robot(0, 0.5 + 0.1 * index), index)
        assert propose(TeachingPicture("frame", "frame", image), bench).reason == ""
        assert propose(TeachingPicture("hand", "hand", _hand(image)), bench).reason


def _cut(frame: TeachingFrame, *columns: slice) -> TeachingFrame:
    robot = frame.robot.copy()
    for cut in columns:
        robot[:, cut] = False
    return replace(frame, robot=robot)


def test_a_mask_that_is_not_plausible_beside_the_others_is_rejected_by_name(bench: Bench, frames: list[TeachingFrame]) -> None:
    frame = frames[6]
    beside = np.roll(frame.robot, 40, axis=0)
    wide = cv2.dilate(frame.robot.view(np.uint8), np.ones((25, 25), np.uint8)) > 0
    bad = [
        _cut(frame, *(slice(x, x + 16) for x in (20, 50, 80, 110, 140))),
        _cut(frame, slice(0, 150)),
        replace(frame, robot=beside),
        replace(frame, robot=wide, vessel=np.ones_like(wide)),
        replace(frame, doubtful=np.ones_like(frame.robot)),
    ]
    checked = check([*frames, *bad], bench)
    assert [one.reason for one in checked[: len(frames)]] == [""] * len(frames)
    kinds = [one.reason.split(":")[0] for one in checked[len(frames) :]]
    assert kinds[:3] == ["in pieces", "no tail", "beside the vessel"]
    assert kinds[3] in ("a hand or a shadow", "of another width")
    assert kinds[4] == "doubtful"


def test_a_cable_beside_the_vessel_does_no_harm(bench: Bench, frames: list[TeachingFrame]) -> None:
    picture = frames[6].picture
    image = picture.image.copy()
    cv2.line(image, (20, 220), (150, 200), (20, 20, 20), 5)
    frame = propose(replace(picture, image=image), bench)
    assert dice(frame.robot, frames[6].robot) > 0.98
    assert frame.hidden_share < 0.1
    assert not check([*frames, frame], bench)[-1].reason


def test_an_empty_picture_with_the_robot_in_it_is_one_line() -> None:
    only = _bench(toy_picture(toy_robot(0, 0.95), seed=900))
    pictures = [picture for picture in toy_stream(16) if int(picture.stem) >= 8 or int(picture.stem) < 3]
    with pytest.raises(TeachingError, match=r"^the empty picture shows the robot near \(\d+, \d+\): take it again"):
        check([propose(picture, only) for picture in pictures], only)


@pytest.mark.parametrize(("ground", "levels", "is_named"), [(120, 5, False), (120, 40, True), (44, 13, True)])
def test_a_bench_that_is_a_little_darker_where_all_frames_have_the_robot_does_not_show_it(
    ground: int, levels: int, is_named: bool
) -> None:
    vessel, robot = toy_vessel(), toy_robot(0, 0.4)
    blank, board = np.zeros_like(robot), np.full((*robot.shape, 3), ground, np.uint8)
    bands = np.where((np.arange(robot.shape[1]) // 8 % 2 > 0)[None, :, None], np.uint8(ground + 30), np.uint8(ground - 30))
    banded, empty = (np.where(robot[..., None], inside, board).astype(np.uint8) for inside in (bands, board - np.uint8(levels)))
    frames = [TeachingFrame(TeachingPicture(name, name, banded), vessel, robot, blank) for name in "abcde"]
    if not is_named:
        check(frames, _bench(empty))
        return
    with pytest.raises(TeachingError, match="the empty picture shows the robot"):
        check(frames, _bench(empty))


def test_a_quarter_is_held_out_and_too_few_frames_are_one_line(frames: list[TeachingFrame]) -> None:
    chosen = choose(frames, 12)
    assert len(chosen) == 12
    assert sum(frame.is_held_out for frame in chosen) == 3
    stems = [frame.picture.stem for frame in chosen]
    assert stems == sorted(stems)
    few = [replace(frame, reason="blurred: sharpness 0.01") if index >= 5 else frame for index, frame in enumerate(frames)]
    with pytest.raises(TeachingError, match=rf"^5 of 16 frames are usable, {FEWEST} are needed; most of the others: blurred; "):
        choose(few, 12)


def test_a_set_is_read_as_it_was_written_and_as_a_person_has_changed_it(
    bench: Bench, frames: list[TeachingFrame], tmp_path: Path
) -> None:
    folder = tmp_path / "set"
    rejected = replace(frames[0], reason="blurred: much")
    written = write_teaching_set(folder, bench, choose(frames[1:], 12), [rejected], 99)
    assert is_teaching_set(folder)
    assert read_teaching_set(folder) == written
    assert (len(written.train), len(written.held_out), written.seen) == (9, 3, 99)
    assert written.rejected == (("picture 0", "blurred: much"),)
    assert (folder / "rejected" / "images" / "000.png").is_file()
    assert find_samples([folder]) == sorted((*written.train, *written.held_out), key=lambda sample: sample.stem)
    first = written.train[0]
    _, vessel, robot = first.load()
    kept = next(frame for frame in frames if frame.picture.stem == first.stem)
    assert (robot == kept.robot).all()
    assert (vessel == kept.vessel).all()
    assert (first.load_doubtful(vessel.shape) == kept.doubtful).all()
    first.image.unlink()
    again = read_teaching_set(folder)
    assert again.train == written.train[1:]
    assert (f"picture {int(first.stem)}", "removed by hand") in again.rejected
    again.train[0].robot.unlink()
    with pytest.raises(UserError, match=r"_robot\.png is missing; draw it, or remove the picture"):
        read_teaching_set(folder)


def test_a_set_replaces_an_older_one_and_nothing_else(bench: Bench, frames: list[TeachingFrame], tmp_path: Path) -> None:
    folder = tmp_path / "set"
    write_teaching_set(folder, bench, choose(frames, 12), [], 16)
    second = write_teaching_set(folder, bench, choose(frames, 8), [], 16)
    assert len(find_samples([folder])) == len(second.train) + len(second.held_out) == 8
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "a.txt").write_text("mine")
    with pytest.raises(TeachingError, match="exists and holds no frames of a bench"):
        write_teaching_set(tmp_path / "notes", bench, choose(frames, 8), [], 16)
    assert (tmp_path / "notes" / "a.txt").read_text() == "mine"
    (folder / "teaching.json").write_text("{")
    with pytest.raises(TeachingError, match=r"teaching\.json: damaged"):
        read_teaching_set(folder)


def test_a_network_of_an_interrupted_training_stays_only_while_the_same_frames_are_held_out(
    bench: Bench, frames: list[TeachingFrame], tmp_path: Path
) -> None:
    chosen = choose(frames, 8)
    network = write_teaching_set(tmp_path / "set", bench, chosen, [], 16).network
    network.mkdir()
    write_teaching_set(tmp_path / "set", bench, chosen, [], 16)
    assert network.is_dir()
    write_teaching_set(tmp_path / "set", bench, [replace(one, is_held_out=not one.is_held_out) for one in chosen], [], 16)
    assert not network.exists(), "it has learnt from frames that are held out now"


def test_a_full_disk_is_one_line(
    bench: Bench, frames: list[TeachingFrame], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def write(path: Path, _image: Image) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(teaching, "write_png", write)
    with pytest.raises(TeachingError, match=r"\.png: cannot be written \(No space left on device\); make room") as raised:
        write_teaching_set(tmp_path / "set", bench, choose(frames, 8), [], 16)
    assert len(str(raised.value).splitlines()) == 1


class _Sees(Segmenter):
    """Finds what it is told, wherever."""

    def __init__(self, robot: Mask) -> None:
        self._robot = robot.astype(np.float32)

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        return np.zeros_like(self._robot), self._robot


def test_a_network_completes_what_differs_little_beside_the_robot_and_nothing_else(bench: Bench) -> None:
    body, shadow = toy_robot(0, 0.8), np.roll(toy_robot(0, 0.8), 7, axis=0)
    image = toy_picture(body, seed=3).astype(np.float32)
    image[shadow & ~body] += 8.0  # the paler half of a robot
    picture = TeachingPicture("pale", "pale", np.clip(image, 0, 255).astype(np.uint8))
    whole = body | shadow
    elsewhere = toy_robot(1, 0.95) & ~_around(whole)
    alone = propose(picture, bench)
    together = propose(picture, bench, _Sees(whole | elsewhere))
    assert dice(together.robot, whole) > dice(alone.robot, whole) + 0.05
    assert not (together.robot & elsewhere).any(), "a network alone makes no robot"


def test_where_network_and_difference_contradict_each_other_is_not_trained_on(bench: Bench) -> None:
    body = toy_robot(0, 0.8)
    seen = cv2.erode(body.view(np.uint8), np.ones((3, 3), np.uint8)) > 0
    frame = propose(TeachingPicture("narrow", "narrow", toy_picture(body, seed=3)), bench, _Sees(seen))
    assert not frame.reason
    assert frame.doubtful[frame.robot & ~seen].mean() > 0.8
    assert not frame.doubtful[seen & frame.robot].any()


def _around(mask: Mask) -> Mask:
    return np.asarray(cv2.dilate(mask.view(np.uint8), np.ones((25, 25), np.uint8)) > 0)


def test_specks_are_left_out_and_not_trained_on(bench: Bench, frames: list[TeachingFrame]) -> None:
    image = frames[6].picture.image.copy()
    branch = np.argwhere(toy_robot(1, 0.95))[-200][::-1]
    cv2.circle(image, (int(branch[0]), int(branch[1])), 3, (20, 20, 20), -1)
    frame = propose(replace(frames[6].picture, image=image), bench)
    assert not frame.robot[branch[1], branch[0]]
    assert dice(frame.robot, frames[6].robot) > 0.98


@pytest.mark.parametrize("begins_px", [0, 40])
def test_what_the_empty_picture_may_hide_of_a_robot_that_is_not_drawn_out_of_it_is_not_learnt_as_bench(
    begins_px: int, bench: Bench, frames: list[TeachingFrame], tmp_path: Path
) -> None:
    x = np.arange(SIZE[0])
    end = cv2.circle(np.zeros(SIZE[::-1], np.uint8), (100, 120), 13, 1, -1) > 0
    ported = replace(bench, vessel=toy_vessel() & (x >= 100) | end)
    shown = [replace(frame, robot=frame.robot & (x >= begins_px)) for frame in frames]
    made = write_teaching_set(tmp_path / "set", ported, choose(shown, 12), [], 16)
    hidden = ~read_bench(made.bench).known
    doubtful = made.train[0].load_doubtful(SIZE[::-1])
    if not begins_px:
        assert not hidden.any()
        return
    assert (hidden & toy_robot(0, 0.5))[:, :35].sum() > 0.95 * toy_robot(0, 0.5)[:, :35].sum()
    assert (doubtful & hidden)[:, :35].sum() == hidden[:, :35].sum()
    assert not hidden[:, 50:].any() and not hidden[:95].any() and not hidden[145:].any()
