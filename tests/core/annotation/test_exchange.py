"""Export and import: training sets, COCO both ways, labelme, and one line for each damaged part."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from core.annotation.exchange import FEWEST, export_coco, export_training_set, merged, read_files, split_own_frames
from core.annotation.masks import fill, polygons_of
from core.annotation.model import (
    Annotation,
    AnnotationError,
    ImageView,
    MaskPolygon,
    MaskTarget,
)
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


def test_coco_goes_out_and_comes_back(image: FoundImage, tmp_path: Path) -> None:
    hole = np.zeros((48, 64), bool)
    hole[5:40, 5:60] = True
    hole[15:25, 20:40] = False
    masks = (*polygons_of(hole, MaskTarget.VESSEL, 0.0), ROBOT_BOX)
    out = tmp_path / "coco.json"
    assert export_coco([stored(with_masks(*masks))], [image], out) == 1
    content = json.loads(out.read_text())
    first, second = content["annotations"]
    assert (first["bbox"], first["area"]) == ([5, 5, 55, 35], int(hole.sum()))
    (flat,) = second["segmentation"]
    assert shoelace(np.reshape(flat, (-1, 2))) == pytest.approx(second["area"], abs=0.6), "an area, but for its four corners"
    assert (min(flat[::2]), max(flat[::2]), min(flat[1::2]), max(flat[1::2])) == (20.0, 41.0, 18.0, 23.0)
    (back,), problems = read_files([out], [image])
    assert problems == []
    for target in MaskTarget:
        assert np.array_equal(fill(back.content.masks, target, SIZE), fill(masks, target, SIZE))
    with pytest.raises(AnnotationError, match="is there already"):
        export_coco([stored(with_masks(*masks))], [image], out)


def test_coco_tells_images_of_one_name_apart(image: FoundImage, tmp_path: Path) -> None:
    images = []
    for number, folder in enumerate(("monday", "tuesday")):
        (tmp_path / folder).mkdir()
        path = tmp_path / folder / "frame.png"
        cv2.imwrite(str(path), np.full((48, 64, 3), 90 + number, np.uint8))
        images.append(FoundImage(path, ImageRecord(f"{number}" * 64, path.name, *SIZE)))
    answers = [replace(stored(with_masks(VESSEL_BOX)), key=ItemKey(one.sha256, "", "a", 1)) for one in images]
    assert export_coco(answers, images, tmp_path / "coco.json") == 2
    content = json.loads((tmp_path / "coco.json").read_text())
    assert [one["file_name"] for one in content["images"]] == ["monday/frame.png", "tuesday/frame.png"]
    back, problems = read_files([tmp_path / "coco.json"], images)
    assert problems == []
    assert [one.image for one in back] == images


def shoelace(points: np.ndarray) -> float:
    """The area of a polygon (N, 2)."""
    (x0, y0), (x1, y1) = points.T, np.roll(points, -1, axis=0).T
    return abs(float(np.sum(x0 * y1 - x1 * y0))) / 2.0


def labelme(**more: Any) -> dict[str, Any]:
    shape = {"label": "Vessel", "shape_type": "polygon", "points": [[10, 10], [51, 10], [51, 31], [10, 31]]}
    line = {"label": "robot", "shape_type": "linestrip", "points": [[1.5, 1.5], [9.5, 1.5]]}
    return {"imagePath": "..\\frames\\frame.png", "imageWidth": 64, "imageHeight": 48, "shapes": [shape, line]} | more


def read(tmp_path: Path, image: FoundImage, content: object) -> tuple[list[Annotation], list[str]]:
    path = tmp_path / "in.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    found, problems = read_files([path], [image])
    return [one.content for one in found], [line.removeprefix(f"{path}: ") for line in problems]


def test_labelme_polygons_and_lines(tmp_path: Path, image: FoundImage) -> None:
    (content,), problems = read(tmp_path, image, labelme())
    assert problems == []
    assert content.robot == ((1.0, 1.0), (9.0, 1.0))
    for target in MaskTarget:
        assert np.array_equal(fill(content.masks, target, SIZE), fill([VESSEL_BOX], target, SIZE))


@pytest.mark.parametrize(
    ("content", "line"),
    [
        ("{", "damaged, not valid JSON; left out"),
        ("[" * 100_000, "damaged, not valid JSON; left out"),
        ("[]", "neither labelme nor COCO; left out"),
        ({"version": 3}, "neither labelme (shapes) nor COCO (images, annotations); left out"),
        (labelme(imagePath="other.png"), "its image 'other.png' is not among the given ones; left out"),
        (labelme(imageWidth=640), "says that frame.png is 640x48, but it is 64x48; left out"),
        (labelme(shapes=5), "its shapes are damaged; left out"),
        (labelme(shapes=[{"label": "bone", "points": []}]), "shape 1: unknown label 'bone'"),
        (labelme(shapes=[{"label": "robot", "points": [[1, "x"]]}]), "shape 1 is damaged; left out"),
        (labelme(shapes=[{"label": "robot", "points": [[1, 1]]}]), "shape 1 is a polygon of 1 points"),
        (labelme(shapes=[{"label": "robot", "points": [[1, 1], [1.2, 1], [1.2, 9]]}]), "shape 1 covers no pixel; left out"),
        ({"images": [], "annotations": []}, "its images or categories are damaged; left out"),
    ],
)
def test_what_is_damaged_or_unknown_is_named(tmp_path: Path, image: FoundImage, content: object, line: str) -> None:
    found, problems = read(tmp_path, image, content)
    assert found == []
    assert problems[0].startswith(line)


def test_one_bad_shape_leaves_the_others(tmp_path: Path, image: FoundImage) -> None:
    content = labelme()
    content["shapes"].insert(0, {"label": "robot", "points": None})
    (found,), problems = read(tmp_path, image, content)
    assert np.array_equal(fill(found.masks, MaskTarget.VESSEL, SIZE), fill([VESSEL_BOX], MaskTarget.VESSEL, SIZE))
    assert problems == ["shape 1 is damaged; left out"]


def test_files_damaged_at_random_never_raise(tmp_path: Path, image: FoundImage) -> None:
    coco = tmp_path / "coco.json"
    export_coco([stored(with_masks(VESSEL_BOX, ROBOT_BOX))], [image], coco)
    rng, path = random.Random(4), tmp_path / "damaged.json"
    for text in (coco.read_text(), json.dumps(labelme())):
        for _ in range(300):
            place = rng.randrange(len(text))
            piece = rng.choice(("", "null", "-1e999", '"x"', "[]", "{}", "}", "9"))
            path.write_text(text[:place] + piece + text[place + rng.randrange(4) :])
            read_files([path], [image])


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
