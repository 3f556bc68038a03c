"""Random looks of a batch of pictures, on the device where they are: what ``augment`` does to one after the other."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional

_BLUR_REACH_PX = 4
_QUANTA = (
    (16, 11, 10, 16, 24, 40, 51, 61),
    (12, 12, 14, 19, 26, 58, 60, 55),
    (14, 13, 16, 24, 40, 57, 69, 56),
    (14, 17, 22, 29, 51, 87, 80, 62),
    (18, 22, 37, 56, 68, 109, 103, 77),
    (24, 35, 55, 64, 81, 104, 113, 92),
    (49, 64, 78, 87, 103, 121, 120, 101),
    (72, 92, 95, 98, 112, 100, 103, 99),
)
"""Of JPEG's brightness (ITU-T T.81, table K.1)."""
_LUMA = ((0.299, 0.587, 0.114), (-0.168736, -0.331264, 0.5), (0.5, -0.418688, -0.081312))


def drawn(low: float, high: float, shape: tuple[int, ...], generator: torch.Generator) -> Tensor:
    """Even chances between `low` and `high`."""
    return torch.rand(shape, generator=generator, device=generator.device) * (high - low) + low


def happens(chance: float, count: int, generator: torch.Generator) -> Tensor:
    """For each of `count` pictures whether it is changed, (count, 1, 1, 1)."""
    return torch.rand((count, 1, 1, 1), generator=generator, device=generator.device) < chance


def random_looks(images: Tensor, generator: torch.Generator) -> Tensor:
    """Exposure, contrast, gamma, white balance, uneven light, blur, noise and compression, each now and then.

    `images` float32 (n, 3, h, w), 0..255; the result is the same, in whole steps.
    """
    n = len(images)
    each = (n, 1, 1, 1)
    pixels = images / 255
    mean = pixels.mean(dim=(1, 2, 3), keepdim=True)
    exposed = (pixels - mean) * drawn(0.65, 1.4, each, generator) + mean + drawn(-0.15, 0.15, each, generator)
    pixels = torch.where(happens(0.7, n, generator), exposed, pixels)
    pixels = torch.where(happens(0.5, n, generator), pixels * drawn(0.85, 1.15, (n, 3, 1, 1), generator), pixels)
    grey = happens(0.12, n, generator)
    pixels = torch.where(grey, pixels.mean(dim=1, keepdim=True), pixels)
    order = torch.rand((n, 3), generator=generator, device=generator.device).argsort(dim=1)[:, :, None, None]
    swapped = pixels.gather(1, order.expand_as(pixels))
    pixels = torch.where(happens(0.12, n, generator) & ~grey, swapped, pixels)
    power = drawn(-0.5, 0.5, each, generator).exp()
    pixels = torch.where(happens(0.4, n, generator), pixels.clamp(0, 1) ** power, pixels)
    light = functional.interpolate(drawn(0.6, 1.3, (n, 1, 4, 4), generator), images.shape[2:], mode="bicubic", align_corners=False)
    pixels = torch.where(happens(0.3, n, generator), pixels * light, pixels)
    pixels = torch.where(happens(0.25, n, generator), _blurred(pixels, drawn(0.4, 1.3, (n,), generator)), pixels)
    noise = torch.randn(pixels.shape, generator=generator, device=generator.device) * drawn(0.005, 0.04, each, generator)
    pixels = torch.where(happens(0.35, n, generator), pixels + noise, pixels)
    steps = (pixels.clamp(0, 1) * 255).floor()
    return torch.where(happens(0.15, n, generator), compressed(steps, drawn(35, 90, (n,), generator)), steps)


def _blurred(images: Tensor, sigma_px: Tensor) -> Tensor:
    """Each picture by a Gaussian of its own."""
    n, planes = images.shape[:2]
    place = torch.arange(-_BLUR_REACH_PX, _BLUR_REACH_PX + 1, device=images.device, dtype=images.dtype)
    kernel = torch.exp(-0.5 * (place / sigma_px[:, None]) ** 2)
    kernel = (kernel / kernel.sum(dim=1, keepdim=True)).repeat_interleave(planes, dim=0)[:, None]
    flat = images.reshape(1, n * planes, *images.shape[2:])
    flat = functional.pad(flat, (_BLUR_REACH_PX,) * 4, mode="reflect")
    flat = functional.conv2d(flat, kernel[:, :, None, :], groups=n * planes)
    return functional.conv2d(flat, kernel[:, :, :, None], groups=n * planes).view_as(images)


def compressed(images: Tensor, quality: Tensor) -> Tensor:
    """What JPEG's blocks of 8 x 8 px leave of pictures (n, 3, h, w), 0..255, at a quality (n,) of 1..100; colours at full size.

    The same steps for colours as for brightness, and no entropy coding, which loses nothing.
    """
    height, width = images.shape[2:]
    whole = functional.pad(images, (0, -width % 8, 0, -height % 8), mode="replicate")
    turn = torch.tensor(_LUMA, device=images.device)
    levels = torch.einsum("cd,ndhw->nchw", turn, whole - 128)
    index = torch.arange(8, device=images.device, dtype=images.dtype)
    waves = torch.cos((2 * index[None, :] + 1) * index[:, None] * math.pi / 16) / 2
    waves[0] /= math.sqrt(2)
    n, planes, tall, wide = levels.shape
    blocks = levels.view(n, planes, tall // 8, 8, wide // 8, 8)
    found = torch.einsum("ua,ncravb,wb->ncruvw", waves, blocks, waves)
    scale = torch.where(quality < 50, 5000 / quality, 200 - 2 * quality)
    table = torch.tensor(_QUANTA, device=images.device, dtype=images.dtype)
    quanta = ((table * scale[:, None, None] + 50) / 100).floor().clamp(1, 255)[:, None, None, :, None, :]
    found = (found / quanta).round() * quanta
    blocks = torch.einsum("ua,ncruvw,wb->ncravb", waves, found, waves)
    levels = blocks.flatten(4, 5).flatten(2, 3)
    back = torch.einsum("cd,ndhw->nchw", torch.linalg.inv(turn), levels) + 128
    return back[:, :, :height, :width].round().clamp(0, 255)
