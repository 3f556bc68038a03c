"""Networks as ONNX files: as they are, and in eight bits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from core.learning.half_precision import halve_onnx
from core.types import Image

if TYPE_CHECKING:
    from core.learning.quantise import EightBitUNet
    from core.perception.unet import DualUNet


def whole_strides(images: Sequence[Image], stride: int) -> list[Image]:
    """The pictures cropped to whole strides: padding would teach ranges edges that no camera shows. Smaller ones are left out."""
    cuts = (image[: image.shape[0] // stride * stride, : image.shape[1] // stride * stride] for image in images)
    return [cut for cut in cuts if cut.size]


def export_eight_bit(network: DualUNet, examples: Sequence[Image], path: Path) -> None:
    """Export a copy that has learnt its ranges and rounding from the `examples`, which are ``whole_strides`` of pictures."""
    import torch

    from core.learning.quantise import EightBitUNet

    eight_bit = EightBitUNet(network.eval()).eval()
    eight_bit.learn(torch.from_numpy(image.transpose(2, 0, 1)[None].copy()).float() / 255 for image in examples)
    export_onnx(eight_bit, network.shape.stride, path)


def export_onnx(network: DualUNet | EightBitUNet, stride: int, path: Path) -> None:
    """Export with free height and width (multiples of `stride`); pre- and post-processing are inside the graph.

    Weights are kept in half precision.
    """
    import warnings

    import torch

    from core.perception.unet import Probabilities

    example = torch.zeros(1, stride * 2, stride * 2, network.shape.inputs, dtype=torch.uint8)
    was_training = network.training
    with warnings.catch_warnings():
        # The tracing exporter is the one that needs no further packages; its deprecation is noise to the user.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            Probabilities(network.eval()),
            (example,),
            str(path),
            input_names=["image"],
            output_names=["probabilities"],
            dynamic_axes={"image": {1: "height", 2: "width"}, "probabilities": {2: "height", 3: "width"}},
            opset_version=17,
            dynamo=False,
        )
    network.train(was_training)
    halve_onnx(path)
