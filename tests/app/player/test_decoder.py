"""What the player keeps of a session in memory."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.player import decoder
from app.player.decoder import FrameDecoder
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
