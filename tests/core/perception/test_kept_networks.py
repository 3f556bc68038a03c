"""What OpenVINO has compiled is taken from the last start, whole and of just this network, or compiled anew."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import torch

from core.learning.model_writer import save_model
from core.perception import inference
from core.perception.inference import OpenVinoSegmenter
from core.perception.unet import DualUNet, UNetShape

PICTURE = np.random.default_rng(5).integers(0, 256, (64, 96, 3)).astype(np.uint8)


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two networks that say something else of the same picture."""
    folders = []
    for seed in (1, 2):
        torch.manual_seed(seed)
        network = DualUNet(UNetShape((8, 8, 8, 8, 8), (8, 8, 8, 8), 1, 2))
        for decoder in (network.vessel, network.robot):
            torch.nn.init.normal_(decoder.output.weight)
            torch.nn.init.zeros_(decoder.output.bias)
        folders.append(tmp_path_factory.mktemp("models") / str(seed))
        save_model(network, folders[-1], training={}, figures={}, examples=[PICTURE])
    return folders


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "lumenpilot" / "networks"


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """An entry for each network that was kept, and so had been compiled."""
    names: list[str] = []
    keep = inference.keep

    def note(name: str, data: bytes) -> None:
        names.append(name)
        keep(name, data)

    monkeypatch.setattr(inference, "keep", note)
    return names


def look(model: Path, precision: str = "int8", threads: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Both masks, and the robot's once more from the network that shows it alone, as a new start finds them."""
    segment = OpenVinoSegmenter(model, threads, precision)
    return np.stack(segment(PICTURE)), segment.robots([PICTURE])[0]


@pytest.mark.parametrize("precision", ["int8", "fp32"])
def test_the_second_start_takes_what_the_first_has_compiled(models: list[Path], compiled: list[str], precision: str) -> None:
    first, second = (look(models[0], precision) for _ in range(2))
    assert len(compiled) == len(set(compiled)) == 2, "both masks, and the robot alone"
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one, other)


def test_another_network_is_never_taken(models: list[Path], compiled: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    first, other = look(models[0]), look(models[1])
    assert np.abs(first[0] - other[0]).mean() > 0.01
    exact = look(models[0], "fp32")
    assert 0.0 < np.abs(first[0] - exact[0]).mean() < 0.05
    look(models[0], threads=2)
    assert len(set(compiled)) == len(compiled) == 8
    monkeypatch.setattr(inference, "_machine", lambda: "another processor")
    look(models[0])
    monkeypatch.setattr(inference, "_this_file", lambda: "another version of the program")
    look(models[0])
    assert len(set(compiled)) == len(compiled) == 12


def _cut(data: bytes) -> bytes:
    return data[: len(data) // 2]


def _turn_a_bit(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


def test_a_damaged_one_is_compiled_again_and_mended(models: list[Path], compiled: list[str], folder: Path) -> None:
    whole = look(models[0])
    for count, damage in enumerate((_cut, _turn_a_bit, lambda _: b"", lambda _: b"x" * 31), start=2):
        for path in folder.iterdir():
            path.write_bytes(damage(path.read_bytes()))
        np.testing.assert_array_equal(look(models[0])[0], whole[0])
        assert len(compiled) == 2 * count
    look(models[0])
    assert len(compiled) == 10


def test_what_is_whole_but_no_network_is_compiled_again(models: list[Path], compiled: list[str], folder: Path) -> None:
    whole = look(models[0])
    for path in list(folder.iterdir()):
        inference.keep(path.stem, b"of a library that wrote it otherwise")
    compiled.clear()
    np.testing.assert_array_equal(look(models[0])[0], whole[0])
    assert len(compiled) == 2


def test_where_nothing_can_be_kept_it_is_compiled(models: list[Path], compiled: list[str], folder: Path) -> None:
    folder.parent.parent.mkdir()
    folder.parent.write_text("a file where the folder should be")
    first, second = look(models[0]), look(models[0])
    np.testing.assert_array_equal(first[0], second[0])
    assert len(compiled) == 4


def test_a_user_without_a_home_perceives_as_well(models: list[Path], compiled: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def no_home(*_: object) -> Path:
        raise RuntimeError("could not determine home directory")

    monkeypatch.setattr(inference, "user_cache_path", no_home)
    first, second = look(models[0]), look(models[0])
    np.testing.assert_array_equal(first[0], second[0])
    assert len(compiled) == 4


def test_one_that_may_only_be_read_is_as_good(models: list[Path], compiled: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    look(models[0])
    monkeypatch.setattr("core.perception.inference.os.utime", refuse)
    look(models[0])
    assert len(compiled) == 2


def test_a_network_that_cannot_be_kept_is_used(models: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("this plug-in exports nothing")

    monkeypatch.setattr(inference, "keep", fail)
    assert look(models[0])[0].shape == (2, *PICTURE.shape[:2])


def test_what_was_kept_last_stays_whatever_the_clock_says(folder: Path) -> None:
    for number in range(inference._MOST):
        name = f"{number:032x}"
        inference.keep(name, b"from the future")
        os.utime(folder / f"{name}.network", (9e9, 9e9))
    inference.keep("f" * 32, b"now")
    assert inference.read("f" * 32) == b"now"
    assert len(list(folder.iterdir())) == inference._MOST


def test_those_that_were_not_used_for_longest_go(folder: Path) -> None:
    names = [f"{number:032x}" for number in range(inference._MOST)]
    for age, name in enumerate(names):
        inference.keep(name, name.encode())
        os.utime(folder / f"{name}.network", (1e9 + age, 1e9 + age))
    assert inference.read(names[0]) == names[0].encode()  # which is a use of it
    inference.keep("f" * 32, b"one more")
    assert inference.read(names[0]) is not None
    assert inference.read(names[1]) is None
    assert len(list(folder.iterdir())) == inference._MOST
