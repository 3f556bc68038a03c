"""Cameras as the kernel lists them in sysfs: USB and V4L2 devices. Nothing is opened."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

DEV, SYS = Path("/dev"), Path("/sys")
USB3_MBIT_S = 5000
_INTEL, _REALSENSE, _BASLER = "8086", "realsense", "2676"
"""Vendor identifiers on USB, and what a RealSense has in its name."""


@dataclass(frozen=True, slots=True)
class UsbDevice:
    """A plugged-in device; ``mbit_s`` is the speed of its connection (480: USB 2, 5000 and more: USB 3)."""

    product: str
    serial: str
    mbit_s: int


@dataclass(frozen=True, slots=True)
class VideoDevice:
    """A V4L2 node that may be a webcam; ``stable`` is its path in /dev/v4l/by-id, None when the system makes none."""

    node: Path
    title: str
    stable: Path | None

    @property
    def path(self) -> str:
        """The stable path where there is one."""
        return str(self.stable or self.node)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""


def realsense_on_usb() -> list[UsbDevice]:
    """RealSense cameras that are plugged in, whether or not they may be opened."""
    return _usb_devices(_INTEL, _REALSENSE)


def basler_on_usb() -> list[UsbDevice]:
    """Basler cameras that are plugged in, whether or not they may be opened; those on a network are not known here."""
    return _usb_devices(_BASLER)


def _usb_devices(vendor: str, part_of_name: str = "") -> list[UsbDevice]:
    found = []
    for folder in sorted((SYS / "bus" / "usb" / "devices").glob("*")):
        product = _text(folder / "product")
        if _text(folder / "idVendor") == vendor and part_of_name in product.lower():
            speed = _text(folder / "speed")
            found.append(UsbDevice(product, _text(folder / "serial"), int(float(speed)) if speed.replace(".", "").isdigit() else 0))
    return found


def video_devices() -> list[VideoDevice]:
    """V4L2 nodes that give pictures: a camera's first one; its further ones carry metadata."""
    stable: dict[Path, Path] = {}
    for link in sorted((DEV / "v4l" / "by-id").glob("*")):
        stable.setdefault(link.resolve(), link)
    found = []
    for folder in sorted((SYS / "class" / "video4linux").glob("video*"), key=lambda path: (len(path.name), path.name)):
        if _text(folder / "index") in {"", "0"}:
            node = DEV / folder.name
            found.append(VideoDevice(node, _text(folder / "name") or folder.name, stable.get(node.resolve())))
    return found


def webcam_node(wanted: str) -> Path:
    """The device of ``camera.device``: a path, or the number of a /dev/video."""
    return DEV / f"video{wanted}" if wanted.isdigit() else Path(wanted)
