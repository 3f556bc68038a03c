"""Exports: opened again by what reads them."""

import csv
import errno
import os
from pathlib import Path

import av
import numpy as np
import pytest

from core.session.export import export_csv, export_mp4
from core.session.manifest import SessionError
from core.session.reader import SessionReader
from core.types import Image, Tick
from tests.core.session_data import number_in, record, tick_of

COUNT = 40


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty frames, the camera's clock standing still once; from frame 20 on with all that a scene can have."""
    ticks = (tick_of(i, 1000.0 + i / 10, full=i >= 20) for i in range(COUNT))
    return record(tmp_path_factory.mktemp("session"), ticks, driven=True)


def test_csv_has_a_line_a_frame_and_blanks_where_something_is_missing(session: Path, tmp_path: Path) -> None:
    with SessionReader(session) as reader:
        assert export_csv(reader, tmp_path / "x.csv") == COUNT
    with (tmp_path / "x.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["index"]) for row in rows] == list(range(COUNT))
    assert (rows[0]["state"], rows[0]["theta_signed_deg"], rows[0]["refusal"]) == ("", "", "no robot: 0 px")
    assert (rows[25]["state"], rows[25]["theta_signed_deg"], rows[25]["refusal"]) == ("D", "-5.5", "")
    assert (rows[25]["asked_bend"], rows[25]["commanded_advance_mm_s"], rows[25]["sent_bend"]) == ("0.25", "2.0", "0.5")
    assert (rows[25]["mode"], rows[25]["time_s"], rows[25]["insertion_mm"]) == ("ARMED", "2.5", "12.5")


def test_mp4_plays_at_the_captured_times(session: Path, tmp_path: Path) -> None:
    with SessionReader(session) as reader:
        assert export_mp4(reader, tmp_path / "x.mp4") == COUNT
    with av.open(str(tmp_path / "x.mp4")) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        frames = list(container.decode(stream))
    assert [number_in(frame.to_ndarray(format="rgb24")) for frame in frames] == list(range(COUNT))
    assert [frame.time for frame in frames] == pytest.approx([i / 10 for i in range(COUNT)], abs=0.002)


def test_mp4_burns_in_what_is_drawn_and_takes_odd_sizes_and_a_clip(session: Path, tmp_path: Path) -> None:
    drawn: list[int] = []

    def draw(tick: Tick) -> Image:
        drawn.append(tick.frame.index)
        return np.full((81, 121, 3), 200, np.uint8)

    with SessionReader(session) as reader:
        assert export_mp4(reader, tmp_path / "x.mp4", draw, first=10, last=15) == 5
    assert drawn == [10, 11, 12, 13, 14]
    with av.open(str(tmp_path / "x.mp4")) as container:
        frame = next(container.decode(video=0))
    assert (frame.width, frame.height) == (122, 82)
    assert frame.to_ndarray(format="rgb24").mean() == pytest.approx(200, abs=3)


@pytest.mark.parametrize("export", [export_csv, export_mp4])
def test_nothing_is_overwritten_and_nothing_half_is_left(session: Path, tmp_path: Path, export: object) -> None:
    assert callable(export)
    there = tmp_path / "there.mp4"
    there.write_text("mine")
    with SessionReader(session) as reader:
        with pytest.raises(SessionError, match="there already"):
            export(reader, there)
        with pytest.raises(SessionError, match="cannot be written"):
            export(reader, there / "in a file.mp4")
    assert [path.name for path in tmp_path.iterdir()] == ["there.mp4"]
    assert there.read_text() == "mine"


def test_a_session_without_pictures_is_no_mp4(tmp_path: Path) -> None:
    session = record(tmp_path, [tick_of(0, 1000.0)])
    (session / "video_0000.mkv").unlink()
    with SessionReader(session) as reader, pytest.raises(SessionError, match="no picture"):
        export_mp4(reader, tmp_path / "x.mp4")
    assert not list(tmp_path.glob("*.mp4*"))


def no_links(*_: object) -> None:
    raise OSError(errno.EPERM, os.strerror(errno.EPERM))


@pytest.mark.parametrize("has_links", [True, False])
def test_of_two_that_export_to_one_file_the_first_one_stands(
    session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_links: bool
) -> None:
    """Also when the other one ends between a check whether the file exists and the move."""
    if not has_links:
        monkeypatch.setattr(os, "link", no_links)
    out = tmp_path / "x.csv"
    with SessionReader(session) as reader, pytest.raises(SessionError, match="was made by something else meanwhile"):

        def another() -> None:
            if not out.exists():
                with SessionReader(session) as other:
                    export_csv(other, out)
                monkeypatch.setattr(Path, "exists", lambda _: False)

        export_csv(reader, out, another)
    monkeypatch.undo()
    with SessionReader(session) as reader:
        export_csv(reader, tmp_path / "y.csv")
    assert out.read_bytes() == (tmp_path / "y.csv").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.csv", "y.csv"]


def test_a_file_that_was_made_while_exporting_is_not_overwritten(session: Path, tmp_path: Path) -> None:
    out = tmp_path / "x.csv"
    with SessionReader(session) as reader, pytest.raises(SessionError, match="was made by something else meanwhile"):
        export_csv(reader, out, lambda: out.write_text("another program's") and None)
    assert out.read_text() == "another program's"
    assert [path.name for path in tmp_path.iterdir()] == ["x.csv"]
