"""The machine code of the compiled loops is kept whole, of just this version, or not at all."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from core.perception.compiled import store
from core.perception.compiled.store import is_whole, open_store

ROOT = Path(__file__).parents[3]
START = """
import sys
from pathlib import Path
from core.perception.compiled import jit
jit._compiler = jit._Compiler(Path(sys.argv[1]))
sys.path.insert(0, sys.argv[1])
import one
print(one.twice(2.0), sum(one.twice.stats.cache_hits.values()))
jit.finish()
"""
ONE = """
from numba import float64
from core.perception.compiled.jit import compiled

@compiled((float64,))
def twice(value):
    return 2.0 * value
"""


@pytest.fixture
def sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one loop to be compiled, and a cache of the user's own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "sources").mkdir()
    (tmp_path / "sources" / "one.py").write_text(ONE)
    return tmp_path / "sources"


def start(sources: Path) -> str:
    """The result of the loop, and how often its machine code was found."""
    command = [sys.executable, "-c", START, str(sources)]
    done = subprocess.run(
        command, cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False
    )
    return done.stdout.strip() or f"{done.returncode} {done.stderr[-600:]}"


def kept(folder: Path) -> list[Path]:
    return sorted(folder.glob("compiled-*"))


def test_what_was_compiled_is_found_again_and_of_another_version_it_is_not(sources: Path) -> None:
    assert [start(sources), start(sources)] == ["4.0 0", "4.0 1"]
    (first,) = kept(sources / "__pycache__")
    assert is_whole(first)
    (sources / "one.py").write_text(ONE.replace("2.0 *", "3.0 *"))
    assert [start(sources), start(sources)] == ["6.0 0", "6.0 1"]
    os.utime(first, (1e9, 1e9))  # nobody has used it for years
    assert start(sources) == "6.0 1"
    assert first not in kept(sources / "__pycache__")


def test_damaged_machine_code_is_compiled_anew(sources: Path) -> None:
    """A bit of it that is wrong ends the whole program, so none is run that is not as it was."""
    assert start(sources) == "4.0 0"
    (folder,) = kept(sources / "__pycache__")
    code = next(folder.rglob("*.nbc"))
    content = bytearray(code.read_bytes())
    content[len(content) // 2] ^= 16
    code.write_bytes(content)
    assert [start(sources), start(sources)] == ["4.0 0", "4.0 1"]


@pytest.mark.parametrize("damage", ["a bit", "a hole", "cut", "gone", "one more", "no seal"])
def test_whatever_is_damaged_is_seen_and_gone(sources: Path, damage: str) -> None:
    filled = open_store(sources)
    assert filled is not None
    content = bytearray(range(256)) * 16
    code = filled.folder / "one.nbc"
    code.write_bytes(content)
    filled.seal()
    (folder,) = kept(sources / "__pycache__")
    code = folder / code.name
    again = open_store(sources)
    assert again is not None
    assert again.name is None, "what is whole is used"
    middle = len(content) // 2
    if damage == "a bit":
        content[middle] ^= 16
    elif damage == "a hole":
        content[middle : middle + 512] = bytes(512)
    elif damage == "cut":
        del content[middle:]
    code.write_bytes(content)
    if damage == "gone":
        code.unlink()
    elif damage == "one more":
        (folder / "other.nbc").write_bytes(b"")
    elif damage == "no seal":
        (folder / store._SEAL).unlink()
    assert not is_whole(folder)
    empty = open_store(sources)
    assert empty is not None
    assert empty.name == folder, "to be compiled anew"
    assert list(empty.folder.iterdir()) == []
    assert not folder.exists()


def test_starts_at_once_all_end_well_and_leave_one(sources: Path) -> None:
    command = [sys.executable, "-c", START, str(sources)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    starts = [subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(3)]
    assert [one.communicate()[0].split()[0] for one in starts] == ["4.0"] * 3
    assert len(kept(sources / "__pycache__")) == 1
    assert start(sources) == "4.0 1"


def test_where_the_sources_cannot_be_written_it_is_the_users_and_what_lies_there_is_copied(
    sources: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Root may write anywhere, so it is asked whether it may."""
    filled = open_store(sources)
    assert filled is not None
    (filled.folder / "one.nbc").write_bytes(b"code")
    filled.seal()
    may = os.access
    beside = str(sources / "__pycache__")
    monkeypatch.setattr(os, "access", lambda path, mode: not str(path).startswith(beside) and may(path, mode))
    mine = open_store(sources)
    assert mine is not None
    assert mine.name is None
    assert mine.folder.parent == tmp_path / "cache" / "lumenpilot"
    assert (mine.folder / "one.nbc").read_bytes() == b"code"
    shutil.rmtree(beside)
    again = open_store(sources)
    assert again == mine, "and is used the next time"


def test_a_user_without_a_home_and_without_rights_goes_on_without(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_home(name: str) -> Path:
        raise RuntimeError("Could not determine home directory.")

    (sources / "__pycache__").write_text("no folder")
    monkeypatch.setattr(store, "user_cache_path", no_home)
    assert open_store(sources) is None


def test_a_disk_that_is_full_at_the_end_leaves_nothing_half_done(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> int:
        raise OSError(28, "No space left on device")

    filled = open_store(sources)
    assert filled is not None
    monkeypatch.setattr(Path, "write_text", full)
    filled.seal()
    assert kept(sources / "__pycache__") == []
