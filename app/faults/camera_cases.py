"""Faults 1 to 10: the camera, and perception that is late."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import cv2
import numpy as np

from app.faults.bench import FaultBench, open_bench
from app.faults.judge import Wanted, judge, mark
from app.faults.registry import Kit, Seen, fault
from core.control.faults import Cause
from core.control.modes import Mode
from core.types import Frame, Image

_TO_ADVISORY = (Mode.HOLD, Mode.ADVISORY)
_AT_ONCE = (Mode.ADVISORY,)
_LATE_S = 0.26
"""150 ms, a frame's period, and two turns."""


@fault(
    1,
    "camera unplugged",
    injected="the camera gives nothing any more",
    wanted="HOLD after 150 ms without a frame, DISARM after 500 ms",
)
def camera_unplugged(kit: Kit) -> Seen:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        bench.hooks.silent = True
        bench.run(0.8)
        causes = Cause.CAMERA_SILENT, Cause.CAMERA_LOST
        return judge(bench, start, Wanted(_TO_ADVISORY, causes, Cause.CAMERA_LOST, within_s=_LATE_S, blank=True))


@fault(
    2,
    "camera read blocks",
    injected="the camera's read waits for 1.5 s, the pilot's turns go on",
    wanted="HOLD, DISARM by the age as seen from outside the camera's thread; the window stays alive",
)
def read_blocks(kit: Kit) -> Seen:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        bench.hooks.read_s = 1.5
        bench.turn()
        bench.hooks.read_s = 0.0
        # the thread that reads is stuck, and shows no sign of life either
        causes = Cause.CAMERA_SILENT, Cause.CAMERA_LOST
        views = bench.views[start.views :]
        hung = [fault.cause for view in views for fault in view.active if fault.cause is Cause.WINDOW_HUNG]
        problems = ["the window stood still, too"] if hung else []
        return judge(
            bench, start, Wanted(_TO_ADVISORY, causes, Cause.CAMERA_LOST, within_s=_LATE_S, blank=True, alerts=()), *problems
        )


@fault(
    3,
    "frozen camera",
    injected="the same picture again and again, with fresh times",
    wanted="DISARM at the fifth identical picture",
)
def frozen(kit: Kit) -> Seen:
    with open_bench(kit) as bench:
        kept: list[Image] = []

        def freeze(frame: Frame) -> Frame:
            kept.append(frame.image)
            return replace(frame, image=kept[0])

        start = mark(bench.hand_over())
        bench.hooks.frame = freeze
        bench.run(0.6)
        problems = [] if len(kept) >= 5 else [f"only {len(kept)} pictures were given"]
        return judge(bench, start, Wanted(_AT_ONCE, (Cause.CAMERA_FROZEN,), Cause.CAMERA_FROZEN, blank=True), *problems)


@fault(
    4,
    "dropped frames",
    injected="first every 7th frame is lost, then every 3rd",
    wanted="warning above 10 % loss; above 20 % over 3 s HOLD, DISARM after 0.5 s",
)
def dropped(kit: Kit) -> Seen:
    with open_bench(kit, frames_per_s=25.0) as bench:
        every = 7

        def drop(frame: Frame) -> Frame | None:
            if frame.index % every == 0:
                bench.camera.lost += 1
                return None
            return frame

        start = mark(bench.hand_over())
        bench.hooks.frame = drop
        bench.until(lambda view: any(fault.cause is Cause.FRAMES_DROPPED for fault in view.active), 6.0)
        warned = bench.mode
        every = 3
        bench.until(lambda view: view.mode is Mode.ADVISORY, 6.0)
        problems = [] if warned is Mode.AUTONOMOUS else [f"a warning already led to {warned}"]
        causes = Cause.FRAMES_DROPPED, Cause.FRAMES_LOST, Cause.FRAMES_LOST_LONG
        return judge(bench, start, Wanted(_TO_ADVISORY, causes, Cause.FRAMES_LOST_LONG), *problems)


@fault(
    5,
    "wrong size or format",
    injected="pictures of half the size; then, armed anew, grey ones; then 16-bit ones",
    wanted="each rejected; DISARM",
)
def wrong_format(kit: Kit) -> Seen:
    changes = (
        lambda image: np.ascontiguousarray(image[::2, ::2]),
        lambda image: np.ascontiguousarray(image[..., 0]),
        lambda image: image.astype(np.uint16) * 257,
    )
    seen: Seen | None = None
    for number, change in enumerate(changes):
        part = Kit(kit.folder / str(number), kit.live)
        part.folder.mkdir()
        with open_bench(part) as bench:
            start = mark(bench.hand_over())
            bench.hooks.frame = partial(_changed, change=change)
            shown = len(bench.ticks)
            bench.run(0.3)
            odd = [tick for tick in bench.ticks[shown:] if tick.frame.image.dtype != np.uint8 or tick.frame.image.ndim != 3]
            problems = ["a picture that is none went on to window and recorder"] if odd else []
            wanted = Wanted(_AT_ONCE, (Cause.WRONG_FORMAT,), Cause.WRONG_FORMAT, blank=True)
            seen = judge(bench, start, wanted, *problems)
            if not seen.ok:
                break
    assert seen is not None
    return seen


@fault(
    6,
    "black, white",
    injected="all pixels 0; then, when the picture was well again, all pixels 255",
    wanted="HOLD at the third such picture",
)
def dark_and_bright(kit: Kit) -> Seen:
    found = []
    for level, cause in ((0, Cause.IMAGE_BLACK), (255, Cause.IMAGE_WHITE)):
        part = Kit(kit.folder / cause.name, kit.live)
        part.folder.mkdir()
        with open_bench(part) as bench:
            start = mark(bench.hand_over())

            def shade(frame: Frame, level: int = level) -> Frame:
                image = np.full_like(frame.image, level)
                image[0, 0] = 100 + frame.index % 50
                return replace(frame, image=image)

            bench.hooks.frame = shade
            bench.run(0.4)
            found.append(judge(bench, start, Wanted((Mode.HOLD,), (cause,), blank=True)))
    return _both(found)


@fault(
    7,
    "blur, occlusion, glare",
    injected="through the network: strong blur; a patch over the head; a white reflection over the head (in lock-step)",
    wanted="low confidence or a named reason: HOLD; the advice says why",
    quick=False,
)
def blurred(kit: Kit) -> Seen:
    found = []
    for name in ("blur", "patch", "glare"):
        part = Kit(kit.folder / name, kit.live)
        part.folder.mkdir()
        with open_bench(part, live=False, network=True) as bench:
            start = mark(bench.hand_over())
            place = _head(bench)
            bench.hooks.frame = partial(_spoilt, how=name, place=place)
            bench.run(0.4)
            views = bench.views[start.views :]
            causes = {fault.cause for view in views for fault in view.active} & {
                Cause.POOR_VIEW, Cause.CONFIDENCE_LOW, Cause.HEAD_LOST, Cause.HEAD_JUMP, Cause.OUTSIDE_VESSEL,
            }  # fmt: skip
            problems = [] if causes else [f"{name}: nothing was said against the picture"]
            seen = judge(
                bench,
                start,
                Wanted((Mode.HOLD,), tuple(sorted(causes, key=str)), blank=True, alternatives=(_TO_ADVISORY, _AT_ONCE)),
                *problems,
            )
            found.append(replace(seen, reaction=f"{name}: {seen.reaction}"))
    return _both(found)


def _head(bench: FaultBench) -> tuple[int, int]:
    """Where the head was seen last, in the picture."""
    scene = next(tick.scene for tick in reversed(bench.ticks) if tick.scene.path is not None)
    assert scene.path is not None
    x, y = scene.to_source(scene.path.head)
    return round(x), round(y)


def _changed(frame: Frame, change: Callable[[Image], Image]) -> Frame:
    return replace(frame, image=change(frame.image))


def _spoilt(frame: Frame, how: str, place: tuple[int, int]) -> Frame:
    image = frame.image.copy()
    if how == "blur":
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), 25.0), np.uint8)
        image[0, 0] = frame.index % 251
    else:
        cv2.circle(image, place, 70, (255, 255, 250) if how == "glare" else (120, 110, 100), -1)
    return replace(frame, image=image)


@fault(
    8,
    "camera moved",
    injected="the whole picture is shifted by 14 px",
    wanted="DISARM by the drift of the landmarks; no arming while it lasts",
)
def moved(kit: Kit) -> Seen:
    with open_bench(kit) as bench:
        bench.hand_over()
        bench.run(0.5)
        start = mark(bench)
        shift = np.array([[1, 0, 12], [0, 1, 7]], np.float32)

        def push(frame: Frame) -> Frame:
            size = frame.image.shape[1], frame.image.shape[0]
            shifted = cv2.warpAffine(frame.image, shift, size, borderMode=cv2.BORDER_REPLICATE)
            return replace(frame, image=np.asarray(shifted, np.uint8))

        def push_masks(*masks: np.ndarray) -> tuple[np.ndarray, ...]:
            return tuple(cv2.warpAffine(mask, shift, (mask.shape[1], mask.shape[0])) for mask in masks)

        bench.hooks.frame, bench.hooks.masks = push, push_masks  # type: ignore[assignment]
        bench.run(1.0)
        problems = [] if Cause.CAMERA_MOVED in bench.view.against_arming else ["it could be armed again"]
        wanted = Wanted(_AT_ONCE, (Cause.CAMERA_MOVED,), Cause.CAMERA_MOVED, blank=True)
        return judge(bench, start, wanted, *problems)


@fault(
    9,
    "stale perception (overload)",
    injected="understanding a frame takes 250 ms; then 800 ms",
    wanted="pose older than 150 ms: HOLD; older than 500 ms: DISARM",
)
def stale(kit: Kit) -> Seen:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        bench.hooks.perceive_s = 0.25
        bench.until(lambda view: view.mode is Mode.HOLD, 1.0)
        bench.hooks.perceive_s = 0.8
        bench.until(lambda view: view.mode is Mode.ADVISORY, 2.0)
        bench.hooks.perceive_s = 0.0
        wanted = Wanted(_TO_ADVISORY, (Cause.POSE_STALE, Cause.POSE_LOST), within_s=0.3, blank=True)
        return judge(bench, start, wanted)


@fault(
    10,
    "results out of order",
    injected="some pairs of frames come in the wrong order",
    wanted="the late one is dropped and counted; nothing else happens",
)
def out_of_order(kit: Kit) -> Seen:
    with open_bench(kit, frames_per_s=30.0) as bench:
        start = mark(bench.hand_over())
        kept: list[Frame] = []

        def shuffle(frame: Frame) -> Frame | None:
            if kept:
                bench.camera.waiting.append(kept.pop())
                return frame
            if frame.index % 8 == 0:
                kept.append(frame)
                return None
            return frame

        bench.hooks.frame = shuffle
        shown = len(bench.ticks)
        bench.run(1.2)
        indices = [tick.frame.index for tick in bench.ticks[shown:]]
        problems = [] if indices == sorted(indices) else ["a late frame went on to window and recorder"]
        problems += [] if bench.ticks[-1].dropped_frames > 0 else ["the late frames were not counted"]
        return judge(bench, start, Wanted((), (Cause.OUT_OF_ORDER,)), *problems)


def _both(found: list[Seen]) -> Seen:
    """Several observations of one fault as one."""
    return Seen(
        "; ".join(seen.reaction for seen in found),
        tuple(dict.fromkeys(text for seen in found for text in seen.alerts)),
        tuple(dict.fromkeys(text for seen in found for text in seen.events)),
        tuple(problem for seen in found for problem in seen.problems),
    )
