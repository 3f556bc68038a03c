"""Files that are there as a whole or not at all."""

import errno
import os
import shutil
from pathlib import Path

import pytest

from core.files import sweep_unfinished, write_whole


@pytest.mark.parametrize("durable", [False, True])
def test_it_takes_the_old_ones_place_and_permissions_and_leaves_nothing_else(tmp_path: Path, durable: bool) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(b"old")
    path.chmod(0o640)
    write_whole(path, b"new", durable=durable)
    assert path.read_bytes() == b"new"
    assert path.stat().st_mode & 0o777 == 0o640
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    path, link = tmp_path / "kept" / "a.toml", tmp_path / "a.toml"
    path.parent.mkdir()
    link.symlink_to(path)
    write_whole(link, b"new", durable=True)
    assert link.is_symlink()
    assert path.read_bytes() == b"new"


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_disk_that_does_not_take_it_leaves_the_old_one_and_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(b"old")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    if call == "fsync":
        monkeypatch.setattr(os, "fsync", full)
    else:
        monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="No space left") as caught:
        write_whole(path, b"new", durable=True)
    assert caught.value.filename == str(path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_cannot_be_synced_is_no_failure_for_the_new_file_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def cannot(_: Path) -> None:
        raise OSError(errno.EINVAL, "Invalid argument")

    monkeypatch.setattr("core.files.sync_folder", cannot)
    write_whole(tmp_path / "a.toml", b"new", durable=True)
    assert (tmp_path / "a.toml").read_bytes() == b"new"


def test_where_permissions_cannot_be_set_it_is_written_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def not_ours(*_: object) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    path = tmp_path / "a.toml"
    path.write_bytes(b"old")
    monkeypatch.setattr(shutil, "copymode", not_ours)
    write_whole(path, b"new")
    assert path.read_bytes() == b"new"


def test_what_was_there_is_kept_beside_it_only_once_the_new_one_has_found_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, older = tmp_path / "a.toml", tmp_path / "a.older.toml"
    for text in (b"one", b"two", b"three"):
        write_whole(path, text, durable=True, older=older)
    assert (path.read_bytes(), older.read_bytes()) == (b"three", b"two")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_whole(path, b"four", durable=True, older=older)
    assert (path.read_bytes(), older.read_bytes()) == (b"three", b"two")


def test_only_what_was_left_of_its_own_files_is_swept(tmp_path: Path) -> None:
    own, foreign, young, folder = (tmp_path / f".{name}.part" for name in (f"{1:016x}", "holiday", f"{2:016x}", f"{3:016x}"))
    for path in (own, foreign, young):
        path.write_bytes(b"half of it")
    folder.mkdir()
    for path in (own, foreign, folder):
        os.utime(path, (1.0, 1.0))
    sweep_unfinished(tmp_path)
    assert not own.exists()
    assert foreign.exists() and young.exists() and folder.exists()
    sweep_unfinished(tmp_path / "absent")
