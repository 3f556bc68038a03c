"""Weights on disk in half precision: all files hold one network, and eight bits lose nothing by it."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from onnx import TensorProto
from safetensors.torch import load_file

from core.learning import model_writer
from core.learning.model_writer import rounded, save_model
from core.perception.inference import OpenVinoSegmenter
from core.perception.model_file import ONNX, ONNX_INT8, WEIGHTS, load_network
from core.perception.unet import DualUNet, UNetShape
from core.types import Image

SHAPE = UNetShape((8, 16, 16, 32, 32), (8, 8, 16, 16), 1, 2)


def _pictures() -> list[Image]:
    rng = np.random.default_rng(5)
    return [np.kron(rng.integers(0, 256, (8, 12, 3)), np.ones((8, 8, 1))).astype(np.uint8) for _ in range(4)]


@pytest.fixture
def network() -> DualUNet:
    torch.manual_seed(4)
    return DualUNet(SHAPE).eval()


def _save(network: DualUNet, folder: Path) -> Path:
    save_model(network, folder, training={}, figures={}, examples=_pictures())
    return folder


def test_files_hold_convolutions_in_half_precision_and_the_rest_as_it_is(network: DualUNet, tmp_path: Path) -> None:
    folder = _save(network, tmp_path / "model")
    state = network.state_dict()
    for name, tensor in load_file(folder / WEIGHTS).items():
        if state[name].dim() > 1:
            assert tensor.dtype == torch.float16
        else:
            torch.testing.assert_close(tensor, state[name], rtol=0.0, atol=0.0)
    for name in (ONNX, ONNX_INT8):
        onnx.checker.check_model(str(folder / name), full_check=True)
        large = [one for one in onnx.load(str(folder / name)).graph.initializer if len(one.dims) > 1]
        assert large
        assert all(one.data_type == TensorProto.FLOAT16 for one in large)
        assert (folder / name).stat().st_size < 0.8 * sum(4 * tensor.numel() for tensor in state.values())


def test_what_is_loaded_is_what_was_rounded_and_is_saved_again_as_it_is(network: DualUNet, tmp_path: Path) -> None:
    before = deepcopy(network.state_dict())
    folder = _save(network, tmp_path / "model")
    loaded, wanted = load_network(folder)[0], rounded(network).state_dict()
    for name, tensor in loaded.state_dict().items():
        assert torch.equal(tensor, wanted[name])
        assert tensor.dtype == before[name].dtype
        torch.testing.assert_close(tensor, before[name], rtol=2**-11, atol=1e-7)
        assert torch.equal(network.state_dict()[name], before[name]), "the network that is saved stays as it was"
    again = _save(loaded, tmp_path / "again")
    assert (again / WEIGHTS).read_bytes() == (folder / WEIGHTS).read_bytes()


def test_eight_bits_are_the_same_network_as_without(network: DualUNet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    half = OpenVinoSegmenter(_save(rounded(network), tmp_path / "half"), 1)
    monkeypatch.setattr(model_writer, "halve_onnx", lambda path: None)
    full = OpenVinoSegmenter(_save(rounded(network), tmp_path / "full"), 1)
    assert "int8" in half.engine
    sizes = [(tmp_path / name / ONNX_INT8).stat().st_size for name in ("half", "full")]
    assert sizes[0] < sizes[1]
    for picture in _pictures():
        for a, b in zip(half(picture), full(picture), strict=True):
            assert np.array_equal(a, b)
