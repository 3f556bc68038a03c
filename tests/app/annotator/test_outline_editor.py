"""The vessel's outline in a widget of its own: tools, undo, the mask that comes out."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from app.annotator.editing import MaskMode
from app.annotator.outline_editor import VesselOutlineEditor
from core.types import Image, Mask, Point

TRUE = np.zeros((240, 320), bool)
TRUE[100:131] = True


def picture() -> Image:
    return np.repeat(np.where(TRUE, 170, 70).astype(np.uint8)[..., None], 3, axis=2)


@pytest.fixture
def editor(qtbot: QtBot) -> VesselOutlineEditor:
    made = VesselOutlineEditor()
    qtbot.addWidget(made)
    made.resize(900, 640)
    made.show()
    qtbot.waitExposed(made)
    return made


def at(editor: VesselOutlineEditor, point: Point) -> QPoint:
    return QPoint(*(round(value) for value in editor.canvas.view.to_screen(point)))


def drag(editor: VesselOutlineEditor, start: Point, end: Point) -> None:
    QTest.mousePress(editor.canvas, Qt.MouseButton.LeftButton, pos=at(editor, start))
    for share in (0.3, 0.6, 1.0):
        QTest.mouseMove(editor.canvas, at(editor, (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))))
    QTest.mouseRelease(editor.canvas, Qt.MouseButton.LeftButton, pos=at(editor, end))


def dice(a: Mask, b: Mask) -> float:
    return 2.0 * float((a & b).sum()) / float(a.sum() + b.sum())


def test_there_is_no_mask_without_a_picture(editor: VesselOutlineEditor) -> None:
    assert editor.vessel_mask is None and editor.outline is None
    editor.undo()
    editor.redo()
    editor.clear()
    assert editor.vessel_mask is None


def test_one_drag_outlines_a_vessel_across_the_picture(editor: VesselOutlineEditor, qtbot: QtBot) -> None:
    editor.show_image(picture())
    assert editor.canvas.mask_mode is MaskMode.TUBE and editor.bar.hint.text().startswith("Drag along the middle")
    editor.canvas.editor.radius_px = 14.0
    with qtbot.waitSignal(editor.changed):
        drag(editor, (4.0, 114.0), (315.0, 116.0))
    assert dice(editor.vessel_mask, TRUE) > 0.95


def test_the_mask_has_what_is_not_computed_yet(editor: VesselOutlineEditor) -> None:
    editor.show_image(picture())
    editor.canvas.editor.radius_px = 14.0
    drag(editor, (4.0, 114.0), (315.0, 116.0))
    assert dice(editor.vessel_mask, TRUE) > 0.95


def test_undo_leads_back_to_the_proposal_and_redo_forward(editor: VesselOutlineEditor) -> None:
    proposal = TRUE.copy()
    proposal[:, 200:] = False
    editor.show_image(picture(), proposal)
    said: list[str] = []
    editor.said.connect(lambda line, _is_fault: said.append(line))
    editor.canvas.editor.radius_px = 14.0
    drag(editor, (190.0, 115.0), (315.0, 115.0))
    assert dice(editor.vessel_mask, TRUE) > 0.95
    editor.undo()
    assert dice(editor.vessel_mask, proposal) > 0.98 and said == ["Undone: add a tube to the vessel mask"]
    editor.redo()
    assert dice(editor.vessel_mask, TRUE) > 0.95
    editor.clear()
    assert not editor.vessel_mask.any()
    editor.undo()
    assert dice(editor.vessel_mask, TRUE) > 0.95


def test_keys_choose_modes(editor: VesselOutlineEditor, qtbot: QtBot) -> None:
    editor.show_image(picture())
    editor.activateWindow()
    editor.canvas.setFocus()
    qtbot.waitUntil(editor.canvas.hasFocus)
    for key, mode in ((Qt.Key.Key_R, MaskMode.REGION), (Qt.Key.Key_T, MaskMode.BRUSH), (Qt.Key.Key_T, MaskMode.POINTS)):
        QTest.keyClick(editor.canvas, key)
        assert editor.canvas.mask_mode is mode
        assert [shown for shown, chip in editor.bar.modes.items() if chip.isChecked()] == [mode][: mode is not MaskMode.POINTS]


def test_a_drawing_is_gone_on_with(editor: VesselOutlineEditor) -> None:
    editor.show_image(picture(), TRUE)
    outline = editor.outline
    editor.show_image(picture())
    editor.show_outline(outline)
    assert dice(editor.vessel_mask, TRUE) > 0.99
