"""Eight-bit copy of a trained network: what runs on processors, in a third of the time of fp32 (docs/method.md).

Weights (in seven of the eight bits) get one step size per output channel, activations one per tensor, both chosen from what a few
training frames make of them (B. Jacob et al., "Quantization and training of neural networks for efficient
integer-arithmetic-only inference", CVPR 2018). The copy is an ordinary torch module whose fake quantisation exports as ONNX
QuantizeLinear / DequantizeLinear pairs, which OpenVINO computes in int8.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from core.perception.unet import DualUNet

WEIGHT_STEPS = 63
"""Steps to each side of zero: seven bits, not eight. Processors without VNNI add pairs of products in 16 bits, which overflow
silently where two full steps meet two full activations (2 * 255 * 127 > 32767); with seven bits they cannot (2 * 255 * 64)."""
_KEPT_SHARE = 0.9999
"""Share of the activations that the range covers; the few beyond it are clipped so that all others get finer steps."""


class _Steps(nn.Module):
    """An activation in 256 steps. While ``learning`` it lets everything through and widens its range to what it sees."""

    def __init__(self) -> None:
        super().__init__()
        self.low, self.high = 0.0, 0.0
        self.learning = True

    def forward(self, x: Tensor) -> Tensor:
        if self.learning:
            tail = max(1, round(x.numel() * (1 - _KEPT_SHARE)))
            flat = x.detach().flatten()
            self.high = max(self.high, float(flat.topk(tail).values[-1]))
            self.low = min(self.low, -float((-flat).topk(tail).values[-1]))
            return x
        scale = max((self.high - self.low) / 255, 1e-8)
        return torch.fake_quantize_per_tensor_affine(x, scale, round(-self.low / scale), 0, 255)


class _Conv(nn.Module):
    """A convolution, plain or transposed, with eight-bit weights and perhaps a rectifier."""

    def __init__(self, conv: nn.Conv2d | nn.ConvTranspose2d, rectify: bool) -> None:
        super().__init__()
        channel = 1 if isinstance(conv, nn.ConvTranspose2d) else 0
        weight = conv.weight.detach()
        scale = weight.abs().amax(dim=[d for d in range(4) if d != channel]).clamp_min(1e-8) / WEIGHT_STEPS
        zero = torch.zeros_like(scale, dtype=torch.int32)
        self.conv, self.rectify, self.channel = conv, rectify, channel
        self.register_buffer("scale", scale)
        self.register_buffer("zero", zero)

    def forward(self, x: Tensor) -> Tensor:
        weight = torch.fake_quantize_per_channel_affine(self.conv.weight, self.scale, self.zero, self.channel, -128, 127)  # type: ignore[arg-type]
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
    """Convolutions with steps between them; the last one's output is stepped by whoever uses it."""

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
        self.encoder = nn.ModuleList([_Chain(_block(block)) for block in network.encoder])
        # One range for everything that meets at a level: what the skip connection and both up-samplings bring is concatenated.
        self.level_steps = nn.ModuleList([_Steps() for _ in network.encoder])
        self.decoders = nn.ModuleList([_EightBitDecoder(decoder) for decoder in (network.vessel, network.robot)])

    def learn_ranges(self, images: Iterable[Tensor]) -> None:
        """Choose all ranges from the given (N, 3, H, W) batches in 0..1."""
        steps = [module for module in self.modules() if isinstance(module, _Steps)]
        with torch.no_grad():
            for image in images:
                self(image)
        for module in steps:
            module.learning = False

    def forward(self, image: Tensor) -> Tensor:
        x = (image - 0.5) * 4.0
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
