"""The player: a recorded session with everything that was understood, frame by frame; always marked as not live."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from html import escape
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QFileDialog, QHBoxLayout, QLabel, QPlainTextEdit, QVBoxLayout, QWidget

from app.operator.recording import AfterSession
from app.player.controls import NoteField, PlayerBar, RecordedPlate, SessionEvents
from app.player.course import Course, JumpKind, PlayClock, chosen_at, neighbour, places_of, target_at, value_lines
from app.player.decoder import Decoded, FrameDecoder
from app.player.replayed import compared_line
from app.player.session_model import PlayedSession
from app.player.timeline import TimelineView
from app.ui import theme
from app.ui.actions import MenuEntry, action_of, add_help_menu, add_menu
from app.ui.description_form import DescriptionDialog
from app.ui.i18n import mark, tr, tr_text
from app.ui.opening import FRAMES, OfferedCommand, ask_path, open_file
from app.ui.snapshot import pictures_folder
from app.ui.theme import ON_PICTURE
from app.ui.window_base import WindowFrame
from app.widgets.basics import Card, OnResize, card_note, column, holder, line
from app.widgets.command_panel import Provenance, ProvenanceTable
from app.widgets.live_view import HeadLoupe, LiveView
from app.widgets.messages import Notice, NoticeKind, Offer, OfferButton, OfferStrip, Toast
from app.widgets.scene_overlay import Layer
from app.widgets.scene_panels import ScenePanels, add_scene_view_menu
from app.widgets.shortcut_page import KeyPage
from app.widgets.sim_banner import SimBanner
from core.config.models import Config
from core.config.rig_file import scaled
from core.evaluation.rehearsal import RehearsalResult, rehearsal_of
from core.files import name_of
from core.session.codec import RecordedRow
from core.session.exporters import PLUGINS
from core.session.manifest import Description, Event, EventKind
from core.session.reader import SessionReader
from core.types import Point, Scene, Tick
from hardware.rig import RigKind

_ZOOM = 1.5
"""Of the timeline, by key."""


def add_player_menus(window: PlayerWindow) -> None:
    """Fill the window's menu bar; keys that step repeat while they are held."""
    panels = window.panels
    window.add_file_menu(
        [
            MenuEntry(tr("&Open..."), window.ask_open, ("Ctrl+O",)),
            MenuEntry(tr("E&xport..."), window.ask_export, ("Ctrl+E",)),
            MenuEntry(tr("Selection as &video"), window.export_clip, ("E",)),
            MenuEntry(tr("&Snapshot"), window.save_snapshot, ("Ctrl+S",)),
            MenuEntry(tr("&Note"), window.begin_note, ("M",)),
            None,
            MenuEntry(tr("&Annotate this frame"), window.annotate_frame, ("A",)),
            MenuEntry(tr("Annotate &refused frames"), window.annotate_refused),
            *([MenuEntry(tr("Annotate the &differences"), window.annotate_differences)] if window.has_replay else []),
            MenuEntry(tr("Annotate frames evenly over the session"), window.annotate_session),
            MenuEntry(tr("Report of the algorithm"), window.evaluate, ("Ctrl+R",)),
            None,
            MenuEntry(tr("&Describe the session..."), window.describe, ("D",)),
            MenuEntry(tr("Session &library"), window.open_library, ("Ctrl+L",)),
        ],
        has_recent=True,
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
            MenuEntry(tr("Slower"), partial(window.change_speed, -1), ("[",)),
            MenuEntry(tr("Faster"), partial(window.change_speed, 1), ("]",)),
            MenuEntry(tr("Speed as &recorded"), partial(window.set_speed, 1.0), ("R",)),
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
            MenuEntry(tr("Jump to the next &kind of thing"), window.next_jump_kind, ("K",)),
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


_MOUSE = (
    mark("Mouse and focus"),
    (
        (mark("Click, drag"), mark("on the timeline: go there")),
        (mark("Shift+drag"), mark("on the timeline: select")),
        (mark("Wheel"), mark("on the timeline or picture: zoom")),
        (mark("Tab, Enter"), mark("go to a control, press it")),
        ("Esc", mark("close, cancel, unselect")),
    ),
)

_TEXT_EVERY_S = 0.1
_BANNER_WIDTH, _GAP = 330, 8


class PlayerPanels(ScenePanels):
    """Makes the widgets, lays them out, and shows one recorded row on all of them."""

    def __init__(self, config: Config, reader: SessionReader, press: Callable[[str], object], *, with_other: bool = False) -> None:
        manifest = reader.manifest
        known = manifest.known if manifest is not None else None
        pixels_per_mm = scaled(config, known).policy.pursuit.pixels_per_mm
        super().__init__(config.perception, pixels_per_mm, _TEXT_EVERY_S)
        self._scale = known.scale if known is not None else None
        self._provenance = Provenance()
        self._chosen: Event | None = None
        self._rehearsal: RehearsalResult | None = None
        self.banner = SimBanner(RigKind.PLAYBACK)
        self.banner.setFixedWidth(_BANNER_WIDTH)
        self.plate = RecordedPlate(manifest, reader.folder.name, reader.description)
        self.live.setAccessibleName(tr("Recorded picture"))
        self.live.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.other = LiveView(pixels_per_mm) if with_other else None
        self.compared = QLabel("", self)
        self.compared.setVisible(with_other)
        self.advice.is_recorded = True
        self.commands = ProvenanceTable()
        self.events = SessionEvents()
        self.values = _text_page(tr("Recorded values"))
        self.problems = _text_page(tr("Problems of the session"))
        self.timeline = TimelineView()
        self.bar = PlayerBar(press)
        self.note = NoteField(tr("Note at this time; Enter keeps it, Esc does not"), "SKY")
        self.note.hide()
        self._mode_note = card_note(tr("mode when it was recorded"))
        for view in (self.live, self.other):
            if view is not None:
                _mark_as_playback(view)
        corner, loupe = _CornerLabel(tr("PLAYBACK"), self.live), self.live.findChild(HeadLoupe)
        if isinstance(loupe, HeadLoupe):
            corner.stackUnder(loupe)
        timeline = Card("", self.timeline)
        room = timeline.layout()
        assert room is not None
        room.setContentsMargins(6, 3, 4, 3)  # the usual margins of a card are for text
        pictures, bar = self._lay_out_pictures(), self.overlay_bar
        left = column((pictures, 5), (bar, 0), (self.note, 0), (timeline, 1), (self.bar, 0), spacing=_GAP)
        self.help = KeyPage(self._lay_out(self._header(), holder(left), self._right_side()), last=(_MOUSE,))
        self.notice = Notice(self.live)
        self.toast = Toast(self.live)
        self.offers = OfferStrip(self.live)
        self.offers.lifted.connect(self.toast.lift)

    def _header(self) -> QHBoxLayout:
        return line(self.banner, (self.plate, 1), self._mode_note, self.mode, spacing=14)

    def _lay_out_pictures(self) -> QWidget:
        """The recorded picture, and beside it what a replay saw in it."""
        if self.other is None:
            return self.live
        self.other.setAccessibleName(tr("The same picture perceived again"))
        for view in (self.live, self.other):
            view.setMinimumSize(300, 225)
        _CornerLabel(tr("PERCEIVED AGAIN"), self.other)
        theme.set_sheet(self.compared, "color: @TEXT; font-size: 14px;")
        self.compared.setAccessibleName(tr("Recorded against perceived again"))
        both = line((self.live, 1), (self.other, 1), spacing=6)
        return holder(column((both, 1), self.compared, spacing=4))

    def _right_side(self) -> QVBoxLayout:
        self.pages.addTab(self.events, tr("Events"))
        self.pages.addTab(self.commands, tr("Commands"))
        self.pages.addTab(self.values, tr("Values"))
        self.pages.addTab(self.problems, tr("Problems"))
        return column((Card("", self.badge), 0), (self.advice, 0), (self._dials(), 3), (self.clearance, 0), (self.pages, 3))

    # ---- one row

    def show_row(self, row: RecordedRow, tick: Tick, target: Point | None, *, renew_text: bool) -> None:
        """Everything as it was recorded; `target` in source pixels."""
        scene = tick.scene
        renew_text = self._renews_text(scene, asked=renew_text)
        self.notice.hide()
        self.live.show_frame(tick.frame, scene, tick.advice)
        self.live.show_target(target)
        self.badge.show_scene(scene, tick.advice, renew_text=renew_text)
        self._show_dials(scene, tick.status, renew_text=renew_text)
        why_none = row.drive.blanked if row.drive is not None and row.drive.blanked else tr("none was recorded")
        self._show_advice(tick, why_none, renew_text=renew_text)
        self._show_drive(row)
        if renew_text:
            self._show_values(row)

    def show_rehearsal_at(self, events: Sequence[Event], time_s: float) -> None:
        """What the rehearsal of the target at this time found, beside the run."""
        chosen = chosen_at(events, time_s)
        if chosen is not self._chosen:
            self._chosen, self._rehearsal = chosen, rehearsal_of(chosen) if chosen is not None else None
            self.show_rehearsal(self._rehearsal)

    def show_other(self, tick: Tick, other: Scene | None) -> None:
        """What a replay saw in the same picture."""
        if self.other is None:
            return
        blank = Scene(tick.frame.index, tick.frame.captured_s, tick.scene.source_size, 1.0)
        self.other.show_frame(tick.frame, other or blank)
        line = compared_line(tick.scene, other) if other is not None else tr("this row was not")
        again = f'<span style="color:{theme.SKY}">\N{HORIZONTAL BAR} {tr("perceived again:")}</span>'
        self.compared.setText(f"{again} {escape(line)}")

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
        self.values.setPlainText("\n".join(value_lines(row, self._rehearsal)) if row is not None else "")
        bar.setValue(at)

    def show_problems(self, problems: Sequence[str]) -> None:
        """All that was found to be wrong; the page's name counts them."""
        self.problems.setPlainText("\n".join(tr_text(problem) for problem in problems) or tr("Nothing was found to be wrong."))
        count = len(problems)
        self.pages.setTabText(self.pages.indexOf(self.problems), tr("⚠ Problems {count}", count=count) if count else tr("Problems"))


def _text_page(name: str) -> QPlainTextEdit:
    page = QPlainTextEdit(readOnly=True, tabChangesFocus=True)
    page.setAccessibleName(name)
    theme.set_sheet(page, "QPlainTextEdit { background: @PANEL; color: @TEXT_DIM; border: none; font-size: 13px; }")
    return page


def _mark_as_playback(view: LiveView) -> None:
    """A frame in the banner's colour, so that no part of the screen looks live."""
    view.setAccessibleDescription(tr("Played back, not live"))
    view.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
    theme.set_sheet(view, f"LiveView {{ border: 2px solid @PLAYBACK; background: {ON_PICTURE.INK}; }}")
    room = view.layout()
    assert room is not None
    room.setContentsMargins(2, 2, 2, 2)


class _CornerLabel(QLabel):
    """A word in the lower left corner of its parent."""

    def __init__(self, text: str, parent: QWidget) -> None:
        super().__init__(text, parent)
        theme.set_sheet(self, "background: @PLAYBACK; color: @INK; font-weight: 700; font-size: 12px; padding: 2px 8px;")
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.adjustSize()
        OnResize(parent, self, lambda: self.move(2, parent.height() - self.height() - 2))


_EXPORTED = "exported"
"""Key of the offer after a file was written."""
_TURN_MS = 15
_STOP_WITHIN_MS = 10_000


class PlayerWindow(WindowFrame):
    """Plays an open session. All reading, decoding and writing is done by other threads; only the newest request counts.

    Parameters
    ----------
    reader : closed by the window.
    config : limits, scale and folders, best those of the recording.
    against : results of a replay, to be shown beside the recording.
    """

    def __init__(self, reader: SessionReader, config: Config, against: Path | None = None) -> None:
        super().__init__()
        self.setMinimumWidth(theme.MIN_WIDE_PX)
        self._reader, self._against = reader, against
        self.clock = PlayClock()
        self.jump_kind = JumpKind.STATE
        self.selection: tuple[float, float] | None = None
        """First and last second of the selection."""
        self.place = -1
        """The row that is on the screen; -1 before the first."""
        self.seek_ms = 0.0
        """From the last request of a row until it was on the screen."""
        self._requested, self._requested_s = -1, 0.0
        self._shown: Decoded | None = None
        self._note_s = 0.0
        self._refused_notes: deque[Event] = deque()
        self._exports: set[Path] = set()
        self._description = reader.description
        self._decoder = FrameDecoder(reader, self)
        self._pictures = pictures_folder(config.window.pictures_folder)
        self.session = PlayedSession(reader, self._pictures, self)
        self._turn = QTimer(self, interval=_TURN_MS, timerType=Qt.TimerType.PreciseTimer)
        self.panels = PlayerPanels(config, reader, lambda key: action_of(self, key).trigger(), with_other=against is not None)
        self.setCentralWidget(self.panels)
        self.after = AfterSession(self.panels.offers, self.others, parent=self)
        add_player_menus(self)
        self._connect()
        self.setWindowTitle(tr("LumenPilot \N{EM DASH} PLAYBACK of {name}", name=reader.folder.name))

    @property
    def course(self) -> Course:
        return self.session.course

    @property
    def has_replay(self) -> bool:
        """Whether results of a replay are shown beside the recording."""
        return self._against is not None

    def _connect(self) -> None:
        panels, bar, session = self.panels, self.panels.bar, self.session
        self._turn.timeout.connect(self._on_turn)
        self._decoder.decoded.connect(self._on_decoded)
        self._decoder.failed.connect(lambda line: panels.show_nothing(tr("Playing ended"), line, NoticeKind.FAULT))
        session.message.connect(self.show_message)
        self.after.said.connect(self.show_message)
        self.others.said.connect(self.show_message)
        session.changed.connect(self._show_course)
        session.polled.connect(self._on_polled)
        session.emptied.connect(lambda why: panels.show_nothing(tr("Nothing to play"), why, NoticeKind.WARNING))
        session.is_written.connect(panels.plate.show_written)
        session.problems_found.connect(panels.show_problems)
        session.compared.connect(self._on_compared)
        session.described.connect(self._on_described)
        session.note_refused.connect(self._on_note_refused)
        panels.timeline.sought.connect(self.seek)
        panels.timeline.selected.connect(lambda first, last: self.select((first, last)))
        panels.events.chosen.connect(self._go_to_event)
        panels.note.returnPressed.connect(self._save_note)
        bar.sought_ms.connect(lambda ms: self.seek(ms / 1000.0))
        bar.speed_chosen.connect(self.set_speed)
        bar.jump_kind_chosen.connect(self.set_jump_kind)
        bar.show_speed(1.0)
        bar.show_kind(self.jump_kind)
        if self._against is not None:
            panels.overlay_bar.toggle(Layer.LOUPE)  # two pictures leave no room for it

    def start(self) -> None:
        """Show the first row as soon as it is known."""
        super().start()
        self.panels.live.setFocus()
        self.panels.show_nothing(tr("Opening"), self._reader.folder.name)
        self.session.start(self._against)

    # ---- what is known of the session

    def _on_polled(self) -> None:
        if self._requested < 0 and len(self.course):
            self._request(0)

    def _show_course(self) -> None:
        self.panels.timeline.show_course(self.course, self.session.events)
        self.panels.bar.show_length(round(self.course.duration_s * 1000), len(self.course))
        self.panels.events.show_events(self.session.events, self.course.first_s)
        if self._shown is not None and self._shown.row is not None:
            self.panels.events.show_time(self._shown.row.captured_s)
        self._show_position()

    def _on_compared(self) -> None:
        self.set_jump_kind(JumpKind.REPLAY)
        self._decoder.replayed = self.session.replayed
        self._decoder.request_again()

    # ---- playing

    def toggle_play(self) -> None:
        """Play or pause; at the end play from the beginning."""
        if self.clock.is_playing:
            self.pause()
        elif len(self.course):
            if self.clock.position_s >= self.course.duration_s:
                self.clock.seek(0.0)
            self.clock.play()
            self._turn.start()
            self.panels.bar.show_playing(True)

    def pause(self) -> None:
        was_playing = self._turn.isActive()
        self.clock.pause()
        self._turn.stop()
        self.panels.bar.show_playing(False)
        if was_playing and self._shown is not None:
            self._show(self._shown)  # while it plays, texts are renewed only now and then

    def _on_turn(self) -> None:
        goes_on = self.clock.advance(self.course, self.course.duration_s)
        if self.clock.skipped_s > 0.0:
            self.show_message(tr("Passed over a gap: {seconds:.1f} s without frames", seconds=self.clock.skipped_s))
        self._request(self.course.place_at(self.clock.position_s))
        self._show_position()
        if not goes_on:
            self.pause()

    def seek(self, time_s: float) -> None:
        if len(self.course):
            self.clock.seek(min(time_s, self.course.duration_s))
            self._request(self.course.place_at(self.clock.position_s))
            self._show_position()

    def go(self, place: int) -> None:
        """To a row; playing goes on from there."""
        if len(self.course):
            place = max(0, min(len(self.course) - 1, place))
            self.clock.seek(float(self.course.times_s[place]))
            self._request(place)
            self._show_position()

    def step(self, step: int) -> None:
        self.pause()
        self.go(max(0, self._requested) + step)

    def skip(self, seconds: float) -> None:
        self.seek(max(0.0, self.clock.position_s + seconds))

    def jump(self, step: int) -> None:
        """To the next (1) or previous (-1) of the chosen kind, paused."""
        self.pause()
        found = neighbour(places_of(self.jump_kind, self.course, self.session.events), max(0, self._requested), step)
        if found is not None:
            self.go(found)
            return
        kind = tr(self.jump_kind.value).lower()
        self.show_message(tr("No {kind} after this frame", kind=kind) if step > 0 else tr("No {kind} before this frame", kind=kind))

    def set_jump_kind(self, kind: JumpKind) -> None:
        self.jump_kind = kind
        self.panels.bar.show_kind(kind)

    def next_jump_kind(self) -> None:
        kinds = list(JumpKind)
        self.set_jump_kind(kinds[(kinds.index(self.jump_kind) + 1) % len(kinds)])
        self.show_message(tr("N and P: {kind}", kind=tr(self.jump_kind.value).lower()))

    def set_speed(self, speed: float) -> None:
        self.clock.speed = speed
        self.panels.bar.show_speed(speed)

    def change_speed(self, step: int) -> None:
        self.set_speed(self.clock.change_speed(step))

    def _go_to_event(self, event: Event) -> None:
        self.pause()
        if len(self.course):
            time_s = event.time_s - self.course.first_s
            self.go(int(self.course.times_s.searchsorted(time_s - 1e-6)))

    # ---- rows on the screen

    def _request(self, place: int) -> None:
        if place == self._requested:
            return
        apart = place - self._requested
        # what comes next: the same step again, or after a jump the frames that follow
        step = apart if self.clock.is_playing or abs(apart) == 1 else 1
        self._requested, self._requested_s = place, time.monotonic()
        self._decoder.request(place, step)

    def _on_decoded(self, found: Decoded) -> None:
        if self._is_shut:
            return
        self._shown, self.place = found, found.place
        self._show(found)
        if found.place == self._requested:
            self.seek_ms = 1000.0 * (time.monotonic() - self._requested_s)

    def _show(self, found: Decoded) -> None:
        if found.row is not None and found.tick is not None:
            target = target_at(self.session.events, found.tick.scene, found.row.captured_s)
            self.panels.show_rehearsal_at(self.session.events, found.row.captured_s)
            self.panels.show_row(found.row, found.tick, target, renew_text=not self.clock.is_playing)
            self.panels.show_other(found.tick, found.other)
        else:
            self.panels.show_lost(found.row, found.place)
        if found.row is not None:
            self.panels.events.show_time(found.row.captured_s)

    def _show_position(self) -> None:
        time_s = self.clock.position_s
        self.panels.timeline.show_time(time_s, follow=self.clock.is_playing)
        self.panels.bar.show_position(round(time_s * 1000), max(0, self._requested))

    # ---- selection, clips, snapshots

    def select(self, selection: tuple[float, float] | None) -> None:
        """First and last second of the clip; None: the whole session."""
        self.selection = selection
        self.panels.timeline.show_selection(selection)
        self.panels.bar.show_selection(selection[1] - selection[0] if selection is not None else None)

    def select_from_here(self) -> None:
        here = self.clock.position_s
        last = self.selection[1] if self.selection is not None and self.selection[1] > here else self.course.duration_s
        self.select((here, last))

    def select_to_here(self) -> None:
        here = self.clock.position_s
        self.select((self.selection[0] if self.selection is not None and self.selection[0] < here else 0.0, here))

    def export_clip(self) -> None:
        """The selection, or the whole session, as a video with overlays in the pictures' folder; playing goes on."""
        if not len(self.course):
            self.show_message(tr("No clip: there are no frames"), is_fault=True)
            return
        name, rows = name_of(self._reader.folder), list[str]()
        if self.selection is not None:
            first, last = (self.course.rows[self.course.place_at(time_s)] for time_s in self.selection)
            name += "_{}-{}ms".format(*(round(time_s * 1000) for time_s in self.selection))
            rows = ["--rows", f"{first}-{last}"]
        paths = (self._pictures / f"{name}{'' if k == 1 else f'_{k}'}.mp4" for k in count(1))
        self._export(next(path for path in paths if not path.exists()), *rows)

    def save_snapshot(self) -> None:
        """The picture that is shown, plain, with overlays, and its values."""
        tick = self._shown.tick if self._shown is not None else None
        if tick is None:
            self.show_message(tr("No snapshot: there is no picture"), is_fault=True)
        else:
            self.session.save_snapshot(tick)

    def ask_open(self) -> None:
        """Another session, or a folder of pictures, in a window of its own."""
        folder = self._reader.folder.parent
        ask_path(self, tr("A session, or a folder of pictures"), folder, self.open_path, QFileDialog.FileMode.Directory)

    def ask_export(self) -> None:
        """The whole session in another form, by the ending of the file's name."""
        folder, endings = self._reader.folder.absolute(), " ".join(f"*.{ending}" for ending in PLUGINS.names)
        start, mode = folder.with_name(f"{folder.name}.mp4"), QFileDialog.FileMode.AnyFile
        ask_path(self, tr("Export the session as"), start, self._export, mode, [endings])

    def _export(self, out: Path, *options: str) -> None:
        if out in self._exports:
            self.show_message(tr("{name} is being written already", name=out.name), is_fault=False)
            return
        self._exports.add(out)
        self.panels.offers.withdraw(_EXPORTED)  # which would hide how far this one is
        words, session = tr("Exporting {name}", name=out.name), str(self._reader.folder)
        arguments = ("session", "export", session, "--out", str(out), *options, "--progress-json", "--json")
        command = OfferedCommand(self, self.panels.offers, words, *arguments)
        command.ended.connect(partial(self._on_exported, out))
        command.start()

    def _on_exported(self, out: Path, told: dict[str, Any] | None, line: str, is_fault: bool) -> None:
        self._exports.remove(out)
        if told is None:
            self.show_message(tr_text(line), is_fault)
            return
        folder = OfferButton(tr("Open its folder"), partial(open_file, out.parent), str(out.parent))
        play = OfferButton(tr("Open it"), partial(open_file, out))
        text = tr("Exported: {path}", path=out)
        self.panels.offers.offer(Offer(_EXPORTED, text, "\n".join(map(tr_text, told["problems"])), (folder, play)))

    # ---- annotation, in a window of its own

    def annotate_frame(self) -> None:
        self.pause()
        if len(self.course):
            self._annotate(np.array([max(0, self._requested)]), "")

    def annotate_refused(self) -> None:
        """Frames without a pose, of the selection or of the whole session."""
        self._annotate(self._selected(np.flatnonzero(self.course.states < 0)), tr("No frame without a pose here"))

    def annotate_differences(self) -> None:
        """Frames at which the replay begins to differ, of the selection or of the whole session."""
        differs = self.course.differs
        self._annotate(self._selected(differs) if differs is not None else np.zeros(0, np.int64), tr("No difference here"))

    def annotate_session(self) -> None:
        self.others.annotate(self._reader.folder)

    def evaluate(self) -> None:
        """The algorithm against what was annotated, as a report; without that the annotator is offered."""
        self.after.evaluate(self._reader.folder)

    def _selected(self, places: NDArray[np.int64]) -> NDArray[np.int64]:
        if self.selection is None:
            return places
        times_s = self.course.times_s[places]
        return places[(times_s >= self.selection[0]) & (times_s <= self.selection[1])]

    def _annotate(self, places: NDArray[np.int64], why_none: str) -> None:
        """Open the annotator on these places of the course, on so many evenly among them where there are more."""
        if not len(places):
            self.show_message(why_none)
            return
        if len(places) > FRAMES:
            places = places[np.unique(np.round(np.linspace(0, len(places) - 1, FRAMES)).astype(int))]
        self.others.annotate(self._reader.folder, ",".join(str(row) for row in self.course.rows[places].tolist()))

    # ---- what it is about

    def open_library(self) -> None:
        """All sessions of its folder."""
        self.others.open_library(self._reader.folder.absolute().parent)

    def describe(self) -> None:
        """Ask what the session is about."""
        self.pause()
        dialog = DescriptionDialog(self, self._reader.folder.name, self._description)
        dialog.given.connect(self.session.describe)
        dialog.show()

    def _on_described(self, description: Description) -> None:
        self._description = description
        self.panels.plate.show_description(description)

    # ---- notes

    def begin_note(self) -> None:
        """Write a note at this time, or go on with one that is being written."""
        self.pause()
        if not self.panels.note.isVisible():
            self._note_s = self.clock.position_s
            self.panels.note.clear()
            self.panels.note.show()
        self.panels.note.setFocus()

    def _end_note(self) -> None:
        self.panels.note.hide()
        self.panels.live.setFocus()
        QTimer.singleShot(0, self._offer_refused_note)

    def _save_note(self) -> None:
        text = self.panels.note.kept_text
        self._end_note()
        if text and len(self.course):
            self.session.add_note(Event(self.course.first_s + self._note_s, EventKind.NOTE, text))

    def _on_note_refused(self, event: Event) -> None:
        """A note that could not be written is offered again at its time, after what is being written meanwhile."""
        self._refused_notes.append(event)
        self._offer_refused_note()

    def _offer_refused_note(self) -> None:
        if self._refused_notes and not self.panels.note.isVisible() and not self._is_shut:
            event = self._refused_notes.popleft()
            self.begin_note()
            self._note_s = event.time_s - self.course.first_s
            self.seek(self._note_s)
            self.panels.note.setText(event.text)

    # ---- the window

    def show_message(self, message: str, is_fault: bool = False) -> None:
        self.panels.toast.show_message(message, is_fault=is_fault)

    def go_to_time(self) -> None:
        """Type a time, as the clock shows it or in seconds."""
        self.panels.bar.position.setFocus()
        self.panels.bar.position.selectAll()

    def show_events(self) -> None:
        self.panels.pages.setCurrentWidget(self.panels.events)
        self.panels.events.setFocus()

    def _on_escape(self) -> None:
        panels = self.panels
        if panels.help.isVisible():
            panels.help.hide()
        elif panels.note.isVisible():
            self._end_note()
        elif self.focusWidget() is not panels.live:
            panels.bar.discard_typed_time()
            panels.live.setFocus()
        elif self.selection is not None:
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
        """A note that is being written is saved."""
        if self.panels.note.isVisible():
            self._save_note()
        return super()._may_close()

    def _let_go(self) -> None:
        self.after.close()
        for command in self.findChildren(OfferedCommand):
            command.leave()  # an export ends by itself
        self._turn.stop()
        self.session.poll_timer.stop()
        self.panels.notice.hide()

    def _finish(self) -> Sequence[str]:
        """End the threads; notes and snapshots are finished."""
        self._decoder.worker.stop(finish=False)
        has_saved = self.session.shut_down()
        if not (self._decoder.worker.wait(_STOP_WITHIN_MS) and has_saved):
            return ["the disk did not answer in time; leaving without it"]
        self._reader.close()
        return ()
