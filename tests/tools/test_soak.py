"""The soak's own tools: samples, flatness, a short run over the whole program."""

from __future__ import annotations

import errno
import json
import os
import signal
from collections.abc import Callable
from io import FileIO
from pathlib import Path
from typing import cast

import pytest

from core.devices import UserError
from tools.soak import ProcessSample, Soak, _SampleFile, flatness, names, run_soak, take_sample


def samples(count: int, grow_mb: float = 0.0, threads: int = 0, files: int = 0) -> list[ProcessSample]:
    """Every ten seconds; what grows does so evenly."""
    return [
        ProcessSample(10.0 * n, 400.0 + grow_mb * n, 12 + threads * n // count, 20 + files * n // count, 1, 50.0)
        for n in range(count)
    ]


@pytest.mark.parametrize(
    ("given", "flat"),
    [
        (samples(300), True),
        (samples(300, grow_mb=0.02), True),
        (samples(300, grow_mb=0.5), False),
        (samples(300, threads=5, files=5), True),
        (samples(300, threads=12), False),
        (samples(300, files=30), False),
        (samples(5), None),
        ([], None),
    ],
)
def test_flat_after_ten_minutes(given: list[ProcessSample], flat: bool | None) -> None:
    assert flatness(given).flat is flat


def test_what_comes_in_the_first_ten_minutes_is_warm_up() -> None:
    warm = [ProcessSample(10.0 * n, min(400.0, 200.0 + 4.0 * n), 12, 20, 1, 50.0) for n in range(300)]
    found = flatness(warm)
    assert (found.flat, found.warm_s) == (True, 600.0)


def test_a_sample_of_this_process() -> None:
    sample = take_sample(1.0)
    assert sample.memory_mb > 10.0
    assert sample.threads >= 1
    assert sample.files >= 3


def test_troubles_have_names_of_their_own() -> None:
    found = list(names())
    assert len(found) == len(set(found)) > 10


@pytest.mark.real_time
def test_a_short_soak_sends_nothing_unsafe_and_loses_nothing() -> None:
    soak = Soak(seed=1)
    soak.run(6.0, lambda now: now.watch.seen.goals < 200)
    summary = soak.summary()
    assert summary["unsafe_texts"] == []
    assert summary["records"]["lost"] == 0
    assert summary["packets"] > 20
    assert summary["rigs_opened"] >= 1


def test_samples_are_on_disk_while_the_soak_runs(tmp_path: Path) -> None:
    """One that breaks down after an hour has to tell what it saw until then."""
    out, taken = tmp_path / "soak.jsonl", samples(3)
    with pytest.raises(RuntimeError), _SampleFile(out) as file:
        file.follow(taken[:2])
        file.follow(taken)
        assert [json.loads(line)["time_s"] for line in out.read_text().splitlines()] == [0.0, 10.0, 20.0]
        raise RuntimeError
    assert len(out.read_text().splitlines()) == 3


class _FullDisk:
    """Takes so many bytes."""

    def __init__(self, room: int) -> None:
        self.room, self.data = room, b""

    def write(self, data: bytes) -> int:
        taken = data[: self.room]
        if not taken:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self.room -= len(taken)
        self.data += taken
        return len(taken)

    def close(self) -> None: ...


def test_a_disk_that_is_full_for_a_while_costs_no_line(tmp_path: Path) -> None:
    taken, disk = samples(3), _FullDisk(50)
    with _SampleFile(tmp_path / "soak.jsonl") as file:
        assert file._file is not None
        file._file.close()
        file._file = cast("FileIO", disk)
        file.follow(taken[:1])
        file.follow(taken[:2])
        assert file.problem == f"{tmp_path / 'soak.jsonl'}: cannot be written (No space left on device)"
        disk.room = 1000
        file.follow(taken)
        assert file.problem == ""
    assert [json.loads(line)["time_s"] for line in disk.data.splitlines()] == [0.0, 10.0, 20.0]


class _Soak(Soak):
    """Takes a sample and asks whether to go on, without a rig; Ctrl-C comes when it is asked."""

    interrupts = False

    def run(self, seconds: float, go_on: Callable[[Soak], bool]) -> None:
        self.tally.samples += samples(1)
        if self.interrupts:
            signal.raise_signal(signal.SIGINT)
        assert go_on(self) is not self.interrupts
        self._close()


@pytest.fixture
def soak(monkeypatch: pytest.MonkeyPatch) -> type[_Soak]:
    monkeypatch.setattr("tools.soak.Soak", _Soak)
    monkeypatch.setattr(_Soak, "interrupts", False)
    return _Soak


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux's full device")
@pytest.mark.usefixtures("soak")
def test_a_full_disk_costs_the_file_and_not_the_summary(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(UserError, match=r"^/dev/full: cannot be written .*; lines at its end are missing$"):
        run_soak(0.01, 0, Path("/dev/full"), true_masks=True, as_json=False)
    told = capsys.readouterr()
    assert told.out.startswith("OK after ")
    assert told.err.count("note: /dev/full: cannot be written (No space left on device); the soak goes on") == 1


def test_ctrl_c_tells_the_figures_so_far_and_is_no_verdict(
    soak: type[_Soak], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(soak, "interrupts", True)
    with pytest.raises(KeyboardInterrupt):
        run_soak(0.01, 0, tmp_path / "soak.jsonl", true_masks=True, as_json=False)
    assert capsys.readouterr().out.startswith("OK until it was interrupted after ")
    first, last = map(json.loads, (tmp_path / "soak.jsonl").read_text().splitlines())
    assert first["time_s"] == 0.0
    assert last["summary"]["interrupted"] is True
    monkeypatch.setattr(soak, "interrupts", False)
    assert run_soak(0.01, 0, tmp_path / "soak.jsonl", true_masks=True, as_json=True) == 0
    assert json.loads(capsys.readouterr().out)["interrupted"] is False


def test_a_file_that_cannot_be_written_is_told_before_the_hours(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="choose another --out"):
        run_soak(0.01, 0, tmp_path / "no folder" / "soak.jsonl", true_masks=True, as_json=True)
