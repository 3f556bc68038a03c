"""A deepened or widened network computes what it did before, and learns on."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from core.learning.growing import deepened, widened
from core.perception.unet import DualUNet, UNetShape

SMALL = UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2)
IMAGES = [np.random.default_rng(seed).integers(0, 256, (70, 96, 3)).astype(np.uint8) for seed in range(3)]


@pytest.mark.parametrize("decoders", [None, 2])
def test_the_deeper_network_says_the_same(decoders: int | None) -> None:
    torch.manual_seed(1)
    network = DualUNet(SMALL)
    batch = torch.stack([torch.from_numpy(image[:64, :96].transpose(2, 0, 1).copy()) for image in IMAGES]).float() / 255
    for _ in range(100):  # until the normalisation knows what it meets, as a trained network's does
        network.train()(batch)
    network.eval()
    deeper = deepened(network, (2, 2, 3, 4, 2), IMAGES, decoder_convolutions=decoders)
    assert [len(block) // 3 for block in deeper.encoder] == [2, 2, 3, 4, 2]
    assert {len(block) // 3 for block in (*deeper.vessel.blocks, *deeper.robot.blocks)} == {decoders or 1}
    picture = torch.rand(1, 3, 64, 64)
    with torch.no_grad():
        torch.testing.assert_close(deeper(picture), network(picture), rtol=1e-4, atol=1e-4)
        # In training the normalisation sees the batch and not its memory, and on like images says nearly the same.
        kept = network.train()(batch)
        assert float((deeper.train()(batch) - kept).abs().mean()) < 0.05 * float(kept.std())


def test_what_is_added_can_learn() -> None:
    deeper = deepened(DualUNet(SMALL), (2, 2, 3, 2, 2), IMAGES).train()
    deeper(torch.rand(2, 3, 64, 64)).square().mean().backward()
    gradient = deeper.encoder[2][6].weight.grad
    assert gradient is not None
    assert float(gradient.abs().sum()) > 0


def test_nothing_is_cut_away() -> None:
    with pytest.raises(ValueError, match="cut down"):
        deepened(DualUNet(SMALL), (1, 2, 2, 2, 2), IMAGES)
    with pytest.raises(ValueError, match="decoders have 1 convolutions per level"):
        deepened(DualUNet(SMALL), (2, 2, 2, 2, 2), IMAGES, decoder_convolutions=0)
    with pytest.raises(ValueError, match="without an image"):
        deepened(DualUNet(SMALL), (2, 2, 3, 2, 2), [])


WIDER = (6, 4, 12, 8, 9), (8, 4, 6, 5)


@pytest.mark.parametrize("inputs", [3, 5])
def test_the_wider_network_says_the_same(inputs: int) -> None:
    torch.manual_seed(2)
    network = DualUNet(replace(SMALL, inputs=inputs, decoder_convolutions=2))
    for _ in range(20):
        network.train()(torch.rand(2, inputs, 64, 64))
    wider = widened(network, *WIDER)
    assert (wider.shape.widths, wider.shape.decoder_widths) == WIDER
    picture = torch.rand(1, inputs, 64, 96)
    with torch.no_grad():
        torch.testing.assert_close(wider(picture), network.eval()(picture), rtol=1e-4, atol=1e-4)
        torch.testing.assert_close(wider.train()(picture), network.train()(picture), rtol=1e-4, atol=1e-4)


def test_new_channels_can_learn() -> None:
    """At first the old channels do not listen to the new ones, but they can begin to at the first step, and the new ones then."""
    torch.manual_seed(3)
    wider = widened(DualUNet(SMALL), *WIDER).train()
    optimizer = torch.optim.SGD(wider.parameters(), lr=0.1)
    for _ in range(2):
        optimizer.zero_grad()
        wider(torch.rand(2, 3, 64, 64)).square().mean().backward()
        optimizer.step()
    for kernel in (wider.encoder[0][0].weight, wider.robot.blocks[0][0].weight):
        assert kernel.grad is not None
        assert float(kernel.grad[-1].abs().sum()) > 0


def test_no_channel_is_cut_away() -> None:
    with pytest.raises(ValueError, match="cannot be cut down to fewer"):
        widened(DualUNet(SMALL), (4, 4, 8, 8, 8), (4, 4, 4, 3))
