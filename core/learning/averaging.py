"""The mean of models that were trained from each other, weight by weight.

Between a model and what fine-tuning made of it the loss has no wall: elsewhere their mean was found to forget less of the old
pictures than the new one [1]_ and to be steadier than each [2]_; what it gave here is in docs/method.md.

References
----------
.. [1] M. Wortsman et al., "Robust fine-tuning of zero-shot models", CVPR 2022.
.. [2] M. Wortsman et al., "Model soups: averaging weights of multiple fine-tuned models improves accuracy without increasing
   inference time", ICML 2022.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.learning.model_writer import save_model
from core.perception.model_file import SECOND_LOOK, ModelError, load_network, second_look_of, trained_without

if TYPE_CHECKING:
    from core.perception.unet import DualUNet


def average_models(folders: Sequence[Path], out: Path) -> None:
    """Write the mean of some models to `out`; one that is named twice counts twice. Their second looks are averaged, too.

    Nobody checks that they were trained from each other: of two that only have their shape in common the mean sees nothing. Its
    manifest names them by the SHA-256 of their weights.

    What was measured of them is not true of their mean: it comes without figures, calibration and eight-bit copies, which
    ``calibrate --eight-bit`` makes.

    Raises
    ------
    ModelError
        A model is damaged, or not of the first one's shape; or `out` cannot be written.
    """
    near = [second_look_of(folder) for folder in folders]
    lacking = [folder for folder, look in zip(folders, near, strict=True) if look is None]
    if lacking and len(lacking) < len(folders):
        raise ModelError(f"{lacking[0]}: has no second look, and others have one; their mean would not fit together")
    first, told = _mean_of(folders)
    if never := sorted(set.intersection(*(set(trained_without(folder)) for folder in folders))):
        told["without"] = never
    with tempfile.TemporaryDirectory() as scratch:
        second = None
        if not lacking:
            second = Path(scratch) / SECOND_LOOK
            network, of_it = _mean_of([look for look in near if look is not None])
            of_it |= {"without": never} if never else {}
            save_model(network, second, training=of_it, figures={})
        save_model(first, out, training=told, figures={}, second_look=second)


def _mean_of(folders: Sequence[Path]) -> tuple[DualUNet, dict[str, Any]]:
    """The network with the mean of all weights, and whose mean that is.

    The normalisation's means and variances are averaged like weights: between models so near to each other it need not learn anew.
    """
    mean, info = load_network(folders[0])
    sums = {name: tensor.double() for name, tensor in mean.state_dict().items() if tensor.is_floating_point()}
    hashes = [info.weights_sha256]
    for folder in folders[1:]:
        network, other = load_network(folder)
        if network.shape != mean.shape:
            raise ModelError(f"{folder}: has another shape than {folders[0]} (made deeper or wider since?); a mean needs one shape")
        hashes.append(other.weights_sha256)
        for name, tensor in network.state_dict().items():
            if name in sums:
                sums[name] += tensor.double()
    for name, tensor in mean.state_dict().items():
        if name in sums:
            tensor.copy_(sums[name] / len(folders))
    return mean, {"mean_of": hashes}
