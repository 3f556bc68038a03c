"""What was taken of a bench: on disk at once, taken up again, and each bad input one line that loses nothing."""

from __future__ import annotations

import errno
import os
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.teaching import folder as folder_module
from app.teaching.folder import LookKind, TakenLook, TeachingFolder, TeachingStep
from core.bench.bench import BenchError
from core.learning import teaching
from core.learning.dataset import read_mask
from core.learning.teaching import TeachingError, read_teaching_set
from core.perception.segmentation import Probability
from core.types import Image, Mask
from tests.core.learning.toy_bench import toy_picture, toy_robot, toy_vessel


def large(mask: Mask) -> Mask:
    """At working size."""
    return cv2.resize(mask.astype(np.uint8), (640, 480), interpolation=cv2.INTER_NEAREST) > 0


def segment(_image: Image) -> tuple[Probability, Probability]:
    """A network that sees the vessel, and no robot."""
    return large(toy_vessel()).astype(np.float32), np.zeros((480, 640), np.float32)


def empties(*, seed: int = 50) -> list[Image]:
    return [toy_picture(seed=seed + number) for number in range(3)]


def robot_picture(branch: int, share: float, *, seed: int = 7) -> Image:
    return toy_picture(toy_robot(branch, share), seed=seed)


def opened(path: Path) -> TeachingFolder:
    work = TeachingFolder(path / "teaching", "toy", lambda: segment)
    work.load()
    return work


def reopened(before: TeachingFolder, path: Path) -> TeachingFolder:
    """As another run of the program finds it."""
    before.release()
    return opened(path)


@pytest.fixture
def work(tmp_path: Path) -> TeachingFolder:
    """Empty bench and vessel are known."""
    work = opened(tmp_path)
    work.add_empty(empties())
    work.set_vessel(work.proposed_vessel())
    work.go(TeachingStep.MOVE)
    return work


def drive(work: TeachingFolder, count: int = 5) -> list[TakenLook]:
    """Push the robot into both branches in so many steps each."""
    return [
        work.look(robot_picture(branch, 0.2 + 0.75 * number / (count - 1), seed=10 * branch + number))
        for branch in (0, 1)
        for number in range(count)
    ]


# ---- the way through


def test_the_steps_need_what_comes_before_them(tmp_path: Path) -> None:
    work = opened(tmp_path)
    assert not work.view().may_leave
    work.add_empty(empties())
    assert work.view().may_leave
    work.go(TeachingStep.VESSEL)
    assert not work.view().may_leave
    work.set_vessel(work.proposed_vessel())
    assert work.view().may_leave
    work.go(TeachingStep.MOVE)
    assert not work.view().may_leave
    drive(work)
    assert work.view().may_leave


def test_frames_are_taken_where_the_robot_is_new_and_the_map_fills(work: TeachingFolder) -> None:
    shares = []
    for branch in (0, 1):
        for number in range(6):
            assert work.look(robot_picture(branch, 0.25 + 0.14 * number, seed=number)).kind in (LookKind.PLACE, LookKind.SEEN)
            shares.append(work.view().share)
    assert shares == sorted(shares)
    assert shares[-1] > 0.9
    assert work.view().missing == ()
    assert work.look(robot_picture(0, 0.6, seed=99)).kind is LookKind.SEEN


def test_a_robot_that_does_not_move_is_not_taken_again(work: TeachingFolder) -> None:
    assert work.look(robot_picture(0, 0.6)).kind is LookKind.PLACE
    assert work.look(robot_picture(0, 0.6, seed=8)).kind is LookKind.STILL


def test_a_bend_at_the_same_depth_is_taken_as_a_bend(work: TeachingFolder) -> None:
    work.look(robot_picture(0, 0.4))
    shifted = np.roll(toy_robot(0, 0.4), 7, axis=0)
    assert work.look(toy_picture(shifted, seed=3)).kind is LookKind.BEND
    assert work.view().bends == 1


def test_a_robot_that_only_goes_on_is_no_bend(work: TeachingFolder) -> None:
    work.look(robot_picture(0, 0.6))
    assert work.look(robot_picture(0, 0.63, seed=3)).kind is not LookKind.BEND
    assert work.view().bends == 0


def test_a_vessel_without_a_robot_is_no_rejected_frame(work: TeachingFolder) -> None:
    assert work.look(toy_picture(seed=77)).kind is LookKind.ABSENT
    assert work.view().frames == ()


def test_frames_become_a_set_that_teach_reads(work: TeachingFolder) -> None:
    drive(work)
    made = read_teaching_set(work.teaching_set())
    assert len(made.train) + len(made.held_out) == work.view().used
    assert made.bench.is_dir()


def test_the_network_completes_the_masks_by_difference_and_not_those_drawn_by_hand(tmp_path: Path) -> None:
    vessel, whole = segment(robot_picture(0, 0.5))[0], large(toy_robot(0, 0.95))
    work = TeachingFolder(tmp_path / "teaching", "toy", lambda: lambda _image: (vessel, whole.astype(np.float32)))
    work.load()
    work.add_empty(empties())
    work.set_vessel(vessel >= 0.5)
    drive(work)
    stem = work.view().frames[0].stem
    work.correct(stem, large(toy_robot(0, 0.25)))
    made = read_teaching_set(work.teaching_set())
    doubtful = {one.stem: one.doubtful is not None and read_mask(one.doubtful) for one in (*made.train, *made.held_out)}
    assert not np.any(doubtful.pop(stem))
    assert all(np.any(mask & whole) for mask in doubtful.values()), "beyond its end the network sees more robot"


def test_a_mask_that_is_rejected_once_completed_stays_as_it_was_reviewed(
    work: TeachingFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive(work)
    written: list[teaching.TeachingFrame] = []
    monkeypatch.setattr(teaching, "write_teaching_set", lambda _folder, _bench, chosen, *_: written.extend(chosen))
    work.teaching_set()
    before, spoilt = written[:], np.ones((480, 640), bool)
    monkeypatch.setattr(
        work, "_completed", lambda frame: replace(frame, robot=spoilt) if frame.picture.stem == before[0].picture.stem else frame
    )
    written.clear()
    work.teaching_set()
    assert not any(one.robot is spoilt for one in written)


# ---- taken up again


def test_everything_is_there_again_after_the_window_was_closed(work: TeachingFolder, tmp_path: Path) -> None:
    drive(work)
    before = work.view()
    work.leave_out(before.frames[2].stem, True)
    mask = large(toy_robot(1, 0.5))
    work.correct(before.frames[3].stem, mask)
    work.go(TeachingStep.FRAMES)
    again = reopened(work, tmp_path).view()
    assert again.step is TeachingStep.FRAMES
    assert np.array_equal(again.vessel, before.vessel)
    assert [taken.stem for taken in again.frames] == [taken.stem for taken in before.frames]
    assert [taken.kind for taken in again.frames] == [taken.kind for taken in before.frames]
    assert again.frames[2].is_left_out
    assert again.frames[3].is_corrected
    assert np.array_equal(again.frames[3].frame.robot, mask)
    assert again.share == pytest.approx(work.view().share)


def test_masks_are_made_again_only_for_another_bench_or_version_or_where_they_are_damaged(
    work: TeachingFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive(work)
    before, made, propose = work.view().frames, list[str](), teaching.propose
    monkeypatch.setattr(teaching, "propose", lambda picture, *more: made.append(picture.stem) or propose(picture, *more))
    (tmp_path / "teaching" / "masks" / str(teaching.MASKS_VERSION) / "0001.png").write_bytes(b"no picture")
    work = reopened(work, tmp_path)
    assert made == ["0001"]
    for taken, again in zip(before, work.view().frames, strict=True):
        for name in ("vessel", "robot", "doubtful", "differs"):
            assert np.array_equal(getattr(taken.frame, name), getattr(again.frame, name))
    monkeypatch.setattr(teaching, "MASKS_VERSION", teaching.MASKS_VERSION + 1)
    work = reopened(work, tmp_path)
    assert len(made) == 1 + len(before), "made by another version"
    work.add_empty(empties(seed=80))
    assert len(made) == 1 + 2 * len(before)


def test_a_robot_that_is_seen_in_the_empty_picture_is_still_pointed_out_in_the_next_run(tmp_path: Path) -> None:
    vessel, robot = segment(robot_picture(0, 0.9))[0], large(toy_robot(0, 0.9)).astype(np.float32)
    work = TeachingFolder(tmp_path / "teaching", "toy", lambda: lambda _image: (vessel, robot))
    work.load()
    work.add_empty([robot_picture(0, 0.9, seed=number) for number in range(3)])
    (before,) = work.view().robot_like
    again = reopened(work, tmp_path)
    assert np.array_equal(again.view().robot_like[0], before)
    again.add_empty(empties())
    assert again.view().robot_like == ()


def test_places_are_taken_up_again(tmp_path: Path) -> None:
    work = opened(tmp_path)
    work.add_place(robot_picture(0, 0.5))
    with pytest.raises(BenchError, match="lies where it lay before"):
        work.add_place(robot_picture(0, 0.5, seed=2))
    work = reopened(work, tmp_path)
    assert len(work.view().places) == 1
    work.add_place(robot_picture(0, 0.95))
    work.add_place(robot_picture(1, 0.95))
    view = work.view()
    assert view.is_computed
    assert view.empty is not None


def test_another_empty_picture_keeps_vessel_and_frames(work: TeachingFolder) -> None:
    drive(work)
    before = work.view()
    work.add_empty(empties(seed=80))
    after = work.view()
    assert np.array_equal(after.vessel, before.vessel)
    assert len(after.frames) == len(before.frames)


def test_starting_over_removes_all_of_it(work: TeachingFolder, tmp_path: Path) -> None:
    drive(work)
    work.start_over()
    assert work.view().empty is None
    assert reopened(work, tmp_path).view().frames == ()


def test_what_was_trained_before_a_change_is_not_taken_for_the_present_frames(work: TeachingFolder) -> None:
    drive(work)
    work.keep_model("toy_1")
    assert work.view().model == "toy_1"
    work.leave_out(work.view().frames[0].stem, True)
    assert work.view().model == ""


# ---- bad input: one line, nothing lost


def test_an_empty_picture_that_is_blurred_or_in_which_something_moves_is_refused(work: TeachingFolder) -> None:
    before = work.view().empty
    with pytest.raises(BenchError, match="something moved while the pictures were taken"):
        work.add_empty([toy_picture(seed=1), toy_picture(toy_robot(0, 0.9), seed=2)])
    with pytest.raises(BenchError, match="blurred"):
        work.add_empty([cv2.GaussianBlur(picture, (0, 0), 9.0) for picture in empties()])
    assert work.view().empty is before


def test_a_noisy_camera_is_no_motion(work: TeachingFolder) -> None:
    rng = np.random.default_rng(5)
    still = toy_picture(seed=1)
    noise = [cv2.GaussianBlur(rng.normal(0, 25, still.shape), (0, 0), 1.2) for _ in range(8)]
    noisy = [np.clip(still + grain, 0, 255).astype(np.uint8) for grain in noise]
    work.add_empty(noisy)
    assert work.view().empty is not None
    with pytest.raises(BenchError, match="something moved"):
        work.add_empty([noisy[0], np.where(toy_robot(0, 0.9)[:, :, None], np.uint8(40), noisy[1])])


def test_an_empty_picture_with_the_robot_in_it_is_said_while_frames_are_taken_and_can_be_taken_again(
    work: TeachingFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    work.add_empty([toy_picture(toy_robot(0, 0.9), seed=number) for number in range(3)])
    drive(work, 3)
    taken = len(work.view().frames)

    def finds_it(*_: object, **_options: object) -> None:
        raise TeachingError("the empty picture shows the robot near (3, 4): take it again without the robot")

    with monkeypatch.context() as patch:
        patch.setattr(folder_module, "_CHECK_FROM", 1)
        patch.setattr(teaching, "check", finds_it)
        look = work.look(robot_picture(1, 0.76, seed=40))
    assert look.needs_empty
    assert look.reason.startswith("the empty picture shows the robot near")
    assert len(work.view().frames) == taken
    work.add_empty(empties())
    assert len(work.view().frames) == taken
    assert work.view().used == taken


def test_a_vessel_that_cannot_be_one(work: TeachingFolder) -> None:
    before = work.view().vessel
    with pytest.raises(BenchError, match="empty"):
        work.set_vessel(np.zeros((480, 640), bool))
    with pytest.raises(BenchError, match="white must be the vessel"):
        work.set_vessel(~before)
    assert work.view().vessel is before


def test_another_bench_a_moved_one_and_a_hand_are_rejected(work: TeachingFolder) -> None:
    with_hand = cv2.circle(robot_picture(0, 0.6), (240, 120), 90, (200, 150, 120), -1)
    moved, other = np.roll(robot_picture(0, 0.6), 25, axis=1), toy_picture(toy_robot(0, 0.6), board=5)
    for picture in (moved, other, with_hand):
        look = work.look(picture)
        assert look.kind is LookKind.REJECTED
        assert look.needs_empty or picture is with_hand
    assert work.view().frames == ()


def test_a_full_disk_loses_nothing(work: TeachingFolder, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    drive(work, 4)
    before = len(work.view().frames)

    def full(*_args: object, **_kwargs: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(folder_module, "write_atomic", full)
        with pytest.raises(BenchError, match="No space left on device"):
            work.look(toy_picture(np.roll(toy_robot(0, 0.55), 8, axis=0), seed=3))
    assert len(work.view().frames) == before
    assert len(reopened(work, tmp_path).view().frames) == before


def test_a_damaged_record_is_one_line_and_can_be_started_over(work: TeachingFolder, tmp_path: Path) -> None:
    (tmp_path / "teaching" / "teaching.json").write_text("{")
    work.release()
    again = TeachingFolder(tmp_path / "teaching", "toy", lambda: segment)
    with pytest.raises(BenchError, match=r"teaching\.json: damaged"):
        again.load()
    again.start_over()
    assert reopened(again, tmp_path).view().empty is None


def test_too_few_frames_are_said(work: TeachingFolder) -> None:
    work.look(robot_picture(0, 0.6))
    with pytest.raises(TeachingError, match="usable"):
        work.teaching_set()


def test_long_jobs_are_counted_and_the_writing_of_the_frames_can_be_stopped(work: TeachingFolder) -> None:
    drive(work)
    work.release()
    count, told = work.view().used, []
    again = TeachingFolder(work.folder, "toy", lambda: segment, lambda *counts: told.append(counts) or len(told) < count + 3)
    again.load()
    with pytest.raises(TeachingError, match="the frames are kept"):
        again.teaching_set()
    assert told == [(done, count) for done in (*range(count), 0, 1, 2)]
    assert not (work.folder / "set").exists()
    again.release()
    late = TeachingFolder(work.folder, "toy", lambda: segment, lambda done, count: done < count)
    late.load()
    with pytest.raises(TeachingError, match="the frames are kept"):
        late.teaching_set()  # all is written, but no training may begin any more


# ---- what a person draws


def test_a_vessel_that_is_half_drawn_is_there_in_the_next_run(tmp_path: Path) -> None:
    work = opened(tmp_path)
    work.add_empty(empties())
    work.go(TeachingStep.VESSEL)
    drawn = large(toy_vessel())
    work.keep_drawn(drawn)
    again = reopened(work, tmp_path)
    assert again.view().vessel is None
    assert (again.view().drawn == drawn).all()
    again.set_vessel(drawn)
    assert reopened(again, tmp_path).view().drawn is None


def test_a_correction_that_is_undone_is_no_correction(work: TeachingFolder) -> None:
    drive(work, 3)
    before = work.view().frames[0].frame.robot
    work.correct("0000", large(toy_robot(1, 0.9)))
    assert work.view().frames[0].is_corrected
    work.correct("0000", None)
    after = work.view().frames[0]
    assert not after.is_corrected
    assert (after.frame.robot == before).all()


def test_a_corrected_frame_of_a_bench_that_is_no_longer_there_is_not_learnt_from(work: TeachingFolder) -> None:
    drive(work, 3)
    work.correct("0000", large(toy_robot(0, 0.4)))
    work.add_empty([np.roll(one, 60, axis=1) for one in empties()])
    assert not work.view().frames[0].is_used


def test_a_computed_bench_need_not_be_known_where_the_robot_always_lies(work: TeachingFolder) -> None:
    drive(work)
    bench = work._bench
    assert bench is not None and bench.vessel is not None
    always = large(toy_robot(0, 0.45))
    work._use_bench(replace(bench, known=bench.known & ~always), is_computed=True)
    assert work.teaching_set().is_dir()


def test_a_frame_whose_picture_is_damaged_does_not_hide_the_others(work: TeachingFolder, tmp_path: Path) -> None:
    drive(work, 3)
    count = len(work.view().frames)
    (tmp_path / "teaching" / "frames" / "0001.png").write_bytes(b"no picture")
    assert len(reopened(work, tmp_path).view().frames) == count - 1


def test_a_step_that_lacks_its_bench_is_not_opened(work: TeachingFolder, tmp_path: Path) -> None:
    shutil.rmtree(tmp_path / "teaching" / "bench")
    assert reopened(work, tmp_path).view().step is TeachingStep.EMPTY
