"""The library: all sessions of a folder with picture, length, states, faults and description; searched, tagged, opened."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from PySide6.QtCore import QEvent, QModelIndex, QPersistentModelIndex, QRectF, QSize, Qt, QTimer
from PySide6.QtGui import QColor, QPainter, QPixmap
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QFileDialog,
    QLabel,
    QLineEdit,
    QListView,
    QMenu,
    QPushButton,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QWidget,
)

from app.library.model import SUMMARY, LibraryFilter, LibraryModel, SortOrder, title_of
from app.ui import theme
from app.ui.actions import MenuEntry, add_help_menu, add_menu
from app.ui.description_form import DescriptionForm
from app.ui.i18n import mark, tr, tr_text
from app.ui.opening import OfferedCommand, ask_path, open_file
from app.ui.window_base import WindowFrame
from app.widgets.basics import Card, Columns, column, holder, line, name_list, set_window_margins, side, text_button
from app.widgets.messages import OfferStrip, Toast
from app.widgets.painting import CENTER, RIGHT, draw_box, draw_fitted, draw_text, text_width
from app.widgets.shortcut_page import KeyPage
from core.session.exporters import PLUGINS as EXPORTERS
from core.session.library import SessionSummary
from core.session.manifest import Description
from core.types import PoseState

_ROW_PX, _PICTURE_PX = 104, (128, 96)
_SIDE_PX = 400, 520
_SHARE = 0.66
_AGAIN_MS = 3000
"""While a session is being recorded, the folder is looked through so often."""
_KIND_ROLES = ("SIM", "LIVE", "PLAYBACK")
_MOUSE = (mark("Mouse"), ((mark("Double click"), mark("play the session")),))

_Index = QModelIndex | QPersistentModelIndex


def length_text(seconds: float | None) -> str:
    """Such as "1:23" or "1:02:03"; "..." while it is not known."""
    if seconds is None:
        return "\N{HORIZONTAL ELLIPSIS}"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def states_text(summary: SessionSummary) -> str:
    """Share of the frames in each state, and without a pose, such as "A 62 %, B 20 %, no pose 18 %"."""
    total = sum(summary.states) + summary.without_pose
    if not total:
        return ""
    shares = [(state.value, count) for state, count in zip(PoseState, summary.states, strict=False)]
    shares.append((tr("no pose"), summary.without_pose))
    return ", ".join(f"{name} {100 * count / total:.0f} %" for name, count in shares if count)


def faults_text(summary: SessionSummary) -> str:
    """All faults with their counts; "" where there was none."""
    return ", ".join(
        tr_text(name) + (f" \N{MULTIPLICATION SIGN}{count}" if count > 1 else "") for name, count in summary.faults.items()
    )


class SessionDelegate(QStyledItemDelegate):
    """One session: picture; when, which rig, how long; what it is about; states and faults; tags, or what is wrong with it."""

    def sizeHint(self, option: QStyleOptionViewItem, index: _Index) -> QSize:
        return QSize(300, _ROW_PX)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: _Index) -> None:
        summary, picture = index.data(SUMMARY), index.data(Qt.ItemDataRole.DecorationRole)
        assert isinstance(summary, SessionSummary)
        room = QRectF(option.rect).adjusted(2, 1, -2, -1)  # type: ignore[attr-defined]
        is_chosen = bool(option.state & QStyle.StateFlag.State_Selected)  # type: ignore[attr-defined]
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        draw_box(painter, room, 8, theme.RAISED if is_chosen else theme.PANEL, theme.SKY if is_chosen else theme.LINE)
        place = QRectF(room.left() + 4, room.top() + 3, *_PICTURE_PX)
        draw_box(painter, place, 4, theme.ON_PICTURE.INK)
        if isinstance(picture, QPixmap):
            draw_fitted(painter, place, picture)
        text = QRectF(place.right() + 14, room.top() + 8, room.right() - place.right() - 28, 20)
        _paint_head(painter, text, summary)
        about = summary.description.line
        colour = theme.TEXT if about else theme.TEXT_FAINT
        draw_text(painter, text.translated(0, 23), about or tr("not described"), theme.font(13), colour, elided=True)
        _paint_states(painter, text.translated(0, 46), summary)
        _paint_last(painter, text.translated(0, 68), summary)
        painter.restore()


def _paint_head(painter: QPainter, room: QRectF, summary: SessionSummary) -> None:
    """Kind, time, rig; at the right the length."""
    right = tr("recording") if summary.is_recording else length_text(summary.seconds)
    colour = theme.VERMILLION if summary.is_recording else theme.TEXT
    draw_text(painter, room, right, theme.semi_bold(14), colour, RIGHT)
    kind, font = tr_text(summary.kind), theme.bold(11)
    role = summary.kind if summary.kind in _KIND_ROLES else "TEXT_FAINT"
    chip = QRectF(room.left(), room.top() + 1, text_width(font, kind) + 14, 18)
    draw_box(painter, chip, 4, None, theme.of(role), 1.5)
    draw_text(painter, chip, kind, font, theme.of(role), CENTER)
    title = title_of(summary)
    place = room.adjusted(chip.width() + 10, 0, -text_width(theme.semi_bold(14), right) - 12, 0)
    draw_text(painter, place, title, theme.semi_bold(14), theme.TEXT, elided=True)
    place.setLeft(place.left() + text_width(theme.semi_bold(14), title) + 12)
    if place.width() > 40:
        draw_text(painter, place, summary.rig, theme.font(12), theme.TEXT_FAINT, elided=True)


def _paint_states(painter: QPainter, room: QRectF, summary: SessionSummary) -> None:
    """A bar of the shares of the states, what it says in words, and the faults."""
    total = sum(summary.states) + summary.without_pose
    if not total:
        return
    bar = QRectF(room.left(), room.center().y() - 4, 110, 8)
    draw_box(painter, bar, 4, theme.LINE)
    left = bar.left()
    for state, count in zip(PoseState, summary.states, strict=False):
        width = bar.width() * count / total
        painter.fillRect(QRectF(left, bar.top(), width, bar.height()), QColor(theme.STATE_COLOUR[state]))
        left += width
    words = states_text(summary)
    place = room.adjusted(bar.width() + 10, 0, 0, 0)
    draw_text(painter, place, words, theme.font(12), theme.TEXT_DIM, elided=True)
    if faults := faults_text(summary):
        place.setLeft(place.left() + text_width(theme.font(12), words) + 14)
        draw_text(painter, place, f"\N{WARNING SIGN} {faults}", theme.font(12), theme.VERMILLION, elided=True)


def _paint_last(painter: QPainter, room: QRectF, summary: SessionSummary) -> None:
    font = theme.font(12)
    if summary.problem:
        draw_text(painter, room, tr_text(summary.problem), font, theme.FAULT, elided=True)
        return
    left = room.left()
    for tag in summary.description.tags:
        chip = QRectF(left, room.top() + 1, text_width(font, tag) + 16, 18)
        if chip.right() > room.right():
            break
        draw_box(painter, chip, 9, theme.WINDOW, theme.LINE)
        draw_text(painter, chip, tag, font, theme.TEXT_DIM, CENTER)
        left = chip.right() + 6


class LibraryPanels(QWidget):
    """The list with search, tags and order above it; at the right the session that is chosen."""

    def __init__(self, sessions: LibraryFilter) -> None:
        super().__init__()
        theme.set_sheet(self, theme.FORM_SHEET)
        self.search = QLineEdit(placeholderText=tr("Search: operator, task, date, rig, #tag, fault ..."))
        self.search.setAccessibleName(tr("Search"))
        self.search.setClearButtonEnabled(True)
        self.tags, self.order = QComboBox(), QComboBox()
        self.tags.addItem(tr("All tags"), "")
        name_list(self.tags, tr("Tag"))
        for order in SortOrder:
            self.order.addItem(tr(order.value), order)
        name_list(self.order, tr("Order"))
        self.count = QLabel("")
        self.count.setObjectName("card_note")
        self.list = QListView()
        self.list.setModel(sessions)
        self.list.setItemDelegate(SessionDelegate(self.list))
        self.list.setUniformItemSizes(True)
        self.list.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.list.setAccessibleName(tr("Sessions"))
        theme.set_sheet(self.list, "QListView { background: @WINDOW; border: none; outline: none; }")
        self.picture = QLabel(alignment=Qt.AlignmentFlag.AlignCenter)
        theme.set_sheet(self.picture, f"background: {theme.ON_PICTURE.INK}; border-radius: 6px;")
        self.picture.setFixedHeight(196)
        self.facts = QLabel(wordWrap=True, textInteractionFlags=Qt.TextInteractionFlag.TextSelectableByMouse)
        theme.set_sheet(self.facts, "color: @TEXT_DIM; font-size: 13px;")
        self.form = DescriptionForm()
        self._shown: Path | None = None
        self.play = text_button(tr("Play"), lambda: None)
        self.play.setObjectName("main_button")
        self.annotate = text_button(tr("Annotate"), lambda: None)
        self.export = QPushButton(tr("Export"))
        self.export.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        buttons = line((self.play, 1), (self.annotate, 1), (self.export, 1), spacing=8)
        self.card = Card(tr("Session"), column(self.picture, self.facts, buttons, self.form, spacing=10))
        right = column(self.card, None)
        head = line((self.search, 1), self.tags, self.order, self.count, spacing=8)
        left = holder(column(head, (self.list, 1), spacing=8))
        self.columns = Columns(left, side(right, *_SIDE_PX), _SHARE)
        layout = column(self.columns)
        set_window_margins(layout)
        self.setLayout(layout)
        self.help = KeyPage(self.columns, last=(_MOUSE,))
        self.toast, self.offers = Toast(self.list), OfferStrip(self.list)
        self.offers.lifted.connect(self.toast.lift)

    def show_session(self, summary: SessionSummary | None, picture: object) -> None:
        """The session that is chosen; the fields stay as they are while they are being filled in."""
        self.card.setVisible(summary is not None)
        if summary is None:
            return
        pixmap = picture if isinstance(picture, QPixmap) else QPixmap()
        self.picture.setPixmap(pixmap)
        self.picture.setVisible(not pixmap.isNull())
        self.facts.setText("\n".join(_facts(summary)))
        focus = self.focusWidget()
        is_typed = focus is not None and self.form.isAncestorOf(focus)
        if not is_typed or summary.folder != self._shown:
            self._shown = summary.folder
            self.form.show_description(summary.description)


def _facts(summary: SessionSummary) -> list[str]:
    """What is known of a session, a line each."""
    made = tr("recorded with LumenPilot {program}", program=summary.program) if summary.program else ""
    head = f"{title_of(summary)}, {tr_text(summary.kind)}, {tr('rig {name}', name=summary.rig or tr('unknown'))}"
    faults = tr("faults: {faults}", faults=faults_text(summary)) if summary.faults else ""
    parts = (summary.folder.name, head, tr_text(summary.problem), states_text(summary), faults, made)
    return [part for part in parts if part]


class LibraryWindow(WindowFrame):
    """Lists the sessions of a folder; what is done with one is done by a process of its own.

    Parameters
    ----------
    model : its folder is looked through when the window starts.
    """

    def __init__(self, model: LibraryModel) -> None:
        super().__init__()
        self._model = model
        model.setParent(self)
        self.sessions = LibraryFilter(model)
        self.sessions.setParent(self)
        self._chosen: Path | None = None
        self.others.said.connect(self.show_message)
        self._again = QTimer(self, singleShot=True, interval=_AGAIN_MS)
        self._again.timeout.connect(model.scan)
        self.panels = LibraryPanels(self.sessions)
        self.setCentralWidget(self.panels)
        self._add_menus()
        self._connect()
        self._show_title()

    def _add_menus(self) -> None:
        exports = [MenuEntry(tr("Export as .{ending}...", ending=name), partial(self.export, name)) for name in EXPORTERS.names]
        open_folder = MenuEntry(tr("&Open a folder..."), self.choose_folder, ("Ctrl+O",))
        self.add_file_menu([open_folder, MenuEntry(tr("&Reload"), self._model.scan, ("F5",))])
        self.add_view_menu([MenuEntry(tr("&Search"), self._begin_search, ("Ctrl+F", "/"))])
        entries = [
            MenuEntry(tr("&Play"), self.play, ("P",), hint="Enter"),
            MenuEntry(tr("&Annotate"), self.annotate, ("A",)),
            None,
            *exports,
            None,
            MenuEntry(tr("&Describe"), self.panels.form.fields["operator"].setFocus, ("D",)),
            MenuEntry(tr("Show its &folder"), self.show_folder),
            MenuEntry(tr("&Recover a copy"), self.recover),
        ]
        actions = add_menu(self, tr("&Session"), entries)
        menu = QMenu(self.panels.export)
        menu.addActions(actions[2 : 2 + len(exports)])
        self.panels.export.setMenu(menu)
        add_help_menu(self, self.panels.help.toggle)

    def _connect(self) -> None:
        panels = self.panels
        panels.search.textChanged.connect(self._filter)
        panels.tags.activated.connect(self._filter)
        panels.order.activated.connect(self._filter)
        panels.list.activated.connect(self.play)
        panels.list.selectionModel().currentChanged.connect(self._on_chosen)
        panels.play.clicked.connect(self.play)
        panels.annotate.clicked.connect(self.annotate)
        panels.form.edited.connect(self._describe)
        self._model.updated.connect(self._on_updated)
        self._model.message.connect(self.show_message)

    @property
    def summary(self) -> SessionSummary | None:
        summary = self.panels.list.currentIndex().data(SUMMARY)
        return summary if isinstance(summary, SessionSummary) else None

    def start(self) -> None:
        super().start()
        self.panels.list.setFocus()
        self.panels.show_session(None, None)
        self.panels.count.setText(tr("reading ..."))
        self._model.scan()

    # ---- what is shown

    def _filter(self) -> None:
        panels = self.panels
        self.sessions.show(panels.search.text(), panels.tags.currentData() or "", panels.order.currentData())
        self._choose_again()
        self._show_count()

    def _on_updated(self) -> None:
        summaries = self._model.summaries
        self._show_tags(sorted({tag for one in summaries for tag in one.description.tags}, key=str.casefold))
        self._choose_again()
        self._show_count()
        if any(one.is_recording for one in summaries) and not self._again.isActive():
            self._again.start()

    def _choose_again(self) -> None:
        """The session that was chosen before, else the first one; it is shown as it is now."""
        rows = range(self.sessions.rowCount())
        indexes = [self.sessions.index(row, 0) for row in rows]
        found = next((index for index in indexes if index.data(SUMMARY).folder == self._chosen), indexes[0] if indexes else None)
        if found is not None and found != self.panels.list.currentIndex():
            self.panels.list.setCurrentIndex(found)
        self._show_chosen()

    def _on_chosen(self, index: QModelIndex) -> None:
        summary = index.data(SUMMARY)
        if isinstance(summary, SessionSummary) and summary.folder != self._chosen:
            self._chosen = summary.folder
            self.panels.form.set_known(one.description for one in self._model.summaries)
            self._show_chosen()

    def _show_chosen(self) -> None:
        index = self.panels.list.currentIndex()
        self.panels.show_session(self.summary, index.data(Qt.ItemDataRole.DecorationRole))

    def _show_tags(self, tags: Sequence[str]) -> None:
        combo = self.panels.tags
        if [combo.itemData(row) for row in range(1, combo.count())] == tags:
            return
        chosen = combo.currentData()
        combo.clear()
        combo.addItem(tr("All tags"), "")
        for tag in tags:
            combo.addItem(tag, tag)
        combo.setCurrentIndex(max(0, combo.findData(chosen)))

    def _show_count(self) -> None:
        shown_here, there = self.sessions.rowCount(), self._model.rowCount()
        if not there:
            text = tr("no session here") if self._model.is_scanned else tr("reading ...")
        else:
            text = tr("{shown} of {count}", shown=shown_here, count=there)
        self.panels.count.setText(text)

    def _show_title(self) -> None:
        self.setWindowTitle(tr("LumenPilot \N{EM DASH} sessions in {folder}", folder=self._model.folder))

    def show_message(self, message: str, is_fault: bool = False) -> None:
        self.panels.toast.show_message(message, is_fault=is_fault)

    # ---- what is done

    def choose_folder(self) -> None:
        mode = QFileDialog.FileMode.Directory
        ask_path(self, tr("A folder with sessions"), self._model.folder, self._open_folder, mode, folders_only=True)

    def _open_folder(self, folder: Path) -> None:
        self._model.open_folder(folder)
        self._show_title()

    def _begin_search(self) -> None:
        self.panels.search.setFocus()
        self.panels.search.selectAll()

    def _describe(self, description: Description) -> None:
        if self._chosen is not None:
            self._model.describe(self._chosen, description)

    def play(self) -> None:
        if (summary := self.summary) is not None:
            self.others.play(summary.folder)

    def annotate(self) -> None:
        """Pictures evenly over it, in the annotator."""
        if (summary := self.summary) is not None:
            self.others.annotate(summary.folder)

    def recover(self) -> None:
        """A whole copy beside a session that was cut."""
        if (summary := self.summary) is not None:
            name = summary.folder.name
            words = tr("Recovering a copy: {name}", name=name), tr("Recovered: {name}", name=name)
            self._run(*words, "session", "recover", str(summary.folder))

    def export(self, ending: str) -> None:
        """Ask for a file, and write it beside the window."""
        if (summary := self.summary) is not None:
            folder, mode = summary.folder, QFileDialog.FileMode.AnyFile
            export = partial(self._export, folder, ending)
            start = folder.with_name(f"{folder.name}.{ending}")
            ask_path(self, tr("Export {name}", name=folder.name), start, export, mode, [f"*.{ending}"])

    def _export(self, session: Path, ending: str, chosen: Path) -> None:
        out = chosen if chosen.name.lower().endswith(f".{ending.lower()}") else chosen.with_name(f"{chosen.name}.{ending}")
        words = tr("Exporting {name}", name=out.name), tr("Exported: {path}", path=out)
        self._run(*words, "session", "export", str(session), "--out", str(out))

    def show_folder(self) -> None:
        """With the desktop's file manager."""
        if (summary := self.summary) is not None:
            open_file(summary.folder)

    def _run(self, words: str, done: str, *arguments: str) -> None:
        """Run a command that shows how far it is; `words` say what it does, `done` that it has ended well."""
        command = OfferedCommand(self, self.panels.offers, words, *arguments, "--progress-json")
        command.ended.connect(partial(self._on_ended, done))
        command.start()

    def _on_ended(self, done: str, told: object, line: str, is_fault: bool) -> None:
        self.show_message(tr_text(line) if told is None else done, is_fault)
        self._model.scan()  # there may be a recovered copy

    # ---- the window

    def changeEvent(self, event: QEvent) -> None:
        """What other windows have recorded meanwhile is listed when this one is looked at again."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.ActivationChange and self.isActiveWindow() and self._model.is_scanned:
            self._model.scan()

    def _on_escape(self) -> None:
        panels = self.panels
        if panels.help.isVisible():
            panels.help.hide()
        elif self.focusWidget() is not panels.list:
            panels.list.setFocus()
        elif panels.search.text():
            panels.search.clear()
        else:
            super()._on_escape()

    def _may_close(self) -> bool:
        """What is being typed is kept."""
        self.panels.list.setFocus()
        return super()._may_close()

    def _let_go(self) -> None:
        self._again.stop()
        for command in self.findChildren(OfferedCommand):
            command.leave()  # it ends by itself

    def _finish(self) -> Sequence[str]:
        return () if self._model.stop() else ["the disk did not answer in time; leaving without it"]
