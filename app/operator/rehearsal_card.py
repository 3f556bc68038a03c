"""The card of a rehearsal over the picture: a button to begin, how far it is, or what was found."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtWidgets import QFrame, QLabel, QProgressBar, QSizePolicy, QWidget

from app.ui import theme
from app.ui.i18n import tr
from app.widgets.basics import OnResize, column, line, text_button
from app.widgets.live_view import LiveView
from app.widgets.scene_overlay import HEAT
from core.evaluation.rehearsal import FEWEST_RUNS, RehearsalResult

KEY = "T"
_INK = theme.ON_PICTURE
_LABEL = "color: {}; font-size: {}px; font-weight: {}; border: none; background: none;"
_BUTTON = (
    f"QPushButton {{ padding: 0 10px; min-height: 24px; font-size: 13px; background: {_INK.RAISED}; color: {_INK.TEXT}; "
    f"border: 1px solid {_INK.TEXT_FAINT}; border-radius: 5px; }} "
    f"QPushButton:hover, QPushButton:focus {{ border-color: {_INK.TEXT}; }}"
)
_WIDTH_PX = 268


class RehearsalCard(QFrame):
    """Lies in the corner of the picture where it hides least, and keeps clear of `covers`. It decides nothing.

    ``pressed``: the button, whose word says what it does; ``closed``: the cross beside a result.
    """

    pressed = Signal()
    closed = Signal()

    def __init__(self, live: LiveView, covers: tuple[QWidget, ...] = ()) -> None:
        super().__init__(live)
        self._live, self._covers = live, covers
        self._title, self._detail, self._advice, self._legend = (QLabel(wordWrap=True) for _ in range(4))
        self._title.setStyleSheet(_LABEL.format(_INK.TEXT, 14, 600))
        self._detail.setStyleSheet(_LABEL.format(_INK.TEXT_DIM, 12, 400))
        self._legend.setStyleSheet(_LABEL.format(_INK.TEXT_DIM, 11, 400))
        squares = "".join(
            f' <span style="color:{colour}">\N{BLACK SQUARE}</span>&nbsp;{limit:g}' for limit, colour in reversed(HEAT)
        )
        self._legend.setText(f"{tr('wall force')}{squares} N")
        self._bar = QProgressBar(textVisible=False, maximum=1000)
        self._bar.setFixedHeight(6)
        self._bar.setStyleSheet(
            f"QProgressBar {{ background: {_INK.WINDOW}; border: none; border-radius: 3px; }}"
            f"QProgressBar::chunk {{ background: {_INK.SKY}; border-radius: 3px; }}"
        )
        self.button = text_button("", self.pressed.emit)
        self.cross = text_button("\N{MULTIPLICATION SIGN}", self.closed.emit, tr("Close the rehearsal"), tr("Close the rehearsal"))
        self.cross.setFixedWidth(26)
        for button in (self.button, self.cross):
            button.setStyleSheet(_BUTTON)
            button.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        head = line((self._title, 1), self.button, self.cross, spacing=6)
        self.setLayout(column(head, self._bar, self._detail, self._advice, self._legend, spacing=4, margins=(10, 7, 8, 7)))
        self.setCursor(Qt.CursorShape.ArrowCursor)
        self.setAccessibleName(tr("Rehearsal"))
        OnResize(live, self, self.place)
        self.hide()

    @property
    def text(self) -> str:
        """What it says, in one line."""
        labels = (self._title, self._detail, self._advice)
        return ". ".join(label.text() for label in labels if not label.isHidden() and label.text())

    def offer(self) -> None:
        """The target can be rehearsed."""
        self._show(tr("Rehearse  ({key})", key=KEY), "", None)

    def show_running(self, done: int, total: int, result: RehearsalResult | None, speed: float | None) -> None:
        """How many runs have ended at this share of the set speeds, and what those at the set ones say.

        No `speed`: before the runs, how far the pictures of the way are perceived.
        """
        title = tr("Rehearsing: {done} of {total}", done=done, total=total)
        if speed is None:
            title = tr("Looking at the way: {share:.0f} %", share=100 * done / max(1, total))
        elif speed < 1.0:
            title = tr("At {share:.0f} % of the set speeds: {done} of {total}", share=100 * speed, done=done, total=total)
        self._show(tr("Cancel"), title, result, done / max(1, total))

    def show_result(self, result: RehearsalResult, *, is_real: bool = False) -> None:
        """`is_real`: the bench has a robot of its own."""
        title = tr("{share:.0f} % of {runs} runs arrived", share=100 * result.arrived.share, runs=result.runs)
        self._show("", title, result)
        if is_real and result.based_on.get("robot") != "identified":
            note = tr("With the nominal robot: rig identify measures yours")
            self._detail.setText(f"{self._detail.text()}\n{note}")
        said, colour = advice_of(result)
        self._advice.setText(said)
        self._advice.setStyleSheet(_LABEL.format(colour, 13, 600))
        self._advice.show()
        self.place()

    def _show(self, button: str, title: str, result: RehearsalResult | None, share: float | None = None) -> None:
        self.button.setText(button)
        self.button.setVisible(bool(button))
        self.cross.setVisible(result is not None and share is None)
        self._title.setText(title)
        self._title.setVisible(bool(title))
        self._bar.setVisible(share is not None)
        self._bar.setValue(round(1000 * (share or 0.0)))
        self._detail.setText("" if result is None else figures_of(result))
        for label in (self._detail, self._legend):
            label.setVisible(result is not None)
        self._advice.hide()
        frame = f"background: {_INK.PANEL}; border: 1px solid {_INK.LINE}; border-radius: 8px;" if title else "background: none;"
        self.setStyleSheet(f"RehearsalCard {{ {frame} }}")
        self.setAccessibleDescription(self.text)
        self.show()
        self.place()

    def place(self) -> None:
        if self.isHidden():
            return
        layout = self.layout()
        assert layout is not None
        layout.activate()
        is_button = self._title.isHidden()
        width = self.sizeHint().width() if is_button else _WIDTH_PX
        height = layout.totalHeightForWidth(width) if layout.hasHeightForWidth() else self.sizeHint().height()
        self.resize(width, height)
        self.move(self._live.free_corner(QSize(width, height), self._covers))
        self.raise_()


def figures_of(result: RehearsalResult) -> str:
    """Interval, time, force, pictures without an answer, and whether a branch is too sharp."""
    arrived, time_s, force = result.arrived, result.time_s, result.wall_force_n
    parts = [tr("95 % interval {low:.0f} to {high:.0f} %", low=100 * arrived.low, high=100 * arrived.high)]
    if time_s.median is not None:
        parts.append(tr("{time:.0f} s (median)", time=time_s.median))
    if force.p95 is not None and force.max is not None:
        parts.append(tr("wall force {p95:.2f} N, {max:.2f} N at most", p95=force.p95, max=force.max))
    missing = result.based_on.get("missing")
    if isinstance(missing, float) and missing >= 0.005:
        parts.append(tr("no answer in {share:.0f} % of the pictures", share=100 * missing))
    words = ", ".join(parts)
    return words + "\n" + tr("A branch on the way turns off more sharply than the head bends") if result.sharp else words


def advice_of(result: RehearsalResult) -> tuple[str, str]:
    """What to do after it, and its colour over the picture."""
    speed = result.recommended_speed_mm_s
    if speed is None and result.runs < FEWEST_RUNS:
        return tr("Too few runs ended to recommend a speed: close other programs, and rehearse again"), _INK.ORANGE
    if speed is None:
        return tr("No speed that was tried is good: choose another target, or steer yourself"), _INK.FAULT
    if speed >= result.speed_mm_s:
        return tr("The set speed is good"), _INK.ROUTE
    share = 100 * speed / result.speed_mm_s
    return tr("Go at {share:.0f} % of the set speeds: advice.fast_mm_s = {speed:g}", share=share, speed=speed), _INK.ORANGE
