"""Weights of convolutions kept in half precision: half the bytes on disk, and nothing that a picture could show.

They are rounded before anything is written, so that all files of a model hold the same network. A network in eight bits loses
nothing at all: its weights lie on a grid of 127 steps, which half precision meets within a thirtieth of a step.
"""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

    from core.perception.unet import DualUNet


def rounded(network: DualUNet) -> DualUNet:
    """A copy whose convolutions' weights are such as half precision can hold; biases and normalisations stay as they are."""
    copy = deepcopy(network)
    for parameter in copy.parameters():
        if parameter.dim() > 1:
            parameter.data = parameter.data.half().float()
    return copy


def halved(state: dict[str, Tensor]) -> dict[str, Tensor]:
    """A network's state, its convolutions' weights in half precision; ``load_state_dict`` takes it as it is."""
    return {
        name: (tensor.half() if tensor.is_floating_point() and tensor.dim() > 1 else tensor).cpu().contiguous()
        for name, tensor in state.items()
    }


def halve_onnx(path: Path) -> None:
    """Keep the weights of an ONNX file in half precision; what computes with them is told to make float32 of them first."""
    import numpy as np
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    model = onnx.load(str(path))
    graph = model.graph
    weights = [one for one in graph.initializer if one.data_type == TensorProto.FLOAT and len(one.dims) > 1]
    for place, weight in enumerate(weights):
        half = numpy_helper.from_array(numpy_helper.to_array(weight).astype(np.float16), f"{weight.name}.half")
        graph.initializer.remove(weight)
        graph.initializer.append(half)
        graph.node.insert(place, helper.make_node("Cast", [half.name], [weight.name], to=TensorProto.FLOAT))
    onnx.save(model, str(path))
