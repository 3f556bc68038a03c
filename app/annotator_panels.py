"""All that the rater sees below the menus: the panels of the annotator window and their places."""

from __future__ import annotations

from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.annotation_desk import AnnotationDesk
from app.language import tr
from app.panel_layout import column, holder, set_window_margins, side
from app.widgets.annotation_bar import AnnotationBar
from app.widgets.annotation_canvas import AnnotationCanvas
from app.widgets.annotation_header import AnnotationHeader
from app.widgets.annotation_help import annotation_help
from app.widgets.annotation_list import QueueList, QueueModel
from app.widgets.annotation_readout import AnnotationReadout
from app.widgets.card import Card
from app.widgets.columns import Columns
from app.widgets.light_sliders import LightSliders
from app.widgets.note_field import NoteField
from app.widgets.toast import Toast

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

    def __init__(self, desk: AnnotationDesk, who: str, names: list[str]) -> None:
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
