"""The steps of the window that teaches a bench, one page each, with the picture or drawing that each shows at the right."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QIcon, QImage, QPainter, QPaintEvent, QPen, QPixmap, QPolygonF, QTransform
from PySide6.QtWidgets import (
    QAbstractItemView,
    QLabel,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QProgressBar,
    QPushButton,
    QSizePolicy,
    QSpinBox,
    QWidget,
)

from app.annotator.canvas import AnnotationCanvas
from app.annotator.editing import MaskMode, Tool
from app.annotator.outline_editor import VesselOutlineEditor
from app.rig_wizard.pages_base import StepPage, WizardPicture, note
from app.teaching.folder import (
    ENOUGH_BENDS,
    ENOUGH_FRAMES,
    PLACES,
    WANTED,
    LookKind,
    TakenFrame,
    TakenLook,
    TeachingStep,
    TeachingView,
    middle_of,
)
from app.teaching.model import MINUTES, TeachingModel, look_line, name_for
from app.training.dialog import BeforeAfter
from app.training.model import TrainingPhase, TrainingState
from app.ui import theme
from app.ui.i18n import mark, tr, tr_text
from app.ui.palette import ON_PICTURE
from app.widgets.basics import button, column, enable, line, set_main_button
from app.widgets.image_canvas import halvings
from core.annotation.masks import fill, polygons_of
from core.annotation.model import Annotation, History, MaskTarget, Readout
from core.bench.coverage import ASKED, COVERED, Side
from core.types import Image, Mask

_INK_OF = {COVERED: (ON_PICTURE.VESSEL, 120), ASKED: (ON_PICTURE.SIM, 90)}
"""Colour and opacity (0..255) of the vessel map: where the robot has been, and the branch that is asked for next."""
_MODE_TEXT = {
    MaskMode.REGION: mark("a click adds what lies around it, a right click takes it away."),
    MaskMode.TUBE: mark("drag along the middle of a branch, the circle as wide as it; the wheel sets the width."),
    MaskMode.BRUSH: mark("drag paints, right drag takes away."),
}
"""What a press does, in a line."""
_VEIL = 110
"""Opacity of what is not known of the empty bench."""
_SIDE_TEXT = {
    Side.UPPER_LEFT: mark("the branch at the upper left"),
    Side.TOP: mark("the branch at the top"),
    Side.UPPER_RIGHT: mark("the branch at the upper right"),
    Side.LEFT: mark("the left branch"),
    Side.MIDDLE: mark("the branch in the middle"),
    Side.RIGHT: mark("the right branch"),
    Side.LOWER_LEFT: mark("the branch at the lower left"),
    Side.BOTTOM: mark("the branch at the bottom"),
    Side.LOWER_RIGHT: mark("the branch at the lower right"),
}


class BenchPicture(WizardPicture):
    """The picture with the vessel tree over it: blue where the robot has been, orange the branch that is asked for next."""

    def __init__(self) -> None:
        super().__init__()
        self._outlines: list[QPolygonF] = []
        self._veil: QImage | None = None
        self._working = (1, 1)
        self._caption = tr("Live")

    def show_bench(
        self,
        working: tuple[int, int],
        tree: NDArray[np.uint8] | None = None,
        unknown: Mask | None = None,
    ) -> None:
        """What is drawn over the picture, in pixels of a picture of size `working` (width, height).

        Parameters
        ----------
        tree : the vessel map, see ``VesselCoverage.tree``.
        unknown : bool (h, w), what is not known of the empty bench.
        """
        self._working = working
        self._outlines = []
        pixels = np.zeros((working[1], working[0], 4), np.uint8)
        if unknown is not None:
            pixels[unknown] = (0, 0, 0, _VEIL)
        if tree is not None:
            for kind, (ink, opacity) in _INK_OF.items():
                pixels[tree == kind] = (*theme.rgb(ink), opacity)
            walls, _ = cv2.findContours((tree > 0).view(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
            self._outlines = [_polygon(np.asarray(wall[:, 0], np.int32)) for wall in walls]
        self._veil = QImage(pixels.tobytes(), *working, 4 * working[0], QImage.Format.Format_RGBA8888) if pixels.any() else None
        self.update()

    @property
    def caption(self) -> str:
        """What is said in the corner."""
        return self._caption

    def show_caption(self, text: str) -> None:
        if text != self._caption:
            self._caption = text
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        if self._image is None:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        box, _ = self._place(self._image)
        if self._veil is not None:
            painter.drawImage(box, self._veil)
        scale = box.width() / self._working[0]
        to_widget = QTransform(scale, 0.0, 0.0, scale, box.left() + 0.5 * scale, box.top() + 0.5 * scale)
        for shape in map(to_widget.map, self._outlines):
            for pen in (QPen(QColor(0, 0, 0, 130), 3.0), QPen(theme.colour(ON_PICTURE.TEXT, 0.9), 1.2)):
                painter.setPen(pen)
                painter.drawPolygon(shape)
        if self._caption:
            self._paint_caption(painter, box)
        painter.end()

    def _paint_caption(self, painter: QPainter, box: QRectF) -> None:
        painter.setFont(theme.semi_bold(13))
        width = painter.fontMetrics().horizontalAdvance(self._caption) + 20
        frame = QRectF(box.left() + 10, box.top() + 10, width, 28)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(0, 0, 0, 150))
        painter.drawRoundedRect(frame, 6, 6)
        painter.setPen(QColor(ON_PICTURE.TEXT))
        painter.drawText(frame, Qt.AlignmentFlag.AlignCenter, self._caption)


def _polygon(points: NDArray[np.int32]) -> QPolygonF:
    return QPolygonF([QPointF(x, y) for x, y in points.tolist()])


def to_pixmap(image: Image) -> QPixmap:
    height, width = image.shape[:2]
    return QPixmap.fromImage(QImage(image.tobytes(), width, height, 3 * width, QImage.Format.Format_RGB888))


class TeachingPage(StepPage):
    """One step. ``right``: what is shown at the right of it.

    ``edited`` comes when what was drawn has changed, and with it whether the page may be left.
    """

    edited = Signal()
    step = TeachingStep.EMPTY
    is_live = False
    """Whether the picture at the right is the live one."""

    def __init__(self, model: TeachingModel, right: QWidget) -> None:
        super().__init__()
        self.model, self.right = model, right

    @property
    def view(self) -> TeachingView:
        return self.model.view

    @property
    def is_done(self) -> bool:
        """Whether nothing more is asked for here."""
        return self.view.step > self.step

    @property
    def may_leave(self) -> bool:
        return self.view.may_leave

    def enter(self) -> None:
        """The page comes to the front."""

    def leave(self) -> None:
        """Another page comes to the front, or the window is closed."""

    def cancel(self) -> bool:
        """Drop what is being drawn; False when there is nothing."""
        return False

    def next(self, step: TeachingStep) -> None:
        """Keep what was done here, and go on."""
        self.model.go(step)

    def refresh(self) -> None:
        """Show what there is now."""


class EmptyPage(TeachingPage):
    """The empty picture, or three places of the robot from which it is computed."""

    name = mark("Empty bench")
    hint = mark(
        "Draw the robot back until none of it is in the picture: by hand, or hold Down with the servos on (F3); at the end of its "
        "way let go, and hold it again. Take your hands out of the picture. From here on camera and phantom stay where they are."
    )
    step = TeachingStep.EMPTY
    is_live = True

    def __init__(self, model: TeachingModel, picture: BenchPicture) -> None:
        super().__init__(model, picture)
        self._picture = picture
        self.take = self.main = button(tr("&Take picture"), model.take_empty, tr("Takes eight pictures within a second"))
        self.place = button(tr("Take &place"), model.take_place, tr("One picture with the robot in another place"))
        self.thumb = QLabel(tr("not taken yet"))
        self.thumb.setFixedSize(232, 174)
        self.thumb.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.thumb.setAccessibleName(tr("The empty picture that was taken"))
        theme.set_sheet(self.thumb, "background: @WINDOW; color: @TEXT_FAINT; border: 1px solid @LINE; border-radius: 6px;")
        self.found = _lines(84)
        cannot = tr(
            "The robot cannot be taken out? Lay it in {count} different places and take each: the empty bench is computed.",
            count=PLACES,
        )
        self.add(self.take, line(self.thumb, None), self.found, None, note(cannot), self.place)

    @property
    def is_done(self) -> bool:
        return self.view.empty is not None and not self.view.robot_like

    def refresh(self) -> None:
        view, busy = self.view, self.model.is_busy
        enable(not busy, self.take, self.place)
        count = len(view.places)
        numbered = tr("Take &place {number} of {count}", number=count + 1, count=PLACES)
        self.place.setText(numbered if count < PLACES else tr("Take one more &place"))
        self.take.setText(tr("&Take it again") if view.empty is not None else tr("&Take picture"))
        if view.empty is None:
            self.thumb.setText("" if busy else tr("not taken yet"))  # what was taken before may just be read
        else:
            marked = view.empty.copy()  # on what was taken: over the live picture it would hide the robot that is drawn back
            cv2.drawContours(marked, view.robot_like, -1, theme.rgb(ON_PICTURE.SIM), 3)
            pixmap = to_pixmap(marked)
            keep, smooth = Qt.AspectRatioMode.KeepAspectRatio, Qt.TransformationMode.SmoothTransformation
            self.thumb.setPixmap(pixmap.scaled(self.thumb.size() - QSize(2, 2), keep, smooth))
        self.found.setText(self._words(view))
        size = (view.empty.shape[1], view.empty.shape[0]) if view.empty is not None else (640, 480)
        unknown = ~view.known if view.known is not None else None
        self._picture.show_bench(size, unknown=unknown)

    def _words(self, view: TeachingView) -> str:
        if view.empty is None:
            return tr("{count} places taken", count=len(view.places)) if view.places else ""
        if view.robot_like:
            x, y = middle_of(view.robot_like[0])
            return tr(
                "The present model sees a robot near ({x:.0f}, {y:.0f}), outlined above. If it is one, draw it back and take the "
                "picture again; if not, go on.",
                x=x,
                y=y,
            )
        if view.known is not None and not view.known.all():
            share = 100.0 * float(1.0 - view.known.mean())
            return tr("{share:.1f} % of the picture are not known (dark): there the robot lay in all pictures.", share=share)
        return tr("Good: the empty bench is known.")


class VesselPage(TeachingPage):
    """The vessel's outline, drawn once, beginning with the network's proposal."""

    name = mark("Vessel")
    hint = mark(
        "Blue is the vessel as the model sees it in the empty picture. Correct it once; errors of a pixel or two do no harm. The "
        "tube's wall does not belong to it."
    )
    step = TeachingStep.VESSEL

    def __init__(self, model: TeachingModel, editor: VesselOutlineEditor) -> None:
        super().__init__(model, editor)
        self.editor = editor
        self._begun = Annotation()
        """The drawing with which the page was opened."""
        self.undo = button(tr("&Undo"), editor.undo)
        tip = tr("The model's proposal instead of what was drawn; Undo brings that back")
        self.again = button(tr("Propose &again"), model.propose_vessel, tip)
        self.words = _lines(60)
        for mode in (MaskMode.REGION, MaskMode.TUBE, MaskMode.BRUSH):
            self.add(note(f"<b>{tr(mode.value.label)}</b> ({mode.value.key}): {tr(_MODE_TEXT[mode])}"))
        self.add(line(self.undo, self.again), self.words, None)
        editor.changed.connect(self.edited)
        model.proposed.connect(self._on_proposed)

    @property
    def may_leave(self) -> bool:
        return self.editor.outline is not None and bool(self.editor.outline.annotation.masks)

    @property
    def is_done(self) -> bool:
        return self.view.vessel is not None

    def enter(self) -> None:
        view, outline = self.view, self.editor.outline
        assert view.empty is not None
        if outline is not None and outline.image is view.empty and outline.undo_action:
            return  # what was drawn is there, with its undo
        self.editor.show_image(view.empty, view.drawn if view.drawn is not None else view.vessel)
        self.editor.set_mode(MaskMode.REGION)
        self._begun = self._annotation
        if view.vessel is None and view.drawn is None:
            self.model.propose_vessel()

    @property
    def _annotation(self) -> Annotation:
        return self.editor.outline.annotation if self.editor.outline is not None else Annotation()

    def leave(self) -> None:
        vessel, view = self.editor.vessel_mask, self.view
        if vessel is None or not vessel.any() or self._annotation == self._begun:
            return
        if not any(np.array_equal(known, vessel) for known in (view.drawn, view.vessel) if known is not None):
            self.model.keep_drawn(vessel)

    def cancel(self) -> bool:
        canvas = self.editor.canvas
        if not canvas.cancel():
            return False
        self.editor.set_mode(canvas.mask_mode)
        return True

    def next(self, step: TeachingStep) -> None:
        vessel = self.editor.vessel_mask
        assert vessel is not None
        if self.view.vessel is not None and self.view.drawn is None and self._annotation == self._begun:
            self.model.go(step)  # the same vessel: its outline as points may differ by pixels
        else:
            self.model.set_vessel(vessel, step)

    def refresh(self) -> None:
        outline, busy = self.editor.outline, self.model.is_busy
        enable(outline is not None and not busy, self.again, self.editor)
        self.undo.setEnabled(not busy and outline is not None and bool(outline.undo_action))
        is_empty = outline is not None and not outline.annotation.masks and not busy
        self.words.setText(tr("The model sees no vessel here: drag a tube along the middle of each branch.") if is_empty else "")

    def _on_proposed(self, vessel: Mask) -> None:
        outline = self.editor.outline
        if outline is not None:
            outline.edit("proposal", Annotation(masks=polygons_of(vessel, MaskTarget.VESSEL)))
            self.editor.canvas.show_annotation(outline.annotation)
            if not vessel.any():
                self.editor.set_mode(MaskMode.TUBE)


class _Goal(QWidget):
    """A bar with what it counts, before and after it."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self._name, self._bar, self._value = QLabel(name), QProgressBar(), QLabel()
        self._bar.setTextVisible(False)
        self._bar.setFixedHeight(8)
        self._bar.setAccessibleName(name)
        self._name.setFixedWidth(76)
        self._value.setFixedWidth(64)
        self._value.setAlignment(Qt.AlignmentFlag.AlignRight)
        theme.set_sheet(self._value, "color: @TEXT_DIM;")
        self.setLayout(line(self._name, (self._bar, 1), self._value))

    def show_share(self, share: float, text: str) -> None:
        self._bar.setRange(0, 1000)
        self._bar.setValue(round(1000 * min(1.0, max(0.0, share))))
        self._value.setText(text)


_STRIP = 3
"""Small pictures of the newest frames beside each other."""


class MovePage(TeachingPage):
    """The robot is moved through the vessel, and frames are taken by themselves."""

    name = mark("Move the robot")
    hint = mark(
        "Move the robot slowly through all branches, and bend its head both ways at some places; by hand, or with the "
        "arrow keys once the servos are on (F3). Frames are taken by themselves, and the map fills where it has been."
    )
    step = TeachingStep.MOVE
    is_live = True

    def __init__(self, model: TeachingModel, picture: BenchPicture) -> None:
        super().__init__(model, picture)
        self._picture = picture
        self.said = QLabel(wordWrap=True)
        self.said.setFixedHeight(62)
        self.said.setAlignment(Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft)
        self.said.setAccessibleName(tr("What became of the newest picture"))
        self.places, self.bends, self.frames = _Goal(tr("Vessel")), _Goal(tr("Bends")), _Goal(tr("Frames"))
        self.lacks = _lines(58)
        self.pause = button(tr("&Pause"), self._on_pause, tr("Take no frames for a while"))
        self.pause.setCheckable(True)
        self._thumbs = [QLabel() for _ in range(_STRIP)]
        for thumb in self._thumbs:
            thumb.setFixedSize(116, 87)
            thumb.setScaledContents(True)
            theme.set_sheet(thumb, "background: @WINDOW; border-radius: 4px;")
        strip = line(*self._thumbs, None, spacing=6)
        self.add(self.said, self.places, self.bends, self.frames, self.lacks, None, strip, line(self.pause, None))
        self._shown: tuple[str, ...] = ()
        model.looked.connect(self._on_looked)

    @property
    def is_done(self) -> bool:
        return self.view.is_enough

    def enter(self) -> None:
        self.pause.setChecked(False)
        self._say(tr("Waiting for the robot to move"), "TEXT_DIM")
        self.model.watch(True)

    def leave(self) -> None:
        self.model.watch(False)

    def refresh(self) -> None:
        view = self.view
        self.pause.setChecked(not self.model.is_watching)  # a full disk ends it, too
        if view.empty is None:
            return
        size = view.empty.shape[1], view.empty.shape[0]
        self._picture.show_bench(size, view.tree)
        ends = [branch for branch in view.branches if branch.is_wanted and branch.is_end] or view.branches
        self.places.show_share(view.share, tr("{done} of {count}", done=sum(one.is_done for one in ends), count=len(ends)))
        bends = tr("{done} of {count}", done=min(view.bends, ENOUGH_BENDS), count=ENOUGH_BENDS)
        self.bends.show_share(view.bends / ENOUGH_BENDS, bends)
        frames = tr("{done} of {count}", done=view.used, count=ENOUGH_FRAMES) if view.used < ENOUGH_FRAMES else str(view.used)
        self.frames.show_share(view.used / ENOUGH_FRAMES, frames)
        self.lacks.setText(lacks_line(view))
        newest = tuple(taken.stem for taken in view.frames[-_STRIP:])
        if newest != self._shown:
            self._shown = newest
            for label, taken in zip(self._thumbs, view.frames[-_STRIP:], strict=False):
                label.setPixmap(to_pixmap(taken.thumb))

    def _on_looked(self, look: TakenLook) -> None:
        if look.kind is LookKind.STILL:
            return  # what was said last stays: nothing flickers while the robot rests
        taken = look.kind in (LookKind.PLACE, LookKind.BEND)
        text = look_line(look, self.view)
        if look.needs_empty:
            text += tr(" (Back leads to the empty picture; the frames stay)")
        self._say(text, "ALLOWED" if taken else "SIM" if look.kind is LookKind.REJECTED else "TEXT_DIM")

    def _say(self, text: str, role: str) -> None:
        theme.set_sheet(self.said, f"color: @{role}; font-size: 15px; font-weight: 600;")
        self.said.setText(text)

    def _on_pause(self) -> None:
        self.model.watch(not self.pause.isChecked())
        if self.pause.isChecked():
            self._say(tr("Paused"), "TEXT_DIM")


def lacks_line(view: TeachingView) -> str:
    if view.is_enough:
        return tr("Nothing is missing. Next shows the frames; more may be taken.")
    names = list(dict.fromkeys(tr(_SIDE_TEXT[branch.side]) for branch in view.missing))
    if view.bends < ENOUGH_BENDS:
        names.append(tr("a bend of the head"))
    if view.used < ENOUGH_FRAMES:
        names.append(tr("{count} more frames", count=ENOUGH_FRAMES - view.used))
    return tr("Missing: {what}", what=", ".join(names[:4]))


class FramesPage(TeachingPage):
    """The frames as small pictures: to leave out, or to correct at the right."""

    name = mark("Look through")
    hint = mark("Orange must be the robot, all of it and nothing else. Leave out what is wrong, or correct it at the right.")
    step = TeachingStep.FRAMES

    def __init__(self, model: TeachingModel, canvas: AnnotationCanvas) -> None:
        super().__init__(model, canvas)
        self.canvas = canvas
        self._history = History()
        self._open: str | None = None
        self._was_corrected = False
        self.list = QListWidget()
        self.list.setViewMode(QListWidget.ViewMode.IconMode)
        self.list.setIconSize(QSize(152, 114))
        self.list.setGridSize(QSize(162, 140))
        self.list.setResizeMode(QListWidget.ResizeMode.Adjust)
        self.list.setMovement(QListWidget.Movement.Static)
        self.list.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.list.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.list.setAccessibleName(tr("Frames"))
        self.list.currentRowChanged.connect(self._on_row)
        self.list.itemDoubleClicked.connect(lambda _item: self._toggle())
        self.out = button(tr("&Leave out"), self._toggle, tr("A double click does it, too"))
        self.undo = button(tr("&Undo"), self._on_undo)
        self.why = note("")
        self.why.setFixedHeight(40)
        self.add((self.list, 1), self.why, line(self.out, self.undo))
        canvas.edited.connect(self._on_edited)

    def enter(self) -> None:
        self._open = None
        self.list.clear()
        for _ in self.view.frames:
            self.list.addItem(QListWidgetItem())
        self.refresh()
        doubtful = next((row for row, taken in enumerate(self.view.frames) if not taken.is_used), 0)
        self.list.setCurrentRow(doubtful if self.view.frames else -1)

    def cancel(self) -> bool:
        is_drawing = bool(self.canvas.editor.stroke)
        if is_drawing:
            self.canvas.cancel()
            self.canvas.set_mask_mode(MaskMode.BRUSH)
        return is_drawing

    def refresh(self) -> None:
        frames = self.view.frames
        for row, taken in enumerate(frames[: self.list.count()]):
            item = self.list.item(row)
            words = frame_words(taken)
            if item.data(Qt.ItemDataRole.UserRole) != (key := f"{taken.stem} {words} {id(taken.thumb)}"):
                item.setData(Qt.ItemDataRole.UserRole, key)
                item.setIcon(_icon_of(taken))
                item.setText(words)
                item.setToolTip(tr_text(taken.frame.reason) or words)
        taken_now = self._current
        enable(taken_now is not None, self.out)
        self.undo.setEnabled(self._may_undo)
        if taken_now is not None:
            self.out.setText(tr("&Take in again") if taken_now.is_left_out else tr("&Leave out"))
            self.why.setText(tr("Rejected: {why}", why=tr_text(taken_now.frame.reason)) if taken_now.frame.reason else "")

    @property
    def _current(self) -> TakenFrame | None:
        row = self.list.currentRow()
        return self.view.frames[row] if 0 <= row < len(self.view.frames) else None

    def _on_row(self, _row: int) -> None:
        taken = self._current
        if taken is None or not self.isVisible():
            return
        self._open, self._history = taken.stem, History()
        self._was_corrected = taken.is_corrected
        self._history.edit("begin", Annotation(masks=polygons_of(taken.frame.robot, MaskTarget.ROBOT)))
        self.canvas.show_image(halvings(taken.frame.picture.image), self._history.current, lambda _annotation: Readout())
        self.canvas.set_tool(Tool.ROBOT_MASK)
        self.canvas.set_mask_mode(MaskMode.BRUSH)
        self.refresh()

    def _toggle(self) -> None:
        taken = self._current
        if taken is not None:
            self.model.leave_out(taken.stem, not taken.is_left_out)

    def _on_edited(self, action: str, annotation: Annotation | None) -> None:
        if not self.isVisible():
            return
        if annotation is not None:
            self._history.edit(action, annotation)
            self._keep()
        self._show_drawn()

    def _on_undo(self) -> None:
        self._history.undo()
        self._keep()
        self._show_drawn()

    def _show_drawn(self) -> None:
        self.canvas.show_annotation(self._history.current)
        self.refresh()

    @property
    def _may_undo(self) -> bool:
        return self._history.undo_action not in ("", "begin")

    def _keep(self) -> None:
        """Keep the mask as it is drawn now; where all was undone, a frame that was not corrected before is not corrected."""
        taken = next((one for one in self.view.frames if one.stem == self._open), None)
        if taken is None:
            return
        if not self._may_undo and not self._was_corrected:
            self.model.correct(taken.stem, None)
        else:
            height, width = taken.frame.robot.shape
            self.model.correct(taken.stem, fill(self._history.current.masks, MaskTarget.ROBOT, (width, height)))


def frame_words(taken: TakenFrame) -> str:
    """What a frame is used for, in a word or two."""
    if taken.is_left_out:
        return tr("left out")
    if taken.frame.reason:
        return tr("rejected")
    if taken.is_corrected:
        return tr("corrected")
    return tr("place") if taken.kind is LookKind.PLACE else tr("bend")


def _icon_of(taken: TakenFrame) -> QIcon:
    """The small picture; one that is not used is dim and crossed out."""
    pixmap = to_pixmap(taken.thumb)
    if not taken.is_used:
        painter = QPainter(pixmap)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(pixmap.rect(), QColor(0, 0, 0, 150))
        painter.setPen(QPen(QColor(ON_PICTURE.FAULT if taken.frame.reason else ON_PICTURE.TEXT_DIM), 3.0))
        right, bottom = pixmap.width(), pixmap.height()
        painter.drawLine(QPointF(right * 0.38, bottom * 0.34), QPointF(right * 0.62, bottom * 0.66))
        painter.drawLine(QPointF(right * 0.62, bottom * 0.34), QPointF(right * 0.38, bottom * 0.66))
        painter.end()
    icon = QIcon(pixmap)
    icon.addPixmap(pixmap, QIcon.Mode.Selected)  # not tinted: the frame shows the selection
    return icon


class TrainPage(TeachingPage):
    """The training, how it goes, and what to expect of the model."""

    name = mark("Train")
    hint = mark("It trains beside the window, which may be closed meanwhile. The present model stays, and can be chosen again.")
    step = TeachingStep.TRAIN

    def __init__(self, model: TeachingModel, pictures: BeforeAfter, in_use: Callable[[str], bool]) -> None:
        super().__init__(model, pictures)
        self._pictures, self._in_use = pictures, in_use
        self.model_name, self.minutes = QLineEdit(name_for(model.rig)), QSpinBox()
        self.model_name.setMaxLength(40)
        self.model_name.setAccessibleName(tr("Name of the new model"))
        self.minutes.setRange(1, 120)
        self.minutes.setValue(MINUTES)
        self.minutes.setSuffix(tr(" min"))
        self.minutes.setAccessibleName(tr("Time for the training"))
        self.start = self.main = button(tr("&Train"), self._on_start)
        self.stop = button(tr("&Stop"), model.stop_training, tr("Frames and what was learnt are kept"))
        self.bar = QProgressBar(textVisible=False)
        self.bar.setFixedHeight(8)
        self.bar.setAccessibleName(tr("Training"))
        self.words = note("")
        self.words.setFixedHeight(80)
        self.words.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.table = QLabel(textFormat=Qt.TextFormat.RichText, alignment=Qt.AlignmentFlag.AlignTop)
        self.table.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Expanding)
        name_label, minutes_label = QLabel(tr("New model")), QLabel(tr("for"))
        name_label.setBuddy(self.model_name)
        minutes_label.setBuddy(self.minutes)
        self.add(line(name_label, (self.model_name, 1)), line((self.start, 1), minutes_label, self.minutes, (self.stop, 1)))
        self.add(column(self.bar, self.words, (self.table, 1)))

    @property
    def is_done(self) -> bool:
        return bool(self.view.model)

    @property
    def may_leave(self) -> bool:
        """Whether a model is there that is not in use now: another one may have been chosen since."""
        return self.view.may_leave and not self._in_use(self.view.model)

    def refresh(self) -> None:
        state = self.model.training
        enable(not state.is_busy and not self.model.is_busy, self.start, self.model_name, self.minutes)
        self.stop.setEnabled(state.phase in (TrainingPhase.PREPARING, TrainingPhase.RUNNING))
        if state.phase is TrainingPhase.DONE and self.model_name.text() == state.name:
            self.model_name.setText(name_for(self.model.rig))
        is_known = state.phase is TrainingPhase.RUNNING or not state.is_busy
        self.bar.setRange(0, 1000 if is_known else 0)
        done = self.model.time_share if state.is_busy else float(state.phase is TrainingPhase.DONE)
        self.bar.setValue(round(1000 * done))
        self.words.setText(self._words(state))
        self.table.setText(self._table())
        if state.held_out:
            after = state.held_out[-1].pictures if len(state.held_out) > 1 else ()
            self._pictures.show_pictures(state.held_out[0].pictures, after)

    def _words(self, state: TrainingState) -> str:
        if state.phase is TrainingPhase.RUNNING:
            minutes = max(1.0, self.model.minutes_left)
            return tr("{what}, about {minutes:.0f} min left", what=tr_text(state.line), minutes=minutes)
        if state.line:
            return tr_text(state.line)
        if self.view.model:
            used = tr(" It is in use.") if self._in_use(self.view.model) else tr(" Use it puts it into force, with this bench.")
            return tr("Model {name} is there.{more}", name=self.view.model, more=used)
        counts = {"count": min(WANTED, self.view.used), "all": self.view.used}
        return tr("{count} of {all} frames are learnt from; a quarter of them is held out, to judge by.", **counts)

    def _table(self) -> str:
        result = self.model.result
        if result is None or not self.view.model:
            return ""
        rows = [(tr("answered"), tr("{answered} of {count} held-out frames", answered=result.answered, count=result.frames))]
        rows.append((tr("right"), tr("{right} of these", right=result.right)))
        if result.robot_dice is not None:
            rows.append((tr("robot (Dice)"), f"{result.robot_dice:.3f}"))
        if result.head_px is not None:
            rows.append((tr("head"), f"{result.head_px:.1f} px"))
        if result.theta_deg is not None:
            rows.append((tr("theta"), f"{result.theta_deg:.1f}°"))
        rows.append((tr("time"), tr("{minutes:.1f} min", minutes=result.time_s / 60)))
        cells = "".join(
            f'<tr><td style="color:{theme.TEXT_DIM}; padding-right:16px; padding-bottom:4px">{name}</td><td>{value}</td></tr>'
            for name, value in rows
        )
        return f"<b>{tr('What to expect on this bench')}</b><table>{cells}</table>"

    def _on_start(self) -> None:
        self.model.train(self.model_name.text().strip(), self.minutes.value())


def _lines(height_px: int) -> QLabel:
    """Words that come and go, in a place that stays."""
    words = note("")
    words.setMinimumHeight(height_px)
    words.setAlignment(Qt.AlignmentFlag.AlignTop)
    return words


def show_main(page: TeachingPage, next_button: QPushButton) -> None:
    """One button stands out: that of the step, until it is done, else the one that leads on; while the robot moves, none before."""
    done = page.is_done and page.may_leave
    if page.main is not None:
        set_main_button(page.main, not done)
    set_main_button(next_button, done if page.main is not None or page.is_live else page.may_leave)
