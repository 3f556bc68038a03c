"""Data set layout, augmentation and the training loop on a toy task."""

import errno
import itertools
import json
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.files import read_image
from core.learning import training
from core.learning.augmentation import FrameCrops, end_nearness, random_clutter, random_crop, random_look, with_strips
from core.learning.dataset import (
    DatasetError,
    Sample,
    find_labelled,
    find_samples,
    leave_out_looks,
    read_truth,
    without_masks,
    write_mask,
    write_png,
)
from core.learning.training import LoaderLost, TrainingProgress, computes_in_bf16, loss_of, make_optimizers, orthogonalised, train
from core.learning.training_plan import TrainingPlan
from core.perception.unet import DualUNet, UNetShape


def _toy_set(folder: Path, count: int) -> Path:
    """Grey boards with a bright vertical band (vessel) and a dark line in it (robot)."""
    (folder / "images").mkdir(parents=True)
    (folder / "masks").mkdir()
    rng = np.random.default_rng(0)
    for i in range(count):
        x = int(rng.integers(30, 90))
        vessel = np.zeros((96, 128), bool)
        vessel[:, x - 12 : x + 12] = True
        robot = np.zeros_like(vessel)
        robot[:60, x - 2 : x + 2] = True
        image = np.full((96, 128, 3), 90, np.uint8)
        image[vessel], image[robot] = 200, 10
        write_png(folder / "images" / f"{i:03d}.png", image)
        write_mask(folder / "masks" / f"{i:03d}_vessel.png", vessel)
        write_mask(folder / "masks" / f"{i:03d}_robot.png", robot)
    return folder


def test_samples_come_back_as_they_were_written(tmp_path: Path) -> None:
    samples = find_samples([_toy_set(tmp_path / "set", 2)])
    image, vessel, robot = samples[0].load()
    assert image.shape == (96, 128, 3)
    assert vessel.sum() == 96 * 24
    assert robot.sum() == 60 * 4
    assert image[robot].max() == 10


def test_a_folder_without_labels_says_what_it_needs(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"needs images/NAME\.png"):
        find_samples([tmp_path])


def test_two_pictures_of_one_stem_would_count_twice(tmp_path: Path) -> None:
    folder = _toy_set(tmp_path / "set", 2)
    (folder / "images" / "001.jpg").write_bytes((folder / "images" / "001.png").read_bytes())
    with pytest.raises(DatasetError, match=r"001\.jpg and 001\.png have the same masks; remove one of them"):
        find_samples([folder])


def test_a_mask_of_another_size_is_named(tmp_path: Path) -> None:
    folder = _toy_set(tmp_path / "set", 1)
    write_mask(folder / "masks" / "000_robot.png", np.zeros((5, 5), bool))
    with pytest.raises(DatasetError, match=r"000_robot.png: 5x5, but its image is 128x96"):
        find_samples([folder])[0].load()


@pytest.mark.parametrize("value", [1, (0, 255, 0)])
def test_a_mask_that_means_something_else_is_named_and_not_taken_for_empty(tmp_path: Path, value: object) -> None:
    folder = _toy_set(tmp_path / "set", 1)
    labels = np.zeros((96, 128, 3), np.uint8)
    labels[20:40, 30:60] = value
    cv2.imwrite(str(folder / "masks" / "000_vessel.png"), labels)
    with pytest.raises(DatasetError, match=r"000_vessel\.png: nothing in it is brighter than 127; a mask is grey, 255 inside"):
        find_samples([folder])[0].load()
    cv2.imwrite(str(folder / "masks" / "000_vessel.png"), np.zeros((96, 128), np.uint8))
    assert not find_samples([folder])[0].load()[1].any(), "a picture without a vessel"


def test_images_without_both_masks_are_told(tmp_path: Path) -> None:
    folder = _toy_set(tmp_path / "set", 3)
    (folder / "masks" / "001_robot.png").rename(folder / "masks" / "001_robot.jpg")
    assert [path.name for path in without_masks([folder])] == ["001.png"]
    assert len(find_samples([folder])) == 2


def test_truth_skips_a_cut_last_line_and_names_any_other(tmp_path: Path) -> None:
    path = tmp_path / "truth.jsonl"
    path.write_text('{"stem": "a"}\n{"stem": "b", "x"')
    assert list(read_truth(tmp_path)) == ["a"]
    path.write_text('{"stem": "a"\n{"stem": "b"}\n')
    with pytest.raises(DatasetError, match="line 1 is damaged"):
        read_truth(tmp_path)


@pytest.mark.parametrize(
    ("entry", "named"),
    [
        ('"theta_deg": -Infinity', "theta_deg: must be a finite number, or null"),
        ('"head_xy": [1, 2, 3]', "head_xy: must be two finite numbers, or null"),
        ('"theta_deg": null, "state": "A"', "state: is said, but theta_deg is not"),
        ('"theta_deg": NaN', "theta_deg"),
        ('"theta_signed_deg": "x"', "theta_signed_deg"),
        ('"theta_deg": true', "theta_deg"),
        ('"head_xy": [1]', "head_xy"),
        ('"head_xy": [1, Infinity]', "head_xy"),
        ('"state": ["A"]', "state"),
        ('"state": "Z"', "state"),
        ('"seed": [1]', "seed"),
        ('"family": 3', "family"),
        ('"tail_xy": "there"', "tail_xy"),
        ('"state": "A", "theta_deg": null', "state"),
        ('"theta_deg": "x", "state": "A"', "theta_deg"),
    ],
)
def test_a_truth_that_makes_no_sense_is_named_by_line_and_key(tmp_path: Path, entry: str, named: str) -> None:
    path = tmp_path / "truth.jsonl"
    path.write_text('{"stem": "a", "seed": 3}\n{"stem": "b", ' + entry + "}\n")
    with pytest.raises(DatasetError, match=rf"truth.jsonl: line 2: {named}.*; mend it") as raised:
        read_truth(tmp_path)
    assert len(str(raised.value).splitlines()) == 1


def test_what_else_a_row_says_and_frames_without_a_pose_are_welcome(tmp_path: Path) -> None:
    rows = [
        {
            "stem": "a",
            "theta_deg": 3,
            "theta_signed_deg": -3.0,
            "head_xy": [1, 2.5],
            "state": "B",
            "seed": "x",
            "family": "backlit",
        },
        {"stem": "b", "theta_deg": None, "theta_signed_deg": None, "head_xy": [1, 2], "state": None, "seed": 4, "crossed": None},
        {"stem": "c", "theta_deg": 3, "state": "A"},
    ]
    (tmp_path / "truth.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert list(read_truth(tmp_path).values()) == rows


def test_looks_are_left_out_by_what_the_truth_says(tmp_path: Path) -> None:
    folder = _toy_set(tmp_path / "set", 3)
    samples = find_samples([folder])
    rows = [{"stem": sample.stem, "family": look} for sample, look in zip(samples, ("red", "x-ray", "red"), strict=True)]
    (folder / "truth.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert leave_out_looks(folder, samples, ["x-ray"]) == [samples[0], samples[2]]
    with pytest.raises(DatasetError, match="every frame is of a look that is left out"):
        leave_out_looks(folder, samples, ["x-ray", "red"])
    (folder / "truth.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows[:2]))
    with pytest.raises(DatasetError, match=f"names no family of looks for frame {samples[2].stem}"):
        leave_out_looks(folder, samples, ["x-ray"])


def test_a_row_that_is_no_object_is_damaged(tmp_path: Path) -> None:
    for text, line in (('[]\n{"stem": "a"}\n', 1), ('{"stem": "a"}\n[]\n', 2)):
        (tmp_path / "truth.jsonl").write_text(text)
        with pytest.raises(DatasetError, match=f"line {line} is damaged"):
            read_truth(tmp_path)


def test_a_pose_has_what_it_is_to_be_measured_by(tmp_path: Path) -> None:
    folder = _toy_set(tmp_path / "set", 2)
    rows = [{"stem": sample.stem, "theta_deg": 3, "state": "A", "head_xy": [1, 2]} for sample in find_samples([folder])]
    rows[1]["head_xy"] = None
    (folder / "truth.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert len(find_labelled(folder)[0]) == 2
    with pytest.raises(DatasetError, match=f"truth of frame {rows[1]['stem']} lacks head_xy; write the set again"):
        find_labelled(folder, ("theta_deg", "head_xy"))


def test_a_truth_in_another_coding_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "truth.jsonl").write_bytes(b"\xff\xfe{}")
    with pytest.raises(DatasetError, match="is not UTF-8 text"):
        read_truth(tmp_path)
    (tmp_path / "truth.jsonl").write_bytes(b'\xef\xbb\xbf{"stem": "a"}\n')
    assert list(read_truth(tmp_path)) == ["a"], "editors of Windows begin with a mark"


def test_crops_keep_image_and_labels_together(tmp_path: Path) -> None:
    image, vessel, robot = find_samples([_toy_set(tmp_path / "set", 1)])[0].load()
    rng = np.random.default_rng(3)
    for _ in range(20):
        cut, cut_vessel, cut_robot = random_crop(image, vessel, robot, (64, 80), rng)
        assert cut.shape == (64, 80, 3)
        inner = cut_robot & (
            np.roll(cut_robot, 1, 0) & np.roll(cut_robot, -1, 0) & np.roll(cut_robot, 1, 1) & np.roll(cut_robot, -1, 1)
        )
        assert not (cut_robot & ~cut_vessel)[2:-2, 2:-2].any()
        if inner.any():
            assert np.median(cut[inner]) < 60


def test_looks_and_clutter_are_pictures() -> None:
    rng = np.random.default_rng(0)
    for _ in range(30):
        picture = random_look(random_clutter((40, 50), rng), rng)
        assert picture.shape == (40, 50, 3)
        assert picture.dtype == np.uint8


def _toy_training(folder: Path, steps: int, *, end_weight: float = 0.0, **kwargs: object) -> tuple[DualUNet, int]:
    import torch

    torch.manual_seed(0)
    network = DualUNet(UNetShape((4, 8, 8, 8, 8), (4, 8, 8, 8), 1, 2))
    plan = TrainingPlan(
        steps=steps,
        batch=4,
        learning_rate=4e-2,
        warmup_steps=5,
        crop=(64, 64),
        workers=0,
        average_decay=0.9,
        threads=1,
        end_weight=end_weight,
    )
    return train(network, FrameCrops(find_samples([folder]), plan), plan, **kwargs)  # type: ignore[arg-type]


def test_strips_lie_across_the_robot_and_leave_the_rest() -> None:
    image = np.full((200, 300, 3), 128, np.uint8)
    robot = np.zeros((200, 300), bool)
    robot[98:102, 100:200] = True
    vessel = np.zeros((200, 300), bool)
    vessel[85:115, 80:220] = True
    over, across = 0, 0
    for seed in range(40):
        painted = with_strips(image, vessel, robot, np.random.default_rng(seed))
        assert painted.shape == image.shape
        assert painted.dtype == np.uint8
        changed = np.any(painted != image, axis=2)
        assert 0 < changed.sum() < 0.15 * changed.size
        assert not changed[:, :20].any()
        assert not changed[:, 280:].any()
        over += bool((changed & robot).any())
        rows = np.flatnonzero(changed[:, 100:200].any(axis=1))
        across += len(rows) > 0 and np.ptp(rows) > 20
    assert (image == 128).all()
    assert over > 30
    assert across > 30


def test_strips_need_something_to_lie_on() -> None:
    image = np.full((64, 64, 3), 128, np.uint8)
    nothing = np.zeros((64, 64), bool)
    assert (with_strips(image, nothing, nothing, np.random.default_rng(0)) == image).all()


def test_training_learns_a_toy_task_and_reports(tmp_path: Path) -> None:
    reports: list[TrainingProgress] = []
    checkpoints: list[int] = []
    last: list[int] = []
    folder = _toy_set(tmp_path / "set", 6)
    _, done = _toy_training(
        folder,
        40,
        on_progress=reports.append,
        report_every=10,
        checkpoint_every=20,
        on_checkpoint=lambda _n, s: checkpoints.append(s),
        on_last=lambda _n, s: last.append(s),
    )
    assert done == 40
    assert [r.step for r in reports] == [10, 20, 30, 40]
    assert reports[-1].loss < reports[0].loss
    assert reports[-1].vessel_dice > 1.2 * reports[0].vessel_dice
    assert reports[-1].robot_dice > 1.2 * reports[0].robot_dice
    assert checkpoints == [20]
    assert last == [40]


def test_training_repeats_bit_for_bit_and_can_be_stopped(tmp_path: Path) -> None:
    folder = _toy_set(tmp_path / "set", 4)
    first, _ = _toy_training(folder, 6)
    second, _ = _toy_training(folder, 6)
    for a, b in zip(first.state_dict().values(), second.state_dict().values(), strict=True):
        assert a.equal(b)
    stops = iter([False, False, True])
    last: list[tuple[DualUNet, int]] = []
    stopped, done = _toy_training(folder, 6, should_stop=lambda: next(stops), on_last=lambda n, s: last.append((n, s)))
    assert done == 3
    assert last == [(stopped, 3)]


@pytest.mark.parametrize("workers", [0, 1])
def test_a_frame_that_cannot_be_read_is_one_line_and_what_was_learnt_is_kept(tmp_path: Path, workers: int) -> None:
    folder = _toy_set(tmp_path / "set", 30)
    cut = folder / "images" / "029.png"
    cut.write_bytes(cut.read_bytes()[:200])
    plan = TrainingPlan(steps=30, batch=1, crop=(64, 64), workers=workers, threads=1, clutter_share=0.0)
    last: list[int] = []
    network = DualUNet(UNetShape((4, 8, 8, 8, 8), (4, 8, 8, 8), 1, 2))
    with pytest.raises(DatasetError, match=r"029\.png: cut short") as raised:
        train(network, FrameCrops(find_samples([folder]), plan), plan, on_last=lambda _n, step: last.append(step))
    assert len(str(raised.value).splitlines()) == 1
    assert str(raised.value).startswith(str(cut))
    assert len(last) == 1
    assert 0 < last[0] < 30


def test_a_reader_that_is_ended_from_outside_is_one_line_and_what_was_learnt_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loader = training.DataLoader

    def killed(*args: object, **options: object) -> Iterator[object]:
        yield from itertools.islice(loader(*args, **options), 4)
        raise RuntimeError("DataLoader worker (pid 4711) is killed by signal: Killed.")

    monkeypatch.setattr(training, "DataLoader", killed)
    last: list[int] = []
    with pytest.raises(LoaderLost, match="was ended from outside; is there too little memory") as raised:
        _toy_training(_toy_set(tmp_path / "set", 4), 9, on_last=lambda _n, step: last.append(step))
    assert last == [4]
    assert len(str(raised.value).splitlines()) == 1


def test_the_robots_ends_are_told_where_they_count_for_more(tmp_path: Path) -> None:
    samples = find_samples([_toy_set(tmp_path / "set", 1)])
    plan = TrainingPlan(steps=20, batch=1, crop=(320, 320), clutter_share=0.0, look_share=0.0, end_weight=4.0)
    crops, plain = FrameCrops(samples, plan), FrameCrops(samples, replace(plan, end_weight=0.0))
    seen = 0
    for index in range(20):
        labels = crops[index][1].numpy()
        assert plain[index][1].numpy().tolist() == labels[:2].tolist()
        if labels[2].any():
            seen += 1
            rows, columns = np.nonzero(labels[2] == labels[2].max())
            robot = np.argwhere(labels[1])
            assert np.hypot(*(robot - (rows[0], columns[0])).T).min() <= 2.0, "it is on the robot"
            assert labels[2].mean() < 55, "and nowhere else"
    assert seen > 10


@pytest.mark.parametrize("width", [1, 4, 10, 24, 40])
def test_a_robot_does_not_end_where_it_is_cut_off(width: int) -> None:
    robot = np.zeros((160, 160), bool)
    robot[60 : 60 + width, :100] = True
    near = end_nearness(robot)
    peaks, places = cv2.connectedComponents((near == 255).view(np.uint8))
    assert peaks == 2, "one end beside the background, the right one"
    assert 99 - width <= np.argwhere(places == 1)[:, 1].mean() <= 99
    robot[60 : 60 + width] = True
    assert not end_nearness(robot).any()
    robot[:] = False
    robot[60:76, 0] = True
    assert not end_nearness(robot).any(), "a sliver at the border"
    assert not end_nearness(np.zeros((160, 160), bool)).any()


def test_the_loss_is_torchs_cross_entropy_and_dice() -> None:
    import torch

    rng = torch.Generator().manual_seed(8)
    logits = 20 * torch.randn(2, 2, 8, 8, generator=rng)
    target = (torch.rand(2, 2, 8, 8, generator=rng) > 0.6).float()
    probability = torch.sigmoid(logits)

    def dice(axes: tuple[int, ...], room: float) -> torch.Tensor:
        return (2 * (probability * target).sum(dim=axes) + room) / ((probability + target).sum(dim=axes) + room)

    entropy = torch.nn.functional.binary_cross_entropy_with_logits(logits, target, reduction="none").mean(dim=(0, 2, 3))
    expected = entropy * torch.tensor([1.0, 5.0]) + 1 - 0.5 * (dice((0, 2, 3), 1) + dice((2, 3), 50).mean(dim=0))
    loss, plain = loss_of(logits, target, robot_weight=1.5)
    torch.testing.assert_close(loss, (expected * torch.tensor([1.0, 1.5])).sum())
    torch.testing.assert_close(plain, dice((0, 2, 3), 1))


def test_what_is_wrong_near_an_end_costs_more() -> None:
    import torch

    target = torch.zeros(1, 3, 64, 64)
    target[0, 1, 28:36, 8:40] = 1
    target[0, 2, 20:44, 28:52] = 1
    right = torch.where(target[:, :2] > 0, 6.0, -6.0)
    at_the_end, elsewhere = right.clone(), right.clone()
    at_the_end[0, 1, 28:36, 36:40] *= -1
    elsewhere[0, 1, 28:36, 8:12] *= -1
    plain = [float(loss_of(wrong, target[:, :2], 1.5)[0]) for wrong in (right, at_the_end, elsewhere)]
    unweighted = [float(loss_of(wrong, target, 1.5)[0]) for wrong in (right, at_the_end, elsewhere)]
    weighted = [float(loss_of(wrong, target, 1.5, 4.0)[0]) for wrong in (right, at_the_end, elsewhere)]
    assert unweighted == pytest.approx(plain)
    assert plain[1] == pytest.approx(plain[2])
    assert weighted[1] - weighted[0] > 2 * (weighted[2] - weighted[0])
    for wrong in (right, at_the_end, elsewhere):
        assert loss_of(wrong, target, 1.5, 4.0)[1].equal(loss_of(wrong, target, 1.5)[1]), "what is told is the plain Dice"


def test_training_weighs_the_ends_when_it_is_asked_to(tmp_path: Path) -> None:
    folder = _toy_set(tmp_path / "set", 4)
    plain, _ = _toy_training(folder, 4)
    weighted, _ = _toy_training(folder, 4, end_weight=4.0)
    assert not all(a.equal(b) for a, b in zip(plain.state_dict().values(), weighted.state_dict().values(), strict=True))


def test_orthogonalised_directions_have_singular_values_near_one() -> None:
    import torch

    torch.manual_seed(0)
    for shape in ((8, 40), (40, 8), (16, 16)):
        # Far from orthogonal to begin with: the first singular value is a hundred times the last.
        matrix = torch.randn(shape) * torch.logspace(0, -1, shape[1])
        values = torch.linalg.svdvals(orthogonalised(matrix))
        assert float(values.max()) < 1.3
        assert float(values.max() / values.min()) < 2.5


def test_gathered_rounds_are_the_newton_schulz_iteration() -> None:
    import torch

    torch.manual_seed(0)
    for shape in ((12, 60), (60, 12)):
        # Nearly of rank three, as directions are late in training.
        matrix = torch.randn(shape[0], 3) @ torch.randn(3, shape[1]) + 1e-3 * torch.randn(shape)
        x = (matrix if shape[0] < shape[1] else matrix.T) / matrix.norm()
        for _ in range(5):
            gram = x @ x.T
            x = 3.4445 * x + (-4.7750 * gram + 2.0315 * gram @ gram) @ x
        expected = x if shape[0] < shape[1] else x.T
        assert float((orthogonalised(matrix) - expected).norm() / expected.norm()) < 1e-3


@pytest.mark.parametrize(
    ("able", "expected"),
    [({}, False), ({"avx512_f": True}, False), ({"avx512_bf16": True}, True), ({"amx_bf16": True, "avx512_bf16": False}, True)],
)
def test_bf16_is_used_only_where_it_is_native(monkeypatch: pytest.MonkeyPatch, able: dict[str, bool], expected: bool) -> None:
    import torch

    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: able)
    assert computes_in_bf16(torch.device("cpu")) is expected
    assert computes_in_bf16(torch.device("cuda"))


def test_the_kernels_go_to_muon_and_the_rest_to_adamw() -> None:
    network = DualUNet(UNetShape((4, 8, 8, 8, 8), (4, 8, 8, 8), 1, 2))
    muon, adamw = make_optimizers(network, 1e-2, 1e-4)
    sizes = [sum(p.numel() for group in o.param_groups for p in group["params"]) for o in (muon, adamw)]
    assert sum(sizes) == sum(p.numel() for p in network.parameters())
    assert all(p.ndim == 4 and p.shape[2:] == (3, 3) for group in muon.param_groups for p in group["params"])


def test_masks_are_readable_pictures(tmp_path: Path) -> None:
    write_mask(tmp_path / "m.png", np.eye(4, dtype=bool))
    assert read_image(tmp_path / "m.png")[:, :, 0].tolist() == (np.eye(4) * 255).tolist()


def test_a_picture_is_written_as_a_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "m.png"
    write_mask(path, np.eye(4, dtype=bool))
    before = path.read_bytes()

    def full(self: Path, _: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self))

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match=r"m\.png"):
        write_mask(path, np.zeros((4, 4), bool))
    assert {one: one.read_bytes() for one in tmp_path.iterdir()} == {path: before}


def test_an_unwritable_place_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="none"):
        write_mask(tmp_path / "none" / "m.png", np.eye(4, dtype=bool))


def test_frames_are_trained_on_at_working_size(tmp_path: Path) -> None:
    sample = find_samples([_toy_set(tmp_path / "set", 1)])[0]
    image, vessel, robot = sample.load(640)
    assert image.shape == (480, 640, 3)
    assert vessel.shape == robot.shape == (480, 640)
    assert vessel.sum() == pytest.approx(96 * 24 * 25, rel=0.03)


def test_hard_frames_are_shown_more_often(tmp_path: Path) -> None:
    samples = find_samples([_toy_set(tmp_path / "set", 4)])
    plan = TrainingPlan(steps=100, batch=4, crop=(64, 64), clutter_share=0.0, look_share=0.0, focus_share=0.5)
    crops = FrameCrops(samples, plan, np.array([0.01, 0.01, 0.01, 0.97]))
    drawn: list[str] = []
    frame = crops._kept.frame

    def watched(sample: Sample) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        drawn.append(sample.stem)
        return frame(sample)

    crops._kept.frame = watched  # type: ignore[method-assign]
    for index in range(400):
        crops[index]
    # Half evenly over four frames, half nearly always the hard one: 1/8 + 0.49.
    assert drawn.count(samples[3].stem) / 400 == pytest.approx(0.61, abs=0.06)


def test_difficulty_is_what_a_model_loses(tmp_path: Path) -> None:
    from core.evaluation.accuracy import difficulty

    sample = find_samples([_toy_set(tmp_path / "set", 1)])[0]
    _, vessel, robot = sample.load(640)

    def perfect(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return vessel.astype(np.float32), robot.astype(np.float32)

    def blind(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return vessel.astype(np.float32), np.zeros(robot.shape, np.float32)

    assert difficulty(sample, perfect) == pytest.approx(0.02)  # type: ignore[arg-type]
    assert difficulty(sample, blind) == pytest.approx(1.0)  # type: ignore[arg-type]
