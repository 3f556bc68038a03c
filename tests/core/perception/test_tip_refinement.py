"""The second look: where it goes, what it changes, and how its network is taught and kept."""

import json
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from core.config.models import SegmentationConfig
from core.learning.augmentation import PriorViews, TipCrops
from core.learning.dataset import Sample, write_mask, write_png
from core.learning.model_writer import save_model, save_with_second_look
from core.learning.training_plan import TrainingPlan
from core.perception.inference import OpenVinoSegmenter, open_second_look
from core.perception.model_file import INFO, ONNX, SECOND_LOOK, ModelError, read_model_info
from core.perception.segmentation import MARGIN_PX, Segmenter, window_around
from core.perception.tip_refinement import MAX_PASSES, WINDOW_PX, Planes, TipRefinement, find_tips, stack_planes
from core.perception.unet import DualUNet, UNetShape, with_prior_planes

SIZE = (480, 640)
TINY = UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2)


def bar(start: int, end: int, row: int = 240) -> np.ndarray:
    """A robot's probability: a horizontal bar 9 px wide."""
    robot = np.zeros(SIZE, np.float32)
    robot[row - 4 : row + 5, start:end] = 0.9
    return robot


class First(Segmenter):
    """A first look that always sees the same."""

    engine = "drawn"

    def __init__(self, robot: np.ndarray, vessel: np.ndarray | None = None) -> None:
        self.robot = robot
        self.vessel = np.full(SIZE, 0.25, np.float32) if vessel is None else vessel

    def __call__(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.vessel, self.robot


class Near(Segmenter):
    """A second network that knows the truth by heart, from the picture's red plane, and counts its looks."""

    engine = "drawn"

    def __init__(self) -> None:
        self.shown: list[Planes] = []

    def __call__(self, planes: Planes, /) -> tuple[np.ndarray, np.ndarray]:
        self.shown.append(planes.copy())
        return np.full(planes.shape[:2], 0.75, np.float32), (planes[:, :, 0] > 0).astype(np.float32)


class Answering(Segmenter):
    """A network given by a function."""

    def __init__(self, answer: Callable[[Planes], tuple[np.ndarray, np.ndarray]]) -> None:
        self.answer = answer

    def __call__(self, image: Planes) -> tuple[np.ndarray, np.ndarray]:
        return self.answer(image)


def picture_of(robot: np.ndarray) -> np.ndarray:
    image = np.zeros((*SIZE, 3), np.uint8)
    image[:, :, 0] = np.where(robot > 0.5, 200, 0)
    return image


def test_ends_inside_the_picture_are_looked_at() -> None:
    robot = bar(0, 300)
    ((x, y),) = find_tips(robot)
    assert 285 <= x < 300
    assert abs(y - 240) <= 1


def test_the_largest_piece_comes_first_and_specks_do_not_count() -> None:
    robot = np.maximum(bar(0, 300), bar(400, 440, row=100))
    robot[400:403, 400:403] = 0.9
    places = find_tips(robot)
    assert [round(y / 10) for _, y in places] == [24, 10, 10]


def test_where_nothing_is_a_robot_the_likeliest_place_is_looked_at() -> None:
    faint = bar(200, 260) * 0.4
    ((x, y),) = find_tips(faint)
    assert 200 <= x < 260
    assert abs(y - 240) <= 4
    assert find_tips(faint * 0.1) == []


def test_a_tip_that_was_missed_is_found_and_followed() -> None:
    truth, seen = bar(0, 420), bar(0, 300)
    near = Near()
    vessel, robot = TipRefinement(First(seen), near)(picture_of(truth))
    # The first window reaches to 294 + 80 px; the end of what it found there is looked at in turn.
    assert len(near.shown) == 2
    assert np.array_equal(robot > 0.5, truth > 0.5)
    assert vessel[240, 350] == pytest.approx(0.75)
    assert vessel[240, 20] == pytest.approx(0.25)
    assert np.array_equal(seen, bar(0, 300)), "what the first look saw is somebody else's"


def test_what_the_first_look_imagined_is_taken_away() -> None:
    _, robot = TipRefinement(First(bar(0, 300)), Near())(picture_of(bar(0, 270)))
    assert np.array_equal(robot > 0.5, bar(0, 270) > 0.5)


def test_the_network_is_shown_the_picture_and_the_first_look() -> None:
    near = Near()
    TipRefinement(First(bar(0, 300)), near)(picture_of(bar(0, 300)))
    (shown,) = near.shown
    assert shown.shape == (WINDOW_PX, WINDOW_PX, 5)
    assert set(np.unique(shown[:, :, 4])) == {0, 230}
    assert set(np.unique(shown[:, :, 3])) == {64}


def test_where_the_vessel_is_known_the_robot_alone_is_looked_at() -> None:
    class Alone(Near):
        def segment_robots(self, images: list[Planes]) -> list[np.ndarray]:
            return [self(planes)[1] for planes in images]

    near, true, known = Alone(), bar(0, 320), np.full(SIZE, 0.5, np.float32)
    near_both = Near()
    segment = TipRefinement(First(bar(0, 300)), near)
    found = segment.segment_robot_beside(known, picture_of(true))
    assert (found[240, 250:318] > 0.5).all()
    assert not (found[240, 324:] > 0.5).any()
    assert {int(shown[0, 0, 3]) for shown in near.shown} == {128}, "it is shown the vessel that is known"
    np.testing.assert_array_equal(TipRefinement(First(bar(0, 300)), near_both).segment_robot_beside(known, picture_of(true)), found)
    assert (known == 0.5).all(), "which stays what it was"
    once = len(near.shown)
    near.shown.clear()
    often = TipRefinement(First(bar(0, 300)), near, passes=4).segment_robot_beside(known, picture_of(true))
    assert len(near.shown) == 4 * once, "as often as the confidence was calibrated with"
    assert (often[240, 250:316] > 0.5).all()


def test_the_second_look_fades_out_at_its_edges_but_not_at_the_pictures() -> None:
    vessel, _ = TipRefinement(First(bar(0, 100, row=20)), Near())(picture_of(bar(0, 100, row=20)))
    x, y, width, height = window_around((95, 20), (640, 480), WINDOW_PX)
    assert y == 0
    assert vessel[0, x + width // 2] == pytest.approx(0.75)
    column = vessel[:, x + width // 2]
    steps = np.diff(column[height - MARGIN_PX - 2 : height + 2])
    assert float(np.abs(steps).max()) <= 0.5 / MARGIN_PX + 1e-6
    assert column[height] == pytest.approx(0.25)


# ---- its network


def test_a_network_that_is_given_a_first_look_says_at_first_what_it_said() -> None:
    torch.manual_seed(2)
    network = DualUNet(TINY).eval()
    wider = with_prior_planes(network)
    picture = torch.rand(1, 3, 64, 64)
    with torch.no_grad():
        expected = network(picture)
        for first in (torch.zeros(1, 2, 64, 64), torch.ones(1, 2, 64, 64)):
            torch.testing.assert_close(wider(torch.cat([picture, first], dim=1)), expected)
    wider.train()(torch.rand(2, 5, 64, 64)).square().mean().backward()
    gradient = wider.encoder[0][0].weight.grad
    assert float(gradient[:, 12:].abs().sum()) > 0, "it can learn to mind it"
    with pytest.raises(ValueError, match="already"):
        with_prior_planes(wider)


def _samples(folder: Path, count: int = 2) -> list[Sample]:
    samples = []
    (folder / "images").mkdir(parents=True)
    (folder / "masks").mkdir()
    for number in range(count):
        robot = bar(0, 250 + 60 * number) > 0.5
        image = np.full((*SIZE, 3), 180, np.uint8)
        image[robot] = 20
        image[:, :, 2] += (np.arange(640) // 8).astype(np.uint8)  # no window looks like another
        names = [folder / "images" / f"{number}.png", *(folder / "masks" / f"{number}_{part}.png" for part in ("vessel", "robot"))]
        write_png(names[0], image)
        write_mask(names[1], bar(0, 500) > 0.5)
        write_mask(names[2], robot)
        samples.append(Sample(str(number), *names))
    return samples


def sees(robot: np.ndarray) -> First:
    """A first look that knows the samples' vessel."""
    return First(robot, bar(0, 500))


def test_windows_are_shown_with_their_labels_and_the_first_look(tmp_path: Path) -> None:
    samples = _samples(tmp_path)
    looks = [PriorViews.at(sample, sees(bar(0, 230))) for sample in samples]
    plan = TrainingPlan(steps=20, batch=4, crop=(WINDOW_PX, WINDOW_PX), look_share=0.0, seed=3)
    crops = TipCrops(samples, looks, plan)
    assert len(crops) == 80
    has_end = 0
    for index in range(40):
        planes, target = (part.numpy() for part in crops[index])
        assert planes.shape == (5, WINDOW_PX, WINDOW_PX)
        assert np.array_equal(planes[0] < 100, target[1] > 0), "picture and label were turned alike"
        has_end += bool((planes[4] > 127).any())
    assert has_end > 30
    again = pickle.loads(pickle.dumps(TipCrops(samples, looks, plan)))  # as it comes to a loader that was spawned
    assert all(one.equal(other) for one, other in zip(crops[7], again[7], strict=True))


def test_half_of_the_windows_show_what_the_second_look_mended(tmp_path: Path) -> None:
    def near(planes: Planes, /) -> tuple[np.ndarray, np.ndarray]:
        return planes[:, :, 3] / np.float32(255), (planes[:, :, 0] < 100).astype(np.float32)

    sample = _samples(tmp_path, 1)[0]
    first = sees(bar(0, 210))
    looks = PriorViews.at(sample, first, Answering(near))
    assert looks.first == PriorViews.at(sample, first).last
    ends = [max(x for x, _ in seen.places) for seen in (looks.first, looks.last)]
    assert ends[0] == pytest.approx(209, abs=3) and ends[1] == pytest.approx(249, abs=3)
    crops = TipCrops([sample], [looks], TrainingPlan(steps=10, batch=4, look_share=0.0))
    shown = [tuple(part.numpy() for part in crops[index]) for index in range(40)]
    mended = sum(bool(((planes[4] > 127) == (target[1] > 0)).all()) for planes, target in shown)
    assert 8 < mended < 32, "half of the windows come with what was seen in the end"


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("models") / "near"
    torch.manual_seed(0)
    network = DualUNet(TINY).eval()
    images = [np.random.default_rng(0).integers(0, 256, (64, 96, 3), np.uint8)]
    planes = [np.random.default_rng(0).integers(0, 256, (160, 160, 5), np.uint8)]
    base = folder.with_name("base")
    save_model(network, base, training={}, figures={"robot_dice": 0.5}, examples=images)
    save_with_second_look(base, with_prior_planes(network), folder, training={"steps_done": 3}, figures={}, examples=planes)
    return folder


def test_a_model_is_kept_with_its_second_look(model: Path) -> None:
    info = read_model_info(model)
    assert (info.name, info.figures, info.calibration) == ("near", {}, None), "what was measured without it is not true of it"
    assert (model / ONNX).read_bytes() == (model.with_name("base") / ONNX).read_bytes()
    second = read_model_info(model / SECOND_LOOK)
    assert second.training == {"steps_done": 3}
    assert second.shape["inputs"] == 5


def test_what_was_held_out_is_still_known_after_the_second_look(model: Path, tmp_path: Path) -> None:
    """Dice on held-out frames is the first network's own, and that one stays; the set's figures were of another model."""
    network, held_out = DualUNet(TINY).eval(), {"held_out": True, "robot_dice": 0.7}
    save_model(network, tmp_path / "tuned", training={}, figures=held_out)
    save_with_second_look(tmp_path / "tuned", with_prior_planes(network), tmp_path / "tuned", training={}, figures={})
    assert read_model_info(tmp_path / "tuned").figures == held_out
    assert open_second_look(SegmentationConfig(model=str(tmp_path / "tuned"), precision="fp32")) is not None


def test_a_second_look_that_is_followed_by_another_counts_half() -> None:
    """The first time it finds a piece of the tip, the second time all of it: what only one of them saw is seen by half."""

    def near(planes: Planes, /) -> tuple[np.ndarray, np.ndarray]:
        shown.append(planes.copy())
        reach = 40 if len(shown) == 1 else 70
        robot = np.zeros(planes.shape[:2], np.float32)
        robot[76:85, : 80 + reach] = 1.0
        return np.full(planes.shape[:2], 0.5, np.float32), robot

    shown: list[Planes] = []
    vessel, robot = TipRefinement(First(bar(0, 300)), Answering(near), passes=2)(picture_of(bar(0, 370)))
    assert [int(planes[:, :, 4].max()) for planes in shown[:2]] == [230, 255], "the second time it is shown what it found itself"
    assert vessel[240, 300] == pytest.approx(0.5, abs=0.01)
    assert robot[240, 315] == pytest.approx(1.0, abs=0.01)
    assert robot[240, 360] == pytest.approx(0.5, abs=0.01)


def test_later_looks_are_through_windows_beside_each_other_and_the_mean_counts() -> None:
    """The network's answer depends on where its window begins: the mean of four looks lies between."""
    picture = picture_of(bar(0, 300))
    picture[:, :, 1], picture[:, :, 2] = np.arange(640) // 4, (np.arange(480) // 4)[:, None]

    def near(planes: Planes, /) -> tuple[np.ndarray, np.ndarray]:
        shown.append((4 * int(planes[0, 0, 1]), 4 * int(planes[0, 0, 2])))
        said = 0.8 if len(shown) == 1 else 0.4
        return np.full(planes.shape[:2], said, np.float32), (planes[:, :, 0] > 0).astype(np.float32)

    shown: list[tuple[int, int]] = []
    segmenter = TipRefinement(First(bar(0, 300)), Answering(near), passes=MAX_PASSES)
    vessel, _ = segmenter(picture)
    begins = np.array(shown) - shown[0]
    assert begins.tolist()[:2] == [[0, 0], [0, 0]]
    assert np.abs(begins[2:] - [[14, 10], [-14, -10]]).max() <= 4
    assert vessel[240, 298] == pytest.approx((0.8 + 3 * 0.4) / 4, abs=0.01)
    assert segmenter.engine == "drawn, second look 4 times"


@pytest.mark.parametrize("device", ["openvino", "torch"])
@pytest.mark.parametrize("precision", ["fp32", "int8"])
def test_every_engine_can_look_again(model: Path, device: str, precision: str) -> None:
    config = SegmentationConfig.model_validate({"model": str(model), "device": device, "precision": precision, "threads": 1})
    near = open_second_look(config)
    planes = stack_planes(np.full((160, 160, 3), 90, np.uint8), np.zeros((160, 160), np.float32), np.ones((160, 160), np.float32))
    vessel, robot = near(planes)
    assert vessel.shape == robot.shape == (160, 160)
    first = OpenVinoSegmenter(model, 1, "fp32")(planes[:, :, :3])
    assert np.abs(robot - first[1]).max() < 0.05, "untaught, it says what the first look says"


def test_it_can_be_left_out_and_need_not_be_there(model: Path) -> None:
    assert open_second_look(SegmentationConfig(model=str(model), second_look=False)) is None
    assert open_second_look(SegmentationConfig(model=str(model.with_name("base")))) is None


def test_a_damaged_second_look_is_said(model: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(model, tmp_path / "copy")
    data = bytearray((copy / SECOND_LOOK / "network.onnx").read_bytes())
    data[len(data) // 2] ^= 1
    (copy / SECOND_LOOK / "network.onnx").write_bytes(data)
    with pytest.raises(ModelError, match=r"second_look.*damaged"):
        open_second_look(SegmentationConfig(model=str(copy), precision="fp32"))
    (copy / SECOND_LOOK / INFO).write_text("{}")
    with pytest.raises(ModelError, match=r"second_look.*damaged"):
        open_second_look(SegmentationConfig(model=str(copy)))


def test_a_model_that_has_lost_its_second_look_is_not_taken_for_whole(model: Path, tmp_path: Path) -> None:
    """Without it a picture is understood far worse, and what its confidence means was learnt with it."""
    copy = shutil.copytree(model, tmp_path / "copy")
    shutil.rmtree(copy / SECOND_LOOK)
    with pytest.raises(ModelError, match=r"second_look.*missing.*restore"):
        open_second_look(SegmentationConfig(model=str(copy)))
    assert open_second_look(SegmentationConfig(model=str(copy), second_look=False)) is None, "nobody asks for it"


def test_a_second_look_of_another_model_is_refused(model: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(model, tmp_path / "copy")
    torch.manual_seed(7)
    save_model(with_prior_planes(DualUNet(TINY).eval()), copy / SECOND_LOOK, training={}, figures={})
    with pytest.raises(ModelError, match=r"second_look.*another model"):
        open_second_look(SegmentationConfig(model=str(copy)))


def test_a_model_from_before_it_was_noted_keeps_its_second_look(model: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(model, tmp_path / "copy")
    info = json.loads((copy / INFO).read_text())
    del info["second_look_sha256"]
    (copy / INFO).write_text(json.dumps(info))
    assert open_second_look(SegmentationConfig(model=str(copy))) is not None
