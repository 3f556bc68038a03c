"""Mean of the weights of models that were trained on from one another: `python -m tools.average_models OUT MODEL=WEIGHT[,NEAR] ...`

A model that was trained on for strange benches forgets some of the twin; the mean with the model before keeps both (M. Wortsman et
al., "Robust fine-tuning of zero-shot models", CVPR 2022; "Model soups", ICML 2022). The weights of the sum are brought to 1. NEAR,
by default the same, weighs a model's tip refinement. ``calibrate OUT --eight-bit`` comes next.
"""

from __future__ import annotations

import copy
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from core.devices import UserError
from core.learning.model_writer import save_model, save_with_second_look
from core.perception.model_file import load_network, model_folder, second_look_of
from core.perception.unet import DualUNet


def mean_network(networks: Sequence[DualUNet], weights: Sequence[float]) -> DualUNet:
    """Weighted mean of networks of one shape; statistics of their layers, too.

    Raises
    ------
    UserError
        The shapes differ.
    """
    if any(network.shape != networks[0].shape for network in networks):
        raise UserError(
            "these models have networks of different shapes: only models that were trained on from one another have a mean"
        )
    states = [network.state_dict() for network in networks]
    total = sum(weights)
    mean = copy.deepcopy(networks[0])
    mean.load_state_dict(
        {
            name: sum(weight / total * state[name] for weight, state in zip(weights, states, strict=True))
            if first.is_floating_point()
            else first
            for name, first in states[0].items()
        }
    )
    return mean.eval()


def main(out: Path, shares: Sequence[tuple[str, float, float]]) -> None:
    """Write the mean of the named models, each with its weight and that of its tip refinement, to the folder `out`."""
    folders = [model_folder(name) for name, _, _ in shares]
    training: dict[str, Any] = {"mean": {name: [weight, near] for name, weight, near in shares}}
    network = mean_network([load_network(folder)[0] for folder in folders], [weight for _, weight, _ in shares])
    save_model(network, out, training=training, figures={})
    refinements = [(second_look_of(folder), near) for folder, (_, _, near) in zip(folders, shares, strict=True)]
    if found := [(place, near) for place, near in refinements if place is not None and near > 0]:
        network = mean_network([load_network(place)[0] for place, _ in found], [near for _, near in found])
        save_with_second_look(out, network, out, training=training, figures={})


def _share(word: str) -> tuple[str, float, float]:
    name, _, numbers = word.rpartition("=")
    weight, _, near = numbers.partition(",")
    return name, float(weight), float(near or weight)


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]), [_share(word) for word in sys.argv[2:]])
    except (UserError, ValueError, IndexError) as error:
        sys.exit(f"{error}\n{__doc__}")
