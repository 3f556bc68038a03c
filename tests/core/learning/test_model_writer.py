"""Weights on disk: in half precision by their names, or in eight bits, and the same network in all files."""

from copy import deepcopy
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from onnx import TensorProto

from core.learning import model_writer
from core.learning.model_writer import rounded, save_model
from core.perception.inference import OpenVinoSegmenter
from core.perception.model_file import ONNX, ONNX_INT8, load_network
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


@pytest.mark.parametrize(("name", "wanted", "share"), [(ONNX, TensorProto.FLOAT16, 0.8), (ONNX_INT8, TensorProto.INT8, 0.5)])
def test_files_hold_weights_in_few_bytes(network: DualUNet, tmp_path: Path, name: str, wanted: int, share: float) -> None:
    folder = _save(network, tmp_path / "model")
    onnx.checker.check_model(str(folder / name), full_check=True)
    large = [one for one in onnx.load(str(folder / name)).graph.initializer if np.prod(one.dims) > 128]
    assert len(large) > 20
    assert all(one.data_type == wanted for one in large)
    parameters = sum(tensor.numel() for tensor in network.state_dict().values())
    assert (folder / name).stat().st_size < share * 4 * parameters


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
    assert (again / ONNX).read_bytes() == (folder / ONNX).read_bytes()


def test_packed_eight_bits_compute_the_same(network: DualUNet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    packed = OpenVinoSegmenter(_save(network, tmp_path / "packed"), 1)
    monkeypatch.setattr(model_writer, "pack_weights", lambda path: None)
    full = OpenVinoSegmenter(_save(network, tmp_path / "full"), 1)
    assert "int8" in packed.engine
    for picture in _pictures():
        for a, b in zip(packed(picture), full(picture), strict=True):
            assert np.array_equal(a, b)
