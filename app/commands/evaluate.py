"""``evaluate``: algorithm against manual measures, as the paper did it: figures, table, report."""

from __future__ import annotations

import json
import os
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from app.annotator.comparison import print_agreement
from app.commands.evaluation_report import print_tables, render_report
from app.commands.options import ConfigOption, JsonOption, ModelOption, PresetOption, ProgressOption
from app.commands.progress import LeftOut, check_no_input, progress_bar, progress_writer, report_progress
from core.annotation.agreement_report import write_measures
from core.annotation.model import AngleProvenance
from core.annotation.store import FoundImage, StoredAnnotation
from core.config.models import Config, choose_model, load_config
from core.devices import UserError, disk_errors
from core.evaluation import evaluation
from core.evaluation.evaluation import EvaluationError, Measurement, angle_pairs, read_measurements, write_measurements
from core.evaluation.paper import PAPER, against_paper, choose_images, measure_twice, wanted_images
from core.files import name_as_text, name_of, write_atomic
from core.program import COMMAND, missing, program_id
from core.types import Frame

_FIGURES = ("error_distribution", "bland_altman", "scatter", "confusion")
_ENDINGS = (".svg", ".pdf")


@dataclass(slots=True)
class _Study:
    """Rows to be evaluated, where they come from, and notes for the reader."""

    rows: list[Measurement]
    source: dict[str, Any]
    notes: list[str]
    agreement: dict[str, Any] | None = None
    interrupted: bool = False


def evaluate(
    out: Annotated[Path, typer.Option(help="folder for metrics.json, measurements.csv, figures and report.html")],
    labelled: Annotated[
        Path | None, typer.Argument(metavar="DIR", help="labelled set as synth writes it, or images annotated by hand")
    ] = None,
    csv: Annotated[
        Path | None,
        typer.Option(help="columns image, angle_1, angle_2, state, algorithm_angle, algorithm_state; blank where not measured"),
    ] = None,
    as_json: JsonOption = False,
    like_paper: Annotated[
        bool, typer.Option("--like-paper", help="draw a test like the paper's: 48 images, measured twice with an error")
    ] = False,
    manual_sd: Annotated[
        float | None, typer.Option(min=0, max=30, help="SD of one such manual measure, degrees; default: 1.5")
    ] = None,
    study: Annotated[
        str | None, typer.Option(help='this study of images annotated by hand, its raters and repeats too; "": outside studies')
    ] = None,
    explain: Annotated[
        bool,
        typer.Option(
            "--explain", help="replay a session's rehearsed runs in the identified twin and name the parameter that explains them"
        ),
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="of the drawn images, their manual errors and the bootstrap")] = 0,
    model: ModelOption = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
    progress_json: ProgressOption = False,
) -> None:
    """The algorithm against manual measures, with the statistics of the paper beside its own figures."""
    if manual_sd is not None and not like_paper:
        raise UserError("--manual-sd is for --like-paper")
    if as_json and progress_json:
        raise UserError("--json and --progress-json both write to standard output: give one of them")
    if progress_json:
        report_progress()
    if (labelled is None) == (csv is None):
        raise EvaluationError("give either a labelled set (evaluate DIR) or a table (evaluate --csv FILE)")
    if explain and (labelled is None or _annotation_file(labelled, study) is None):
        raise EvaluationError("--explain needs the annotated pictures of a session (evaluate DIR)")
    if study is not None and (csv is not None or like_paper):
        raise EvaluationError("--study needs images annotated by hand (evaluate DIR), not --csv or --like-paper")
    if csv is not None:
        if like_paper or model is not None or preset is not None or config is not None:
            raise EvaluationError("--like-paper, --model, --preset and --config need a labelled set (evaluate DIR), not --csv")
        for name in _written_names():
            check_no_input(out / name, [csv], "--out")
        found = _Study(read_measurements(csv), {"kind": "table of measures", "name": name_as_text(csv.name)}, [])
        _make_out(out)
    elif labelled is not None and (annotations := _annotation_file(labelled, study)) is not None:
        if like_paper:
            raise EvaluationError("--like-paper needs a labelled set with its truth, not annotations by hand")
        _make_out(out)
        settings = load_config(config, preset, choose_model(model))
        recorded = _recorded(annotations.parent, settings, model) if config is None and preset is None else None
        found = _perceive_annotated(annotations, *(recorded or (settings, [])), study, seed)
        found.source["preset"] = preset
        if explain:
            _explain(annotations.parent, found)
    elif labelled is not None:
        if study is not None:
            begin = f"{COMMAND} annotate {labelled} --study {study}"
            raise EvaluationError(f"{labelled}: has no annotation file; begin the study with: {begin}")
        truth = _read_set(labelled)
        _make_out(out)
        manual_sd_deg = (1.5 if manual_sd is None else manual_sd) if like_paper else None
        found = _perceive_set(labelled, truth, load_config(config, preset, choose_model(model)), manual_sd_deg, seed)
        found.source["preset"] = preset
    metrics = _metrics(found, seed, csv)
    if like_paper:
        metrics["against_paper"] = against_paper(metrics)
    _report(out, found, metrics, as_json)
    if found.interrupted:
        raise KeyboardInterrupt


def _metrics(found: _Study, seed: int, csv: Path | None) -> dict[str, Any]:
    """What metrics.json holds of a study; `csv` is the table that it was read from."""
    metrics: dict[str, Any] = {"source": found.source, "seed": seed, "program": program_id()}
    metrics |= evaluation.evaluate(found.rows, seed)
    if csv is not None and not metrics["angle"]["n"] and not metrics["state"]["n"]:
        raise EvaluationError(f"{csv}: no row has both a manual and an algorithmic measure; nothing to compare")
    metrics["notes"] = found.notes + metrics["notes"]
    if why := missing("matplotlib"):
        metrics["notes"].append(f"No figures: {why}")
    metrics["paper"] = PAPER
    if found.agreement is not None:
        _insert_repeatability(metrics, found.agreement["within"])
        metrics["agreement"] = {key: value for key, value in found.agreement.items() if key != "measures"}
    return metrics


def _report(out: Path, found: _Study, metrics: dict[str, Any], as_json: bool) -> None:
    """Write the files and print the results; raises EvaluationError."""
    try:
        _write(out, found.rows, metrics)
        if found.agreement is not None:
            write_measures(out / "raters.csv", found.agreement["measures"])
    except OSError as error:
        raise EvaluationError(f"{error.filename or out}: cannot be written ({error.strerror or error})") from None
    if (writer := progress_writer()) is not None:
        writer.write({"report": str(out / "report.html")} | metrics["images"])
    elif as_json:
        sys.stdout.write(json.dumps(metrics, allow_nan=False) + "\n")
    else:
        print_tables(metrics)
        if found.agreement is not None:
            print_agreement(found.agreement, within=False)  # stands among the angles
        sys.stderr.write(f"{'report is' if missing('matplotlib') else 'report and figures are'} in {out}\n")


def _insert_repeatability(metrics: dict[str, Any], within: dict[str, Any]) -> None:
    """Take the SD of one manual measure from the raters' own repeats, where there are any: the columns are means over raters."""
    manual = metrics["manual"]
    if within["n"] > 1:
        manual["repeatability_sd_deg"], manual["ci95"]["repeatability_sd_deg"] = within["sd_deg"], within["ci95"]
    elif within["n"] == 0 and manual["repeatability_sd_deg"] is not None:
        metrics["notes"].append(
            "No rater measured an image twice: the SD of one manual measure is that of several, and holds their differences."
        )


def _make_out(out: Path) -> None:
    """Make the folder before the work; raises EvaluationError."""
    with disk_errors(EvaluationError, out, "cannot be made", "; choose another --out"):
        out.mkdir(parents=True, exist_ok=True)
    if not os.access(out, os.W_OK | os.X_OK):
        raise EvaluationError(f"{out}: cannot be written to; choose another --out")


def _written_names() -> list[str]:
    """All files that are written to ``--out``, or removed there because an earlier evaluation wrote them."""
    drawn = [f"{name}{ending}" for name in _FIGURES for ending in _ENDINGS]
    return ["metrics.json", "measurements.csv", "raters.csv", "report.html", *drawn]


def _write(out: Path, rows: list[Measurement], metrics: dict[str, Any]) -> None:
    figures: dict[str, dict[str, bytes]] = {}
    if not missing("matplotlib"):
        from app.commands.figures import draw_figures, drawn

        for name, figure in draw_figures(angle_pairs(rows), metrics).items():
            figures[name] = {ending: drawn(figure, ending) for ending in _ENDINGS}
    text = json.dumps(metrics, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    write_atomic(out / "metrics.json", text.encode())
    write_measurements(out / "measurements.csv", rows)
    (out / "raters.csv").unlink(missing_ok=True)  # of an earlier evaluation, as figures below
    for name in _FIGURES:
        for ending in _ENDINGS:
            path = out / f"{name}{ending}"
            if name in figures:
                write_atomic(path, figures[name][ending])
            else:
                path.unlink(missing_ok=True)
    report = render_report(metrics, {name: files[".svg"] for name, files in figures.items()})
    write_atomic(out / "report.html", report.encode())


def _annotation_file(given: Path, study: str | None) -> Path | None:
    """The annotation file that is given, or that of a folder without a truth of its own, or whose `study` is asked for."""
    from core.annotation.store import DEFAULT_NAME

    if given.suffix == ".sqlite" and given.is_file():
        return given
    own = given / DEFAULT_NAME
    return own if own.is_file() and (study is not None or not (given / "truth.jsonl").is_file()) else None


def _perceive_annotated(annotations: Path, config: Config, notes: list[str], study: str | None, seed: int) -> _Study:
    """Images that were annotated by hand, against the algorithm."""
    from app.annotator.comparison import comparable_answers, compare_with_algorithm, rater_agreement
    from app.annotator.sources import read_annotated

    answers, images = read_annotated(annotations, _places_of(annotations))
    notes = notes + _answer_notes(annotations, answers, images, study)
    done, more = comparable_answers(answers, images, config, study, str(annotations))
    rows, reasons, engine, missed = compare_with_algorithm(done, images, config)
    source: dict[str, Any] = {"kind": "annotated by hand", "name": name_as_text(name_of(annotations.parent))}
    source |= {"model": config.perception.segmentation.model, "preset": None, "engine": engine, "refused": reasons, "study": study}
    source |= _session_of(annotations.parent)
    notes += more
    notes += [f"Interrupted after {len(rows)} of {len(rows) + missed} images."] if missed else []
    return _Study(rows, source, notes, rater_agreement(done, images, seed), interrupted=missed > 0)


def _session_of(folder: Path) -> dict[str, Any]:
    """What the session in a folder is about, its runs beside their rehearsals, and which program recorded it; {} for no session."""
    from core.session.manifest import MANIFEST, SessionError, read_manifest
    from core.session.reader import SessionReader
    from core.session.rehearsed_run import runs_beside

    if not (folder / MANIFEST).is_file():
        return {}
    try:
        manifest = read_manifest(folder)
        with SessionReader(folder) as reader:
            reader.wait()
            about = reader.description.model_dump(mode="json") | {"rehearsals": runs_beside(reader)}
        return {"session": {"recorded_by": manifest.program} | about}
    except SessionError:  # damaged: the annotations are evaluated without it
        return {}


def _explain(folder: Path, found: _Study) -> None:
    """Add to the runs in the source which parameter of the robot explains them; a note says why not."""
    from app.commands.session import explain_runs
    from core.session.reader import SessionReader

    try:
        with SessionReader(folder) as reader:
            reader.wait()
            explain_runs(reader, found.source.get("session", {}).get("rehearsals", []))
    except UserError as error:  # what was perceived is not lost
        found.notes.append(f"Not explained: {error}")


def _places_of(annotations: Path) -> list[Path]:
    """Where the annotated images may be: in the file's folder, and those of other folders where they were seen last."""
    from core.annotation.store import AnnotationStore

    folder = annotations.parent.resolve()
    with AnnotationStore(annotations, read_only=True) as store:
        seen = [Path(os.path.normpath(folder / image.name)) for image in store.images().values()]
    elsewhere = [path for path in seen if path.parent != folder and path.is_file()]
    own = [] if elsewhere and len(elsewhere) == len(seen) else [annotations.parent]
    return [*own, *sorted(elsewhere)]


def _answer_notes(
    annotations: Path, answers: Sequence[StoredAnnotation], images: Sequence[FoundImage], study: str | None
) -> list[str]:
    """Notes on manual answers that are not among the figures, or that know the algorithm's own."""
    from core.annotation.agreement_report import choose_study, undecided
    from core.annotation.store import AnnotationStore
    from core.annotation.study import angle_words, settings_from

    done, here = choose_study(answers, study, str(annotations)), {image.sha256 for image in images}
    gone = len({one.key.sha256 for one in done} - here)
    with AnnotationStore(annotations, read_only=True) as store:
        after_look = store.given_after_look()
        chosen = done[0].key.study
        kept = store.study_settings(chosen) if chosen else None
    notes = [f"Of the annotated images {gone} are not where they were; they are in none of the figures."] if gone else []
    if kept is not None:
        notes.append(angle_words(settings_from(kept, f"study {chosen!r}").hides_angle))
    if tied := undecided(one for one in done if one.key.sha256 in here):
        notes.append(
            f"On {tied} images no state was given most often (two raters who disagree, for example); there the state of the rater "
            "whose name comes first counts."
        )
    manual = [one for one in done if one.provenance is AngleProvenance.MANUAL]
    looked = sum(one.key.sha256 in here and one.key in after_look for one in manual)
    if looked:
        notes.append(
            f"Of the manual answers {looked} were given, or changed, after the algorithm's lines had been shown (key H), and may "
            "agree with it better than independent ones. A blind study (annotate --study NAME) hides them."
        )
    return notes


def _recorded(folder: Path, config: Config, model: str | None) -> tuple[Config, list[str]] | None:
    """The configuration that a session was recorded with, with another `model` if given, and notes on it; None: no session."""
    from app.commands.replay import ReplayOptions, model_note, model_of, replay_config
    from core.session.manifest import MANIFEST, SessionError, read_manifest

    if not (folder / MANIFEST).is_file():
        return None
    try:
        manifest = read_manifest(folder)
    except SessionError:  # damaged: evaluated with the present settings
        return None
    as_recorded, notes = replay_config(manifest, ReplayOptions(folder, model))
    if not notes:
        notes = ["Each picture of the session was perceived by itself, with the settings that it was recorded with."]
    notes += model_note(manifest, as_recorded, model_of(as_recorded)) if model is None else []
    return config.model_copy(update={"perception": as_recorded.perception}), notes


@dataclass(frozen=True, slots=True)
class _Truth:
    """A labelled image; theta and state: None where it shows no pose."""

    stem: str
    image: Path
    theta_deg: float | None
    state: str | None
    group: str | None


def _read_set(folder: Path) -> list[_Truth]:
    """The images of a labelled set with their truth, by name; raises EvaluationError, DatasetError."""
    from core.learning.dataset import UNMEASURED, find_labelled

    if not (folder / "truth.jsonl").is_file() or not (folder / "images").is_dir():
        what = (
            "needs images/ and truth.jsonl as synth writes them, or the annotation file of annotate"
            if folder.is_dir()
            else "no such folder"
        )
        raise EvaluationError(f"{folder}: not a labelled set ({what}); for a table use --csv FILE")
    samples, truth = find_labelled(folder)
    found = []
    for sample in samples:
        row = truth[sample.stem]
        if row.get("reason") == UNMEASURED:  # drawn to train on; it may have a pose
            continue
        theta, state = row.get("theta_deg"), row.get("state")
        angle, state = (float(theta), str(state)) if theta is not None and state is not None else (None, None)
        group = f"phantom {row['seed']}" if row.get("seed") is not None else None
        found.append(_Truth(sample.stem, sample.image, angle, state, group))
    if not found:
        raise EvaluationError(f"{folder}: no frame of it was measured, only drawn: draw both lines and set the state (annotate)")
    return found


def _perceive_set(folder: Path, truth: list[_Truth], config: Config, manual_sd_deg: float | None, seed: int) -> _Study:
    """Perceive each image by itself; the truth stands for the manual measure.

    With `manual_sd_deg` it is a study like the paper's: its share of states, and two manual measures with an error of this SD.
    After an interruption (Ctrl-C) the images until then are evaluated.
    """
    from core.files import ImageError, read_image
    from core.perception.pipeline import open_pipeline

    notes: list[str] = []
    source: dict[str, Any] = {"kind": "labelled set", "name": name_as_text(name_of(folder))}
    measured: dict[str, tuple[float, float | None]] = {t.stem: (t.theta_deg, None) for t in truth if t.theta_deg is not None}
    if manual_sd_deg is not None:
        states = {t.stem: t.state for t in truth if t.state is not None}
        chosen = choose_images(states, seed)
        if not chosen:
            raise EvaluationError(f"{folder}: has no image of the states B, C and D, which the paper's test consists of")
        truth = [t for t in truth if t.stem in set(chosen)]
        angles = [t.theta_deg for t in truth if t.theta_deg is not None]
        measured = dict(zip([t.stem for t in truth], measure_twice(angles, manual_sd_deg, seed), strict=True))
        wanted, having = wanted_images(), Counter(t.state for t in truth)
        source |= {"kind": "study like the paper's", "wanted": wanted, "manual_sd_deg": manual_sd_deg}
        notes += [f"The set has {having[s]} of the {n} wanted images of state {s}." for s, n in wanted.items() if having[s] < n]
        notes.append(
            f"Built like the paper's test: {len(truth)} images drawn with seed {seed}; each manual angle is the true one with a "
            f"normal error of {manual_sd_deg:g}° (SD), the manual state is the true one."
        )
    pipeline = open_pipeline(config.perception)
    rows: list[Measurement] = []
    reasons: Counter[str] = Counter()
    left_out, interrupted = LeftOut(), False
    with progress_bar() as bar:
        try:
            for one in bar.track(truth, description="images"):
                try:
                    image = read_image(one.image)
                except ImageError as error:
                    left_out.add(error)
                    continue
                scene = pipeline.perceive_single(Frame(len(rows), 0.0, image))
                angle, state = (scene.pose.theta_deg, scene.pose.state.value) if scene.pose is not None else (None, None)
                first, second = measured.get(one.stem, (None, None))
                rows.append(Measurement(name_as_text(one.stem), first, second, one.state, angle, state, one.group))
                if scene.refusal is not None and one.state is not None:
                    reasons[scene.refusal.reason.value] += 1
        except KeyboardInterrupt:
            if not rows:
                raise
            interrupted = True
            notes.append(f"Interrupted after {len(rows)} of {len(truth)} images.")
    left_out.print_note(len(rows))
    model = config.perception.segmentation.model
    source |= {"model": model, "preset": None, "engine": pipeline.engine, "refused": dict(sorted(reasons.items()))}
    if left_out:
        notes.append(f"{len(left_out)} images could not be read and are left out.")
    poseless = [row for row in rows if row.state is None]
    if poseless:
        answered = sum(row.algorithm_state is not None for row in poseless)
        notes.append(f"{len(poseless)} images show no pose to measure (the algorithm answered {answered} of them).")
    return _Study(rows, source, notes, interrupted=interrupted)
