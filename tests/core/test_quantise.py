"""The eight-bit copy of a network: close to the original, stored and verified beside it, chosen by the configuration."""

from pathlib import Path

import numpy as np
import pytest
import torch

from core.config import SegmentationConfig
from core.learning.model_file import ONNX_INT8, ModelError, read_model_info, save_model
from core.learning.quantise import EightBitUNet, _Conv
from core.perception.segmentation import OpenVinoSegmenter, open_segmenter
from core.perception.unet import DualUNet, UNetShape
from core.types import Image

TINY = UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2)


def _pictures(count: int) -> list[Image]:
    """Smooth pictures with edges, as a network meets them; noise alone would exercise only a sliver of its ranges."""
    rng = np.random.default_rng(5)
    return [np.kron(rng.integers(0, 256, (10, 12, 3)), np.ones((8, 8, 1))).astype(np.uint8) for _ in range(count)]


def _network() -> DualUNet:
    """Random weights, but with the running statistics of normalisation that training would leave."""
    torch.manual_seed(3)
    network = DualUNet(TINY).train()
    batch = torch.from_numpy(np.stack(_pictures(8)).transpose(0, 3, 1, 2)[:, :, :64, :96].copy()).float() / 255
    with torch.no_grad():
        for _ in range(60):
            network(batch)
    return network.eval()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("models") / "tiny"
    save_model(_network(), folder, training={}, figures={}, examples=_pictures(4))
    return folder


def test_the_copy_answers_like_the_original() -> None:
    network = _network()
    copy = EightBitUNet(network).eval()
    batches = [torch.from_numpy(p.transpose(2, 0, 1)[None, :, :64].copy()).float() / 255 for p in _pictures(4)]
    copy.learn_ranges(batches)
    with torch.no_grad():
        original, eight_bit = (torch.sigmoid(n(batches[0])) for n in (network, copy))
    spread = float(original.max() - original.min())
    assert float((original - eight_bit).abs().mean()) < 0.05 * spread
    assert not torch.equal(original, eight_bit), "nothing was quantised"


def test_two_products_never_overflow_the_sixteen_bits_of_an_old_processor() -> None:
    """Without VNNI, u8 x s8 products are added in pairs with 16 bits, and what is beyond is cut off without a word."""
    parts = [module for module in EightBitUNet(_network()).modules() if isinstance(module, _Conv)]
    assert len(parts) > 20
    for part in parts:
        shape = [-1 if axis == part.channel else 1 for axis in range(4)]
        steps = torch.round(part.conv.weight.detach() / part.scale.reshape(shape)).abs()
        assert 60 <= float(steps.max()) <= 64
        assert 2 * 255 * float(steps.max()) < 2**15


def test_openvino_computes_in_eight_bits_where_the_model_has_them(folder: Path) -> None:
    image = _pictures(1)[0]
    eight_bit, exact = OpenVinoSegmenter(folder, 1), OpenVinoSegmenter(folder, 1, "fp32")
    assert "int8" in eight_bit.engine
    assert "fp32" in exact.engine
    for a, b in zip(eight_bit(image), exact(image), strict=True):
        assert a.shape == b.shape == image.shape[:2]
        assert 0 < float(np.abs(a - b).mean()) < 0.05


def test_the_configuration_chooses_the_precision(folder: Path) -> None:
    for precision, expected in (("auto", "int8"), ("int8", "int8"), ("fp32", "fp32")):
        config = SegmentationConfig.model_validate({"model": str(folder), "device": "openvino", "precision": precision})
        assert expected in open_segmenter(config).engine


def test_a_model_without_eight_bits_says_so_and_auto_goes_without(tmp_path: Path) -> None:
    save_model(DualUNet(TINY).eval(), tmp_path / "plain", training={}, figures={})
    assert read_model_info(tmp_path / "plain").onnx_int8_sha256 is None
    assert "fp32" in OpenVinoSegmenter(tmp_path / "plain", 1).engine
    with pytest.raises(ModelError, match="choose precision fp32"):
        OpenVinoSegmenter(tmp_path / "plain", 1, "int8")


def test_a_damaged_eight_bit_network_is_refused(folder: Path) -> None:
    path = folder / ONNX_INT8
    original = path.read_bytes()
    try:
        path.write_bytes(original[:-1])
        with pytest.raises(ModelError, match=r"network_int8\.onnx: SHA-256 differs"):
            OpenVinoSegmenter(folder, 1)
    finally:
        path.write_bytes(original)
