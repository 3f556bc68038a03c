"""Labelled sets from the twin: complete, repeatable, continued after an interruption, disjoint by seed."""

import itertools
import json
import os
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.learning.dataset import find_samples, read_truth
from core.learning.scenes import find_scenes, read_scene
from hardware.twin import dataset
from hardware.twin.dataset import SynthError, SynthPlan, write_set
from hardware.twin.phantoms import make_phantom
from hardware.twin.rendering.appearance import Appearance
from hardware.twin.rendering.renderer import Renderer


@pytest.fixture(scope="module")
def small_set(tmp_path_factory: pytest.TempPathFactory) -> SynthPlan:
    plan = SynthPlan(tmp_path_factory.mktemp("synth") / "set", 5, 3, size=(320, 240))
    write_set(plan)
    return plan


def test_every_frame_has_image_masks_and_truth(small_set: SynthPlan) -> None:
    samples, truth = find_samples([small_set.out]), read_truth(small_set.out)
    assert [s.stem for s in samples] == list(truth) == [f"{i:06d}" for i in range(5)]
    for sample in samples:
        image, vessel, robot = sample.load()
        row = truth[sample.stem]
        assert image.shape == (240, 320, 3)
        assert vessel.any()
        assert row["robot_visible"] == bool(robot.any())
        assert row["seed"] == 3
        assert (row["state"] is None) == (row["theta_deg"] is None)


def test_the_same_plan_gives_the_same_bytes(small_set: SynthPlan, tmp_path: Path) -> None:
    again = SynthPlan(tmp_path / "again", 5, 3, size=(320, 240))
    write_set(again)
    for name in ("images/000003.png", "masks/000003_robot.png", "truth.jsonl"):
        assert (again.out / name).read_bytes() == (small_set.out / name).read_bytes()


def test_an_interrupted_set_goes_on_and_keeps_what_is_there(small_set: SynthPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[int] = []
    original = dataset._write_episode
    monkeypatch.setattr(dataset, "_write_episode", lambda plan, episode: written.append(episode) or original(plan, episode))
    progress: list[int] = []
    assert write_set(small_set, on_progress=progress.append) == 5
    assert written == []
    assert progress == [5]
    (small_set.out / "episodes" / "00000.jsonl").unlink()
    before = (small_set.out / "images" / "000001.png").read_bytes()
    write_set(small_set)
    assert written == [0]
    assert (small_set.out / "images" / "000001.png").read_bytes() == before


def test_a_process_that_is_ended_from_outside_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise BrokenProcessPool("A process in the process pool was terminated abruptly")

    monkeypatch.setattr(dataset, "as_completed", broken)
    monkeypatch.setattr(dataset, "ProcessPoolExecutor", lambda *_args, **_options: ThreadPoolExecutor(1))
    monkeypatch.setattr(dataset, "_write_episode", lambda *_: 0)
    with pytest.raises(SynthError, match=r"was ended from outside .*; the same command goes on, with fewer --workers"):
        write_set(SynthPlan(tmp_path / "set", 4, 5, (160, 120), None, None), workers=2)


def test_what_a_killed_run_left_is_removed(small_set: SynthPlan) -> None:
    left = [small_set.out / name / f".{7:016x}.part" for name in (".", "images", "masks", "episodes")]
    for path in left:
        path.write_bytes(b"half of it")
        os.utime(path, (1.0, 1.0))
    write_set(small_set)
    assert not any(path.exists() for path in left)


@pytest.mark.parametrize(("count", "seed", "words"), [(5, 4, "other settings"), (2, 3, "holds more than 2 frames")])
def test_another_plan_or_a_smaller_count_does_not_overwrite_a_set(small_set: SynthPlan, count: int, seed: int, words: str) -> None:
    with pytest.raises(SynthError, match=words):
        write_set(SynthPlan(small_set.out, count, seed, size=(320, 240)))


def test_the_benchs_own_look_is_the_trials_one() -> None:
    frame = next(dataset.episode_frames(SynthPlan(Path("unused"), 1, 8, size=(320, 240), families=("bench",)), 0))
    phantom = make_phantom("random:8")
    renderer = Renderer(phantom, Appearance(), (320, 240), 8)
    points, sheath_mm, _ = dataset.robot_shapes(phantom, 8, dataset.LOOKS_PER_EPISODE)[0]
    assert np.array_equal(frame.picture.image, renderer.render(points, sheath_mm, noise_seed=0).image)
    assert frame.truth["family"] == "bench"


def test_painted_benches_have_exact_labels() -> None:
    plan = SynthPlan(Path("unused"), 1, 8, size=(320, 240), families=("painted",))
    painted, again = (next(dataset.episode_frames(plan, 0)) for _ in range(2))
    assert painted.truth["family"] == "painted"
    assert np.array_equal(painted.picture.image, again.picture.image)
    path = np.rint(painted.truth["robot_path_xy"]).astype(int)
    inside = np.all((path >= 3) & (path < (317, 237)), axis=1)
    assert painted.picture.robot[path[inside, 1], path[inside, 0]].mean() > 0.95
    assert painted.picture.vessel.shape == painted.picture.robot.shape
    assert painted.picture.vessel.any()


def test_a_look_is_shown_with_several_poses() -> None:
    plan = SynthPlan(Path("unused"), 50, 3, size=(320, 240), poses=3)
    assert (plan.episodes, plan.frames_of(0), plan.frames_of(1)) == (2, 48, 2)
    frames = list(itertools.islice(dataset.episode_frames(plan, 0), 12))
    vessels = [np.packbits(frame.picture.vessel).tobytes() for frame in frames]
    families = [frame.truth["family"] for frame in frames]
    for first in range(0, 12, 3):
        assert len(set(vessels[first : first + 3])) == len(set(families[first : first + 3])) == 1
    assert len(set(vessels)) == 4, "each look has a view of its own"
    robots = {np.packbits(frame.picture.robot).tobytes() for frame in frames if frame.truth["robot_visible"]}
    assert len(robots) == sum(frame.truth["robot_visible"] for frame in frames)
    alone = next(dataset.episode_frames(replace(plan, count=16, poses=1), 0))
    assert np.array_equal(alone.picture.vessel, frames[0].picture.vessel), "the first look is the same"


def test_a_set_of_several_poses_grows_in_the_middle_of_a_look(tmp_path: Path) -> None:
    plan = SynthPlan(tmp_path / "set", 4, 3, size=(160, 120), poses=3)
    write_set(plan)
    assert json.loads((plan.out / "plan.json").read_text())["poses"] == 3
    write_set(replace(plan, count=8))
    whole = replace(plan, out=tmp_path / "whole", count=8)
    write_set(whole)
    written = sorted(path.relative_to(whole.out) for path in whole.out.rglob("*") if path.is_file())
    assert len(written) == 8 * 3 + 3
    assert all((plan.out / name).read_bytes() == (whole.out / name).read_bytes() for name in written)
    with pytest.raises(SynthError, match="other settings"):
        write_set(replace(plan, count=8, poses=1))


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> SynthPlan:
    plan = SynthPlan(tmp_path_factory.mktemp("scenes") / "set", 3, 3, size=(320, 240), scenes=True)
    write_set(plan)
    return plan


def test_scenes_are_the_twins_geometry(scenes: SynthPlan) -> None:
    truth, files = read_truth(scenes.out), find_scenes([scenes.out])
    assert [path.stem for path in files] == list(truth) == ["000000", "000001", "000002"]
    assert [truth[path.stem]["pictures"] for path in files] == [2, 0, 2]
    for path in files:
        scene = read_scene(path)
        assert scene.ratio.shape == (240, 320)
        assert scene.vessel.any()
        assert (scene.vessel != (scene.ratio < 1)).mean() < 0.01
        assert len(scene.lines) == 6
        assert len({line.tobytes() for line in scene.lines}) > 1
        for (image, robot), line in zip(scene.pictures, scene.lines, strict=False):
            assert image.shape == (240, 320, 3)
            rows, columns = np.nonzero(robot)
            if len(rows):
                away = np.hypot(columns[:, None] - line[:, 0], rows[:, None] - line[:, 1]).min(axis=1)
                assert away.max() < scene.radius_px + 3
        assert len(scene.pictures) == truth[path.stem]["pictures"]


def test_a_set_of_scenes_goes_on_and_is_no_set_of_frames(scenes: SynthPlan, tmp_path: Path) -> None:
    again = replace(scenes, out=tmp_path / "again", count=1)
    write_set(again)
    write_set(replace(again, count=3))
    for path in find_scenes([scenes.out]):
        assert (again.out / "scenes" / path.name).read_bytes() == path.read_bytes()
    with pytest.raises(SynthError, match="holds more than 2 scenes"):
        write_set(replace(again, count=2))
    with pytest.raises(SynthError, match="other settings"):
        write_set(replace(again, scenes=False))


def test_an_unwritable_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(SynthError, match="cannot be written"):
        write_set(SynthPlan(tmp_path / "file" / "set", 1, 0))
