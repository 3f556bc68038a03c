"""The frames that all tests of crops on a device share."""

from __future__ import annotations

import pytest

from core.learning.dataset import Sample
from core.learning.gpu_batches import DeviceFrames
from tests.core.device.device_set import loaded, write_frames


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> list[Sample]:
    return write_frames(tmp_path_factory.mktemp("set"))


@pytest.fixture(scope="module")
def frames(samples: list[Sample]) -> DeviceFrames:
    return loaded(samples)
