"""The player: a recorded session with everything that was understood, frame by frame; never to be mistaken for a live picture."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import Qt, QTimer, Slot
from PySide6.QtGui import QKeyEvent

from app import theme
from app.decode_thread import Decoded, DecodeThread
from app.known_session import KnownSession
from app.language import tr
from app.play_clock import PlayClock
from app.player_keeper import PlayerKeeper
from app.player_menus import add_player_menus
from app.player_panels import PlayerPanels
from app.replayed import Replayed
from app.session_marks import Course, JumpKind, neighbour, places_of, target_at
from app.snapshot import pictures_folder
from app.widgets.notice import NoticeKind
from app.widgets.overlays import Layer
from app.window_frame import WindowFrame
from core.config import Config
from core.session.events import Event, EventKind
from core.session.reader import SessionReader

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
        self._keeper = PlayerKeeper(reader, pictures_folder(config.window.pictures_folder), self)
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
