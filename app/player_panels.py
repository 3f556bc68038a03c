"""All that is to be seen of the player below its menus: the widgets of the operator window that fit, and the timeline."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtWidgets import QHBoxLayout, QLabel, QPlainTextEdit, QVBoxLayout, QWidget

from app import palette, theme
from app.language import tr, tr_text
from app.palette import ON_PICTURE
from app.panel_layout import card_note, column, holder
from app.provenance import Provenance
from app.recorded_values import value_lines
from app.replayed import compared_line
from app.scene_panels import ScenePanels
from app.widgets.card import Card
from app.widgets.head_loupe import HeadLoupe
from app.widgets.live_view import LiveView
from app.widgets.note_field import NoteField
from app.widgets.notice import Notice, NoticeKind
from app.widgets.player_bar import PlayerBar
from app.widgets.player_help import player_help
from app.widgets.provenance_table import ProvenanceTable
from app.widgets.recorded_plate import RecordedPlate
from app.widgets.session_events import SessionEvents
from app.widgets.sim_banner import SimBanner
from app.widgets.timeline import TimelineView
from app.widgets.toast import Toast
from core.config import Config
from core.rig_file import scaled
from core.session.manifest import Manifest
from core.session.recorded import RecordedRow
from core.types import Point, Scene, Tick
from hardware.rig import RigKind

_TEXT_EVERY_S = 0.1
_BANNER_WIDTH, _GAP = 330, 8


class PlayerPanels(ScenePanels):
    """Makes the widgets, lays them out, and shows one recorded row on all of them."""

    def __init__(self, config: Config, manifest: Manifest | None, name: str, *, with_other: bool = False) -> None:
        known = manifest.known if manifest is not None else None
        pixels_per_mm = scaled(config, known).policy.pursuit.pixels_per_mm
        super().__init__(config.perception, pixels_per_mm, _TEXT_EVERY_S)
        self._scale = known.scale if known is not None else None
        self.banner = SimBanner(RigKind.PLAYBACK)
        self.banner.setFixedWidth(_BANNER_WIDTH)
        self.plate = RecordedPlate(manifest, name)
        self.live.setAccessibleName(tr("Recorded picture"))
        self.live.setAccessibleDescription(tr("Played back, not live"))
        self.live.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.other = LiveView(pixels_per_mm) if with_other else None
        self.compared = QLabel("", self)
        self.compared.setVisible(with_other)
        self.commands = ProvenanceTable()
        self.events = SessionEvents()
        self.values = QPlainTextEdit()
        self.problems = QPlainTextEdit()
        self.timeline = TimelineView()
        self.bar = PlayerBar()
        self.note = NoteField(tr("Note at this time; Enter keeps it, Esc does not"), "SKY")
        self.note.hide()
        self._provenance = Provenance()
        self._style()
        left = column(
            (self._pictures(), 5), (self.overlay_bar, 0), (self.note, 0), (_framed(self.timeline), 1), (self.bar, 0), spacing=_GAP
        )
        self.help = player_help(self._lay_out(self._header(), holder(left), self._right_side()))
        self.notice = Notice(self.live)
        self.toast = Toast(self.live)

    @property
    def views(self) -> tuple[LiveView, ...]:
        return (self.live,) if self.other is None else (self.live, self.other)

    def show_row(self, row: RecordedRow, tick: Tick, target: Point | None, *, renew_text: bool) -> None:
        """Everything as it was recorded; `target` in source pixels."""
        scene = tick.scene
        renew_text = self._renews_text(scene, asked=renew_text)
        self.notice.clear()
        self.live.show_frame(tick.frame, scene, tick.advice)
        self.live.show_target(target)
        self.badge.show_scene(scene, renew_text=renew_text)
        self._show_dials(scene, tick.status, renew_text=renew_text)
        why_none = row.drive.blanked if row.drive is not None and row.drive.blanked else tr("none was recorded")
        self._show_advice(tick, why_none, renew_text=renew_text)
        self._show_drive(row)
        if renew_text:
            self._show_values(row)

    def show_lost(self, row: RecordedRow | None, place: int) -> None:
        """A row that cannot be read, or whose picture is lost: then its values are shown without it."""
        title = tr("This picture is lost") if row is not None else tr("This row is damaged")
        self._blank(title, tr("Row {row}; the problems page names it", row=place + 1), row)
        self.notice.show_notice(NoticeKind.WARNING, title, tr("Go on with the arrow keys"))

    def show_nothing(self, title: str, detail: str, kind: NoticeKind = NoticeKind.PROGRESS) -> None:
        """No row at all, or not yet."""
        self._blank(title, detail)
        self.notice.show_notice(kind, title, detail)

    def _blank(self, title: str, why: str, row: RecordedRow | None = None) -> None:
        """No picture, and nothing of the row before; of `row` what is known without its picture."""
        self.live.clear()
        self.live.show_target(None)
        if self.other is not None:
            self.other.clear()
            self.compared.setText("")
        self._blank_dials(title, why)
        self._show_drive(row)
        self._show_values(row)

    def _show_drive(self, row: RecordedRow | None) -> None:
        view = row.drive if row is not None else None
        for widget in (self._mode_note, self.mode):
            widget.setVisible(view is not None)
        if view is not None:
            self.mode.show_view(view)
        latency_ms = 1000.0 * view.latency_s if view is not None and view.latency_s is not None else None
        self.commands.show_rows(self._provenance.rows(view), latency_ms, view.follow_share if view is not None else None)

    def _show_values(self, row: RecordedRow | None) -> None:
        bar = self.values.verticalScrollBar()
        at = bar.value()
        self.values.setPlainText("\n".join(value_lines(row)) if row is not None else "")
        bar.setValue(at)

    def show_problems(self, problems: Sequence[str]) -> None:
        """All that was found to be wrong; the page's name counts them."""
        self.problems.setPlainText("\n".join(tr_text(problem) for problem in problems) or tr("Nothing was found to be wrong."))
        count = len(problems)
        self.pages.setTabText(self.pages.indexOf(self.problems), tr("⚠ Problems {count}", count=count) if count else tr("Problems"))

    def _style(self) -> None:
        # a frame in the banner's colour and its word in the corner: also a part of the screen must not look live
        for view in self.views:
            view.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
            theme.set_sheet(view, f"LiveView {{ border: 2px solid @PLAYBACK; background: {ON_PICTURE.INK}; }}")
            room = view.layout()
            assert room is not None
            room.setContentsMargins(2, 2, 2, 2)
        corner, loupe = _CornerMark(tr("PLAYBACK"), self.live), self.live.findChild(HeadLoupe)
        if isinstance(loupe, HeadLoupe):
            corner.stackUnder(loupe)
        for page, name in ((self.values, tr("Recorded values")), (self.problems, tr("Problems of the session"))):
            page.setReadOnly(True)
            page.setTabChangesFocus(True)
            page.setAccessibleName(name)
            theme.set_sheet(page, "QPlainTextEdit { background: @PANEL; color: @TEXT_DIM; border: none; font-size: 13px; }")

    def _header(self) -> QHBoxLayout:
        header = QHBoxLayout()
        header.setSpacing(14)
        header.addWidget(self.banner)
        header.addWidget(self.plate, 1)
        self._mode_note = card_note(tr("mode then"))
        header.addWidget(self._mode_note)
        header.addWidget(self.mode)
        return header

    def _pictures(self) -> QWidget:
        """The recorded picture, and beside it what a replay saw in it."""
        if self.other is None:
            return self.live
        self.other.setAccessibleName(tr("The same picture perceived again"))
        self.other.setAccessibleDescription(tr("Played back, not live"))
        both = QHBoxLayout()
        both.setSpacing(6)
        for view in self.views:
            view.setMinimumSize(300, 225)
            both.addWidget(view, 1)
        _CornerMark(tr("PERCEIVED AGAIN"), self.other)
        theme.set_sheet(self.compared, "color: @TEXT; font-size: 14px;")
        self.compared.setAccessibleName(tr("Recorded against perceived again"))
        pictures = column((self.compared, 0), spacing=4)
        pictures.insertLayout(0, both, 1)
        return holder(pictures)

    def show_other(self, tick: Tick, other: Scene | None) -> None:
        """What a replay saw in the same picture."""
        if self.other is None:
            return
        blank = Scene(tick.frame.index, tick.frame.captured_s, tick.scene.source_size, 1.0)
        self.other.show_frame(tick.frame, other or blank)
        line = compared_line(tick.scene, other) if other is not None else tr("this row was not")
        again = f'<span style="color:{palette.SKY}">\N{HORIZONTAL BAR} {tr("perceived again:")}</span>'
        self.compared.setText(f"{again} {escape(line)}")

    def _right_side(self) -> QVBoxLayout:
        for page, name in (
            (self.events, tr("Events")),
            (self.commands, tr("Commands")),
            (self.values, tr("Values")),
            (self.problems, tr("Problems")),
        ):
            self.pages.addTab(page, name)
        dials = self._dials()
        return column((Card("", self.badge), 0), (self.advice, 0), (dials, 3), (self.clearance, 0), (self.pages, 3))


class _CornerMark(QLabel):
    """A word in the lower left corner of its parent."""

    def __init__(self, text: str, parent: QWidget) -> None:
        super().__init__(text, parent)
        self._parent = parent
        theme.set_sheet(self, "background: @PLAYBACK; color: @INK; font-weight: 700; font-size: 12px; padding: 2px 8px;")
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.adjustSize()
        parent.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize:
            self.move(2, self._parent.height() - self.height() - 2)
        return False


def _framed(timeline: TimelineView) -> Card:
    """As high as it can be: a card's usual margins are for text."""
    card = Card("", timeline)
    room = card.layout()
    assert room is not None
    room.setContentsMargins(6, 3, 4, 3)
    return card
