"""What ``train`` teaches: the shapes that its networks begin with."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from app.lessons import FrameLesson, SecondLookLesson
from core.errors import UserError
from core.learning.model_file import ONNX, SECOND_LOOK, WEIGHTS, ModelError, load_network
from core.learning.model_writing import save_model, save_with_second_look
from core.perception.unet import DualUNet, UNetShape

SMALL = UNetShape((4, 4, 8, 8, 200), (4, 4, 4, 80), 1, 2)


@pytest.fixture
def small(tmp_path: Path) -> Path:
    torch.manual_seed(1)
    save_model(DualUNet(SMALL), tmp_path / "small", training={}, figures={})
    return tmp_path / "small"


def test_a_second_look_is_made_wider_once(small: Path, tmp_path: Path) -> None:
    plain = SecondLookLesson([], str(small), deepen=False).network
    wider = SecondLookLesson([], str(small), deepen=False, widen=True).network
    assert plain.shape.widths == SMALL.widths
    # A level that is wider than the shipped one already stays so.
    assert wider.shape.widths == (32, 64, 80, 128, 200)
    assert wider.shape.decoder_widths == (32, 48, 48, 80)
    picture = torch.rand(1, 5, 64, 64)
    with torch.no_grad():
        torch.testing.assert_close(wider.eval()(picture), plain.eval()(picture), rtol=1e-4, atol=1e-4)
    whole = tmp_path / "whole"
    save_with_second_look(small, wider, whole, training={}, figures={})
    assert load_network(whole / "second_look")[0].shape == wider.shape
    with pytest.raises(UserError, match="as wide already; leave --widen out"):
        SecondLookLesson([], str(whole), deepen=False, widen=True)


@pytest.mark.parametrize("name", [WEIGHTS, ONNX])
@pytest.mark.parametrize("place", [".", SECOND_LOOK])
@pytest.mark.parametrize("lesson", ["frames", "second look"])
def test_a_model_with_a_damaged_part_is_refused_before_anything_is_taught(
    small: Path, tmp_path: Path, name: str, place: str, lesson: str
) -> None:
    whole = tmp_path / "whole"
    save_with_second_look(small, SecondLookLesson([], str(small), deepen=False).network, whole, training={}, figures={})
    file = whole / place / name
    file.write_bytes(file.read_bytes()[:-1] + b"?")
    with pytest.raises(ModelError, match=f"{name}: SHA-256 differs") as raised:
        if lesson == "frames":
            FrameLesson([], str(whole), None, deepen=False, shallow=False)
        else:
            SecondLookLesson([], str(whole), deepen=False)
    assert len(str(raised.value).splitlines()) == 1
