"""``benchmark --player``: the session that it makes is a whole one, and every seek ends at the row that was wished for."""

from __future__ import annotations

from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from core.config.models import Config
from core.session.reader import SessionReader
from tools import benchmarks


def test_a_long_session_is_made_opened_and_sought_in(qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(benchmarks, "_CYCLE", 8)
    monkeypatch.setattr(benchmarks, "_SEEKS", 5)
    benchmarks._make_session(Config(), 2.0 / 60.0, str(tmp_path))
    (folder,) = tmp_path.iterdir()
    with SessionReader(folder) as reader:
        assert reader.wait(30.0)
        assert len(reader) == 60
        assert not reader.problems
    found = benchmarks._measure(folder, Config())
    assert found["rows"] == 60
    assert found["seek_ms"]["p50"] > 0.0
    assert 0.0 < found["opens_s"] <= found["known_s"]
