"""A trained network made deeper or wider, or given more to see, without forgetting: what is added changes nothing at first.

T. Chen et al., "Net2Net: accelerating learning via knowledge transfer", ICLR 2016: as every level ends in a rectifier, a
convolution that copies its input changes nothing, and training goes on from where the shallower network stood. New channels are not
copies, as they are there, but drawn anew, and at first nobody listens to them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from core.perception.unet import DualUNet


def deepened(
    network: DualUNet,
    encoder_convolutions: tuple[int, int, int, int, int],
    images: Iterable[NDArray[np.uint8]],
    *,
    decoder_convolutions: int | None = None,
) -> DualUNet:
    """A copy of `network` with this many convolutions per level, which in evaluation mode computes the same.

    Parameters
    ----------
    network : the trained network.
    encoder_convolutions : counts per encoder level; none may be smaller than the network's.
    images : typical inputs (h, w, ``network.shape.inputs``) uint8. The normalisation of a new convolution is set to the mean and
        variance of what it meets on them, so that it is an identity in training, too.
    decoder_convolutions : of every decoder level; None leaves them as they are.

    Raises
    ------
    ValueError
        A level would lose convolutions, or there is no image.
    """
    old = network.shape.encoder_convolutions
    if any(new < before for new, before in zip(encoder_convolutions, old, strict=True)):
        raise ValueError(f"the network has {old} convolutions per level and cannot be cut down to {encoder_convolutions}")
    before = network.shape.decoder_convolutions
    after = before if decoder_convolutions is None else decoder_convolutions
    if after < before:
        raise ValueError(f"the decoders have {before} convolutions per level and cannot be cut down to {after}")
    deeper = DualUNet(replace(network.shape, encoder_convolutions=encoder_convolutions, decoder_convolutions=after)).eval()
    deeper.load_state_dict(network.state_dict(), strict=False)
    for old_block, new_block, met in zip(_levels(network), _levels(deeper), _level_statistics(network, images), strict=True):
        layers = list(new_block.children())[len(old_block) :]
        for conv, norm in zip(layers[0::3], layers[1::3], strict=True):
            assert isinstance(conv, nn.Conv2d) and isinstance(norm, nn.BatchNorm2d)
            _make_identity(conv, norm, *met)
    return deeper


def with_first_look(network: DualUNet) -> DualUNet:
    """A copy of `network` that also takes a first look's probabilities (5 planes), and at first does not mind them."""
    if network.shape.inputs != 3:
        raise ValueError("the network takes a first look already")
    wider = DualUNet(replace(network.shape, inputs=5)).eval()
    state = network.state_dict()
    name = "encoder.0.0.weight"
    kernel = wider.state_dict()[name].zero_()
    # Folding keeps the pixels of a plane together, so that the planes of the picture come first as before.
    kernel[:, : state[name].shape[1]] = state[name]
    wider.load_state_dict(state | {name: kernel})
    return wider


def widened(network: DualUNet, widths: tuple[int, int, int, int, int], decoder_widths: tuple[int, int, int, int]) -> DualUNet:
    """A copy of `network` with this many channels per level, which computes the same.

    The new channels see all that the old ones see, with weights drawn anew; the old ones do not mind them at first.

    Raises
    ------
    ValueError
        A level would lose channels.
    """
    old = network.shape
    if any(new < had for new, had in zip(widths + decoder_widths, old.widths + old.decoder_widths, strict=True)):
        raise ValueError(f"the network has {old.widths} and {old.decoder_widths} channels and cannot be cut down to fewer")
    wider = DualUNet(replace(old, widths=widths, decoder_widths=decoder_widths)).eval()
    state = {
        name: _widened(new, network.state_dict()[name], _kept_inputs(name, network, wider))
        for name, new in wider.state_dict().items()
    }
    wider.load_state_dict(state)
    return wider


def _kept_inputs(name: str, network: DualUNet, wider: DualUNet) -> list[int] | None:
    """Which of the wider kernel's inputs the old one had; None: the first ones."""
    found = re.fullmatch(r"(?:vessel|robot)\.blocks\.(\d)\.0\.weight", name)
    if found is None:
        return None
    # What comes from below and what comes from the encoder lie behind each other.
    level = 3 - int(found[1])
    below, beside, start = network.shape.decoder_widths[level], network.shape.widths[level], wider.shape.decoder_widths[level]
    return [*range(below), *range(start, start + beside)]


def _widened(new: Tensor, old: Tensor, inputs: list[int] | None) -> Tensor:
    """`new` with `old` in it, and nothing new in what the old outputs see."""
    result = new.clone()
    if new.dim() < 4:  # one value per channel, or a count
        result[tuple(slice(size) for size in old.shape)] = old
        return result
    if new.shape[2:] == (2, 2):  # an up-sampling has its inputs first
        result[:, : old.shape[1]] = 0
        result[: old.shape[0], : old.shape[1]] = old
        return result
    result[: old.shape[0]] = 0
    result[: old.shape[0], inputs if inputs is not None else slice(old.shape[1])] = old
    return result


def _levels(network: DualUNet) -> list[nn.Sequential]:
    """The levels of the encoder and of both decoders, all of which end in a rectifier."""
    levels = [*network.encoder, *network.vessel.blocks, *network.robot.blocks]
    return [level for level in levels if isinstance(level, nn.Sequential)]


def _level_statistics(network: DualUNet, images: Iterable[NDArray[np.uint8]]) -> list[tuple[Tensor, Tensor]]:
    """Mean and variance per channel of what leaves each level."""
    levels = _levels(network)
    sums: list[tuple[int, Tensor, Tensor]] = [(0, torch.zeros(()), torch.zeros(())) for _ in levels]

    def add(at: int, output: Tensor) -> None:
        values = output.transpose(0, 1).flatten(1).double()
        count, total, squares = sums[at]
        sums[at] = count + values.shape[1], total + values.sum(dim=1), squares + values.square().sum(dim=1)

    hooks = [level.register_forward_hook(lambda _m, _i, output, at=at: add(at, output)) for at, level in enumerate(levels)]
    stride = network.shape.stride
    try:
        with torch.no_grad():
            for image in images:
                cut = image[: image.shape[0] // stride * stride, : image.shape[1] // stride * stride]
                network.eval()(torch.from_numpy(np.ascontiguousarray(cut.transpose(2, 0, 1)))[None].float() / 255)
    finally:
        for hook in hooks:
            hook.remove()
    if not sums[0][0]:
        raise ValueError("without an image nobody knows what the new convolutions will meet")
    means = [(total / count, squares / count) for count, total, squares in sums]
    return [(mean.float(), (square - mean.square()).clamp(min=0).float()) for mean, square in means]


@torch.no_grad()
def _make_identity(conv: nn.Conv2d, norm: nn.BatchNorm2d, mean: Tensor, variance: Tensor) -> None:
    nn.init.dirac_(conv.weight)
    assert norm.running_mean is not None and norm.running_var is not None
    norm.running_mean.copy_(mean)
    norm.running_var.copy_(variance)
    norm.bias.copy_(mean)
    norm.weight.copy_((variance + norm.eps).sqrt())
