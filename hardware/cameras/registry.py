"""The registry of cameras, ``CAMERA_KINDS``: a row for each value of ``rig.camera``, for rig, device search, wizard and preflight.

A new camera is a file in this folder with a ``Sensor`` (see ``live``) or a ``Camera``, a row here, and its name in ``CAMERAS``
(``core/config/models.py``); or a plugin. Drivers are imported where they are used: their libraries take long to load, or may be
missing.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from core.config.models import CAMERAS, CameraConfig
from core.devices import Camera, DeviceError
from core.messages import message
from core.program import how_to_install
from hardware.cameras import sysfs

if TYPE_CHECKING:
    from hardware.preflight.checks import Check


@dataclass(frozen=True, slots=True)
class FoundCamera:
    """A camera that a rig can have. ``serial`` of a RealSense or Basler camera, ``device`` of a webcam."""

    kind: str
    title: str
    serial: str | None = None
    device: str | None = None


@dataclass(frozen=True, slots=True)
class CameraKind:
    """What can be done with a value of ``rig.camera``. Cameras that are made are not open yet.

    Attributes
    ----------
    live : the plugged-in camera of a configuration; None: there is no such camera.
    recorded : plays ``rig.source``; None: it cannot.
    find : the cameras that are plugged in. Raises ImportError, DeviceError.
    check : the preflight's check of the configured camera, without opening it. Raises ImportError, DeviceError.
    """

    title: str
    live: Callable[[CameraConfig], Camera] | None = None
    recorded: Callable[[Path], Camera] | None = None
    find: Callable[[], Sequence[FoundCamera]] = lambda: ()
    check: Callable[[CameraConfig], Check] | None = None


_LIBREALSENSE = "pyrealsense2"
"""The optional package of RealSense cameras."""


def _need_realsense() -> None:
    if find_spec(_LIBREALSENSE) is None:
        raise DeviceError("RealSense cameras need the package pyrealsense2: {command}", command=how_to_install(_LIBREALSENSE))


def _realsense_live(config: CameraConfig) -> Camera:
    _need_realsense()
    from hardware.cameras.realsense import realsense_camera

    return realsense_camera(config)


def _find_realsense() -> Sequence[FoundCamera]:
    if find_spec(_LIBREALSENSE) is None and not sysfs.realsense_on_usb():
        return ()
    _need_realsense()
    from hardware.cameras.realsense import find_cameras

    return [FoundCamera("realsense", camera.describe(), serial=camera.serial) for camera in find_cameras()]


_UDEV = (
    "install librealsense's udev rules: sudo cp 99-realsense-libusb.rules /etc/udev/rules.d/ "
    "&& sudo udevadm control --reload-rules && sudo udevadm trigger, then plug the camera in again"
)


def _check_realsense(config: CameraConfig) -> Check:
    """There, permitted, on a fast enough port, with a firmware that the library knows."""
    from hardware.preflight.checks import Check

    if find_spec(_LIBREALSENSE) is None:
        return Check("camera", False, message("RealSense cameras need the package pyrealsense2"), how_to_install(_LIBREALSENSE))
    from hardware.cameras.realsense import find_cameras

    cameras = find_cameras()
    chosen = [camera for camera in cameras if config.serial in {None, camera.serial}]
    if not chosen:
        if cameras:
            others = ", ".join(camera.serial for camera in cameras)
            detail, fix = f"no RealSense camera {config.serial}; there are: {others}", "set camera.serial to one of these"
        elif plugged := sysfs.realsense_on_usb():
            detail, fix = f"{plugged[0].product} is plugged in, but cannot be opened", _UDEV
        else:
            detail, fix = "no RealSense camera", "plug it into a USB 3 port; if it is: another cable, or another port"
        return Check("camera", False, detail, fix)
    if len(chosen) > 1:
        serials = ", ".join(camera.serial for camera in chosen)
        return Check("camera", False, f"{len(chosen)} RealSense cameras: {serials}", f'set camera.serial = "{chosen[0].serial}"')
    camera = chosen[0]
    speeds = [device.mbit_s for device in sysfs.realsense_on_usb() if len(cameras) == 1 or device.serial in {"", camera.serial}]
    if camera.usb.startswith(("1", "2")) or any(0 < speed < sysfs.USB3_MBIT_S for speed in speeds):
        fix = "use a blue USB 3 port and the camera's own cable: on USB 2 it gives 640x480 at most, and loses frames"
        return Check("camera", False, camera.describe(), fix)
    if camera.is_outdated:
        fix = f"update its firmware to {camera.recommended_firmware}: realsense-viewer, or rs-fw-update -s {camera.serial} -f FILE"
        return Check("camera", False, camera.describe(), fix)
    return Check("camera", True, camera.describe())


def _webcam_live(config: CameraConfig) -> Camera:
    from hardware.cameras.webcam import webcam_camera

    return webcam_camera(config)


def _find_webcams() -> Sequence[FoundCamera]:
    return [FoundCamera("webcam", f"{device.title} ({device.path})", device=device.path) for device in sysfs.video_devices()]


def _check_webcam(config: CameraConfig) -> Check:
    from hardware.preflight.checks import Check

    devices, wanted = sysfs.video_devices(), config.device
    if wanted is not None:
        node = sysfs.webcam_node(wanted)
        known = [device.title for device in devices if device.node.resolve() == node.resolve()]
        note = f"{wanted}, {known[0]}" if known else wanted
        if not node.exists():
            paths = ", ".join(device.path for device in devices) or "none"
            return Check("camera", False, f"{wanted} is not there; webcams: {paths}", "plug it in, or set camera.device")
    elif devices:
        node, note = devices[0].node, f"{devices[0].title}, the first of {len(devices)}"
    else:
        return Check("camera", False, "no webcam", "plug it in; if it is: another cable, or another port")
    if not os.access(node, os.R_OK | os.W_OK):
        return Check(
            "camera", False, message("no permission for {node}", node=node), "sudo usermod -aG video $USER, then log in again"
        )
    return Check("camera", True, note)


def _basler_live(config: CameraConfig) -> Camera:
    from hardware.cameras.basler import basler_camera

    return basler_camera(config)


_PYPYLON = "pypylon"
"""The optional package of Basler's cameras."""
_BASLER_UDEV = (
    """echo 'SUBSYSTEM=="usb", ATTRS{idVendor}=="2676", MODE="0666"' | sudo tee /etc/udev/rules.d/69-basler-cameras.rules """
    "&& sudo udevadm control --reload-rules && sudo udevadm trigger, then plug the camera in again"
)


def _find_basler() -> Sequence[FoundCamera]:
    """Most computers have neither package nor camera: that is no problem there."""
    if find_spec(_PYPYLON) is None and not sysfs.basler_on_usb():
        return ()
    from hardware.cameras.basler import find_cameras

    return [FoundCamera("basler", f"{camera.name} {camera.serial}", serial=camera.serial) for camera in find_cameras()]


def _check_basler(config: CameraConfig) -> Check:
    from hardware.preflight.checks import Check

    if find_spec(_PYPYLON) is None:
        return Check("camera", False, message("Basler cameras need the package pypylon"), how_to_install(_PYPYLON))
    from hardware.cameras.basler import find_cameras

    cameras = find_cameras()
    chosen = [camera for camera in cameras if config.serial in {None, camera.serial}]
    serials = ", ".join(camera.serial for camera in cameras)
    if len(chosen) == 1:
        return Check("camera", True, f"{chosen[0].name} {chosen[0].serial}")
    if chosen:
        fix = f'set camera.serial = "{chosen[0].serial}"'
        return Check("camera", False, message("{a} Basler cameras: {serials}", a=len(chosen), serials=serials), fix)
    if cameras:
        detail = message("no Basler camera {serial}; there are: {serials}", serial=config.serial, serials=serials)
        return Check("camera", False, detail, "set camera.serial to one of these")
    if plugged := sysfs.basler_on_usb():
        detail = message("{camera} is plugged in, but cannot be opened", camera=plugged[0].product)
        return Check("camera", False, detail, _BASLER_UDEV)
    fix = message("plug it into a USB 3 port; on a network: its supply, its cable, and an address in this computer's network")
    return Check("camera", False, message("no Basler camera"), fix)


def _video_file(source: Path) -> Camera:
    from hardware.cameras.files import VideoFile

    return VideoFile(source)


def _image_folder(source: Path) -> Camera:
    from hardware.cameras.files import ImageFolder

    return ImageFolder(source)


CAMERA_KINDS: dict[str, CameraKind] = {
    "twin": CameraKind("bench twin"),  # opened by the rig, together with its robot
    "realsense": CameraKind("RealSense", _realsense_live, None, _find_realsense, _check_realsense),
    "webcam": CameraKind("webcam", _webcam_live, None, _find_webcams, _check_webcam),
    "basler": CameraKind("Basler", _basler_live, None, _find_basler, _check_basler),
    "video_file": CameraKind("video", recorded=_video_file),
    "image_folder": CameraKind("pictures", recorded=_image_folder),
}


def camera_kind(name: str) -> CameraKind:
    """What can be done with a value of ``rig.camera``; a plugin's camera is only made, which may raise PluginError."""
    return CAMERA_KINDS.get(name) or CameraKind(name, partial(CAMERAS.make, name))
