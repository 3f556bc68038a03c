"""The player's decoder: decoded frames are bounded in memory, and damaged rows are made drawable."""

from __future__ import annotations

import threading
from pathlib import Path
from queue import Queue

import pytest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.player import decoder
from app.player.decoder import Decoded, FrameDecoder
from core.session.reader import SessionReader
from tests.core.session_data import SIZE, record, tick_of

PICTURE_BYTES = SIZE[0] * SIZE[1] * 3


@pytest.mark.parametrize(("room", "kept", "ahead"), [(1000, 24, 6), (5, 5, 3), (0.5, 1, 1)])
def test_kept_pictures_are_bounded_by_bytes_too(
    room: float, kept: int, ahead: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By their number alone those of a large camera took more than a gigabyte."""
    monkeypatch.setattr(decoder, "_KEPT_BYTES", int(room * PICTURE_BYTES))
    session = record(tmp_path, [tick_of(i, 1000.0 + i / 30) for i in range(30)])
    with SessionReader(session) as reader:
        reader.wait(10.0)
        thread = FrameDecoder(reader)
        for place in range(30):
            decoded = thread._decode(place)
            assert decoded.tick is not None
            assert thread._decode(place) is decoded, "what is shown is kept in any case"
        assert list(thread._kept) == list(range(30 - kept, 30))
        assert thread._kept_bytes == kept * PICTURE_BYTES
        assert thread._ahead_count(decoded) == ahead


@pytest.mark.parametrize("other", [12, 5], ids=["another row between", "the same row again"])
def test_a_late_report_of_decoding_ahead_displaces_no_request(
    other: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, qtbot: QtBot
) -> None:
    """The position said one row, the picture stayed at another."""
    session = record(tmp_path, [tick_of(i, 1000.0 + i / 30) for i in range(20)])
    begun: Queue[int] = Queue()
    gate = threading.Semaphore(0)
    with SessionReader(session) as reader:
        reader.wait(10.0)
        frames, shown = FrameDecoder(reader), []
        frames.decoded.connect(lambda found: shown.append(found.place))
        decode = frames._decode

        def decode_slowly(place: int) -> Decoded:
            begun.put(place)
            assert gate.acquire(timeout=10)
            return decode(place)

        monkeypatch.setattr(frames, "_decode", decode_slowly)
        frames.request(5)
        gate.release()
        qtbot.waitUntil(lambda: shown == [5])
        assert [begun.get(timeout=5) for _ in range(2)] == [5, 6]
        frames.request(other)
        gate.release()
        assert begun.get(timeout=5) == other, "row 6 is decoded, which is not reported yet"
        if other == 5:
            frames.request_again()
        else:
            frames.request(5)
        QApplication.processEvents()
        gate.release(100)
        qtbot.waitUntil(lambda: shown == [5, other, 5])
        qtbot.waitUntil(lambda: set(range(5, 12)) <= set(frames._kept))
        frames.worker.stop(finish=False)
        assert frames.worker.wait(5000)
