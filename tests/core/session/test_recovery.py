"""Sessions that were cut or damaged: read as far as they go, told what is wrong, recovered into a copy, the original untouched."""

import errno
import hashlib
import json
import os
import random
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import av
import pytest

from core.session import recovery
from core.session.files import add_event, lines_of
from core.session.manifest import EVENTS, Event, EventKind, SessionError, read_manifest
from core.session.reader import SessionReader
from core.session.recovery import Recovery, expected_loss, find_cut_sessions, recover
from core.session.writer import SessionWriter
from tests.core.session_data import ABOUT, QUICK, number_in, record, set_open, tick_of, wait_for

CHILD = Path(__file__).with_name("recording_child.py")
FPS = 30.0
COUNT = 75


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session of 75 frames at 30 fps in one file."""
    return record(tmp_path_factory.mktemp("whole"), (tick_of(i, 1000.0 + i / FPS, full=True) for i in range(COUNT)))


@pytest.fixture
def session(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / whole.name))


def fingerprint(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.iterdir())}


def read_all(session: Path) -> tuple[list[int], list[int], tuple[str, ...]]:
    """Indices of the rows, those whose picture is there, and the problems. No picture may be another row's."""
    with SessionReader(session) as reader:
        assert reader.wait(20.0)
        rows = [reader.row(place) for place in range(len(reader))]
        frames = [reader.frame(place) for place in range(len(reader))]
        assert [number_in(frame.image) for frame in frames if frame is not None] == [f.index for f in frames if f is not None]
        _ = reader.events
        return (
            [row.index for row in rows if row is not None],
            [frame.index for frame in frames if frame is not None],
            reader.problems,
        )


def rewrite_video(path: Path, delays_ms: Mapping[int, int] | None = None, without: int | None = None) -> None:
    """Write the video once more, without one of its packets and with some of its times changed, both by the packet's place."""
    whole = path.with_suffix(".whole")
    path.rename(whole)
    with av.open(str(whole), format="matroska") as source, av.open(str(path), "w", format="matroska") as target:
        stream = source.streams.video[0]
        copy = target.add_stream_from_template(stream)
        for place, packet in enumerate(packet for packet in source.demux(stream) if packet.size):
            assert packet.pts is not None
            if place != without:
                packet.pts += (delays_ms or {}).get(place, 0)
                packet.stream, packet.dts = copy, place
                target.mux_one(packet)
    whole.unlink()


def cut(path: Path, share: float) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])


# --- damaged sessions, read as they are


def test_a_cut_last_row_is_named_and_the_others_are_read(session: Path) -> None:
    path = session / "frames.jsonl"
    path.write_bytes(path.read_bytes()[:-40])
    rows, pictures, problems = read_all(session)
    assert rows == pictures == list(range(COUNT - 1))
    assert problems == (f"frames.jsonl: line {COUNT}: cut off; skipped",)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (b"{", "not valid JSON"),
        (b'{"row": NaN}', "row: "),
        (b"[" * 200_000, "not valid JSON"),
        (b"[1, 2]", "not an object"),
        (b"\xff\xfe\x00", "not valid JSON"),
        (b"x" * 4_100_000, "longer than"),
        (b'{"row": 1e400}', "row: "),
        (b'{"row": -5, "captured_s": 1.0, "video": 0, "pts_ms": 0}', "row: "),
        (b'{"row": 900, "captured_s": "x"}', "captured_s: "),
        (b'{"row": ' + b"9" * 5000 + b"}", "not valid JSON"),
    ],
)
def test_a_bad_row_is_named_by_its_line_and_skipped(session: Path, line: bytes, why: str) -> None:
    path = session / "frames.jsonl"
    lines = path.read_bytes().splitlines()
    lines[10] = line
    path.write_bytes(b"\n".join(lines) + b"\n")
    rows, _, problems = read_all(session)
    assert rows == [i for i in range(COUNT) if i != 10]
    assert problems[0].startswith("frames.jsonl: line 11: ")
    assert why in problems[0]


def test_a_flipped_digit_is_found_by_the_checksum(session: Path) -> None:
    path = session / "frames.jsonl"
    data = path.read_bytes()
    place = data.index(b'"theta_signed_deg":-5.5') + len(b'"theta_signed_deg":-')
    path.write_bytes(data[:place] + b"7" + data[place + 1 :])
    rows, _, problems = read_all(session)
    assert rows == list(range(1, COUNT))
    assert problems == ("frames.jsonl: line 1: checksum wrong; skipped",)


def test_rows_without_their_video_keep_their_values(session: Path) -> None:
    (session / "video_0000.mkv").unlink()
    rows, pictures, problems = read_all(session)
    assert (len(rows), pictures) == (COUNT, [])
    assert len(problems) == 1, "one line for the file, not one a picture"
    assert problems[0].startswith("video_0000.mkv: cannot be read as a video")


@pytest.mark.parametrize(
    "change", [{"kind": 7}, {"started_utc": 5e300}, {"counts": 3}, {"format": 0}, {"started_monotonic_s": None}]
)
def test_a_manifest_with_a_wrong_value_names_it(session: Path, change: dict[str, object]) -> None:
    content = json.loads((session / "manifest.json").read_text()) | change
    (session / "manifest.json").write_text(json.dumps(content))
    with pytest.raises(SessionError, match=next(iter(change))):
        read_manifest(session)


def test_a_session_of_a_newer_version_is_refused_and_left_alone(session: Path) -> None:
    content = json.loads((session / "manifest.json").read_text()) | {"format": 2, "closed": False}
    (session / "manifest.json").write_text(json.dumps(content))
    for use in (SessionReader, recover):
        with pytest.raises(SessionError, match="newer version"):
            use(session)
    assert find_cut_sessions(session.parent) == ()


@pytest.mark.parametrize(("make", "why"), [("folder", "not a session"), ("file", "not a file"), ("nothing", "no such session")])
def test_what_is_no_session_is_refused(tmp_path: Path, make: str, why: str) -> None:
    path = tmp_path / "x"
    if make == "folder":
        path.mkdir()
    elif make == "file":
        path.write_text("")
    for use in (SessionReader, recover):
        with pytest.raises(SessionError, match=why):
            use(path)


# --- recovery


def checked(session: Path, done: Recovery) -> tuple[list[int], list[int]]:
    """The copy is whole: closed, nothing wrong with it, as many rows and pictures as it says."""
    rows, pictures, problems = read_all(done.folder)
    # only lost pictures are left to tell of: one by one, or the whole file when it held none
    assert all("no picture at" in problem or "cannot be read as a video" in problem for problem in problems), problems
    manifest = read_manifest(done.folder)
    assert manifest.closed
    assert manifest.recovered == done.loss
    assert manifest.counts.frames == len(rows) == done.frames
    assert done.loss.origin == str(session)
    return rows, pictures


def test_a_cut_session_is_found_recovered_and_not_found_again(session: Path) -> None:
    set_open(session)
    for name in ("frames.jsonl", "video_0000.mkv"):
        cut(session / name, 0.6)
    before = fingerprint(session)
    (found,) = find_cut_sessions(session.parent)
    assert (found.folder, found.why) == (session, "it did not end properly")
    done = recover(found.folder)
    rows, pictures = checked(session, done)
    assert fingerprint(session) == before
    assert len(rows) == pytest.approx(0.6 * COUNT, abs=3)
    assert len(pictures) >= len(rows) - 20
    assert done.loss.seconds == pytest.approx((len(rows) - len(pictures)) / FPS, abs=0.04)
    assert done.folder == session.with_name(session.name + "_recovered")
    assert find_cut_sessions(session.parent) == ()
    with pytest.raises(SessionError, match="there already"):
        recover(session)


def test_a_whole_session_loses_nothing_when_it_is_recovered(session: Path, tmp_path: Path) -> None:
    done = recover(session, tmp_path / "into")
    assert (done.loss.seconds, done.loss.rows, done.loss.pictures, done.loss.problems) == (0.0, 0, 0, ())
    assert checked(session, done) == (list(range(COUNT)), list(range(COUNT)))


def test_after_a_lost_picture_none_is_kept_that_builds_on_it(session: Path) -> None:
    path = session / "video_0000.mkv"
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 512] = bytes(512)
    path.write_bytes(data)
    done = recover(session)
    rows, pictures = checked(session, done)
    assert len(rows) == COUNT
    # each picture that can be decoded is the row's own
    assert len(pictures) <= done.pictures == COUNT - done.loss.pictures


def test_a_session_whose_manifest_is_lost_claims_nothing(session: Path) -> None:
    (session / "manifest.json").unlink()
    (found,) = find_cut_sessions(session.parent)
    assert "manifest.json: missing" in found.why
    done = recover(found.folder)
    manifest = read_manifest(done.folder)
    assert (manifest.kind, manifest.started_monotonic_s) == ("UNKNOWN", 1000.0)
    assert session.name.startswith(f"session_{manifest.started_utc:%Y%m%dT%H%M%SZ}")
    assert len(read_all(done.folder)[1]) == COUNT


def test_two_recoveries_of_one_session_do_not_meet(session: Path) -> None:
    """A window leaves one going on when it is closed, and the next window offers it again."""
    refused: list[str] = []

    def another(_bytes: int) -> None:
        if not refused:
            with pytest.raises(SessionError) as error:
                recover(session)
            refused.append(str(error.value))

    done = recover(session, on_bytes=another)
    assert refused == [f"{session}: is being recovered already; wait until that has ended"]
    assert checked(session, done) == (list(range(COUNT)), list(range(COUNT)))
    assert sorted(path.name for path in session.parent.iterdir()) == [session.name, done.folder.name]


def test_a_copy_that_is_recovered_again_still_tells_what_was_lost_before(session: Path) -> None:
    path = session / "frames.jsonl"
    lines = path.read_bytes().splitlines()
    path.write_bytes(b"\n".join([*lines[:20], b"garbage", *lines[25:70]]) + b"\n")
    first = recover(session)
    assert first.loss.rows == 10
    lines = (first.folder / "frames.jsonl").read_bytes().splitlines()
    (first.folder / "frames.jsonl").write_bytes(b"\n".join(lines[:-3]) + b"\n")
    second = recover(first.folder)
    assert (second.loss.rows, second.loss.origin) == (13, str(first.folder))
    assert second.loss.seconds == pytest.approx(13 / FPS, abs=0.01)
    assert any("line 21" in problem for problem in second.loss.problems)


def test_pictures_whose_rows_were_cut_off_are_kept_however_many(tmp_path: Path) -> None:
    """Two pictures a second: the rows of half a minute are gone, its pictures are not."""
    session = record(tmp_path, (tick_of(i, 1000.0 + i / 2) for i in range(COUNT)))
    lines = (session / "frames.jsonl").read_bytes().splitlines()
    (session / "frames.jsonl").write_bytes(b"\n".join(lines[:10]) + b"\n" + lines[10][:40])
    set_open(session)
    expected, done = expected_loss(session), recover(session)
    assert done.pictures == COUNT
    assert (done.loss.rows, done.loss.seconds) == (COUNT - 10, (COUNT - 10) / 2)
    assert (expected.frames, expected.pictures, expected.loss.rows) == (done.frames, done.pictures, done.loss.rows)


@pytest.mark.parametrize(
    ("delays_ms", "kept"),
    [
        (dict.fromkeys(range(30), 4_096_000), range(30, COUNT)),
        (dict.fromkeys(range(30, 43), 1_024), [*range(30), *range(60, COUNT)]),
        ({5: 4_096_000}, [*range(5), *range(30, COUNT)]),
        ({5: 10}, [*range(5), *range(30, COUNT)]),
    ],
)
def test_damaged_times_cost_their_pictures_and_what_builds_on_them(
    session: Path, delays_ms: dict[int, int], kept: Sequence[int]
) -> None:
    """A time that no row has is damaged; key pictures are 0, 30 and 60."""
    rewrite_video(session / "video_0000.mkv", delays_ms)
    done = recover(session)
    assert f"video_0000.mkv: {COUNT - len(kept)} damaged pictures left out" in done.loss.problems
    assert checked(session, done) == (list(range(COUNT)), list(kept))
    assert done.pictures == len(kept)


def test_without_rows_all_pictures_are_kept_also_after_a_pause(tmp_path: Path) -> None:
    session = record(tmp_path, (tick_of(i, 1000.0 + i / FPS + 8.0 * (i >= 40)) for i in range(COUNT)))
    (session / "frames.jsonl").write_bytes(b"")
    assert recover(session).pictures == COUNT


def test_a_disk_that_cannot_be_read_any_further_costs_only_what_comes_after(session: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def bad_sector(path: Path) -> Iterator[Any]:
        for line in lines_of(path):
            if path.name == "frames.jsonl" and line.number > 40:
                raise OSError(errno.EIO, os.strerror(errno.EIO))
            yield line

    monkeypatch.setattr(recovery, "lines_of", bad_sector)
    done = recover(session)
    assert done.frames == 40
    assert done.loss.problems == ("frames.jsonl: cannot be read further (Input/output error)",)


def test_a_picture_that_is_lost_with_its_row_takes_along_what_builds_on_it(session: Path) -> None:
    lost = COUNT // 2
    path = session / "frames.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:lost] + lines[lost + 1 :]))
    rows, pictures, _ = read_all(session)
    assert rows == pictures == [index for index in range(COUNT) if index != lost], "the row alone: its picture has come by"

    rewrite_video(session / "video_0000.mkv", without=lost)
    for folder in (session, recover(session).folder):
        rows, pictures, _ = read_all(folder)  # which looks that no picture is another one's
        assert rows == [index for index in range(COUNT) if index != lost]
        assert pictures[:lost] == list(range(lost))
        assert lost + 1 not in pictures


def test_a_session_that_is_being_recorded_is_left_alone(tmp_path: Path) -> None:
    writer = SessionWriter(QUICK, ABOUT, folder=tmp_path)
    writer.start()
    writer.put(tick_of(0, time.monotonic()))
    wait_for(lambda: writer.status().frames == 1)
    folder = writer.status().folder
    assert find_cut_sessions(tmp_path) == ()
    with pytest.raises(SessionError, match="being recorded"):
        recover(folder)
    assert writer.close()


def test_a_session_with_nothing_left_says_so_and_leaves_no_half_copy(session: Path) -> None:
    (session / "frames.jsonl").write_bytes(b"\x00" * 100)
    (session / "video_0000.mkv").write_bytes(b"\x00" * 1000)
    with pytest.raises(SessionError, match="nothing left to recover"):
        recover(session)
    assert [path.name for path in session.parent.iterdir()] == [session.name]


# --- damage at random


def damaged(session: Path, dice: random.Random) -> str:
    """Cut, flip, zero or scramble a random file of the session; says what was done."""
    path = dice.choice(sorted(session.iterdir()))
    data = bytearray(path.read_bytes())
    kind = dice.choice(("cut", "flip", "zero", "scramble", "repeat"))
    at = dice.randrange(len(data))
    span = min(len(data) - at, dice.choice((1, 16, 512, 4096)))
    if kind == "cut":
        del data[at:]
    elif kind == "flip":
        for _ in range(dice.choice((1, 4, 40))):
            data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)
    elif kind == "zero":
        data[at : at + span] = bytes(span)
    elif kind == "scramble":
        data[at : at + span] = dice.randbytes(span)
    else:
        data[at:at] = data[at : at + span]
    path.write_bytes(data)
    return f"{kind} {path.name} at {at}"


def run_case(whole: Path, folder: Path, seed: int) -> None:
    session = Path(shutil.copytree(whole, folder / whole.name))
    dice = random.Random(seed)
    what = [damaged(session, dice) for _ in range(dice.choice((1, 1, 2)))]
    before = fingerprint(session)
    try:
        rows, pictures, _ = read_all(session)
        done = recover(session)
    except SessionError as error:
        assert "\n" not in str(error), what
        assert "nothing left" in str(error) or "newer version" in str(error), (what, error)
    else:
        again, whole_pictures = checked(session, done)
        assert set(again) <= set(range(COUNT)), what
        assert set(rows) >= set(again), what
        assert len(whole_pictures) >= len(pictures) - 30, what
    assert fingerprint(session) == before, what
    shutil.rmtree(folder)


def test_damage_at_random_is_survived(whole: Path, tmp_path: Path) -> None:
    for seed in range(int(os.environ.get("LUMENPILOT_FUZZ", "15"))):
        run_case(whole, tmp_path / str(seed), seed)


# --- a process that is killed


def record_and_kill(folder: Path, after_s: float, fps: float = 60.0) -> int:
    """Record in another process and kill it; returns how many frames it said to have written."""
    child = subprocess.Popen([sys.executable, str(CHILD), str(folder), str(fps)], stdout=subprocess.PIPE, text=True)
    while child.stdout.readline() == "0\n":
        pass
    time.sleep(after_s)
    child.kill()
    rest = child.stdout.read()
    child.wait()
    child.stdout.close()
    whole_lines = rest[: rest.rfind("\n") + 1].splitlines()
    return int(whole_lines[-1]) if whole_lines else 0


def test_a_recording_that_is_killed_loses_no_written_row_and_half_a_second_at_most(tmp_path: Path) -> None:
    dice = random.Random(4)
    earlier = record(tmp_path, (tick_of(i, 1000.0 + i / FPS) for i in range(5)))
    before = fingerprint(earlier)
    for _ in range(int(os.environ.get("LUMENPILOT_KILLS", "2"))):
        written = record_and_kill(tmp_path, dice.uniform(0.3, 1.2))
        (found,) = find_cut_sessions(tmp_path)
        done = recover(found.folder)
        rows, pictures = checked(found.folder, done)
        assert rows == list(range(len(rows)))
        assert len(rows) >= written
        assert pictures == rows[: len(pictures)]
        assert (len(rows) - len(pictures)) / 60.0 <= 0.5
        assert done.loss.seconds <= 0.5
    assert fingerprint(earlier) == before


def test_a_note_is_added_to_a_session_that_has_ended(session: Path) -> None:
    path = session / "events.jsonl"
    path.write_bytes(path.read_bytes()[:-5])
    add_event(session, Event(1001.5, EventKind.NOTE, "kink here"))
    with SessionReader(session) as reader:
        assert [event.text for event in reader.events if event.kind is EventKind.NOTE] == ["kink here"]
        assert [problem for problem in reader.problems if "events" in problem] == ["events.jsonl: line 1: not valid JSON; skipped"]
    path.unlink()
    path.mkdir()
    with pytest.raises(SessionError, match="not kept"):
        add_event(session, Event(1001.5, EventKind.NOTE, "kink here"))


@contextmanager
def short_of_room(session: Path) -> Iterator[None]:
    """The disk takes twenty bytes more of the events."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, ((session / EVENTS).stat().st_size + 20, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_note_that_finds_no_room_leaves_nothing_of_itself(session: Path) -> None:
    before = (session / EVENTS).read_bytes()
    with short_of_room(session), pytest.raises(SessionError, match="the note was not kept"):
        add_event(session, Event(1001.0, EventKind.NOTE, "the tip touched the wall here"))
    assert (session / EVENTS).read_bytes() == before


def test_a_copy_that_cannot_be_written_is_one_line(session: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(SessionError, match=r"make room or choose another folder"):
        recover(session, tmp_path / "file")
