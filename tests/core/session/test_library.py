"""The library: sessions are found and summed up, broken ones too; the cache is never needed."""

import json
from pathlib import Path

from core.session.library import Cached, SummaryCache, find_sessions, first_summary, signature_of, whole_summary
from core.session.manifest import MANIFEST, Description, Event, EventKind, write_description
from core.session.reader import SessionReader
from core.session.writer import SessionWriter
from core.types import PoseState
from tests.core.session_data import ABOUT, QUICK, record, tick_of, wait_for


def make(folder: Path) -> Path:
    """Four rows: two in state D, two without a pose; a fault that came twice."""
    events = [Event(time_s, EventKind.FAULT, "camera lost") for time_s in (1000.5, 1001.0)]
    return record(folder, (tick_of(k, 1000.0 + k / 2, full=k < 2) for k in range(4)), events=events)


def whole(session: Path):
    with SessionReader(session) as reader:
        assert reader.wait(10.0)
        return whole_summary(reader)


def test_a_session_is_summed_up(tmp_path: Path) -> None:
    session = make(tmp_path / "study" / "monday")
    assert find_sessions(tmp_path) == [session]
    write_description(session, Description(operator="Ana", tags=("pilot",)))
    first = first_summary(session)
    assert (first.kind, first.rig, first.seconds, first.problem) == ("SIM", "twin", None, "")
    summary = whole(session)
    assert (summary.seconds, summary.without_pose, summary.faults) == (1.5, 2, {"camera lost": 2})
    assert dict(zip(PoseState, summary.states, strict=True)) == {"A": 0, "B": 0, "C": 0, "D": 2}
    assert summary.matches("ana #pil CAMERA twin")
    assert not summary.matches("ana ben")
    assert not summary.matches("#ana")


def test_broken_sessions_are_listed_with_their_reason(tmp_path: Path) -> None:
    session = make(tmp_path)
    content = json.loads((session / MANIFEST).read_text())
    path = session / MANIFEST
    for text, reason in (
        (json.dumps(content | {"closed": False}), f"it did not end properly; repair it with: session recover {session.name}"),
        (json.dumps(content | {"format": 9}), f"{path}: format 9 is of a newer version (this one knows 1); update the program"),
        ("{", f"{path}: damaged (not valid JSON)"),
    ):
        path.write_text(text)
        assert first_summary(session).problem == reason
    assert whole(session).problem == f"{path}: damaged (not valid JSON)", "and its rows are there"
    assert whole(session).seconds == 1.5
    path.unlink()
    assert first_summary(session).problem == f"{path}: missing"


def test_a_session_that_is_being_recorded_is_no_broken_one(tmp_path: Path) -> None:
    writer = SessionWriter(QUICK, ABOUT, folder=tmp_path, clock=lambda: 1000.0)
    writer.start()
    assert writer.put(tick_of(0, 1000.0))
    wait_for(lambda: writer.status().frames)
    (session,) = find_sessions(tmp_path)
    summary = first_summary(session)
    assert (summary.is_recording, summary.problem) == (True, "")
    write_description(session, Description(operator="Ana"))  # also meanwhile
    assert writer.close()
    after = first_summary(session)
    assert (after.is_recording, after.problem, after.description.operator) == (False, "", "Ana")


def test_the_cache_is_kept_and_nothing_depends_on_it(tmp_path: Path) -> None:
    session = record(tmp_path, [tick_of(0, 1000.0)])
    cached = Cached(signature_of(session), first_summary(session), b"jpeg")
    path = tmp_path / "cache" / "library.sqlite"
    SummaryCache(path).keep(cached)
    assert SummaryCache(path).read() == {session: cached}
    write_description(session, Description(operator="Ana"))
    assert signature_of(session) != cached.signature
    path.write_bytes(b"no database" * 500)
    assert SummaryCache(path).read() == {}
    for _ in range(2):  # the first removes the damaged file
        SummaryCache(path).keep(cached)
    assert SummaryCache(path).read() == {session: cached}
    nowhere = SummaryCache(session / MANIFEST / "library.sqlite")
    nowhere.keep(cached)
    assert nowhere.read() == {}
