"""Preflight checks of the networks: their files are whole, and on a picture whose truth is known they see what is there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config.models import PerceptionConfig, SegmentationConfig, TwinConfig
from core.messages import message
from core.perception.model_file import ModelError, ModelInfo, check_all_files, model_folder, read_model_info, second_look_of
from core.types import Image, Mask, Scene
from hardware.preflight.checks import RENEW, Check, one_line

if TYPE_CHECKING:
    from hardware.twin.truth import Truth

SHIPPED = "default"
GOLDEN = TwinConfig(phantom="s_curve", appearance_seed=0, image_width_px=640, image_height_px=480)
"""Rendered, never filmed: the same phantom, look, noise and robot on every computer, and the truth with it."""
_GOLDEN_MM = 70.0
_THETA_DEG, _HEAD_PX = 8.0, 8.0
_OVERLAP = 0.5
_BRIGHTER = 1.5
"""Sums are large in a bright picture. Twice as bright the walls of the golden one are gone: there networks that differ by nothing
but rounding are 0.014 apart, and sums that overflow 0.025."""
_EIGHT_BIT_OFF, _EIGHT_BIT_NEAR_OFF = 0.01, 0.05
"""Mean difference of probability between eight-bit and exact network, in a whole picture (0.001 where all is well, 0.073 where sums
overflowed) and in a window around the robot's end, much of which is uncertain (0.004 where all is well)."""
_RESTORE = "git checkout -- resources/models   (or unpack the program again)"


def check_model(name: str) -> Check:
    """The hashes of all files of a model, and whether its confidence is calibrated."""
    try:
        folder = model_folder(name)
        info, files = read_model_info(folder, verify=()), check_all_files(folder)
        if (near := second_look_of(folder)) is not None:
            files += [f"{near.name}/{file}" for file in check_all_files(near)]
    except ModelError as error:
        return Check("model", False, one_line(error), _advice(name))
    if info.calibration is None or info.familiarity is None:
        text = "{name}: all {count} files are whole (SHA-256); its confidence is not calibrated: it drives no real rig"
        return Check("model", True, message(text, name=info.name, count=len(files)))
    return Check("model", True, message("{name}: all {count} files are whole (SHA-256)", name=info.name, count=len(files)))


def check_self_test(config: PerceptionConfig) -> Check:
    """Perceive the golden picture and compare with its truth.

    The shipped model must find state, theta and head. A model of the user's own, which may never have seen such a phantom, must not
    take the vessel for the robot. Of both, the eight-bit copy must answer on this processor as the exact network does.
    """
    name = "self-test"
    try:
        from core.perception.pipeline import open_pipeline
        from hardware.twin.world import TwinWorld

        info = read_model_info(model_folder(config.segmentation.model), verify=())
        plain = PerceptionConfig(segmentation=config.segmentation)
        pipeline = open_pipeline(plain)
        world = TwinWorld(GOLDEN, perception=plain, seed=0)
        world.insert(_GOLDEN_MM)
        frame, truth = world.frame(), world.truth()
        masks = world.picture(world.physics.robot_points_mm())
        scene = pipeline.perceive_single(frame)
        off = _eight_bit_off(config.segmentation, frame.image)
    except ModelError as error:
        return Check(name, False, f"not run: {one_line(error)}", _advice(config.segmentation.model))
    except (ImportError, RuntimeError, ValueError, OSError) as error:
        return Check(name, False, f"{type(error).__name__}: {one_line(error)}", RENEW)
    if off is not None:
        detail = f"{info.name}: on this processor the eight-bit network is off by {off}"
        return Check(name, False, detail, "set perception.segmentation.precision to fp32, or train the model on with this version")
    return judge(name, info, pipeline.engine, scene, truth, (masks.vessel, masks.robot))


def _eight_bit_off(config: SegmentationConfig, image: Image) -> str | None:
    """How far an eight-bit network is off where its sums are large, in a brighter picture; None: no more than it may."""
    from core.perception.inference import OpenVinoSegmenter, open_second_look, open_segmenter
    from core.perception.segmentation import window_around
    from core.perception.tip_refinement import WINDOW_PX, stack_planes

    used, used_near = open_segmenter(config), open_second_look(config)
    if not isinstance(used, OpenVinoSegmenter) or not used.is_eight_bit:
        return None
    exact = config.model_copy(update={"device": "openvino", "precision": "fp32"})
    bright = np.asarray(cv2.convertScaleAbs(image, alpha=_BRIGHTER), np.uint8)
    seen = open_segmenter(exact)(bright)
    # Three are seen as two at once, as single pictures are, and one by itself, as in a stream.
    found = [(_apart(one, seen), _EIGHT_BIT_OFF) for one in used.segment_batch([bright] * 3)]
    near = open_second_look(exact)
    if used_near is not None and near is not None:
        row, column = np.unravel_index(int(np.argmax(seen[1])), seen[1].shape)
        x, y, width, height = window_around((float(column), float(row)), (image.shape[1], image.shape[0]), WINDOW_PX)
        part = np.s_[y : y + height, x : x + width]
        planes = stack_planes(bright[part], seen[0][part], seen[1][part])
        exactly = near(planes)
        found += [(_apart(one, exactly), _EIGHT_BIT_NEAR_OFF) for one in used_near.segment_batch([planes] * 3)]
    return next((f"{off:.3f} (at most {allowed:g})" for off, allowed in found if off > allowed), None)


def _apart(some: Sequence[NDArray[np.float32]], others: Sequence[NDArray[np.float32]]) -> float:
    """The largest of the mean differences."""
    return max(float(np.abs(one - other).mean()) for one, other in zip(some, others, strict=True))


def judge(name: str, info: ModelInfo, engine: str, scene: Scene, truth: Truth, true_masks: tuple[Mask, Mask]) -> Check:
    """What was seen against what is there; `true_masks` are vessel and robot."""
    from core.evaluation.accuracy import dice

    milliseconds = f"first frame in {scene.latency_ms.get('total', 0.0):.0f} ms"
    advice = _advice(info.name) if info.name == SHIPPED else "train it with the twin's frames too, or choose another model"
    if scene.masks is not None:
        seen = (scene.masks.vessel, scene.masks.robot)
        overlaps = [[dice(mask, there) for there in true_masks] for mask in seen]
        if overlaps[0][1] > overlaps[0][0] or overlaps[1][0] > overlaps[1][1]:
            return Check(name, False, f"{info.name} takes the vessel for the robot: its outputs are swapped", advice)
        if info.name != SHIPPED:
            found = f"vessel {overlaps[0][0]:.2f}, robot {overlaps[1][1]:.2f} overlap on the golden picture"
            return Check(name, True, f"{engine}, {milliseconds}; a model of your own: {found}")
        if min(overlaps[0][0], overlaps[1][1]) < _OVERLAP:
            detail = f"{info.name} finds only {overlaps[0][0]:.0%} of the vessel and {overlaps[1][1]:.0%} of the robot"
            return Check(name, False, detail, advice)
    if scene.pose is None or scene.path is None or truth.pose is None or truth.head_xy is None:
        return Check(name, False, f"{info.name} gives no pose on the golden picture: {scene.refusal}", advice)
    theta_off = abs(scene.pose.theta_signed_deg - truth.pose.theta_signed_deg)
    head_off = float(np.hypot(*np.subtract(scene.path.head, truth.head_xy)))
    detail = (
        f"{engine}, {milliseconds}: state {scene.pose.state.value} (true {truth.pose.state.value}), "
        f"theta off by {theta_off:.1f} deg, head by {head_off:.1f} px"
    )
    good = scene.pose.state is truth.pose.state and theta_off <= _THETA_DEG and head_off <= _HEAD_PX
    return Check(name, good, detail, "" if good else advice)


def _advice(model: str) -> str:
    return _RESTORE if model == SHIPPED else "restore the model folder, or set perception.segmentation.model to another one"
