"""Faults 1 to 20, 43 and 46: camera, late perception, results of perception, the model, and a robot that goes the other way."""

from __future__ import annotations

import json
import math
import pickle
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from app.operator.rig_engine import EngineMaker
from core.config.models import Config, PerceptionConfig, SegmentationConfig
from core.control.alerts import ALERTS
from core.control.engine import Perceive
from core.control.faults import Cause
from core.control.health import ModelReport
from core.control.modes import Act, Mode
from core.perception.model_file import INFO, WEIGHTS, ModelError, load_network, model_folder, read_model_info, sha256_of
from core.perception.pipeline import open_pipeline
from core.perception.pose import classify
from core.perception.segmentation import Segmenter
from core.types import Frame, Image, Point, Reason, Refusal, Scene
from hardware.preflight.model_checks import judge as judge_model
from hardware.twin.actuation import JointsToTwin
from hardware.twin.world import TwinWorld
from tools.fault_campaign.bench import ExpectedReaction, FaultBench, Masks, Probability, bench_fault, is_active, judge, open_bench
from tools.fault_campaign.registry import Kit, Observation, check, fault, run_parts
from tools.lockstep import LockStepServos

_HELD = (Mode.HOLD,)
_TO_ADVISORY = (Mode.HOLD, Mode.ADVISORY)
_AT_ONCE = (Mode.ADVISORY,)
_RESUMED = (Mode.HOLD, Mode.AUTONOMOUS, Mode.HOLD, Mode.ADVISORY)
_LATE_S = 0.26  # 150 ms, a frame's period, and two turns
_IN, _OUT = np.float32(0.99), np.float32(0.01)  # probabilities of the masks


def _expect(path: tuple[Mode, ...], *causes: Cause, **more: object) -> ExpectedReaction:
    """The last cause is latched if the robot is disarmed; the advice is blank."""
    latched = causes[-1] if path[-1] is Mode.ADVISORY else None
    return ExpectedReaction(path, causes, **{"latched": latched, "blank": True, **more})  # type: ignore[arg-type]


# ---- camera


@bench_fault(1, _expect(_TO_ADVISORY, Cause.CAMERA_SILENT, Cause.CAMERA_LOST, within_s=_LATE_S), seconds=0.8)
def camera_unplugged(bench: FaultBench) -> None:
    bench.hooks.silent = True


@bench_fault(2, _expect(_TO_ADVISORY, Cause.CAMERA_SILENT, Cause.CAMERA_LOST, within_s=_LATE_S))
def read_blocks(bench: FaultBench) -> list[str]:
    bench.hooks.read_s = 1.5
    bench.turn()
    bench.hooks.read_s = 0.0
    hung = any(is_active(view, Cause.WINDOW_HUNG) for view in bench.views_since_mark)
    return check((not hung, "the window stood still, too"))


@bench_fault(3, _expect(_AT_ONCE, Cause.CAMERA_FROZEN))
def frozen(bench: FaultBench) -> list[str]:
    kept: list[Image] = []

    def freeze(frame: Frame) -> Frame:
        kept.append(frame.image)
        return replace(frame, image=kept[0])

    bench.hooks.frame = freeze
    bench.run(0.6)
    return check((len(kept) >= 5, f"only {len(kept)} pictures were given"))


@bench_fault(
    4, _expect(_TO_ADVISORY, Cause.FRAMES_DROPPED, Cause.FRAMES_LOST, Cause.FRAMES_LOST_LONG, blank=False), frames_per_s=25.0
)
def dropped(bench: FaultBench) -> list[str]:
    every = 7

    def drop(frame: Frame) -> Frame | None:
        if frame.index % every == 0:
            bench.camera.lost += 1
            return None
        return frame

    bench.hooks.frame = drop
    bench.until_active(Cause.FRAMES_DROPPED, 6.0)
    warned = bench.mode
    every = 3
    bench.until_mode(Mode.ADVISORY, 6.0)
    return check((warned is Mode.AUTONOMOUS, f"a warning already led to {warned}"))


@fault(5)
def wrong_format(kit: Kit) -> Observation:
    def inject(kit: Kit, change: Callable[[Image], np.ndarray]) -> Observation:
        with open_bench(kit) as bench:
            bench.hand_over().mark()
            bench.hooks.frame = lambda frame: replace(frame, image=change(frame.image))
            shown = len(bench.ticks)
            bench.run(0.3)
            whole = all(tick.frame.image.dtype == np.uint8 and tick.frame.image.ndim == 3 for tick in bench.ticks[shown:])
            problems = check((whole, "a picture that is none went on to window and recorder"))
            return judge(bench, _expect(_AT_ONCE, Cause.WRONG_FORMAT), *problems)

    return run_parts(
        kit,
        ("half", partial(inject, change=lambda image: np.ascontiguousarray(image[::2, ::2]))),
        ("grey", partial(inject, change=lambda image: np.ascontiguousarray(image[..., 0]))),
        ("16-bit", partial(inject, change=lambda image: image.astype(np.uint16) * 257)),
    )


@fault(6)
def dark_and_bright(kit: Kit) -> Observation:
    def inject(kit: Kit, level: int, cause: Cause) -> Observation:
        def shade(frame: Frame) -> Frame:
            image = np.full_like(frame.image, level)
            image[0, 0] = 100 + frame.index % 50
            return replace(frame, image=image)

        with open_bench(kit) as bench:
            bench.hand_over().mark()
            bench.hooks.frame = shade
            bench.run(0.4)
            return judge(bench, _expect(_HELD, cause))

    black, white = partial(inject, level=0, cause=Cause.IMAGE_BLACK), partial(inject, level=255, cause=Cause.IMAGE_WHITE)
    return run_parts(kit, ("black", black), ("white", white), named=False)


@fault(7)
def blurred(kit: Kit) -> Observation:
    def spoil(frame: Frame, how: str, place: tuple[int, int]) -> Frame:
        image = frame.image.copy()
        if how == "blur":
            image = np.asarray(cv2.GaussianBlur(image, (0, 0), 25.0), np.uint8)
            image[0, 0] = frame.index % 251
        else:
            cv2.circle(image, place, 70, (255, 255, 250) if how == "glare" else (120, 110, 100), -1)
        return replace(frame, image=image)

    def inject(kit: Kit, how: str) -> Observation:
        with open_bench(kit, live=False, network=True) as bench:
            bench.hand_over().mark()
            scene = next(tick.scene for tick in reversed(bench.ticks) if tick.scene.path is not None)
            assert scene.path is not None
            x, y = scene.to_source(scene.path.head)
            bench.hooks.frame = partial(spoil, how=how, place=(round(x), round(y)))
            bench.run(0.4)
            causes = {fault.cause for view in bench.views_since_mark for fault in view.active} & {
                Cause.POOR_VIEW, Cause.CONFIDENCE_LOW, Cause.HEAD_LOST, Cause.HEAD_JUMP, Cause.OUTSIDE_VESSEL,
            }  # fmt: skip
            expected = _expect(_HELD, *sorted(causes, key=str), alternatives=(_TO_ADVISORY, _AT_ONCE))
            return judge(bench, expected, *check((bool(causes), f"{how}: nothing was said against the picture")))

    return run_parts(kit, *((how, partial(inject, how=how)) for how in ("blur", "patch", "glare")))


@fault(8)
def moved(kit: Kit) -> Observation:
    shift = np.array([[1, 0, 12], [0, 1, 7]], np.float32)

    def shift_frame(frame: Frame) -> Frame:
        size = frame.image.shape[1], frame.image.shape[0]
        shifted = cv2.warpAffine(frame.image, shift, size, borderMode=cv2.BORDER_REPLICATE)
        return replace(frame, image=np.asarray(shifted, np.uint8))

    def shift_masks(*masks: np.ndarray) -> tuple[np.ndarray, ...]:
        return tuple(cv2.warpAffine(mask, shift, (mask.shape[1], mask.shape[0])) for mask in masks)

    with open_bench(kit) as bench:
        bench.hand_over().run(0.5)
        bench.mark()
        bench.hooks.frame, bench.hooks.masks = shift_frame, shift_masks  # type: ignore[assignment]
        bench.run(1.0)
        problems = check((Cause.CAMERA_MOVED in bench.view.against_arming, "it could be armed again"))
        return judge(bench, _expect(_AT_ONCE, Cause.CAMERA_MOVED), *problems)


@bench_fault(9, _expect(_TO_ADVISORY, Cause.POSE_STALE, Cause.POSE_LOST, latched=None, within_s=0.3))
def stale(bench: FaultBench) -> None:
    bench.hooks.perceive_s = 0.25
    bench.until_mode(Mode.HOLD, 1.0)
    bench.hooks.perceive_s = 0.8
    bench.until_mode(Mode.ADVISORY, 2.0)
    bench.hooks.perceive_s = 0.0


@bench_fault(10, ExpectedReaction((), (Cause.OUT_OF_ORDER,)), frames_per_s=30.0)
def out_of_order(bench: FaultBench) -> list[str]:
    kept: list[Frame] = []

    def swap(frame: Frame) -> Frame | None:
        if kept:
            bench.camera.waiting.append(kept.pop())
            return frame
        if frame.index % 8 == 0:
            kept.append(frame)
            return None
        return frame

    bench.hooks.frame = swap
    shown = len(bench.ticks)
    bench.run(1.2)
    indices = [tick.frame.index for tick in bench.ticks[shown:]]
    return check(
        (indices == sorted(indices), "a late frame went on to window and recorder"),
        (bench.ticks[-1].dropped_frames > 0, "the late frames were not counted"),
    )


# ---- results of perception


def _first(count: int, change: Callable[[Scene], Scene], bench: FaultBench) -> None:
    """Change so many scenes, and wait until the program drives on."""
    left = count

    def hook(scene: Scene) -> Scene:
        nonlocal left
        left -= 1
        return change(scene) if left >= 0 else scene

    bench.hooks.scene = hook
    bench.until(lambda view: view.mode is Mode.AUTONOMOUS and left < -2, 1.0)


@bench_fault(11, _expect(_RESUMED, Cause.NOT_FINITE, Cause.NOT_FINITE_REPEATED), seconds=0.5)
def not_finite(bench: FaultBench) -> None:
    def spoil_pose(scene: Scene) -> Scene:
        return replace(scene, pose=replace(scene.pose, theta_deg=math.nan)) if scene.pose is not None else scene

    def spoil_masks(vessel: Probability, robot: Probability) -> Masks:
        spoilt, (height, width) = vessel.copy(), vessel.shape
        spoilt[height // 3 : 2 * height // 3, width // 4 : 3 * width // 4] = np.nan  # in the middle, where the vessel is
        return spoilt, robot

    _first(1, spoil_pose, bench)
    bench.hooks.masks = spoil_masks


@bench_fault(43, _expect(_RESUMED, Cause.UNKNOWN_KIND, Cause.POSE_LOST, within_s=0.1), seconds=1.0)
def unknown_kind(bench: FaultBench) -> None:
    refusal = Refusal(Reason.UNLIKE_TRAINING, "distance 1.30 from the pictures that it knows (at most 1.00)")

    def refuse(scene: Scene) -> Scene:
        return replace(scene, pose=None, refusal=refusal)

    _first(3, refuse, bench)
    bench.hooks.scene = refuse


@bench_fault(12, _expect(_TO_ADVISORY, Cause.HEAD_LOST, Cause.HEAD_LOST_LONG, within_s=0.32), seconds=0.8)
def head_lost(bench: FaultBench) -> None:
    bench.hooks.masks = lambda vessel, robot: (vessel, np.full_like(robot, _OUT))


@bench_fault(13, _expect(_AT_ONCE, Cause.SEVERAL_ROBOTS), seconds=0.3)
def several_robots(bench: FaultBench) -> None:
    bench.hooks.masks = lambda vessel, robot: (np.maximum(vessel, vessel[::-1]), np.maximum(robot, robot[::-1]))


@bench_fault(14, _expect(_AT_ONCE, Cause.OUTSIDE_VESSEL), seconds=0.3)
def outside(bench: FaultBench) -> None:
    bench.hooks.masks = lambda vessel, robot: (np.where(robot > 0.5, _OUT, np.roll(vessel, 80, axis=0)), robot)


@fault(15)
def ambiguous(kit: Kit) -> Observation:
    fork = (320.0, 240.0)
    vessel = np.max([_tube(fork, end, 20.0) for end in ((0.0, 240.0), (600.0, 80.0), (600.0, 400.0))], axis=0)
    cut = vessel.copy()
    cut[:, 460:] = _OUT  # both branches: symmetric to the pixel
    robot = _tube((-20.0, 240.0), fork, 5.0)
    with open_bench(kit) as bench:
        bench.hooks.masks = lambda v, r: (vessel, robot)
        bench.hand_over(target=(560.0, 103.0)).mark()
        bench.hooks.masks = lambda v, r: (cut, robot)
        bench.run(0.3)
        asks = "target" in ALERTS[Cause.BRANCH_UNCLEAR].what_to_do
        return judge(bench, _expect(_HELD, Cause.BRANCH_UNCLEAR), *check((asks, "the alert does not ask for a target")))


def _tube(start: Point, end: Point, radius_px: float) -> Probability:
    y, x = np.mgrid[:480, :640].astype(float)
    (x0, y0), (dx, dy) = start, (end[0] - start[0], end[1] - start[1])
    along = np.clip(((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy), 0.0, 1.0)
    inside = np.hypot(x - x0 - along * dx, y - y0 - along * dy) <= radius_px
    return np.asarray(np.where(inside, _IN, _OUT), np.float32)


# a head that stays at its new place is accepted after a while
@bench_fault(16, _expect(_HELD, Cause.HEAD_JUMP, alternatives=((Mode.HOLD, Mode.AUTONOMOUS),)), seconds=0.3)
def jump(bench: FaultBench) -> None:
    def shorten(vessel: Probability, robot: Probability) -> Masks:
        columns = np.flatnonzero((robot > 0.5).any(axis=0))
        short = robot.copy()
        short[:, columns[-1] - 70 :] = _OUT
        return vessel, short

    bench.hooks.masks = shorten


@fault(17)
def chatter(kit: Kit) -> Observation:
    frames = 0

    def swing(vessel: Probability, robot: Probability) -> Masks:
        nonlocal frames
        frames += 1
        tube, thread = np.full_like(vessel, _OUT), np.full_like(robot, _OUT)
        cv2.line(tube, (0, 240), (639, 240), float(_IN), 80)
        y = 246 if frames % 2 else 245
        cv2.line(thread, (0, y), (300, y), float(_IN), 10)
        return tube, thread

    def changes(states: Sequence[object]) -> int:
        return sum(a is not b for a, b in zip(states, states[1:], strict=False))

    with open_bench(kit) as bench:
        bench.hooks.masks = swing
        bench.hand_over(target=(600.0, 240.0)).mark()
        before = len(bench.ticks)
        bench.run(1.0)
        poses = [tick.scene.pose for tick in bench.ticks[before:] if tick.scene.pose is not None]
        limits = bench.config.perception.pose
        raw = changes([classify(pose.c_head_px, pose.c_tail_px, pose.theta_deg, limits) for pose in poses])
        shown = changes([pose.state for pose in poses])
        problems = check(
            (raw > 5, f"the bare thresholds changed the state {raw} times only"),
            (shown == 0, f"the state that is shown changed {shown} times"),
        )
        seen = judge(bench, ExpectedReaction(()), *problems)
        return replace(seen, reaction=f"goes on; {raw} changes by the bare thresholds, {shown} shown")


# ---- model


def _arm_unfit(kit: Kit, report: ModelReport, perceive: Perceive | None = None, *more: str) -> Observation:
    """Open the rig with a model that is not fit, and try to arm."""
    with open_bench(kit, model=report, perceive=perceive) as bench:
        bench.run(0.5)
        bench.switch_on()
        bench.mark()
        bench.pilot.ask(Act.ARM)
        bench.run(1.3)
        problems = check(
            (not report.ok, "the model passed for whole"),
            (bool(bench.ticks), "there are no pictures"),
            (Cause.MODEL_UNFIT in bench.view.against_arming, "it could be armed"),
        )
        # it was active before the mark: the session begins with it
        seen = judge(bench, ExpectedReaction((), (Cause.MODEL_UNFIT,)), *more, *problems)
        return replace(seen, reaction=f"refuses to arm, {len(bench.ticks)} pictures shown") if seen.ok else seen


def _arm_with_model(kit: Kit, folder: Path) -> Observation:
    settings = SegmentationConfig(model=str(folder), threads=1)
    perceive, report = EngineMaker()._perception(PerceptionConfig(segmentation=settings))
    return _arm_unfit(kit, report, perceive)


@fault(18)
def damaged_model(kit: Kit) -> Observation:
    def inject(kit: Kit, damage: str) -> Observation:
        folder = Path(shutil.copytree(model_folder("default"), kit.folder / "model"))
        for path in sorted(folder.glob("*.onnx")):
            data = bytearray(path.read_bytes())
            path.unlink()
            if damage != "missing":
                data[len(data) // 2] ^= 1
                path.write_bytes(data[: len(data) // 2] if damage == "cut" else data)
        return _arm_with_model(kit.part("sessions"), folder)

    return run_parts(kit, *((damage, partial(inject, damage=damage)) for damage in ("missing", "cut", "flipped")))


class _Canary:
    """What a malicious file would run when it is unpickled."""

    def __init__(self, path: str) -> None:
        self._path = path

    def __reduce__(self) -> tuple[object, tuple[str, str]]:
        return open, (self._path, "w")


@fault(19)
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
    try:
        load_network(folder)
        loaded = True
    except ModelError:
        loaded = False
    seen = _arm_with_model(kit.part("sessions"), folder)
    problems = check((not loaded, "the weights were loaded"), (not canary.exists(), "the code in the file ran"))
    return replace(seen, problems=(*seen.problems, *problems), reaction="refused, nothing ran; refuses to arm")


@fault(20)
def wrong_model(kit: Kit) -> Observation:
    plain = Config().perception
    world = TwinWorld(Config().twin, perception=plain)
    world.insert(70.0)
    masks = world.picture(world.physics.robot_points_mm())
    pipeline = open_pipeline(plain)
    single = pipeline._single

    class Swapped(Segmenter):
        engine = "swapped"

        def __call__(self, image: Image) -> Masks:
            vessel, robot = single.segment(image)
            return robot, vessel

    pipeline._single = replace(single, segment=Swapped())
    scene = pipeline.perceive_single(world.frame())
    info = read_model_info(model_folder("default"))
    verdict = judge_model("self-test", info, "swapped", scene, world.truth(), (masks.vessel, masks.robot))
    problems = check((not verdict.ok and "swapped" in verdict.detail, f"the self-test says: {verdict.detail}"))
    seen = _arm_unfit(kit, ModelReport(verdict.ok, verdict.detail), None, *problems)
    return replace(seen, reaction=f"refuses to arm: {verdict.detail}")


@fault(46)
def other_way(kit: Kit) -> Observation:
    def wired(change: Callable[[Sequence[float]], Sequence[float]], cause: Cause) -> Callable[[Kit], Observation]:
        def run(kit: Kit) -> Observation:
            with open_bench(kit, live=False) as bench:
                bench.hand_over().mark()
                robot = bench.robot
                assert isinstance(robot, LockStepServos)
                joints = JointsToTwin(bench.config.servos, change(robot.positions_mm()))
                bench.world.drive = lambda duration_s: joints.command(change(robot.positions_mm()), duration_s)
                bench.until(lambda view: view.latched is not None)
                return judge(bench, ExpectedReaction(_AT_ONCE, (cause,), latched=cause, may_hold=True))

        return run

    return run_parts(
        kit,
        ("right and left swapped", wired(lambda at: (at[1], at[0], *at[2:]), Cause.WRONG_TURN)),
        ("feed reversed", wired(lambda at: (*at[:4], -at[4], *at[5:]), Cause.WRONG_FEED)),
    )
