"""The annotator window: wires canvas, readout, list and keys to the desk; it never waits for anything."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QAction, QCloseEvent, QKeySequence
from PySide6.QtWidgets import QHBoxLayout, QLabel, QLineEdit, QMainWindow, QMessageBox, QVBoxLayout, QWidget

from app import theme
from app.annotation_desk import AnnotationDesk
from app.annotation_tool import Tool
from app.annotator_menus import add_annotator_menus
from app.heartbeat import Heartbeat
from app.language import tr, tr_text
from app.menus import action_of
from app.training_dialog import TrainingDialog
from app.training_source import collect_from_store
from app.widgets.annotation_bar import AnnotationBar
from app.widgets.annotation_canvas import AnnotationCanvas
from app.widgets.annotation_header import AnnotationHeader
from app.widgets.annotation_help import annotation_help
from app.widgets.annotation_list import QueueList, QueueModel
from app.widgets.annotation_readout import AnnotationReadout
from app.widgets.card import Card
from app.widgets.columns import Columns
from app.widgets.light_sliders import LightSliders
from app.widgets.toast import Toast
from app.wording import refusal_text
from core.study.annotations import Annotation, Readout, turn_annotation
from core.types import PoseState

_LEFT_SHARE = 0.74
_SIDE_WIDTH = (330, 400)


class AnnotatorWindow(QMainWindow):
    """Shows the desk's item in hand and hands the rater's edits to the desk.

    Parameters
    ----------
    desk : queue, edits, disk; the window shuts it down when it closes.
    who : study and rater, as they are shown.
    """

    def __init__(self, desk: AnnotationDesk, who: str) -> None:
        super().__init__()
        self._desk = desk
        desk.setParent(self)
        self._is_shut = False
        self._training: TrainingDialog | None = None
        self._heartbeat = Heartbeat(parent=self)
        self.canvas = AnnotationCanvas()
        self.readout = AnnotationReadout(desk.config.vectors.robot_length_px)
        self.bar = AnnotationBar(blind=desk.blind)
        self.header = AnnotationHeader(who)
        self.light = LightSliders()
        self.note = QLineEdit()
        self.note.setPlaceholderText(tr("Note on this image  (F2)"))
        self.note.setAccessibleName(tr("Note"))
        self.note.setMaxLength(2000)
        theme.set_sheet(
            self.note,
            "QLineEdit { background: @PANEL; color: @TEXT; border: 1px solid @LINE; border-radius: 6px; padding: 5px 10px; }"
            " QLineEdit:focus { border-color: @SKY; }",
        )
        self.queue = QueueList(QueueModel(self._names(), desk.status, desk.has_masks))
        self._lay_out()
        self.toast = Toast(self.canvas)
        self._make_menus()
        self._wire()
        self.setWindowTitle(tr("LumenPilot \N{EM DASH} annotate"))
        self.setMinimumSize(*theme.MIN_WINDOW)
        self.resize(theme.start_size(self.screen()))

    @property
    def desk(self) -> AnnotationDesk:
        return self._desk

    @property
    def max_block_ms(self) -> float:
        """The longest time that the GUI thread was blocked in the last ten seconds."""
        return self._heartbeat.max_block_ms

    def start(self) -> None:
        """Take the first item without an answer in hand."""
        self._heartbeat.start()
        self.canvas.setFocus()
        self.queue.show_progress(self._desk.finished, len(self._desk.items))
        first = self._desk.next_open(-1)
        self.open(first if first is not None else 0)

    # ---- composition

    def _names(self) -> list[str]:
        """In a blind study nothing tells that an image was there before."""
        if self._desk.blind:
            return [tr("image {place}", place=place) for place in range(1, len(self._desk.items) + 1)]
        return [item.image.path.name for item in self._desk.items]

    def _lay_out(self) -> None:
        picture = QWidget()
        left = QVBoxLayout(picture)
        left.setContentsMargins(0, 0, 0, 0)
        left.setSpacing(6)
        for widget, stretch in ((self.header, 0), (self.canvas, 1), (self.bar, 0)):
            left.addWidget(widget, stretch)
        side = QWidget()
        column = QVBoxLayout(side)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(theme.GAP)
        column.addWidget(Card(tr("Angle to the vessel"), self.readout))
        column.addWidget(Card(tr("Images"), self.queue), 1)
        column.addWidget(self.note)
        column.addWidget(Card("", self.light))
        side.setMinimumWidth(_SIDE_WIDTH[0])
        side.setMaximumWidth(_SIDE_WIDTH[1])
        stage = QWidget()
        row = QHBoxLayout(stage)
        row.setContentsMargins(theme.GAP, 4, theme.GAP, theme.GAP)
        self.columns = Columns(picture, side, _LEFT_SHARE)
        row.addWidget(self.columns)
        self.setCentralWidget(stage)
        self.help = annotation_help(stage)

    def _make_menus(self) -> None:
        add_annotator_menus(self)
        escape = QAction(self)
        escape.setShortcut(QKeySequence(Qt.Key.Key_Escape))
        escape.triggered.connect(self._on_escape)
        self.addAction(escape)
        hint = QLabel(tr("F1  keys"))
        hint.setObjectName("card_note")
        hint.setContentsMargins(0, 0, 14, 0)
        self.menuBar().setCornerWidget(hint)

    def _wire(self) -> None:
        desk, canvas = self._desk, self.canvas
        desk.opened.connect(self._on_opened)
        desk.changed.connect(self._on_changed)
        desk.listed.connect(self._on_listed)
        desk.saved.connect(lambda: self.header.show_saved(True))
        desk.failed.connect(self._on_failed)
        desk.proposed.connect(self._show_proposal)
        canvas.edited.connect(self._on_edited)
        canvas.previewed.connect(self._on_previewed)
        canvas.line_ended.connect(self._on_line_ended)
        canvas.tool_changed.connect(lambda tool: self.bar.show_tool(tool, brush_on=False))
        canvas.ended.connect(self._on_ended)
        canvas.installEventFilter(self)
        self.bar.tool_chosen.connect(self.take_tool)
        self.bar.switched.connect(self._on_switched)
        self.light.changed.connect(canvas.set_light)
        self.note.editingFinished.connect(self._keep_note)
        self.note.returnPressed.connect(canvas.setFocus)
        self.queue.chosen.connect(self._choose)

    # ---- the item in hand

    def open(self, place: int) -> None:
        """Take an item in hand; it is blank until it is loaded."""
        self._keep_note()
        if place != self._desk.index:
            self.canvas.blank()
            self.readout.show_annotation(Annotation(), Readout(missing=tr("loading")))
        self.queue.show_current(place)
        self._desk.open(place)
        name = self._names()[place] if not self._desk.blind else tr("Image {place}", place=place + 1)
        self.header.show_title(tr("{name}   ({place} of {count})", name=name, place=place + 1, count=len(self._desk.items)))

    def _choose(self, place: int) -> None:
        self.canvas.setFocus()
        if place != self._desk.index:
            self.open(place)

    def step(self, step: int) -> None:
        """So many items on, or back."""
        place = self._desk.index + step
        if 0 <= place < len(self._desk.items):
            self.open(place)
        elif step > 0:
            left = len(self._desk.items) - self._desk.finished
            self.toast.show_message(
                tr("The last image. {left} without an answer: U goes there", left=left)
                if left
                else tr("The last image. All are done")
            )
        else:
            self.toast.show_message(tr("The first image"))

    def go_open(self) -> None:
        """To the next item without an answer."""
        place = self._desk.next_open(self._desk.index)
        if place is None:
            self.toast.show_message(tr("All images have an answer"))
        else:
            self.open(place)

    def _on_opened(self) -> None:
        annotation = self._desk.annotation
        self.canvas.show_image(self._desk.levels, annotation, self._desk.measure)
        self.canvas.set_brush(False)
        tool = Tool.VESSEL if len(annotation.robot) > 1 and len(annotation.vessel) < 2 else Tool.ROBOT
        if tool is not self.canvas.tool:
            self.canvas.set_tool(tool)
        self.bar.show_tool(self.canvas.tool, brush_on=False)
        self.bar.set_switch("H", False)
        self.canvas.show_proposal(None)
        self._show_annotation()

    def _show_annotation(self) -> None:
        annotation = self._desk.annotation
        self.readout.show_annotation(annotation, self._desk.measure(annotation))
        if not self.note.hasFocus():
            self.note.setText(annotation.note)

    def _on_changed(self) -> None:
        self.canvas.show_annotation(self._desk.annotation)
        self._show_annotation()
        if self._desk.unsaved:
            self.header.show_saved(False)

    def _on_listed(self, place: int) -> None:
        self.queue.renew(place)
        self.queue.show_progress(self._desk.finished, len(self._desk.items))

    def _on_failed(self, line: str, is_edit: bool) -> None:
        if is_edit:
            self.header.show_unsaved(self._desk.unsaved, line)
        elif not self._desk.is_open:
            self.readout.show_annotation(Annotation(), Readout(missing=tr("this image cannot be shown")))
        self.bar.set_switch("H", False)
        self.toast.show_message(line, is_fault=True)

    # ---- edits

    def _on_edited(self, action: str, annotation: Annotation | None) -> None:
        if annotation is None:  # taken back before it was done
            self._on_changed()
        else:
            self._desk.edit(action, annotation)

    def _on_previewed(self, annotation: Annotation, readout: Readout) -> None:
        self.readout.show_annotation(annotation, readout, is_preview=self.canvas.is_moving)

    def _on_line_ended(self, tool: Tool) -> None:
        """From one line to the other, as long as one is missing."""
        annotation = self._desk.annotation
        if tool is Tool.ROBOT and len(annotation.vessel) < 2:
            self.take_tool(Tool.VESSEL)
        elif tool is Tool.VESSEL and len(annotation.robot) < 2:
            self.take_tool(Tool.ROBOT)
        else:
            self._show_annotation()

    def _on_ended(self) -> None:
        """Enter with both lines drawn takes the state that they say; once more goes on."""
        annotation = self._desk.annotation
        pose = self._desk.measure(annotation).pose
        if pose is not None and annotation.state is None and not annotation.cannot_tell:
            self.set_state(pose.state)
        elif annotation.cannot_tell or (pose is not None and annotation.state is not None):
            self.step(1)
        else:
            missing = tr_text(self._desk.measure(annotation).missing)
            self.toast.show_message(tr("Not complete: {missing}; or X, can't tell", missing=missing))

    def set_state(self, state: PoseState) -> None:
        """The rater's word on the pose."""
        self.canvas.close_line()
        self._desk.edit(f"state {state.value}", replace(self._desk.annotation, state=state, cannot_tell=False))

    def toggle_cannot_tell(self) -> None:
        """\"Can't tell\" is an answer; once more takes it back."""
        annotation = self._desk.annotation
        self.canvas.close_line()
        if annotation.cannot_tell:
            self._desk.edit("can tell", replace(annotation, cannot_tell=False))
        else:
            self._desk.edit("can't tell", replace(annotation, cannot_tell=True, state=None))

    def undo(self) -> None:
        """Back one edit, and say which."""
        action = self._desk.history.undo_action
        self._desk.undo()
        self.toast.show_message(tr("Undone: {action}", action=tr_text(action)) if action else tr("Nothing to undo"))

    def redo(self) -> None:
        """Forward one edit, and say which."""
        can_redo = self._desk.history.can_redo
        self._desk.redo()
        self.toast.show_message(
            tr("Done again: {action}", action=tr_text(self._desk.history.undo_action)) if can_redo else tr("Nothing to redo")
        )

    def edit_note(self) -> None:
        """Write the note; Enter or Escape goes back to the picture."""
        self.note.setFocus()
        self.note.selectAll()

    def _keep_note(self) -> None:
        # What no file can hold (half of a surrogate pair, pasted) becomes a question mark.
        text = self.note.text().encode("utf-8", errors="replace").decode("utf-8").strip()
        if self._desk.is_open and text != self._desk.annotation.note:
            self._desk.edit("note", replace(self._desk.annotation, note=text))

    def simplify(self) -> None:
        """Fewer points on the outlines of the mask tool."""
        if self.canvas.tool.is_mask:
            self.canvas.simplify_masks()
        else:
            self.toast.show_message(tr("Simplify is for masks: 3 or 4 first"))

    # ---- tools and switches

    def take_tool(self, tool: Tool) -> None:
        """Take a tool, by key, chip or menu."""
        self.canvas.set_tool(tool)
        self.canvas.set_brush(False)
        self.bar.show_tool(tool, brush_on=False)
        self.canvas.setFocus()
        self._show_annotation()

    def _on_switched(self, key: str, on: bool) -> None:
        if key == "L":
            self.canvas.set_loupe(on)
        elif key == "K":
            self.canvas.set_masks_shown(on)
        elif key == "T":
            self.canvas.set_brush(on)
            self.bar.show_tool(self.canvas.tool, brush_on=self.canvas.brush_on)
        elif key == "H":
            self._ask_proposal(on)
        self.canvas.setFocus()

    # ---- the algorithm

    def toggle_proposal(self) -> None:
        """Show or hide what the algorithm says."""
        if self._desk.blind:
            self.toast.show_message(tr("A blind study: what the algorithm says is hidden"))
        else:
            self.bar.toggle("H")

    def _ask_proposal(self, on: bool) -> None:
        if not on:
            self.canvas.show_proposal(None)
            return
        if self._desk.proposal is None:
            self.toast.show_message(tr("Asking the algorithm"))
        self._desk.propose()

    def _show_proposal(self) -> None:
        proposal, item = self._desk.proposal, self._desk.item
        if proposal is None or item is None or not self._desk.is_open:
            return
        self.bar.set_switch("H", True)
        self.canvas.show_proposal(turn_annotation(proposal.annotation, item.view, item.image.record.size))
        if proposal.pose is not None:
            pose = proposal.pose
            self.toast.show_message(
                tr(
                    "Algorithm: θ {theta:.1f}°, state {state}, confidence {confidence:.2f}. G takes it over",
                    theta=pose.theta_deg,
                    state=pose.state.value,
                    confidence=proposal.confidence,
                )
            )
        else:
            self.toast.show_message(
                tr("The algorithm gives no pose: {why}", why=refusal_text(proposal.refusal) if proposal.refusal is not None else "")
            )

    def take_proposal(self) -> None:
        """Lines with a line tool, the tool's masks with a mask tool; undo brings the own ones back."""
        proposal, item = self._desk.proposal, self._desk.item
        if self._desk.blind or item is None or proposal is None:
            self.toggle_proposal()
            return
        shown = turn_annotation(proposal.annotation, item.view, item.image.record.size)
        annotation, target = self._desk.annotation, self.canvas.tool.value.target
        if target is not None:
            kept = tuple(mask for mask in annotation.masks if mask.target is not target)
            taken = tuple(mask for mask in shown.masks if mask.target is target)
            if taken:
                self._desk.edit(f"take the algorithm's {target.value} mask", replace(annotation, masks=(*kept, *taken)))
            else:
                self.toast.show_message(tr("The algorithm found no {what}", what=tr_text(target.value)))
        elif shown.robot or shown.vessel:
            self.canvas.close_line()
            self._desk.edit(
                "take the algorithm's lines", replace(annotation, robot=shown.robot, vessel=shown.vessel, cannot_tell=False)
            )
        else:
            self.toast.show_message(tr("The algorithm has no lines here"))
        self.bar.set_switch("H", False)
        self.canvas.show_proposal(None)

    # ---- training

    def train(self) -> None:
        """Train a model on the masks of this file; the dialog watches it."""
        if self._training is None:
            images = [item.image for item in self._desk.items]
            collect = partial(collect_from_store, self._desk.store, images)
            self._training = TrainingDialog(collect, str(self._desk.store_path), self)
        self._training.show()
        self._training.raise_()

    # ---- the window

    def tell_saved(self) -> None:
        """Where the annotations are."""
        self.toast.show_message(tr("Every edit is saved at once, in {path}", path=self._desk.store_path))

    def _on_escape(self) -> None:
        if self.help.isVisible():
            self.help.hide()
        elif not self.canvas.hasFocus():
            self.canvas.setFocus()
        elif not self.canvas.let_go() and self.isFullScreen():
            self.toggle_full_screen()
        self.bar.show_tool(self.canvas.tool, brush_on=self.canvas.brush_on)

    def toggle_full_screen(self) -> None:
        """Full screen, without the menu bar, and back."""
        self.setWindowState(self.windowState() ^ Qt.WindowState.WindowFullScreen)

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.WindowStateChange:
            self.menuBar().setVisible(not self.isFullScreen())
            action_of(self, "F11").setChecked(self.isFullScreen())

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in (QEvent.Type.MouseMove, QEvent.Type.MouseButtonPress, QEvent.Type.KeyPress, QEvent.Type.Wheel):
            self._desk.sign_of_life()
        return False

    def closeEvent(self, event: QCloseEvent) -> None:
        self._keep_note()
        if self._desk.unsaved and self.header.saved_text.startswith("\N{WARNING SIGN}") and not self._may_lose():
            event.ignore()
            return
        self.shut_down()
        event.accept()

    def _may_lose(self) -> bool:
        box = QMessageBox(
            QMessageBox.Icon.Warning,
            tr("Not saved"),
            tr("{count} edits could not be written.", count=self._desk.unsaved),
            parent=self,
        )
        box.setInformativeText(tr("Free some space or put the disk back, and they are written by themselves."))
        stay = box.addButton(tr("Stay"), QMessageBox.ButtonRole.RejectRole)
        box.addButton(tr("Leave without them"), QMessageBox.ButtonRole.DestructiveRole)
        box.setDefaultButton(stay)
        box.exec()
        return box.clickedButton() is not stay

    def shut_down(self) -> None:
        """Finish writing and end the threads."""
        if not self._is_shut:
            self._is_shut = True
            if self._training is not None:
                self._training.end()
            self._heartbeat.stop()
            self.canvas.removeEventFilter(self)
            self.setUpdatesEnabled(False)
            self.hide()  # what is still to be written or perceived is waited for without a frozen window
            self._desk.shut_down()
