"""Faults 1 to 10: the camera, and perception that is late.

Faults 11 to 20, and 43: what perception says, and the model that it rests on.

Faults 21 to 28, 44 and 45: the servos and their line. Always over a pseudo-terminal, with the real driver in its own process.

Faults 29, 32, 37, 40: programs that get in each other's way, or are killed.

Faults 30, 33, 34, 35: window, hands, deadman, clock.

Faults 36, 38, 39: disk, recorder, files that cannot be believed.

Faults 31, 41, 42: what happens to the window's worker, to its end, and what its banner says.

The operator window on the twin, driven without a hand: for what happens to a window, its threads and its end.
"""

from __future__ import annotations

import json
import math
import os
import pickle
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import cv2
import numpy as np
from PySide6.QtCore import QTimer

from app.operator.engine_thread import EnginePhase
from app.operator.rig_engine import EngineMaker
from core.annotation.store import AnnotationStore, ImageRecord
from core.config.models import Config, PerceptionConfig, SegmentationConfig, load_config
from core.config.safety import ServosConfig
from core.control.alerts import ALERTS, Note
from core.control.engine import Perceive
from core.control.faults import Cause
from core.control.gate import Source
from core.control.health import ModelReport
from core.control.modes import Act, Mode
from core.control.motion import AT_REST, Jog
from core.control.pilot import PERIOD_S
from core.devices import UserError
from core.perception.model_file import INFO, WEIGHTS, ModelError, load_network, model_folder, read_model_info, sha256_of
from core.perception.pipeline import open_pipeline
from core.perception.pose import classify
from core.perception.segmentation import Segmenter
from core.session.manifest import EVENTS, FRAMES, MANIFEST, EventKind, read_manifest
from core.session.reader import SessionReader
from core.session.recovery import find_cut_sessions, recover
from core.session.video import FrameEncoder
from core.types import Frame, Image, Point, Reason, Refusal, Scene
from hardware.preflight.model_checks import judge as judge_model
from hardware.rig import RigKind, kind_of
from hardware.servos.bus_ipc import BusPhase, BusStatus
from hardware.servos.dynamixel_port import WrongServo
from hardware.servos.servo_robot import ServoRobot
from hardware.twin.servos.bus import SoftServoBus
from hardware.twin.servos.device import OVERLOAD_BIT, SoftServo
from hardware.twin.world import TwinWorld
from tools.fault_campaign.bench import FaultBench, Probability, open_bench
from tools.fault_campaign.children import KEY, MODULE
from tools.fault_campaign.registry import CampaignError, ExpectedReaction, Kit, Observation, fault, judge, mark

if TYPE_CHECKING:
    from app.operator.window import OperatorWindow


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
def camera_unplugged(kit: Kit) -> Observation:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        bench.hooks.silent = True
        bench.run(0.8)
        causes = Cause.CAMERA_SILENT, Cause.CAMERA_LOST
        return judge(bench, start, ExpectedReaction(_TO_ADVISORY, causes, Cause.CAMERA_LOST, within_s=_LATE_S, blank=True))


@fault(
    2,
    "camera read blocks",
    injected="the camera's read waits for 1.5 s, the pilot's turns go on",
    wanted="HOLD, DISARM by the age as seen from outside the camera's thread; the window stays alive",
)
def read_blocks(kit: Kit) -> Observation:
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
            bench,
            start,
            ExpectedReaction(_TO_ADVISORY, causes, Cause.CAMERA_LOST, within_s=_LATE_S, blank=True, alerts=()),
            *problems,
        )


@fault(
    3,
    "frozen camera",
    injected="the same picture again and again, with fresh times",
    wanted="DISARM at the fifth identical picture",
)
def frozen(kit: Kit) -> Observation:
    with open_bench(kit) as bench:
        kept: list[Image] = []

        def freeze(frame: Frame) -> Frame:
            kept.append(frame.image)
            return replace(frame, image=kept[0])

        start = mark(bench.hand_over())
        bench.hooks.frame = freeze
        bench.run(0.6)
        problems = [] if len(kept) >= 5 else [f"only {len(kept)} pictures were given"]
        return judge(bench, start, ExpectedReaction(_AT_ONCE, (Cause.CAMERA_FROZEN,), Cause.CAMERA_FROZEN, blank=True), *problems)


@fault(
    4,
    "dropped frames",
    injected="first every 7th frame is lost, then every 3rd",
    wanted="warning above 10 % loss; above 20 % over 3 s HOLD, DISARM after 0.5 s",
)
def dropped(kit: Kit) -> Observation:
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
        return judge(bench, start, ExpectedReaction(_TO_ADVISORY, causes, Cause.FRAMES_LOST_LONG), *problems)


@fault(
    5,
    "wrong size or format",
    injected="pictures of half the size; then, armed anew, grey ones; then 16-bit ones",
    wanted="each rejected; DISARM",
)
def wrong_format(kit: Kit) -> Observation:
    changes = (
        lambda image: np.ascontiguousarray(image[::2, ::2]),
        lambda image: np.ascontiguousarray(image[..., 0]),
        lambda image: image.astype(np.uint16) * 257,
    )
    seen: Observation | None = None
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
            wanted = ExpectedReaction(_AT_ONCE, (Cause.WRONG_FORMAT,), Cause.WRONG_FORMAT, blank=True)
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
def dark_and_bright(kit: Kit) -> Observation:
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
            found.append(judge(bench, start, ExpectedReaction((Mode.HOLD,), (cause,), blank=True)))
    return _both(found)


@fault(
    7,
    "blur, occlusion, glare",
    injected="through the network: strong blur; a patch over the head; a white reflection over the head (in lock-step)",
    wanted="low confidence or a named reason: HOLD; the advice says why",
    quick=False,
)
def blurred(kit: Kit) -> Observation:
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
                ExpectedReaction((Mode.HOLD,), tuple(sorted(causes, key=str)), blank=True, alternatives=(_TO_ADVISORY, _AT_ONCE)),
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
def moved(kit: Kit) -> Observation:
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
        wanted = ExpectedReaction(_AT_ONCE, (Cause.CAMERA_MOVED,), Cause.CAMERA_MOVED, blank=True)
        return judge(bench, start, wanted, *problems)


@fault(
    9,
    "stale perception (overload)",
    injected="understanding a frame takes 250 ms; then 800 ms",
    wanted="pose older than 150 ms: HOLD; older than 500 ms: DISARM",
)
def stale(kit: Kit) -> Observation:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        bench.hooks.perceive_s = 0.25
        bench.until(lambda view: view.mode is Mode.HOLD, 1.0)
        bench.hooks.perceive_s = 0.8
        bench.until(lambda view: view.mode is Mode.ADVISORY, 2.0)
        bench.hooks.perceive_s = 0.0
        wanted = ExpectedReaction(_TO_ADVISORY, (Cause.POSE_STALE, Cause.POSE_LOST), within_s=0.3, blank=True)
        return judge(bench, start, wanted)


@fault(
    10,
    "results out of order",
    injected="some pairs of frames come in the wrong order",
    wanted="the late one is dropped and counted; nothing else happens",
)
def out_of_order(kit: Kit) -> Observation:
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
        return judge(bench, start, ExpectedReaction((), (Cause.OUT_OF_ORDER,)), *problems)


def _both(found: list[Observation]) -> Observation:
    """Several observations of one fault as one."""
    return Observation(
        "; ".join(seen.reaction for seen in found),
        tuple(dict.fromkeys(text for seen in found for text in seen.alerts)),
        tuple(dict.fromkeys(text for seen in found for text in seen.events)),
        tuple(problem for seen in found for problem in seen.problems),
    )


_Two = tuple[Probability, Probability]
_SEEN, _NOT = np.float32(0.99), np.float32(0.01)


@fault(
    11,
    "NaN or infinity from network or fit",
    injected="one pose with theta = NaN; then the network gives NaN in a part of the picture for good",
    wanted="discarded: HOLD; three in a row: DISARM",
)
def not_finite(kit: Kit) -> Observation:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        left = 1

        def spoil(scene: Scene) -> Scene:
            nonlocal left
            left -= 1
            return replace(scene, pose=replace(scene.pose, theta_deg=math.nan)) if left >= 0 and scene.pose is not None else scene

        bench.hooks.scene = spoil
        bench.until(lambda view: view.mode is Mode.AUTONOMOUS and left < -2, 1.0)
        bench.hooks.masks = lambda vessel, robot: (_perception_cases_spoilt(vessel), robot)
        bench.run(0.5)
        causes = Cause.NOT_FINITE, Cause.NOT_FINITE_REPEATED
        wanted = ExpectedReaction((Mode.HOLD, Mode.AUTONOMOUS, *_TO_ADVISORY), causes, Cause.NOT_FINITE_REPEATED, blank=True)
        return judge(bench, start, wanted)


def _perception_cases_spoilt(probability: Probability) -> Probability:
    """With numbers that are none in the middle, where geometry meets them."""
    spoilt, (height, width) = probability.copy(), probability.shape
    spoilt[height // 3 : 2 * height // 3, width // 4 : 3 * width // 4] = np.nan
    return spoilt


@fault(12, "head lost", injected="the robot's mask is empty", wanted="HOLD at the third frame, DISARM after 0.5 s")
def head_lost(kit: Kit) -> Observation:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        bench.hooks.masks = lambda vessel, robot: (vessel, np.full_like(robot, _NOT))
        bench.run(0.8)
        causes = Cause.HEAD_LOST, Cause.HEAD_LOST_LONG
        return judge(bench, start, ExpectedReaction(_TO_ADVISORY, causes, Cause.HEAD_LOST_LONG, within_s=0.32, blank=True))


@fault(13, "several robots", injected="a second robot of the same size is put into the mask", wanted="DISARM")
def several_robots(kit: Kit) -> Observation:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())

        def double(vessel: Probability, robot: Probability) -> _Two:
            other = robot[::-1]
            return np.maximum(vessel, vessel[::-1]), np.maximum(robot, other)

        bench.hooks.masks = double
        bench.run(0.3)
        return judge(bench, start, ExpectedReaction(_AT_ONCE, (Cause.SEVERAL_ROBOTS,), Cause.SEVERAL_ROBOTS, blank=True))


@fault(14, "robot outside vessel", injected="the vessel's mask is shifted by 80 px", wanted="DISARM")
def outside(kit: Kit) -> Observation:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())

        def cut(vessel: Probability, robot: Probability) -> _Two:
            return np.where(robot > 0.5, _NOT, np.roll(vessel, 80, axis=0)), robot

        bench.hooks.masks = cut
        bench.run(0.3)
        return judge(bench, start, ExpectedReaction(_AT_ONCE, (Cause.OUTSIDE_VESSEL,), Cause.OUTSIDE_VESSEL, blank=True))


@fault(
    15,
    "branch ambiguity",
    injected="a symmetric Y; the branch to the destination is cut off, so that no route decides",
    wanted="HOLD, and the alert asks for a destination",
)
def ambiguous(kit: Kit) -> Observation:
    with open_bench(kit) as bench:
        vessel, robot, cut = _symmetric_y()
        bench.hooks.masks = lambda v, r: (vessel, robot)
        start = mark(bench.hand_over(target=(560.0, 103.0)))
        bench.hooks.masks = lambda v, r: (cut, robot)
        bench.run(0.3)
        text = ALERTS[Cause.BRANCH_UNCLEAR].what_to_do
        problems = [] if "destination" in text else ["the alert does not ask for a destination"]
        wanted = ExpectedReaction((Mode.HOLD,), (Cause.BRANCH_UNCLEAR,), blank=True)
        return judge(bench, start, wanted, *problems)


def _symmetric_y() -> tuple[Probability, Probability, Probability]:
    """Vessel, robot up to the fork, and the vessel with both branches cut off; symmetric to the pixel."""
    fork = (320.0, 240.0)
    ends = ((0.0, 240.0), (600.0, 80.0), (600.0, 400.0))
    vessel = np.max([_tube(fork, end, 20.0) for end in ends], axis=0)
    cut = vessel.copy()
    cut[:, 460:] = _NOT
    return vessel, _tube((-20.0, 240.0), fork, 5.0), cut


def _tube(start: Point, end: Point, radius_px: float) -> Probability:
    y, x = np.mgrid[:480, :640].astype(float)
    (x0, y0), (dx, dy) = start, (end[0] - start[0], end[1] - start[1])
    along = np.clip(((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy), 0.0, 1.0)
    inside = np.hypot(x - x0 - along * dx, y - y0 - along * dy) <= radius_px
    return np.asarray(np.where(inside, _SEEN, _NOT), np.float32)


@fault(
    16,
    "pose jump",
    injected="the head is found 70 px further back from one frame to the next",
    wanted="rejected, HOLD",
)
def jump(kit: Kit) -> Observation:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())

        def shorten(vessel: Probability, robot: Probability) -> _Two:
            columns = np.flatnonzero((robot > 0.5).any(axis=0))
            short = robot.copy()
            short[:, columns[-1] - 70 :] = _NOT
            return vessel, short

        bench.hooks.masks = shorten
        bench.run(0.3)
        # a head that stays where it was found anew is believed after a while
        stays = ((Mode.HOLD, Mode.AUTONOMOUS),)
        return judge(bench, start, ExpectedReaction((Mode.HOLD,), (Cause.HEAD_JUMP,), blank=True, alternatives=stays))


@fault(
    17,
    "state chatter",
    injected="the robot swings by 1 px about the threshold of state A, from frame to frame",
    wanted="the state that is shown does not change: hysteresis and dwell",
)
def chatter(kit: Kit) -> Observation:
    with open_bench(kit) as bench:
        frames = 0

        def swing(vessel: Probability, robot: Probability) -> _Two:
            nonlocal frames
            frames += 1
            tube, thread = np.full_like(vessel, _NOT), np.full_like(robot, _NOT)
            cv2.line(tube, (0, 240), (639, 240), float(_SEEN), 80)
            y = 246 if frames % 2 else 245
            cv2.line(thread, (0, y), (300, y), float(_SEEN), 10)
            return tube, thread

        bench.hooks.masks = swing
        start = mark(bench.hand_over(target=(600.0, 240.0)))
        before = len(bench.ticks)
        bench.run(1.0)
        poses = [tick.scene.pose for tick in bench.ticks[before:] if tick.scene.pose is not None]
        limits = bench.config.perception.pose
        raw = [classify(pose.c_head_px, pose.c_tail_px, pose.theta_deg, limits) for pose in poses]
        raw_changes, changes = (
            sum(a is not b for a, b in zip(row, row[1:], strict=False)) for row in (raw, [p.state for p in poses])
        )
        problems = [] if raw_changes > 5 else [f"the bare thresholds changed the state {raw_changes} times only"]
        problems += [f"the state that is shown changed {changes} times"] if changes > 0 else []
        seen = judge(bench, start, ExpectedReaction((), ()), *problems)
        return replace(seen, reaction=f"goes on; {raw_changes} changes by the bare thresholds, {changes} shown")


# ---- the model


@fault(
    18,
    "model missing, truncated, bit-flipped",
    injected="a copy of the model: a file gone, cut in half, one bit flipped",
    wanted="its hash tells: refuses to arm; the program opens all the same",
)
def damaged_model(kit: Kit) -> Observation:
    found = []
    for damage in ("missing", "cut", "flipped"):
        folder = Path(shutil.copytree(model_folder("default"), kit.folder / damage / "model"))
        for path in sorted(folder.glob("*.onnx")):
            data = bytearray(path.read_bytes())
            path.unlink()
            if damage != "missing":
                data[len(data) // 2] ^= 1
                path.write_bytes(data[: len(data) // 2] if damage == "cut" else data)
        found.append(_unfit(kit, folder, damage))
    return _both(found)


def _unfit(kit: Kit, folder: Path, name: str) -> Observation:
    """The rig is opened with a model that is not fit, and the operator tries to arm."""
    settings = SegmentationConfig(model=str(folder), threads=1)
    perceive, report = EngineMaker()._perception(PerceptionConfig(segmentation=settings))
    part = Kit(kit.folder / name / "sessions", kit.live)
    part.folder.mkdir(parents=True)
    with open_bench(part, model=report, perceive=perceive) as bench:
        bench.run(0.5)
        bench.switch_on()
        start = mark(bench)
        bench.pilot.ask(Act.ARM)
        bench.run(1.3)
        problems = [] if not report.ok else ["the model passed for whole"]
        problems += [] if bench.ticks else ["there are no pictures"]
        problems += [] if Cause.MODEL_UNFIT in bench.view.against_arming else ["it could be armed"]
        # it was active before the mark: the session begins with it
        seen = judge(bench, start, ExpectedReaction((), (Cause.MODEL_UNFIT,)), *problems)
        return replace(seen, reaction=f"{name}: refuses to arm, {len(bench.ticks)} pictures shown" if seen.ok else seen.reaction)


class _Canary:
    """What a malicious file would run when it is unpickled."""

    def __init__(self, path: str) -> None:
        self._path = path

    def __reduce__(self) -> tuple[object, tuple[str, str]]:
        return open, (self._path, "w")


@fault(
    19,
    "malicious weights",
    injected="the weights are a pickle that runs code when it is loaded, and the manifest vouches for it",
    wanted="refused: nothing but safetensors and ONNX is read, and nothing runs",
)
def malicious(kit: Kit) -> Observation:
    canary = kit.folder / "ran"
    folder = Path(shutil.copytree(model_folder("default"), kit.folder / "model"))
    (folder / WEIGHTS).write_bytes(pickle.dumps(_Canary(str(canary))))
    for path in folder.glob("*.onnx"):
        path.write_bytes((folder / WEIGHTS).read_bytes())
    info = json.loads((folder / INFO).read_text(encoding="utf-8"))
    info["weights_sha256"] = info["onnx_sha256"] = sha256_of(folder / WEIGHTS)
    info["onnx_int8_sha256"] = None
    (folder / INFO).write_text(json.dumps(info), encoding="utf-8")
    problems = []
    try:
        load_network(folder)
        problems.append("the weights were loaded")
    except ModelError:
        pass
    seen = _unfit(kit, folder, "pickle")
    problems += ["the code in the file ran"] if canary.exists() else []
    return replace(seen, problems=(*seen.problems, *problems), reaction="refused, nothing ran; refuses to arm")


@fault(
    20,
    "wrong model",
    injected="the network's two outputs are swapped; the verdict of the preflight's self-test goes to the pilot",
    wanted="the golden picture tells: refuses to arm",
)
def wrong_model(kit: Kit) -> Observation:
    plain = Config().perception
    world = TwinWorld(Config().twin, perception=plain)
    world.insert(70.0)
    masks = world.picture(world.physics.robot_points_mm())
    pipeline = open_pipeline(plain)
    sight = pipeline._single

    class Swapped(Segmenter):
        engine = "swapped"

        def __call__(self, image: Image) -> _Two:
            vessel, robot = sight.segment(image)
            return robot, vessel

    pipeline._single = replace(sight, segment=Swapped())
    scene = pipeline.perceive_single(world.frame())
    info = read_model_info(model_folder("default"))
    check = judge_model("self-test", info, "swapped", scene, world.truth(), (masks.vessel, masks.robot))
    report = ModelReport(check.ok, check.detail)
    with open_bench(kit, model=report) as bench:
        bench.run(0.5)
        bench.switch_on()
        start = mark(bench)
        bench.pilot.ask(Act.ARM)
        bench.run(1.3)
        problems = [] if not check.ok and "swapped" in check.detail else [f"the self-test says: {check.detail}"]
        problems += [] if Cause.MODEL_UNFIT in bench.view.against_arming else ["it could be armed"]
        seen = judge(bench, start, ExpectedReaction((), (Cause.MODEL_UNFIT,)), *problems)
        return replace(seen, reaction=f"refuses to arm: {check.detail}")


@fault(
    43,
    "picture of an unknown kind",
    injected="perception says that the pictures are unlike all that the model knows: three of them, then all",
    wanted="HOLD at the first, and on again; then DISARM",
)
def unknown_kind(kit: Kit) -> Observation:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        left = 3
        refusal = Refusal(Reason.UNLIKE_TRAINING, "distance 1.30 from the pictures that it knows (at most 1.00)")

        def unlike(scene: Scene) -> Scene:
            nonlocal left
            left -= 1
            return replace(scene, pose=None, refusal=refusal) if left >= 0 else scene

        bench.hooks.scene = unlike
        bench.until(lambda view: view.mode is Mode.AUTONOMOUS and left < -2, 1.0)
        bench.hooks.scene = lambda scene: replace(scene, pose=None, refusal=refusal)
        bench.run(1.0)
        causes = Cause.UNKNOWN_KIND, Cause.POSE_LOST
        wanted = ExpectedReaction((Mode.HOLD, Mode.AUTONOMOUS, *_TO_ADVISORY), causes, Cause.POSE_LOST, within_s=0.1, blank=True)
        return judge(bench, start, wanted)


_DISARM, _STOP, _HELD = (Mode.ADVISORY,), (Mode.STOPPED,), (Mode.HOLD, Mode.ADVISORY)
_ADVANCE = 5
_CARRIED_TICKS_S = 1000.0
"""Some 10 mm/s of a joint."""


def _line(bench: FaultBench) -> SoftServoBus:
    assert bench.bus is not None
    return bench.bus


def _status(bench: FaultBench) -> BusStatus | None:
    return bench.robot.bus_status() if isinstance(bench.robot, ServoRobot) else None


def _servo_fault(
    kit: Kit,
    inject: Callable[[FaultBench], object],
    path: tuple[Mode, ...],
    cause: Cause,
    *more: Cause,
    alternatives: tuple[tuple[Mode, ...], ...] = (),
    release: Callable[[FaultBench], object] = lambda bench: None,
    **options: Any,
) -> Observation:
    """Hand over, break something, wait until the pilot has left autonomy; the servos must hold and nothing may be sent any more.

    `release` ends what moves the servos from outside.
    """
    with open_bench(kit, live=True, **options) as bench:
        start = mark(bench.hand_over())
        inject(bench)
        bench.until(lambda view: view.mode is path[-1])
        release(bench)
        bench.run(0.4)
        wanted = ExpectedReaction(path, (cause, *more), cause, alternatives=((Mode.HOLD, *path), *alternatives), may_hold=True)
        return judge(bench, start, wanted, *_still(bench))


def _still(bench: FaultBench) -> list[str]:
    """Nothing is armed any more, and the servos stand."""
    status = _status(bench)
    problems = ["the bus process is still armed"] if status is not None and status.phase is BusPhase.ARMED else []
    before = _line(bench).positions_mm()
    bench.run(0.3)
    after = _line(bench).positions_mm()
    moved_mm = max(abs(a - b) for a, b in zip(before, after, strict=True))
    return problems + ([f"a servo still moves, by {moved_mm:.2f} mm"] if moved_mm > 0.05 else [])


@fault(
    21,
    "one servo silent",
    injected="the advance servo hears and obeys, but does not answer",
    wanted="after 3 misses DISARM of all seven",
    quick=False,
)
def silent(kit: Kit) -> Observation:
    return _servo_fault(kit, lambda bench: _line(bench).faults.mute(_ADVANCE), _DISARM, Cause.SERVO_SILENT)


@fault(
    22,
    "CRC, garbage, short packet",
    injected="one damaged answer of each kind; then forty with a wrong CRC",
    wanted="one retry each, at most a short hold; more than 5 in a second: DISARM; nothing breaks",
    quick=False,
)
def noise(kit: Kit) -> Observation:
    with open_bench(kit, live=True) as bench:
        start = mark(bench.hand_over())
        faults = _line(bench).faults
        spoils: tuple[Callable[[], object], ...]
        spoils = (partial(faults.crc, 1), partial(faults.garbage, 24), partial(faults.short, 3), partial(faults.truncate, 2))
        for spoil in spoils:
            spoil()
            bench.run(0.45)
        single = bench.mode
        faults.crc(40)
        bench.until(lambda view: view.mode is Mode.ADVISORY)
        bench.run(0.3)
        problems = [] if single in {Mode.AUTONOMOUS, Mode.HOLD} else [f"single bad packets already led to {single}"]
        status = _status(bench)
        problems += [] if status is not None and status.line.retries >= 3 else ["there was no retry"]
        return judge(
            bench,
            start,
            ExpectedReaction(_DISARM, (Cause.BUS_NOISE,), Cause.BUS_NOISE, alternatives=(_HELD,), may_hold=True),
            *problems,
            *_still(bench),
        )


@fault(
    23,
    "overload alert",
    injected="a servo raises its hardware error bit for overload",
    wanted="register 70 is read: STOP",
    quick=False,
)
def overload(kit: Kit) -> Observation:
    return _servo_fault(kit, lambda bench: _line(bench).stir(3, lambda servo: servo.alert(OVERLOAD_BIT)), _STOP, Cause.SERVO_ALERT)


@fault(
    24,
    "over-temperature, under-voltage",
    injected="a servo is warmed up, then heated; on another bench the supply sags, then falls",
    wanted="first a warning, then DISARM, before the servo shuts itself down",
    quick=False,
)
def supply(kit: Kit) -> Observation:
    def drop(servo: SoftServo, volts: float) -> None:
        servo.supply_v = volts

    def heat(bench: FaultBench) -> None:
        _line(bench).stir(2, lambda servo: servo.heat(67.0))
        _expect(bench, Cause.WARM)
        _line(bench).stir(2, lambda servo: servo.heat(72.0))

    def sag(bench: FaultBench) -> None:
        for supply_v in (10.8, 10.3):
            for joint in bench.config.servos.joints:
                _line(bench).stir(joint.id, partial(drop, volts=supply_v))
            if supply_v > 10.5:
                _expect(bench, Cause.VOLTAGE_SAGS)

    return _on_benches(
        kit,
        ("heat", lambda part: _servo_fault(part, heat, _DISARM, Cause.HOT, Cause.WARM)),
        ("supply", lambda part: _servo_fault(part, sag, _DISARM, Cause.VOLTAGE_LOW, Cause.VOLTAGE_SAGS)),
    )


def _on_benches(kit: Kit, *parts: tuple[str, Callable[[Kit], Observation]]) -> Observation:
    """Several kinds of a fault, each on a bench of its own, told as one."""
    found = []
    for name, inject in parts:
        part = Kit(kit.folder / name, kit.live)
        part.folder.mkdir()
        seen = inject(part)
        found.append(replace(seen, reaction=f"{name}: {seen.reaction}"))
    return Observation(
        "; ".join(seen.reaction for seen in found),
        tuple(text for seen in found for text in seen.alerts),
        tuple(dict.fromkeys(text for seen in found for text in seen.events)),
        tuple(text for seen in found for text in seen.problems),
    )


def _expect(bench: FaultBench, cause: Cause) -> None:
    """A warning comes, and the program drives on."""
    if not bench.until(lambda view: any(fault.cause is cause for fault in view.active)):
        raise CampaignError(f"no warning: {cause}")


@fault(
    25,
    "tracking error, jam, slack wire",
    injected="the advance servo's horn is blocked while the program feeds; on another bench it is pulled back; on a third it drifts"
    " while nobody drives",
    wanted="STOP after 200 ms beyond the envelope",
    quick=False,
)
def jam(kit: Kit) -> Observation:
    def block(bench: FaultBench) -> None:
        _line(bench).stir(_ADVANCE, lambda servo: servo.freeze(True))

    def pull(bench: FaultBench) -> None:
        _line(bench).stir(_ADVANCE, lambda servo: servo.carry(-_CARRIED_TICKS_S))

    return _on_benches(
        kit,
        ("jam", lambda part: _servo_fault(part, block, _STOP, Cause.TRACKING)),
        ("pulled", lambda part: _servo_fault(part, pull, _STOP, Cause.TRACKING, release=_release)),
        ("drift", _drift),
    )


def _release(bench: FaultBench) -> None:
    _line(bench).stir(_ADVANCE, lambda servo: servo.carry(0.0))


def _drift(kit: Kit) -> Observation:
    """Armed, and the operator's hand at rest."""
    with open_bench(kit, live=True) as bench:
        bench.arm()
        bench.run(0.3)
        start = mark(bench)
        _line(bench).stir(_ADVANCE, lambda servo: servo.carry(_CARRIED_TICKS_S / 4))
        bench.until(lambda view: view.mode is Mode.STOPPED)
        _release(bench)
        bench.run(0.4)
        return judge(bench, start, ExpectedReaction(_STOP, (Cause.TRACKING,), Cause.TRACKING), *_still(bench))


@fault(
    44,
    "too much current",
    injected="the advance servo draws 1.5 A for 100 ms; then 0.9 A for good, with a ripple to nothing for a fifth of the time",
    wanted="the first is no fault; the second STOPs after half a second",
    quick=False,
)
def strain(kit: Kit) -> Observation:
    with open_bench(kit, live=True) as bench:
        start = mark(bench.hand_over())

        _line(bench).stir(_ADVANCE, lambda servo: servo.grind(1500.0))
        bench.run(0.1)
        _line(bench).stir(_ADVANCE, lambda servo: servo.grind(0.0))
        bench.run(0.7)
        peak = bench.mode
        _line(bench).stir(_ADVANCE, lambda servo: servo.grind(900.0, ripples=True))
        bench.until(lambda view: view.mode is Mode.STOPPED)
        bench.run(0.3)
        problems = [f"a peak already led to {peak}"] if peak not in {Mode.AUTONOMOUS, Mode.HOLD} else []
        return judge(
            bench,
            start,
            ExpectedReaction(_STOP, (Cause.STRAINED,), Cause.STRAINED, alternatives=((Mode.HOLD, *_STOP),), may_hold=True),
            *problems,
            *_still(bench),
        )


@fault(
    45,
    "torque-off not proven",
    injected="the torque is to go off at STOP; it is pressed while one servo obeys but does not answer, which it does 0.6 s later",
    wanted="STOP; told at once that the torque is not proven to be off, tried again, and told when all servos have said so",
    quick=False,
)
def torque_stays(kit: Kit) -> Observation:
    with open_bench(kit, live=True, servos={"torque_off_on_stop": True}) as bench:
        start = mark(bench.hand_over())
        _line(bench).faults.mute(_ADVANCE)
        bench.pilot.ask(Act.STOP)
        bench.until(lambda view: any(fault.cause is Cause.TORQUE_ON for fault in view.active))
        bench.run(0.6)
        early = [alert for alert in bench.alerts[start.alerts :] if alert.key is Note.TORQUE_OFF]
        _line(bench).faults.mute(_ADVANCE, False)
        bench.until(lambda view: all(fault.cause is not Cause.TORQUE_ON for fault in view.active))
        bench.run(0.3)
        problems = ["said to be off before the silent servo had said so"] if early else []
        problems += [
            f"the torque of {joint.name} is on"
            for joint in bench.config.servos.joints
            if _line(bench).servo(joint.id).table["torque"]
        ]
        wanted = ExpectedReaction(
            _STOP, (Cause.STOP_PRESSED, Cause.TORQUE_ON), Cause.STOP_PRESSED, alerts=(Note.TORQUE_OFF,), may_hold=True
        )
        return judge(bench, start, wanted, *problems)


@fault(
    26,
    "USB serial vanishes",
    injected="the pseudo-terminal is closed, and comes back two seconds later",
    wanted="STOP; opened again and checked by itself, never armed by itself",
    quick=False,
)
def vanished(kit: Kit) -> Observation:
    with open_bench(kit, live=True) as bench:
        start = mark(bench.hand_over())
        _line(bench).vanish()
        bench.until(lambda view: view.mode is Mode.STOPPED)
        bench.run(2.0)
        _line(bench).reappear()
        back = bench.until(lambda view: (status := _status(bench)) is not None and status.phase is not BusPhase.CLOSED)
        bench.run(1.0)
        status = _status(bench)
        problems = [] if back else ["the port was not opened again"]
        problems += ["it was armed again by itself"] if status is not None and status.armed else []
        problems += ["the servos count as switched on"] if bench.view.servos_on else []
        problems += ["joints count as zeroed although nobody watched them"] if status is not None and any(status.zeroed) else []
        return judge(
            bench,
            start,
            ExpectedReaction(_STOP, (Cause.PORT_LOST,), Cause.PORT_LOST, alternatives=((Mode.HOLD, *_STOP),), may_hold=True),
            *problems,
        )


@fault(
    27,
    "servo rebooted",
    injected="a servo loses its power for a moment: RAM and turn count are gone",
    wanted="DISARM, latched; it must be zeroed before it can be armed",
    quick=False,
)
def rebooted(kit: Kit) -> Observation:
    with open_bench(kit, live=True) as bench:
        start = mark(bench.hand_over())
        _line(bench).stir(4, lambda servo: servo.restart())
        bench.until(lambda view: view.mode is Mode.ADVISORY)
        bench.run(0.8)
        status = _status(bench)
        problems = ["its joint still counts as zeroed"] if status is not None and status.zeroed[3] else []
        # which of the two is seen first depends on when the read falls: it is silent while it boots
        latched = bench.view.latched.cause if bench.view.latched is not None else None
        problems += [] if latched in {Cause.REBOOTED, Cause.SERVO_SILENT} else [f"latched is {latched or 'nothing'}"]
        said = {alert.key for alert in bench.alerts[start.alerts :]} & {Cause.REBOOTED, Cause.SERVO_SILENT}
        problems += [] if said else ["no alert"]
        wanted = ExpectedReaction(_DISARM, (Cause.REBOOTED,), silent=(Cause.REBOOTED,), alternatives=(_HELD,), may_hold=True)
        seen = judge(bench, start, wanted, *problems)
        bench.pilot.ask(Act.ACKNOWLEDGE)
        bench.run(0.2)
        bench.pilot.switch_on()
        bench.until(lambda view: any(fault.cause is Cause.SERVOS_WRONG for fault in view.active) or view.servos_on)
        wrong = next((fault.detail for fault in bench.view.active if fault.cause is Cause.SERVOS_WRONG), "")
        more = () if "zero" in wrong else ("it could be switched on without a new zero",)
        return replace(seen, problems=(*seen.problems, *more))


@fault(
    28,
    "wrong id, model, mode",
    injected="a servo with another model number; one with another id inside; one whose mode is altered while it stands by",
    wanted="named; the rig does not open, or the servos cannot be switched on: nothing to arm",
    quick=False,
)
def wrong_servo(kit: Kit) -> Observation:
    said = [_refused(kit, "model_number", 1060), _refused(kit, "id", 9)]
    with open_bench(kit, live=True) as bench:
        start = mark(bench)
        _line(bench).stir(6, lambda servo: servo.table.__setitem__("operating_mode", 1))
        bench.pilot.switch_on()
        bench.until(lambda view: any(f.cause is Cause.SERVOS_WRONG for f in view.active) or view.servos_on)
        said.append(next((fault.detail for fault in bench.view.active if fault.cause is Cause.SERVOS_WRONG), ""))
        bench.pilot.ask(Act.ARM)
        bench.run(0.2)
        problems = ["the servos could be switched on"] if bench.view.servos_on else []
        problems += ["not refused by name" for text in said if not text]
        seen = judge(bench, start, ExpectedReaction((), (Cause.SERVOS_WRONG,)), *problems)
        return replace(seen, reaction="; ".join(said))


def _refused(kit: Kit, register: str, value: int) -> str:
    """What the driver says at the opening of a rig with one altered servo; empty when it says nothing."""
    part = Kit(kit.folder / register, kit.live)
    part.folder.mkdir()
    try:
        with open_bench(part, live=True, before_open=lambda bus: bus.servo(2).table.__setitem__(register, value)):
            return ""
    except WrongServo as error:
        return str(error)


ROOT = Path(__file__).resolve().parents[2]
_BOUND_S = 1.0
"""Half a second of patience with a stopped application, a hold, and a machine that has other things to do."""
_STEP_SLACK = 1.05
_REST_MM = 0.01
_SAMPLE_S, _WATCH_S, _START_S = 0.004, 1.6, 60.0
_GLANCE_S, _MOVING_MM = 0.04, 0.2
_KILLS = 8


@contextmanager
def child(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """One of the campaign's programs; gone afterwards."""
    process = subprocess.Popen([sys.executable, "-m", MODULE, *arguments], cwd=ROOT, stdout=subprocess.PIPE)
    try:
        yield process
    finally:
        with_stdout = process.stdout
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.kill()
        process.wait()
        if with_stdout is not None:
            with_stdout.close()


def _process_cases_line(process: subprocess.Popen[bytes]) -> dict[str, object]:
    assert process.stdout is not None
    try:
        found = json.loads(process.stdout.readline() or b"{}")
    except ValueError:
        found = {}
    if not found:
        raise CampaignError("a program of the campaign did not start")
    return dict(found)


@fault(
    29,
    "two programs on one port",
    injected="a second program opens the port while the first one drives",
    wanted="the second is refused by name; the first drives on",
    quick=False,
)
def two_programs(kit: Kit) -> Observation:
    with open_bench(kit, live=True) as bench:
        start = mark(bench.hand_over())
        assert bench.bus is not None
        with child("open", bench.bus.port) as process:
            bench.wait_for(lambda: process.poll() is not None)
            said = _process_cases_line(process)
        problems = [] if said.get("error") == "PortTaken" else [f"the second program: {said}"]
        driving = bench.mode in {Mode.AUTONOMOUS, Mode.HOLD}
        problems += [] if driving else [f"the first program went to {bench.mode}"]
        seen = judge(bench, start, ExpectedReaction((), (), alternatives=((Mode.HOLD,),), may_hold=True), *problems)
        return replace(
            seen, reaction=f"refused: {str(said.get('message', '')).replace(bench.bus.port, 'PORT')}; the first one goes on"
        )


@dataclass(frozen=True, slots=True)
class Strike:
    """What became of the servos: time until the last one stood still, and the longest way in its own bounded steps."""

    what: str
    stop_s: float
    steps: float


@fault(
    32,
    "process killed or stopped",
    injected="SIGKILL and SIGSTOP, to the application and to the bus process, while the program drives",
    wanted=f"the servos stand within {_BOUND_S:g} s, and within one bounded step from where the order found them",
    quick=False,
)
def killed(kit: Kit) -> Observation:
    strikes = []
    for victim in ("application", "bus process"):
        for number in (signal.SIGKILL, signal.SIGSTOP):
            strikes.append(_strike(victim, number))
    problems = [f"{one.what}: still moving after {one.stop_s:.2f} s" for one in strikes if one.stop_s > _BOUND_S]
    # a stopped application is still permitted until its heartbeat is missed: its order is good for a step, and then held
    problems += [f"{one.what}: went {one.steps:.2f} steps" for one in strikes if one.steps > _STEP_SLACK]
    reaction = "; ".join(f"{one.what}: {1000 * one.stop_s:.0f} ms, {one.steps:.2f} steps" for one in strikes)
    return Observation(f"servos stand. {reaction}", events=("the session ends there (fault 37)",), problems=tuple(problems))


def _strike(victim: str, number: signal.Signals) -> Strike:
    servos = ServosConfig()
    bus = SoftServoBus(servos, wire_time=True)
    bus.start()
    samples: list[tuple[float, tuple[float, ...]]] = []
    done = threading.Event()

    def watch() -> None:
        while not done.wait(_SAMPLE_S):
            positions = bus.positions_mm()
            samples.append((time.monotonic(), positions))

    try:
        with child("drive", bus.port) as process:
            bus_pid = int(str(_process_cases_line(process)["bus_pid"]))
            watcher = threading.Thread(target=watch, daemon=True)
            watcher.start()
            time.sleep(0.6)
            _await_motion(bus)
            hit_s = time.monotonic()
            os.kill(process.pid if victim == "application" else bus_pid, number)
            start_mm = bus.positions_mm()
            struck_s = time.monotonic()
            time.sleep(_WATCH_S)
            done.set()
            watcher.join()
            if victim != "application":
                _end(bus_pid)
    finally:
        done.set()
        bus.stop()
    after = [sample for sample in samples if sample[0] >= hit_s]
    end_mm = after[-1][1]
    moving = [n for n, (_, at) in enumerate(after) if max(abs(a - b) for a, b in zip(at, end_mm, strict=True)) > _REST_MM]
    stopped_s = after[min(moving[-1] + 1, len(after) - 1)][0] if moving else hit_s
    late = [at for time_s, at in after if time_s >= struck_s]
    steps = max(abs(a - b) / j.max_step_mm for at in late for a, b, j in zip(at, start_mm, servos.joints, strict=True))
    return Strike(f"{number.name} {victim}", stopped_s - hit_s, steps)


def _await_motion(bus: SoftServoBus) -> None:
    """Until a servo is under way: a strike at one that stands shows nothing."""
    until_s = time.monotonic() + _WATCH_S
    while time.monotonic() < until_s:
        before = bus.positions_mm()
        time.sleep(_GLANCE_S)
        if max(abs(a - b) for a, b in zip(before, bus.positions_mm(), strict=True)) > _MOVING_MM:
            return


def _end(pid: int) -> None:
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return


@fault(
    37,
    "kill -9 while recording",
    injected="the recording program is killed at a random moment",
    wanted="the session is listed as cut, is recovered into a copy, and the copy says what is lost",
    quick=False,
)
def killed_recording(kit: Kit) -> Observation:
    settings = kit.folder / "small.toml"
    settings.write_text("[perception.segmentation]\nthreads = 1\n[record]\nsync_s = 0.5\n", encoding="utf-8")
    folder = kit.folder / "sessions"
    command = [sys.executable, "main.py", "record", "--seconds", "600", "--out", str(folder), "--config", str(settings)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        rows = _rows_written(folder)
        time.sleep(random.Random(37).uniform(0.5, 2.0))
        rows = _rows_written(folder)
    finally:
        process.kill()
        process.wait()
    cut = find_cut_sessions(folder)
    problems = [] if len(cut) == 1 else [f"{len(cut)} cut sessions are listed"]
    if not cut:
        return Observation("not listed", problems=tuple(problems))
    done = recover(cut[0].folder)
    with SessionReader(done.folder) as reader:
        reader.wait(20.0)
        kept, loss = len(reader), reader.manifest.recovered if reader.manifest is not None else None
    problems += [] if kept >= rows else [f"of {rows} rows that were written {kept} are left"]
    problems += [] if loss is not None else ["the copy does not say what is lost"]
    lost = f"{loss.seconds:.1f} s and {loss.pictures} pictures lost" if loss is not None else "loss unknown"
    return Observation(
        f"listed, recovered: {kept} rows, {lost}", events=("the copy's manifest names the loss",), problems=tuple(problems)
    )


def _rows_written(folder: Path) -> int:
    """Rows that are on the disk by now; waits for the first thirty."""
    until_s = time.monotonic() + _START_S
    while time.monotonic() < until_s:
        rows = sum(path.read_bytes().count(b"\n") for path in folder.glob("session_*/frames.jsonl"))
        if rows >= 10:
            return rows
        time.sleep(0.1)
    raise CampaignError("the recording did not begin in time")


@fault(
    40,
    "kill during annotation save",
    injected=f"a program that saves one annotation after the other is killed, {_KILLS} times",
    wanted="nothing is lost after it said that it was saved",
    quick=False,
)
def killed_annotating(kit: Kit) -> Observation:
    path = kit.folder / "a.sqlite"
    draw = random.Random(40)
    told, problems = 0, []
    for _ in range(_KILLS):
        with child("annotate", str(path), str(told + 1)) as process:
            first = _process_cases_line(process)
            time.sleep(draw.uniform(0.0, 0.1))
            process.kill()
            process.wait()
            assert process.stdout is not None
            lines = [json.loads(line) for line in process.stdout.read().split(b"\n")[:-1]]
        told = int((lines or [first])[-1]["saved"])
        with AnnotationStore(path, read_only=True) as store:
            (one,) = store.annotations()
            kept = int(one.content.robot[0][0])
            problems += [] if told <= kept <= told + 1 else [f"{told} were told as saved, {kept} are there"]
            problems += [] if store.history(KEY).current == one.content else ["the history lacks the last edit"]
            told = kept
    return Observation(f"{told} saves, {_KILLS} kills, none lost", events=("the journal has every edit",), problems=tuple(problems))


_ROUNDS = 6
_DEADMAN_S = 0.1
_SUSPEND_S = 1.3


@fault(
    30,
    "GUI hangs",
    injected="a slot of the window sleeps for 0.8 s: no sign of life, and the deadman that it reports is silent, too",
    wanted="HOLD by the silent deadman within 100 ms, DISARM after 500 ms",
)
def window_hangs(kit: Kit) -> Observation:
    if kit.live:
        return hung_window(kit)
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        bench.hooks.window_lives = False
        bench.run(0.8)
        bench.hooks.window_lives = True
        bench.run(0.1)
        wanted = ExpectedReaction((Mode.HOLD, Mode.ADVISORY), (Cause.DEADMAN, Cause.WINDOW_HUNG), Cause.WINDOW_HUNG, within_s=0.14)
        return judge(bench, start, wanted)


@fault(
    33,
    "operator input in autonomy",
    injected=f"{_ROUNDS} hand-overs, each ended by a touch of the controls at a random moment, mixed with other requests",
    wanted="the operator has the hand in the same turn; nothing of the program leaves in it",
)
def override(kit: Kit) -> Observation:
    draw = random.Random(33)
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        problems = []
        for _ in range(_ROUNDS):
            bench.run(draw.uniform(0.02, 0.3))
            problems += _touch(bench, draw)
            bench.run(0.4)
            bench.hand_over()
        modes = [view.mode for view in bench.views[start.views :]]
        back = sum(a is Mode.AUTONOMOUS and b is Mode.ARMED for a, b in zip(modes, modes[1:], strict=False))
        problems += [] if back >= _ROUNDS else [f"only {back} of {_ROUNDS} touches ended autonomy"]
        path = tuple(mode for before, mode in zip([start.mode, *modes], modes, strict=False) if mode is not before)
        seen = judge(bench, start, ExpectedReaction(path, ()), *problems)
        overrides = "override" in " ".join(seen.events)
        more = () if overrides else ("no override in the session",)
        return Observation(f"{back} of {_ROUNDS} in the same turn", seen.alerts, seen.events, (*seen.problems, *more))


def _touch(bench: FaultBench, draw: random.Random) -> list[str]:
    """One touch, in the middle of whatever else is asked for in that turn; what went wrong."""
    if bench.mode is not Mode.AUTONOMOUS:
        bench.hand_over()
    if draw.random() < 0.5:
        bench.pilot.ask(draw.choice((Act.HAND_OVER, Act.TAKE_BACK, Act.ARM)))
    bench.jog = draw.choice((Jog(advance=1.0), Jog(bend=-1.0), Jog(straighten=True), Jog(delivery=-0.3)))
    view = bench.turn()
    bench.jog = AT_REST
    problems = []
    if view.mode is not Mode.ARMED:
        problems.append(f"after a touch the mode is {view.mode}")
    if view.commanded is not None or view.permitted is Source.PROGRAM:
        problems.append("the program still drives in the turn of the touch")
    return problems


@fault(
    34,
    "deadman lost (focus, pedal unplugged, stuck)",
    injected="released; then silent, as when its device is gone; then pressed since before arming (in lock-step)",
    wanted="HOLD within 100 ms; a press from before arming does not count",
)
def deadman(kit: Kit) -> Observation:
    with open_bench(kit, live=False) as bench:
        start = mark(bench.hand_over())
        bench.held = False
        released_s = _time_to_hold(bench)
        bench.hand_over()
        bench.deadman_speaks = False
        silent_s = _time_to_hold(bench)
        bench.run(0.7)  # longer than a hold clears itself
        bench.deadman_speaks = True
        bench.run(0.3)
        expired = bench.mode is Mode.HOLD
        bench.pilot.ask(Act.DISARM)
        bench.held = True
        bench.until(lambda view: not view.against_arming)
        bench.pilot.ask(Act.ARM)
        bench.run(0.1)
        bench.pilot.ask(Act.HAND_OVER)
        bench.run(0.1)
        problems = [
            f"{what} held after {1000 * s:.0f} ms" for what, s in (("released", released_s), ("silent", silent_s)) if s > 0.121
        ]
        problems += [] if expired else ["a hold of which the deadman was lost for long cleared itself"]
        problems += [] if bench.mode is Mode.ARMED else ["a deadman that was down before arming counted"]
        modes = [view.mode for view in bench.views[start.views :]]
        path = tuple(mode for before, mode in zip([start.mode, *modes], modes, strict=False) if mode is not before)
        seen = judge(bench, start, ExpectedReaction(path, (Cause.DEADMAN,)), *problems)
        reaction = f"HOLD {1000 * released_s:.0f} ms after the release, {1000 * silent_s:.0f} ms after the last word"
        return Observation(reaction, seen.alerts, seen.events, seen.problems)


def _time_to_hold(bench: FaultBench) -> float:
    """From now until HOLD, by the pilot's clock, less the turn in which the last word was said."""
    since_s = bench.view.time_s
    bench.until(lambda view: view.mode is Mode.HOLD, 1.0)
    return bench.view.time_s - since_s


@fault(
    35,
    "clock jump, suspend",
    injected="the clock leaps by 2 s; live: the whole program stands still for 1.3 s",
    wanted="DISARM after a gap of more than 1 s; only the monotonic clock counts",
)
def clock(kit: Kit) -> Observation:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        if bench.live:
            time.sleep(_SUSPEND_S)
        else:
            bench.jump(2.0)
        bench.run(5 * PERIOD_S)
        return judge(bench, start, ExpectedReaction((Mode.ADVISORY,), (Cause.CLOCK,), Cause.CLOCK))


_DAMAGES = 24


@fault(
    36,
    "disk low, full",
    injected="the disk's free space falls to 5 %, then to nothing, while it is recorded and the program drives (in lock-step)",
    wanted="warning below 7 %; the recording stops visibly, what was written stays; driving is not touched",
)
def disk_full(kit: Kit) -> Observation:
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
        seen = judge(bench, start, ExpectedReaction((), ()), *problems)
        return replace(
            seen, reaction=f"goes on; {problem.partition(':')[0]}; {rows} frames kept", events=("session closed with the cause",)
        )


@fault(
    38,
    "encoder too slow",
    injected="the encoder does not return while pictures come; the queue takes 3 (in lock-step)",
    wanted="bounded queue; drops counted and shown; driving is not touched",
)
def slow_encoder(kit: Kit) -> Observation:
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
        seen = judge(bench, start, ExpectedReaction((), (Cause.RECORDER_BEHIND,)), *problems)
        more = () if any(event.startswith("frames dropped") for event in seen.events) else ("the drops are not in the session",)
        return replace(seen, reaction=f"goes on; {dropped} frames dropped and counted", problems=(*seen.problems, *more))


@fault(
    39,
    "malformed configuration, session, annotation",
    injected=f"{_DAMAGES} copies each of a configuration, a session and an annotation file: cut, zeroed, bits flipped",
    wanted="read, or refused by one line; the original is untouched; nothing else is ever raised",
)
def malformed(kit: Kit) -> Observation:
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
    return Observation(
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


_PATIENCE_S = 60.0
_TARGET = (560.0, 195.0)


class BreakingPerception:
    """Perceives, until it is told to break."""

    def __init__(self, perceive: Perceive) -> None:
        self._perceive = perceive
        self.broken = False

    def __call__(self, frame: Frame, target: Point | None = None) -> Scene:
        if self.broken:
            raise RuntimeError("injected: perception breaks")
        return self._perceive(frame, target)


def window_settings(folder: Path) -> Config:
    """A light twin: no servo line, ten pictures a second, one thread; sessions go to the folder."""
    return Config.model_validate(
        {
            "twin": {"live_frames_per_second": 12.0},
            "servos": {"driver": "direct"},
            "perception": {"segmentation": {"threads": 1, "mirrored": "never"}},
            "record": {"folder": str(folder), "ring_s": 0.0},
        }
    )


def make_test_window(folder: Path) -> tuple[OperatorWindow, list[BreakingPerception]]:
    """The window, shown and started, with the real opener; and the perceptions that it opens, newest last."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    from app.operator.rig_engine import EngineMaker
    from app.operator.window import OperatorWindow
    from app.ui.window_base import make_application

    make_application()
    made: list[BreakingPerception] = []

    class Maker(EngineMaker):
        def _perception(self, config: PerceptionConfig) -> tuple[Perceive, ModelReport]:
            perceive, report = super()._perception(config)
            made.append(BreakingPerception(perceive))
            return made[-1], report

    window = OperatorWindow(window_settings(folder), Maker(), RigKind.SIM)
    window.show()
    window.start()
    return window, made


def until(wanted: Callable[[], bool], patience_s: float = _PATIENCE_S) -> bool:
    """Let the window live until something is so; False when it was not in time."""
    from PySide6.QtCore import QCoreApplication, QEventLoop

    until_s = time.monotonic() + patience_s
    while not wanted() and time.monotonic() < until_s:
        QCoreApplication.processEvents(QEventLoop.ProcessEventsFlag.AllEvents, 20)
        time.sleep(0.002)
    return wanted()


def bring_to(window: OperatorWindow, wanted: Mode) -> bool:
    """Do what an operator does to get there: servos on (the twin's are), destination, arm, deadman, hand over."""
    from app.ui.texts import OperatorStep

    desk = window.controls

    def is_in(*modes: Mode) -> bool:
        return desk.view is not None and desk.view.mode in modes

    if not until(lambda: desk.view is not None and desk.view.permitted is Source.OPERATOR and window.shown_tick is not None):
        return False
    window.choose_target(*_TARGET)
    until_s = time.monotonic() + _PATIENCE_S
    while not is_in(wanted) and time.monotonic() < until_s:
        if is_in(Mode.ADVISORY) and wanted is not Mode.ADVISORY:
            desk.deadman.hold("mouse", False)
            if desk.view is not None and desk.view.latched is not None:
                desk.ask_step(OperatorStep.ACKNOWLEDGE)
            if until(lambda: desk.view is not None and not desk.view.against_arming, 5.0):
                desk.ask_step(OperatorStep.ARM)
        elif is_in(Mode.ARMED, Mode.HOLD) and wanted is Mode.AUTONOMOUS:
            desk.deadman.hold("mouse", True)
            if until(lambda: desk.view is not None and not desk.view.against_hand_over and bool(desk.view.deadman), 2.0):
                desk.ask_step(OperatorStep.HAND_OVER)
        until(lambda: is_in(wanted), 0.5)
    return is_in(wanted)


def record(window: OperatorWindow) -> bool:
    """Begin to record; True when the first frames are written."""
    window.recorder.toggle()
    return until(lambda: window.recorder.status.frames > 3)


def run_and_close(folder: Path, wanted: str) -> int:
    """For a process of its own: record, go to a mode, close the window; what was reached is told on standard output."""
    window, _ = make_test_window(folder)
    recorded = record(window)
    reached = bring_to(window, Mode(wanted))
    sys.stdout.write(json.dumps({"recorded": recorded, "mode": wanted if reached else "not reached"}) + "\n")
    sys.stdout.flush()
    window.close()
    return 0


_END_S, _SLEEP_S = 180.0, 0.8


@fault(
    31,
    "worker dies",
    injected="in the window, perception raises while the program drives",
    wanted="DISARM: the robot is held and let go; the window says so and stays; starting again acknowledges nothing",
    quick=False,
)
def worker_dies(kit: Kit) -> Observation:
    window, made = make_test_window(kit.folder)
    problems = []
    try:
        problems += [] if record(window) else ["nothing was recorded"]
        problems += [] if bring_to(window, Mode.AUTONOMOUS) else ["the program did not get to drive"]
        made[-1].broken = True
        problems += [] if until(lambda: window.rig.phase is EnginePhase.FAULT) else ["the window does not tell"]
        notice = window.panels.notice
        shown = notice.isVisibleTo(window)
        problems += [] if shown else ["no notice is shown"]
        problems += [] if window.rig.pilot is None else ["there is still somebody who drives"]
        made[-1].broken = False
        folder = window.recorder.status.folder
        window.rig.restart()
        again = until(lambda: window.rig.phase is EnginePhase.RUNNING and window.controls.view is not None)
        problems += [] if again else ["it could not be started again"]
        view = window.controls.view
        latched = view.latched.cause if view is not None and view.latched is not None else None
        problems += [] if latched is Cause.WORKER_DEAD else [f"after the new start {latched or 'nothing'} is latched"]
    finally:
        window.close()
    told = _events_of(folder) if folder is not None else []
    problems += [] if f"{EventKind.FAULT}: {Cause.WORKER_DEAD}" in told else ["not in the session: worker stopped"]
    return Observation(
        "DISARM: rig closed, notice shown; latched until acknowledged", ("The rig stopped",), tuple(told), tuple(problems)
    )


def hung_window(kit: Kit) -> Observation:
    """Fault 30 in the real window: its thread sleeps while the program drives."""
    window, _ = make_test_window(kit.folder)
    problems = []
    try:
        problems += [] if record(window) else ["nothing was recorded"]
        problems += [] if bring_to(window, Mode.AUTONOMOUS) else ["the program did not get to drive"]
        folder = window.recorder.status.folder
        slept_s = time.monotonic()
        QTimer.singleShot(0, lambda: time.sleep(_SLEEP_S))
        until(lambda: time.monotonic() > slept_s + _SLEEP_S + 0.3)
        view = window.controls.view
        latched = view.latched.cause if view is not None and view.latched is not None else None
        problems += [] if latched is Cause.WINDOW_HUNG else [f"latched is {latched or 'nothing'}"]
        said = [line for line in window.panels.events.lines if ALERTS[Cause.WINDOW_HUNG].text in line]
        problems += [] if said else ["no alert"]
    finally:
        window.close()
    if folder is None:
        return Observation("not recorded", problems=tuple(problems))
    with SessionReader(folder) as reader:
        reader.wait(10.0)
        after = [event for event in reader.events if event.time_s >= slept_s]
    modes = [(event.text, event.time_s - slept_s) for event in after if event.kind is EventKind.MODE]
    problems += [] if [mode for mode, _ in modes] == [Mode.HOLD, Mode.ADVISORY] else [f"modes went {modes}"]
    problems += [] if any(event.text == Cause.WINDOW_HUNG.value for event in after) else ["not in the session: window hangs"]
    words = {Mode.HOLD.value: "HOLD", Mode.ADVISORY.value: "DISARM"}
    reaction = ", ".join(f"{words.get(mode, mode)} at {1000 * at_s:.0f} ms" for mode, at_s in modes)
    told = tuple(dict.fromkeys(f"{event.kind}: {event.text}" for event in after if event.text))
    return Observation(reaction, (ALERTS[Cause.DEADMAN].text, ALERTS[Cause.WINDOW_HUNG].text), told, tuple(problems))


def _events_of(folder: Path) -> list[str]:
    with SessionReader(folder) as reader:
        reader.wait(10.0)
        shown = [f"{event.kind}: {event.text}" if event.text else event.kind.value for event in reader.events]
    return list(dict.fromkeys(text for text in shown if not text.startswith("video")))


@fault(
    41,
    "quit while armed or recording",
    injected="the window is closed while it records: in ADVISORY, ARMED and AUTONOMOUS",
    wanted="disarmed, flushed, joined; exit code 0; the session is whole",
    quick=False,
)
def quit_while_busy(kit: Kit) -> Observation:
    problems, reaction = [], []
    events: list[str] = []
    for mode in (Mode.ADVISORY, Mode.ARMED, Mode.AUTONOMOUS):
        folder = kit.folder / mode.value
        folder.mkdir()
        command = [sys.executable, "-m", MODULE, "window", str(folder), mode.value]
        environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=_END_S, env=environment)
        said = json.loads(done.stdout.splitlines()[-1]) if done.stdout.strip() else {}
        problems += [] if said.get("mode") == mode.value else [f"{mode} was not reached"]
        problems += [] if done.returncode == 0 else [f"{mode}: exit code {done.returncode}"]
        sessions = sorted(folder.glob("session_*"))
        whole = len(sessions) == 1 and read_manifest(sessions[0]).closed
        problems += [] if whole else [f"{mode}: the session is not whole"]
        events += _events_of(sessions[0]) if sessions else []
        reaction.append(f"{mode}: exit code {done.returncode}, session {'whole' if whole else 'cut'}")
    return Observation("; ".join(reaction), (), tuple(dict.fromkeys(events)), tuple(problems))


@fault(
    42,
    "twin taken for the real rig",
    injected="the twin, a real camera and a recording are opened",
    wanted="a permanent banner SIM, LIVE or PLAYBACK; the session keeps it",
)
def labels(kit: Kit) -> Observation:
    from app.operator.window import OperatorWindow
    from app.ui.window_base import make_application

    problems = []
    rigs = {
        RigKind.SIM: {},
        RigKind.LIVE: {"camera": "realsense", "robot": "none"},
        RigKind.PLAYBACK: {"camera": "video_file", "robot": "none", "source": "a.mkv"},
    }
    make_application()
    for kind, rig in rigs.items():
        config = Config.model_validate({"rig": rig, "record": {"ring_s": 0.0}})
        problems += [] if kind_of(config.rig) is kind else [f"{rig} counts as {kind_of(config.rig)}"]
        window = OperatorWindow(config, lambda _config: None, kind)  # type: ignore[arg-type, return-value]
        problems += [] if kind.value in window.windowTitle() else [f"{kind} is not in the window's title"]
        problems += [] if window.panels.banner.word == kind.value else [f"{kind} is on no banner"]
        window.close()
        window.deleteLater()
    with open_bench(Kit(kit.folder, False)) as bench:
        bench.record()
        bench.run(0.2)
        manifest, _ = bench.recorded()
    problems += [] if manifest.kind == RigKind.SIM.value else [f"the session says {manifest.kind}"]
    return Observation(
        "SIM, LIVE and PLAYBACK on title, banner and in the manifest", (), (f"manifest: {manifest.kind}",), tuple(problems)
    )
