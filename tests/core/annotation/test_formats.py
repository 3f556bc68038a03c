"""Files of other programs: each format there and back, read by libraries that are not ours; one line for each damaged part."""

import base64
import io
import json
import random
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import roifile
from PIL import Image

from core.annotation.formats import FORMATS, decompressed_runs, export_as, read_files
from core.annotation.masks import fill, polygons_of
from core.annotation.model import Annotation, AnnotationError, ImageView, MaskPolygon, MaskTarget
from core.annotation.store import FoundImage, ImageRecord, ItemKey, StoredAnnotation
from core.learning.dataset import write_png
from core.program import ROOT
from core.types import Mask
from tests.core.annotation.test_masks import shoelace

SIZE = (64, 48)
VESSEL_BOX = MaskPolygon(MaskTarget.VESSEL, ((10.0, 10.0), (50.0, 10.0), (50.0, 30.0), (10.0, 30.0)))
ROBOT_BOX = MaskPolygon(MaskTarget.ROBOT, ((20.0, 18.0), (40.0, 18.0), (40.0, 22.0), (20.0, 22.0)))
ROBOT_LINE, VESSEL_LINE = ((10.0, 20.0), (30.0, 21.5), (50.0, 20.0)), ((12.0, 24.0), (60.0, 24.0))


def with_hole() -> Mask:
    """A vessel with a hole in it."""
    mask = np.zeros((48, 64), bool)
    mask[5:40, 5:60] = True
    mask[15:25, 20:40] = False
    return mask


ALL = Annotation(ROBOT_LINE, VESSEL_LINE, masks=(*polygons_of(with_hole(), MaskTarget.VESSEL, 0.0), ROBOT_BOX))


def found_image(path: Path, sha256: str = "ab" * 32) -> FoundImage:
    write_png(path, np.full((48, 64, 3), 90, np.uint8))
    return FoundImage(path, ImageRecord(sha256, path.name, *SIZE))


@pytest.fixture
def image(tmp_path: Path) -> FoundImage:
    return found_image(tmp_path / "frame.png")


def stored(content: Annotation, sha256: str = "ab" * 32, rater: str = "ann", changed: str = "2026-01-01") -> StoredAnnotation:
    key = ItemKey(sha256, "", rater)
    return StoredAnnotation(key, ImageView.AS_IS, content, None, None, None, None, None, 1.0, changed)


def export(kind: str, image: FoundImage, out: Path, content: Annotation = ALL) -> Path:
    assert export_as(FORMATS[kind], [stored(content)], [image], out) == 1
    return out


@pytest.mark.parametrize("kind", [name for name, one in FORMATS.items() if one.write is not None])
def test_every_format_goes_out_and_comes_back(kind: str, image: FoundImage, tmp_path: Path) -> None:
    form, out = FORMATS[kind], tmp_path / "out"
    export(kind, image, out)
    files = [out] if form.writes_file else sorted(out.glob(f"*{form.ending}"))
    (back,), problems = read_files(files, [image])
    assert problems == []
    for target in MaskTarget:
        assert np.array_equal(fill(back.content.masks, target, SIZE), fill(ALL.masks, target, SIZE))
    lines = (ROBOT_LINE, VESSEL_LINE) if form.has_lines else ((), ())
    assert (back.content.robot, back.content.vessel) == lines
    with pytest.raises(AnnotationError, match="is there already; choose another --out"):
        export(kind, image, out)
    with pytest.raises(AnnotationError, match="no image has a mask"):
        export(kind, image, tmp_path / "nothing", Annotation())
    assert not (tmp_path / "nothing").exists()


@pytest.mark.parametrize("kind", [name for name, one in FORMATS.items() if one.write is not None])
def test_images_of_one_name_are_told_apart(kind: str, tmp_path: Path) -> None:
    images = []
    for number, folder in enumerate(("monday", "tuesday")):
        (tmp_path / folder).mkdir()
        images.append(found_image(tmp_path / folder / "frame.png", f"{number}" * 64))
    contents = [Annotation(masks=(VESSEL_BOX, piece)) for piece in (ROBOT_BOX, replace(ROBOT_BOX, points=VESSEL_BOX.points))]
    answers = [stored(content, one.sha256) for content, one in zip(contents, images, strict=True)]
    out = tmp_path / "out"
    assert export_as(FORMATS[kind], answers, images, out) == 2
    back, problems = read_files([out] if out.is_file() else sorted(out.rglob(f"*{FORMATS[kind].ending}")), images)
    assert (kind == "imagej") == bool(problems), "only ImageJ's file does not say where its picture lies"
    for one, content in zip(back, contents, strict=False):
        assert np.array_equal(*(fill(part.masks, MaskTarget.ROBOT, SIZE) for part in (one.content, content)))


def test_the_newest_lines_go_out_with_the_masks_that_count(image: FoundImage, tmp_path: Path) -> None:
    answers = [
        stored(replace(ALL, robot=VESSEL_LINE), rater="ben", changed="2026-01-02"),
        stored(Annotation(ROBOT_LINE, masks=(VESSEL_BOX,)), rater="cleo", changed="2026-01-03"),
    ]
    export_as(FORMATS["labelme"], answers, [image], tmp_path / "out")
    (back,), _ = read_files([tmp_path / "out" / "frame.json"], [image])
    assert (back.content.robot, back.content.vessel, back.content.drawn) == (ROBOT_LINE, (), set(MaskTarget))


def test_imagej_reads_regions_and_lines(image: FoundImage, tmp_path: Path) -> None:
    regions = roifile.roiread(export("imagej", image, tmp_path / "out") / "frame.zip")
    assert [(one.name, one.roitype.name) for one in regions] == [
        ("vessel 1", "RECT"),
        ("robot 2", "POLYGON"),
        ("robot line 3", "POLYLINE"),
        ("vessel line 4", "LINE"),
    ]
    assert regions[0].composite
    assert [len(ring) for ring in regions[0].coordinates(multi=True)] == [9, 9], "two closed rings, corners cut off"
    outline = regions[1].coordinates()
    assert (outline.min(axis=0).tolist(), outline.max(axis=0).tolist()) == ([20.0, 18.0], [41.0, 23.0]), "pixel corners"
    assert regions[2].coordinates().tolist() == [[10.5, 20.5], [30.5, 22.0], [50.5, 20.5]], "pixel centres"
    assert (regions[3].x1, regions[3].y1, regions[3].x2, regions[3].y2) == (12.5, 24.5, 60.5, 24.5)


def test_what_fiji_draws_is_read(image: FoundImage, tmp_path: Path) -> None:
    """Whole numbers, rectangles and free lines, and labels of other regions, as the ROI Manager writes them."""
    box = roifile.ImagejRoi(roitype=roifile.ROI_TYPE.RECT, name="Vessel", left=10, top=10, right=51, bottom=31)
    line = roifile.ImagejRoi.frompoints([[10, 20], [30, 22], [50, 20]], name="catheter-line")
    line.roitype = roifile.ROI_TYPE.FREELINE
    oval = roifile.ImagejRoi(roitype=roifile.ROI_TYPE.OVAL, name="robot", left=1, top=1, right=9, bottom=9)
    other = roifile.ImagejRoi(roitype=roifile.ROI_TYPE.RECT, name="0123-0456", left=1, top=1, right=9, bottom=9)
    path = tmp_path / "frame.zip"
    roifile.roiwrite(path, [box, line, oval, other])
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("broken.roi", b"Iout" + bytes(80))
    (back,), problems = read_files([path], [image])
    assert np.array_equal(fill(back.content.masks, MaskTarget.VESSEL, SIZE), fill([VESSEL_BOX], MaskTarget.VESSEL, SIZE))
    assert back.content.robot == ((9.5, 19.5), (29.5, 21.5), (49.5, 19.5))
    oval_line, other_line, broken_line = problems
    assert "not a polygon" in oval_line
    assert "unknown label '0123-0456'" in other_line
    assert "broken.roi" in broken_line


def test_a_label_map_has_a_number_for_each_pixel(image: FoundImage, tmp_path: Path) -> None:
    out = export(
        "png", image, tmp_path / "out", Annotation(masks=(VESSEL_BOX, replace(ROBOT_BOX, points=((0, 0), (12, 0), (12, 12)))))
    )
    with Image.open(out / "frame.png") as picture:
        assert picture.mode == "L"
        pixels = np.array(picture)
    assert (pixels[20, 20], pixels[0, 5], pixels[11, 11], pixels[40, 40]) == (1, 2, 3, 0)
    assert (out / "labels.txt").read_text().split() == ["background", "vessel", "robot", "vessel+robot"]


def test_label_maps_with_colours_and_labels_of_their_own(image: FoundImage, tmp_path: Path) -> None:
    folder = tmp_path / "labelme"
    folder.mkdir()
    labels = np.zeros((48, 64), np.uint8)
    labels[10:31, 10:51], labels[18:23, 20:41], labels[0, 0] = 2, 1, 9
    picture = Image.fromarray(labels.copy()).convert("P")
    picture.putpalette([0, 0, 0, 128, 0, 0, 0, 128, 0] + [0] * 18 + [0, 0, 128])
    labels[0, 0] = 0
    picture.save(folder / "frame.png")
    (folder / "labels.txt").write_text("_background_\nrobot\nvessel\n")
    (back,), problems = read_files([folder / "frame.png"], [image])
    assert problems == [f"{folder / 'frame.png'}: pixels of value 4 have no label (0 to 2 have); left out"]
    assert np.array_equal(fill(back.content.masks, MaskTarget.ROBOT, SIZE), labels == 1)
    write_png(folder / "frame.png", np.full((48, 64, 3), 90, np.uint8))
    assert read_files([folder / "frame.png"], [image])[1][0].endswith("is a picture in colours, not a map of labels; left out")


@pytest.mark.parametrize(
    ("text", "shape", "zeros"),
    [  # made by pycocotools 2.0
        ("0141NO13NM10O123NL", (5, 7), "1 1011011 01 010110111111011".replace(" ", "")),
        ("`7c41a>7VOJje0^4mgNoL", (48, 64), None),
    ],
)
def test_compressed_run_lengths_are_those_of_coco(text: str, shape: tuple[int, int], zeros: str | None) -> None:
    runs = decompressed_runs(text)
    assert sum(runs) == shape[0] * shape[1]
    mask = np.repeat(np.arange(len(runs)) % 2 == 1, runs).reshape(shape[::-1]).T
    if zeros is None:
        expected = np.zeros(shape, bool)
        expected[:, 5:60] = True
        expected[3, 8] = expected[40:, 20] = expected[10:12, 33] = False
        expected[0, 63] = True
    else:
        rows = ["1101001", "0101101", "0000001", "0011110", "0110111"]
        expected = np.array([[character == "1" for character in row] for row in rows])
    assert np.array_equal(mask, expected)


def coco(segmentation: object) -> dict[str, Any]:
    row = {"image_id": 1, "category_id": 1, "segmentation": segmentation}
    images = [{"id": 1, "file_name": "frame.png", "width": 64, "height": 48}]
    return {"images": images, "categories": [{"id": 1, "name": "vessel"}], "annotations": [row]}


def test_coco_with_compressed_run_lengths_is_read(tmp_path: Path, image: FoundImage) -> None:
    (content,), problems = read(tmp_path, image, coco({"size": [48, 64], "counts": "`7c41a>7VOJje0^4mgNoL"}))
    assert problems == []
    assert fill(content.masks, MaskTarget.VESSEL, SIZE).sum() == 55 * 48 - 1 - 8 - 2, "a single pixel is no outline"


CVAT = """<annotations><version>1.1</version><image id="0" name="run/frame.png" width="64" height="48">
<polygon label="vessel" occluded="0" points="10.0,10.0;51.0,10.0;51.0,31.0;10.0,31.0" z_order="0"></polygon>
<mask label="robot" source="semi-auto" occluded="0" rle="1, 2, 1, 4, 1, 2, 1" left="30" top="20" width="4" height="3"/>
<polyline label="robot" occluded="0" points="10.5,20.5;30.5,22.0;50.5,20.5"/>
<points label="robot" points="1,1"/><tag label="good"/>
</image></annotations>"""


def test_cvat_polygons_masks_and_polylines_are_read(tmp_path: Path, image: FoundImage) -> None:
    (content,), problems = read(tmp_path, image, CVAT, "annotations.xml")
    assert problems == ["run/frame.png: points 4 is a points of 1 points, not a polygon or the one line of its label; left out"]
    assert np.array_equal(fill(content.masks, MaskTarget.VESSEL, SIZE), fill([VESSEL_BOX], MaskTarget.VESSEL, SIZE))
    robot = np.zeros((48, 64), bool)
    robot[20, 31:33], robot[21, 30:34], robot[22, 31:33] = True, True, True
    assert np.array_equal(fill(content.masks, MaskTarget.ROBOT, SIZE), robot)
    assert content.robot == ROBOT_LINE


def test_coco_has_boxes_and_areas(image: FoundImage, tmp_path: Path) -> None:
    content = json.loads(export("coco", image, tmp_path / "coco.json").read_text())
    first, second = content["annotations"]
    assert (first["bbox"], first["area"]) == ([5, 5, 55, 35], int(with_hole().sum()))
    (flat,) = second["segmentation"]
    assert shoelace(np.reshape(flat, (-1, 2))) == pytest.approx(second["area"], abs=0.6), "an area, but for its four corners"
    assert (min(flat[::2]), max(flat[::2]), min(flat[1::2]), max(flat[1::2])) == (20.0, 41.0, 18.0, 23.0)
    assert set(content) == {"info", "images", "annotations", "categories"}


def test_labelme_has_the_parts_that_labelme_reads(image: FoundImage, tmp_path: Path) -> None:
    content = json.loads((export("labelme", image, tmp_path / "out") / "frame.json").read_text())
    assert set(content) == {"version", "flags", "shapes", "imagePath", "imageData", "imageHeight", "imageWidth"}
    assert (content["imagePath"], content["imageHeight"], content["imageWidth"]) == ("../frame.png", 48, 64)
    assert [one["shape_type"] for one in content["shapes"]] == ["mask", "polygon", "linestrip", "linestrip"]
    keys = {"label", "points", "group_id", "shape_type", "flags", "description", "mask"}
    assert all(set(one) == keys for one in content["shapes"])
    hole = content["shapes"][0]
    assert hole["points"] == [[5, 5], [59, 39]]
    with Image.open(io.BytesIO(base64.b64decode(hole["mask"]))) as patch:
        assert np.array_equal(np.array(patch) > 0, with_hole()[5:40, 5:60])


def labelme(**more: Any) -> dict[str, Any]:
    shape = {"label": "Vessel", "shape_type": "polygon", "points": [[10, 10], [51, 10], [51, 31], [10, 31]]}
    line = {"label": "robot", "shape_type": "linestrip", "points": [[1.5, 1.5], [9.5, 1.5]]}
    return {"imagePath": "..\\frames\\frame.png", "imageWidth": 64, "imageHeight": 48, "shapes": [shape, line]} | more


def read(tmp_path: Path, image: FoundImage, content: object, name: str = "in.json") -> tuple[list[Annotation], list[str]]:
    path = tmp_path / name
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
        ("[]", "neither labelme (shapes) nor COCO (images, annotations); left out"),
        ({"version": 3}, "neither labelme (shapes) nor COCO (images, annotations); left out"),
        (labelme(imagePath="other.png"), "its image 'other.png' is not among the given ones; left out"),
        (labelme(imageWidth=640), "says that frame.png is 640x48, but it is 64x48; left out"),
        (labelme(shapes=5), "its shapes are damaged; left out"),
        (labelme(shapes=[{"label": "bone", "points": []}]), "shape 1: unknown label 'bone'"),
        (labelme(shapes=[{"label": "robot", "points": [[1, "x"]]}]), "shape 1 is damaged ("),
        (labelme(shapes=[{"label": "robot", "points": [[1, 1]]}]), "shape 1 is a polygon of 1 points"),
        (labelme(shapes=[{"label": "robot", "points": [[1, 1], [1.2, 1], [1.2, 9]]}]), "shape 1 covers no pixel; left out"),
        ({"images": [], "annotations": []}, "its images or categories are damaged; left out"),
        (coco({"size": [48, 64], "counts": "0141NO"}), "annotation 1 is damaged (run lengths of another size); left out"),
        (coco({"size": [48, 64], "counts": "01~"}), "annotation 1 is damaged (run lengths with a character"),
        (coco({"size": [48, 64], "counts": "P"}), "annotation 1 is damaged (run lengths that are cut short); left out"),
    ],
)
def test_what_is_damaged_or_unknown_is_named(tmp_path: Path, image: FoundImage, content: object, line: str) -> None:
    found, problems = read(tmp_path, image, content)
    assert found == []
    assert problems[0].startswith(line)


def test_files_damaged_at_random_never_raise(tmp_path: Path, image: FoundImage) -> None:
    rng = random.Random(4)
    texts = [(export("coco", image, tmp_path / "coco.json").read_text(), ".json"), (json.dumps(labelme()), ".json"), (CVAT, ".xml")]
    for text, ending in texts:
        path = tmp_path / f"damaged{ending}"
        for _ in range(70):
            place = rng.randrange(len(text))
            piece = rng.choice(("", "null", "-1e999", '"x"', "[]", "{}", "}", "9"))
            path.write_text(text[:place] + piece + text[place + rng.randrange(4) :])
            read_files([path], [image])
    for kind in ("png", "imagej"):
        (source,) = export(kind, image, tmp_path / kind).glob(f"frame{FORMATS[kind].ending}")
        data = source.read_bytes()
        for _ in range(50):
            place = rng.randrange(len(data))
            source.write_bytes(data[:place] + rng.randbytes(rng.randrange(3)) + data[place + rng.randrange(3) :])
            read_files([source], [image])


def test_regions_damaged_at_random_never_raise(tmp_path: Path, image: FoundImage) -> None:
    """Inside the ZIP, whose check sum hides damage to its bytes."""
    rng = random.Random(5)
    with zipfile.ZipFile(export("imagej", image, tmp_path / "out") / "frame.zip") as archive:
        regions = [archive.read(name) for name in archive.namelist()]
    for _ in range(50):
        with zipfile.ZipFile(tmp_path / "frame.zip", "w") as archive:
            for number, data in enumerate(regions):
                place = rng.randrange(len(data))
                archive.writestr(f"{number}.roi", data[:place] + rng.randbytes(4) + data[place + 4 :])
        read_files([tmp_path / "frame.zip"], [image])


def test_the_documentation_names_every_format() -> None:
    text = (ROOT / "docs" / "studies.md").read_text(encoding="utf-8")
    assert [name for name in FORMATS if f"`{name}`" not in text] == []
