"""``record`` and ``session`` as a user calls them."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import av
import pytest
from mcap.reader import make_reader

from core.session.manifest import read_manifest
from core.session.reader import SessionReader
from tests.app.program import MAIN, run

# a small picture and one thread: the machine that runs the tests may be busy
CONFIG = """
[twin]
image_width_px = 320
image_height_px = 240
[perception]
working_size_px = 320
[perception.segmentation]
threads = 1
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("config") / "small.toml"
    path.write_text(CONFIG)
    return path


@pytest.fixture(scope="module")
def recorded(config: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, object]]:
    """A session of the twin, and what ``record --json`` said."""
    out = tmp_path_factory.mktemp("sessions")
    done = run("record", "--seconds", 1.5, "--out", out / "new folder", "--config", config, "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    return Path(result["session"]), result


def test_recording_the_twin_writes_a_session_of_its_rig(recorded: tuple[Path, dict[str, object]]) -> None:
    session, result = recorded
    manifest = read_manifest(session)
    assert (manifest.kind, manifest.rig, manifest.closed, manifest.ended) == ("SIM", "twin", True, "all recorded")
    assert manifest.config["twin"]["image_width_px"] == 320
    assert len(manifest.model["sha256"] or "") == 64
    with SessionReader(session) as reader:
        reader.wait(20.0)
        assert reader.problems == ()
        assert len(reader) == result["frames"] == manifest.counts.frames > 3
        ticks = [reader.tick(place) for place in (0, len(reader) // 2, len(reader) - 1)]
        assert all(tick is not None and tick.frame.image.shape == (240, 320, 3) for tick in ticks)
        assert all(tick is not None and tick.status is not None for tick in ticks)
        row = reader.row(0)
        assert row is not None
        assert row.drive is not None
    assert result["dropped"] == 0
    assert float(str(result["seconds"])) >= 1.4


def test_info_is_one_object_and_a_table(recorded: tuple[Path, dict[str, object]]) -> None:
    session, result = recorded
    done = run("session", "info", session, "--json")
    assert done.returncode == 0, done.stderr
    info = json.loads(done.stdout)
    assert (info["rows"], info["kind"], info["ended"], info["problems"]) == (result["frames"], "SIM", "all recorded", [])
    table = run("session", "info", session)
    assert table.returncode == 0
    assert "all recorded" in table.stdout
    assert "ADVISORY" in table.stdout


def test_export_writes_all_three(recorded: tuple[Path, dict[str, object]], tmp_path: Path) -> None:
    session, result = recorded
    outs = [tmp_path / f"x.{ending}" for ending in ("mp4", "csv", "mcap")]
    done = run("session", "export", session, *(word for out in outs for word in ("--out", out)), "--json")
    assert done.returncode == 0, done.stderr
    written = json.loads(done.stdout)["written"]
    assert written[str(outs[0])] == written[str(outs[1])] == result["frames"]
    with av.open(str(outs[0])) as container:
        frame = next(container.decode(video=0))
        # overlays are drawn larger than the picture, with a caption below
        assert frame.width >= 1280
        assert frame.height > frame.width * 3 / 4
    with outs[1].open(newline="") as file:
        assert len(list(csv.DictReader(file))) == result["frames"]
    with outs[2].open("rb") as mcap:
        assert {channel.topic for _, channel, _ in make_reader(mcap).iter_messages()} >= {"/camera/video", "/pose", "/robot"}
    again = run("session", "export", session, "--out", outs[0])
    assert again.returncode == 2
    assert "there already" in again.stderr


def test_ctrl_c_ends_the_recording_properly(config: Path, tmp_path: Path) -> None:
    command = ["record", "--seconds", "600", "--out", str(tmp_path), "--config", str(config), "--json"]
    process = subprocess.Popen([sys.executable, str(MAIN), *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    until_s = time.monotonic() + 60.0
    while not any(path.stat().st_size for path in tmp_path.glob("*/frames.jsonl")):
        assert process.poll() is None
        assert time.monotonic() < until_s
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, errors = process.communicate(timeout=60.0)
    assert process.returncode == 0, errors
    result = json.loads(out)
    assert result["ended"] == "interrupted"
    assert read_manifest(Path(result["session"])).closed


def test_a_killed_recording_is_recovered_by_the_command(config: Path, tmp_path: Path) -> None:
    command = ["record", "--seconds", "600", "--out", str(tmp_path), "--config", str(config)]
    process = subprocess.Popen(
        [sys.executable, str(MAIN), *command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    until_s = time.monotonic() + 60.0
    while not any(path.read_bytes().count(b"\n") > 5 for path in tmp_path.glob("*/frames.jsonl")):
        assert time.monotonic() < until_s
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    (session,) = tmp_path.glob("session_*")
    info = run("session", "info", session, "--json")
    assert json.loads(info.stdout)["ended"] == "cut"
    done = run("session", "recover", session, "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["frames"] > 5
    assert result["lost"]["rows"] == 0
    assert json.loads(run("session", "info", result["session"], "--json").stdout)["problems"] == []


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("record", "--seconds", 1, "--out", "{file}"), "choose another folder"),
        (("record", "--seconds", 1, "--out", "{folder}", "--rig", "moon"), "unknown rig 'moon'"),
        (("record", "--seconds", 1, "--out", "{folder}", "--config", "{file}"), "not valid TOML"),
        (("record", "--seconds", 0, "--out", "{folder}"), "seconds"),
        (("record", "--seconds", 1, "--out", "{folder}", "--config", "{no_model}"), "no model 'nope'"),
        (("session", "info", "{folder}"), "not a session"),
        (("session", "info", "{file}"), "not a file"),
        (("session", "recover", "{folder}/nothing"), "no such session"),
        (("session", "export", "{folder}", "--out", "{folder}/x.avi"), "must be one of .mp4, .csv, .mcap"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path: Path, arguments: tuple[object, ...], why: str) -> None:
    folder, file, no_model = tmp_path / "folder", tmp_path / "file", tmp_path / "no_model.toml"
    folder.mkdir()
    file.write_text("= not toml")
    no_model.write_text('[perception.segmentation]\nmodel = "nope"\n')
    done = run(*(str(word).format(folder=folder, file=file, no_model=no_model) for word in arguments))
    assert done.returncode == 2
    assert why in done.stderr
    assert "Traceback" not in done.stderr
    assert list(folder.iterdir()) == []
