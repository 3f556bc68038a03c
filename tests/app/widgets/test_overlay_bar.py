"""The switches of the overlays."""

from __future__ import annotations

import pytest
from PySide6.QtWidgets import QAbstractButton

from app.widgets.overlay_bar import OverlayBar
from app.widgets.scene_overlay import Layer
from tests.app.widgets.conftest import Own


def test_chips_switch_their_layer(own: Own) -> None:
    bar = own(OverlayBar())
    seen: list[tuple[Layer, bool]] = []
    bar.toggled.connect(lambda layer, on: seen.append((layer, on)))
    bar.toggle(Layer.VECTORS)
    assert seen == [(Layer.VECTORS, False)]
    assert not bar.is_on(Layer.VECTORS)
    bar.set_all(True)
    assert seen[-1] == (Layer.VECTORS, True)


@pytest.mark.parametrize(("width", "rows"), [(1200, 1), (600, 2), (420, 2)])
def test_chips_go_in_two_rows_where_one_would_cut_their_names(own: Own, width: int, rows: int) -> None:
    bar = own(OverlayBar())
    bar.resize(width, bar.heightForWidth(width))
    bar.grab()
    chips = bar.findChildren(QAbstractButton)
    assert len({chip.y() for chip in chips}) == rows
    assert all(chip.width() >= chip.sizeHint().width() for chip in chips) is (width > 420)
    for chip in chips:
        assert bar.rect().contains(chip.geometry())
        assert not any(chip.geometry().intersects(other.geometry()) for other in chips if other is not chip)
    in_order = sorted(chips, key=lambda chip: (chip.y(), chip.x()))
    assert [chip.text() for chip in in_order] == [layer.value.label for layer in Layer]


def test_layers_have_keys_of_their_own() -> None:
    assert [layer.value.key for layer in Layer] == [*"123456789", "G"]
