"""The annotator window: panels, menus, and the wiring of canvas, readout, list and keys to the model."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from PySide6.QtCore import QEvent, QObject
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QHBoxLayout, QInputDialog, QMessageBox, QWidget

from app.annotator.canvas import CANVAS_KEYS, AnnotationCanvas
from app.annotator.editing import RADIUS_NOTCH, MaskMode, Tool
from app.annotator.files import IMPORTED, AnnotationFiles
from app.annotator.model import AnnotationModel
from app.annotator.panels import AnnotationBar, AnnotationHeader, AnnotationReadout, Answer, QueueList, QueueModel
from app.player.controls import NoteField
from app.training.dialog import TrainingDialog
from app.training.model import collect_from_store
from app.ui import theme
from app.ui.actions import MenuEntry, add_help_menu, add_menu
from app.ui.i18n import mark, tr, tr_text
from app.ui.texts import refusal_text
from app.ui.window_base import WindowFrame
from app.widgets.basics import Card, Columns, column, holder, set_window_margins, side
from app.widgets.image_canvas import LightSliders
from app.widgets.messages import Offer, OfferButton, OfferStrip, Toast
from app.widgets.shortcut_page import KeyPage
from core.annotation.model import TAKES_LINES, Annotation, MaskTarget, Readout

_ZOOM_STEP = 1.3


def add_annotator_menus(window: AnnotatorWindow) -> None:
    """Fill the window's menu bar; keys that step repeat while they are held."""
    panels = window.panels
    canvas, bar, light = panels.canvas, panels.bar, panels.light
    window.add_file_menu(
        [
            MenuEntry(tr("&Open..."), window.files.ask_open, ("Ctrl+O",)),
            MenuEntry(tr("&Import..."), window.files.ask_import, ("Ctrl+I",)),
            MenuEntry(tr("&Export..."), window.files.ask_export, ("Ctrl+E",)),
            MenuEntry(tr("&Report of the raters"), window.files.report, ("Ctrl+R",)),
            MenuEntry(tr("Report of the &algorithm"), window.files.evaluate),
            None,
            MenuEntry(tr("&Next rater..."), window.ask_rater),
            MenuEntry(tr("&Train on my annotations..."), window.train),
            None,
            MenuEntry(tr("Show where it is &saved"), window.show_where_saved, ("Ctrl+S",)),
        ],
        has_recent=True,
    )
    view = window.add_view_menu(
        [
            MenuEntry(tr("Zoom &in"), partial(canvas.zoom, _ZOOM_STEP), ("+", "=")),
            MenuEntry(tr("Zoom &out"), partial(canvas.zoom, 1 / _ZOOM_STEP), ("-",)),
            MenuEntry(tr("&Close-up of the head, or the cursor"), canvas.close_up, ("Z",)),
            MenuEntry(tr("&Whole picture"), canvas.fit, ("F", "0")),
            MenuEntry(tr("&Keep the zoom from picture to picture"), window.toggle_keeps_zoom, checked=True),
            None,
            MenuEntry(tr("More contrast"), partial(light.step, 1), (".",)),
            MenuEntry(tr("Less contrast"), partial(light.step, -1), (",",)),
            MenuEntry(tr("Brighter"), partial(light.step, 0, 1), (">",)),
            MenuEntry(tr("Darker"), partial(light.step, 0, -1), ("<",)),
            MenuEntry(tr("&Normal contrast and brightness"), light.reset, ("/",)),
            None,
            MenuEntry(tr("&Loupe"), partial(bar.toggle, "L"), ("L",), checked=True),
            MenuEntry(tr("&Masks"), partial(bar.toggle, "K"), ("K",), checked=True),
            MenuEntry(tr("&Algorithm"), window.toggle_proposal, ("H",), checked=False),
        ]
    )
    switches = dict(zip("LKH", view[-4:-1], strict=True))
    bar.shown.connect(lambda key, on: switches[key].setChecked(on))
    drawing = _add_drawing_menus(window)
    go = add_menu(
        window,
        tr("&Go"),
        [
            MenuEntry(tr("&Next"), partial(window.step, 1), ("N", "PgDown")),
            MenuEntry(tr("&Previous"), partial(window.step, -1), ("P", "PgUp")),
            MenuEntry(tr("Next &without an answer"), window.go_open, ("U",)),
            MenuEntry(tr("&First"), partial(window.open, 0), ("Home",)),
            MenuEntry(tr("&Last"), partial(window.open, len(window.model.items) - 1), ("End",)),
            MenuEntry(tr("Lis&t of images"), panels.queue.setFocus, ("F6",)),
        ],
    )
    for action in (*drawing, *go[:2], *view[:2], *view[4:8]):
        action.setAutoRepeat(True)
    add_help_menu(window, panels.help.toggle)


def _add_drawing_menus(window: AnnotatorWindow) -> Sequence[QAction]:
    """What edits the annotation, and its tools; returns the steps among them."""
    canvas = window.panels.canvas
    answers = [MenuEntry(tr("Answer: {answer}", answer=tr(a.value.label)), partial(window.give, a), (a.value.key,)) for a in Answer]
    edits = add_menu(
        window,
        tr("&Edit"),
        [
            MenuEntry(tr("&Undo"), window.undo, ("Ctrl+Z",)),
            MenuEntry(tr("&Redo"), window.redo, ("Ctrl+Shift+Z", "Ctrl+Y")),
            None,
            *answers,
            MenuEntry(tr("&Note"), window.edit_note, ("M", "F2")),
            None,
            MenuEntry(tr("Take the &algorithm's lines, or mask"), window.apply_proposal, ("G",)),
            MenuEntry(tr("&Masks as in another image"), window.carry_masks, ("V",)),
            MenuEntry(tr("Follow the &lines through the clip"), window.follow_lines, ("Ctrl+F",)),
            MenuEntry(tr("&Fewer points on outlines"), window.simplify, ("S",)),
        ],
    )
    tools = [MenuEntry(tr(t.value.label), partial(window.set_tool, t), (t.value.key,)) for t in Tool]
    drawing = add_menu(
        window,
        tr("&Tools"),
        [
            *tools,
            None,
            *[MenuEntry(tr(m.value.label), partial(window.toggle_mode, m), (m.value.key,)) for m in MaskMode if m.value.key],
            MenuEntry(tr("Circle smaller"), partial(canvas.resize_circle, 1 / RADIUS_NOTCH), ("[",)),
            MenuEntry(tr("Circle larger"), partial(canvas.resize_circle, RADIUS_NOTCH), ("]",)),
        ],
    )
    return (*edits[:2], *drawing[-2:])


_MOUSE = (
    mark("In the picture, by mouse"),
    (
        (mark("Click, drag"), mark("set a point; move one")),
        (mark("Double click"), mark("end the line")),
        (mark("Right click"), mark("take a point out; brush, region, tube: take away")),
        (mark("Wheel"), mark("zoom at the cursor; brush, region, tube: size, with Ctrl zoom")),
    ),
)

_LEFT_SHARE = 0.74
_SIDE_WIDTH = (330, 400)
_LEFT_GAP = 6


class AnnotatorPanels(QWidget):
    """Makes the widgets and lays them out.

    Parameters
    ----------
    model : whose items are listed.
    who : study and rater, as they are shown.
    names : of the items, in their order, as the list shows them.
    """

    def __init__(self, model: AnnotationModel, who: str, names: list[str]) -> None:
        super().__init__()
        self.canvas = AnnotationCanvas()
        self.readout = AnnotationReadout()
        self.bar = AnnotationBar(blind=model.blind)
        self.header = AnnotationHeader(who)
        self.light = LightSliders()
        self.note = NoteField(tr("Note on this image  (M)"))
        paths = (
            () if model.blind else [item.image.path for item in model.items]
        )  # a picture that returns mirrored is not to be known
        self.queue = QueueList(QueueModel(names, model, paths))
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
        self.help = KeyPage(self, ((mark("In the picture"), CANVAS_KEYS), _MOUSE))
        self.toast = Toast(self.canvas)
        self.offers = OfferStrip(self.canvas)
        self.offers.lifted.connect(self.toast.lift)


_DONE, _FOLLOWING = "done", "following"
"""Keys of the offers after the last image, and while lines are followed."""
_TAKEN_BACK = {Answer.CANNOT_TELL: "can tell", Answer.NO_ROBOT: "there is a robot"}


class AnnotatorWindow(WindowFrame):
    """Shows the model's open item and hands the rater's edits to the model.

    Parameters
    ----------
    model : queue, edits, disk; the window shuts it down when it closes.
    who : study and rater, as they are shown.
    paths : where the images are, for the commands that report and export.
    """

    def __init__(self, model: AnnotationModel, who: str, paths: Sequence[Path] = ()) -> None:
        super().__init__()
        self.setMinimumWidth(theme.MIN_WIDE_PX)
        self.model = model
        model.setParent(self)
        self._training: TrainingDialog | None = None
        self._carried: Annotation | None = None
        """Masks that another image's lead to: a proposal, until it is taken or hidden."""
        self._takes_proposal = False
        """The algorithm's answer is taken over as soon as it comes."""
        self.next_rater = ""
        """Who annotates these images next, once this window is closed."""
        # In a blind study no name tells that an image was there before.
        names = [item.image.path.name for item in model.items]
        if model.blind:
            names = [tr("image {place}", place=place) for place in range(1, len(model.items) + 1)]
        self.panels = AnnotatorPanels(model, who, names)
        self.setCentralWidget(self.panels)
        self.files = AnnotationFiles(self, model, self.panels.offers, paths)
        add_annotator_menus(self)
        self._connect()
        self.setWindowTitle(tr("LumenPilot \N{EM DASH} annotate {name}", name=model.store.path.absolute().parent.name))

    def _connect(self) -> None:
        model, panels, canvas = self.model, self.panels, self.panels.canvas
        model.opened.connect(self._on_opened)
        model.changed.connect(self._on_changed)
        model.status_changed.connect(self._on_status_changed)
        model.saved.connect(lambda: panels.header.show_saved(True))
        model.failed.connect(self._on_failed)
        model.proposed.connect(self._show_proposal)
        model.carried.connect(self._show_carried)
        model.following.connect(self._show_following)
        model.followed.connect(self._on_followed)
        self.files.said.connect(self.show_message)
        self.others.said.connect(self.show_message)
        panels.bar.answered.connect(self.give)
        canvas.edited.connect(self._on_edited)
        canvas.previewed.connect(self._on_previewed)
        canvas.line_ended.connect(self._on_line_ended)
        canvas.tool_changed.connect(lambda tool: panels.bar.show_tool(tool, MaskMode.POINTS))
        canvas.outline_failed.connect(lambda line: self.show_message(line, is_fault=True))
        canvas.ended.connect(self._on_ended)
        canvas.installEventFilter(self)
        panels.bar.tool_chosen.connect(self.set_tool)
        panels.bar.mode_chosen.connect(self.set_mode)
        panels.bar.switched.connect(self._on_switched)
        panels.light.changed.connect(canvas.set_light)
        panels.note.editingFinished.connect(self._save_note)
        panels.note.returnPressed.connect(canvas.setFocus)
        panels.queue.chosen.connect(self._on_chosen)

    def start(self) -> None:
        super().start()
        self.panels.canvas.setFocus()
        self.panels.queue.show_progress(self.model.finished, len(self.model.items))
        first = self.model.next_open(-1)
        self.open(first if first is not None else 0)

    # ---- the open item

    def open(self, place: int) -> None:
        """Open an item; the canvas is blank until it is loaded."""
        self._complete_edits()
        if place != self.model.index:
            self.panels.canvas.blank()
            self.panels.readout.show_annotation(Annotation(), Readout(missing=tr("loading")))
        self.panels.queue.show_current(place)
        self.model.open(place)
        number, count = place + 1, len(self.model.items)
        name = self.model.items[place].image.path.name if not self.model.blind else tr("Image {place}", place=number)
        self.panels.header.show_title(tr("{name}   ({place} of {count})", name=name, place=number, count=count))

    def _on_chosen(self, place: int) -> None:
        self.panels.canvas.setFocus()
        if place != self.model.index:
            self.open(place)

    def step(self, step: int) -> None:
        """So many items on, or back."""
        place = self.model.index + step
        left = len(self.model.items) - self.model.finished
        if 0 <= place < len(self.model.items):
            self.open(place)
        elif step < 0:
            self.show_message(tr("The first image"))
        elif left:
            self.show_message(tr("The last image. {left} without an answer: U goes there", left=left))
        else:
            self._offer_end()

    def _offer_end(self) -> None:
        """All images are answered: what comes next."""
        is_study = self.model.blind
        report = OfferButton(tr("Report"), self.files.report, tr("How well the raters agree, with each other and themselves"))
        rater = OfferButton(tr("Next rater..."), self.ask_rater, tr("The same images for somebody else"))
        judged = OfferButton(tr("Evaluate"), self.files.evaluate, tr("The algorithm against these answers, as a report"))
        export = OfferButton(tr("Export..."), self.files.ask_export, tr("Training set, table, or masks for other programs"))
        answers = (rater, report, judged, export) if is_study else (judged, report, rater, export)
        count = len(self.model.items)
        self.panels.offers.offer(Offer(_DONE, tr("All {count} images have an answer", count=count), "", answers))

    def ask_rater(self) -> None:
        """Who annotates next; this window closes, and opens for them."""
        rater = self.model.items[0].key.rater
        dialog = QInputDialog(self)
        dialog.setWindowTitle(tr("Next rater"))
        dialog.setLabelText(tr("Who annotates next? Now it is {rater}.", rater=rater))
        dialog.textValueSelected.connect(self._on_rater)
        dialog.finished.connect(dialog.deleteLater)
        dialog.open()

    def _on_rater(self, text: str) -> None:
        self.next_rater = text.strip()
        if self.next_rater and not self.close():
            self.next_rater = ""

    def go_open(self) -> None:
        place = self.model.next_open(self.model.index)
        if place is None:
            self._offer_end()
        else:
            self.open(place)

    def _on_opened(self) -> None:
        annotation, canvas = self.model.annotation, self.panels.canvas
        self.panels.note.setText(annotation.note)  # also while it has the focus: its text was the last picture's
        canvas.show_image(self.model.levels, annotation, self.model.shown_readout)
        canvas.set_mask_mode(MaskMode.POINTS)
        tool = Tool.VESSEL if len(annotation.robot) > 1 and len(annotation.vessel) < 2 else Tool.ROBOT
        if tool is not canvas.tool:
            canvas.set_tool(tool)
        self.panels.bar.show_tool(canvas.tool, MaskMode.POINTS)
        self._hide_proposal()
        self._show_annotation()

    def _show_annotation(self) -> None:
        annotation = self.model.annotation
        readout = self.model.shown_readout(annotation)
        self.panels.readout.show_annotation(annotation, readout, self.model.history.provenance)
        self.panels.bar.show_answer(annotation, readout)
        if not self.panels.note.hasFocus():
            self.panels.note.setText(annotation.note)

    def _on_changed(self) -> None:
        self.panels.canvas.show_annotation(self.model.annotation)
        self._show_annotation()
        if self.model.unsaved:
            self.panels.header.show_saved(False)

    def _on_status_changed(self, place: int) -> None:
        self.panels.queue.update_row(place)
        self.panels.queue.show_progress(self.model.finished, len(self.model.items))

    def _on_failed(self, line: str, is_edit: bool) -> None:
        if is_edit:
            self.panels.header.show_unsaved(self.model.unsaved, line)
        else:
            if not self.model.is_open:
                self.panels.readout.show_annotation(Annotation(), Readout(missing=tr("this image cannot be shown")))
            self.panels.bar.set_switch("H", False)
        self.show_message(line, is_fault=True)

    # ---- edits

    def _on_edited(self, action: str, annotation: Annotation | None) -> None:
        if annotation is None:  # cancelled
            self._on_changed()
        else:
            self.model.edit(action, annotation)

    def _on_previewed(self, annotation: Annotation, readout: Readout) -> None:
        source = self.model.history.provenance
        self.panels.readout.show_annotation(annotation, readout, source, is_preview=self.panels.canvas.is_moving)
        self.panels.bar.show_answer(annotation, readout)

    def _on_line_ended(self, tool: Tool) -> None:
        """From one line to the other, as long as one is missing."""
        annotation = self.model.annotation
        if tool is Tool.ROBOT and len(annotation.vessel) < 2:
            self.set_tool(Tool.VESSEL)
        elif tool is Tool.VESSEL and len(annotation.robot) < 2:
            self.set_tool(Tool.ROBOT)
        else:
            self._show_annotation()
        readout = self.model.shown_readout(annotation)
        if annotation.state is None and readout.pose is not None:
            takes = tr("Enter takes {state}, as the lines say \N{MIDDLE DOT} or A B C D, X, O", state=readout.pose.state)
            self.panels.bar.hint.setText(takes)
        elif annotation.state is None and readout.is_hidden:
            self.panels.bar.hint.setText(tr("Now the state as you see it: A B C D, X or O"))

    def _on_ended(self) -> None:
        """Enter with both lines drawn takes the state that they say, where the rater may see it; once more goes on."""
        annotation = self.model.annotation
        readout = self.model.measure(annotation)
        if annotation.without_pose or (readout.pose is not None and annotation.state is not None):
            self.step(1)
        elif readout.pose is None:
            missing = tr_text(readout.missing)
            self.show_message(tr("Not complete: {missing}; or X, can't tell; or O, no robot", missing=missing))
        elif self.model.is_hidden:
            self.show_message(tr("A blind study: choose the state yourself, A B C D"))
        else:
            self.give(next(one for one in Answer if one.value.state is readout.pose.state))

    def give(self, answer: Answer) -> None:
        """The rater's answer. One without a pose is taken back by giving it again; at once, the state from before is back."""
        self.panels.canvas.complete()
        self.panels.canvas.close_line()
        annotation, state = self.model.annotation, answer.value.state
        action = f"state {state.value}" if state is not None else answer.value.label.lower()
        if state is None and Answer.of(annotation) is answer:
            if self.model.history.undo_action == action:
                self.model.undo()
                return
            self.model.edit(_TAKEN_BACK[answer], replace(annotation, cannot_tell=False, no_robot=False))
            return
        cannot_tell, no_robot = answer is Answer.CANNOT_TELL, answer is Answer.NO_ROBOT
        self.model.edit(action, replace(annotation, state=state, cannot_tell=cannot_tell, no_robot=no_robot))

    def undo(self) -> None:
        """Back one edit, and say which; while an outline is drawn, its last point."""
        if self.panels.canvas.undo_draft_point():
            self.show_message(tr("Undone: {action}", action=tr("the outline's last point")))
            return
        self.panels.canvas.complete()
        action = self.model.history.undo_action
        self.model.undo()
        self.show_message(tr("Undone: {action}", action=tr_text(action)) if action else tr("Nothing to undo"))

    def redo(self) -> None:
        """Forward one edit, and say which."""
        self.panels.canvas.complete()
        can_redo = self.model.history.can_redo
        self.model.redo()
        action = tr_text(self.model.history.undo_action)
        self.show_message(tr("Done again: {action}", action=action) if can_redo else tr("Nothing to redo"))

    def edit_note(self) -> None:
        """Write the note; Enter or Escape goes back to the picture."""
        self.panels.note.setFocus()
        self.panels.note.selectAll()

    def _complete_edits(self) -> None:
        """What is being drawn and written."""
        self.panels.canvas.complete()
        self._save_note()

    def _save_note(self) -> None:
        text = self.panels.note.kept_text
        if self.model.is_open and text != self.model.annotation.note:
            self.model.edit("note", replace(self.model.annotation, note=text))

    def simplify(self) -> None:
        if self.panels.canvas.tool.is_mask:
            self.panels.canvas.simplify_masks()
        else:
            self.show_message(tr("Fewer points are for masks: 3 or 4 first"))

    # ---- tools and switches

    def set_tool(self, tool: Tool) -> None:
        """Choose a tool, by key, chip or menu."""
        self.panels.canvas.complete()
        self.panels.canvas.set_tool(tool)
        self.set_mode(MaskMode.POINTS)
        self._show_annotation()

    def set_mode(self, mode: MaskMode) -> None:
        """Choose how a mask is drawn, by key, chip or menu; with a line tool the vessel's mask is meant."""
        canvas = self.panels.canvas
        if mode is not MaskMode.POINTS and not canvas.tool.is_mask:
            self.set_tool(Tool.VESSEL_MASK)
        canvas.complete()
        canvas.set_mask_mode(mode)
        self.panels.bar.show_tool(canvas.tool, canvas.mask_mode)
        canvas.setFocus()

    def toggle_mode(self, mode: MaskMode) -> None:
        self.set_mode(MaskMode.POINTS if self.panels.canvas.mask_mode is mode else mode)

    def _on_switched(self, key: str, on: bool) -> None:
        canvas = self.panels.canvas
        if key == "L":
            canvas.set_loupe(on)
        elif key == "K":
            canvas.set_masks_shown(on)
        elif on:
            if self.model.proposal is None:
                self.show_message(tr("Asking the algorithm"))
            self.model.propose()
        else:
            self._takes_proposal = False
            canvas.show_proposal(None)
        canvas.setFocus()

    def toggle_keeps_zoom(self) -> None:
        """Whether the next picture is shown as magnified as this one."""
        self.panels.canvas.keeps_zoom = not self.panels.canvas.keeps_zoom

    # ---- the algorithm

    def toggle_proposal(self) -> None:
        if self.model.blind:
            self.show_message(tr("A blind study: what the algorithm says is hidden"))
        else:
            self.panels.bar.toggle("H")

    def _show_proposal(self) -> None:
        """The answer, if the rater still wants it: seeing it biases them. Otherwise it is kept for the next time."""
        proposal = self.model.proposal
        if proposal is None or not self.model.is_open or not self.panels.bar.is_on("H"):
            return
        self.model.record_proposal_seen()
        proposed = self.model.proposed_annotation
        self.panels.canvas.show_proposal(proposed)
        pose = self.model.measure(proposed).pose or proposal.pose
        if self._takes_proposal:
            self.apply_proposal()
            return
        if pose is not None:
            text = tr(
                "Algorithm: θ {theta:.1f}°, state {state}, confidence {confidence:.2f}. G takes it over",
                theta=pose.theta_deg,
                state=pose.state.value,
                confidence=proposal.confidence,
            )
        else:
            why = refusal_text(proposal.refusal) if proposal.refusal is not None else ""
            text = tr("The algorithm gives no pose: {why}", why=why)
        self.show_message(text)

    def _hide_proposal(self) -> None:
        self.panels.bar.set_switch("H", False)
        self._carried, self._takes_proposal = None, False
        self.panels.canvas.show_proposal(None)

    def carry_masks(self) -> None:
        """Propose the masks that follow from another image of the same bench; once more hides them."""
        if self._carried is not None:
            self._hide_proposal()
            return
        source = self.model.carry()
        if source:
            self.show_message(tr("Finding the masks by those of {name}", name=source))
        elif self.model.blind:
            self.show_message(tr("A blind study: masks are drawn outside it"))
        else:
            self.show_message(tr("No other image of this folder and size has a robot mask"))

    def follow_lines(self) -> None:
        """Follow the drawn lines through all images of the clip; what was drawn or corrected stays, and is followed from."""
        self._complete_edits()
        count = self.model.follow()
        if count:
            self._show_following(0, count)
        elif self.model.blind:
            self.show_message(tr("A blind study: lines are drawn by hand in it"))
        else:
            self.show_message(tr("Draw both lines on an image of this folder first; the others get theirs from it"))

    def _show_following(self, done: int, count: int) -> None:
        stop = OfferButton(tr("Stop"), self.model.stop_following, tr("What was followed so far is kept"))
        words = tr("Following the lines: {done} of {count} images", done=done, count=count)
        self.panels.offers.offer(Offer(_FOLLOWING, words, "", (stop,), share=done / count, dismissed=self.model.stop_following))

    def _on_followed(self, count: int) -> None:
        self.panels.offers.withdraw(_FOLLOWING)
        if count:
            self.show_message(tr("{count} images have followed lines: correct one, and Ctrl+F follows from it", count=count))

    def _show_carried(self, proposal: Annotation, name: str) -> None:
        self._hide_proposal()
        self._carried = proposal
        self.panels.canvas.show_proposal(proposal)
        self.show_message(tr("Proposed from {name}, dotted: G takes the masks over, V hides them", name=name))

    def _apply_carried(self, proposal: Annotation) -> None:
        """The masks of the mask tool, or with a line tool both."""
        target = self.panels.canvas.tool.value.target
        if not self._take_masks("take the proposed masks", proposal, MaskTarget if target is None else (target,)):
            self.show_message(tr("Nothing of it was found in this image"))
        self._hide_proposal()

    def _take_masks(self, action: str, proposal: Annotation, targets: Iterable[MaskTarget]) -> bool:
        """Put the proposal's masks of these targets in the place of the rater's; False where it has none."""
        taken = tuple(mask for mask in proposal.masks if mask.target in tuple(targets))
        if taken:
            replaced = {mask.target for mask in taken}
            kept = tuple(mask for mask in self.model.annotation.masks if mask.target not in replaced)
            self.model.edit(action, replace(self.model.annotation, masks=(*kept, *taken)))
        return bool(taken)

    def apply_proposal(self) -> None:
        """Take over the lines with a line tool, the tool's masks with a mask tool; undo brings the rater's own back."""
        self.panels.canvas.complete()
        if self._carried is not None:
            self._apply_carried(self._carried)
            return
        if self.model.proposal is None or not self.panels.bar.is_on("H"):
            self._takes_proposal = True
            if self.model.blind or not self.panels.bar.is_on("H"):  # else the answer is waited for
                self.toggle_proposal()
            return
        proposed, annotation, target = self.model.proposed_annotation, self.model.annotation, self.panels.canvas.tool.value.target
        if target is not None:
            if not self._take_masks(f"take the algorithm's {target.value} mask", proposed, (target,)):
                self.show_message(tr("The algorithm found no {what}", what=tr_text(target.value)))
        elif proposed.robot or proposed.vessel:
            self.panels.canvas.close_line()
            taken_over = replace(proposed, state=annotation.state, masks=annotation.masks, note=annotation.note)
            self.model.edit(TAKES_LINES, taken_over)
            self.show_message(tr("The algorithm's lines are yours now: correct them, Enter goes on, Ctrl+Z takes them back"))
        else:
            self.show_message(tr("The algorithm has no lines here"))
        self._hide_proposal()

    # ---- training

    def train(self) -> None:
        """Train a model on the masks of this file, in a dialog."""
        if self._training is None:
            images = [item.image for item in self.model.items]
            collect = partial(collect_from_store, self.model.store, images)
            self._training = TrainingDialog(collect, str(self.model.store.path), self)
        self._training.show()
        self._training.raise_()

    # ---- the window

    def show_message(self, message: str, is_fault: bool = False) -> None:
        """A line for the rater."""
        self.panels.toast.show_message(message, is_fault=is_fault)

    def show_where_saved(self) -> None:
        self._complete_edits()
        self.model.settle()
        if self.model.unsaved:
            self.show_message(tr("{count} edits could not be written.", count=self.model.unsaved), is_fault=True)
        else:
            self.show_message(tr("Every edit is saved at once, in {path}", path=self.model.store.path))

    def _on_escape(self) -> None:
        if self.panels.help.isVisible():
            self.panels.help.hide()
        elif not self.panels.canvas.hasFocus():
            self.panels.canvas.setFocus()
        elif not self.panels.canvas.cancel():
            super()._on_escape()
        self.panels.bar.show_tool(self.panels.canvas.tool, self.panels.canvas.mask_mode)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in (QEvent.Type.MouseMove, QEvent.Type.MouseButtonPress, QEvent.Type.KeyPress, QEvent.Type.Wheel):
            self.model.record_activity()
        return False

    def _may_close(self) -> bool:
        """Edits that cannot be written are asked about."""
        self._complete_edits()
        self.model.settle()
        return not self.model.unsaved or self._may_lose()

    def _may_lose(self) -> bool:
        text = tr("{count} edits could not be written.", count=self.model.unsaved)
        box = QMessageBox(QMessageBox.Icon.Warning, tr("Not saved"), text, parent=self)
        box.setInformativeText(tr("Free some space or put the disk back, and they are written by themselves."))
        stay = box.addButton(tr("Stay"), QMessageBox.ButtonRole.RejectRole)
        box.addButton(tr("Leave without them"), QMessageBox.ButtonRole.DestructiveRole)
        box.setDefaultButton(stay)
        box.exec()
        return box.clickedButton() is not stay

    def open_path(self, path: Path) -> None:
        """A file of another program is imported; everything else opens in a window of its own."""
        if path.suffix.lower() in IMPORTED:
            self.model.import_files([path])
        else:
            self.others.open_path(path, "--rater", self.model.items[0].key.rater)

    def _let_go(self) -> None:
        self.files.close()
        if self._training is not None:
            self._training.end()
        self.panels.canvas.removeEventFilter(self)

    def _finish(self) -> Sequence[str]:
        return self.model.shut_down()
