"""``ablation`` as a user calls it, on a set that ``synth`` writes now and on streams of the twin."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from core.devices import UserError
from tests.app.program import run
from tools import ablation as command
from tools.ablation import STEPS, Plan, run_ablation


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from hardware.twin.dataset import SynthPlan, write_set

    out = tmp_path_factory.mktemp("synth") / "set"
    write_set(SynthPlan(out, 6, 77, (640, 480)))
    return out


@pytest.fixture(scope="module")
def done(frames: Path) -> subprocess.CompletedProcess[str]:
    return run("ablation", frames, "--true-masks", "--json", "--out", frames.parent / "out")


class _Full(io.StringIO):
    def write(self, _text: str) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")


def test_results_outlive_a_broken_output(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing was written to --out where nothing could be told."""
    monkeypatch.setattr(command, "measure_streams", lambda *_args, **_more: (None, False))
    monkeypatch.setattr("sys.stdout", _Full())
    with pytest.raises(OSError, match="No space left"):
        run_ablation(Plan(None, out=tmp_path, sequence=1, seed=7, true_masks=True), as_json=True)
    assert json.loads((tmp_path / "ablation.json").read_text())["seed"] == 7


def test_json_is_one_object_with_a_row_for_each_step_on_and_off(done: subprocess.CompletedProcess[str]) -> None:
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["frames"], result["masks"], result["interrupted"]) == (6, "true masks", False)
    names = [row["name"] for row in result["rows"]]
    steps = [step.name for step in STEPS]
    assert names == ["paper, literally", *(f"+ {name}" for name in steps), *(f"ours without {name}" for name in steps)]
    by_name = {row["name"]: row for row in result["rows"]}
    assert by_name["+ end extension"]["compared_with"] == "+ spur pruning"
    assert by_name["ours without end extension"]["compared_with"] == "+ quality gate"  # ours, as far as single images go
    extension = by_name["ours without end extension"]["figures"]["head_median_px"]
    assert extension["difference"] > 1.0, "without it the head lies a radius too far back"
    assert extension["low"] is extension["high"] is None
    assert "too few for intervals" in result["drawn"]
    for name in ("+ tracking", "ours without tracking"):
        assert "needs a stream" in by_name[name]["note"]
        assert "figures" not in by_name[name]


def test_out_holds_the_table_and_every_frame(done: subprocess.CompletedProcess[str], frames: Path) -> None:
    out = frames.parent / "out"
    assert json.loads((out / "ablation.json").read_text()) == json.loads(done.stdout)
    table = [line for line in (out / "ablation.md").read_text().splitlines() if line.startswith("|")]
    assert len(table) == 2 + 1 + 2 * len(STEPS)
    assert len({line.count("|") for line in table}) == 1
    with (out / "ablation_frames.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 6 * (1 + 2 * (len(STEPS) - 1))
    assert {row["stem"] for row in rows} == {f"{index:06d}" for index in range(6)}


def test_a_table_is_shown_with_values_and_differences(frames: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_ablation(Plan(frames, true_masks=True), as_json=False)
    shown = capsys.readouterr().out
    for text in ("paper, literally", "+ gap repair", "ours without line fit", "95 % bootstrap interval", "needs a"):
        assert text in shown


def test_tracking_is_measured_on_a_stream_of_the_twin() -> None:
    shown = run("ablation", "--true-masks", "--json", "--sequence", 8, "--phantom", "s_curve", "--phantom", "tree")
    assert shown.returncode == 0, shown.stderr
    stream = json.loads(shown.stdout)["stream"]
    assert (stream["phantoms"], stream["frames_each"]) == (["s_curve", "tree"], 4)
    assert [row["name"] for row in stream["rows"]] == ["paper, literally", "ours without tracking", "ours"]
    for row in stream["rows"]:
        assert row["figures"]["frames"] == 8
        assert row["figures"]["swapped_frames"] == row["figures"]["jumps"] == 0


def test_a_stream_is_also_perceived_as_the_window_does(capsys: pytest.CaptureFixture[str]) -> None:
    run_ablation(Plan(None, sequence=6, phantoms=("tree",)), as_json=True)
    rows = json.loads(capsys.readouterr().out)["stream"]["rows"]
    assert [row["name"] for row in rows] == ["paper, literally", "ours without tracking", "ours", "ours, as the window has it"]
    assert rows[-1]["figures"]["frames"] == 6
    assert rows[-1]["figures"]["theta_median_deg"] < 5.0


def test_an_interruption_shows_what_was_measured_until_then(
    frames: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    real, calls = command.score_frame, []

    def interrupted(*arguments: object) -> object:
        calls.append(1)
        if len(calls) > 3 * 21 + 5:  # in the middle of the fourth frame's 21 variants
            raise KeyboardInterrupt
        return real(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(command, "score_frame", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_ablation(Plan(frames, true_masks=True, sequence=4), as_json=True)
    result = json.loads(capsys.readouterr().out)
    assert (result["frames"], result["interrupted"]) == (3, True)
    assert "stream" not in result


def test_a_damaged_frame_is_left_out_and_said(frames: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, out = tmp_path / "set", tmp_path / "out"
    shutil.copytree(frames, folder)
    _cut(folder / "images" / "000002.png")
    run_ablation(Plan(folder, true_masks=True, out=out), as_json=True)
    shown = capsys.readouterr()
    result = json.loads(shown.out)
    assert (result["frames"], result["left_out"], result["interrupted"]) == (5, 1, False)
    assert "1 of 6 frames could not be read" in shown.err
    assert "1 frames left out that cannot be read" in (out / "ablation.md").read_text()
    with (out / "ablation_frames.csv").open(newline="") as file:
        assert {row["stem"] for row in csv.DictReader(file)} == {f"{index:06d}" for index in (0, 1, 3, 4, 5)}


def test_what_leaves_nothing_to_compare_is_no_interruption(frames: Path, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    shutil.copytree(frames, folder)
    rows = [json.loads(line) for line in (frames / "truth.jsonl").read_text().splitlines()]
    rows[1:] = [row | {"state": None} for row in rows[1:]]
    (folder / "truth.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    _cut(folder / "images" / f"{rows[0]['stem']}.png")
    with pytest.raises(UserError, match="no frame with a pose can be read"):
        run_ablation(Plan(folder, true_masks=True), as_json=True)
    for image in (folder / "images").iterdir():
        _cut(image)
    with pytest.raises(UserError, match="none of 6 frames could be read"):
        run_ablation(Plan(folder, true_masks=True), as_json=True)


def _cut(image: Path) -> None:
    image.write_bytes(image.read_bytes()[:50])


def test_bad_input_is_one_clear_line(frames: Path, tmp_path: Path) -> None:
    untold, poseless, halved = tmp_path / "untold", tmp_path / "poseless", tmp_path / "halved"
    for folder in (untold, poseless, halved):
        shutil.copytree(frames, folder)
    rows = [json.loads(line) for line in (frames / "truth.jsonl").read_text().splitlines()]

    def write(folder: Path, changed: list[dict[str, object]]) -> None:
        (folder / "truth.jsonl").write_text("".join(json.dumps(row) + "\n" for row in changed))

    write(untold, rows[:-1])
    write(poseless, [row | {"state": None} for row in rows])
    write(halved, [{key: value for key, value in row.items() if key != "head_xy"} for row in rows])
    file = tmp_path / "file"
    file.write_text("")
    for plan, words in (
        (Plan(None), "nothing to measure on"),
        (Plan(tmp_path / "missing"), "no labelled frames"),
        (Plan(untold), "1 of 6 frames lack a truth (the first: 000005)"),
        (Plan(poseless), "no frame of truth.jsonl has a pose"),
        (Plan(halved), "lacks head_xy"),
        (Plan(frames, out=file), "cannot be made"),
        (Plan(None, sequence=5, phantoms=("nowhere",)), "unknown phantom 'nowhere'"),
        (Plan(frames, model=str(tmp_path / "none")), "none"),
    ):
        with pytest.raises(UserError) as failed:
            run_ablation(plan, as_json=True)
        assert words in str(failed.value)
        assert "\n" not in str(failed.value)
    ended = run("ablation", poseless, "--true-masks")
    assert ended.returncode == 2
    assert ended.stderr.startswith("error: ")
    assert (ended.stderr.count("\n"), ended.stdout) == (1, "")


def test_names_that_are_no_utf8_are_shown_as_bytes(frames: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = os.fsdecode(b"caf\xe9")
    folder = Path(shutil.copytree(frames, tmp_path / name))
    for path in (*folder.glob("*/000000*.png"),):
        path.rename(path.with_name(path.name.replace("000000", name)))
    truth = folder / "truth.jsonl"
    truth.write_text(truth.read_text().replace('"000000"', json.dumps(name)))
    run_ablation(Plan(folder, true_masks=True, out=tmp_path / "out"), as_json=False)
    assert r"caf\xe9" in (tmp_path / "out" / "ablation.md").read_text()
    assert r"caf\xe9" in (tmp_path / "out" / "ablation_frames.csv").read_text()
