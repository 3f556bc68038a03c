"""The player: a recorded session with everything that was understood, frame by frame; never to be mistaken for a live picture.

The menus of the player: everything that it can do, with its key.

All that is to be seen of the player below its menus: the widgets of the operator window that fit, and the timeline.

The player's keys.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path

from PySide6.QtCore import QEvent, QObject, Qt, QTimer, Slot
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QMainWindow, QPlainTextEdit, QVBoxLayout, QWidget

from app.player.controls import NoteField, PlayerBar, RecordedPlate, SessionEvents
from app.player.decoder import Decoded, DecodeThread, PlayerSessionLoader
from app.player.session_model import (
    Course,
    JumpKind,
    KnownSession,
    PlayClock,
    Replayed,
    compared_line,
    neighbour,
    places_of,
    target_at,
    value_lines,
)
from app.player.timeline import TimelineView
from app.ui import theme
from app.ui.actions import KeyTable, MenuEntry, add_help_menu, add_menu, menu_tables, shown
from app.ui.i18n import mark, tr, tr_text
from app.ui.snapshot import pictures_folder
from app.ui.theme import ON_PICTURE
from app.ui.window_base import WindowFrame
from app.widgets.basics import Card, card_note, column, holder
from app.widgets.command_panel import Provenance, ProvenanceTable
from app.widgets.live_view import HeadLoupe, LiveView
from app.widgets.messages import Notice, NoticeKind, Toast
from app.widgets.scene_overlay import Layer
from app.widgets.scene_panels import ScenePanels, add_scene_view_menu
from app.widgets.shortcut_page import KeyPage
from app.widgets.sim_banner import SimBanner
from core.config.models import Config
from core.config.rig_file import scaled
from core.session.codec import RecordedRow
from core.session.manifest import Event, EventKind, Manifest
from core.session.reader import SessionReader
from core.types import Point, Scene, Tick
from hardware.rig import RigKind

_ZOOM = 1.5


def add_player_menus(window: PlayerWindow) -> None:
    """Fill the window's menu bar. Keys that step repeat while they are held."""
    panels = window.panels
    window.add_file_menu(
        [
            MenuEntry(tr("&Snapshot"), window.take_snapshot, ("S", "Ctrl+S")),
            None,
            MenuEntry(tr("Selection as &video"), window.export_clip, ("E",)),
            MenuEntry(tr("&Note"), window.begin_note, ("M",)),
        ]
    )
    view = add_scene_view_menu(
        window,
        panels,
        [
            MenuEntry(tr("Zoom the timeline &in"), partial(panels.timeline.zoom, _ZOOM), ("+", "=")),
            MenuEntry(tr("Zoom the timeline &out"), partial(panels.timeline.zoom, 1 / _ZOOM), ("-",)),
            MenuEntry(tr("The whole &session"), panels.timeline.fit, ("Ctrl+0",)),
        ],
    )
    play = add_menu(
        window,
        tr("&Play"),
        [
            MenuEntry(tr("&Play or pause"), window.toggle_play, ("Space",)),
            None,
            MenuEntry(tr("One frame back"), partial(window.step, -1), ("Left",)),
            MenuEntry(tr("One frame on"), partial(window.step, 1), ("Right",)),
            MenuEntry(tr("One second back"), partial(window.skip, -1.0), ("Shift+Left",)),
            MenuEntry(tr("One second on"), partial(window.skip, 1.0), ("Shift+Right",)),
            MenuEntry(tr("Ten seconds back"), partial(window.skip, -10.0), ("Ctrl+Left",)),
            MenuEntry(tr("Ten seconds on"), partial(window.skip, 10.0), ("Ctrl+Right",)),
            MenuEntry(tr("First frame"), partial(window.seek, 0.0), ("Home",)),
            MenuEntry(tr("Last frame"), partial(window.seek, float("inf")), ("End",)),
            MenuEntry(tr("Go to a &time"), window.go_to_time, ("T",)),
            None,
            MenuEntry(tr("Slower"), partial(window.faster, -1), ("[",)),
            MenuEntry(tr("Faster"), partial(window.faster, 1), ("]",)),
            MenuEntry(tr("As &recorded"), partial(window.set_speed, 1.0), ("R",)),
        ],
    )
    kinds = [
        MenuEntry(tr("Jump to: {kind}", kind=tr(kind.value).lower()), partial(window.set_jump_kind, kind)) for kind in JumpKind
    ]
    go = add_menu(
        window,
        tr("&Go"),
        [
            MenuEntry(tr("&Next"), partial(window.jump, 1), ("N",)),
            MenuEntry(tr("&Previous"), partial(window.jump, -1), ("P",)),
            MenuEntry(tr("Another &kind"), window.next_jump_kind, ("K",)),
            None,
            *kinds,
            None,
            MenuEntry(tr("&Events"), window.show_events, ("F6",)),
            None,
            MenuEntry(tr("Selection &from here"), window.select_from_here, ("I",)),
            MenuEntry(tr("Selection &to here"), window.select_to_here, ("O",)),
            MenuEntry(tr("No selection"), partial(window.select, None), hint="Esc"),
        ],
    )
    for action in (*play[1:7], *go[:2], *view[-6:-4]):
        action.setAutoRepeat(True)
    add_help_menu(window, panels.help.toggle)


_ELSE = (
    mark("Mouse and focus"),
    (
        (mark("Click, drag"), mark("on the timeline: go there")),
        (mark("Shift+drag"), mark("on the timeline: select")),
        (mark("Wheel"), mark("on the timeline or picture: zoom")),
        (mark("Tab, Enter"), mark("go to a control, press it")),
        ("Esc", mark("close, cancel, unselect")),
    ),
)


def player_keys(window: QMainWindow) -> Sequence[KeyTable]:
    """The keys of the menus, and the mouse."""
    return (*menu_tables(window), shown(_ELSE))


def player_help(parent: QWidget) -> KeyPage:
    """The page of the player, over `parent`."""
    return KeyPage(parent, player_keys)


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
        again = f'<span style="color:{theme.SKY}">\N{HORIZONTAL BAR} {tr("perceived again:")}</span>'
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


_TURN_MS = 15
_STOP_WITHIN_MS = 10_000


class PlayerWindow(WindowFrame):
    """Plays an open session. All reading, decoding and writing is done by other threads; the newest wish wins.

    Parameters
    ----------
    reader : closed by the window.
    config : limits, scale and folders, best those of the recording.
    against : results of a replay, to be shown beside the recording.
    """

    def __init__(self, reader: SessionReader, config: Config, against: Path | None = None) -> None:
        super().__init__()
        self.setMinimumWidth(theme.MIN_WIDE_PX)
        self._reader = reader
        self._clock = PlayClock()
        self._jump_kind = JumpKind.STATE
        self._selection: tuple[float, float] | None = None
        self._place = -1
        self._asked = -1
        self._asked_s = 0.0
        self._shown: Decoded | None = None
        self.seek_ms = 0.0
        self._note_s = 0.0
        self._refused: deque[Event] = deque()
        self._decode = DecodeThread(reader, self)
        self._keeper = PlayerSessionLoader(reader, pictures_folder(config.window.pictures_folder), self)
        self._known = KnownSession(reader, self)
        self._turn = QTimer(self)
        self._turn.setInterval(_TURN_MS)
        self._turn.setTimerType(Qt.TimerType.PreciseTimer)
        self._against = against
        self.panels = PlayerPanels(config, reader.manifest, reader.folder.name, with_other=against is not None)
        self.setCentralWidget(self.panels)
        add_player_menus(self)
        self._wire()
        self.setWindowTitle(tr("LumenPilot \N{EM DASH} PLAYBACK of {name}", name=reader.folder.name))

    # ---- what can be asked

    @property
    def place(self) -> int:
        """The row that is on the screen; -1 before the first."""
        return self._place

    @property
    def rows(self) -> int:
        """Rows known so far."""
        return len(self._course)

    @property
    def time_s(self) -> float:
        """Where playing is, from the first row."""
        return self._clock.position_s

    @property
    def is_playing(self) -> bool:
        return self._clock.is_playing

    @property
    def speed(self) -> float:
        return self._clock.speed

    @property
    def jump_kind(self) -> JumpKind:
        return self._jump_kind

    @property
    def selection(self) -> tuple[float, float] | None:
        """First and last second of the selection."""
        return self._selection

    @property
    def events(self) -> tuple[Event, ...]:
        return self._known.events

    @property
    def _course(self) -> Course:
        return self._known.course

    # ---- composition

    def _wire(self) -> None:
        panels, bar = self.panels, self.panels.bar
        self._decode.decoded.connect(self._on_decoded)
        self._decode.failed.connect(lambda line: panels.show_nothing(tr("Playing ended"), line, NoticeKind.FAULT))
        self._keeper.said.connect(self.say)
        self._keeper.events_read.connect(self._known.take_events)
        self._keeper.events_read.connect(lambda _events, is_written: panels.plate.show_written(is_written))
        self._keeper.noted.connect(self._known.take_note)
        self._keeper.note_refused.connect(self._write_again)
        self._keeper.replayed_read.connect(self._on_replayed)
        self._keeper.progressed.connect(bar.show_progress)
        known = self._known
        known.said.connect(self.say)
        known.changed.connect(self._show_course)
        known.emptied.connect(lambda why: panels.show_nothing(tr("Nothing to play"), why, NoticeKind.WARNING))
        known.looked.connect(self._on_looked)
        known.problems_found.connect(panels.show_problems)
        self._turn.timeout.connect(self._on_turn)
        panels.timeline.sought.connect(self.seek)
        panels.timeline.selected.connect(lambda first, last: self.select((first, last)))
        panels.events.chosen.connect(self._go_to_event)
        panels.note.returnPressed.connect(self._keep_note)
        bar.play_asked.connect(self.toggle_play)
        bar.step_asked.connect(self.step)
        bar.jump_asked.connect(self.jump)
        bar.sought_ms.connect(lambda ms: self.seek(ms / 1000.0))
        bar.speed_chosen.connect(self.set_speed)
        bar.jump_kind_chosen.connect(self.set_jump_kind)
        bar.clip_asked.connect(self.export_clip)
        bar.cancel_asked.connect(self._keeper.cancel_clip)
        bar.note_asked.connect(self.begin_note)
        bar.snapshot_asked.connect(self.take_snapshot)
        bar.show_speed(1.0)
        bar.show_kind(self._jump_kind)
        if self._against is not None:
            panels.overlay_bar.toggle(Layer.LOUPE)  # two pictures leave no room for it

    def start(self) -> None:
        """Show the first row as soon as it is known."""
        super().start()
        self.panels.live.setFocus()
        self.panels.show_nothing(tr("Opening"), self._reader.folder.name)
        self._keeper.read_events()
        if self._against is not None:
            self._keeper.read_replayed(self._against)
        self._known.start()

    # ---- what is known of the session

    @Slot()
    def _on_looked(self) -> None:
        if self._asked < 0 and len(self._course):
            self._ask(0)

    @Slot()
    def _show_course(self) -> None:
        self.panels.timeline.show_course(self._course, self.events)
        self.panels.bar.show_length(round(self._course.duration_s * 1000), len(self._course))
        self.panels.events.show_events(self.events, self._course.first_s)
        if self._shown is not None and self._shown.row is not None:
            self.panels.events.show_time(self._shown.row.captured_s)
        self._show_position()

    @Slot(object)
    def _on_replayed(self, replayed: Replayed) -> None:
        self._known.compare_with(replayed)
        self.set_jump_kind(JumpKind.REPLAY)
        self._show_course()
        self._decode.replayed = replayed.scene
        self._decode.ask_again()

    # ---- playing

    @Slot()
    def toggle_play(self) -> None:
        """Play or pause; at the end play from the beginning."""
        if self._clock.is_playing:
            self.pause()
        elif len(self._course):
            if self._clock.position_s >= self._course.duration_s:
                self._clock.seek(0.0)
            self._clock.play()
            self._turn.start()
            self.panels.bar.show_playing(True)

    def pause(self) -> None:
        """Stop at the frame that is shown."""
        was_playing = self._turn.isActive()
        self._clock.pause()
        self._turn.stop()
        self.panels.bar.show_playing(False)
        if was_playing and self._shown is not None:
            self._show(self._shown)  # while it plays, texts are renewed now and then only

    @Slot()
    def _on_turn(self) -> None:
        goes_on = self._clock.turn(self._course, self._course.duration_s)
        if self._clock.passed_s > 0.0:
            self.say(tr("Passed over a gap: {seconds:.1f} s without frames", seconds=self._clock.passed_s))
        self._ask(self._course.place_at(self._clock.position_s))
        self._show_position()
        if not goes_on:
            self.pause()

    @Slot(float)
    def seek(self, time_s: float) -> None:
        """To a time from the first row."""
        if len(self._course):
            self._clock.seek(min(time_s, self._course.duration_s))
            self._ask(self._course.place_at(self._clock.position_s))
            self._show_position()

    def go(self, place: int) -> None:
        """To a row; playing goes on from there."""
        if len(self._course):
            place = max(0, min(len(self._course) - 1, place))
            self._clock.seek(float(self._course.times_s[place]))
            self._ask(place)
            self._show_position()

    @Slot(int)
    def step(self, step: int) -> None:
        """So many frames on or back, paused."""
        self.pause()
        self.go(max(0, self._asked) + step)

    def skip(self, seconds: float) -> None:
        """So many seconds on or back."""
        self.seek(max(0.0, self._clock.position_s + seconds))

    @Slot(int)
    def jump(self, step: int) -> None:
        """To the next (1) or previous (-1) of the chosen kind, paused."""
        self.pause()
        found = neighbour(places_of(self._jump_kind, self._course, self.events), max(0, self._asked), step)
        if found is None:
            kind = tr(self._jump_kind.value).lower()
            self.say(tr("No {kind} after this frame", kind=kind) if step > 0 else tr("No {kind} before this frame", kind=kind))
        else:
            self.go(found)

    @Slot(object)
    def set_jump_kind(self, kind: JumpKind) -> None:
        self._jump_kind = kind
        self.panels.bar.show_kind(kind)

    def next_jump_kind(self) -> None:
        kinds = list(JumpKind)
        self.set_jump_kind(kinds[(kinds.index(self._jump_kind) + 1) % len(kinds)])
        self.say(tr("N and P: {kind}", kind=tr(self._jump_kind.value).lower()))

    @Slot(float)
    def set_speed(self, speed: float) -> None:
        self._clock.speed = speed
        self.panels.bar.show_speed(speed)

    def faster(self, step: int) -> None:
        """One speed up or down."""
        self.set_speed(self._clock.faster(step))

    def _go_to_event(self, event: Event) -> None:
        self.pause()
        if len(self._course):
            time_s = event.time_s - self._course.first_s
            self.go(int(self._course.times_s.searchsorted(time_s - 1e-6)))

    # ---- rows on the screen

    def _ask(self, place: int) -> None:
        if place == self._asked:
            return
        apart = place - self._asked
        # what comes next: the same step again, or after a jump the frames that follow
        step = apart if self._clock.is_playing or abs(apart) == 1 else 1
        self._asked, self._asked_s = place, time.monotonic()
        self._decode.ask(place, step)

    @Slot()
    def _on_decoded(self) -> None:
        found = self._decode.take()
        if found is None or self._is_shut:
            return
        self._shown, self._place = found, found.place
        self._show(found)
        if found.place == self._asked:
            self.seek_ms = 1000.0 * (time.monotonic() - self._asked_s)

    def _show(self, found: Decoded) -> None:
        if found.row is not None and found.tick is not None:
            target = target_at(self.events, found.tick.scene, found.row.captured_s)
            self.panels.show_row(found.row, found.tick, target, renew_text=not self._clock.is_playing)
            self.panels.show_other(found.tick, found.other)
        else:
            self.panels.show_lost(found.row, found.place)
        if found.row is not None:
            self.panels.events.show_time(found.row.captured_s)

    def _show_position(self) -> None:
        time_s = self._clock.position_s
        self.panels.timeline.show_time(time_s, follow=self._clock.is_playing)
        self.panels.bar.show_position(round(time_s * 1000), max(0, self._asked))

    # ---- keeping

    def select(self, selection: tuple[float, float] | None) -> None:
        """First and last second of the clip; None: the whole session."""
        self._selection = selection
        self.panels.timeline.show_selection(selection)
        self.panels.bar.show_selection(selection[1] - selection[0] if selection is not None else None)

    def select_from_here(self) -> None:
        """The selection begins here."""
        here = self._clock.position_s
        last = self._selection[1] if self._selection is not None and self._selection[1] > here else self._course.duration_s
        self.select((here, last))

    def select_to_here(self) -> None:
        """The selection ends here."""
        here = self._clock.position_s
        self.select((self._selection[0] if self._selection is not None and self._selection[0] < here else 0.0, here))

    @Slot()
    def export_clip(self) -> None:
        """The selection as a video with overlays, into the pictures' folder; playing goes on."""
        if not len(self._course):
            self.say(tr("No clip: there are no frames"), is_fault=True)
            return
        if self._selection is None and not self._known.is_whole:
            self.say(tr("No clip yet: the session is still being read, and would be cut short"), is_fault=True)
            return
        first_s, last_s = self._selection or (0.0, self._course.duration_s)
        self._keeper.write_clip((self._course.place_at(first_s), self._course.place_at(last_s)), (first_s, last_s))

    @Slot()
    def take_snapshot(self) -> None:
        """The picture that is shown, plain, with overlays, and its values."""
        tick = self._shown.tick if self._shown is not None else None
        if tick is None:
            self.say(tr("No snapshot: there is no picture"), is_fault=True)
        else:
            self._keeper.take_snapshot(tick)

    @Slot()
    def begin_note(self) -> None:
        """Write a note at this time; one that is being written is gone on with."""
        self.pause()
        if self.panels.note.isVisible():
            self.panels.note.setFocus()
            return
        self._note_s = self._clock.position_s
        self.panels.note.clear()
        self.panels.note.show()
        self.panels.note.setFocus()

    def _end_note(self) -> None:
        self.panels.note.hide()
        self.panels.live.setFocus()
        QTimer.singleShot(0, self._offer_refused)

    def _keep_note(self) -> None:
        text = self.panels.note.kept_text
        self._end_note()
        if text and len(self._course):
            event = Event(self._course.first_s + self._note_s, EventKind.NOTE, text)
            self._keeper.add_note(event)

    @Slot(object)
    def _write_again(self, event: Event) -> None:
        """A note that the disk did not take, at its time; what is being written meanwhile comes first."""
        self._refused.append(event)
        self._offer_refused()

    def _offer_refused(self) -> None:
        if self._refused and not self.panels.note.isVisible() and not self._is_shut:
            event = self._refused.popleft()
            self.begin_note()
            self._note_s = event.time_s - self._course.first_s
            self.seek(self._note_s)
            self.panels.note.setText(event.text)

    # ---- the window

    @Slot(str, bool)
    def say(self, message: str, is_fault: bool = False) -> None:
        """A line for the person at the screen."""
        self.panels.toast.show_message(message, is_fault=is_fault)

    def go_to_time(self) -> None:
        """Type a time, as the clock shows it or in seconds."""
        self.panels.bar.position.setFocus()
        self.panels.bar.position.selectAll()

    def show_events(self) -> None:
        """The list of events, by keyboard."""
        self.panels.pages.setCurrentWidget(self.panels.events)
        self.panels.events.setFocus()

    @Slot()
    def _on_escape(self) -> None:
        panels = self.panels
        if panels.help.isVisible():
            panels.help.hide()
        elif panels.note.isVisible():
            self._end_note()
        elif self.focusWidget() is not panels.live:
            panels.bar.abandon()
            panels.live.setFocus()
        elif self._keeper.has_clip:
            self._keeper.cancel_clip()
        elif self._selection is not None:
            self.select(None)
        else:
            super()._on_escape()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Enter takes the time that was typed."""
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and self.focusWidget() is self.panels.bar.position:
            self.panels.live.setFocus()
            return
        super().keyPressEvent(event)

    def _may_close(self) -> bool:
        """A note that is being written is kept."""
        if self.panels.note.isVisible():
            self._keep_note()
        return super()._may_close()

    def _let_go(self) -> None:
        self._turn.stop()
        self._known.stop()
        self.panels.notice.clear()

    def _finish(self) -> Sequence[str]:
        """End the threads; notes and snapshots are finished, a clip is given up."""
        self._decode.stop()
        has_saved = self._keeper.shut_down()
        if not (self._decode.wait(_STOP_WITHIN_MS) and has_saved):
            return ["the disk did not answer in time; leaving without it"]
        self._reader.close()
        return ()
