"""The configured camera, and which cameras there are.

The servo port, the servos behind it, and the adapter's latency. Only looks: no torque, no goal, no setting is ever written.

Foot pedal and gamepad, where they are configured.
"""

from __future__ import annotations

import errno
import fcntl
import grp
import os
import select
import stat
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from core.config.models import Config, GamepadConfig, PedalConfig
from core.config.safety import ServosConfig
from core.devices import Camera, DeviceError
from core.types import Frame
from hardware.preflight.checks import NOT_CONFIGURED, REALSENSE, RENEW, Check, load_problem, one_line
from hardware.rig import RigKind, kind_of, real_camera
from hardware.servos.discovery import DEV, SYS, USB3_MBIT_S, latency_timer, realsense_on_usb, video_devices

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
    return _judge_camera(config, frames)


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


def _judge_camera(config: Config, frames: Sequence[Frame]) -> Check:
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


_MAX_LATENCY_MS = 2
_TORQUE, _ERROR, _VOLTAGE = 64, 70, 144


def check_servo_port(port: str | None, *, wanted: bool = False) -> Check:
    """There, permitted, a serial port, and no other program on it; `wanted` by a rig with servos."""
    name = "servo port"
    if port is None and wanted:
        return Check(name, False, "the rig has servos, but no port", "set servos.port (ls /dev/serial/by-id)")
    if port is None:
        return Check(name, True, NOT_CONFIGURED)
    path = Path(port)
    try:
        mode = path.stat().st_mode
    except OSError as error:
        reason = "is not there" if error.errno in {errno.ENOENT, errno.ENOTDIR} else f"cannot be seen ({error.strerror})"
        return Check(name, False, f"{port} {reason}", "plug the USB adapter in, or set servos.port (ls /dev/serial/by-id)")
    if not stat.S_ISCHR(mode):
        return Check(name, False, f"{port} is no serial port", "set servos.port (ls /dev/serial/by-id)")
    if not os.access(path, os.R_OK | os.W_OK):
        return Check(name, False, f"no permission for {port} (group {_group(path)})", _join(_group(path)))
    return _check_lock(name, port)


def _check_lock(name: str, port: str) -> Check:
    try:
        handle = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        busy = error.errno == errno.EBUSY
        fix = f"close the program that has it (fuser -v {port})" if busy else "unplug the USB adapter and plug it in again"
        return Check(name, False, f"{port} cannot be opened ({error.strerror})", fix)
    try:
        if not os.isatty(handle):
            return Check(name, False, f"{port} is no serial port", "set servos.port (ls /dev/serial/by-id)")
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        fix = f"close the program that has it (fuser -v {port}); it may be LumenPilot itself"
        return Check(name, False, f"{port} is in use by another program", fix)
    finally:
        os.close(handle)
    target = os.path.realpath(port)
    return Check(name, True, f"{port} is free" + (f" ({target})" if target != port else ""))


def _group(path: Path) -> str:
    number = path.stat().st_gid
    try:
        return grp.getgrgid(number).gr_name
    except KeyError:
        return str(number)


def _join(group: str) -> str:
    """What makes the port permitted for good. Root's own group is a port that udev has not seen."""
    return f"sudo usermod -aG {'dialout' if group in {'root', '0'} else group} $USER, then log in again"


def check_servos(config: ServosConfig) -> Check:
    """All seven answer, are the configured model, and report no trouble."""
    name = "servos"
    if config.port is None:
        return Check(name, True, NOT_CONFIGURED)
    try:
        from hardware.servos.dynamixel_bus import identify
        from hardware.servos.dynamixel_port import PortError, ServoError, ServoLine
    except ImportError as error:
        return Check(name, False, one_line(error), RENEW)
    line = ServoLine(config.port, config.baud)
    try:
        line.open()
        found = identify(line, config)
        readings = [
            (joint.name, *_reading(line.read(joint.id, _TORQUE, 7), line.read(joint.id, _VOLTAGE, 3))) for joint in config.joints
        ]
    except PortError as error:
        return Check(name, False, f"not asked: {one_line(error)}", "see the servo port")
    except ServoError as error:
        return Check(name, False, one_line(error), "switch the servos' 12 V on, check the cables, servos.baud and the joints' ids")
    finally:
        line.close()
    firmware = sorted({identity.firmware for identity in found})
    return _judge_servo(
        name, config, readings, f"{len(found)} answer, model {config.model}, firmware {', '.join(map(str, firmware))}"
    )


def _reading(status: bytes, supply: bytes) -> tuple[bool, int, float, float]:
    """Torque, hardware error, volts, degrees Celsius from registers 64 to 70 and 144 to 146."""
    return status[0] == 1, status[_ERROR - _TORQUE], int.from_bytes(supply[:2], "little") / 10.0, float(supply[2])


def _judge_servo(name: str, config: ServosConfig, readings: Sequence[tuple[str, bool, int, float, float]], what: str) -> Check:
    from hardware.servos.registers import HardwareError, describe

    volts, degrees = min(reading[3] for reading in readings), max(reading[4] for reading in readings)
    torque = [reading[0] for reading in readings if reading[1]]
    torque_text = f"torque on: {', '.join(torque)}" if torque else "torque off"
    detail = f"{what}; {volts:.1f} V at least, {degrees:.0f} \N{DEGREE SIGN}C at most, {torque_text}"
    if broken := [f"{reading[0]}: {describe(HardwareError(reading[2]))}" for reading in readings if reading[2]]:
        fix = "find the reason (jam, heat, supply), then restart that servo in the servo table"
        return Check(name, False, f"hardware error, {'; '.join(broken)}", fix)
    if volts < config.min_voltage_v:
        return Check(name, False, detail, f"the supply must give {config.min_voltage_v:g} V or more at every servo")
    if degrees > config.max_temperature_c:
        return Check(name, False, detail, f"let it cool below {config.max_temperature_c:g} \N{DEGREE SIGN}C")
    return Check(name, True, detail)


def check_latency(port: str | None, sys: Path = SYS) -> Check:
    """How long an FTDI adapter keeps bytes back. The driver sets it when it opens the port, so it is looked at after that."""
    name = "adapter latency"
    if port is None:
        return Check(name, True, NOT_CONFIGURED)
    timer = latency_timer(Path(port), sys)
    if timer is None:
        return Check(name, True, f"{port} has no latency timer to set")
    try:
        latency_ms = int(timer.read_text(encoding="ascii"))
    except (OSError, ValueError) as error:
        return Check(name, False, f"{timer} cannot be read ({one_line(error)})", "unplug the USB adapter and plug it in again")
    detail = f"{latency_ms} ms ({timer})"
    if latency_ms > _MAX_LATENCY_MS:
        return Check(name, False, f"{detail}: the bus needs 1 ms for 50 cycles a second", f"echo 1 | sudo tee {timer}")
    return Check(name, True, detail)


_LISTEN_S = 3.5
"""Opening the port restarts many boards; they talk again after some seconds."""


def check_pedal(config: PedalConfig, listen_s: float = _LISTEN_S) -> Check:
    """The pedal reports, and its STOP is not pressed."""
    name = "foot pedal"
    if config.port is None:
        return Check(name, True, NOT_CONFIGURED)
    try:
        from hardware.inputs.pedal import PedalParser, open_pedal_port

        port = open_pedal_port(config)
    except (ImportError, DeviceError) as error:
        return Check(name, False, one_line(error), "plug the pedal in, set pedal.port (ls /dev/serial/by-id), close other programs")
    parser, heard = PedalParser(), 0
    until_s = time.monotonic() + listen_s
    try:
        poll = select.poll()
        poll.register(port.fd, select.POLLIN)
        while (left_s := until_s - time.monotonic()) > 0.0:
            if not poll.poll(1000.0 * left_s):
                break
            data = port.read()
            heard += len(data)
            for line in parser.feed(data):
                if line is not None and line.stop:
                    return Check(
                        name, False, f"{config.port}: STOP is pressed, or its wire is broken", "release STOP; check its wire"
                    )
                if line is not None:
                    return Check(name, True, f"{config.port} reports; deadman {'pressed' if line.down else 'released'}")
    except DeviceError as error:
        return Check(name, False, one_line(error), "check its USB cable")
    finally:
        port.close()
    if heard:
        return Check(name, False, f"what comes from {config.port} is no pedal's report", "check pedal.port and pedal.baud")
    return Check(name, False, f"{config.port} is silent", "check the pedal's power and firmware, then plug it in again")


def check_gamepad(config: GamepadConfig) -> Check:
    """The configured gamepad is there; without one configured, none is missed."""
    name = "gamepad"
    if not config.enabled:
        return Check(name, True, NOT_CONFIGURED)
    from hardware.inputs.gamepad import GamepadError, find_gamepad

    try:
        found = find_gamepad(config)
    except GamepadError as error:
        return Check(name, False, one_line(error), "plug it in, sudo usermod -aG input $USER, or set gamepad.enabled = false")
    if found is None:
        return Check(name, True, f"{NOT_CONFIGURED}; none is plugged in")
    device, title, _ = found
    os.close(device)
    return Check(name, True, title)
