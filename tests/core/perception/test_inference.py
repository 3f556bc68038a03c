"""The inference engines as the process sees them; what they compute is tested with the pipeline and the models."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import torch

from core.learning.model_writer import save_model
from core.perception.inference import OpenVinoSegmenter, TorchSegmenter
from core.perception.segmentation import OrientationAverage, Segmenter
from core.perception.unet import DualUNet, UNetShape

TWO_MODELS = """
import gc, os, signal
import numpy as np
from core.config.models import SegmentationConfig
from core.perception.inference import open_segmenter

config = SegmentationConfig(device="openvino", threads=1)
first, second = open_segmenter(config), open_segmenter(config)
for segment in (first, second):
    segment(np.zeros((64, 64, 3), np.uint8))
del segment, first
gc.collect()
del second
gc.collect()
signal.signal(signal.SIGTERM, lambda *_: print("heard"))
os.kill(os.getpid(), signal.SIGTERM)
"""


def test_a_signal_is_survived_when_models_were_opened_and_dropped() -> None:
    """OpenVINO's stack for signals is unmapped when a second one gives it back: Ctrl-C after a change of the model killed us."""
    done = subprocess.run([sys.executable, "-c", TWO_MODELS], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "heard\n"), done.stderr


def pictures() -> list[np.ndarray]:
    """An odd number of one size, which is none of whole strides."""
    rng = np.random.default_rng(6)
    return [rng.integers(0, 256, (70, 128, 3)).astype(np.uint8) for _ in range(5)]


@pytest.fixture(scope="module")
def undecided(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small model of random weights whose answers differ from place to place and from picture to picture."""
    torch.manual_seed(7)
    network = DualUNet(UNetShape((8, 8, 8, 8, 8), (8, 8, 8, 8), 1, 2))
    for decoder in (network.vessel, network.robot):
        torch.nn.init.normal_(decoder.output.weight)
        torch.nn.init.zeros_(decoder.output.bias)
    folder = tmp_path_factory.mktemp("models") / "undecided"
    save_model(network, folder, training={}, figures={}, examples=pictures())
    return folder


@pytest.mark.parametrize("precision", ["int8", "fp32"])
@pytest.mark.parametrize("turned", [False, True])
def test_what_is_seen_together_is_what_is_seen_alone(undecided: Path, precision: str, turned: bool) -> None:
    segment = OpenVinoSegmenter(undecided, 1, precision)
    looking = OrientationAverage(segment) if turned else segment
    alone = [np.stack(looking(image)) for image in pictures()]
    together = [np.stack(found) for found in looking.segment_batch(pictures())]
    assert [found.shape for found in together] == [(2, *image.shape[:2]) for image in pictures()]
    for one, other in zip(alone, together, strict=True):
        # In eight bits a value at the middle of a step may be rounded to either side.
        assert np.abs(one - other).mean() < 0.0005
    assert np.abs(alone[0] - alone[1]).mean() > 0.005, "another picture, another answer"


@pytest.mark.parametrize("engine", ["int8", "fp32", "torch"])
def test_the_robot_alone_is_the_robot_that_is_seen_beside_the_vessel(undecided: Path, engine: str) -> None:
    segment: Segmenter = TorchSegmenter(undecided, 1) if engine == "torch" else OpenVinoSegmenter(undecided, 1, engine)
    both = [segment(image)[1] for image in pictures()]
    alone = segment.segment_robots(pictures())
    assert [robot.shape for robot in alone] == [(70, 128)] * 5
    for one, other in zip(both, alone, strict=True):
        assert np.abs(one - other).mean() < 0.0005
    assert np.abs(alone[0] - alone[1]).mean() > 0.005, "another picture, another answer"
    again = segment(pictures()[0])
    assert [plane.shape for plane in again] == [(70, 128)] * 2, "and both can be had as before"


@pytest.mark.parametrize(("fold", "planes"), [(1, 3), (4, 3), (2, 5)])
def test_networks_of_all_shapes_can_leave_the_vessel_out(tmp_path: Path, fold: int, planes: int) -> None:
    torch.manual_seed(8)
    network = DualUNet(UNetShape((4, 4, 4, 4, 4), (4, 4, 4, 4), 1, fold, inputs=planes))
    torch.nn.init.normal_(network.robot.output.weight)
    image = np.random.default_rng(2).integers(0, 256, (64, 128, planes)).astype(np.uint8)
    save_model(network, tmp_path / "any", training={}, figures={}, examples=[image])
    for precision in ("int8", "fp32"):
        segment = OpenVinoSegmenter(tmp_path / "any", 1, precision)
        (alone,) = segment.segment_robots([image])
        assert segment._robot_model is not segment._model
        np.testing.assert_allclose(alone, segment(image)[1], atol=1e-6)


def test_several_threads_may_ask_one_network(undecided: Path) -> None:
    """A picture that stands is looked at again in a thread of its own, while a rig that was opened meanwhile has the network."""
    segment = OpenVinoSegmenter(undecided, 1)
    alone = [segment.segment_signed([image])[0] for image in pictures()[:3]]

    def same(picture: int) -> bool:
        found = segment.segment_signed([pictures()[picture]])[0]
        return all(np.array_equal(one, other) for one, other in zip(found, alone[picture], strict=True))

    with ThreadPoolExecutor(3) as threads:
        assert all(threads.map(same, [0, 1, 2] * 40))


def test_who_cannot_see_together_is_asked_one_by_one() -> None:
    asked = []

    class OneByOne(Segmenter):
        engine = "a test's"

        def __call__(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            asked.append(image.shape)
            return image[:, :, 0] / np.float32(255), image[:, :, 1] / np.float32(255)

    images = pictures()
    np.testing.assert_array_equal(
        OneByOne().segment_robot_beside(images[1][:, :, 2], images[0]), images[0][:, :, 1] / np.float32(255)
    )
    asked.clear()
    found = OrientationAverage(OneByOne()).segment_batch(images)
    assert len(asked) == 8 * len(images)
    for image, (vessel, robot) in zip(images, found, strict=True):
        np.testing.assert_allclose(vessel, image[:, :, 0] / 255, atol=1e-5)
        np.testing.assert_allclose(robot, image[:, :, 1] / 255, atol=1e-5)
