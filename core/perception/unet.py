"""The dual-decoder multi-task U-Net (the paper, "Vascular Structure Segmentation and Interventional Robot Detection").

One encoder with four down-samplings, and for each task a decoder of its own with four up-samplings and skip connections. Two things
are ours, chosen by measurement (docs/method.md): ``fold`` rearranges blocks of fold x fold pixels into channels before the
first convolution and back after the last one, so that the network works on a quarter of the positions and yet distinguishes
every pixel; and the decoders may be narrower than the encoder. ``UNetShape.of_base(64)`` is the paper's network.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import torch
from torch import Tensor, nn


@dataclass(frozen=True, slots=True)
class UNetShape:
    """Size of the network.

    ``widths`` are the channels of the five encoder levels, ``decoder_widths`` those of the four decoder levels from fine to coarse,
    ``fold`` the block of pixels folded into channels (1 = none). ``encoder_convolutions`` are the 3x3 convolutions of each encoder
    level (the paper has two everywhere), ``decoder_convolutions`` those of every decoder level. ``inputs`` are the planes of the
    input: 3 of a picture, 5 where the first network's probabilities come with it (``tip_refinement.py``).
    """

    widths: tuple[int, int, int, int, int] = (16, 32, 64, 128, 256)
    decoder_widths: tuple[int, int, int, int] = (16, 32, 64, 128)
    decoder_convolutions: int = 2
    fold: int = 1
    encoder_convolutions: tuple[int, int, int, int, int] = (2, 2, 2, 2, 2)
    inputs: int = 3

    @classmethod
    def of_base(cls, base: int) -> UNetShape:
        """The paper's plain shape at a base width (64 in the paper)."""
        return cls((base, base * 2, base * 4, base * 8, base * 16), (base, base * 2, base * 4, base * 8), 2, 1)

    @property
    def stride(self) -> int:
        """Input height and width must be multiples of this."""
        return 16 * self.fold

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> UNetShape:
        """Inverse of ``to_json``; raises TypeError, KeyError or ValueError for anything else."""
        widths = tuple(int(w) for w in data["widths"])
        decoder = tuple(int(w) for w in data["decoder_widths"])
        if len(widths) != 5 or len(decoder) != 4 or min(widths + decoder) < 1 or max(widths + decoder) > 4096:
            raise ValueError("a U-Net has five encoder widths and four decoder widths between 1 and 4096")
        fold, convolutions = int(data["fold"]), int(data["decoder_convolutions"])
        if fold not in (1, 2, 4) or convolutions not in (1, 2):
            raise ValueError("fold is 1, 2 or 4 and decoder_convolutions 1 or 2")
        # Models from before the levels could differ do not say.
        depths = tuple(int(count) for count in data.get("encoder_convolutions", (2, 2, 2, 2, 2)))
        if len(depths) != 5 or min(depths) < 1 or max(depths) > 8:
            raise ValueError("encoder_convolutions are five counts between 1 and 8")
        inputs = int(data.get("inputs", 3))
        if inputs not in (3, 5):
            raise ValueError("inputs are 3 (a picture) or 5 (with the first network's probabilities)")
        return cls(widths, decoder, convolutions, fold, depths, inputs)


def _convolutions(inputs: int, outputs: int, count: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for _ in range(count):
        layers += [nn.Conv2d(inputs, outputs, 3, padding=1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)]
        inputs = outputs
    return nn.Sequential(*layers)


class _Decoder(nn.Module):
    """Four up-samplings with skip connections and a 1x1 output."""

    def __init__(self, shape: UNetShape) -> None:
        super().__init__()
        below = shape.widths[4]
        up, blocks = [], []
        for level in (3, 2, 1, 0):
            width = shape.decoder_widths[level]
            up.append(nn.ConvTranspose2d(below, width, 2, stride=2))
            blocks.append(_convolutions(width + shape.widths[level], width, shape.decoder_convolutions))
            below = width
        self.up = nn.ModuleList(up)
        self.blocks = nn.ModuleList(blocks)
        self.output = nn.Conv2d(below, shape.fold**2, 1)
        # Most pixels are neither vessel nor robot: starting from "no" saves the first hundred steps.
        nn.init.constant_(self.output.bias, -3.0)  # type: ignore[arg-type]

    def forward(self, bottom: Tensor, skips: list[Tensor]) -> Tensor:
        x = bottom
        for up, block, skip in zip(self.up, self.blocks, reversed(skips), strict=True):
            x = block(torch.cat([up(x), skip], dim=1))
        return self.output(x)  # type: ignore[no-any-return]


class DualUNet(nn.Module):
    """RGB images (N, ``shape.inputs``, H, W), 0..1 -> logits (N, 2, H, W), vessel and robot. H, W: multiples of the stride."""

    def __init__(self, shape: UNetShape) -> None:
        super().__init__()
        self.shape = shape
        channels = shape.inputs * shape.fold**2
        encoder = []
        for width, count in zip(shape.widths, shape.encoder_convolutions, strict=True):
            encoder.append(_convolutions(channels, width, count))
            channels = width
        self.encoder = nn.ModuleList(encoder)
        self.vessel = _Decoder(shape)
        self.robot = _Decoder(shape)

    def forward(self, image: Tensor) -> Tensor:
        return self.with_deepest(image)[0]

    def with_deepest(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """The logits, and what the encoder's last level gives, (N, ``shape.widths[4]``, H / stride, W / stride)."""
        bottom, skips = self._encoded(image)
        outputs = [self._unfolded(decoder(bottom, skips)) for decoder in (self.vessel, self.robot)]
        return torch.cat(outputs, dim=1), bottom

    def robot_alone(self, image: Tensor) -> Tensor:
        """The robot's logits (N, 1, H, W) without the vessel's."""
        return self._unfolded(self.robot(*self._encoded(image)))

    def _encoded(self, image: Tensor) -> tuple[Tensor, list[Tensor]]:
        """What the encoder's last level gives, and the levels above it from fine to coarse."""
        x = (image - 0.5) * 4.0
        if self.shape.fold > 1:
            x = nn.functional.pixel_unshuffle(x, self.shape.fold)
        skips: list[Tensor] = []
        for level, block in enumerate(self.encoder):
            x = block(nn.functional.max_pool2d(x, 2) if level else x)
            skips.append(x)
        bottom = skips.pop()
        return bottom, skips

    def _unfolded(self, output: Tensor) -> Tensor:
        return nn.functional.pixel_shuffle(output, self.shape.fold) if self.shape.fold > 1 else output


def with_prior_planes(network: DualUNet) -> DualUNet:
    """A copy of `network` that also takes probabilities (5 planes), with weights of 0 for them.

    Raises ValueError: the network takes them already.
    """
    if network.shape.inputs != 3:
        raise ValueError("the network takes probabilities already")
    wider = DualUNet(replace(network.shape, inputs=5)).eval()
    state, name = network.state_dict(), "encoder.0.0.weight"
    kernel = wider.state_dict()[name].zero_()
    # Folding keeps the pixels of a plane together: the planes of the picture come first as before.
    kernel[:, : state[name].shape[1]] = state[name]
    wider.load_state_dict(state | {name: kernel})
    return wider


class Probabilities(nn.Module):
    """The network as it is exported: uint8 image (1, H, W, planes) -> probabilities (1, 2, H, W) in 0..1."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, image: Tensor) -> Tensor:
        return torch.sigmoid(self.network(_scaled(image)))

    def with_deepest(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """The probabilities, and what a ``DualUNet`` has in its deepest level."""
        assert isinstance(self.network, DualUNet)
        logits, deepest = self.network.with_deepest(_scaled(image))
        return torch.sigmoid(logits), deepest

    def robot(self, image: Tensor) -> Tensor:
        """The robot's probabilities (1, 1, H, W) alone, of a ``DualUNet``."""
        assert isinstance(self.network, DualUNet)
        return torch.sigmoid(self.network.robot_alone(_scaled(image)))


def _scaled(image: Tensor) -> Tensor:
    return image.permute(0, 3, 1, 2).to(torch.float32) / 255.0
