"""Means of models: of networks of one shape alone."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from core.devices import UserError
from core.perception.unet import DualUNet, UNetShape
from tools.average_models import mean_network

_SHAPE = UNetShape(widths=(4, 4, 4, 4, 4))


def test_the_mean_has_each_networks_share_of_every_weight() -> None:
    one, other = DualUNet(_SHAPE), DualUNet(_SHAPE)
    mean = mean_network([one, other], [3.0, 1.0]).state_dict()
    for name, values in one.state_dict().items():
        if values.is_floating_point():
            torch.testing.assert_close(mean[name], 0.75 * values + 0.25 * other.state_dict()[name])


def test_networks_of_different_shapes_have_no_mean() -> None:
    with pytest.raises(UserError, match="different shapes"):
        mean_network([DualUNet(_SHAPE), DualUNet(replace(_SHAPE, inputs=5))], [1.0, 1.0])
