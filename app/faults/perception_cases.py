"""Faults 11 to 20, and 43: what perception says, and the model that it rests on."""

from __future__ import annotations

import json
import math
import pickle
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from app.faults.bench import Probability, open_bench
from app.faults.camera_cases import _AT_ONCE, _TO_ADVISORY, _both
from app.faults.judge import Wanted, judge, mark
from app.faults.registry import Kit, Seen, fault
from app.rig_engine import EngineMaker
from core.config import Config, PerceptionConfig, SegmentationConfig
from core.control.alerts import ALERTS
from core.control.faults import Cause
from core.control.health import ModelReport
from core.control.modes import Act, Mode
from core.learning.model_file import INFO, WEIGHTS, ModelError, load_network, model_folder, read_model_info, sha256_of
from core.perception.pipeline import open_pipeline
from core.perception.pose import classify
from core.types import Image, Point, Reason, Refusal, Scene
from hardware.checks.model import judge as judge_model
from hardware.twin.world import TwinWorld

_Two = tuple[Probability, Probability]
_SEEN, _NOT = np.float32(0.99), np.float32(0.01)


@fault(
    11,
    "NaN or infinity from network or fit",
    injected="one pose with theta = NaN; then the network gives NaN in a part of the picture for good",
    wanted="discarded: HOLD; three in a row: DISARM",
)
def not_finite(kit: Kit) -> Seen:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        left = 1

        def spoil(scene: Scene) -> Scene:
            nonlocal left
            left -= 1
            return replace(scene, pose=replace(scene.pose, theta_deg=math.nan)) if left >= 0 and scene.pose is not None else scene

        bench.hooks.scene = spoil
        bench.until(lambda view: view.mode is Mode.AUTONOMOUS and left < -2, 1.0)
        bench.hooks.masks = lambda vessel, robot: (_spoilt(vessel), robot)
        bench.run(0.5)
        causes = Cause.NOT_FINITE, Cause.NOT_FINITE_REPEATED
        wanted = Wanted((Mode.HOLD, Mode.AUTONOMOUS, *_TO_ADVISORY), causes, Cause.NOT_FINITE_REPEATED, blank=True)
        return judge(bench, start, wanted)


def _spoilt(probability: Probability) -> Probability:
    """With numbers that are none in the middle, where geometry meets them."""
    spoilt, (height, width) = probability.copy(), probability.shape
    spoilt[height // 3 : 2 * height // 3, width // 4 : 3 * width // 4] = np.nan
    return spoilt


@fault(12, "head lost", injected="the robot's mask is empty", wanted="HOLD at the third frame, DISARM after 0.5 s")
def head_lost(kit: Kit) -> Seen:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        bench.hooks.masks = lambda vessel, robot: (vessel, np.full_like(robot, _NOT))
        bench.run(0.8)
        causes = Cause.HEAD_LOST, Cause.HEAD_LOST_LONG
        return judge(bench, start, Wanted(_TO_ADVISORY, causes, Cause.HEAD_LOST_LONG, within_s=0.32, blank=True))


@fault(13, "several robots", injected="a second robot of the same size is put into the mask", wanted="DISARM")
def several_robots(kit: Kit) -> Seen:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())

        def double(vessel: Probability, robot: Probability) -> _Two:
            other = robot[::-1]
            return np.maximum(vessel, vessel[::-1]), np.maximum(robot, other)

        bench.hooks.masks = double
        bench.run(0.3)
        return judge(bench, start, Wanted(_AT_ONCE, (Cause.SEVERAL_ROBOTS,), Cause.SEVERAL_ROBOTS, blank=True))


@fault(14, "robot outside vessel", injected="the vessel's mask is shifted by 80 px", wanted="DISARM")
def outside(kit: Kit) -> Seen:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())

        def cut(vessel: Probability, robot: Probability) -> _Two:
            return np.where(robot > 0.5, _NOT, np.roll(vessel, 80, axis=0)), robot

        bench.hooks.masks = cut
        bench.run(0.3)
        return judge(bench, start, Wanted(_AT_ONCE, (Cause.OUTSIDE_VESSEL,), Cause.OUTSIDE_VESSEL, blank=True))


@fault(
    15,
    "branch ambiguity",
    injected="a symmetric Y; the branch to the destination is cut off, so that no route decides",
    wanted="HOLD, and the alert asks for a destination",
)
def ambiguous(kit: Kit) -> Seen:
    with open_bench(kit) as bench:
        vessel, robot, cut = _symmetric_y()
        bench.hooks.masks = lambda v, r: (vessel, robot)
        start = mark(bench.hand_over(target=(560.0, 103.0)))
        bench.hooks.masks = lambda v, r: (cut, robot)
        bench.run(0.3)
        text = ALERTS[Cause.BRANCH_UNCLEAR].what_to_do
        problems = [] if "destination" in text else ["the alert does not ask for a destination"]
        wanted = Wanted((Mode.HOLD,), (Cause.BRANCH_UNCLEAR,), blank=True)
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
def jump(kit: Kit) -> Seen:
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
        return judge(bench, start, Wanted((Mode.HOLD,), (Cause.HEAD_JUMP,), blank=True, alternatives=stays))


@fault(
    17,
    "state chatter",
    injected="the robot swings by 1 px about the threshold of state A, from frame to frame",
    wanted="the state that is shown does not change: hysteresis and dwell",
)
def chatter(kit: Kit) -> Seen:
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
        seen = judge(bench, start, Wanted((), ()), *problems)
        return replace(seen, reaction=f"goes on; {raw_changes} changes by the bare thresholds, {changes} shown")


# ---- the model


@fault(
    18,
    "model missing, truncated, bit-flipped",
    injected="a copy of the model: a file gone, cut in half, one bit flipped",
    wanted="its hash tells: refuses to arm; the program opens all the same",
)
def damaged_model(kit: Kit) -> Seen:
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


def _unfit(kit: Kit, folder: Path, name: str) -> Seen:
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
        seen = judge(bench, start, Wanted((), (Cause.MODEL_UNFIT,)), *problems)
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
def malicious(kit: Kit) -> Seen:
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
def wrong_model(kit: Kit) -> Seen:
    plain = Config().perception
    world = TwinWorld(Config().twin, perception=plain)
    world.insert(70.0)
    masks = world.picture(world.physics.robot_points_mm())
    pipeline = open_pipeline(plain)
    sight = pipeline._single

    class Swapped:
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
        seen = judge(bench, start, Wanted((), (Cause.MODEL_UNFIT,)), *problems)
        return replace(seen, reaction=f"refuses to arm: {check.detail}")


@fault(
    43,
    "picture of an unknown kind",
    injected="perception says that the pictures are unlike all that the model knows: three of them, then all",
    wanted="HOLD at the first, and on again; then DISARM",
)
def unknown_kind(kit: Kit) -> Seen:
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
        wanted = Wanted((Mode.HOLD, Mode.AUTONOMOUS, *_TO_ADVISORY), causes, Cause.POSE_LOST, within_s=0.1, blank=True)
        return judge(bench, start, wanted)
