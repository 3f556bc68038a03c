"""Locks between processes, and what takes their place where there are none."""

import errno
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from core.locks import FolderLock, lock_file


def test_one_holds_it_several_share_it(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.touch()
    with path.open("rb") as one, path.open("rb") as other:
        lock_file(one.fileno(), is_shared=True)
        lock_file(other.fileno(), is_shared=True)
        with pytest.raises(BlockingIOError):
            lock_file(one.fileno())
    with path.open("rb") as one:
        lock_file(one.fileno())


@pytest.mark.parametrize(("code", "expected"), [(0, None), (errno.EACCES, BlockingIOError), (errno.EINVAL, OSError)])
def test_windows_locks_one_byte_far_behind_the_file(
    code: int, expected: type[OSError] | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def locking(handle: int, mode: int, count: int) -> None:
        asked.append((os.lseek(handle, 0, os.SEEK_CUR), mode, count))
        if code:
            raise OSError(code, "no")

    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(locking=locking, LK_NBLCK=2, LK_LOCK=1))
    with (tmp_path / "a").open("w+b") as file:
        file.write(b"abc")
        file.flush()
        if expected is None:
            lock_file(file.fileno(), waits=True)
        else:
            with pytest.raises(expected):
                lock_file(file.fileno())
        assert file.tell() == 3
    ((place, mode, count),) = asked
    assert (place > 2_000_000_000, mode, count) == (True, 2 if code else 1, 1)


def test_no_locks_at_all_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fcntl", None)
    with (tmp_path / "a").open("wb") as file, pytest.raises(OSError, match=os.strerror(errno.ENOLCK)):
        lock_file(file.fileno())


def test_a_folder_has_one_holder_until_it_is_released(tmp_path: Path) -> None:
    first, second = FolderLock(), FolderLock()
    assert first.take(tmp_path)
    assert first.take(tmp_path)
    assert not second.take(tmp_path)
    first.release()
    first.release()
    assert second.take(tmp_path)
    del second
    assert first.take(tmp_path), "one that is gone holds nothing"
    first.release()


def test_a_drive_without_locks_refuses_no_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_locks(_file: int, _kind: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", no_locks)
    first, second = FolderLock(), FolderLock()
    assert first.take(tmp_path)
    assert second.take(tmp_path)
