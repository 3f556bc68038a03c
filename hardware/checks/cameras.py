"""The configured camera, and which cameras there are."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from core.config import Config
from core.devices import Camera, DeviceError
from core.types import Frame
from hardware.checks.check import Check, one_line
from hardware.checks.program import REALSENSE, load_problem
from hardware.rig import RigKind, kind_of, real_camera
from hardware.usb import DEV, SYS, USB3_MBIT_S, realsense_on_usb, video_devices

if TYPE_CHECKING:
    from hardware.cameras.realsense import RealSenseInfo

_SEE_LIBRARIES = "see the vendor libraries in main.py doctor"
_FIRST_WITHIN_S, _WATCHED_S = 6.0, 1.5
_FEWEST = 3
_LEAST_RATE = 0.8
_UDEV = (
    "install librealsense's udev rules: sudo cp 99-realsense-libusb.rules /etc/udev/rules.d/ "
    "&& sudo udevadm control --reload-rules && sudo udevadm trigger, then plug the camera in again"
)


def _realsense() -> Sequence[RealSenseInfo]:
    _check_realsense_library()
    from hardware.cameras.realsense import find_cameras

    return find_cameras()


def _check_realsense_library() -> None:
    """Raises ImportError. A library cut short ends whoever loads it with a memory fault, and all checks with it."""
    if problem := load_problem(REALSENSE):
        raise ImportError(f"the library of RealSense cameras cannot be used: {problem}")


def _camera_of(config: Config) -> Camera:
    if config.rig.camera == "realsense":
        _check_realsense_library()
    return real_camera(config)


def check_camera(
    config: Config, found: Callable[[], Sequence[RealSenseInfo]] = _realsense, dev: Path = DEV, sys: Path = SYS
) -> Check:
    """The rig's camera: there, permitted, on a fast enough port."""
    rig = config.rig
    if rig.camera == "twin":
        return Check("camera", True, "the bench twin needs none")
    if rig.source is not None or rig.camera in {"video_file", "image_folder"}:
        there = rig.source is not None and Path(rig.source).exists()
        detail = f"{rig.camera}: {rig.source}" + ("" if there else " is not there")
        return Check("camera", there, detail, "" if there else "set rig.source to the recording, video or folder")
    return _check_webcam(config, dev, sys) if rig.camera == "webcam" else _check_realsense(config, found, sys)


def _check_realsense(config: Config, found: Callable[[], Sequence[RealSenseInfo]], sys: Path) -> Check:
    wanted = config.camera.serial
    try:
        cameras = list(found())
    except (ImportError, DeviceError) as error:
        return Check("camera", False, one_line(error), _SEE_LIBRARIES)
    chosen = [camera for camera in cameras if wanted in {None, camera.serial}]
    if not chosen:
        return _no_realsense(wanted, cameras, sys)
    if len(chosen) > 1:
        serials = ", ".join(camera.serial for camera in chosen)
        return Check("camera", False, f"{len(chosen)} RealSense cameras: {serials}", f'set camera.serial = "{chosen[0].serial}"')
    camera = chosen[0]
    speeds = [device.mbit_s for device in realsense_on_usb(sys) if len(cameras) == 1 or device.serial in {"", camera.serial}]
    on_usb2 = camera.usb.startswith(("1", "2")) or any(0 < speed < USB3_MBIT_S for speed in speeds)
    if on_usb2:
        fix = "use a blue USB 3 port and the camera's own cable: on USB 2 it gives 640x480 at most, and loses frames"
        return Check("camera", False, camera.describe(), fix)
    if camera.is_outdated:
        fix = f"update its firmware to {camera.recommended_firmware}: realsense-viewer, or rs-fw-update -s {camera.serial} -f FILE"
        return Check("camera", False, camera.describe(), fix)
    return Check("camera", True, camera.describe())


def _no_realsense(wanted: str | None, cameras: Sequence[RealSenseInfo], sys: Path) -> Check:
    if cameras:
        others = ", ".join(camera.serial for camera in cameras)
        return Check("camera", False, f"no RealSense camera {wanted}; there are: {others}", "set camera.serial to one of these")
    if plugged := realsense_on_usb(sys):
        return Check("camera", False, f"{plugged[0].product} is plugged in, but cannot be opened", _UDEV)
    return Check("camera", False, "no RealSense camera", "plug it into a USB 3 port; if it is: another cable, or another port")


def _check_webcam(config: Config, dev: Path, sys: Path) -> Check:
    devices = video_devices(dev, sys)
    wanted = config.camera.device
    if not devices and wanted is None:
        return Check("camera", False, "no webcam", "plug it in; if it is: another cable, or another port")
    if wanted is None:
        node, note = devices[0].node, f"{devices[0].title}, the first of {len(devices)}"
    else:
        node = dev / f"video{wanted}" if wanted.isdigit() else Path(wanted)
        known = [device.title for device in devices if device.node.resolve() == node.resolve()]
        note = f"{wanted}, {known[0]}" if known else wanted
        if not node.exists():
            paths = ", ".join(str(device.stable or device.node) for device in devices) or "none"
            return Check("camera", False, f"{wanted} is not there; webcams: {paths}", "plug it in, or set camera.device")
    if not os.access(node, os.R_OK | os.W_OK):
        return Check("camera", False, f"no permission for {node}", "sudo usermod -aG video $USER, then log in again")
    return Check("camera", True, note)


def check_picture(config: Config, make_camera: Callable[[Config], Camera] = _camera_of, watched_s: float = _WATCHED_S) -> Check:
    """A real camera is opened for a moment: it gives frames, at its rate, and they are neither black nor white nor blurred."""
    name = "picture"
    if kind_of(config.rig) is not RigKind.LIVE:
        return Check(name, True, "only real cameras are tried")
    try:
        camera = make_camera(config)
        try:
            camera.open()
            frames = _watch(camera, watched_s)
        finally:
            camera.close()
    except ImportError as error:
        return Check(name, False, one_line(error), _SEE_LIBRARIES)
    except DeviceError as error:
        return Check(name, False, one_line(error), "see the camera; close other programs that use it (fuser -v /dev/video*)")
    if len(frames) < _FEWEST:
        return Check(name, False, f"{len(frames)} frames in {watched_s:g} s", "check the cable; another USB port, without a hub")
    return _judge(config, frames)


def _watch(camera: Camera, watched_s: float) -> list[Frame]:
    """Frames of so many seconds, from the first one on."""
    frames: list[Frame] = []
    until_s = time.monotonic() + _FIRST_WITHIN_S
    while time.monotonic() < until_s:
        frame = camera.read(0.1)
        if frame is not None:
            until_s = until_s if frames else time.monotonic() + watched_s
            frames.append(frame)
    return frames


def _judge(config: Config, frames: Sequence[Frame]) -> Check:
    from core.perception.quality import check_image
    from core.perception.segmentation import to_working

    name, first, last = "picture", frames[0], frames[-1]
    rate = (last.index - first.index) / max(last.captured_s - first.captured_s, 1e-6)
    height, width = last.image.shape[:2]
    detail = f"{width}x{height}, {rate:.1f} frames/s, {last.lost} lost, brightness {last.image.mean():.0f} of 255"
    asked = config.camera.frames_per_second
    if rate < _LEAST_RATE * asked:
        fix = f"it should give {asked}: more light, camera.exposure_ms below {1000 / asked:.0f}, or a USB 3 port without a hub"
        return Check(name, False, detail, fix)
    refusal = check_image(to_working(last.image, config.perception.working_size_px)[0], config.perception.quality)
    if refusal is not None:
        return Check(name, False, f"{detail}; {refusal}", "lens cap, lamp, focus; or set camera.exposure_ms")
    return Check(name, True, detail)


def list_cameras(found: Callable[[], Sequence[RealSenseInfo]] = _realsense, dev: Path = DEV, sys: Path = SYS) -> Check:
    """All cameras that this computer has, for those who set up a rig. Never a failure."""
    try:
        lines = [camera.describe() for camera in found()]
    except (ImportError, DeviceError) as error:
        lines = [f"RealSense: {one_line(error)}"]
    lines += [f"{device.title} ({device.stable or device.node})" for device in video_devices(dev, sys)]
    return Check("cameras found", True, "; ".join(lines) or "none")
