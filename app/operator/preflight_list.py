"""The checks before driving as a list: a sign, a word, what was found, what to do. Space is STOP here, too."""

from __future__ import annotations

from PySide6.QtCore import QPoint, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QDialog, QFrame, QGridLayout, QLabel, QPushButton, QScrollArea, QWidget

from app.operator.preflight import Preflight, PreflightFinding, PreflightModel
from app.ui import theme
from app.ui.i18n import mark, tr, tr_text
from app.ui.texts import OperatorStep
from app.widgets.basics import card_note, column, line, takes_enter
from hardware.preflight.preflight import Level

_SIZE = QSize(780, 560)
_LEAST_PX, _ABOVE_PX = 300, 8
_TITLE_PX = 40  # about what the desktop's title bar takes
_UPDATE_MS = 1000
_LOOK: dict[Level, tuple[str, str, str]] = {
    Level.GOOD: ("\N{CHECK MARK}", "ALLOWED", mark("good")),
    Level.UNUSED: ("\N{EN DASH}", "TEXT_FAINT", mark("not used")),
    Level.WARNING: ("\N{WARNING SIGN}", "ORANGE", mark("notice")),
    Level.BAD: ("\N{MULTIPLICATION X}", "FAULT", mark("NOT READY")),
}
"""Sign, colour and word: some operators see no difference in colour."""
_BADGE_PX = 112


class PreflightList(QDialog):
    """Shows the findings of `model`. ``arm_asked`` is a request; nothing here decides.

    It opens above `kept_clear` (STOP) in its parent's window, also by itself when arming is refused.
    """

    arm_asked = Signal()

    def __init__(self, model: PreflightModel, parent: QWidget | None = None, kept_clear: QWidget | None = None) -> None:
        super().__init__(parent)
        self._model = model
        self._kept_clear = kept_clear
        self._shown: tuple[PreflightFinding, ...] = ()
        self.setWindowTitle(tr("Before driving"))
        self.setModal(False)
        self.resize(_SIZE)
        self._headline = QLabel(wordWrap=True)
        self._headline.setFont(theme.bold(18))
        self._note = card_note("")
        self._note.setFont(theme.font(theme.Size.BODY))
        content = QWidget()
        self._rows = QGridLayout(content)
        self._rows.setContentsMargins(8, 6, 8, 6)
        self._rows.setColumnStretch(2, 1)
        self._rows.setHorizontalSpacing(14)
        self._rows.setVerticalSpacing(8)
        scroll = QScrollArea(widgetResizable=True)
        scroll.setFrameShape(QFrame.Shape.NoFrame)
        scroll.setObjectName("checks")
        scroll.setAccessibleName(tr("Checks before driving"))
        scroll.setWidget(content)
        self.again, self.arm, self.leave = QPushButton(tr("Check &again")), QPushButton(tr("A&rm  (F6)")), QPushButton(tr("&Close"))
        self.again.clicked.connect(model.begin)
        self.arm.clicked.connect(self._on_arm)
        self.leave.clicked.connect(self.close)
        self.arm.setShortcut(OperatorStep.ARM.value.key)  # the keys are this window's while it is in front
        self.arm.setObjectName("main_button")
        buttons = self.again, self.arm, self.leave
        for button in buttons:
            button.setAutoDefault(False)
        foot = line((self._note, 1), *buttons, spacing=12)
        self.setLayout(column(self._headline, (scroll, 1), foot, spacing=12, margins=(18, 14, 18, 14)))
        self._timer = QTimer(self, interval=_UPDATE_MS)
        self._timer.timeout.connect(self.renew)  # the state of the open rig changes without a signal
        self.finished.connect(self._timer.stop)
        model.changed.connect(self.renew)
        self.renew()

    @property
    def texts(self) -> list[str]:
        """The lines as shown."""
        return [
            f"{tr(_LOOK[one.level][2])} {tr_text(one.name)}: {tr_text(one.detail)} {tr_text(one.fix)}".strip()
            for one in self._shown
        ]

    @property
    def headline(self) -> str:
        return self._headline.text()

    def open_list(self) -> None:
        self.renew()
        self._timer.start()
        if not self.isVisible():
            self._place()
        self.show()
        self.raise_()
        self.activateWindow()

    def _place(self) -> None:
        window, clear = self.parentWidget(), self._kept_clear
        if window is None or clear is None:
            return
        frame, bottom = window.frameGeometry(), clear.mapToGlobal(QPoint(0, 0)).y() - _ABOVE_PX
        height = max(_LEAST_PX, min(_SIZE.height(), bottom - frame.top() - _TITLE_PX))
        self.resize(_SIZE.width(), height)
        self.move(frame.center().x() - _SIZE.width() // 2, min(frame.center().y() - height // 2, bottom - height - _TITLE_PX))

    def renew(self) -> None:
        now = self._model.preflight
        self._headline.setText(now.headline)
        self._note.setText(_note(now))
        self.again.setEnabled(not now.is_running)
        self.again.setText(tr("Check &again") if now.age_s is not None else tr("Check &now"))
        self.arm.setEnabled(self._model.has_robot and now.is_fresh and not (now.against or now.waiting or now.is_running))
        self.arm.setToolTip("" if self.arm.isEnabled() else _why_not(now, self._model.has_robot))
        if now.findings != self._shown:
            self._shown = now.findings
            self._fill()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not takes_enter(self, event):
            super().keyPressEvent(event)

    def _on_arm(self) -> None:
        self.close()
        self.arm_asked.emit()

    def _fill(self) -> None:
        while self._rows.count():
            if (widget := self._rows.takeAt(0).widget()) is not None:
                widget.hide()
                widget.deleteLater()
        for row in range(self._rows.rowCount()):
            self._rows.setRowStretch(row, 0)
        order = {Level.BAD: 0, Level.WARNING: 1, Level.GOOD: 2, Level.UNUSED: 3}
        for place, finding in enumerate(sorted(self._shown, key=lambda one: order[one.level])):
            shown = tr_text(finding.name)
            name = QLabel(shown[0].upper() + shown[1:])
            name.setFont(theme.semi_bold(theme.Size.BODY))
            detail = QLabel(tr_text(finding.detail) + (f"\n\N{RIGHTWARDS ARROW} {tr_text(finding.fix)}" if finding.fix else ""))
            detail.setWordWrap(True)
            detail.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)  # a command is made to be copied
            top = Qt.AlignmentFlag.AlignTop
            sign, role, word = _LOOK[finding.level]
            badge = QLabel(f'<span style="font-size: 18px;">{sign}</span>&nbsp;&nbsp;{tr(word)}')
            badge.setFixedWidth(_BADGE_PX)
            theme.set_sheet(badge, f"color: @{role}; font-size: 13px; font-weight: 600;")
            self._rows.addWidget(badge, place, 0, top)
            self._rows.addWidget(name, place, 1, top)
            self._rows.addWidget(detail, place, 2, top)
        self._rows.setRowStretch(len(self._shown), 1)


def _note(now: Preflight) -> str:
    if now.is_running or now.age_s is None:
        return tr("The checks take some seconds. Nothing moves by them.")
    minutes = int(now.age_s // 60)
    ago = tr("just now") if minutes < 1 else tr("{minutes} min ago", minutes=minutes)
    return tr("Checked {ago}", ago=ago) + ("" if now.is_fresh else tr(": too long ago"))


def _why_not(now: Preflight, has_robot: bool) -> str:
    if not has_robot:
        return tr("There is nothing to arm: no servos are open")
    if now.is_fresh and now.waiting and not now.against:
        return now.waiting[0]
    if now.against:
        return tr("First mend what is NOT READY, and check again")
    return tr("First the checks must be done")
