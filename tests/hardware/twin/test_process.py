"""The twin in a process of its own: pictures, status and servos, and the end of either side."""

from __future__ import annotations

import errno
import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import psutil
import pytest

from core.config.models import Config
from core.control.gate import Source
from core.devices import DeviceError
from core.types import Command, Frame, RobotStatus
from hardware.processes import DeviceProcess
from hardware.rig import START_INSERTION_MM, RigKind, open_rig, start_ahead
from hardware.servos.bus_ipc import start_bus
from hardware.servos.dynamixel_port import BusProcessLost
from hardware.servos.servo_robot import ServoRobot
from hardware.twin.process import RemoteTwin, pack_frame, pack_status, start_twin, unpack_frame, unpack_status
from hardware.twin.server import _serve

CONFIG = Config.model_validate({"twin": {"image_width_px": 160, "image_height_px": 120}})


@pytest.fixture
def twin() -> Iterator[RemoteTwin]:
    made = RemoteTwin(CONFIG, 40.0)
    yield made
    made.close()


def next_frame(twin: RemoteTwin) -> Frame:
    until_s = time.monotonic() + 120.0
    while time.monotonic() < until_s:
        frame = twin.read(0.5)
        if frame is not None:
            return frame
    raise AssertionError("no frame")


def test_what_is_packed_is_unpacked() -> None:
    image = np.random.default_rng(0).integers(0, 255, (12, 16, 3), dtype=np.uint8)
    frame = unpack_frame(pack_frame(Frame(7, 1.25, image)))
    assert (frame.index, frame.captured_s) == (7, 1.25)
    assert np.array_equal(frame.image, image)
    for contact_n in (None, 0.25):
        status = RobotStatus(1.0, 2.0, 3.0, (0.1, 0.2, 0.3, 0.4), (1.0, 2.0, 3.0, 4.0), contact_n)
        assert unpack_status(pack_status(status)) == status


def test_frames_come_in_order_and_each_once_with_the_truth_until_it_is_closed(twin: RemoteTwin) -> None:
    asked_s, before_s = twin.clock(), time.monotonic()
    frames = [next_frame(twin) for _ in range(4)]
    indices = [frame.index for frame in frames]
    assert indices == sorted(set(indices))
    assert frames[0].image.shape == (120, 160, 3)
    assert asked_s <= frames[-1].captured_s <= twin.clock(), "on the bench's clock"
    assert [frame.captured_s for frame in frames] == sorted(frame.captured_s for frame in frames)
    assert before_s <= (frames[-1].published_s or 0.0) <= time.monotonic(), "on the real clock"
    assert not np.array_equal(frames[0].image, frames[-1].image), "noise of a camera"
    assert twin.status().insertion_mm == pytest.approx(40.0, abs=2.0)
    assert twin.status().wall_contact_n is not None
    pid = twin._process.pid
    twin.close()
    assert not psutil.pid_exists(pid)


def test_a_process_that_is_gone_is_a_device_error(twin: RemoteTwin) -> None:
    next_frame(twin)
    os.kill(twin._process.pid, signal.SIGKILL)
    with pytest.raises(DeviceError, match=r"the bench twin stopped.*F5"):
        for _ in range(200):
            twin.read(0.05)


def test_an_application_that_was_ended_is_no_error_of_the_twin() -> None:
    """Its pipe may be closed before its end of standard input is seen."""
    image = np.zeros((2, 2, 3), np.uint8)
    status = RobotStatus(1.0, 2.0, 3.0, (0.1, 0.2, 0.3, 0.4), (1.0, 2.0, 3.0, 4.0), None)
    world = SimpleNamespace(
        failure=None, frames=SimpleNamespace(take=lambda _: Frame(0, 0.0, image)), physics=SimpleNamespace(status=lambda: status)
    )
    slot = SimpleNamespace(put=lambda _: None)
    listening, wake = os.pipe()
    os.close(listening)
    try:
        _serve(cast("Any", world), cast("Any", slot), cast("Any", slot), cast("Any", SimpleNamespace(pipe=wake)), threading.Event())
    finally:
        os.close(wake)


@pytest.mark.real_time
@pytest.mark.usefixtures("no_process_stays_behind")
@pytest.mark.parametrize("begins", [False, True])
def test_what_was_started_ahead_becomes_the_rig(begins: bool) -> None:
    ahead = start_ahead(CONFIG)
    if begins:
        ahead.begin(CONFIG, START_INSERTION_MM)
    rig = open_rig(CONFIG, ahead)
    try:
        assert {child.pid for child in psutil.Process().children()} >= {ahead.twin.pid, ahead.bus.pid}
        assert isinstance(rig.robot, ServoRobot)
        assert rig.robot._client.pid == ahead.bus.pid
        frame = rig.camera.read(20.0)
        assert frame.image.shape == (120, 160, 3)
        rig.robot.connect()
        assert rig.robot._client.pid != ahead.bus.pid, "the second connection has a process of its own"
    finally:
        rig.close()


@pytest.mark.usefixtures("no_process_stays_behind")
@pytest.mark.parametrize(("begun_mm", "is_killed"), [(30.0, False), (40.0, True)])
def test_a_twin_that_began_with_another_configuration_or_died_is_replaced(begun_mm: float, is_killed: bool) -> None:
    ahead = start_ahead(CONFIG)
    ahead.begin(CONFIG, begun_mm)
    if is_killed:
        os.kill(ahead.twin.pid, signal.SIGKILL)
        assert ahead.twin.wait(60.0)
    twin = ahead.open_twin(CONFIG, 40.0)
    try:
        assert twin._process.pid != ahead.twin.pid
        next_frame(twin)
        assert twin.status().insertion_mm == pytest.approx(40.0, abs=2.0)
    finally:
        twin.close()
        ahead.end()


@pytest.mark.usefixtures("no_process_stays_behind")
def test_a_twin_that_began_and_is_not_needed_ends_and_what_is_wrong_is_said_when_it_is_opened() -> None:
    wrong = CONFIG.model_copy(update={"twin": CONFIG.twin.model_copy(update={"wiring": "1,2"})})
    ahead = start_ahead(CONFIG)
    ahead.begin(wrong, 40.0)
    with pytest.raises(DeviceError, match=r"twin\.wiring 1,2"):
        ahead.open_twin(wrong, 40.0)
    ahead.end()
    ahead = start_ahead(CONFIG)
    ahead.begin(CONFIG, 40.0)
    ahead.end()


@pytest.mark.usefixtures("no_process_stays_behind")
def test_a_process_that_cannot_be_started_is_a_device_error_when_the_rig_is_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> tuple[int, int]:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    open_before = psutil.Process().num_fds()
    with monkeypatch.context() as patch:
        patch.setattr(os, "pipe", refused)
        assert start_ahead(CONFIG) is None
        with pytest.raises(DeviceError, match=r"the bench twin cannot be started \(Too many open files\)"):
            open_rig(CONFIG)
        with pytest.raises(BusProcessLost, match=r"the servo bus process cannot be started \(Too many open files\)"):
            start_bus()
    with monkeypatch.context() as patch:
        patch.setattr(os, "ftruncate", refused)
        with pytest.raises(DeviceError, match="the bench twin cannot be started"):
            RemoteTwin(CONFIG, 40.0)
    assert psutil.Process().num_fds() == open_before


@pytest.mark.parametrize("start", [start_twin, start_bus])
def test_an_application_that_ends_before_it_needs_a_process_leaves_none_behind(
    start: Callable[[], DeviceProcess], capfd: pytest.CaptureFixture[str]
) -> None:
    process = start()
    process.socket.shutdown(socket.SHUT_RDWR)
    assert process.wait(120.0)
    assert process.exit_code() == 0
    process.discard()
    assert capfd.readouterr() == ("", "")


@pytest.mark.usefixtures("no_process_stays_behind")
def test_a_twin_that_died_while_it_waited_is_replaced() -> None:
    prestarted = start_twin()
    os.kill(prestarted.pid, signal.SIGKILL)
    assert prestarted.wait(60.0)
    twin = RemoteTwin(CONFIG, 40.0, prestarted)
    try:
        assert twin._process.pid != prestarted.pid
        next_frame(twin)
    finally:
        twin.close()


@pytest.mark.real_time
def test_the_rig_on_it_is_driven_by_the_real_driver() -> None:
    rig = open_rig(CONFIG)
    try:
        assert rig.kind is RigKind.SIM
        assert rig.camera.name.startswith("bench twin: ")
        rig.robot.arm()
        start_mm = rig.robot.status().insertion_mm
        until_s = time.monotonic() + 5.0
        while rig.robot.status().insertion_mm < start_mm + 2.0 and time.monotonic() < until_s:
            rig.robot.beat(Source.OPERATOR)
            rig.robot.send(Command(advance_mm_s=8.0))
            time.sleep(0.02)
        assert rig.robot.status().insertion_mm > start_mm + 1.0
        assert rig.robot.status().tendon_pull_mm is not None
    finally:
        rig.close()
