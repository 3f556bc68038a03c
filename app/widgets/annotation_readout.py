"""The angle in large figures, the distances, and the rater's state beside what his lines say."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from app import palette, theme
from app.language import tr, tr_text
from app.tool_tips import tip
from app.widgets.state_badge import paint_state
from app.wording import STATE_TITLE, side
from core.study.annotations import Annotation, Readout

_DASH = "\N{EN DASH}"
_HEIGHT = 232


class AnnotationReadout(QWidget):
    """Shows one annotation with its readout; without both lines it says what is still to be drawn."""

    def __init__(self, wanted_px: float) -> None:
        super().__init__()
        self._wanted_px = wanted_px
        self._annotation = Annotation()
        self._readout = Readout()
        self._is_preview = False
        self.setFixedHeight(_HEIGHT)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(tr("Readout"))
        self.setToolTip(tip("theta", "d_head", "d_tail", "crossed", "lines_used", "state"))

    @property
    def angle_text(self) -> str:
        pose = self._readout.pose
        return _DASH if pose is None else f"{pose.theta_deg:.1f}°"

    @property
    def state_text(self) -> str:
        """The line beside the badge."""
        annotation, pose = self._annotation, self._readout.pose
        if annotation.cannot_tell:
            return tr("Can't tell")
        if annotation.state is not None:
            return tr(STATE_TITLE[annotation.state])
        return tr("No state yet") if pose is not None else tr("No state")

    @property
    def advice_text(self) -> str:
        """What the lines say of the state, or what is missing."""
        annotation, pose = self._annotation, self._readout.pose
        if annotation.cannot_tell:
            return tr("X takes it back")
        if pose is None:
            missing = tr_text(self._readout.missing)
            return missing[:1].upper() + missing[1:]
        if annotation.state is None:
            return tr("The lines say {state}: Enter takes it, or press A B C D", state=pose.state.value)
        if annotation.state is not pose.state:
            return tr("The lines say {state}, by the rule", state=pose.state.value)
        return tr("The lines say the same")

    def sizeHint(self) -> QSize:
        return QSize(320, _HEIGHT)

    def show_annotation(self, annotation: Annotation, readout: Readout, *, is_preview: bool = False) -> None:
        """`is_preview`: a point is still moving."""
        self._annotation, self._readout, self._is_preview = annotation, readout, is_preview
        self.setAccessibleDescription(f"{tr('theta')} {self.angle_text}; {self.state_text}; {self.advice_text}")
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self._paint_angle(painter)
        self._paint_distances(painter)
        self._paint_state(painter)
        painter.end()

    def _paint_angle(self, painter: QPainter) -> None:
        pose = self._readout.pose
        painter.setPen(QColor(palette.THETA if pose is not None else palette.TEXT_FAINT))
        painter.setFont(theme.bold(58 if pose is not None else 34))
        box = QRectF(0, 0, self.width() * 0.62, 72)
        painter.drawText(box, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter, self.angle_text)
        left = self.width() * 0.62
        painter.setFont(theme.semi_bold(14))
        painter.setPen(QColor(palette.TEXT if pose is not None else palette.TEXT_FAINT))
        turn = side(pose.theta_signed_deg) if pose is not None and pose.theta_deg >= 0.05 else ""
        painter.drawText(
            QRectF(left, 14, self.width() - left, 20), Qt.AlignmentFlag.AlignVCenter, f"\N{GREEK SMALL LETTER THETA} {turn}"
        )
        painter.setFont(theme.font(12))
        painter.setPen(QColor(palette.TEXT_DIM))
        painter.drawText(
            QRectF(left, 36, self.width() - left, 18), Qt.AlignmentFlag.AlignVCenter, tr("moving") if self._is_preview else ""
        )

    def _paint_distances(self, painter: QPainter) -> None:
        pose, readout = self._readout.pose, self._readout
        cells = (
            ("d_head", f"{pose.d_head_px:.1f} px" if pose else _DASH, palette.D_HEAD),
            ("d_tail", f"{pose.d_tail_px:.1f} px" if pose else _DASH, palette.D_TAIL),
            (tr("crossed"), (tr("yes") if pose.crossed else tr("no")) if pose else _DASH, palette.TEXT),
            (tr("lines used"), self._lengths() if readout.robot_vector is not None else _DASH, palette.TEXT),
        )
        width = self.width() / len(cells)
        for place, (name, value, colour) in enumerate(cells):
            painter.setFont(theme.font(12))
            painter.setPen(QColor(palette.TEXT_DIM))
            painter.drawText(QRectF(place * width, 80, width, 16), Qt.AlignmentFlag.AlignVCenter, name)
            painter.setFont(theme.fitted(theme.semi_bold(15), value, int(width - 4)))
            painter.setPen(QColor(colour if pose or place == 3 else palette.TEXT_FAINT))
            painter.drawText(QRectF(place * width, 98, width, 20), Qt.AlignmentFlag.AlignVCenter, value)

    def _lengths(self) -> str:
        """Arc lengths that the vectors are fitted to; less than wanted is less certain."""
        robot, vessel = round(self._readout.robot_length_px), round(self._readout.vessel_length_px)
        return f"{robot} + {vessel} px" if vessel else f"{robot} px"

    def _paint_state(self, painter: QPainter) -> None:
        annotation, pose = self._annotation, self._readout.pose
        painter.setPen(QPen(QColor(palette.LINE), 1))
        painter.drawLine(QPointF(0, 131), QPointF(self.width(), 131))
        box = QRectF(2, 146, 62, 62)
        shown = None if annotation.cannot_tell else annotation.state
        if annotation.cannot_tell:
            painter.setPen(QPen(QColor(palette.TEXT_DIM), 2, Qt.PenStyle.DashLine))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawEllipse(box.adjusted(3, 3, -3, -3))
            painter.setFont(theme.bold(30))
            painter.setPen(QColor(palette.TEXT))
            painter.drawText(box, Qt.AlignmentFlag.AlignCenter, "?")
        else:
            paint_state(painter, box, shown)
        left = 80.0
        painter.setFont(theme.bold(20))
        painter.setPen(QColor(palette.TEXT if shown or annotation.cannot_tell else palette.TEXT_DIM))
        painter.drawText(QRectF(left, 148, self.width() - left, 26), Qt.AlignmentFlag.AlignVCenter, self.state_text)
        differs = shown is not None and pose is not None and pose.state is not shown
        painter.setFont(theme.font(13))
        painter.setPen(QColor(palette.ORANGE if differs else palette.TEXT_DIM))
        flags = int(Qt.AlignmentFlag.AlignTop | Qt.TextFlag.TextWordWrap)
        painter.drawText(QRectF(left, 178, self.width() - left, 52), flags, self.advice_text)
