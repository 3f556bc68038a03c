"""``evaluate`` as a user calls it: the paper's table from the paper's labels, files, report, labelled sets, and bad input."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from math import atan, degrees
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import cv2
import numpy as np
import pytest

from app.commands import evaluate as command
from app.commands.evaluation_report import render_report
from core.config.models import TwinConfig
from core.devices import UserError
from core.evaluation.evaluation import EvaluationError, Measurement, read_measurements, write_measurements
from core.evaluation.paper import PAPER_CONFUSION
from core.learning.dataset import write_png
from core.session.manifest import event_of_target
from hardware.twin.identification import Explanation
from hardware.twin.world import TwinWorld
from tests.app.annotated import measure, tube
from tests.app.program import run
from tests.core.evaluation.test_metrics import label_pairs
from tests.core.session.test_rehearsed_run import FOUND
from tests.core.session_data import record, tick_of

pytestmark = pytest.mark.usefixtures("looked_at_once")

FIGURES = {"error_distribution", "bland_altman", "scatter", "confusion"}


def evaluate(folder: Path | None = None, csv: Path | None = None, *, out: Path, **more: object) -> dict:
    command.evaluate(out, folder, csv, **more)
    return json.loads((out / "metrics.json").read_text(encoding="utf-8"))


@pytest.fixture
def drawing() -> None:
    """Asked for by tests that are about figures."""


@pytest.fixture(autouse=True)
def undrawn(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """All others leave out what takes most of an evaluation's time."""
    if "drawing" not in request.fixturenames:
        monkeypatch.setattr("app.commands.figures.drawn", lambda _figure, _ending: b"<svg></svg>")


@pytest.fixture(scope="module")
def paper_csv(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The 44 label pairs of METHOD section 7, with made-up angles."""
    rng = np.random.default_rng(0)
    rows = []
    for place, (manual, algorithm) in enumerate(zip(*label_pairs(PAPER_CONFUSION), strict=True)):
        theta = rng.uniform(0, 60)
        angles = [round(theta + error, 1) for error in rng.normal(0, 1.5, 3)]
        rows.append(Measurement(f"{place}.png", angles[0], angles[1], manual, angles[2], algorithm))
    path = tmp_path_factory.mktemp("table") / "paper.csv"
    write_measurements(path, rows)
    return path


@pytest.fixture(scope="module")
def drawn(paper_csv: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What an evaluation of these writes, with its figures."""
    out = tmp_path_factory.mktemp("drawn")
    command.evaluate(out, None, paper_csv)
    return out


def tubes(folder: Path, count: int) -> list[Path]:
    """Pictures of a tube, to be measured by hand."""
    images = [folder / f"frame_{index}.png" for index in range(count)]
    for index, image in enumerate(images):
        write_png(image, tube(index)[0])
    return images


def test_the_papers_labels_print_the_papers_table(paper_csv: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    evaluate(csv=paper_csv, out=tmp_path)
    printed = [re.split(r" {2,}", line.strip()) for line in capsys.readouterr().out.splitlines()]
    rows = {cells[0]: cells[1:] for cells in printed if len(cells) > 1}
    assert [rows["Accuracy"][0], rows["Accuracy"][-1]] == ["88.6 %", "88.6 %"]
    assert [rows["Cohen’s kappa"][0], rows["Cohen’s kappa"][-1]] == ["0.796", "0.796"]
    assert [rows["Fowlkes–Mallows, pair counting"][0], rows["Fowlkes–Mallows, pair counting"][-1]] == ["0.801", "0.801"]
    assert rows["Fowlkes–Mallows, mean over states"][0] == "0.864"
    table = [cells for cells in printed if cells[0] in {"B", "C", "D"} and len(cells) > 5]
    assert [cells[1:5] for cells in table] == [
        ["13", "0.86", "0.92", "0.89"],
        ["26", "0.92", "0.88", "0.90"],
        ["5", "0.80", "0.80", "0.80"],
    ]
    assert [cells[-3:] for cells in table] == [cells[2:5] for cells in table], "the paper's beside ours"
    assert rows["Macro average"][1:4] == ["0.86", "0.87", "0.86"]
    assert rows["Weighted average"][1:4] == ["0.89", "0.89", "0.89"]
    assert ["B", "12", "1", "0"] in printed
    assert ["C", "2", "23", "1"] in printed
    assert ["D", "0", "1", "4"] in printed


@pytest.mark.usefixtures("drawing")
def test_json_is_all_there_is_on_standard_output_and_the_same_input_gives_the_same_files(
    paper_csv: Path, drawn: Path, tmp_path: Path
) -> None:
    out = tmp_path / "deep" / "out"
    done = run("evaluate", "--csv", paper_csv, "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert json.loads(done.stdout) == json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    assert json.loads(done.stdout)["state"]["confusion"] == [list(row) for row in PAPER_CONFUSION]
    wanted = {"metrics.json", "measurements.csv", "report.html"} | {f"{name}{end}" for name in FIGURES for end in (".svg", ".pdf")}
    assert {path.name for path in out.iterdir()} == wanted
    assert (out / "scatter.pdf").read_bytes().startswith(b"%PDF")
    for path in out.iterdir():
        assert path.read_bytes() == (drawn / path.name).read_bytes(), path.name


def test_without_matplotlib_the_report_says_how_to_get_its_figures(
    paper_csv: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "missing", lambda package: f"this needs the package {package}")
    metrics = evaluate(csv=paper_csv, out=tmp_path)
    assert capsys.readouterr().err.endswith(f"report is in {tmp_path}\n")
    assert metrics["notes"][-1] == "No figures: this needs the package matplotlib"
    assert {path.name for path in tmp_path.iterdir()} == {"metrics.json", "measurements.csv", "report.html"}
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<svg" not in text
    assert metrics["notes"][-1] in text


def test_the_report_is_one_page_that_needs_nothing_else(drawn: Path) -> None:
    text = (drawn / "report.html").read_text(encoding="utf-8")
    assert re.findall(r'(?:src|href)="(?!#)', text) == []
    assert not re.search(r"https?:|//[a-z]|@import|<script", text)
    assert text.count("<svg") == len(FIGURES)
    ids = re.findall(r'\bid="([^"]*)"', text)
    assert len(ids) == len(set(ids)), "ids of the figures do not collide"
    assert set(re.findall(r'(?:href="#|url\(#)([^")]*)', text)) <= set(ids)
    for words in ("0.796", "0.801", "0.86", "Evaluation of paper.csv", "n = 44", "95 % interval"):
        assert words in text


def test_the_report_has_a_session_s_runs_beside_their_rehearsals(
    paper_csv: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    xs = (10.0, 20.0, 30.0, 40.0, 48.0)
    sides = {name: tuple((x, y) for x in xs) for name, y in (("xy", 32.0), ("low_xy", 36.0), ("high_xy", 28.0))}
    found = FOUND.model_copy(update={"target_xy": (49.0, 32.0), "way": FOUND.way.model_copy(update=sides)})
    chosen = event_of_target((49.0, 32.0), 9.0, found.model_dump(mode="json"))
    session = record(tmp_path / "sessions", [tick_of(place, 10.0 + 0.1 * place, full=True) for place in range(3)], events=[chosen])
    about = command._session_of(session)
    assert [run["runs"] for run in about["session"]["rehearsals"]] == [50]
    metrics = evaluate(csv=paper_csv, out=tmp_path / "out")
    page = render_report(metrics | {"source": metrics["source"] | about}, {})
    assert "A run beside its rehearsal: to (49, 32) arrived; 0.0 s (rehearsed 0.0, -1.0 to 1.0); 100% in the band" in page
    monkeypatch.setattr("app.commands.session.has_rig", lambda _name: True)
    monkeypatch.setattr("app.commands.session.find_rig", lambda name: (Path(name), SimpleNamespace(behaviour=MagicMock())))
    for name in ("bench_of_session", "motion_of_session"):
        monkeypatch.setattr(f"hardware.twin.identification.{name}", lambda *_: MagicMock())
    monkeypatch.setattr("hardware.twin.identification.explained", lambda *_: Explanation(1.5, 0.2, {"play_mm": 0.3}))
    command._explain(session, command._Study([], about, []))
    page = render_report(metrics | {"source": metrics["source"] | about}, {})
    assert "its replay in the identified twin is 1.5 mm off: play_mm = 0.3 would explain it (0.2 mm left)" in page
    with pytest.raises(EvaluationError, match="--explain needs the annotated pictures of a session"):
        evaluate(csv=paper_csv, out=tmp_path / "out", explain=True)
    command._explain(session, without := command._Study([], {}, []))
    assert without.notes[0].startswith("Not explained: no run of this session was rehearsed")


def test_names_in_a_table_cannot_change_the_report(tmp_path: Path) -> None:
    path = tmp_path / "<script>x.csv"
    write_measurements(path, [Measurement("<script>", 1.0, None, "B", 2.0, "B")])
    evaluate(csv=path, out=tmp_path / "out")
    assert "<script" not in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_errors_are_one_line_and_exit_code_2(tmp_path: Path) -> None:
    bad = tmp_path / "bad.csv"
    bad.write_text("image,angle_1\na,1\n")
    done = run("evaluate", "--csv", bad, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1
    assert "'angle_2' is missing" in done.stderr
    assert not (tmp_path / "out").exists()


def test_what_cannot_be_evaluated_says_so(paper_csv: Path, tmp_path: Path) -> None:
    blank = tmp_path / "blank.csv"
    write_measurements(blank, [Measurement("a", 1.0, 1.0, "B", None, None)])
    (tmp_path / "taken").write_text("a file")
    (tmp_path / "folder").mkdir()
    out = tmp_path / "out"
    cases = [
        ({"csv": blank, "out": out}, "nothing to compare"),
        ({"csv": paper_csv, "out": tmp_path / "taken"}, "cannot be made"),
        ({"csv": paper_csv, "out": tmp_path / "taken" / "in"}, "cannot be made"),
        ({"out": out}, "give either"),
        ({"folder": tmp_path, "csv": paper_csv, "out": out}, "give either"),
        ({"csv": paper_csv, "out": out, "like_paper": True}, "need a labelled set"),
        ({"csv": paper_csv, "out": out, "model": "default"}, "need a labelled set"),
        ({"folder": tmp_path / "folder", "out": out}, "not a labelled set"),
        ({"folder": tmp_path / "nowhere", "out": out}, "no such folder"),
        ({"folder": paper_csv, "out": out}, "not a labelled set"),
    ]
    for arguments, words in cases:
        with pytest.raises(UserError, match=words) as caught:
            evaluate(**arguments)
        assert "\n" not in str(caught.value)


# labelled sets


@pytest.fixture(scope="module")
def labelled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Four frames of the twin and a black one without a pose, as synth lays them out."""
    folder = tmp_path_factory.mktemp("data") / "set"
    for part in ("images", "masks"):
        (folder / part).mkdir(parents=True)
    world = TwinWorld(TwinConfig(phantom="tree"))
    rows = []
    for place in range(4):
        world.insert(50.0 + 8.0 * place)
        truth = world.truth()
        image = world.frame().image
        state = "BCDC"[place]  # a label by hand; what the algorithm makes of it is not the matter here
        rows.append({"stem": f"{place:06d}", "theta_deg": truth.pose.theta_deg, "state": state})
        _write_frame(folder, rows[-1]["stem"], image)
    rows.append({"stem": "000004", "theta_deg": None, "state": None})
    _write_frame(folder, "000004", np.zeros_like(image))
    (folder / "truth.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    yield folder


def _write_frame(folder: Path, stem: str, image: np.ndarray) -> None:
    cv2.imwrite(str(folder / "images" / f"{stem}.png"), image[:, :, ::-1])
    for task in ("vessel", "robot"):
        cv2.imwrite(str(folder / "masks" / f"{stem}_{task}.png"), np.zeros(image.shape[:2], np.uint8))


@pytest.mark.usefixtures("all_orientations")
def test_a_labelled_set_is_perceived_and_its_truth_is_the_manual_measure(labelled: Path, tmp_path: Path) -> None:
    found = evaluate(labelled, out=tmp_path / "out")
    truth = [json.loads(line) for line in (labelled / "truth.jsonl").read_text().splitlines()]
    rows = read_measurements(tmp_path / "out" / "measurements.csv")
    assert [(row.image, row.angle_1, row.state) for row in rows] == [(t["stem"], t["theta_deg"], t["state"]) for t in truth]
    assert all(row.angle_2 is None for row in rows)
    assert rows[4].algorithm_state is None
    assert found["images"]["measured"] == 4
    assert found["angle"]["n"] == found["images"]["answered"] >= 1
    assert sum(found["source"]["refused"].values()) == found["images"]["unanswered"]
    assert any("1 images show no pose" in note for note in found["notes"])
    again = evaluate(csv=tmp_path / "out" / "measurements.csv", out=tmp_path / "again")
    assert (again["angle"], again["state"]) == (found["angle"], found["state"]), "the table can be evaluated by itself"


def test_a_study_like_the_papers(labelled: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = evaluate(labelled, out=tmp_path / "out", like_paper=True, manual_sd=2.0, seed=7)
    rows = read_measurements(tmp_path / "out" / "measurements.csv")
    assert [row.state for row in rows] == ["B", "C", "D", "C"]
    assert all(row.angle_1 != row.angle_2 for row in rows)
    assert found["manual"]["n"] == 4
    assert found["source"]["wanted"] == {"B": 14, "C": 28, "D": 6}
    assert found["source"]["manual_sd_deg"] == 2.0
    assert "The set has 2 of the 28 wanted images of state C." in found["notes"]
    assert set(found["against_paper"].values()) <= {"better", "equal", "worse", None}
    assert "of the paper’s 27 figures are bettered" in capsys.readouterr().out
    assert "Against it" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_a_damaged_picture_does_not_cost_the_others(labelled: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    damaged = Path(shutil.copytree(labelled, tmp_path / "set"))
    cut = damaged / "images" / "000003.png"
    cut.write_bytes(cut.read_bytes()[:500])
    found = evaluate(damaged, out=tmp_path / "out")
    images = [row.image for row in read_measurements(tmp_path / "out" / "measurements.csv")]
    assert images == ["000000", "000001", "000002", "000004"]
    assert "1 images could not be read and are left out." in found["notes"]
    assert f"note: 1 of 5 frames could not be read and are left out; the first: {cut}" in capsys.readouterr().err
    for path in (damaged / "images").glob("*.png"):
        path.write_bytes(b"")
    with pytest.raises(UserError, match=r"none of 5 frames could be read; the first: .*000000\.png: empty file"):
        evaluate(damaged, out=tmp_path / "out")


def interrupt_at_the_third_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    from core import files

    read, calls = files.read_image, []

    def third_is_interrupted(path: Path) -> np.ndarray:
        calls.append(path)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return read(path)

    monkeypatch.setattr(files, "read_image", third_is_interrupted)


def test_an_interrupted_evaluation_keeps_what_was_perceived(
    labelled: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupt_at_the_third_picture(monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        evaluate(labelled, out=tmp_path / "out")
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text(encoding="utf-8"))
    assert "Interrupted after 2 of 5 images." in metrics["notes"]
    assert [row.image for row in read_measurements(tmp_path / "out" / "measurements.csv")] == ["000000", "000001"]
    assert (tmp_path / "out" / "report.html").is_file()


def test_a_set_with_a_hole_is_one_clear_line(labelled: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    (broken / "images").mkdir(parents=True)
    (broken / "masks").mkdir()
    _write_frame(broken, "a", np.zeros((120, 160, 3), np.uint8))
    for text, words in (
        ('{"stem": "b"}\n', "1 of 1 frames lack a truth"),
        ('{"stem": "a", "theta_deg": "x", "state": "B"}\n', "line 1: theta_deg: "),
        ('{"stem": "a", "theta_deg": 3, "state": "E"}\n', "line 1: state: "),
    ):
        (broken / "truth.jsonl").write_text(text)
        with pytest.raises(UserError, match=words):
            evaluate(broken, out=tmp_path / "out")
    (broken / "truth.jsonl").write_text('{"stem": "a", "theta_deg": 3, "state": "A"}\n')
    with pytest.raises(UserError, match="no image of the states B, C and D"):
        evaluate(broken, out=tmp_path / "out", like_paper=True)


def test_a_study_is_evaluated_with_its_raters_and_repeats(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two raters measure two images twice: bo always two degrees more than al, and the second measure is as the first."""
    images = tubes(tmp_path, 2)
    store = tmp_path / "annotations.lumenpilot.sqlite"
    for repeat in (1, 2):
        measure(store, images, [0.0, 10.0], study="main", rater="al", repeat=repeat)
        measure(store, images, [2.0, 12.0], study="main", rater="bo", repeat=repeat)
    measure(store, images, [5.0, 5.0], study="pilot", rater="al")
    out = tmp_path / "out"
    with pytest.raises(UserError, match=r"holds several studies.*choose one with --study NAME"):
        evaluate(tmp_path, out=out)
    metrics = evaluate(tmp_path, out=out, study="main")
    agreement = metrics["agreement"]
    assert agreement["within"]["n"] == 2
    assert metrics["manual"]["repeatability_sd_deg"] == agreement["within"]["sd_deg"] == pytest.approx(0.0, abs=1e-6)
    assert agreement["annotations"] == 8
    assert sorted(agreement["raters"]) == ["al", "bo"]
    assert agreement["raters"]["al"]["sd_deg"] == pytest.approx(0.0, abs=1e-6)
    wanted = (degrees(atan(2 / 40)) + degrees(atan(12 / 40)) - degrees(atan(10 / 40))) / 2
    assert agreement["pairs"][0]["angle"]["mean_difference_deg"] == pytest.approx(wanted, abs=0.05)
    report = (out / "report.html").read_text()
    for part in ("<h2>Raters</h2>", "First against second", "al, bo", "ICC(2,1)"):
        assert part in report
    printed = capsys.readouterr().out
    assert "Rater against rater" in printed
    assert printed.count("SD of one") == report.count("<td>SD of one") == 1, "one figure, in one place"
    assert len((out / "raters.csv").read_text().splitlines()) == 9


def test_images_of_other_folders_are_found_where_they_were_annotated(tmp_path: Path) -> None:
    """Sessions beside each other, one file: only those in the file's own folder were found, and the others said to be gone."""
    images = [tmp_path / f"session_{index // 2}" / f"frame_{index}.png" for index in range(4)]
    for index, image in enumerate(images):
        image.parent.mkdir(exist_ok=True)
        write_png(image, tube(index)[0])
    store = images[0].parent / "annotations.lumenpilot.sqlite"
    for rater, tilts in (("al", [0.0, 10.0, 5.0, 2.0]), ("bo", [2.0, 12.0, 9.0, 6.0])):
        measure(store, images, tilts, study="main", rater=rater)
    metrics = evaluate(store.parent, out=tmp_path / "out", study="main")
    assert not any("not where they were" in note for note in metrics["notes"])
    assert metrics["agreement"]["annotations"] == 8
    rows = read_measurements(tmp_path / "out" / "measurements.csv")
    assert [(row.image, row.group) for row in rows] == [(image.name, image.parent.name) for image in images]


def test_raters_are_compared_on_the_images_that_are_here_only(tmp_path: Path) -> None:
    """Those that are gone were told to be in none of the figures, and were in the raters' agreement, by their hashes."""
    images = tubes(tmp_path, 3)
    store = tmp_path / "annotations.lumenpilot.sqlite"
    for repeat, tilts in ((1, [0.0, 10.0, 5.0]), (2, [0.0, 10.0, 25.0])):
        measure(store, images, tilts, study="main", rater="al", repeat=repeat)
    images[2].unlink()
    metrics = evaluate(tmp_path, out=tmp_path / "out", study="main")
    assert "Of the annotated images 1 are not where they were; they are in none of the figures." in metrics["notes"]
    within = metrics["agreement"]["within"]
    assert (within["n"], within["sd_deg"]) == (2, pytest.approx(0.0, abs=1e-6))
    lines = (tmp_path / "out" / "raters.csv").read_text().splitlines()[1:]
    assert {line.partition(",")[0] for line in lines} == {"frame_0.png", "frame_1.png"}


def test_what_was_measured_outside_studies_can_be_chosen(tmp_path: Path) -> None:
    images = tubes(tmp_path, 2)
    store = tmp_path / "annotations.lumenpilot.sqlite"
    measure(store, images, [0.0, 10.0])
    measure(store, images, [5.0, 5.0], study="main")
    done = run("evaluate", tmp_path, "--out", tmp_path / "out", "--json", "--study", "")
    assert done.returncode == 0, done.stderr
    rows = read_measurements(tmp_path / "out" / "measurements.csv")
    assert [row.angle_1 for row in rows] == pytest.approx([0.0, degrees(atan(10 / 40))], abs=0.05)


def test_a_study_needs_images_annotated_by_hand(paper_csv: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="--study needs images annotated by hand"):
        evaluate(csv=paper_csv, out=tmp_path / "out", study="main")
    (tmp_path / "empty").mkdir()
    with pytest.raises(UserError, match=r"begin the study with: python main\.py annotate"):
        evaluate(tmp_path / "empty", out=tmp_path / "out", study="main")


def test_a_study_goes_before_the_truth_of_its_set(tmp_path: Path) -> None:
    images = tubes(tmp_path, 3)
    measure(tmp_path / "annotations.lumenpilot.sqlite", images, [0.0, 10.0, 5.0], study="main")
    images[2].unlink()
    (tmp_path / "truth.jsonl").write_text("")
    result = evaluate(tmp_path, out=tmp_path / "out", study="main")
    assert result["source"]["kind"] == "annotated by hand"
    assert result["notes"][0] == "Of the annotated images 1 are not where they were; they are in none of the figures."
    with pytest.raises(UserError, match="not a labelled set"):
        evaluate(tmp_path, out=tmp_path / "out")
