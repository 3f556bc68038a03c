"""Preflight checks of the rig's devices: camera, servo port and servos, foot pedal, gamepad.

They only look: no torque, no goal, no setting is ever written.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import grp
import os
import select
import shlex
import shutil
import stat
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from core.config.acceptance import AcceptanceError, problems_of, read_acceptance
from core.config.models import Config, GamepadConfig, PedalConfig
from core.config.rig_file import RigFileError, as_calibrated, rig_in_use
from core.config.safety import LIMITS_FORCE, ServosConfig
from core.control.alerts import ALERTS
from core.control.readiness import read_readiness
from core.devices import Camera, DeviceError
from core.messages import message
from core.program import CALLED
from core.types import Frame
from hardware.cameras import sysfs
from hardware.cameras.registry import CAMERA_KINDS, camera_kind
from hardware.preflight.checks import NOT_CONFIGURED, RENEW, Check, one_line
from hardware.processes import holders
from hardware.rig import RigKind, kind_of, real_camera

_FIRST_FRAME_WITHIN_S, _WATCHED_S = 6.0, 1.5
_FEWEST_FRAMES = 3
_LEAST_RATE = 0.8
"""Of the frame rate that the camera is asked for."""


def check_camera(config: Config) -> Check:
    """The rig's camera: there, permitted, on a fast enough port."""
    rig = config.rig
    if rig.camera == "twin":
        return Check("camera", True, "the bench twin needs none")
    kind = camera_kind(rig.camera)
    if kind.live is not None and kind.check is None and rig.source is None:
        return Check("camera", True, f"{rig.camera}, of a plugin: see its picture")
    if rig.source is not None or kind.check is None:
        there = rig.source is not None and Path(rig.source).exists()
        detail = f"{rig.camera}: {rig.source}" + ("" if there else " is not there")
        return Check("camera", there, detail, "" if there else "set rig.source to the recording, video or folder")
    try:
        return kind.check(config.camera)
    except (ImportError, DeviceError) as error:
        return Check("camera", False, one_line(error), RENEW if isinstance(error, ImportError) else "")


def check_picture(config: Config, make_camera: Callable[[Config], Camera] = real_camera, watched_s: float = _WATCHED_S) -> Check:
    """A real camera is opened for a moment: it gives frames, at its rate, and they are neither black nor white nor blurred."""
    name = "picture"
    if kind_of(config.rig) is not RigKind.LIVE:
        return Check(name, True, "only real cameras are tried")
    frames: list[Frame] = []
    try:
        camera = make_camera(config)
        try:
            camera.open()
            until_s = time.monotonic() + _FIRST_FRAME_WITHIN_S
            while time.monotonic() < until_s:
                frame = camera.read(0.1)
                if frame is not None:
                    until_s = until_s if frames else time.monotonic() + watched_s
                    frames.append(frame)
        finally:
            camera.close()
    except ImportError as error:
        return Check(name, False, one_line(error), RENEW)
    except DeviceError as error:
        return Check(name, False, one_line(error), "see the camera; close other programs that use it (fuser -v /dev/video*)")
    if len(frames) < _FEWEST_FRAMES:
        return Check(
            name,
            False,
            message("{a} frames in {b:g} s", a=len(frames), b=watched_s),
            "check the cable; another USB port, without a hub",
        )
    return _judge_frames(config, frames)


def _judge_frames(config: Config, frames: Sequence[Frame]) -> Check:
    from core.perception.quality import check_image
    from core.perception.segmentation import to_working

    name, first, last = "picture", frames[0], frames[-1]
    rate = (last.index - first.index) / max(last.captured_s - first.captured_s, 1e-6)
    height, width = last.image.shape[:2]
    detail = message(
        "{a}x{b}, {rate:.1f} frames/s, {c} lost, brightness {light:.0f} of 255",
        a=width,
        b=height,
        rate=rate,
        c=last.lost,
        light=last.image.mean(),
    )
    asked = config.camera.frames_per_second
    if rate < _LEAST_RATE * asked:
        fix = message(
            "it should give {a}: more light, camera.exposure_ms below {b:.0f}, or a USB 3 port without a hub",
            a=asked,
            b=1000 / asked,
        )
        return Check(name, False, detail, fix)
    refusal = check_image(to_working(last.image, config.perception.working_size_px)[0], config.perception.quality)
    if refusal is not None:
        return Check(name, False, f"{detail}; {refusal}", "lens cap, lamp, focus; or set camera.exposure_ms")
    return Check(name, True, detail)


def check_readiness(config: Config) -> Check:
    """Whether the program may drive this rig; without it a real one stays advisory."""
    name = "driving by program"
    if kind_of(config.rig) is not RigKind.LIVE or config.rig.robot == "none":
        return Check(name, True, "only asked of a rig with a real robot")
    try:
        found = read_readiness(as_calibrated(config))
    except RigFileError as error:
        return Check(name, False, one_line(error), "mend the rig file, or calibrate the rig")
    lacks = [ALERTS[hindrance] for hindrance in found.hindrances]
    if not lacks:
        deadman = "" if found.keyboard_deadman else "; with pedal or gamepad as deadman"
        return Check(name, True, f"directions, steering, model and policy are as needed{deadman}")
    return Check(name, False, "; ".join(lack.text for lack in lacks), "; ".join(lack.what_to_do for lack in lacks))


def check_acceptance(config: Config) -> Check:
    """Whether a rig with real servos was accepted, and nothing has changed since."""
    name = "acceptance"
    if kind_of(config.rig) is not RigKind.LIVE or config.rig.robot == "none":
        return Check(name, True, "only asked of a rig with a real robot")
    again = f"{CALLED} rig accept {shlex.quote(config.rig.name)}"
    try:
        found = rig_in_use(config)
        accepted = read_acceptance(found[0]) if found is not None else None
    except (AcceptanceError, RigFileError) as error:
        return Check(name, False, one_line(error), f"{again} --anew")
    firmware: tuple[int, ...] = ()
    with contextlib.suppress(ImportError, DeviceError):  # what hinders it is told by other checks
        firmware = _firmware(config.servos)
    if problems := problems_of(accepted, config, firmware):
        return Check(name, False, "; ".join(problems), again)
    assert accepted is not None
    return Check(name, True, f"by {accepted.operator}, {accepted.finished_utc or accepted.begun_utc:%Y-%m-%d}")


def _firmware(servos: ServosConfig) -> tuple[int, ...]:
    """Versions of the servos' firmware, by joint. Raises DeviceError."""
    from hardware.servos.dynamixel_bus import identify
    from hardware.servos.dynamixel_port import ServoLine

    line = ServoLine(servos.port or "", servos.baud)
    line.open()
    try:
        return tuple(found.firmware for found in identify(line, servos))
    finally:
        line.close()


def list_cameras() -> Check:
    """All cameras that this computer has, for those who set up a rig. Never a failure."""
    lines = []
    for kind in CAMERA_KINDS.values():
        try:
            lines += [camera.title for camera in kind.find()]
        except (ImportError, DeviceError) as error:
            lines.append(f"{kind.title}: {one_line(error)}")
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
        return Check(name, False, message("{port} is no serial port", port=port), "set servos.port (ls /dev/serial/by-id)")
    if not os.access(path, os.R_OK | os.W_OK):
        group = _group(path)  # root's own is that of a port that udev has not seen
        fix = f"sudo usermod -aG {'dialout' if group in {'root', '0'} else group} $USER, then log in again"
        return Check(name, False, f"no permission for {port} (group {group})", fix)
    try:
        handle = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        if error.errno == errno.EBUSY:
            return _taken(name, port)
        return Check(name, False, f"{port} cannot be opened ({error.strerror})", "unplug the USB adapter and plug it in again")
    try:
        if not os.isatty(handle):
            return Check(name, False, message("{port} is no serial port", port=port), "set servos.port (ls /dev/serial/by-id)")
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return _taken(name, port)
    finally:
        os.close(handle)
    if holders(port):
        return _taken(name, port)
    target = os.path.realpath(port)
    return Check(name, True, message("{port} is free", port=port) + (f" ({target})" if target != port else ""))


def _taken(name: str, port: str) -> Check:
    """The port is open in another program, which is named if this user may see it."""
    who = ", ".join(holders(port))
    what = message("{port} is in use by another program", port=port) + (f": {who}" if who else "")
    return Check(name, False, what, f"close that program (sudo fuser -v {port}); it may be LumenPilot itself")


def _group(path: Path) -> str:
    number = path.stat().st_gid
    try:
        return grp.getgrgid(number).gr_name
    except KeyError:
        return str(number)


def check_servos(config: ServosConfig) -> Check:
    """All servos answer, are the configured model, and report no trouble."""
    name = "servos"
    if config.port is None:
        return Check(name, True, NOT_CONFIGURED)
    if config.driver != "dynamixel":
        return Check(name, True, f"{config.driver}: its axes are asked when the rig is opened")
    try:
        from hardware.servos.dynamixel_bus import identify
        from hardware.servos.dynamixel_port import PortError, ServoError, ServoLine
        from hardware.servos.registers import HardwareError, describe
    except ImportError as error:
        return Check(name, False, one_line(error), RENEW)
    line = ServoLine(config.port, config.baud)
    try:
        line.open()
        found = identify(line, config)
        tables = {joint.name: (line.read(joint.id, _TORQUE, 7), line.read(joint.id, _VOLTAGE, 3)) for joint in config.joints}
    except PortError as error:
        return Check(name, False, f"not asked: {one_line(error)}", "see the servo port")
    except ServoError as error:
        return Check(name, False, one_line(error), "switch the servos' supply on, check cables, servos.baud and the joints' ids")
    finally:
        line.close()
    firmware = ", ".join(map(str, sorted({identity.firmware for identity in found})))
    # registers 64 (torque) to 70 (hardware error), and 144 (voltage in 0.1 V) to 146 (temperature)
    volts = min(int.from_bytes(supply[:2], "little") / 10.0 for _, supply in tables.values())
    degrees = max(float(supply[2]) for _, supply in tables.values())
    models = ", ".join(dict.fromkeys(config.model_of(joint).name for joint in config.joints))
    what = message("{a} answer, {models}, firmware {rest}", a=len(found), models=models, rest=firmware)
    on = ", ".join(joint for joint, (status, _) in tables.items() if status[0] == 1)
    torque = f"torque on: {on}" if on else "torque off"
    detail = f"{what}; {volts:.1f} V at least, {degrees:.0f} \N{DEGREE SIGN}C at most, {torque}"
    errors = {joint: HardwareError(status[_ERROR - _TORQUE]) for joint, (status, _) in tables.items()}
    if broken := [f"{joint}: {describe(error)}" for joint, error in errors.items() if error]:
        fix = "find the reason (jam, heat, supply), then restart that servo in the servo table"
        return Check(name, False, f"hardware error, {'; '.join(broken)}", fix)
    for joint in config.joints:
        supply = tables[joint.name][1]
        if int.from_bytes(supply[:2], "little") / 10.0 < config.lowest_v(joint):
            fix = message("the supply must give {a:g} V or more at servo {joint}", a=config.lowest_v(joint), joint=joint.name)
            return Check(name, False, detail, fix)
        if supply[2] > config.hottest_c(joint):
            return Check(
                name, False, detail, message("let {joint} cool below {a:g} °C", joint=joint.name, a=config.hottest_c(joint))
            )
    return Check(name, True, detail)


def check_bus_speed(config: ServosConfig) -> Check:
    """Whether the configured speed leaves time for the cycles. Servos come from the factory at 57600 baud, which is too slow."""
    name = "bus speed"
    if config.port is None or config.driver != "dynamixel":
        return Check(name, True, NOT_CONFIGURED)
    from hardware.servos.discovery import FASTER_BUS, slow_bus

    if slow := slow_bus(config.baud, config.bus_hz):
        return Check(name, False, slow, FASTER_BUS)
    return Check(name, True, message("{baud} baud", baud=config.baud))


def check_adapter_power(port: str | None) -> Check:
    """Whether the system may put the servos' USB adapter to sleep when it is idle, which TLP and powertop switch on."""
    name = "adapter power"
    if port is None:
        return Check(name, True, NOT_CONFIGURED)
    device = (sysfs.SYS / "class" / "tty" / Path(port).resolve().name / "device").resolve()
    usb = next((folder for folder in (device, *device.parents) if (folder / "idVendor").is_file()), None)
    control = usb / "power" / "control" if usb is not None else None
    if control is None or not control.is_file():
        return Check(name, True, f"{port} is no USB adapter")
    try:
        setting = control.read_text(encoding="ascii").strip()
    except (OSError, ValueError) as error:
        return Check(name, False, f"{control} cannot be read ({one_line(error)})", "unplug the USB adapter and plug it in again")
    if setting == "auto":
        fix = f"echo on | sudo tee {control}; for good: exclude it from autosuspend in TLP or powertop"
        return Check(name, False, f"USB autosuspend may put it to sleep ({control})", fix)
    return Check(name, True, f"no USB autosuspend ({control})")


_BUS_CALL_S = 3.0
"""A message bus that does not answer within this time counts as missing."""
_SCREEN_SAVER = "org.freedesktop.ScreenSaver"
_HAS_OWNER = ("call", "org.freedesktop.DBus", "/org/freedesktop/DBus", "org.freedesktop.DBus", "NameHasOwner", "s", _SCREEN_SAVER)


def check_screen_lock(robot: str) -> Check:
    """Whether screen lock and sleep can be inhibited while real servos follow; gamepad and pedal do not count as input."""
    name = "screen lock"
    if robot != "servos":
        return Check(name, True, NOT_CONFIGURED)
    fix = "switch screen lock and sleep off in the desktop's settings"
    if shutil.which("systemd-inhibit") is None:
        return Check(name, False, "sleep cannot be inhibited: systemd-inhibit is not there", fix)
    try:
        asked = subprocess.run(
            ["busctl", "--user", *_HAS_OWNER],
            capture_output=True,
            text=True,
            timeout=_BUS_CALL_S,
            stdin=subprocess.DEVNULL,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return Check(name, False, f"whether the lock can be inhibited is not known ({one_line(error)})", fix)
    if asked.returncode != 0 or "true" not in asked.stdout:
        return Check(name, False, f"the lock cannot be inhibited: no {_SCREEN_SAVER} on this desktop", fix)
    return Check(name, True, "inhibited while the servos follow")


def check_forces(config: ServosConfig) -> Check:
    """What each servo limits its own force to, and whether the joint still reaches its speed with it."""
    name = "forces"
    if config.port is None:
        return Check(name, True, NOT_CONFIGURED)
    if config.driver not in LIMITS_FORCE:
        return Check(name, False, f"a {config.driver} cannot limit its force", "drive by hand only; the program does not drive")
    told, slow = [], []
    for joint in config.joints:
        limit, model = config.force_limit(joint), config.model_of(joint)
        how = "duty" if limit.current_ma is None else f"{limit.current_ma:.0f} mA"
        told.append(f"{joint.name} {limit.force_n:.0f} {joint.force_unit} ({how})")
        if limit.speed_mm_s < joint.max_speed_mm_s:
            slow.append(f"{joint.name} {limit.speed_mm_s:.1f} of {joint.max_speed_mm_s:g} {joint.unit}/s")
        if model.is_small:
            told[-1] += f" by {model.name}, whose motor goes on when its own bus watchdog trips"
    if slow:
        fix = "raise the joint's max_force_n, or lower its max_speed_mm_s; or use a model that reports its current"
        return Check(name, False, f"with its force limit reaches at most: {', '.join(slow)}", fix)
    weak = ", ".join(f"{joint.name} {least_n:g} {joint.force_unit}" for joint, least_n in config.weak_joints)
    friction = f"; the gear's friction may take it all: larger drums, or max_force_n of at least {weak}" if weak else ""
    return Check(name, True, f"at most {', '.join(told)}{friction}")


def check_latency(port: str | None) -> Check:
    """How long an FTDI adapter keeps bytes back. The driver sets it when it opens the port, so it is looked at after that."""
    name = "adapter latency"
    if port is None:
        return Check(name, True, NOT_CONFIGURED)
    timer = sysfs.SYS / "bus" / "usb-serial" / "devices" / Path(port).resolve().name / "latency_timer"
    if not timer.is_file():
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
                        name,
                        False,
                        message("{port}: STOP is pressed, or its wire is broken", port=config.port),
                        "release STOP; check its wire",
                    )
                if line is not None and line.estop:
                    what = message("{port}: the E-stop is pressed, or its wire is broken", port=config.port)
                    return Check(name, False, what, "release the E-stop; check the wire of its second contact")
                if line is not None:
                    return Check(name, True, f"{config.port} reports; deadman {'pressed' if line.down else 'released'}")
    except DeviceError as error:
        return Check(name, False, one_line(error), "check its USB cable")
    finally:
        port.close()
    if heard:
        return Check(
            name, False, message("what comes from {port} is no pedal's report", port=config.port), "check pedal.port and pedal.baud"
        )
    return Check(
        name, False, message("{port} is silent", port=config.port), "check the pedal's power and firmware, then plug it in again"
    )


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
