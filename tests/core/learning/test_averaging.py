"""The mean of models: weight by weight, whole or not at all."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from core.config.models import SegmentationConfig
from core.learning.averaging import average_models
from core.learning.model_writer import save_model, save_with_second_look
from core.perception.inference import TorchSegmenter, open_second_look, open_segmenter
from core.perception.model_file import (
    INFO,
    ONNX_INT8,
    SECOND_LOOK,
    WEIGHTS,
    ModelError,
    load_network,
    read_model_info,
    second_look_of,
    sha256_of,
    trained_without,
)
from core.perception.unet import DualUNet, UNetShape

TINY = UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2)
WIDER = UNetShape((8, 8, 8, 8, 8), (4, 4, 4, 4), 1, 2)
PICTURE = np.random.default_rng(3).integers(0, 255, (64, 96, 3), np.uint8)


def network(seed: int, shape: UNetShape = TINY) -> DualUNet:
    """With other weights and another normalisation for every seed."""
    torch.manual_seed(seed)
    made = DualUNet(shape)
    for tensor in made.state_dict().values():
        if tensor.is_floating_point():
            tensor.add_(0.1 * torch.rand_like(tensor))
    return made.eval()


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two, each with an eight-bit copy and a second look; the first has never seen two looks, the second one of these."""
    made = tmp_path_factory.mktemp("models")
    folders = [made / "one", made / "other"]
    for seed, (folder, without) in enumerate(zip(folders, (["subtraction", "backlit"], ["backlit"]), strict=True)):
        save_model(network(seed), folder, training={"without": without}, figures={}, examples=[PICTURE])
        near = network(10 + seed, replace(TINY, inputs=5))
        save_with_second_look(folder, near, folder, training={"without": without}, figures={})
    return folders


@pytest.fixture
def models(written: list[Path], tmp_path: Path) -> list[Path]:
    """Copies of them, to do with as a test likes."""
    return [Path(shutil.copytree(folder, tmp_path / folder.name)) for folder in written]


def contents(folder: Path) -> dict[str, bytes]:
    """Every file in it, byte for byte."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def weights(folder: Path) -> dict[str, torch.Tensor]:
    return load_network(folder)[0].state_dict()


def test_every_weight_is_the_mean_in_both_looks(models: list[Path], tmp_path: Path) -> None:
    one, other = models
    average_models([one, other, other], tmp_path / "mean")
    for part in ("", SECOND_LOOK):
        first, second, mean = (weights(folder / part) for folder in (one, other, tmp_path / "mean"))
        for name, tensor in mean.items():
            if tensor.is_floating_point():
                torch.testing.assert_close(tensor, (first[name] + 2 * second[name]) / 3, rtol=2**-11, atol=1e-7)
                assert not torch.equal(first[name], second[name]), "what would a mean of the same tell"
    assert second_look_of(tmp_path / "mean") == tmp_path / "mean" / SECOND_LOOK


def test_it_opens_in_fp32_and_says_whose_mean_it_is(models: list[Path], tmp_path: Path) -> None:
    average_models(models, tmp_path / "mean")
    info = read_model_info(tmp_path / "mean")
    for part in ("", SECOND_LOOK):
        hashes = [sha256_of(folder / part / WEIGHTS) for folder in models]
        assert read_model_info(tmp_path / "mean" / part).training["mean_of"] == hashes
    assert trained_without(tmp_path / "mean") == ("backlit",), "which neither of them has seen"
    assert (info.calibration, info.familiarity, info.onnx_int8_sha256, info.figures) == (None, None, None, {})
    assert not (tmp_path / "mean" / ONNX_INT8).exists()
    config = SegmentationConfig(model=str(tmp_path / "mean"), threads=1)
    asked = (TorchSegmenter(tmp_path / "mean", 1), TorchSegmenter(models[0], 1))
    for found, expected, of_one in zip(open_segmenter(config)(PICTURE), *(segment(PICTURE) for segment in asked), strict=True):
        assert np.abs(found - expected).mean() < 0.003, "what perception runs is the mean, too"
        assert np.abs(found - of_one).mean() > 0.03
    assert open_second_look(config) is not None


def test_a_look_that_the_second_look_has_seen_is_not_left_out(models: list[Path], tmp_path: Path) -> None:
    near = network(20, replace(TINY, inputs=5))
    save_with_second_look(models[0], near, tmp_path / "seen", training={"without": ["subtraction"]}, figures={})
    assert trained_without(models[0]) == ("subtraction", "backlit")
    assert trained_without(tmp_path / "seen") == ("subtraction",)
    save_with_second_look(models[0], near, tmp_path / "all", training={}, figures={})
    assert trained_without(tmp_path / "all") == ()


def test_the_mean_of_equals_is_the_same_to_the_last_bit(models: list[Path], tmp_path: Path) -> None:
    shutil.copytree(models[0], tmp_path / "copy")
    average_models([models[0], tmp_path / "copy", models[0]], tmp_path / "mean")
    assert sha256_of(tmp_path / "mean" / WEIGHTS) == sha256_of(models[0] / WEIGHTS)


def test_what_does_not_fit_together_is_one_clear_error_and_leaves_nothing(models: list[Path], tmp_path: Path) -> None:
    wider = tmp_path / "wider"
    save_model(network(5, WIDER), wider, training={}, figures={})
    bare = tmp_path / "bare"
    save_model(network(6), bare, training={}, figures={})
    torn = Path(shutil.copytree(models[1], tmp_path / "torn"))
    (torn / WEIGHTS).write_bytes(b"torn")
    closer = tmp_path / "closer"
    save_with_second_look(
        models[1], network(7, UNetShape((8, 8, 8, 8, 8), (4, 4, 4, 4), 1, 2, inputs=5)), closer, training={}, figures={}
    )
    before = contents(tmp_path)
    for others, told in (
        ([bare, wider], "wider: has another shape than"),
        ([models[0], closer], "second_look: has another shape than"),
        ([models[0], bare], "bare: has no second look"),
        ([models[0], torn], "restore the model folder"),
    ):
        with pytest.raises(ModelError, match=told):
            average_models(others, tmp_path / "mean")
        assert contents(tmp_path) == before


@pytest.mark.parametrize("told", [5, "backlit", [{}], None])
def test_a_strange_word_about_the_training_is_no_reason_to_break(models: list[Path], tmp_path: Path, told: object) -> None:
    info = json.loads((models[1] / INFO).read_text())
    info["training"]["without"] = told
    (models[1] / INFO).write_text(json.dumps(info))
    average_models(models, tmp_path / "mean")
    assert trained_without(tmp_path / "mean") == ()


def test_a_folder_that_is_no_model_is_never_replaced(models: list[Path], tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    with pytest.raises(ModelError, match="is not a model"):
        average_models(models, tmp_path / "mine")
    assert (tmp_path / "mine" / "notes.txt").read_text() == "mine"
    assert json.loads((models[0] / INFO).read_text())["name"] == "one"
