"""Pictures for ``annotate`` among folders, links, videos and sessions; which of them are alike."""

from __future__ import annotations

from pathlib import Path

import av
import cv2
import pytest

from app.annotator.comparison import groups_of
from app.annotator.sources import default_store, image_files, recorded_angles, session_rows
from core.annotation.store import DEFAULT_NAME
from core.devices import UserError
from tests.core.drawing import film, greys
from tests.core.session_data import QUICK, record, tick_of


def grey_of(path: Path) -> float:
    return float(cv2.imread(str(path)).mean())


def test_a_video_that_pictures_were_taken_of_is_gone_on_with_those(tmp_path: Path) -> None:
    """The second rater's call does not say how many: a study of 500 must not become one of 48."""
    video = film(tmp_path / "run.mp4", greys([4 * k for k in range(60)]), "libx264")
    assert [len(image_files([video], count)) for count in (55, None)] == [55, 55]
    other = film(tmp_path / "other.mp4", greys([4 * k for k in range(60)]), "libx264")
    assert len(image_files([other], None)) == 48


def test_a_session_in_several_files_is_one_recording(tmp_path: Path) -> None:
    """The last minute of an hour must not count as much as the hour."""
    config = QUICK.model_copy(update={"split_s": 1.4})
    session = record(tmp_path, [tick_of(index, 1000.0 + index / 30.0) for index in range(60)], config)
    assert len(list(session.glob("video_*.mkv"))) == 2
    files = image_files([session], 7)
    assert [path.parent.name for path in files] == ["video_0000_frames"] * 5 + ["video_0001_frames"] * 2
    assert image_files([session], None) == files


def test_pictures_of_an_older_video_of_its_name_are_not_taken_for_its_own(tmp_path: Path) -> None:
    video = film(tmp_path / "take.mp4", greys([40] * 5), "libx264")
    files = image_files([video], 2)
    film(video, greys([200] * 5), "libx264")
    for reuse in (False, True):
        with pytest.raises(UserError, match=r"take_frames: holds pictures of another video than take.mp4 is now; move it away"):
            image_files([video], 2, reuse=reuse)
    assert round(grey_of(files[0]), -1) == 40
    (video.with_name("take_frames") / "video.json").unlink()  # as folders were before they knew whose they are
    with pytest.raises(UserError, match="holds pictures of another video"):
        image_files([video], 2)
    film(video, greys([40] * 5), "libx264")
    assert image_files([video], 2) == files
    assert (files[0].parent / "video.json").is_file()


def test_a_damaged_frame_is_left_out_and_no_neighbour_taken_for_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    video = film(tmp_path / "run.mkv", greys([8 * k for k in range(31)]), "libx264", g="1", bf="0")
    with av.open(str(video)) as container:
        packets = [(packet.pos, packet.size) for packet in container.demux(video=0) if packet.size]
    data = bytearray(video.read_bytes())
    position, size = packets[10]
    data[position + 4 : position + size] = bytes(size - 4)
    video.write_bytes(data)
    assert [path.name for path in image_files([video], 4)] == ["run_000000.png", "run_000020.png", "run_000030.png"]
    assert "run.mkv: 1 of 4 chosen frames are lost or damaged: left out" in capsys.readouterr().err


def test_a_video_becomes_pictures_evenly_over_time(tmp_path: Path) -> None:
    video = film(tmp_path / "run.mkv", greys([8 * k for k in range(31)]), "libx264")
    files = image_files([video], 4)
    assert [path.name for path in files] == ["run_000000.png", "run_000010.png", "run_000020.png", "run_000030.png"]
    assert image_files([video], 4) == files, "written once"
    assert [round(grey_of(path) / 8) for path in files] == [0, 10, 20, 30]
    assert default_store([video]) == tmp_path / DEFAULT_NAME
    assert image_files([video], 48, reuse=True) == files, "who evaluates finds what was annotated, however many those are"
    for path in files:
        path.unlink()
    assert image_files([video], 4, reuse=True) == files


def test_pictures_of_one_recording_are_one_group(tmp_path: Path) -> None:
    """Whatever folders its files have; of plain pictures in one folder nobody knows what they show."""
    session, video, plain = (tmp_path / name for name in ("session_1", "run_frames", "pictures"))
    parts = [session / f"video_000{k}_frames" for k in range(2)]
    for place in (*parts, video, plain):
        place.mkdir(parents=True)
    (session / "frames.jsonl").touch()
    (video / "video.json").touch()
    of_session = [part / "a.png" for part in parts]
    assert set(groups_of(of_session).values()) == {"session_1"}
    assert groups_of([video / "a.png", video / "b.png"]) == {video / "a.png": "run_frames", video / "b.png": "run_frames"}
    assert groups_of([plain / "a.png", plain / "b.png"]) == {plain / "a.png": None, plain / "b.png": None}
    mixed = groups_of([*of_session, plain / "a.png"])
    assert list(mixed.values()) == ["session_1", "session_1", "pictures"]


@pytest.fixture
def session(tmp_path: Path) -> Path:
    """Twelve rows; without a pose from the fourth to the sixth."""
    return record(tmp_path, [tick_of(k, 10.0 + 0.1 * k, full=not 4 <= k < 7) for k in range(12)])


def test_rows_of_a_session_become_pictures(session: Path) -> None:
    files = session_rows(session, "2, 9,2")
    assert [path.name for path in files] == ["video_0000_000002.png", "video_0000_000009.png"]
    assert [path.name for path in session_rows(session, "refused")] == [f"video_0000_00000{k}.png" for k in (4, 5, 6)]
    assert len(image_files([session], None)) == 5, "all that were extracted are gone on with"


@pytest.mark.parametrize(
    ("chosen", "message"),
    [("2,99", "no row 99; its rows are 0 to 11"), ("first", "must be row numbers"), (",", "must be row numbers")],
)
def test_rows_that_are_not_there_are_named(session: Path, chosen: str, message: str) -> None:
    with pytest.raises(UserError, match=message):
        session_rows(session, chosen)
    assert not list(session.glob("*_frames"))


def test_rows_are_those_of_a_session(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no such session"):
        session_rows(tmp_path / "gone", "1")


def test_a_picture_of_a_session_has_its_time_and_the_recorded_angle(tmp_path: Path) -> None:
    session = record(tmp_path, [tick_of(k, 1000.0 + k / 10, full=k > 0) for k in range(4)])
    (folder,) = {path.parent for path in image_files([session], 4)}
    assert recorded_angles(folder) == {0: (0.0, None), 1: (0.1, -5.5), 2: (0.2, -5.5), 3: (0.3, -5.5)}
    assert recorded_angles(tmp_path) == {}
