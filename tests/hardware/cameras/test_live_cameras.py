"""Real cameras without one: RealSense by the real library on software devices and recordings, webcams on a stand-in for OpenCV."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pyrealsense2 as rs
import pytest

from core.config.models import CameraConfig, Config
from core.control.engine import Engine
from core.devices import Camera, CameraLost, DeviceError, EndOfStream
from core.types import Frame, Point, Scene
from hardware.cameras.live import CaptureClock, LiveCamera, SensorFrame
from hardware.cameras.realsense import RealSenseInfo, RealSenseRecording, RealSenseSensor, find_cameras, realsense_camera
from hardware.cameras.webcam import WebcamSensor
from hardware.rig import RigKind, open_rig
from hardware.twin.servos.bus import SoftServoBus
from tests.hardware.soft_cameras import CONFIG, HEIGHT, PERIOD_S, WIDTH, SoftRealSense, SoftWebcam, picture, write_bag


def _frames(camera: Camera, count: int) -> list[Frame]:
    found: list[Frame] = []
    until_s = time.monotonic() + 10.0
    while len(found) < count and time.monotonic() < until_s:
        frame = camera.read(0.5)
        if frame is not None:
            found.append(frame)
    assert len(found) == count
    return found


def _until_lost(camera: Camera) -> CameraLost:
    """The loss as ``read`` tells it; the frames before it are dropped."""
    until_s = time.monotonic() + 10.0
    while time.monotonic() < until_s:
        try:
            camera.read(0.05)
        except CameraLost as error:
            return error
    raise AssertionError("nobody noticed")


def _until_back(camera: Camera) -> Frame:
    until_s = time.monotonic() + 10.0
    while time.monotonic() < until_s:
        try:
            frame = camera.read(0.05)
        except CameraLost:
            continue
        if frame is not None:
            return frame
    raise AssertionError("it did not come back")


# --- the clock -------------------------------------------------------------------------------------------------------------------


def test_a_clock_that_the_computer_shares_tells_the_age() -> None:
    clock = CaptureClock()
    assert clock.captured_s(100.0, 5000.0, 5000.03) == pytest.approx(99.97)
    assert clock.captured_s(100.04, 5000.033, 5000.08) == pytest.approx(99.993)


def test_of_a_clock_of_its_own_only_the_rate_counts() -> None:
    clock = CaptureClock()
    # arrivals 0, 20 and 5 ms later than the quickest
    assert clock.captured_s(100.000, 7.000) == pytest.approx(100.000)
    assert clock.captured_s(100.053, 7.033) == pytest.approx(100.033)
    assert clock.captured_s(100.071, 7.066) == pytest.approx(100.066)
    assert clock.captured_s(200.0, 1.0) == pytest.approx(200.0)  # it was started again


@pytest.mark.parametrize("now_s", [4000.0, 5000.9])
def test_a_shared_clock_that_makes_no_sense_is_not_believed(now_s: float) -> None:
    """The wall clock was set between two pictures, or the stamp is of another clock."""
    assert CaptureClock().captured_s(100.0, 5000.0, now_s) == 100.0


def test_after_a_stall_the_pictures_that_waited_are_as_old_as_they_are() -> None:
    """What lay in the queue while the computer was busy must not be taken for new: somebody drives by it."""
    clock = CaptureClock()
    for k in range(30):
        clock.captured_s(100.0 + k / 30, 5000.0 + k / 30, 5000.01 + k / 30)
    assert clock.captured_s(102.0, 5001.22, 5002.0) == pytest.approx(101.22)
    assert clock.captured_s(102.01, 5001.26, 5002.01) == pytest.approx(101.26)


def test_capture_never_goes_back_and_never_lies_in_the_future() -> None:
    clock = CaptureClock()
    assert clock.captured_s(100.0, 50.0, 50.0) == 100.0
    assert clock.captured_s(100.01, 49.9, 50.01) == 100.0
    assert clock.captured_s(100.02, None) == 100.02


# --- any live camera -------------------------------------------------------------------------------------------------------------


class _Script:
    """A sensor that does what the test says."""

    name = "script"

    def __init__(self) -> None:
        self.shots: list[SensorFrame | DeviceError | None] = []
        self.refuses_to_start = 0
        self.calls: list[str] = []
        self.hangs = threading.Event()
        self.hangs.set()

    def start(self) -> None:
        self.calls.append("start")
        if self.refuses_to_start:
            self.refuses_to_start -= 1
            raise DeviceError("script: not there")

    def read(self, timeout_s: float) -> SensorFrame | None:
        self.hangs.wait()
        if not self.shots:
            time.sleep(0.005)
            return None
        shot = self.shots.pop(0)
        if isinstance(shot, DeviceError):
            raise shot
        return shot

    def stop(self) -> None:
        self.calls.append("stop")

    def reset(self) -> float:
        self.calls.append("reset")
        return 0.0


def _shot(number: int | None, at_s: float) -> SensorFrame:
    return SensorFrame(np.zeros((2, 2, 3), np.uint8), at_s, number)


@pytest.fixture
def script() -> _Script:
    return _Script()


@pytest.fixture
def camera(script: _Script) -> Iterator[LiveCamera]:
    camera = LiveCamera(script, CONFIG)
    yield camera
    script.hangs.set()
    camera.close()


def _newest(camera: LiveCamera) -> Frame:
    time.sleep(0.05)
    frame = camera.read(1.0)
    assert frame is not None
    return frame


def test_a_camera_that_is_not_there_is_an_error_at_open(script: _Script, camera: LiveCamera) -> None:
    script.refuses_to_start = 1
    with pytest.raises(DeviceError, match="not there"):
        camera.open()
    with pytest.raises(DeviceError, match="not open"):
        camera.read(0.0)
    camera.open()  # and may be tried again
    assert script.calls.count("start") == 2


def test_missing_numbers_are_lost_frames_and_a_count_that_goes_back_is_none(script: _Script, camera: LiveCamera) -> None:
    script.shots = [_shot(number, 10.0 + place * PERIOD_S) for place, number in enumerate([5, 6, 9, 9, 2, 3])]
    camera.open()
    frame = _newest(camera)
    assert (frame.index, frame.lost) == (5, 2)  # 7 and 8; the 9 that came twice with another time is new


@pytest.mark.parametrize("counts", [True, False])
def test_a_camera_that_is_slower_than_asked_for_loses_frames(counts: bool, script: _Script, camera: LiveCamera) -> None:
    """In dim light some cameras slow down and count on as if nothing was missing; others do not count at all."""
    periods = [0, 1, 2.4, 3, 5, 6, 9]  # jitter, then one frame left out, then two
    script.shots = [_shot(place if counts else None, 10.0 + period * PERIOD_S) for place, period in enumerate(periods)]
    camera.open()
    frame = _newest(camera)
    assert (frame.index, frame.lost) == (6, 3)


def test_the_newest_frame_wins(script: _Script, camera: LiveCamera) -> None:
    script.shots = [_shot(number, 10.0 + number * PERIOD_S) for number in range(51)]
    camera.open()
    frame = _newest(camera)
    assert (frame.index, frame.lost) == (50, 0)
    assert frame.captured_s == pytest.approx(10.0 + 50 * PERIOD_S)
    assert camera.read(0.0) is None


def test_a_camera_that_repeats_its_last_picture_is_lost(script: _Script, camera: LiveCamera) -> None:
    script.shots = [_shot(3, 10.0)] * 100_000
    camera.open()
    assert _newest(camera).index == 0
    assert "no picture" in str(_until_lost(camera))


def test_a_lost_camera_is_reset_and_comes_back_with_its_index_going_on(script: _Script, camera: LiveCamera) -> None:
    script.shots = [_shot(7, 10.0), DeviceError("script is lost: check its cable")]
    camera.open()
    assert str(_until_lost(camera)) == "script is lost: check its cable"
    script.refuses_to_start = 2
    script.shots = [_shot(0, 20.0)]
    frame = _until_back(camera)
    assert (frame.index, frame.lost, camera.reconnects) == (1, 0, 1)
    assert script.calls[:6] == ["start", "stop", "reset", "start", "start", "start"]


def test_a_driver_that_hangs_is_noticed_from_outside(script: _Script, camera: LiveCamera) -> None:
    script.shots = [_shot(0, 10.0)]
    camera.open()
    assert _newest(camera).index == 0
    script.hangs.clear()
    assert "no picture" in str(_until_lost(camera))


def test_a_driver_that_breaks_is_for_good(script: _Script, camera: LiveCamera) -> None:
    script.shots = ["no shot at all"]  # type: ignore[list-item]
    camera.open()
    with pytest.raises(DeviceError, match=r"no longer read \(AttributeError.*F5") as caught:
        for _ in range(100):
            camera.read(0.05)
    assert not isinstance(caught.value, CameraLost)


def test_a_rig_outlives_a_lost_camera(script: _Script, camera: LiveCamera) -> None:
    def perceive(frame: Frame, target: Point | None = None) -> Scene:
        return Scene(frame.index, frame.captured_s, (2, 2), 1.0)

    script.shots = [_shot(0, 10.0), DeviceError("gone")]
    camera.open()
    engine = Engine(camera, perceive, lambda _: None, camera.close)
    ticks = [engine.step(0.1)]
    _until_lost(camera)
    ticks += [engine.step(0.0) for _ in range(3)]
    script.shots = [_shot(0, 20.0)]
    while ticks[-1] is None:
        ticks.append(engine.step(0.5))
    engine.close()
    assert [tick.frame.index for tick in ticks if tick is not None] == [0, 1]


# --- RealSense -------------------------------------------------------------------------------------------------------------------


def test_cameras_are_listed() -> None:
    camera = SoftRealSense("f7", usb="2.1")
    assert find_cameras(camera.context()) == [RealSenseInfo("Intel RealSense L515", "f7", "1.5.8.1", "1.5.8.1", "2.1")]
    camera.plugged = False
    assert find_cameras(camera.context()) == []


def test_versions_are_compared_as_numbers() -> None:
    assert RealSenseInfo("a", "b", "1.5.8.1", "1.5.10.0").is_outdated
    assert not RealSenseInfo("a", "b", "5.13.0.50", "5.9.0.1").is_outdated
    assert not RealSenseInfo("a", "b").is_outdated


def test_frames_come_exactly_and_with_their_time() -> None:
    with SoftRealSense() as soft:
        camera = realsense_camera(CONFIG, soft.context)
        began_s = time.monotonic()
        camera.open()
        try:
            frames = [(frame, time.monotonic()) for frame in (_frames(camera, 1)[0] for _ in range(10))]
        finally:
            camera.close()
    first = frames[0][0]
    for frame, seen_s in frames:
        assert any(np.array_equal(frame.image, picture(number)) for number in range(soft.number + 1))
        assert frame.image.flags.owndata
        assert began_s - 0.001 <= frame.captured_s <= seen_s + 0.001
    assert first.lost == 0
    assert camera.name == "Intel RealSense L515"


def test_the_sensor_is_set_up_as_configured() -> None:
    soft = SoftRealSense()
    settings = {"exposure_ms": 8.0, "gain": 9000.0, "white_balance_k": 4013}
    sensor = RealSenseSensor(CONFIG.model_copy(update=settings), soft.context)
    sensor.start()
    wanted = {
        rs.option.enable_auto_exposure: 0.0,
        rs.option.auto_exposure_priority: 0.0,
        rs.option.exposure: 80.0,
        rs.option.gain: 4096.0,  # the most that there is
        rs.option.white_balance: 4010.0,  # in its steps
    }
    assert {option: soft.sensor.get_option(option) for option in wanted} == wanted
    sensor.stop()
    automatic = RealSenseSensor(CONFIG, soft.context)
    automatic.start()
    assert soft.sensor.get_option(rs.option.enable_auto_exposure) == 1.0
    assert soft.sensor.get_option(rs.option.auto_exposure_priority) == 0.0
    automatic.stop()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width_px": 640}, r"has no 640x120 at 30/s: .*one of 160x120 at 30/s"),
        ({"serial": "other"}, "no RealSense camera other; there are: f1"),
    ],
)
def test_what_the_camera_does_not_have_is_named(change: dict[str, object], message: str) -> None:
    soft = SoftRealSense()
    with pytest.raises(DeviceError, match=message):
        realsense_camera(CONFIG.model_copy(update=change), soft.context).open()


def test_without_a_camera_open_fails_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pipeline would stop the whole program for 15 seconds here, so none is made."""
    soft, pipelines = SoftRealSense(), []
    soft.plugged = False
    monkeypatch.setattr(rs, "pipeline", lambda *args: pipelines.append(args))
    with pytest.raises(DeviceError, match="no RealSense camera: plug it"):
        realsense_camera(CONFIG, soft.context).open()
    assert pipelines == []


def test_of_two_cameras_one_must_be_chosen() -> None:
    one, other = SoftRealSense("f1"), SoftRealSense("f2")

    def both() -> object:
        context = one.context()
        other.device.add_to(context)
        return context

    with pytest.raises(DeviceError, match=r"2 RealSense cameras \(f1, f2\): set camera.serial"):
        realsense_camera(CONFIG, both).open()
    chosen = RealSenseSensor(CONFIG.model_copy(update={"serial": "f2"}), both)
    chosen.start()
    chosen.stop()
    assert chosen.info is not None and chosen.info.serial == "f2"


def test_another_realsense_camera_does_not_take_the_place_of_a_lost_one() -> None:
    """Somebody is driving by the pictures of the first."""
    own, other = SoftRealSense("f1"), SoftRealSense("f2")
    there = [own]

    def plugged() -> object:
        context = rs.context()
        for camera in there:
            camera.device.add_to(context)
        return context

    sensor = RealSenseSensor(CONFIG, plugged)
    sensor.start()
    sensor.stop()
    there[:] = [other]
    with pytest.raises(DeviceError, match=r"RealSense L515 f1 is not there any more \(there are: f2\): plug it in"):
        sensor.start()
    there[:] = []
    with pytest.raises(DeviceError, match="no RealSense camera: plug it"):
        sensor.start()
    there[:] = [other, own]  # no choice to be made either: it is known which one
    sensor.start()
    sensor.stop()
    assert sensor.info is not None and sensor.info.serial == "f1"


@pytest.mark.parametrize("how", ["unplugged", "stalled"])
def test_a_realsense_camera_is_lost_and_found(how: str) -> None:
    with SoftRealSense() as soft:
        camera = realsense_camera(CONFIG, soft.context)
        camera.open()
        try:
            before = _frames(camera, 3)[-1]
            if how == "unplugged":
                soft.plugged = False
            soft.silent = True
            silent_s = time.monotonic()
            _until_lost(camera)
            noticed_s = time.monotonic() - silent_s
            soft.plugged, soft.silent = True, False
            after = _until_back(camera)
        finally:
            camera.close()
    assert CONFIG.lost_after_s - PERIOD_S - 0.05 <= noticed_s
    assert after.index > before.index
    assert after.captured_s > before.captured_s
    assert camera.name == "Intel RealSense L515"


# --- RealSense recordings --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bag(tmp_path_factory.mktemp("bag") / "run.bag", list(range(60)))


def _until_the_end(recording: RealSenseRecording) -> list[Frame | None]:
    """All that a recording gives; it is closed then."""
    frames: list[Frame | None] = []
    with pytest.raises(EndOfStream, match="end of the recording"):
        while True:
            frames.append(recording.read(0.0))
    recording.close()
    return frames


def test_sixty_of_sixty_frames_come_exactly_from_a_recording(bag: Path) -> None:
    recording = RealSenseRecording(bag, paced=False)
    recording.open()
    frames = _until_the_end(recording)
    assert [frame.index for frame in frames if frame] == list(range(60))
    for frame in frames:
        assert np.array_equal(frame.image, picture(frame.index))
        assert frame.captured_s == pytest.approx(frame.index * PERIOD_S, abs=1e-3)
        assert frame.lost == 0


def test_a_machine_that_stands_still_while_a_recording_opens_loses_no_frames(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begin = rs.pipeline.start

    def slowly(pipeline: rs.pipeline, config: rs.config) -> rs.pipeline_profile:
        profile = begin(pipeline, config)
        time.sleep(1.0)  # twenty frames more than the library holds ready, at its own pace
        return profile

    monkeypatch.setattr(rs.pipeline, "start", slowly)
    recording = RealSenseRecording(bag, paced=False)
    recording.open()
    assert [frame.index for frame in _until_the_end(recording) if frame] == list(range(60))


def test_a_moment_of_silence_before_the_last_frames_is_not_the_end(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Stalled:
        """The library on a machine that stands still: it has read the whole file, and what it read comes late."""

        def __init__(self, pipeline: rs.pipeline) -> None:
            self._pipeline, self._waits = pipeline, 0

        def try_wait_for_frames(self, timeout_ms: int) -> tuple[bool, rs.composite_frame | None]:
            self._waits += 1
            return (False, None) if self._waits in (45, 46) else self._pipeline.try_wait_for_frames(timeout_ms)

        def stop(self) -> None:
            self._pipeline.stop()

    class HasReadAll:
        def current_status(self) -> rs.playback_status:
            return rs.playback_status.stopped

    recording = RealSenseRecording(bag, paced=False)
    recording.open()
    monkeypatch.setattr(recording, "_pipeline", Stalled(recording._pipeline))
    monkeypatch.setattr(recording, "_playback", HasReadAll())
    frames = _until_the_end(recording)
    assert [frame.index for frame in frames if frame] == list(range(60))


def test_frames_that_the_recording_lacks_are_lost(tmp_path: Path) -> None:
    recording = RealSenseRecording(write_bag(tmp_path / "gaps.bag", [0, 1, 4, 5]), paced=False)
    recording.open()
    assert [(frame.index, frame.lost) for frame in _frames(recording, 4)] == [(0, 0), (1, 0), (2, 2), (3, 2)]
    recording.close()


def test_a_recording_in_bgr_is_given_in_rgb(tmp_path: Path) -> None:
    recording = RealSenseRecording(write_bag(tmp_path / "bgr.bag", [0], form=rs.format.bgr8), paced=False)
    recording.open()
    assert np.array_equal(_frames(recording, 1)[0].image, picture(0)[..., ::-1])
    recording.close()


def test_a_recording_can_be_left_early_and_played_again(bag: Path) -> None:
    recording = RealSenseRecording(bag)
    for _ in range(2):
        recording.open()
        assert _frames(recording, 2)[-1].index >= 1
        recording.close()


@pytest.mark.parametrize("content", [None, b"", b"not a recording", b"#ROSBAG V2.0\n"])
def test_a_foreign_recording_is_one_clear_line(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "x.bag"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(DeviceError, match=r"x\.bag: (no such recording|cannot be played as a RealSense recording)") as caught:
        RealSenseRecording(path).open()
    assert "\n" not in str(caught.value)


def test_a_cut_recording_is_one_clear_line(bag: Path, tmp_path: Path) -> None:
    path = tmp_path / "cut.bag"
    path.write_bytes(bag.read_bytes()[: bag.stat().st_size // 2])
    with pytest.raises(DeviceError, match=r"cut\.bag: cannot be played"):
        RealSenseRecording(path).open()


# --- webcams ---------------------------------------------------------------------------------------------------------------------


@pytest.fixture
def webcam(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SoftWebcam:
    return SoftWebcam(tmp_path, monkeypatch)


def _sensor(webcam: SoftWebcam, **changes: object) -> WebcamSensor:
    return WebcamSensor(CONFIG.model_copy(update=changes), webcam.open_capture)


def test_a_webcam_gives_rgb_with_the_kernels_time(webcam: SoftWebcam) -> None:
    sensor = _sensor(webcam)
    webcam.stamp_ms = lambda taken_s: 1000.0 * (taken_s - 0.02)
    began_s = time.monotonic()
    sensor.start()
    shot = sensor.read(0.1)
    arrived_s = time.monotonic()
    sensor.stop()
    assert np.array_equal(shot.image, picture(0))
    assert began_s - 0.025 <= shot.captured_s <= arrived_s - 0.015
    assert sensor.name == "Soft Webcam"


def test_another_webcam_does_not_take_the_place_of_a_lost_one(webcam: SoftWebcam) -> None:
    """No camera is named, so that the first one is meant; later on it is that one."""
    sensor = _sensor(webcam)
    sensor.start()
    assert sensor.read(0.1) is not None
    sensor.stop()
    webcam.unplug(0)
    other = webcam.sys / "class" / "video4linux" / "video2"
    other.mkdir(parents=True)
    (other / "name").write_text("Laptop Camera\n")
    (other / "index").write_text("0\n")
    (webcam.dev / "video2").touch()
    with pytest.raises(DeviceError, match="Soft Webcam is not there any more: plug it in"):
        sensor.start()
    webcam.plug(4)
    sensor.start()
    sensor.stop()
    assert [Path(node).name for node, _ in webcam.captures] == ["video0", "video4"]


def test_the_first_picture_may_take_longer_than_the_time_limit(webcam: SoftWebcam, monkeypatch: pytest.MonkeyPatch) -> None:
    sensor = _sensor(webcam)
    sensor.start()
    capture, grab = webcam.captures[0][1], webcam.captures[0][1].grab

    def slow() -> bool:
        time.sleep(0.6)
        return False

    monkeypatch.setattr(capture, "grab", slow)
    assert sensor.read(0.1) is None
    monkeypatch.setattr(capture, "grab", grab)
    assert sensor.read(0.1) is not None
    monkeypatch.setattr(capture, "grab", slow)
    with pytest.raises(DeviceError, match="is lost"):
        sensor.read(0.1)
    sensor.stop()


def test_a_webcam_without_stamps_counts_from_the_arrival(webcam: SoftWebcam) -> None:
    sensor = _sensor(webcam)
    webcam.stamp_ms = lambda _: 0.0
    sensor.start()
    before_s = time.monotonic()
    shot = sensor.read(0.1)
    sensor.stop()
    assert before_s <= shot.captured_s <= time.monotonic()


def test_a_damaged_picture_is_left_out(webcam: SoftWebcam) -> None:
    sensor = _sensor(webcam)
    webcam.damaged = {0}
    sensor.start()
    assert sensor.read(0.1) is None
    assert sensor.read(0.1) is not None
    sensor.stop()


def test_a_webcam_is_set_up_as_configured(webcam: SoftWebcam) -> None:
    webcam.refuses = {cv2.CAP_PROP_GAIN}  # not every camera has everything
    sensor = _sensor(webcam, exposure_ms=5.0, gain=10.0, white_balance_k=5000, pixel_format="YUYV")
    sensor.start()
    settings = webcam.captures[0][1].settings
    sensor.stop()
    assert next(iter(settings)) == cv2.CAP_PROP_FOURCC
    assert settings[cv2.CAP_PROP_FOURCC] == cv2.VideoWriter.fourcc(*"YUYV")
    assert settings[cv2.CAP_PROP_FPS] == 30
    assert (settings[cv2.CAP_PROP_AUTO_EXPOSURE], settings[cv2.CAP_PROP_EXPOSURE]) == (1.0, 50.0)
    assert (settings[cv2.CAP_PROP_AUTO_WB], settings[cv2.CAP_PROP_WB_TEMPERATURE]) == (0.0, 5000)


def test_another_size_than_asked_for_is_refused(webcam: SoftWebcam) -> None:
    webcam.size = (1280, 720)
    with pytest.raises(DeviceError, match=r"gives 1280x720 instead of 160x120: set camera\.width_px"):
        _sensor(webcam).start()
    assert webcam.captures[0][1].released


def test_webcams_are_named_by_path_number_or_not_at_all(webcam: SoftWebcam) -> None:
    for wanted in (None, "0", str(webcam.stable)):
        sensor = _sensor(webcam, device=wanted)
        sensor.start()
        sensor.stop()
    assert {node for node, _ in webcam.captures} == {str(webcam.dev / "video0")}
    with pytest.raises(DeviceError, match=r"webcam 7 is not there; webcams: .*usb-Soft-index0"):
        _sensor(webcam, device="7").start()
    webcam.unplug(0)
    with pytest.raises(DeviceError, match="no webcam: plug it in"):
        _sensor(webcam).start()


def test_a_webcam_is_lost_and_found_under_another_number(webcam: SoftWebcam) -> None:
    camera = LiveCamera(_sensor(webcam, device=str(webcam.stable)), CONFIG)
    camera.open()
    try:
        before = _frames(camera, 2)[-1]
        webcam.unplug(0)
        assert re.search("is lost: check its cable|is not there", str(_until_lost(camera)))
        webcam.plug(3)
        after = _until_back(camera)
    finally:
        camera.close()
    assert after.index > before.index
    assert webcam.captures[-1][0] == str(webcam.dev / "video3")
    assert all(capture.released for _, capture in webcam.captures)


# --- rigs ------------------------------------------------------------------------------------------------------------------------


@pytest.fixture
def soft(monkeypatch: pytest.MonkeyPatch) -> Iterator[SoftRealSense]:
    def made(config: CameraConfig) -> LiveCamera:
        return LiveCamera(RealSenseSensor(config, soft.context), config)

    with SoftRealSense() as soft:
        monkeypatch.setattr("hardware.cameras.realsense.realsense_camera", made)
        yield soft


def _rig(**settings: object) -> Config:
    servos = settings.pop("servos", {})
    return Config.model_validate({"rig": {"name": "bench", "camera": "realsense"} | settings, "camera": CONFIG, "servos": servos})


def test_a_live_rig_to_look_only(soft: SoftRealSense) -> None:
    rig = open_rig(_rig(robot="none"))
    try:
        assert (rig.name, rig.kind, rig.is_live, rig.robot) == ("bench", RigKind.LIVE, True, None)
        assert _frames(rig.camera, 1)[0].image.shape == (HEIGHT, WIDTH, 3)
    finally:
        rig.close()


@pytest.mark.real_time
def test_a_live_rig_with_servos_that_are_checked_but_not_armed(soft: SoftRealSense) -> None:
    bus = SoftServoBus(Config().servos, wire_time=True)
    bus.start()
    try:
        rig = open_rig(_rig(robot="servos", servos={"port": bus.port}))
        try:
            assert rig.kind is RigKind.LIVE
            assert rig.robot is not None
            assert [bus.servo(joint.id).answer(2, 64, 1).data for joint in Config().servos.joints] == [b"\0"] * 7
        finally:
            rig.close()
    finally:
        bus.stop()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"robot": "twin"}, 'set rig.robot to "servos" or "none"'),
        ({"robot": "servos"}, "set servos.port"),
        ({"camera": "twin", "robot": "servos"}, "the twin has servos of its own"),
        ({"camera": "twin", "robot": "twin", "servos": {"port": "/dev/ttyUSB0"}}, r"leave servos\.port"),
        ({"camera": "webcam", "robot": "none", "source": "film.mp4"}, "a webcam plays no files"),
        ({"camera": "image_folder"}, "needs rig.source"),
    ],
)
def test_rigs_that_make_no_sense_say_what_to_do(soft: SoftRealSense, settings: dict[str, object], message: str) -> None:
    with pytest.raises(DeviceError, match=message):
        open_rig(_rig(**settings))


def test_the_camera_is_let_go_when_the_servos_fail(soft: SoftRealSense, tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="does not exist"):
        open_rig(_rig(robot="servos", servos={"port": str(tmp_path / "ttyUSB9")}))
    rig = open_rig(_rig(robot="none"))
    _frames(rig.camera, 1)
    rig.close()


def test_a_recording_is_played_back(bag: Path) -> None:
    rig = open_rig(_rig(robot="none", source=str(bag)))
    try:
        assert (rig.name, rig.kind, rig.robot) == ("run.bag", RigKind.PLAYBACK, None)
        assert _frames(rig.camera, 3)[-1].index >= 2
    finally:
        rig.close()
