"""Muon, momentum whose direction is orthogonalised, for the kernels of convolutions, and AdamW for everything else.

K. Jordan et al., "Muon: an optimizer for hidden layers in neural networks", 2024. It learns in 2 minutes what takes AdamW alone
several times as long (docs/method.md). Our own instead of ``torch.optim.Muon``: that one takes matrices only and computes in bf16,
which is slow on processors without it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import torch
from torch import Tensor, nn

_QUINTIC = (3.4445, -4.7750, 2.0315)
"""Coefficients of the Newton-Schulz iteration that drives all singular values into 0.7..1.2 within five rounds."""


def orthogonalised(matrix: Tensor, rounds: int = 5) -> Tensor:
    """The (rows, columns) matrix with its singular values brought near 1, by a Newton-Schulz iteration.

    Every round multiplies by a polynomial of the Gram matrix, and all of these commute. So they are gathered in matrices of the
    shorter side, and the long one is multiplied once instead of twice a round: a third of the work for the kernels here.
    """
    a, b, c = _QUINTIC
    x: Tensor = matrix / (matrix.norm() + 1e-7)
    tall = x.shape[0] > x.shape[1]
    if tall:
        x = x.T
    gram = x @ x.T
    unit = torch.eye(len(gram), dtype=gram.dtype, device=gram.device)
    product = unit
    for left in reversed(range(rounds)):
        factor = a * unit + b * gram + c * gram @ gram
        product = factor @ product
        if left:
            gram = factor @ gram @ factor
    x = product @ x
    return x.T if tall else x


class Muon(torch.optim.Optimizer):
    """Steps of the same root mean square as AdamW's (0.2 of the learning rate), whatever the size of the kernel."""

    def __init__(self, parameters: Iterable[Tensor], lr: float, momentum: float = 0.95, weight_decay: float = 0.01) -> None:
        super().__init__(parameters, {"lr": lr, "momentum": momentum, "weight_decay": weight_decay})

    @torch.no_grad()
    def step(self, closure: Callable[[], float] | None = None) -> None:  # type: ignore[override]
        """One step along the orthogonalised Nesterov momentum of every parameter that has a gradient."""
        assert closure is None, "Muon needs no second look at the loss"
        for group in self.param_groups:
            for parameter in group["params"]:
                if parameter.grad is not None:
                    self._step_of(parameter, group)

    def _step_of(self, parameter: Tensor, group: dict[str, Any]) -> None:
        assert parameter.grad is not None
        state = self.state[parameter]
        if "momentum" not in state:
            state["momentum"] = torch.zeros_like(parameter)
        state["momentum"].lerp_(parameter.grad, 1 - group["momentum"])
        direction = parameter.grad.lerp(state["momentum"], group["momentum"]).flatten(1)
        scale = 0.2 * max(direction.shape) ** 0.5
        parameter.mul_(1 - group["lr"] * group["weight_decay"])
        parameter.sub_(orthogonalised(direction).view_as(parameter), alpha=group["lr"] * scale)


def make_optimizers(network: nn.Module, learning_rate: float, weight_decay: float) -> list[torch.optim.Optimizer]:
    """Muon for the 3x3 kernels, AdamW at 0.3 of its learning rate for what is left: outputs, up-samplings, scales and offsets."""
    kernels = [m.weight for m in network.modules() if isinstance(m, nn.Conv2d) and m.kernel_size != (1, 1)]
    taken = {id(parameter) for parameter in kernels}
    rest = [parameter for parameter in network.parameters() if id(parameter) not in taken]
    return [Muon(kernels, learning_rate), torch.optim.AdamW(rest, learning_rate * 0.3, weight_decay=weight_decay)]
