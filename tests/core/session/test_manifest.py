"""What a session is about: in its manifest, changed beside it, and remembered for the next one."""

import errno
import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from core.config.models import Config
from core.program import program_id, program_line
from core.session import manifest as manifests
from core.session.manifest import (
    DESCRIPTION,
    MANIFEST,
    About,
    Description,
    SessionError,
    about_rig,
    new_manifest,
    read_manifest,
    remember_description,
    remembered_description,
    write_description,
)
from core.session.reader import SessionReader
from core.session.recovery import recover
from core.session.writer import SessionWriter
from tests.core.session_data import ABOUT, QUICK, record, tick_of

ANA = Description(operator="Ana", task="loop", condition="shared", phantom="silicone 3", notes="warm", tags=("pilot", "day 1"))


def about(kind: str, phantom: str, description: Description = ANA) -> Description:
    made = About(kind, "bench", phantom=phantom, description=description)
    return new_manifest(made, "id", datetime.now(UTC), 0.0, "lossy").description


def test_a_session_says_who_recorded_it_and_with_which_program(tmp_path: Path) -> None:
    writer = SessionWriter(QUICK, replace(ABOUT, description=Description(operator="Ben")), folder=tmp_path, clock=lambda: 1000.0)
    for description in (None, ANA):
        if description is not None:
            writer.describe(description)
        writer.start()
        assert writer.put(tick_of(0, 1000.0))
        writer.stop()
    assert writer.close()
    first, second = sorted((read_manifest(folder) for folder in tmp_path.iterdir()), key=lambda one: one.description.operator)
    assert (first.description, second.description) == (ANA, Description(operator="Ben"))
    assert first.program == program_line()
    assert {key: first.versions.get(key) for key in ("lumenpilot", "commit")} == {
        "lumenpilot": program_id()["version"],
        "commit": program_id().get("commit"),
    }


def test_the_twin_knows_its_phantom_and_elsewhere_the_operator_does() -> None:
    assert about("SIM", "tree").phantom == "tree"
    assert about("LIVE", "bench 2").phantom == "silicone 3"
    assert about("LIVE", "bench 2", Description()).phantom == "bench 2"
    assert about_rig(Config.model_validate({"twin": {"phantom": "tree"}}), "SIM", "twin").phantom == "tree"


def test_a_session_of_before_has_no_description(tmp_path: Path) -> None:
    session = record(tmp_path, [tick_of(0, 1000.0)])
    content = json.loads((session / MANIFEST).read_text())
    del content["description"], content["versions"]["lumenpilot"]
    (session / MANIFEST).write_text(json.dumps(content))
    with SessionReader(session) as reader:
        assert (reader.description, reader.problems) == (Description(), ())
        assert reader.manifest.program == ""


def test_a_description_is_changed_without_touching_what_was_recorded(tmp_path: Path) -> None:
    session = record(tmp_path, [tick_of(k, 1000.0 + k) for k in range(3)])
    before = {path.name: path.read_bytes() for path in session.iterdir()}
    write_description(session, ANA)
    assert {path.name: path.read_bytes() for path in session.iterdir() if path.name != DESCRIPTION} == before
    for folder in (session, recover(session).folder):  # it goes into a repaired copy
        with SessionReader(folder) as reader:
            assert (reader.description, reader.problems) == (ANA, ())


def test_a_description_that_cannot_be_read_hides_nothing(tmp_path: Path) -> None:
    writer = SessionWriter(QUICK, replace(ABOUT, description=ANA), folder=tmp_path, clock=lambda: 1000.0)
    writer.start()
    assert writer.put(tick_of(0, 1000.0))
    assert writer.close()
    session = next(tmp_path.iterdir())
    for text, problem in (
        ('{"operator": ', "damaged (not valid JSON)"),
        ('{"operator": 7}', "damaged (operator: Input should be a valid string)"),
        ('{"format": 2, "operator": {"name": "Ana"}}', "format 2 is of a newer version (this one knows 1); update the program"),
    ):
        (session / DESCRIPTION).write_text(text)
        with SessionReader(session) as reader:
            assert reader.description.operator == "Ana", "as the manifest has it"
            assert reader.problems == (f"{session / DESCRIPTION}: {problem}",)
    with pytest.raises(SessionError, match="newer version"):
        write_description(session, Description())
    assert "format" in (session / DESCRIPTION).read_text(), "what a newer version wrote is kept"


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    session = record(tmp_path, [tick_of(0, 1000.0)])
    monkeypatch.setattr(manifests, "write_atomic", refuse)
    with pytest.raises(SessionError) as caught:
        write_description(session, ANA)
    line = f"{session / DESCRIPTION}: cannot be written (Read-only file system); nothing was changed: make the folder writable"
    assert str(caught.value) == line
    assert not (session / DESCRIPTION).exists()


def test_what_is_remembered_is_of_no_single_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert remembered_description() == Description()
    remember_description(ANA)
    assert remembered_description() == Description(operator="Ana", task="loop", condition="shared", phantom="silicone 3")
    next(tmp_path.rglob(DESCRIPTION)).write_text("not JSON")
    assert remembered_description() == Description()
