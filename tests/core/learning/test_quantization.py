"""The eight-bit copy of a network: close to the original, stored and verified beside it, chosen by the configuration."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import torch

from core.config.models import SegmentationConfig
from core.learning.model_writer import changed, save_model, write_eight_bit
from core.learning.quantization import EightBitUNet, _Conv, _Moments
from core.perception.inference import OpenVinoSegmenter, open_segmenter
from core.perception.model_file import ONNX_INT8, ModelError, read_model_info
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


def _batches(count: int) -> list[torch.Tensor]:
    return [torch.from_numpy(p.transpose(2, 0, 1)[None, :, :64].copy()).float() / 255 for p in _pictures(count)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("models") / "tiny"
    save_model(_network(), folder, training={}, figures={}, examples=_pictures(4))
    return folder


def test_the_copy_answers_like_the_original() -> None:
    network = _network()
    copy = EightBitUNet(network).eval()
    batches = _batches(4)
    copy.learn(batches)
    with torch.no_grad():
        original, eight_bit = (torch.sigmoid(n(batches[0])) for n in (network, copy))
    spread = float(original.max() - original.min())
    assert float((original - eight_bit).abs().mean()) < 0.05 * spread
    assert not torch.equal(original, eight_bit), "nothing was quantised"


@pytest.mark.parametrize("transposed", [False, True])
def test_what_rounding_loses_on_average_goes_into_the_bias(transposed: bool) -> None:
    torch.manual_seed(2)
    plain = torch.nn.ConvTranspose2d(6, 5, 2, stride=2) if transposed else torch.nn.Conv2d(6, 5, 3, padding=1)
    part = _Conv(plain, rectify=False)
    part.scale *= 8  # so coarse that every weight matters
    part.moments = _Moments()
    x = 3 + torch.rand(1, 6, 24, 24)
    with torch.no_grad():
        exact = plain(x)
        assert torch.equal(part(x), exact), "what it learns from is exact"
        part.round_weights()
        found = part(x)
    inside = np.s_[:, :, 2:-2, 2:-2]
    lost = (found - exact)[inside]
    assert 0 < float(lost.abs().mean())
    phases = [lost[..., i::2, j::2] for i in (0, 1) for j in (0, 1)] if transposed else [lost]
    for phase in phases:  # no chequerboard either
        assert float(phase.mean(dim=(0, 2, 3)).abs().max()) < 0.2 * float(exact[inside].std())


@pytest.mark.parametrize("transposed", [False, True])
def test_rounding_together_loses_less_than_rounding_each_to_its_nearest(transposed: bool) -> None:
    """On smooth maps that it has not seen, as the maps of a network are."""
    torch.manual_seed(4)
    maps = torch.nn.functional.avg_pool2d(torch.rand(2, 8, 66, 66), 5, stride=1)
    maps[:, 4:] = 0.7 * maps[:, :4] + 0.3 * maps[:, 4:]
    plain = torch.nn.ConvTranspose2d(8, 6, 2, stride=2) if transposed else torch.nn.Conv2d(8, 6, 3, padding=1)
    nearest, together = _Conv(plain, rectify=False), _Conv(plain, rectify=False)
    together.moments = _Moments()
    with torch.no_grad():
        together(maps[:1])
        together.round_weights()
        lost = [float((part(maps[1:]) - plain(maps[1:])).pow(2).mean()) for part in (nearest, together)]
    assert lost[1] < 0.5 * lost[0]


def test_an_eight_bit_copy_needs_a_picture_and_changes_nothing_without(folder: Path, tmp_path: Path) -> None:
    model = shutil.copytree(folder, tmp_path / "model")
    before = {path: path.read_bytes() for path in model.iterdir()}
    with pytest.raises(ModelError, match="nothing to make an eight-bit copy from"), changed(model) as work:
        write_eight_bit(work, [np.zeros((8, 200, 3), np.uint8)])
    assert {path: path.read_bytes() for path in model.iterdir()} == before
    assert list(tmp_path.iterdir()) == [model]


def test_a_model_without_an_eight_bit_copy_gets_one(tmp_path: Path) -> None:
    save_model(_network(), tmp_path / "plain", training={}, figures={"a": 1})
    (tmp_path / "link").symlink_to(tmp_path / "plain")
    with changed(tmp_path / "link") as work:
        write_eight_bit(work, _pictures(3))
    info = read_model_info(tmp_path / "plain", verify=(ONNX_INT8,))
    assert info.figures == {}
    assert "int8" in OpenVinoSegmenter(tmp_path / "link", 1).engine
    assert (tmp_path / "link").is_symlink()


def test_two_products_never_overflow_the_sixteen_bits_of_an_old_processor() -> None:
    """Without VNNI, u8 x s8 products are added in pairs with 16 bits, and what is beyond is cut off without a word."""
    copy = EightBitUNet(_network()).eval()
    copy.learn(_batches(2))
    parts = [module for module in copy.modules() if isinstance(module, _Conv)]
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
