"""A vessel's mask drawn in a window of its own: the annotator's picture and mask tools over one picture, without its files."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import QWidget

from app.annotator.canvas import AnnotationCanvas
from app.annotator.editing import RADIUS_NOTCH, MaskMode, Tool
from app.annotator.panels import AnnotationBar
from app.ui.i18n import tr, tr_text
from app.widgets.basics import column
from app.widgets.image_canvas import halvings
from core.annotation.model import Annotation, Readout
from core.annotation.outline import VesselOutline
from core.types import Image, Mask

_ZOOM_STEP = 1.3
_SPACING = 6


class VesselOutlineEditor(QWidget):
    """Draws the mask of the vessel with tube, region, brush and points; begins with the tube.

    ``changed`` comes after every gesture, undo and redo; ``said`` carries a line for the user and whether it is a fault.
    """

    changed = Signal()
    said = Signal(str, bool)

    def __init__(self) -> None:
        super().__init__()
        self.canvas = AnnotationCanvas()
        self.bar = AnnotationBar(blind=True, tools=(Tool.VESSEL_MASK,))
        self.setLayout(column((self.canvas, 1), (self.bar, 0), spacing=_SPACING))
        self._outline: VesselOutline | None = None
        self.canvas.edited.connect(self._on_edited)
        self.canvas.outline_failed.connect(lambda line: self.said.emit(line, True))
        self.bar.mode_chosen.connect(self.set_mode)
        self.bar.switched.connect(self._on_switched)
        canvas = self.canvas
        keys: dict[str, Callable[..., object]] = {m.value.key: partial(self.toggle_mode, m) for m in MaskMode if m.value.key}
        keys |= {"[": partial(canvas.resize_circle, 1 / RADIUS_NOTCH), "]": partial(canvas.resize_circle, RADIUS_NOTCH)}
        keys |= {"+": partial(canvas.zoom, _ZOOM_STEP), "=": partial(canvas.zoom, _ZOOM_STEP)}
        keys |= {"-": partial(canvas.zoom, 1 / _ZOOM_STEP), "F": canvas.fit}
        keys |= {"Ctrl+Z": self.undo, "Ctrl+Shift+Z": self.redo, "Ctrl+Y": self.redo, "S": canvas.simplify_masks}
        keys |= {key: partial(self.bar.toggle, key) for key in "LK"}
        for key, act in keys.items():
            shortcut = QShortcut(QKeySequence(key), self, context=Qt.ShortcutContext.WidgetWithChildrenShortcut)
            shortcut.activated.connect(act)

    @property
    def outline(self) -> VesselOutline | None:
        """What is drawn; None before ``show_image``."""
        return self._outline

    @property
    def vessel_mask(self) -> Mask | None:
        """The vessel, (H, W), with all that was drawn; None before ``show_image``."""
        if self._outline is None:
            return None
        self.canvas.complete()
        return self._outline.mask

    def show_image(self, image: Image, proposal: Mask | None = None) -> None:
        """Draw on another picture (H, W, 3); `proposal` (H, W) is what is there to begin with."""
        self.show_outline(VesselOutline(image, proposal))

    def show_outline(self, outline: VesselOutline) -> None:
        """Go on with an outline; it is changed in place."""
        self._outline = outline
        self.canvas.show_image(halvings(outline.image), outline.annotation, lambda _annotation: Readout())
        self.canvas.set_tool(Tool.VESSEL_MASK)
        self.set_mode(MaskMode.TUBE)

    def set_mode(self, mode: MaskMode) -> None:
        self.canvas.complete()
        self.canvas.set_mask_mode(mode)
        self.bar.show_tool(Tool.VESSEL_MASK, mode)
        self.canvas.setFocus()

    def toggle_mode(self, mode: MaskMode) -> None:
        """Choose a mode, or go back to points."""
        self.set_mode(MaskMode.POINTS if self.canvas.mask_mode is mode else mode)

    def undo(self) -> None:
        """Back one gesture, and say which; while an outline is drawn, its last point."""
        if self._outline is None or self.canvas.undo_draft_point():
            return
        self.canvas.complete()
        action = self._outline.undo_action
        self._outline.undo()
        self._show(tr("Undone: {action}", action=tr_text(action)) if action else tr("Nothing to undo"))

    def redo(self) -> None:
        """Forward one gesture, and say which."""
        if self._outline is None:
            return
        self.canvas.complete()
        can_redo = self._outline.can_redo
        self._outline.redo()
        action = tr_text(self._outline.undo_action)
        self._show(tr("Done again: {action}", action=action) if can_redo else tr("Nothing to redo"))

    def clear(self) -> None:
        """An empty mask; undo brings it back."""
        if self._outline is not None:
            self.canvas.complete()
            self._outline.edit("clear the vessel mask", Annotation())
            self._show("")

    def _on_edited(self, action: str, annotation: Annotation | None) -> None:
        if self._outline is None:
            return
        if annotation is not None:
            self._outline.edit(action, annotation)
        self.canvas.show_annotation(self._outline.annotation)
        self.changed.emit()

    def _on_switched(self, key: str, on: bool) -> None:
        (self.canvas.set_loupe if key == "L" else self.canvas.set_masks_shown)(on)
        self.canvas.setFocus()

    def _show(self, line: str) -> None:
        if self._outline is not None:
            self.canvas.show_annotation(self._outline.annotation)
            self.changed.emit()
        if line:
            self.said.emit(line, False)
