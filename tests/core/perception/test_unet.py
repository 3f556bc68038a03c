import pytest
import torch

from core.perception.unet import DualUNet, UNetShape


def test_the_papers_shape_has_four_downsamplings_and_two_decoders() -> None:
    shape = UNetShape.of_base(64)
    assert shape.widths == (64, 128, 256, 512, 1024)
    assert shape.stride == 16
    network = DualUNet(UNetShape.of_base(4))
    assert len(network.encoder) == 5
    assert len(network.vessel.up) == len(network.robot.up) == 4


@pytest.mark.parametrize("fold", [1, 2, 4])
def test_output_has_the_inputs_size(fold: int) -> None:
    shape = UNetShape((4, 4, 4, 4, 4), (4, 4, 4, 4), 1, fold)
    side = shape.stride
    with torch.inference_mode():
        assert DualUNet(shape).eval()(torch.rand(1, 3, side, side * 2)).shape == (1, 2, side, side * 2)


def test_decoders_share_nothing_but_the_encoder() -> None:
    network = DualUNet(UNetShape((4, 4, 4, 4, 4), (4, 4, 4, 4), 1, 1)).eval()
    image = torch.rand(1, 3, 32, 32)
    before = network(image)
    with torch.no_grad():
        network.robot.output.bias.add_(1.0)
    after = network(image)
    torch.testing.assert_close(before[:, 0], after[:, 0])
    torch.testing.assert_close(before[:, 1] + 1.0, after[:, 1])


@pytest.mark.parametrize(
    "change",
    [
        {"widths": [1, 2, 3]},
        {"encoder_convolutions": [2, 2, 2, 0, 2]},
        {"fold": 3},
        {"decoder_convolutions": 0},
        {"widths": [0, 4, 4, 4, 4]},
    ],
)
def test_a_senseless_shape_is_refused(change: dict[str, object]) -> None:
    with pytest.raises(ValueError):
        UNetShape.from_json(UNetShape().to_json() | change)
