"""The training loop on a toy task, its loss and its optimizers."""

import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from core.learning import training
from core.learning.augmentation import FrameCrops
from core.learning.dataset import DatasetError, find_samples, write_mask
from core.learning.training import LoaderLost, TrainingProgress, computes_in_bf16, loss_of, orthogonalised, train
from core.learning.training_plan import TrainingPlan
from core.perception.unet import DualUNet, UNetShape
from tests.core.learning.toy_set import toy_set


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
    return train(network, FrameCrops(find_samples([folder]), plan), plan, **kwargs)


def test_training_learns_a_toy_task_and_reports(tmp_path: Path) -> None:
    reports: list[TrainingProgress] = []
    checkpoints: list[int] = []
    last: list[int] = []
    folder = toy_set(tmp_path / "set", 6)
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
    folder = toy_set(tmp_path / "set", 4)
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
    folder = toy_set(tmp_path / "set", 30)
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
        _toy_training(toy_set(tmp_path / "set", 4), 9, on_last=lambda _n, step: last.append(step))
    assert last == [4]
    assert len(str(raised.value).splitlines()) == 1


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
    folder = toy_set(tmp_path / "set", 4)
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


@pytest.mark.parametrize(
    ("able", "expected"),
    [({}, False), ({"avx512_f": True}, False), ({"avx512_bf16": True}, True), ({"amx_bf16": True, "avx512_bf16": False}, True)],
)
def test_bf16_is_used_only_where_it_is_native(monkeypatch: pytest.MonkeyPatch, able: dict[str, bool], expected: bool) -> None:
    import torch

    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: able)
    assert computes_in_bf16(torch.device("cpu")) is expected
    assert computes_in_bf16(torch.device("cuda"))


@pytest.mark.parametrize("end_weight", [0.0, 4.0])
def test_pixels_whose_label_is_unsure_do_not_count_for_the_robot(end_weight: float) -> None:
    import torch

    target = torch.zeros(1, 4, 64, 64)
    target[0, 0, 20:44, :] = 1
    target[0, 1, 28:36, 8:40] = 1
    target[0, 2, 20:44, 28:52] = 1
    target[0, 3, 24:40, 30:50] = 1
    right = torch.where(target[:, :2] > 0, 6.0, -6.0)
    unsure, sure, vessel = right.clone(), right.clone(), right.clone()
    unsure[0, 1, 28:36, 32:48] *= -1
    sure[0, 1, 28:36, 8:12] *= -1
    vessel[0, 0, 28:36, 32:48] *= -1
    losses = [loss_of(wrong, target, 1.5, end_weight) for wrong in (right, unsure, sure, vessel)]
    assert losses[1][0].item() == pytest.approx(losses[0][0].item(), rel=1e-4)
    assert losses[1][1].tolist() == pytest.approx(losses[0][1].tolist(), abs=1e-3)
    assert losses[2][0] > losses[0][0] + 0.05
    assert losses[3][0] > losses[0][0] + 0.05, "the vessel's label is sure there"


def test_doubtful_masks_are_found_and_go_into_the_labels(tmp_path: Path) -> None:
    folder = toy_set(tmp_path / "set", 4)
    doubtful = np.zeros((96, 128), bool)
    doubtful[:, 64:] = True
    write_mask(folder / "masks" / "001_doubtful.png", doubtful)
    samples = find_samples([folder])
    assert [sample.doubtful is not None for sample in samples] == [False, True, False, False]
    assert (samples[1].load_doubtful((96, 128)) == doubtful).all()
    assert samples[1].load_doubtful((48, 64)).sum() == 48 * 32
    plan = TrainingPlan(steps=4, batch=1, crop=(64, 64), workers=0, clutter_share=0.0)
    crops = FrameCrops(samples, plan)
    labels = {crops.place_of(index): crops[index][1] for index in range(4)}
    assert all(label.shape == (4, 64, 64) for label in labels.values()), "all crops of a batch have the same planes"
    assert {place for place, label in labels.items() if label[3].any()} <= {1}
    assert FrameCrops(samples[2:], plan)[0][1].shape == (2, 64, 64)


def test_a_training_with_a_time_ends_in_time_with_its_rate_come_down(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = itertools.count()
    monkeypatch.setattr(training.time, "monotonic", lambda: float(next(clock)))
    network = DualUNet(UNetShape((4, 8, 8, 8, 8), (4, 8, 8, 8), 1, 2))
    plan = TrainingPlan(steps=1000, batch=1, crop=(64, 64), workers=0, warmup_steps=2, threads=1, seconds=30.0)
    reports: list[TrainingProgress] = []
    crops = FrameCrops(find_samples([toy_set(tmp_path / "set", 4)]), plan)
    _, done = train(network, crops, plan, on_progress=reports.append, report_every=4)
    assert 8 <= done <= 20
    assert reports[-1].step == reports[-1].steps == done
    assert 0.5 * done < reports[0].steps < 3 * done
    assert plan.learning_rate_at(10, 15.0) == pytest.approx(0.5 * plan.learning_rate, rel=0.02)
    assert plan.learning_rate_at(10, 30.0) == pytest.approx(0.01 * plan.learning_rate)
    assert plan.share_at(500, 3.0) == 0.5
