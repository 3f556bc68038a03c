"""Reference results: record what the command line produces, and compare two recordings.

``python -m tools.reference record DIR`` runs the program of a project root stage by stage and keeps its results in DIR.
``python -m tools.reference compare DIR_A DIR_B`` lists the differences of two recordings and exits 1 if there are any.
``python -m tools.reference start --root A --root B`` times two project roots in turns.

Only the command line of the program is used, nothing of it is imported: ``--root FOLDER`` records another version. Fields that
hold measured times are left out of a recording, all others are compared exactly. Results depend on the processor and on package
versions: make both recordings on the same machine.
"""

from __future__ import annotations

import argparse
import difflib
import hashlib
import json
import math
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

# The commands of each stage. All files that they write are kept: JSON, JSON lines, CSV and text as they are, pictures, videos and
# MCAP as hashes, of others the name. The standard output goes to the file behind ">". "help" is no command.
TRIALS = "trial --policy pursuit --policy table --policy push --json --out trials --seeds"
ACCURACY = "benchmark --accuracy set --json > accuracy.json"
SPEED = "benchmark --json --frames 24 > speed.json"
QUICK_STAGES: dict[str, tuple[str, ...]] = {
    "help": ("help",),
    "perceive": (
        "synth --out frames --count 24 --seed 7",
        "perceive frames/images --masks masks > pictures.jsonl",
        "perceive frames/images --masks masks_paper --preset paper > paper.jsonl",
        "perceive inputs/golden_session/video_0000.mkv --masks masks_video > video.jsonl",
    ),
    "overlay": (
        "perceive inputs/golden_session/video_0000.mkv --overlay overlay > video.jsonl",
        "session export inputs/golden_session --out overlay.mp4",
        "session export inputs/golden_session --plain --out plain.mp4",
    ),
    "session": (
        "session info inputs/golden_session --json > info.json",
        "session export inputs/golden_session --out session.csv --out session.mcap --json > export.json",
        "replay inputs/golden_session --jsonl replay.jsonl --diff --json > replay.json",
        "session info inputs/cut_session --json > cut.json",
        "session recover inputs/cut_session --only-look --json > recover.json",
    ),
    "evaluate": ("evaluate --csv inputs/measures.csv --out evaluation --json > stdout.json",),
    "accuracy64": ("synth --out set --count 64 --seed 900000", ACCURACY),
    "trials2": (f"{TRIALS} 0:2 > results.jsonl",),
    "start": (SPEED,),
}
LONG_STAGES = {"accuracy": ("synth --out set --count 512 --seed 900000", ACCURACY), "trials": (f"{TRIALS} 0:10 > results.jsonl",)}
STAGES: dict[str, tuple[str, ...]] = QUICK_STAGES | LONG_STAGES
# Keys whose values are measured wall-clock times, in all stages but "start".
TIMING_KEYS = frozenset({"latency_ms", "total_ms"})
# Values of `benchmark --json` whose ratio is reported.
SPEED_KEYS = ("first_frame_s", "total_ms.p50", "total_ms.p95", "after_network_ms.p50", "after_network_ms.p95", "peak_memory_mb")
MOST_SHOWN = 12  # differences printed per file


def run_program(root: Path, work: Path, words: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run ``main.py`` of an absolute `root` in the folder `work`, which also holds its settings; raises RuntimeError."""
    python = str(root / ".venv/bin/python") if (root / ".venv/bin/python").exists() else sys.executable
    # Caches of compiled code are shared by all runs of the same root, settings are not.
    key = hashlib.sha256(str(root).encode()).hexdigest()[:12]
    folders = {f"XDG_{kind}_HOME": str(work / "home" / kind) for kind in ("CONFIG", "DATA", "STATE")}
    folders["XDG_CACHE_HOME"] = str(Path(tempfile.gettempdir()) / f"lumenpilot-reference-{key}")
    fixed = {"COLUMNS": "100", "NO_COLOR": "1", "TERM": "dumb", "LC_ALL": "C.UTF-8", "QT_QPA_PLATFORM": "offscreen"}
    command = [python, str(root / "main.py"), *words]
    done = subprocess.run(command, cwd=work, env={**os.environ, **fixed, **folders}, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"main.py {' '.join(words)}\nexit code {done.returncode}\n{done.stderr[-3000:]}")
    return done


def _run_line(root: Path, work: Path, line: str) -> None:
    """Run a command of ``STAGES``."""
    if line == "help":
        return _record_help(root, work)
    words, _, target = line.partition(" > ")
    (work / (target or os.devnull)).write_text(run_program(root, work, words.split()).stdout, encoding="utf-8")


def _make_inputs(root: Path, work: Path) -> None:
    """The golden session, the same one cut off in a row, and a table of made-up measures with blank cells and refusals."""
    inputs = work / "inputs"
    for name in ("golden_session", "cut_session"):
        shutil.copytree(root / "tests/data/golden_session", inputs / name)
    rows = (inputs / "cut_session/frames.jsonl").read_bytes()
    (inputs / "cut_session/frames.jsonl").write_bytes(rows[: len(rows) * 2 // 3])
    table = "image,angle_1,angle_2,state,algorithm_angle,algorithm_state\n"
    for k in range(60):
        first, second, state = k * 37 % 120, "" if k % 6 == 5 else k * 37 % 120 + k % 5 - 2, "ABCD"[k * 7 % 4]
        answer = "," if k % 11 == 10 else f"{first + k * 13 % 17 * 0.4 - 3.0:.2f},{state if k % 9 else 'ABCD'[k % 4]}"
        table += f"image_{k:02},{first},{second},{'' if k % 13 == 12 else state},{answer}\n"
    (inputs / "measures.csv").write_text(table, encoding="utf-8")


def _record_help(root: Path, work: Path) -> None:
    """``--help`` of the program, of every command and of every sub-command."""
    waiting: list[tuple[str, ...]] = [()]
    while waiting:
        words = waiting.pop()
        text = run_program(root, work, [*words, "--help"]).stdout
        (work / ("-".join(words or ("main",)) + ".txt")).write_text(text, encoding="utf-8")
        listed = text.partition("\nCommands:\n")[2]
        waiting += [(*words, name) for name in re.findall(r"^  ([\w-]+)(?:\s{2}|$)", listed, re.MULTILINE)]


def _read_json(path: Path, without: frozenset[str] = frozenset()) -> Any:
    text, is_lines = path.read_text(encoding="utf-8"), path.suffix == ".jsonl"
    values = [
        json.loads(one, object_hook=lambda row: {key: value for key, value in row.items() if key not in without})
        for one in (text.splitlines() if is_lines else [text])
    ]
    return values if is_lines else values[0]


def _write_json(path: Path, value: Any) -> None:
    texts = map(json.dumps, value) if path.suffix == ".jsonl" else [json.dumps(value, indent=1)]
    path.write_text("".join(f"{text}\n" for text in texts), encoding="utf-8")


def _keep_results(work: Path, out: Path, without: frozenset[str]) -> None:
    """Copy what the commands have written into `out`, in one folder; absolute paths of the working folder become relative."""
    out.mkdir()
    hashes, names = {}, []
    for path in sorted(work.rglob("*")):
        name = path.relative_to(work).as_posix()
        if path.is_dir() or name.startswith(("inputs/", "home/")):
            continue
        kept = out / name.replace("/", "-")
        if path.suffix in (".png", ".mp4", ".mcap"):
            hashes[name] = hashlib.sha256(path.read_bytes()).hexdigest()
        elif path.suffix in (".json", ".jsonl", ".csv", ".txt"):
            kept.write_text(path.read_text(encoding="utf-8").replace(f"{work}/", ""), encoding="utf-8")
            if path.suffix.startswith(".json"):
                _write_json(kept, _read_json(kept, without))
        else:
            names.append(name)
    if hashes or names:
        _write_json(out / "files.json", {"sha256": hashes, "others": names})


def record(out: Path, root: Path, stages: Sequence[str], sets: Path | None = None) -> int:
    """Record `stages` into folders of `out`; return how many failed, which have a ``failed.txt``.

    Parameters
    ----------
    sets : folder with the labelled sets of earlier recordings, which are not rendered again; it gets the others.
    """
    root, failed = root.resolve(), 0
    git = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    commit = subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip()
    out.mkdir(parents=True, exist_ok=True)
    info = _read_json(out / "info.json") if (out / "info.json").is_file() else {"stages": {}}
    cpu = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text(encoding="utf-8"))
    info["machine"] = {"processor": cpu[1] if cpu else None, "cores": os.cpu_count()}
    for stage in stages:
        shutil.rmtree(out / stage, ignore_errors=True)
        started, problem = time.monotonic(), ""
        with tempfile.TemporaryDirectory(prefix="reference-") as scratch:
            work = Path(scratch).resolve()
            _make_inputs(root, work)
            if sets is not None and (sets / stage).is_dir():
                shutil.copytree(sets / stage, work / "set")
            try:
                for line in STAGES[stage]:
                    _run_line(root, work, line)
                _keep_results(work, out / stage, frozenset() if stage == "start" else TIMING_KEYS)
                if sets is not None and (work / "set").is_dir():
                    shutil.copytree(work / "set", sets / stage, dirs_exist_ok=True)
            except (RuntimeError, OSError, ValueError) as error:
                problem = f"{type(error).__name__}: {error}"
                (out / stage).mkdir(exist_ok=True)
                (out / stage / "failed.txt").write_text(problem + "\n", encoding="utf-8")
        seconds = round(time.monotonic() - started, 1)
        failed += bool(problem)
        info["stages"][stage] = {"commit": commit, "seconds": seconds}
        _write_json(out / "info.json", info)
        _print(f"{stage}: {'FAILED: ' + problem if problem else 'recorded'}, {seconds} s")
    return failed


def find_differences(a: Any, b: Any, path: str = "") -> Iterator[str]:
    """Differences of two JSON values, each as one line with the path of its key and both values."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in sorted(a.keys() | b.keys()):
            if key in a and key in b:
                yield from find_differences(a[key], b[key], f"{path}.{key}")
            else:
                yield f"{path}.{key}: only in {'A' if key in a else 'B'}"
    elif isinstance(a, list) and isinstance(b, list):
        if len(a) != len(b):
            yield f"{path}: {len(a)} elements | {len(b)} elements"
        for place, (one, other) in enumerate(zip(a, b, strict=False)):
            yield from find_differences(one, other, f"{path}[{place}]")
    elif json.dumps(a) != json.dumps(b):
        yield f"{path}: {json.dumps(a, ensure_ascii=False)[:200]} | {json.dumps(b, ensure_ascii=False)[:200]}"


def _entries(text: str) -> list[str]:
    """Lines of a table, or of a help text without alignment; of commands the name only."""
    text, _, listed = text.partition("\nCommands:\n")
    entries = [" ".join(entry.split()) for entry in re.split(r"\n(?= {0,2}\S)", text)]
    return entries + re.findall(r"^  (\S+)", listed, re.MULTILINE)


def _compare_files(stage: str, a: Path, b: Path) -> list[str]:
    """Lines that tell the differences."""
    if stage == "start":
        _print_ratios([_read_json(a)], [_read_json(b)])
        return []
    if a.suffix in (".json", ".jsonl"):
        return list(find_differences(_read_json(a), _read_json(b)))
    before, after = (_entries(path.read_text(encoding="utf-8")) for path in (a, b))
    return [line for line in list(difflib.unified_diff(before, after, n=0, lineterm=""))[2:] if not line.startswith("@@")]


def _compare_stage(stage: str, a: Path, b: Path) -> Iterator[tuple[str, list[str]]]:
    """What differs, and the lines that tell how."""
    for folder in (a, b):
        if not folder.is_dir() or (folder / "failed.txt").exists():
            yield f"{folder}: {'failed when it was recorded' if folder.is_dir() else 'not recorded'}", []
            return
    for name in sorted({path.name for folder in (a, b) for path in folder.iterdir()}):
        if (a / name).exists() and (b / name).exists():
            if lines := _compare_files(stage, a / name, b / name):
                yield f"{stage}/{name}: A | B", lines
        else:
            yield f"{stage}/{name}: only in {'A' if (a / name).exists() else 'B'}", []


def compare(a: Path, b: Path, stages: Sequence[str] | None = None, report_only: Sequence[str] = ()) -> int:
    """Print the differences of two recordings; return the number of stages that differ, 1 if there are none to compare.

    Parameters
    ----------
    stages : what to compare; None: what both recordings have.
    report_only : stages whose differences are printed, but not counted.
    """
    differing, (one, other) = 0, (_read_json(folder / "info.json")["machine"] for folder in (a, b))
    if one != other:
        _print(f"note: recorded on different machines: {one} | {other}")
    compared = stages or [name for name in STAGES if (a / name).is_dir() and (b / name).is_dir()]
    for stage in compared:
        found = list(_compare_stage(stage, a / stage, b / stage))
        for title, lines in found:
            more = [f"... {len(lines) - MOST_SHOWN} more"] if len(lines) > MOST_SHOWN else []
            _print("\n    ".join([title, *lines[:MOST_SHOWN], *more]))
        verdict = "equal" if not found else "differences are reported only" if stage in report_only else "DIFFERENT"
        differing += verdict == "DIFFERENT"
        _print(f"{stage}: {verdict}")
    others = ", ".join(name for name in STAGES if name not in compared) or "none"
    _print(f"{differing} of {len(compared)} stages differ; not compared: {others}")
    return differing or not compared


def _print_ratios(a: Sequence[Any], b: Sequence[Any]) -> None:
    for name in SPEED_KEYS:
        key, _, inner = name.partition(".")
        values = [[speed[key][inner] if inner else speed[key] for speed in side] for side in (a, b)]
        one, other = (statistics.median([math.nan if value is None else value for value in side]) for side in values)
        _print(f"{name}: {one:.2f} | {other:.2f}, ratio {other / one:.2f}")


def start(roots: Sequence[Path], times: int) -> int:
    """Time the first root (A) and the second (B) in turns; print medians and their ratio."""
    speeds: list[list[Any]] = [[] for _ in roots]
    for _ in range(times):
        for root, done in zip(roots, speeds, strict=True):
            with tempfile.TemporaryDirectory(prefix="reference-") as work:
                _run_line(root.resolve(), Path(work), SPEED)
                done.append(_read_json(Path(work, "speed.json")))
    _print_ratios(*speeds)
    return 0


def _print(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def _stages(text: str) -> list[str]:
    names = [name for word in text.split(",") for name in (QUICK_STAGES if word == "quick" else [word])]
    if unknown := [name for name in names if name not in STAGES]:
        raise argparse.ArgumentTypeError(f"unknown stage {unknown[0]!r}; known: quick, {', '.join(STAGES)}")
    return names


def main() -> int:
    """Command line; exit code 1 means that something differs or a stage failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    stages: dict[str, Any] = {"type": _stages, "metavar": "STAGE,..."}
    one = commands.add_parser("record", help="run the program and keep its results")
    one.add_argument("out", type=Path, metavar="DIR")
    one.add_argument("--root", type=Path, default=Path.cwd(), help="project root with main.py; default: this folder")
    one.add_argument("--sets", type=Path, help="folder that keeps labelled sets; those that are there are not rendered again")
    one.add_argument("--only", default=list(STAGES), help=f"of quick, {', '.join(STAGES)}; default: all", **stages)
    two = commands.add_parser("compare", help="list the differences of two recordings")
    two.add_argument("a", type=Path, metavar="DIR_A")
    two.add_argument("b", type=Path, metavar="DIR_B")
    two.add_argument("--only", help="default: all that both have", **stages)
    two.add_argument("--report-only", default=[], help="print differences of these, but do not count them", **stages)
    three = commands.add_parser("start", help="time two project roots in turns")
    three.add_argument("--root", type=Path, action="append", required=True, help="give it twice: A, then B")
    three.add_argument("--times", type=int, default=3, help="turns; default: 3")
    given = parser.parse_args()
    if given.command == "start":
        if len(given.root) != 2:
            parser.error("start needs --root twice")
        return start(given.root, given.times)
    if given.command == "record":
        return int(record(given.out, given.root, given.only, given.sets) > 0)
    return int(compare(given.a, given.b, given.only, given.report_only) > 0)


if __name__ == "__main__":
    sys.exit(main())
