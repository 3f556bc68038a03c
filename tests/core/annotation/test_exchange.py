"""Training sets out of annotations, and imported annotations put into what is there."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.annotation.exchange import FEWEST, export_training_set, merged, split_own_frames
from core.annotation.masks import fill
from core.annotation.model import Annotation, AnnotationError, ImageView, MaskPolygon, MaskTarget
from core.annotation.store import AnnotationStore, FoundImage, ImageRecord, ItemKey, StoredAnnotation, find_images
from core.learning.dataset import UNMEASURED, find_labelled, find_samples, read_truth, write_png
from core.types import PoseState
from tests.app.annotated import annotate_masks, measure

SIZE = (64, 48)
VESSEL_BOX = MaskPolygon(MaskTarget.VESSEL, ((10.0, 10.0), (50.0, 10.0), (50.0, 30.0), (10.0, 30.0)))
ROBOT_BOX = MaskPolygon(MaskTarget.ROBOT, ((20.0, 18.0), (40.0, 18.0), (40.0, 22.0), (20.0, 22.0)))
LINES = Annotation(((10.0, 20.0), (50.0, 20.0)), ((12.0, 24.0), (60.0, 24.0)), PoseState.B)


@pytest.fixture
def image(tmp_path: Path) -> FoundImage:
    path = tmp_path / "frame.png"
    write_png(path, np.full((48, 64, 3), 90, np.uint8))
    return FoundImage(path, ImageRecord("ab" * 32, "frame.png", *SIZE))


def stored(content: Annotation, rater: str = "ann", changed: str = "2026-01-01", theta: float | None = None) -> StoredAnnotation:
    key = ItemKey("ab" * 32, "", rater)
    return StoredAnnotation(key, ImageView.AS_IS, content, theta, theta, 4.0, 4.0, False, 1.0, changed)


def with_masks(*masks: MaskPolygon) -> Annotation:
    return Annotation(LINES.robot, LINES.vessel, LINES.state, masks=masks)


def tilted(annotation: Annotation, theta_deg: float) -> Annotation:
    """The robot's line turned about its head, by so much against the vessel."""
    (tail_x, _), (head_x, head_y) = annotation.robot
    rise = (head_x - tail_x) * math.tan(math.radians(theta_deg))
    return replace(annotation, robot=((tail_x, head_y - rise), (head_x, head_y)))


def test_a_training_set_is_what_training_reads(image: FoundImage, tmp_path: Path) -> None:
    out = tmp_path / "set"
    older, newer = (
        stored(with_masks(VESSEL_BOX), changed="2026-01-01"),
        stored(tilted(with_masks(VESSEL_BOX, ROBOT_BOX), 3.0), "bob", "2026-01-02", 3.0),
    )
    assert export_training_set([older, newer], [image], out) == (1, [])
    (sample,), truth = find_labelled(out)
    pixels, vessel, robot = sample.load()
    assert pixels.shape == (48, 64, 3)
    assert np.array_equal(vessel, fill([VESSEL_BOX], MaskTarget.VESSEL, SIZE)), "the newest masks count"
    assert robot.sum() == 21 * 5
    row = truth["frame"]
    assert (row["theta_deg"], row["state"], row["head_xy"]) == (pytest.approx(3.0), "B", [50.0, 20.0])
    with pytest.raises(AnnotationError, match="is not empty; choose another --out"):
        export_training_set([newer], [image], out)


def test_a_picture_without_a_robot_trains_with_an_empty_mask(image: FoundImage, tmp_path: Path) -> None:
    """Only where a rater has said so: else a robot that is there would be taught as background."""
    out = tmp_path / "set"
    assert export_training_set([stored(Annotation(no_robot=True, masks=(VESSEL_BOX,)))], [image], out) == (1, [])
    (sample,), truth = find_labelled(out)
    assert not sample.load()[2].any()
    assert (truth["frame"]["reason"], truth["frame"]["state"]) == ("no robot", None)


@pytest.mark.parametrize("ending", [".webp", ".JPG"])
def test_training_finds_every_image_of_its_set(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"frame{ending}"
    cv2.imwrite(str(path), np.full((48, 64, 3), 90, np.uint8))
    image = FoundImage(path, ImageRecord("ab" * 32, path.name, *SIZE))
    assert export_training_set([stored(with_masks(VESSEL_BOX, ROBOT_BOX))], [image], tmp_path / "set") == (1, [])
    (sample,), _ = find_labelled(tmp_path / "set")
    assert sample.load()[0].mean() == pytest.approx(90, abs=2)


def test_truth_is_of_finished_answers_of_one_study(image: FoundImage, tmp_path: Path) -> None:
    """Half-drawn lines of one rater, and another study's angle, went into the mean that training takes for the truth."""
    done = stored(tilted(with_masks(VESSEL_BOX, ROBOT_BOX), 10.0), theta=10.0)
    begun = stored(replace(tilted(LINES, 80.0), state=None), "ben", theta=80.0)
    export_training_set([done, begun], [image], tmp_path / "set")
    row = find_labelled(tmp_path / "set")[1]["frame"]
    assert (row["theta_deg"], row["state"]) == (pytest.approx(10.0), "B")
    other = replace(stored(tilted(LINES, 50.0), "cleo", theta=50.0), key=ItemKey("ab" * 32, "other", "cleo"))
    with pytest.raises(
        AnnotationError, match=r"measured in several studies \('' \(outside studies\), 'other'\); choose one with --study"
    ):
        export_training_set([done, other], [image], tmp_path / "set2")
    assert not (tmp_path / "set2").exists()


def test_a_hole_alone_is_no_mask(image: FoundImage, tmp_path: Path) -> None:
    lone = replace(ROBOT_BOX, is_hole=True)
    assert with_masks(VESSEL_BOX, lone).drawn == {MaskTarget.VESSEL}
    with pytest.raises(AnnotationError, match="no image has both a vessel and a robot mask"):
        export_training_set([stored(with_masks(VESSEL_BOX, lone))], [image], tmp_path / "set")
    assert merged(Annotation(masks=(lone,)), Annotation(masks=(ROBOT_BOX,))).masks == (lone, ROBOT_BOX)


@pytest.mark.parametrize("is_answer", [True, False])
def test_an_image_without_angle_trains_but_has_no_truth(image: FoundImage, tmp_path: Path, is_answer: bool) -> None:
    answers = [stored(Annotation(cannot_tell=is_answer, masks=(VESSEL_BOX, ROBOT_BOX)))]
    answers.append(stored(with_masks(VESSEL_BOX), "bob", "2026-01-02"))  # newer, but half
    assert export_training_set(answers, [image], tmp_path / "set") == (1, [])
    row = find_labelled(tmp_path / "set")[1]["frame"]
    assert (row["theta_deg"], row["state"], row["reason"]) == (None, None, "not measured by hand")
    with pytest.raises(AnnotationError, match="no image has both a vessel and a robot mask"):
        export_training_set(answers[1:], [image], tmp_path / "set")


def test_an_import_fills_gaps_and_replaces_no_work_by_hand() -> None:
    both = merged(with_masks(VESSEL_BOX), Annotation(masks=(ROBOT_BOX,)))
    assert both.masks == (VESSEL_BOX, ROBOT_BOX)
    new = Annotation(((1.0, 1.0), (2.0, 2.0)), masks=(MaskPolygon(MaskTarget.VESSEL, ROBOT_BOX.points), ROBOT_BOX))
    assert merged(both, new) == both
    assert merged(Annotation(note="mine"), new) == Annotation(new.robot, masks=new.masks, note="mine")


def read_store(store_path: Path) -> tuple[Sequence[StoredAnnotation], list[FoundImage]]:
    with AnnotationStore(store_path) as store:
        return store.annotations(), find_images(sorted(store_path.parent.glob("*.png")), store)[0]


@pytest.mark.parametrize(("count", "held_out"), [(6, 2), (9, 2), (10, 2), (15, 3), (24, 4)])
def test_a_fifth_and_two_at_least_stay_out(count: int, held_out: int, tmp_path: Path) -> None:
    annotations, images = read_store(annotate_masks(tmp_path / "images", count))
    frames = split_own_frames(annotations, images, tmp_path / "sets")
    assert (frames.train_count, frames.held_out_count) == (count - held_out, held_out)
    train, out = ({sample.stem for sample in find_samples([folder])} for folder in (frames.train, frames.held_out))
    assert len(train) == count - held_out
    assert not train & out
    places = sorted(int(stem.removeprefix("frame_")) for stem in out)
    begin = (count - held_out) // 2
    assert places == list(range(begin, begin + held_out)), "neighbours in the order of their names"


def test_too_few_masks_are_refused_with_what_is_missing(tmp_path: Path) -> None:
    annotations, images = read_store(annotate_masks(tmp_path / "images", FEWEST + 1, without_robot=(0, 3)))
    with pytest.raises(AnnotationError, match=r"5 images have both a vessel and a robot mask, and training needs 6: 1 more"):
        split_own_frames(annotations, images, tmp_path / "sets")
    with pytest.raises(AnnotationError, match=r"1 image has both"):
        split_own_frames(annotations, images[1:2], tmp_path / "sets")
    assert not (tmp_path / "sets").exists()


def test_answers_of_several_studies_are_no_obstacle_to_training(tmp_path: Path) -> None:
    path = annotate_masks(tmp_path / "images", FEWEST)
    pictures = sorted(path.parent.glob("*.png"))
    measure(path, pictures, [3.0] * FEWEST, study="first")
    annotations, images = read_store(path)
    frames = split_own_frames(annotations, images, tmp_path / "of one")
    assert {row["state"] for row in read_truth(frames.held_out).values()} == {"C"}
    measure(path, pictures[:1], [9.0], study="second")
    annotations, images = read_store(path)
    frames = split_own_frames(annotations, images, tmp_path / "of two")
    assert (frames.train_count, frames.held_out_count) == (FEWEST - 2, 2)
    assert {row["reason"] for row in read_truth(frames.held_out).values()} == {UNMEASURED}
