"""Eight-bit copy of a trained network, which takes a third of the time of fp32 on processors (docs/method.md).

Weights (in seven of the eight bits) get one step size per output channel, activations one per tensor, chosen on a few training
frames (B. Jacob et al., "Quantization and training of neural networks for efficient integer-arithmetic-only inference", CVPR 2018).
The rounding error of a weight is compensated by the other weights of its row (E. Frantar et al., "GPTQ: accurate post-training
quantization for generative pre-trained transformers", ICLR 2023), its mean by the bias. The copy is a torch module whose fake
quantisation exports as ONNX QuantizeLinear / DequantizeLinear pairs, which OpenVINO computes in int8.
"""

from __future__ import annotations

from collections.abc import Iterable
from copy import deepcopy
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from core.perception.unet import DualUNet

WEIGHT_STEPS = 63
"""Steps to each side of zero: seven bits, not eight. Processors without VNNI add pairs of products in 16 bits, which overflow
silently where two full steps meet two full activations (2 * 255 * 127 > 32767); with seven bits they cannot (2 * 255 * 64)."""
_KEPT_SHARE = 0.9999
"""Share of the activations that the range covers; the few beyond it are clipped so that all others get finer steps."""
_PLACES = 512
"""Pixels of each example whose inputs are used to choose how a convolution's weights are rounded."""
_DAMPING = 0.01
"""Share of the inputs' mean variance that is added to each: a few examples say little of rare inputs."""
_AT_ONCE = 64
"""Weights of a row that are rounded before the rest of the row is corrected."""
_PIXEL_STEP = 4.0 / 255
"""One of 255 levels of the network's input. Its zero lies between two levels; the copy's has to lie on one."""


class _Steps(nn.Module):
    """An activation in 256 steps. While ``learning`` it passes values on and widens its range to them."""

    def __init__(self) -> None:
        super().__init__()
        self.low, self.high = 0.0, 0.0
        self.learning = True

    def forward(self, x: Tensor) -> Tensor:
        if self.learning:
            tail = max(1, round(x.numel() * (1 - _KEPT_SHARE)))
            flat = x.detach().flatten().cpu().numpy()
            low, high = tail - 1, flat.size - tail
            ends = np.partition(flat, (low, high))  # a third of the time of torch's topk
            self.low, self.high = min(self.low, float(ends[low])), max(self.high, float(ends[high]))
            return x
        scale = max((self.high - self.low) / 255, 1e-8)
        return torch.fake_quantize_per_tensor_affine(x, scale, round(-self.low / scale), 0, 255)


class _Moments:
    """Mean and covariance of a convolution's inputs, from random places of the examples."""

    def __init__(self) -> None:
        self._count = 0
        self._sum: Any = 0.0
        self._products: Any = 0.0
        self._random = torch.Generator().manual_seed(0)

    def choose(self, number: int) -> Tensor:
        """Which of so many places are used."""
        return torch.randperm(number, generator=self._random)[:_PLACES]

    def add(self, inputs: Tensor) -> None:
        """Inputs (places, K) at the places chosen."""
        chosen = inputs.double()
        self._count += len(chosen)
        self._sum = self._sum + chosen.sum(0)
        self._products = self._products + chosen.T @ chosen

    def mean(self) -> Tensor:
        return self._sum / self._count  # type: ignore[no-any-return]

    def products(self, *, centred: bool) -> Tensor:
        """Mean products (K, K) of any two inputs, or of their differences from their means."""
        mean = self.mean()
        products: Tensor = self._products / self._count
        return products - mean[:, None] * mean[None, :] if centred else products


def _rounded(weight: Tensor, scale: Tensor, products: Tensor) -> Tensor:
    """Rows of weights (N, K) in whole steps of `scale` (N,) with the least change for inputs of such mean products (K, K)."""
    # Those whose inputs vary most first: the others compensate their rounding errors.
    order = products.diagonal().argsort(descending=True, stable=True)
    damped = products[order][:, order]
    damped += torch.eye(len(order), dtype=damped.dtype) * (_DAMPING * damped.diagonal().mean()).clamp_min(1e-12)
    # The inverse's upper Cholesky factor, without the inverse: of damped = U U^T with an upper U it is U^-1.
    upper = torch.linalg.cholesky(damped.flip(0, 1)).flip(0, 1)
    follow = torch.linalg.solve_triangular(upper, torch.eye(len(order), dtype=damped.dtype), upper=True)
    left = weight.double()[:, order]
    whole = torch.empty_like(left)
    step = scale.double()
    for first in range(0, len(order), _AT_ONCE):
        last = min(first + _AT_ONCE, len(order))
        lost = left.new_empty(len(left), last - first)
        for column in range(first, last):
            now = left[:, column]
            whole[:, column] = torch.round(now / step).clamp(-WEIGHT_STEPS, WEIGHT_STEPS) * step
            lost[:, column - first] = (now - whole[:, column]) / follow[column, column]
            left[:, column + 1 : last] -= lost[:, column - first, None] * follow[column, column + 1 : last]
        left[:, last:] -= lost @ follow[first:last, last:]
    back = torch.empty_like(whole)
    back[:, order] = whole
    return back.to(weight.dtype)


class _Conv(nn.Module):
    """A convolution, plain or transposed, with eight-bit weights and perhaps a rectifier."""

    scale: Tensor

    def __init__(self, conv: nn.Conv2d | nn.ConvTranspose2d, rectify: bool) -> None:
        super().__init__()
        conv = deepcopy(conv)
        channel = 1 if isinstance(conv, nn.ConvTranspose2d) else 0
        weight = conv.weight.detach()
        scale = weight.abs().amax(dim=[d for d in range(4) if d != channel]).clamp_min(1e-8) / WEIGHT_STEPS
        zero = torch.zeros_like(scale, dtype=torch.int32)
        self.conv, self.rectify, self.channel = conv, rectify, channel
        self.register_buffer("scale", scale)
        self.register_buffer("zero", zero)
        self.moments: _Moments | None = None

    def round_weights(self) -> None:
        """Round the weights by the moments of their inputs, and put the mean error into the bias."""
        if self.moments is None:
            return
        weight, channels = self.conv.weight.detach(), self.scale.numel()
        # A plain convolution's bias compensates the mean error of a row. A transposed one has rows for four pixels and one bias.
        rows = weight.permute(1, 2, 3, 0).reshape(-1, weight.shape[0]) if self.channel else weight.reshape(channels, -1)
        whole = _rounded(rows, self.scale.repeat_interleave(len(rows) // channels), self.moments.products(centred=not self.channel))
        lost = ((rows - whole).double() @ self.moments.mean()).reshape(channels, -1).mean(1)
        turned = whole.reshape(*weight.shape[1:], -1).permute(3, 0, 1, 2) if self.channel else whole.reshape(weight.shape)
        self.conv.weight.data.copy_(turned)
        assert self.conv.bias is not None
        self.conv.bias.data += lost.to(self.conv.bias.dtype)
        self.moments = None

    def _add_moments(self, x: Tensor) -> None:
        """Add the inputs of the weights at some pixels of `x` (N, C, H, W) to the moments."""
        assert self.moments is not None
        number, _, height, width = x.shape
        chosen = self.moments.choose(number * height * width)
        image, row, column = chosen // (height * width), chosen // width % height, chosen % width
        if self.channel == 0 and self.conv.kernel_size != (1, 1):
            (down, right), (above, left) = self.conv.kernel_size, cast("tuple[int, int]", self.conv.padding)
            around = nn.functional.pad(x, (left, left, above, above)).unfold(2, down, 1).unfold(3, right, 1)
            places = around[image, :, row, column].flatten(1)
        else:  # each pixel for itself
            places = x[image, :, row, column]
        self.moments.add(places)

    def forward(self, x: Tensor) -> Tensor:
        weight = self.conv.weight
        if self.moments is not None:
            self._add_moments(x)
        else:
            weight = torch.fake_quantize_per_channel_affine(weight, self.scale, self.zero, self.channel, -128, 127)  # type: ignore[arg-type]
        if isinstance(self.conv, nn.ConvTranspose2d):
            y = nn.functional.conv_transpose2d(x, weight, self.conv.bias, stride=2)
        else:
            y = nn.functional.conv2d(x, weight, self.conv.bias, padding=self.conv.padding)
        return torch.relu(y) if self.rectify else y


def _block(layers: nn.Module) -> list[_Conv]:
    """The convolutions of a block, each with its normalisation folded in."""
    parts: list[Any] = list(layers.children())
    return [_Conv(fuse_conv_bn_eval(conv, norm), rectify=True) for conv, norm in zip(parts[0::3], parts[1::3], strict=True)]


class _Chain(nn.Module):
    """Convolutions with steps between them; the last one's output is quantised by its user."""

    def __init__(self, convolutions: list[_Conv]) -> None:
        super().__init__()
        self.convolutions = nn.ModuleList(convolutions)
        self.steps = nn.ModuleList([_Steps() for _ in convolutions[1:]])

    def forward(self, x: Tensor) -> Tensor:
        for conv, steps in zip(self.convolutions, [*self.steps, None], strict=True):
            x = conv(x)
            if steps is not None:
                x = steps(x)
        return x


class EightBitUNet(nn.Module):
    """``DualUNet`` in evaluation mode with eight-bit weights and activations; same input, same output."""

    def __init__(self, network: DualUNet) -> None:
        super().__init__()
        self.shape = network.shape
        self.input_steps = _Steps()
        self.input_steps.low, self.input_steps.high = -128 * _PIXEL_STEP, 127 * _PIXEL_STEP
        self.encoder = nn.ModuleList([_Chain(_block(block)) for block in network.encoder])
        # One range per level: the skip connection and both up-samplings are concatenated.
        self.level_steps = nn.ModuleList([_Steps() for _ in network.encoder])
        self.decoders = nn.ModuleList([_EightBitDecoder(decoder) for decoder in (network.vessel, network.robot)])
        first: Any = self.encoder[0]
        first = first.convolutions[0].conv
        # Half a level, by which the input's zero was moved. At the picture's edges, padded with zeros, it is slightly too much.
        first.bias.data += 0.5 * _PIXEL_STEP * first.weight.detach().sum(dim=(1, 2, 3))

    def learn(self, images: Iterable[Tensor]) -> None:
        """Choose all ranges, and how weights are rounded, from the given (N, planes, H, W) batches of levels in 0..1."""
        steps = [module for module in self.modules() if isinstance(module, _Steps)]
        convolutions = [module for module in self.modules() if isinstance(module, _Conv)]
        for module in convolutions:
            module.moments = _Moments()
        with torch.no_grad():
            for image in images:
                self(image)
            for module in convolutions:
                module.round_weights()
        for step in steps:
            step.learning = False

    def forward(self, image: Tensor) -> Tensor:
        x = (image - 128 / 255) * 4.0
        if self.shape.fold > 1:
            x = nn.functional.pixel_unshuffle(x, self.shape.fold)
        x = self.input_steps(x)
        skips: list[Tensor] = []
        for level, (block, steps) in enumerate(zip(self.encoder, self.level_steps, strict=True)):
            x = steps(block(nn.functional.max_pool2d(x, 2) if level else x))
            skips.append(x)
        bottom = skips.pop()
        outputs = [decoder(bottom, skips, list(self.level_steps)) for decoder in self.decoders]
        if self.shape.fold > 1:
            outputs = [nn.functional.pixel_shuffle(output, self.shape.fold) for output in outputs]
        return torch.cat(outputs, dim=1)


class _EightBitDecoder(nn.Module):
    def __init__(self, decoder: Any) -> None:
        super().__init__()
        self.up = nn.ModuleList([_Conv(up, rectify=False) for up in decoder.up])
        self.blocks = nn.ModuleList([_Chain(_block(block)) for block in decoder.blocks])
        self.block_steps = nn.ModuleList([_Steps() for _ in self.blocks])
        self.output = _Conv(decoder.output, rectify=False)

    def forward(self, bottom: Tensor, skips: list[Tensor], level_steps: list[nn.Module]) -> Tensor:
        x = bottom
        parts = zip(self.up, self.blocks, self.block_steps, reversed(skips), reversed(level_steps[:-1]), strict=True)
        for up, block, steps, skip, shared in parts:
            x = steps(block(torch.cat([shared(up(x)), skip], dim=1)))
        return self.output(x)  # type: ignore[no-any-return]
