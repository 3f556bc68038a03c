"""The player's decoder: decoded frames are bounded in memory, and damaged rows are made drawable."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from queue import Queue

import numpy as np
import pytest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.player import decoder
from app.player.decoder import Decoded, FrameDecoder, drawable
from core.session.reader import SessionReader
from core.types import Tick
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
        frames.stop()
        assert frames.wait(5000)


def far(tick: Tick) -> Tick:
    path = tick.scene.path
    return replace(tick, scene=replace(tick.scene, path=replace(path, points=path.points * 1e30)))


@pytest.mark.parametrize(
    "damage",
    [
        far,
        lambda tick: replace(tick, scene=replace(tick.scene, scale=1e-30, scale_xy=None)),
        lambda tick: replace(tick, scene=replace(tick.scene, centerline=replace(tick.scene.centerline, piece=np.zeros((0, 2))))),
    ],
)
def test_absurd_geometry_is_not_drawn(damage: Callable[[Tick], Tick]) -> None:
    """Lines to the end of the world would take seconds to paint."""
    sound = tick_of(0, 0.0, full=True)
    assert drawable(sound).scene.path is not None
    shown = drawable(damage(sound))
    assert (shown.scene.path, shown.scene.vessel_graph, shown.scene.masks, shown.scene.scale) == (None, None, None, 1.0)
    assert shown.scene.pose is sound.scene.pose


def test_an_absurd_advice_is_not_drawn() -> None:
    sound = tick_of(0, 0.0, full=True)
    assert sound.advice is not None
    assert drawable(replace(sound, advice=replace(sound.advice, advance_mm_s=1e12))).advice is None
