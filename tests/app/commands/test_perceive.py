"""``perceive`` as scripts and studies rely on it, on pictures that the twin renders now; and what bad input gives."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.commands.progress import LineOutput
from core.bench.bench import bench_from_pictures, read_bench, write_bench
from core.config.models import TwinConfig
from core.devices import UserError
from core.files import read_image
from hardware.twin.world import TwinWorld
from tests.app.program import MAIN, run
from tests.core.drawing import film

pytestmark = pytest.mark.usefixtures("looked_at_once")

KEYS = set(
    "image width height head_xy tail_xy robot_path_xy robot_vector vessel_vector theta_deg theta_signed_deg d_head_px d_tail_px "
    "crossed state confidence reason latency_ms".split()
)


def rows(path: Path) -> list[dict]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.fixture(scope="module")
def world() -> TwinWorld:
    world = TwinWorld(TwinConfig(phantom="tree"))
    world.insert(70.0)
    return world


@pytest.fixture(scope="module")
def picture(world: TwinWorld, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("in") / "photo.png"
    cv2.imwrite(str(path), world.frame().image[:, :, ::-1])
    return path


def test_a_picture_gives_the_contracts_object_masks_and_overlay(picture: Path, world: TwinWorld, tmp_path: Path) -> None:
    done = run("perceive", picture, "--jsonl", tmp_path / "o.jsonl", "--masks", tmp_path / "m", "--overlay", tmp_path / "s")
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    (row,) = rows(tmp_path / "o.jsonl")
    assert set(row) == KEYS
    truth = world.truth()
    assert truth.head_xy is not None
    assert row["reason"] is None
    assert row["state"] in {"A", "B", "C", "D"}
    assert np.hypot(*(np.array(row["head_xy"]) - truth.to_source(truth.head_xy))) < 6.0
    assert abs(row["theta_deg"] - truth.pose.theta_deg) < 6.0
    assert row["theta_deg"] == abs(row["theta_signed_deg"])
    assert row["robot_path_xy"][-1] == pytest.approx(row["head_xy"], abs=0.01)
    assert set(row["robot_vector"]) == {"start", "center", "end"}
    assert 0 < row["confidence"] <= 1
    assert row["latency_ms"]["total"] > 0
    for name in ("vessel", "robot"):
        mask = read_image(tmp_path / "m" / f"photo_{name}.png")
        assert mask.shape == (480, 640, 3)
        assert set(np.unique(mask)) == {0, 255}
    assert read_image(tmp_path / "s" / "photo_overlay.png").shape[1] >= 640


def test_points_are_source_pixels_and_distances_working_pixels(picture: Path, tmp_path: Path) -> None:
    image = cv2.imread(str(picture))
    cv2.imwrite(str(tmp_path / "double.png"), cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC))
    assert run("perceive", picture, tmp_path / "double.png", "--jsonl", tmp_path / "o.jsonl").returncode == 0
    one, two = rows(tmp_path / "o.jsonl")
    assert (two["width"], two["height"]) == (1280, 960)
    np.testing.assert_allclose(np.array(two["head_xy"]), np.array(one["head_xy"]) * 2 + 0.5, atol=6.0)
    assert abs(two["d_head_px"] - one["d_head_px"]) < 3.0


def test_bad_files_are_objects_with_a_reason_and_the_rest_goes_on(picture: Path, tmp_path: Path) -> None:
    folder = tmp_path / "mixed"
    folder.mkdir()
    data = picture.read_bytes()
    (folder / "a_cut.png").write_bytes(data[: len(data) // 2])
    (folder / "b_empty.png").write_bytes(b"")
    (folder / "c_good.png").write_bytes(data)
    (folder / "notes.txt").write_text("other files are left alone")
    grey16 = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE).astype(np.uint16) * 257
    cv2.imwrite(str(folder / "d_grey16.png"), grey16)
    (folder / "e_gone.png").symlink_to(tmp_path / "moved away.png")
    done = run("perceive", folder, "--jsonl", tmp_path / "o.jsonl")
    assert done.returncode == 0, done.stderr
    cut, empty, good, grey, gone = rows(tmp_path / "o.jsonl")
    assert "cut short" in cut["reason"]
    assert cut["state"] is None
    assert cut["confidence"] == 0
    assert "empty file" in empty["reason"]
    assert good["state"] is not None
    assert grey["state"] is not None
    assert "No such file" in gone["reason"]
    assert "3 pictures could not be read" in done.stderr


def test_pictures_of_nothing_or_without_a_robot_have_no_pose_and_a_named_reason(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    folder = tmp_path / "nothing"
    folder.mkdir()
    made = {
        "black": np.zeros((480, 640, 3), np.uint8),
        "white": np.full((480, 640, 3), 255, np.uint8),
        "grey": np.full((480, 640, 3), 128, np.uint8),
        "noise": rng.integers(0, 255, (480, 640, 3), np.uint8),
        "tiny": np.full((3, 2, 3), 90, np.uint8),
        "strip": np.full((4, 900, 3), 90, np.uint8),
        "empty": TwinWorld(TwinConfig(phantom="tree"))._renderer.render(None).image,
    }
    for name, image in made.items():
        cv2.imwrite(str(folder / f"{name}.png"), image)
    assert run("perceive", folder, "--jsonl", tmp_path / "o.jsonl").returncode == 0
    found = {Path(row["image"]).stem: row for row in rows(tmp_path / "o.jsonl")}
    assert set(found) == set(made)
    for row in found.values():
        assert row["state"] is None
        assert row["theta_deg"] is None
        assert row["reason"]
    assert found["black"]["reason"].startswith("image black")
    assert found["white"]["reason"].startswith("image overexposed")


def test_a_video_is_perceived_frame_by_frame(picture: Path, tmp_path: Path) -> None:
    film(tmp_path / "v.mkv", [read_image(picture)] * 3, quantizer=2)
    assert run("perceive", tmp_path / "v.mkv", "--jsonl", tmp_path / "o.jsonl").returncode == 0
    found = rows(tmp_path / "o.jsonl")
    assert [row["image"].rsplit("#")[-1] for row in found] == ["0", "1", "2"]
    assert all(row["state"] for row in found)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux's full device")
def test_a_full_disk_is_one_clear_error(picture: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done = run("perceive", picture, "--jsonl", "/dev/full")
    assert (done.returncode, done.stderr.splitlines()[-1]) == (
        2,
        "error: /dev/full: cannot be written (No space left on device); choose another file",
    )
    with open("/dev/full", "w") as full:
        with monkeypatch.context() as patch:
            patch.setattr(sys, "stdout", full)
            with pytest.raises(UserError, match="standard output: cannot be written"), LineOutput(None) as lines:
                lines.write("a line")
        asked = subprocess.run([sys.executable, str(MAIN), "--help"], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
        assert (asked.returncode, asked.stderr) == (2, "error: output: the disk is full; make room, or write to another one\n")


def test_a_dash_is_standard_output(picture: Path, tmp_path: Path) -> None:
    done = run("perceive", picture, "--jsonl", "-", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["state"] is not None
    assert list(tmp_path.iterdir()) == []
    named = run("perceive", picture, "--jsonl", "./-", cwd=tmp_path)
    assert (named.returncode, named.stdout) == (0, "")
    assert json.loads((tmp_path / "-").read_text())["state"] == json.loads(done.stdout)["state"]


def test_pictures_of_the_same_name_do_not_overwrite_each_other(picture: Path, tmp_path: Path) -> None:
    for name in ("x/a.png", "y/a.png", "y/a_2.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(picture.read_bytes())
    arguments = [tmp_path / name for name in ("x/a.png", "y/a.png", "y/a_2.png")]
    assert run("perceive", *arguments, "--jsonl", tmp_path / "o.jsonl", "--masks", tmp_path / "m").returncode == 0
    assert sorted(p.name for p in (tmp_path / "m").glob("*_robot.png")) == ["a_2_robot.png", "a_3_robot.png", "a_robot.png"]


def test_what_cannot_be_written_is_told_and_the_rest_goes_on(picture: Path, tmp_path: Path) -> None:
    (tmp_path / "m").mkdir()
    (tmp_path / "m" / "photo_vessel.png").mkdir()
    other = tmp_path / "other.png"
    other.write_bytes(picture.read_bytes())
    done = run("perceive", picture, other, "--jsonl", tmp_path / "o.jsonl", "--masks", tmp_path / "m")
    assert done.returncode == 2
    assert "1 pictures could not be written" in done.stderr
    assert len(rows(tmp_path / "o.jsonl")) == 2
    assert (tmp_path / "m" / "other_robot.png").is_file()


def test_with_an_empty_picture_and_the_vessel_the_bench_is_known(picture: Path, world: TwinWorld, tmp_path: Path) -> None:
    empty, vessel = tmp_path / "empty.png", tmp_path / "vessel.png"
    cv2.imwrite(str(empty), TwinWorld(TwinConfig(phantom="tree")).frame().image[:, :, ::-1])
    mask = world.picture(world.physics.robot_points_mm()).vessel
    cv2.imwrite(str(vessel), mask.astype(np.uint8) * 255)
    out, masks = tmp_path / "o.jsonl", tmp_path / "masks"
    done = run("perceive", picture, "--empty", empty, "--vessel", vessel, "--jsonl", out, "--masks", masks)
    assert done.returncode == 0, done.stderr
    assert rows(out)[0]["state"] is not None
    assert np.array_equal(read_image(masks / "photo_vessel.png")[:, :, 0] > 127, mask)
    known = bench_from_pictures([read_image(empty)], mask, "b", 640)
    write_bench(known, tmp_path / "bench")
    done = run("perceive", picture, "--bench", tmp_path / "bench", "--jsonl", tmp_path / "bench" / "bench.json")
    assert done.returncode == 2
    assert "is an input" in done.stderr
    read_bench(tmp_path / "bench")
    other = tmp_path / "other.png"
    cv2.imwrite(str(other), np.roll(cv2.imread(str(picture)), 40, axis=1))
    done = run("perceive", other, "--empty", empty, "--jsonl", out)
    assert done.returncode == 0, done.stderr
    assert rows(out)[0]["reason"].startswith(("camera or phantom moved", "not this bench"))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["perceive", "{picture}", "--vessel", "{picture}"], "--vessel needs --empty"),
        (["perceive", "{picture}", "--empty", "{tmp}/none.png"], "none.png: cannot be read"),
        (["perceive", "{picture}", "--bench", "{tmp}/empty_folder"], "bench.json: cannot be read"),
        (["perceive", "{picture}", "--bench", "{tmp}/b", "--empty", "{picture}"], "leave --empty and --vessel out"),
        (["perceive", "{tmp}/none.png"], "none of 1 pictures could be read"),
        (["perceive", "{tmp}/empty_folder"], "no pictures or videos there"),
        (["perceive", "{picture}", "--model", "nope"], "no model 'nope'"),
        (["perceive", "{picture}", "--preset", "nope"], "unknown preset"),
        (["perceive", "{picture}", "--masks", "{tmp}/file/masks"], "cannot be written"),
        (["perceive", "{picture}", "--jsonl", "{tmp}/file/o.jsonl"], "cannot be written"),
        (["perceive", "{picture}", "--targets", "{tmp}/bad.json"], "not valid JSON"),
        (["perceive", "{picture}", "--targets", "{tmp}/odd.json"], "needs an object"),
        (["perceive", "{picture}", "--config", "{tmp}/bad.toml"], "perception.pose.d_allow_px: must be > 0 and <= 200"),
        (["gui", "--rig", "nope"], "unknown rig 'nope'"),
        (["gui", "--source", "{tmp}/none.mp4"], "no such file"),
        (["gui", "--source", "{tmp}/bad.toml"], "--source takes a folder of pictures, or a file that ends in .png, "),
        (["gui", "--source", "{tmp}/cut.png"], "cut.png: "),
        (["train", "--out", "{tmp}/model"], "nothing to train on"),
        (["train", "--data", "{tmp}/empty_folder", "--out", "{tmp}/model"], "needs images/NAME.png"),
        (["benchmark", "--accuracy", "{tmp}/empty_folder"], "no labelled frames"),
    ],
)
def test_bad_input_is_one_clear_line_and_exit_code_2(arguments: list[str], words: str, picture: Path, tmp_path: Path) -> None:
    (tmp_path / "empty_folder").mkdir()
    (tmp_path / "file").write_text("a file where a folder is wanted")
    (tmp_path / "bad.json").write_text("{")
    (tmp_path / "cut.png").write_bytes(picture.read_bytes()[:100])
    (tmp_path / "odd.json").write_text('{"photo": [1, "x"]}')
    (tmp_path / "bad.toml").write_text("[perception.pose]\nd_allow_px = 0\n")
    done = run(*(a.format(tmp=tmp_path, picture=picture) for a in arguments))
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1
    assert words in lines[0]
    assert "Traceback" not in done.stderr
