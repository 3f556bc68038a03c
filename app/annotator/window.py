"""The annotator window: wires canvas, readout, list and keys to the desk; it never waits for anything.

The menus of the annotator window: everything that it can do, with its key.

All that the rater sees below the menus: the panels of the annotator window and their places.

The annotator's keys.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from PySide6.QtCore import QEvent, QObject
from PySide6.QtWidgets import QHBoxLayout, QMainWindow, QMessageBox, QWidget

from app.annotator.canvas import CANVAS_KEYS, AnnotationCanvas
from app.annotator.editing import Tool
from app.annotator.model import AnnotationModel
from app.annotator.panels import AnnotationBar, AnnotationHeader, AnnotationReadout, QueueList, QueueModel
from app.player.controls import NoteField
from app.training.dialog import TrainingDialog, collect_from_store
from app.ui import theme
from app.ui.actions import KeyTable, MenuEntry, add_help_menu, add_menu, menu_tables, shown
from app.ui.i18n import mark, tr, tr_text
from app.ui.texts import refusal_text
from app.ui.window_base import WindowFrame
from app.widgets.basics import Card, Columns
from app.widgets.image_canvas import LightSliders
from app.widgets.messages import Toast
from app.widgets.scene_panels import column, holder, set_window_margins, side
from app.widgets.shortcut_page import KeyPage
from core.annotation.model import Annotation, Readout, turn_annotation
from core.annotation.store import TAKES_LINES
from core.types import PoseState

_ZOOM_STEP = 1.3
_BRUSH_STEP = 1.25


def add_annotator_menus(window: AnnotatorWindow) -> None:
    """Fill the window's menu bar; keys that step repeat while they are held."""
    panels = window.panels
    canvas, bar, light = panels.canvas, panels.bar, panels.light
    window.add_file_menu(
        [
            MenuEntry(tr("Where is it &saved?"), window.tell_saved, ("Ctrl+S",)),
            None,
            MenuEntry(tr("&Train on my annotations..."), window.train),
        ]
    )
    view = window.add_view_menu(
        [
            MenuEntry(tr("Zoom &in"), partial(canvas.zoom, _ZOOM_STEP), ("+", "=")),
            MenuEntry(tr("Zoom &out"), partial(canvas.zoom, 1 / _ZOOM_STEP), ("-",)),
            MenuEntry(tr("&Close-up of the head"), canvas.close_up, ("Z",)),
            MenuEntry(tr("&Whole picture"), canvas.fit, ("F", "0")),
            None,
            MenuEntry(tr("More contrast"), partial(light.step, 1), (".",)),
            MenuEntry(tr("Less contrast"), partial(light.step, -1), (",",)),
            MenuEntry(tr("Brighter"), partial(light.step, 0, 1), (">",)),
            MenuEntry(tr("Darker"), partial(light.step, 0, -1), ("<",)),
            MenuEntry(tr("Picture as it is"), light.reset, ("/",)),
            None,
            MenuEntry(tr("&Loupe"), partial(bar.toggle, "L"), ("L",)),
            MenuEntry(tr("&Masks"), partial(bar.toggle, "K"), ("K",)),
            MenuEntry(tr("&Algorithm"), window.toggle_proposal, ("H",)),
        ]
    )
    states = [MenuEntry(tr("State {state}", state=s.value), partial(window.set_state, s), (s.value,)) for s in PoseState]
    edits = add_menu(
        window,
        tr("&Edit"),
        [
            MenuEntry(tr("&Undo"), window.undo, ("Ctrl+Z",)),
            MenuEntry(tr("&Redo"), window.redo, ("Ctrl+Shift+Z", "Ctrl+Y")),
            None,
            *states,
            MenuEntry(tr("Can't tell"), window.toggle_cannot_tell, ("X",)),
            MenuEntry(tr("&Note"), window.edit_note, ("F2",)),
            None,
            MenuEntry(tr("Take the &algorithm's"), window.take_proposal, ("G",)),
            MenuEntry(tr("&Simplify outlines"), window.simplify, ("S",)),
        ],
    )
    for action in edits[:2]:
        action.setAutoRepeat(True)
    tools = [MenuEntry(tr(t.value.label), partial(window.take_tool, t), (t.value.key,)) for t in Tool]
    add_menu(
        window,
        tr("&Tools"),
        [
            *tools,
            None,
            MenuEntry(tr("&Brush"), partial(bar.toggle, "T"), ("T",)),
            MenuEntry(tr("Brush smaller"), partial(canvas.resize_brush, 1 / _BRUSH_STEP), ("[",)),
            MenuEntry(tr("Brush larger"), partial(canvas.resize_brush, _BRUSH_STEP), ("]",)),
        ],
    )
    go = add_menu(
        window,
        tr("&Go"),
        [
            MenuEntry(tr("&Next"), partial(window.step, 1), ("N", "PgDown")),
            MenuEntry(tr("&Previous"), partial(window.step, -1), ("P", "PgUp")),
            MenuEntry(tr("Next &without an answer"), window.go_open, ("U",)),
            MenuEntry(tr("&First"), partial(window.open, 0), ("Home",)),
            MenuEntry(tr("&Last"), partial(window.open, len(window.desk.items) - 1), ("End",)),
            MenuEntry(tr("Lis&t"), panels.queue.take_focus, ("F6",)),
        ],
    )
    for action in (*go[:2], *view[:2], *view[4:8]):
        action.setAutoRepeat(True)
    add_help_menu(window, panels.help.toggle)


_MOUSE = (
    mark("In the picture, by mouse"),
    (
        (mark("Click, drag"), mark("set a point; move one")),
        (mark("Double click"), mark("end the line, take the state, go on")),
        (mark("Right click"), mark("take a point out; the brush: take away")),
        (mark("Wheel"), mark("zoom at the cursor")),
    ),
)


def annotation_keys(window: QMainWindow) -> Sequence[KeyTable]:
    """The keys of the picture, of the menus, and the mouse."""
    return (shown((mark("In the picture"), CANVAS_KEYS)), shown(_MOUSE), *menu_tables(window))


def annotation_help(parent: QWidget) -> KeyPage:
    """The page of the annotator, over `parent`."""
    return KeyPage(parent, annotation_keys)


_LEFT_SHARE = 0.74
_SIDE_WIDTH = (330, 400)
_LEFT_GAP = 6


class AnnotatorPanels(QWidget):
    """Makes the widgets and lays them out.

    Parameters
    ----------
    desk : whose items are listed.
    who : study and rater, as they are shown.
    names : of the items, in their order, as the list shows them.
    """

    def __init__(self, desk: AnnotationModel, who: str, names: list[str]) -> None:
        super().__init__()
        self.canvas = AnnotationCanvas()
        self.readout = AnnotationReadout(desk.config.vectors.robot_length_px)
        self.bar = AnnotationBar(blind=desk.blind)
        self.header = AnnotationHeader(who)
        self.light = LightSliders()
        self.note = NoteField(tr("Note on this image  (F2)"))
        self.queue = QueueList(QueueModel(names, desk.status, desk.has_masks))
        left = column((self.header, 0), (self.canvas, 1), (self.bar, 0), spacing=_LEFT_GAP)
        right = column(
            (Card(tr("Angle to the vessel"), self.readout), 0),
            (Card(tr("Images"), self.queue), 1),
            (self.note, 0),
            (Card("", self.light), 0),
        )
        self.columns = Columns(holder(left), side(right, *_SIDE_WIDTH), _LEFT_SHARE)
        room = QHBoxLayout(self)
        set_window_margins(room)
        room.addWidget(self.columns)
        self.help = annotation_help(self)
        self.toast = Toast(self.canvas)


_CANNOT_TELL = "can't tell"


class AnnotatorWindow(WindowFrame):
    """Shows the desk's item in hand and hands the rater's edits to the desk.

    Parameters
    ----------
    desk : queue, edits, disk; the window shuts it down when it closes.
    who : study and rater, as they are shown.
    """

    def __init__(self, desk: AnnotationModel, who: str) -> None:
        super().__init__()
        self.setMinimumWidth(theme.MIN_WIDE_PX)
        self._desk = desk
        desk.setParent(self)
        self._training: TrainingDialog | None = None
        self.panels = AnnotatorPanels(desk, who, self._names())
        self.setCentralWidget(self.panels)
        add_annotator_menus(self)
        self._wire()
        self.setWindowTitle(tr("LumenPilot \N{EM DASH} annotate"))

    @property
    def desk(self) -> AnnotationModel:
        return self._desk

    def start(self) -> None:
        """Take the first item without an answer in hand."""
        super().start()
        self.panels.canvas.setFocus()
        self.panels.queue.show_progress(self._desk.finished, len(self._desk.items))
        first = self._desk.next_open(-1)
        self.open(first if first is not None else 0)

    # ---- composition

    def _names(self) -> list[str]:
        """In a blind study nothing tells that an image was there before."""
        if self._desk.blind:
            return [tr("image {place}", place=place) for place in range(1, len(self._desk.items) + 1)]
        return [item.image.path.name for item in self._desk.items]

    def _wire(self) -> None:
        desk, panels, canvas = self._desk, self.panels, self.panels.canvas
        desk.opened.connect(self._on_opened)
        desk.changed.connect(self._on_changed)
        desk.listed.connect(self._on_listed)
        desk.saved.connect(lambda: panels.header.show_saved(True))
        desk.failed.connect(self._on_failed)
        desk.proposed.connect(self._show_proposal)
        canvas.edited.connect(self._on_edited)
        canvas.previewed.connect(self._on_previewed)
        canvas.line_ended.connect(self._on_line_ended)
        canvas.tool_changed.connect(lambda tool: panels.bar.show_tool(tool, brush_on=False))
        canvas.ended.connect(self._on_ended)
        canvas.installEventFilter(self)
        panels.bar.tool_chosen.connect(self.take_tool)
        panels.bar.switched.connect(self._on_switched)
        panels.light.changed.connect(canvas.set_light)
        panels.note.editingFinished.connect(self._keep_note)
        panels.note.returnPressed.connect(canvas.setFocus)
        panels.queue.chosen.connect(self._choose)

    # ---- the item in hand

    def open(self, place: int) -> None:
        """Take an item in hand; it is blank until it is loaded."""
        self._keep_all()
        if place != self._desk.index:
            self.panels.canvas.blank()
            self.panels.readout.show_annotation(Annotation(), Readout(missing=tr("loading")))
        self.panels.queue.show_current(place)
        self._desk.open(place)
        name = self._names()[place] if not self._desk.blind else tr("Image {place}", place=place + 1)
        self.panels.header.show_title(tr("{name}   ({place} of {count})", name=name, place=place + 1, count=len(self._desk.items)))

    def _choose(self, place: int) -> None:
        self.panels.canvas.setFocus()
        if place != self._desk.index:
            self.open(place)

    def step(self, step: int) -> None:
        """So many items on, or back."""
        place = self._desk.index + step
        if 0 <= place < len(self._desk.items):
            self.open(place)
        elif step > 0:
            left = len(self._desk.items) - self._desk.finished
            self.say(
                tr("The last image. {left} without an answer: U goes there", left=left)
                if left
                else tr("The last image. All are done")
            )
        else:
            self.say(tr("The first image"))

    def go_open(self) -> None:
        """To the next item without an answer."""
        place = self._desk.next_open(self._desk.index)
        if place is None:
            self.say(tr("All images have an answer"))
        else:
            self.open(place)

    def _on_opened(self) -> None:
        annotation = self._desk.annotation
        self.panels.note.setText(annotation.note)  # also while it is being written in: what stood there was the last picture's
        self.panels.canvas.show_image(self._desk.levels, annotation, self._desk.measure)
        self.panels.canvas.set_brush(False)
        tool = Tool.VESSEL if len(annotation.robot) > 1 and len(annotation.vessel) < 2 else Tool.ROBOT
        if tool is not self.panels.canvas.tool:
            self.panels.canvas.set_tool(tool)
        self.panels.bar.show_tool(self.panels.canvas.tool, brush_on=False)
        self.panels.bar.set_switch("H", False)
        self.panels.canvas.show_proposal(None)
        self._show_annotation()

    def _show_annotation(self) -> None:
        annotation = self._desk.annotation
        self.panels.readout.show_annotation(annotation, self._desk.measure(annotation))
        if not self.panels.note.hasFocus():
            self.panels.note.setText(annotation.note)

    def _on_changed(self) -> None:
        self.panels.canvas.show_annotation(self._desk.annotation)
        self._show_annotation()
        if self._desk.unsaved:
            self.panels.header.show_saved(False)

    def _on_listed(self, place: int) -> None:
        self.panels.queue.renew(place)
        self.panels.queue.show_progress(self._desk.finished, len(self._desk.items))

    def _on_failed(self, line: str, is_edit: bool) -> None:
        if is_edit:
            self.panels.header.show_unsaved(self._desk.unsaved, line)
        else:
            if not self._desk.is_open:
                self.panels.readout.show_annotation(Annotation(), Readout(missing=tr("this image cannot be shown")))
            self.panels.bar.set_switch("H", False)
        self.say(line, is_fault=True)

    # ---- edits

    def _on_edited(self, action: str, annotation: Annotation | None) -> None:
        if annotation is None:  # taken back before it was done
            self._on_changed()
        else:
            self._desk.edit(action, annotation)

    def _on_previewed(self, annotation: Annotation, readout: Readout) -> None:
        self.panels.readout.show_annotation(annotation, readout, is_preview=self.panels.canvas.is_moving)

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
            self.say(tr("Not complete: {missing}; or X, can't tell", missing=missing))

    def set_state(self, state: PoseState) -> None:
        """The rater's word on the pose."""
        self.panels.canvas.complete()
        self.panels.canvas.close_line()
        self._desk.edit(f"state {state.value}", replace(self._desk.annotation, state=state, cannot_tell=False))

    def toggle_cannot_tell(self) -> None:
        """\"Can't tell\" is an answer; once more takes it back, and a state that was there before is there again."""
        self.panels.canvas.complete()
        annotation = self._desk.annotation
        self.panels.canvas.close_line()
        if annotation.cannot_tell and self._desk.history.undo_action == _CANNOT_TELL:
            self._desk.undo()
        elif annotation.cannot_tell:
            self._desk.edit("can tell", replace(annotation, cannot_tell=False))
        else:
            self._desk.edit(_CANNOT_TELL, replace(annotation, cannot_tell=True, state=None))

    def undo(self) -> None:
        """Back one edit, and say which; while an outline is drawn, its last point."""
        if self.panels.canvas.take_back_draft_point():
            self.say(tr("Undone: {action}", action=tr("the outline's last point")))
            return
        self.panels.canvas.complete()
        action = self._desk.history.undo_action
        self._desk.undo()
        self.say(tr("Undone: {action}", action=tr_text(action)) if action else tr("Nothing to undo"))

    def redo(self) -> None:
        """Forward one edit, and say which."""
        self.panels.canvas.complete()
        can_redo = self._desk.history.can_redo
        self._desk.redo()
        self.say(tr("Done again: {action}", action=tr_text(self._desk.history.undo_action)) if can_redo else tr("Nothing to redo"))

    def edit_note(self) -> None:
        """Write the note; Enter or Escape goes back to the picture."""
        self.panels.note.setFocus()
        self.panels.note.selectAll()

    def _keep_all(self) -> None:
        """What is being drawn and written."""
        self.panels.canvas.complete()
        self._keep_note()

    def _keep_note(self) -> None:
        text = self.panels.note.kept_text
        if self._desk.is_open and text != self._desk.annotation.note:
            self._desk.edit("note", replace(self._desk.annotation, note=text))

    def simplify(self) -> None:
        """Fewer points on the outlines of the mask tool."""
        if self.panels.canvas.tool.is_mask:
            self.panels.canvas.simplify_masks()
        else:
            self.say(tr("Simplify is for masks: 3 or 4 first"))

    # ---- tools and switches

    def take_tool(self, tool: Tool) -> None:
        """Take a tool, by key, chip or menu."""
        self.panels.canvas.complete()
        self.panels.canvas.set_tool(tool)
        self.panels.canvas.set_brush(False)
        self.panels.bar.show_tool(tool, brush_on=False)
        self.panels.canvas.setFocus()
        self._show_annotation()

    def _on_switched(self, key: str, on: bool) -> None:
        if key == "L":
            self.panels.canvas.set_loupe(on)
        elif key == "K":
            self.panels.canvas.set_masks_shown(on)
        elif key == "T":
            self.panels.canvas.set_brush(on)
            self.panels.bar.show_tool(self.panels.canvas.tool, brush_on=self.panels.canvas.brush_on)
        elif key == "H":
            self._ask_proposal(on)
        self.panels.canvas.setFocus()

    # ---- the algorithm

    def toggle_proposal(self) -> None:
        """Show or hide what the algorithm says."""
        if self._desk.blind:
            self.say(tr("A blind study: what the algorithm says is hidden"))
        else:
            self.panels.bar.toggle("H")

    def _ask_proposal(self, on: bool) -> None:
        if not on:
            self.panels.canvas.show_proposal(None)
            return
        if self._desk.proposal is None:
            self.say(tr("Asking the algorithm"))
        self._desk.propose()

    def _show_proposal(self) -> None:
        """The answer, if the rater still wants it: it biases him. One that he has switched off is kept for the next time."""
        proposal, item = self._desk.proposal, self._desk.item
        if proposal is None or item is None or not self._desk.is_open or not self.panels.bar.is_on("H"):
            return
        self._desk.keep_look()
        self.panels.canvas.show_proposal(turn_annotation(proposal.annotation, item.view, item.image.record.size))
        if proposal.pose is not None:
            pose = proposal.pose
            self.say(
                tr(
                    "Algorithm: θ {theta:.1f}°, state {state}, confidence {confidence:.2f}. G takes it over",
                    theta=pose.theta_deg,
                    state=pose.state.value,
                    confidence=proposal.confidence,
                )
            )
        else:
            self.say(
                tr("The algorithm gives no pose: {why}", why=refusal_text(proposal.refusal) if proposal.refusal is not None else "")
            )

    def take_proposal(self) -> None:
        """Lines with a line tool, the tool's masks with a mask tool; undo brings the own ones back."""
        proposal, item = self._desk.proposal, self._desk.item
        if self._desk.blind or item is None or proposal is None:
            if self._desk.blind or not self.panels.bar.is_on("H"):  # else the answer is waited for
                self.toggle_proposal()
            return
        shown = turn_annotation(proposal.annotation, item.view, item.image.record.size)
        annotation, target = self._desk.annotation, self.panels.canvas.tool.value.target
        if target is not None:
            kept = tuple(mask for mask in annotation.masks if mask.target is not target)
            taken = tuple(mask for mask in shown.masks if mask.target is target)
            if taken:
                self._desk.edit(f"take the algorithm's {target.value} mask", replace(annotation, masks=(*kept, *taken)))
            else:
                self.say(tr("The algorithm found no {what}", what=tr_text(target.value)))
        elif shown.robot or shown.vessel:
            self.panels.canvas.close_line()
            self._desk.edit(TAKES_LINES, replace(annotation, robot=shown.robot, vessel=shown.vessel, cannot_tell=False))
        else:
            self.say(tr("The algorithm has no lines here"))
        self.panels.bar.set_switch("H", False)
        self.panels.canvas.show_proposal(None)

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

    def say(self, message: str, is_fault: bool = False) -> None:
        """A line for the rater."""
        self.panels.toast.show_message(message, is_fault=is_fault)

    def tell_saved(self) -> None:
        """Where the annotations are."""
        self._keep_all()
        self._desk.settle()
        if self._desk.unsaved:
            self.say(tr("{count} edits could not be written.", count=self._desk.unsaved), is_fault=True)
            return
        self.say(tr("Every edit is saved at once, in {path}", path=self._desk.store_path))

    def _on_escape(self) -> None:
        if self.panels.help.isVisible():
            self.panels.help.hide()
        elif not self.panels.canvas.hasFocus():
            self.panels.canvas.setFocus()
        elif not self.panels.canvas.let_go():
            super()._on_escape()
        self.panels.bar.show_tool(self.panels.canvas.tool, brush_on=self.panels.canvas.brush_on)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in (QEvent.Type.MouseMove, QEvent.Type.MouseButtonPress, QEvent.Type.KeyPress, QEvent.Type.Wheel):
            self._desk.sign_of_life()
        return False

    def _may_close(self) -> bool:
        """Edits that cannot be written are asked about."""
        self._keep_all()
        self._desk.settle()
        return not self._desk.unsaved or self._may_lose()

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

    def _let_go(self) -> None:
        if self._training is not None:
            self._training.end()
        self.panels.canvas.removeEventFilter(self)

    def _finish(self) -> Sequence[str]:
        """What is still to be written or perceived."""
        return self._desk.shut_down()
