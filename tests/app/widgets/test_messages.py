"""Notices over the picture."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.widgets.messages import Notice, NoticeKind
from tests.app.widgets.conftest import Own


def test_notice_shows_title_detail_and_a_way_out(own: Own, qtbot: QtBot) -> None:
    room = own(QWidget(), 700, 500, show=True)
    notice = Notice(room)
    notice.show_notice(NoticeKind.FAULT, "The rig stopped", "camera lost", restartable=True)
    assert notice.text == "The rig stopped. camera lost"
    with qtbot.waitSignal(notice.restart):
        qtbot.mouseClick(notice._button, Qt.MouseButton.LeftButton)
    assert room.rect().contains(notice.geometry())
    notice.hide()
    assert not notice.isVisible()


@pytest.mark.parametrize("size", [(480, 320), (590, 345), (1000, 700)])
@pytest.mark.parametrize("restartable", [False, True])
def test_a_notice_has_room_for_all_that_it_says(own: Own, size: tuple[int, int], restartable: bool) -> None:
    room = own(QWidget(), *size, show=True)
    notice = Notice(room)
    path = "/dev/serial/by-id/usb-FTDI_USB__-__Serial_Converter_FT8J0MXY-if00-port0"
    why = f"no permission for {path}: {'add yourself to the group dialout, log out and in again; ' * 4}then start the rig again"

    notice.show_notice(NoticeKind.FAULT, "The rig stopped", why, restartable=restartable)
    assert room.rect().contains(notice.geometry())
    assert notice.toolTip() == notice.text
    shown = notice.grab().toImage()
    notice.show_notice(NoticeKind.FAULT, "The rig stopped", why.removesuffix("again") + "twice", restartable=restartable)
    assert notice.grab().toImage() != shown, "its last word is seen"
    notice.show_notice(NoticeKind.FAULT, "The rig stopped", "camera lost", restartable=restartable)
    assert notice.height() < shown.height()
