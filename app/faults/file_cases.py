"""Faults 36, 38, 39: disk, recorder, files that cannot be believed."""

from __future__ import annotations

import random
import shutil
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

from app.faults.bench import open_bench
from app.faults.judge import Wanted, judge, mark
from app.faults.registry import Kit, Seen, fault
from core.config import load_config
from core.control.faults import Cause
from core.errors import UserError
from core.session.manifest import EVENTS, FRAMES, MANIFEST
from core.session.reader import SessionReader
from core.session.recovery import recover
from core.session.video import FrameEncoder
from core.study.annotation_records import ImageRecord
from core.study.annotation_store import AnnotationStore

_DAMAGES = 24


@fault(
    36,
    "disk low, full",
    injected="the disk's free space falls to 5 %, then to nothing, while it is recorded and the program drives (in lock-step)",
    wanted="warning below 7 %; the recording stops visibly, what was written stays; driving is not touched",
)
def disk_full(kit: Kit) -> Seen:
    free = 50_000_000_000
    total = 100_000_000_000

    def usage(_path: object) -> tuple[int, int, int]:
        return total, total - free, free

    with (
        patch.object(shutil, "disk_usage", usage),
        open_bench(kit, live=False, record={"warn_free_share": 0.07, "stop_free_mb": 40.0}) as bench,
    ):
        start = mark(bench.hand_over())
        folder = bench.writer.status().folder
        free = 5_000_000_000
        warned = bench.wait_for(lambda: bool(bench.writer.status().warning))
        bench.run(0.1)
        free = 1_000_000
        stopped = bench.wait_for(lambda: bool(bench.writer.status().problem))
        bench.run(0.3)
        said = [alert.key for alert in bench.alerts[start.alerts :]]
        problems = [] if warned and Cause.DISK_LOW in said else ["no warning"]
        problems += [] if stopped and Cause.DISK_FULL in said else ["nothing said that the recording stopped"]
        problems += [] if not bench.writer.status().recording else ["the recording went on"]
        problem = bench.writer.status().problem
        assert folder is not None
        with SessionReader(folder) as reader:
            reader.wait(10.0)
            rows, closed = len(reader), reader.is_closed
        problems += [] if rows > 0 and closed else [f"of the session {rows} rows are left, closed: {closed}"]
        seen = judge(bench, start, Wanted((), ()), *problems)
        return replace(
            seen, reaction=f"goes on; {problem.partition(':')[0]}; {rows} frames kept", events=("session closed with the cause",)
        )


@fault(
    38,
    "encoder too slow",
    injected="the encoder does not return while pictures come; the queue takes 3 (in lock-step)",
    wanted="bounded queue; drops counted and shown; driving is not touched",
)
def slow_encoder(kit: Kit) -> Seen:
    encode = FrameEncoder.encode

    go_on = threading.Event()

    def slow(self: FrameEncoder, *arguments: object, **named: object) -> object:
        go_on.wait(20.0)
        return encode(self, *arguments, **named)  # type: ignore[arg-type]

    with open_bench(kit, live=False, record={"max_queue": 3}) as bench:
        start = mark(bench.hand_over())
        with patch.object(FrameEncoder, "encode", slow):
            bench.hooks.recorder_keeps_up = False
            bench.run(0.5)
            go_on.set()
            bench.wait_for(lambda: bench.writer.pictures_waiting == 0)
            bench.hooks.recorder_keeps_up = True
        bench.run(1.1)  # the next picture tells how many were dropped before it
        dropped = bench.writer.status().dropped
        problems = [] if dropped > 0 else ["nothing was counted as dropped"]
        seen = judge(bench, start, Wanted((), (Cause.RECORDER_BEHIND,)), *problems)
        more = () if any(event.startswith("frames dropped") for event in seen.events) else ("the drops are not in the session",)
        return replace(seen, reaction=f"goes on; {dropped} frames dropped and counted", problems=(*seen.problems, *more))


@fault(
    39,
    "malformed configuration, session, annotation",
    injected=f"{_DAMAGES} copies each of a configuration, a session and an annotation file: cut, zeroed, bits flipped",
    wanted="read, or refused by one line; the original is untouched; nothing else is ever raised",
)
def malformed(kit: Kit) -> Seen:
    draw = random.Random(39)
    with open_bench(Kit(kit.folder, False)) as bench:
        bench.run(0.2)
        bench.record()
        bench.run(0.5)
        bench.recorded()
        session = bench.writer.status().folder
    assert session is not None
    config = kit.folder / "user.toml"
    config.write_text('[safety]\nmin_confidence = 0.6\n[twin]\nphantom = "tree"\n', encoding="utf-8")
    store = kit.folder / "a.sqlite"
    with AnnotationStore(store) as kept:
        kept.add_image(ImageRecord("0" * 64, "a.png", 640, 480), 1000, 5)
    problems: list[str] = []
    tally = {"refused": 0, "read": 0}
    for number in range(_DAMAGES):
        work = kit.folder / f"try{number}"
        work.mkdir()
        for original, use in ((config, _read_config), (store, _read_store)):
            copy = work / original.name
            copy.write_bytes(_damaged(original.read_bytes(), draw))
            problems += _use(use, copy, tally)
        target = work / "session"
        target.mkdir()
        names = (MANIFEST, FRAMES, EVENTS, "video_0000.mkv")
        for name in names:
            (target / name).write_bytes((session / name).read_bytes())
        victim = target / draw.choice(names)
        victim.write_bytes(_damaged(victim.read_bytes(), draw))
        before = victim.read_bytes()
        problems += _use(_read_session, target, tally)
        problems += [] if victim.read_bytes() == before else [f"{victim.name} of a damaged session was changed"]
    return Seen(
        f"{tally['refused']} refused by one line, {tally['read']} read (what is damaged in them named)",
        events=("nothing is recorded meanwhile",),
        problems=tuple(dict.fromkeys(problems)),
    )


def _damaged(data: bytes, draw: random.Random) -> bytes:
    place, kind = draw.randrange(len(data)), draw.randrange(3)
    if kind == 0:
        return data[:place]
    if kind == 1:
        return data[:place] + bytes(16) + data[place + 16 :]
    flipped = np.frombuffer(data, np.uint8).copy()
    for _ in range(draw.choice((1, 1, 20))):
        flipped[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
    return flipped.tobytes()


def _use(read: Callable[[Path], object], path: Path, tally: dict[str, int]) -> list[str]:
    """What went wrong: an error that is not meant for people, or one of more than a line."""
    try:
        read(path)
    except UserError as error:
        tally["refused"] += 1
        return [] if "\n" not in str(error) else [f"more than a line about {path.name}"]
    except Exception as error:  # noqa: BLE001 - what must never happen is what this looks for
        return [f"{path.name}: {type(error).__name__} escaped"]
    tally["read"] += 1
    return []


def _read_config(path: Path) -> object:
    return load_config(path)


def _read_store(path: Path) -> object:
    with AnnotationStore(path, read_only=True) as store:
        return store.images(), store.annotations()


def _read_session(path: Path) -> object:
    with SessionReader(path) as reader:
        reader.wait(10.0)
        for place in range(len(reader)):
            reader.tick(place)
        events = reader.events
    recover(path, path.parent / "recovered")
    return events
