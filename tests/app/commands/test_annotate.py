"""``annotate`` as a user calls it: studies, agreement, export, import, salvage, and the way on to ``evaluate``."""

from __future__ import annotations

import csv
import json
import shutil
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from app.annotator.sources import AnnotateOptions, StudyOptions
from app.commands import evaluation_report
from app.commands.annotate import queue_of, run_annotate
from app.commands.evaluate import evaluate
from core.annotation.model import Annotation, History, ImageView, MaskPolygon, MaskTarget, measure_lines
from core.annotation.store import DEFAULT_NAME, AnnotationStore, FoundImage, ItemKey, find_images
from core.config.models import Config, TwinConfig
from core.devices import UserError
from core.evaluation.evaluation import read_measurements
from core.learning.dataset import find_labelled, write_png
from core.types import PoseState
from hardware.twin.world import TwinWorld
from tests.app.program import run as main

pytestmark = pytest.mark.usefixtures("looked_at_once")

BOXES = (
    MaskPolygon(MaskTarget.VESSEL, ((10.0, 10.0), (200.0, 10.0), (200.0, 200.0), (10.0, 200.0))),
    MaskPolygon(MaskTarget.ROBOT, ((10.0, 10.0), (200.0, 10.0), (200.0, 50.0), (10.0, 50.0))),
)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three pictures of the twin, as its camera sees them."""
    folder = tmp_path_factory.mktemp("pictures")
    world = TwinWorld(TwinConfig(phantom="tree"))
    for k in range(3):
        world.insert(50.0 + 8.0 * k)
        write_png(folder / f"{k}.png", world.frame().image)
    return folder


@pytest.fixture
def folder(pictures: Path, tmp_path: Path) -> Path:
    for path in pictures.glob("*.png"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


def save(store: AnnotationStore, image: FoundImage, content: Annotation, key: ItemKey) -> None:
    entry = History().edit("draw", content)
    assert entry is not None
    store.save(key, ImageView.AS_IS, entry, content, measure_lines(content, image.record.size, Config().perception), 9.0)


def annotate(folder: Path, study: str = "", raters: tuple[str, ...] = ("ann", "bob")) -> None:
    """Each rater answers each image twice (once outside a study); Bob turns the robot by a degree or so more."""
    with AnnotationStore(folder / DEFAULT_NAME) as store:
        images, _ = find_images(sorted(folder.glob("*.png")), store)
        for place, rater in enumerate(raters):
            for repeat in (1, 2) if study else (1,):
                for k, image in enumerate(images):
                    bent = 190.0 + 12 * k + place + repeat
                    content = Annotation(((250.0, 180.0), (300.0, bent)), ((200.0, 200.0), (400.0, 200.0)), masks=BOXES)
                    measured = measure_lines(content, image.record.size, Config().perception)
                    save(store, image, replace(content, state=measured.pose.state), ItemKey(image.sha256, study, rater, repeat))


def run(folder: Path, **more: object) -> int:
    return run_annotate(AnnotateOptions(paths=(folder,), **more))


def queue(folder: Path, **more: object) -> list[tuple[str, int, ImageView]]:
    options = StudyOptions(**more)
    with AnnotationStore(folder / DEFAULT_NAME) as store:
        images, _ = find_images(sorted(folder.glob("*.png")), store)
        return [
            (i.image.path.name, i.key.repeat, i.view) for i in queue_of(store, images, options.rater or "ann", options, Config())
        ]


def test_the_agreement_is_printed_and_written(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    annotate(folder, "pilot")
    assert run(folder, report=True, out=tmp_path / "report") == 0
    printed = capsys.readouterr().out
    assert "Study pilot: 12 answers on 3 images" in printed
    assert "ann, bob" in printed
    assert max(map(len, printed.splitlines())) <= 80
    report = json.loads((tmp_path / "report" / "agreement.json").read_text())
    assert set(report["raters"]) == {"ann", "bob"}
    assert report["between"]["n"] == 3
    assert len((tmp_path / "report" / "measures.csv").read_text().splitlines()) == 13
    run(folder, report=True, as_json=True)
    assert json.loads(capsys.readouterr().out)["study"] == "pilot"


def test_a_report_tells_that_angles_were_drawn_under_other_lengths(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Angles that had been fitted to other lengths went into one figure with the others, and nothing said so."""
    annotate(folder)
    assert run(folder, report=True, as_json=True) == 0
    before = capsys.readouterr()
    assert "fitted otherwise" not in before.err
    config = tmp_path / "other.toml"
    config.write_text("[perception.vectors]\nvessel_half_length_px = 10.0\nrobot_length_px = 20.0\n")
    assert run(folder, report=True, as_json=True, config_path=config) == 0
    after = capsys.readouterr()
    assert [row["theta_deg"] for row in json.loads(after.out)["measures"]] == pytest.approx(
        [row["theta_deg"] for row in json.loads(before.out)["measures"]]
    ), "straight lines have one angle whatever their length"
    assert "fitted otherwise" not in after.err
    with AnnotationStore(folder / DEFAULT_NAME) as store:
        (image, *_), _ = find_images(sorted(folder.glob("*.png")), store)
        robot = ((200.0, 240.0), (270.0, 240.0), (290.0, 220.0))
        content = Annotation(robot, ((150.0, 200.0), (400.0, 200.0)), PoseState.C)
        save(store, image, content, ItemKey(image.sha256, "", "cleo"))
    assert run(folder, report=True, as_json=True, config_path=config) == 0
    told = capsys.readouterr()
    assert "Of the manual angles 1 were fitted otherwise" in told.err
    (row,) = [row for row in json.loads(told.out)["measures"] if row["rater"] == "cleo"]
    assert row["theta_deg"] == pytest.approx(45.0)


def test_annotations_become_a_training_set_a_coco_file_and_come_back(folder: Path, tmp_path: Path) -> None:
    annotate(folder)
    run(folder, export="dataset", out=tmp_path / "set")
    samples, truth = find_labelled(tmp_path / "set")
    assert [sample.stem for sample in samples] == ["0", "1", "2"]
    assert truth["0"]["theta_deg"] is not None
    run(folder, export="coco", out=tmp_path / "coco.json")
    other = tmp_path / "other.sqlite"
    run(folder, imports=(tmp_path / "coco.json",), store=other, study=StudyOptions(rater="eve"))
    with AnnotationStore(other, read_only=True) as store:
        assert [(one.key.rater, len(one.content.masks)) for one in store.annotations()] == [("eve", 2)] * 3
    with pytest.raises(UserError, match="nothing was imported"):
        run(folder, imports=(tmp_path / "coco.json",), store=other, study=StudyOptions(rater="eve"))


def test_angles_over_time_go_out_as_table_and_figure(folder: Path, tmp_path: Path) -> None:
    annotate(folder, raters=("ann",))
    run(folder, export="angles", out=tmp_path / "angles.csv")
    with (tmp_path / "angles.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["image"], row["rater"], row["provenance"]) for row in rows] == [(f"{k}.png", "ann", "manual") for k in range(3)]
    assert all(abs(float(row["theta_signed_deg"])) == float(row["theta_deg"]) for row in rows)
    assert (rows[0]["time_s"], rows[0]["algorithm_theta_signed_deg"]) == ("", ""), "they are of no recording"
    assert (tmp_path / "angles.svg").read_bytes().startswith(b"<?xml")
    with pytest.raises(UserError, match=r"angles\.csv: is there already"):
        run(folder, export="angles", out=tmp_path / "angles.csv")


def test_without_matplotlib_angles_go_out_as_a_table_alone(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    annotate(folder, raters=("ann",))
    monkeypatch.setattr(evaluation_report, "missing", lambda package: f"this needs the package {package}")
    (tmp_path / "angles.svg").touch()
    run(folder, export="angles", out=tmp_path / "angles.csv")
    said = capsys.readouterr().err
    assert said.endswith(f"no figures: this needs the package matplotlib\n3 angles in {tmp_path / 'angles.csv'}\n")
    assert not (tmp_path / "angles.svg").read_bytes()


def test_a_training_set_has_the_angles_of_one_study_and_masks_from_anywhere(folder: Path, tmp_path: Path) -> None:
    """A study is blind, so that masks are drawn outside it: with --study they were left out, and said not to be there."""
    annotate(folder, raters=("ann",))
    with AnnotationStore(folder / DEFAULT_NAME) as store:
        images, _ = find_images(sorted(folder.glob("*.png")), store)
        for image in images:
            content = Annotation(((250.0, 180.0), (300.0, 180.0)), ((200.0, 200.0), (400.0, 200.0)), PoseState.C)
            save(store, image, content, ItemKey(image.sha256, "first", "ann"))
    with pytest.raises(UserError, match="several studies"):
        run(folder, export="dataset", out=tmp_path / "any")
    run(folder, export="dataset", out=tmp_path / "first", study=StudyOptions("first"))
    samples, truth = find_labelled(tmp_path / "first")
    assert [truth[sample.stem]["theta_deg"] for sample in samples] == pytest.approx([0.0] * 3, abs=1e-6)
    run(folder, export="dataset", out=tmp_path / "outside", study=StudyOptions(""))
    assert find_labelled(tmp_path / "outside")[1]["0"]["theta_deg"] > 5.0
    with pytest.raises(UserError, match="nobody has answered in study 'fisrt'"):
        run(folder, export="dataset", out=tmp_path / "misspelt", study=StudyOptions("fisrt"))


def test_an_import_goes_on_from_the_journal_where_the_answer_itself_is_damaged(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The imported mask took the place of the lines that were in force."""
    annotate(folder, raters=("ann",))
    coco, bare = tmp_path / "coco.json", tmp_path / "bare.sqlite"
    run(folder, export="coco", out=coco)
    with AnnotationStore(bare) as store:
        image = find_images([folder / "0.png"], store)[0][0]
        lines = Annotation(((250.0, 180.0), (300.0, 190.0)), ((200.0, 200.0), (400.0, 200.0)), PoseState.C)
        save(store, image, lines, ItemKey(image.sha256, "", "ann"))
    with closing(sqlite3.connect(bare)) as database:
        database.execute("UPDATE annotations SET content = replace(content, '300.0', '333.0')")
        database.commit()
    run(folder, imports=(coco,), store=bare, study=StudyOptions(rater="ann"))
    assert "damaged" in capsys.readouterr().err
    with AnnotationStore(bare, read_only=True) as store:
        (one,) = [a for a in store.annotations() if a.key.sha256 == image.sha256]
    assert (one.content.robot, one.content.state, len(one.content.masks)) == (lines.robot, PoseState.C, 2)


def test_one_rater_alone_is_exported_and_reported(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    annotate(folder)
    for name in ("ann", "bob"):
        run(folder, export="csv", out=tmp_path / f"{name}.csv", study=StudyOptions(rater=name))
    first, second = (read_measurements(tmp_path / f"{name}.csv") for name in ("ann", "bob"))
    assert len(first) == len(second) == 3
    assert [row.angle_1 for row in first] != [row.angle_1 for row in second]
    capsys.readouterr()
    run(folder, report=True, as_json=True, study=StudyOptions(rater="bob"))
    assert "ann" not in json.loads(capsys.readouterr().out)["raters"]
    for what in ({"export": "csv", "out": tmp_path / "eve.csv"}, {"report": True}):
        with pytest.raises(UserError, match="--rater eve: has annotated nothing here; who has: ann, bob"):
            run(folder, study=StudyOptions(rater="eve"), **what)
    with pytest.raises(UserError, match=r"bob\.csv: is there already"):
        run(folder, export="csv", out=tmp_path / "bob.csv")


def test_an_annotated_folder_is_evaluated_as_its_table_is(folder: Path, tmp_path: Path) -> None:
    annotate(folder)
    run(folder, export="csv", out=tmp_path / "table.csv")
    rows = read_measurements(tmp_path / "table.csv")
    assert [row.image for row in rows] == ["0.png", "1.png", "2.png"]
    assert all(row.angle_1 is not None and row.angle_2 is not None and row.state is not None for row in rows)
    with AnnotationStore(folder / DEFAULT_NAME) as store:
        store.keep_look(store.annotations()[0].key, 0)
    evaluate(tmp_path / "by_table", csv=tmp_path / "table.csv")
    evaluate(tmp_path / "by_folder", folder)
    first, second = (json.loads((tmp_path / name / "metrics.json").read_text()) for name in ("by_table", "by_folder"))
    assert (first["angle"], first["state"], first["manual"]) == (second["angle"], second["state"], second["manual"])
    assert second["source"]["kind"] == "annotated by hand"
    looked = "Of the manual answers 1 were given, or changed, after the algorithm's lines had been shown (key H)"
    assert any(note.startswith(looked) for note in second["notes"])


def test_a_study_is_gone_on_with_as_it_was_begun(folder: Path) -> None:
    first = queue(folder, asked="pilot", turn=True, seed=4)
    assert len(first) == 6
    assert {view for _, repeat, view in first if repeat == 2} == {ImageView.TURNED}
    assert queue(folder, asked="pilot") == first
    for other in ({"mirror": True}, {"repeats": 3}, {"seed": 5}, {"order": "even"}):
        with pytest.raises(UserError, match=r"was begun otherwise: shown 2 times \(as is, turned\), order random, seed 4"):
            queue(folder, asked="pilot", **other)


def test_a_study_goes_on_without_an_image_that_vanished(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    queue(folder, asked="pilot")
    (folder / "1.png").unlink()
    assert {name for name, _, _ in queue(folder, asked="pilot")} == {"0.png", "2.png"}
    assert "1.png: belongs to the study, but is not here; left out" in capsys.readouterr().err


def test_queues_outside_studies(folder: Path) -> None:
    names = ["0.png", "1.png", "2.png"]
    assert [name for name, _, _ in queue(folder)] == names
    assert [name for name, _, _ in queue(folder, order="even")] == ["0.png", "2.png", "1.png"]
    assert sorted(name for name, _, _ in queue(folder, order="worst")) == names
    assert queue(folder, order="random", seed=1) == queue(folder, order="random", seed=1)
    with pytest.raises(UserError, match="belong to a study: give it a name with --study"):
        queue(folder, mirror=True)
    with pytest.raises(UserError, match="--order bad: must be one of listed, random, worst, even"):
        queue(folder, order="bad")


def test_a_damaged_file_is_salvaged_into_a_new_one(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    annotate(folder)
    path = folder / DEFAULT_NAME
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(UserError, match="damaged; annotate --salvage writes what is readable into a new file"):
        run(folder, report=True)
    run(folder, salvage=True)
    assert "the damaged file is as it was" in capsys.readouterr().err
    assert path.read_bytes() == data[: len(data) // 2]
    with pytest.raises(UserError, match="is there already; choose another --out"):
        run(folder, salvage=True)


def test_two_raters_files_are_joined(folder: Path, pictures: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ann's file comes from another computer, whose folder has the same pictures; Bob is there, too, and his name tells nothing."""
    there = tmp_path / "there"
    shutil.copytree(pictures, there)
    annotate(folder, "pilot", raters=("bob",))
    annotate(there, "pilot")
    with pytest.raises(UserError, match=r"a rater 'bob' is there and here, .*--as bob=NAME \(somebody else\)") as raised:
        run(folder, joins=(there,))
    assert "\n" not in str(raised.value)
    assert run(folder, joins=(there / DEFAULT_NAME,), names=("bob=robert",)) == 0
    told = capsys.readouterr().err
    assert f"{there / DEFAULT_NAME}: ann, robert (there: bob)\n" in told
    assert f"12 answers are new in {folder / DEFAULT_NAME}, 0 went on, 0 were there already\n" in told
    run(folder, joins=(there,))
    assert "0 answers are new" in capsys.readouterr().err
    run(folder, report=True, as_json=True)
    assert set(json.loads(capsys.readouterr().out)["raters"]) == {"ann", "bob", "robert"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"report": True}, "no such annotation file; annotate the images first"),
        ({"model": ""}, r"segmentation\.model"),
        ({"export": "xml", "out": Path("x")}, "--export xml: must be one of dataset, csv, angles, labelme, coco"),
        ({"export": "csv"}, "--export needs --out"),
        ({"imports": (Path("nowhere.json"),)}, "nothing was imported"),
        ({"joins": (Path("nowhere.sqlite"),)}, "nowhere.sqlite: no such annotation file"),
        ({"joins": (Path("a.sqlite"),), "names": ("ben",)}, "--as ben: must be THERE=HERE"),
        ({"joins": (Path("a.sqlite"),), "names": ("user=ben", "user=eva")}, "--as user=eva: must be THERE=HERE"),
        ({"joins": (Path("a.sqlite"),), "study": StudyOptions(rater="ben")}, "--join takes all raters of a file"),
        ({"joins": (Path("a.sqlite"),), "report": True}, "give one of them"),
        ({"names": ("user=ben",)}, "give --join FILE, too"),
        ({"rows": "1,2"}, "nothing of a session|not a session|no session"),
        ({"rows": "1,2", "frames": 4}, "--rows is for one session"),
        ({"rows": "1,2", "study": StudyOptions("first")}, "leave out --study"),
        ({"rows": "1,2", "report": True}, "--rows is for the window"),
        ({"study": StudyOptions("first", rater="b\udcff")}, r"--rater 'b\\udcff': is no UTF-8; give the name in plain letters"),
    ],
)
def test_wrong_calls_end_in_one_line(folder: Path, options: dict[str, object], message: str) -> None:
    with pytest.raises(UserError, match=message) as raised:
        run(folder, **options)
    assert "\n" not in str(raised.value)
    assert not (folder / DEFAULT_NAME).exists(), "what was refused leaves nothing behind"


def test_the_command_ends_with_one_line_and_code_2(tmp_path: Path) -> None:
    done = main("annotate", tmp_path / "nowhere")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"error: {tmp_path / 'nowhere'}: no such file or folder\n"


def test_the_states_given_count_and_not_those_of_the_lines(folder: Path, tmp_path: Path) -> None:
    annotate(folder, raters=("ann",))
    with AnnotationStore(folder / DEFAULT_NAME) as store:
        (one, *_) = store.annotations()
        history = store.history(one.key)
        content = replace(one.content, state=PoseState.A)
        entry = history.edit("state A", content)
        assert entry is not None
        store.save(one.key, one.view, entry, content, measure_lines(content, (640, 480), Config().perception), 9.0)
    run(folder, export="csv", out=tmp_path / "table.csv")
    assert read_measurements(tmp_path / "table.csv")[0].state == "A"


@pytest.mark.slow
@pytest.mark.usefixtures("all_orientations")
def test_worst_first_looks_at_disagreement_too(folder: Path) -> None:
    """An image whose manual angle is 60 degrees off the algorithm's comes before those that nobody has measured."""
    first, *_, last = [name for name, _, _ in queue(folder, order="worst")]
    assert first != last
    with AnnotationStore(folder / DEFAULT_NAME) as store:
        images, _ = find_images([folder / last], store)
        content = Annotation(((300.0, 100.0), (300.0, 200.0)), ((280.0, 190.0), (340.0, 215.0)), PoseState.D)
        measured = measure_lines(content, images[0].record.size, Config().perception)
        assert measured.pose.theta_deg > 60
        save(store, images[0], content, ItemKey(images[0].sha256, "", "ann"))
    assert [name for name, _, _ in queue(folder, order="worst")].index(last) < 2
