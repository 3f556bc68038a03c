"""A bench without physics or network: a drawn tube, a robot that swings in it, and poses that follow from the drawing."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot

from core.config.models import PerceptionConfig, PoseConfig
from core.control.alerts import Alert
from core.control.drive_view import DriveNews, DriveView
from core.control.faults import Fault
from core.control.gate import Source
from core.control.kept_zero import ZeroRequest
from core.control.modes import Act, Mode
from core.control.motion import Jog
from core.types import (
    Advice,
    Centerline,
    Frame,
    GraphEdge,
    Masks,
    Point,
    Points,
    Pose,
    PoseState,
    Reason,
    Refusal,
    RobotPath,
    RobotStatus,
    Route,
    Scene,
    Skeletons,
    Speed,
    Tick,
    Vector,
    VesselGraph,
)

WORKING = (640, 480)
_LUMEN_PX = 34
_ROBOT_PX = 5


def make_pose(state: PoseState = PoseState.C, *, theta: float = 18.4, head: float = 14.2, tail: float = 6.1) -> Pose:
    """A pose with signed values; crossed follows from the signs."""
    return Pose(abs(theta), theta, head, tail, head * tail < 0, state, 0.93)


def make_scene(pose: Pose | None = None, refusal: Refusal | None = None, *, index: int = 0, captured_s: float = 0.0) -> Scene:
    """A scene without geometry; with neither argument: no robot."""
    if pose is None and refusal is None:
        refusal = Refusal(Reason.NO_ROBOT)
    return Scene(index, captured_s, WORKING, 1.0, pose=pose, refusal=refusal, latency_ms={"segmentation": 21.0, "total": 30.0})


def make_tick(scene: Scene | None = None, advice: Advice | None = None) -> Tick:
    scene = scene or make_scene()
    image = np.full((scene.source_size[1], scene.source_size[0], 3), 90, np.uint8)
    return Tick(Frame(scene.frame_index, scene.captured_s, image), scene, advice, None, None, 0, 30.0)


def centerline_points() -> Points:
    """A gentle S through the working picture, one point per pixel or so."""
    t = np.linspace(0.0, 1.0, 700)
    return np.column_stack([40 + 560 * t, 250 - 120 * np.sin(2 * np.pi * t) * (0.5 + 0.5 * t)])


def branch_points() -> Points:
    t = np.linspace(0.0, 1.0, 260)
    return np.column_stack([330 + 230 * t, 255 + 30 * t + 130 * t**1.4])


@dataclass
class FakeBench:
    """Makes consistent scenes of a robot at a place, swinging about the centerline."""

    source_scale: float = 1.0
    limits: PoseConfig = field(default_factory=PoseConfig)

    def __post_init__(self) -> None:
        self._line = centerline_points()
        self._branch = branch_points()
        self._vessel = np.zeros((WORKING[1], WORKING[0]), np.uint8)
        for line in (self._line, self._branch):
            cv2.polylines(self._vessel, [np.round(line).astype(np.int32)], False, 1, 2 * _LUMEN_PX, cv2.LINE_8)
        self._background = self._draw_background()
        edges = tuple(GraphEdge(k, k + 1, line, np.full(len(line), _LUMEN_PX)) for k, line in enumerate((self._line, self._branch)))
        self._graph = VesselGraph(np.array([self._line[0], self._line[-1], self._branch[-1]]), edges)

    def _draw_background(self) -> np.ndarray:
        rng = np.random.default_rng(3)
        height, width = self._vessel.shape
        y, x = np.mgrid[0:height, 0:width]
        board = 205 - 0.00022 * ((x - 250) ** 2 + (y - 190) ** 2)
        soft = cv2.GaussianBlur(self._vessel.astype(np.float32), (0, 0), 4)
        wall = np.abs(cv2.Sobel(soft, cv2.CV_32F, 1, 0)) + np.abs(cv2.Sobel(soft, cv2.CV_32F, 0, 1))
        grey = board - 20 * soft - 70 * wall + rng.normal(0, 2.0, board.shape)
        colour = np.stack([grey, grey - 6 - 10 * soft, grey - 12 - 16 * soft], axis=2)
        return np.clip(colour, 0, 255).astype(np.uint8)

    def scene_at(self, index: int, captured_s: float, target: Point | None = None) -> tuple[np.ndarray, Scene]:
        """The picture and the scene at a time."""
        path = self._robot_points(captured_s)
        robot = np.zeros_like(self._vessel)
        cv2.polylines(robot, [np.round(path * 16).astype(np.int32)], False, 1, 2 * _ROBOT_PX, cv2.LINE_8, 4)
        image = self._background.copy()
        cv2.polylines(image, [np.round(path * 16).astype(np.int32)], False, (46, 48, 56), 2 * _ROBOT_PX, cv2.LINE_AA, 4)
        cv2.polylines(image, [np.round(path[-30:] * 16).astype(np.int32)], False, (190, 150, 70), 2 * _ROBOT_PX - 1, cv2.LINE_AA, 4)
        if self.source_scale != 1.0:
            image = cv2.resize(image, None, fx=self.source_scale, fy=self.source_scale, interpolation=cv2.INTER_LINEAR)
        return image, self._understand(index, captured_s, image, path, robot.astype(bool), target)

    def _robot_points(self, time_s: float) -> Points:
        count = int(300 + 90 * np.sin(time_s / 5.0))
        line = self._line[:count]
        normal = _normals(self._line)[:count]
        along = np.arange(count)
        swing = 17 * np.sin(along / 58.0 - time_s * 0.9) * np.clip(along / 160.0, 0, 1)
        return line + normal * swing[:, None]

    def _understand(
        self, index: int, captured_s: float, image: np.ndarray, path: Points, robot: np.ndarray, target: Point | None
    ) -> Scene:
        vessel = self._vessel.astype(bool)
        nearest = int(np.argmin(np.linalg.norm(self._line - path[-1], axis=1)))
        piece = self._line[max(0, nearest - 24) : nearest + 24]
        robot_vector, vessel_vector = _fit(path[-44:]), _fit(piece)
        pose = _pose(robot_vector, vessel_vector, self.limits)
        scene = Scene(
            index,
            captured_s,
            (image.shape[1], image.shape[0]),
            1.0 / self.source_scale,
            masks=Masks(vessel, robot, vessel.astype(np.float32), robot.astype(np.float32)),
            skeletons=Skeletons(vessel, robot),
            path=RobotPath(path, 0.9, None, True, 0.0, float(_ROBOT_PX)),
            vessel_graph=self._graph,
            centerline=Centerline(piece, (float(self._line[nearest, 0]), float(self._line[nearest, 1])), float(_LUMEN_PX)),
            robot_vector=robot_vector,
            vessel_vector=vessel_vector,
            pose=pose,
            latency_ms={
                "segmentation": 19.0 + np.random.default_rng(index).gamma(2, 1.2),
                "skeletons": 4.1,
                "path": 1.4,
                "centerline": 1.9,
                "pose": 0.4,
                "total": 27.5,
            },
        )
        if target is not None:
            scene = replace(scene, route=Route(self._line[nearest:], 300.0, scene.to_working(target)))
        return scene


def _normals(line: Points) -> Points:
    tangent = np.gradient(line, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.column_stack([-tangent[:, 1], tangent[:, 0]])


def _fit(points: Points) -> Vector:
    middle = points.mean(axis=0)
    direction = np.linalg.svd(points - middle)[2][0]
    if direction @ (points[-1] - points[0]) < 0:
        direction = -direction
    start, end = (middle + direction * float((p - middle) @ direction) for p in (points[0], points[-1]))
    center = (start + end) / 2
    return Vector((float(start[0]), float(start[1])), (float(center[0]), float(center[1])), (float(end[0]), float(end[1])))


def _pose(robot: Vector, vessel: Vector, limits: PoseConfig) -> Pose:
    (rx, ry), (vx, vy) = robot.direction, vessel.direction
    theta = float(np.degrees(np.arctan2(vx * ry - vy * rx, vx * rx + vy * ry)))

    def offset(point: Point) -> float:
        return vx * (point[1] - vessel.center[1]) - vy * (point[0] - vessel.center[0])

    head, tail = offset(robot.end), offset(robot.start)
    if abs(head) < limits.d_allow_px and abs(tail) < limits.d_allow_px and abs(theta) < limits.theta_allow_deg:
        state = PoseState.A
    elif head * tail < 0:
        state = PoseState.D
    else:
        state = PoseState.B if abs(head) < abs(tail) else PoseState.C
    return Pose(abs(theta), theta, head, tail, head * tail < 0, state, 0.94)


_ADVICE = {
    PoseState.A: (Speed.FAST, 8.0, "on the centerline and along it"),
    PoseState.B: (Speed.SLOW, 3.0, "coming back to the centerline"),
    PoseState.C: (Speed.SLOWEST, 1.0, "moving away from the centerline"),
    PoseState.D: (Speed.MODERATE, 5.0, "crossed the centerline, angle left"),
}


def advise(scene: Scene) -> Advice | None:
    if scene.pose is None:
        return None
    speed, rate, why = _ADVICE[scene.pose.state]
    steer = -scene.pose.theta_signed_deg if scene.pose.state in (PoseState.C, PoseState.D) else 0.0
    return Advice(speed, rate, steer, why)


class FakePilot:
    """A pilot that does nothing but keep what it was told; `view` and `alerts` are what the window sees next."""

    def __init__(self) -> None:
        self.jogs: list[Jog] = []
        self.acts: list[Act] = []
        self.deadman_said: list[bool | None] = []
        self.estop_said: list[bool] = []
        self.beats = 0
        self.speed = 0.0
        self.simulation_speed = 1.0
        self.asked: list[str] = []
        self.halted = False
        self.faults: list[Fault] = []
        self.view = DriveView(0.0, permitted=Source.OPERATOR, servos_on=True, deadman=False)
        self.alerts: list[Alert] = []

    @property
    def now_s(self) -> float:
        return time.monotonic()

    @property
    def can_move(self) -> bool:
        return self.view.mode is not Mode.ADVISORY or self.view.servos_on or bool(self.view.busy)

    def jog(self, source: object, jog: Jog) -> None:
        self.jogs.append(jog)

    def hand_speed(self, share: float) -> None:
        self.speed = share

    def switch_on(self) -> None:
        self.asked.append("switch on")

    def zero(self, request: ZeroRequest) -> bool:
        self.asked.append(f"zero {list(request.positions_mm)}, kept {list(request.kept)}")
        return True

    def reboot(self, servo_id: int) -> None:
        self.asked.append(f"reboot {servo_id}")

    def relax(self) -> bool:
        self.asked.append("relax")
        return True

    def torque_off(self) -> bool:
        self.asked.append("torque off")
        return True

    def halt(self) -> None:
        self.halted = True

    def ask(self, act: Act) -> None:
        self.acts.append(act)

    def stop(self) -> None:
        self.acts.append(Act.STOP)

    def deadman(self, source: object, pressed: bool | None) -> None:
        self.deadman_said.append(pressed)

    def estop(self, pressed: bool) -> None:
        self.estop_said.append(pressed)

    def window_alive(self) -> None:
        self.beats += 1

    def report_fault(self, fault: Fault) -> None:
        self.faults.append(fault)

    def news(self) -> DriveNews:
        alerts, self.alerts = tuple(self.alerts), []
        return DriveNews(self.view, alerts)


class FakeEngine:
    """An engine over the fake bench at `frames_per_second`; what the window asked for is kept for the test."""

    def __init__(
        self,
        bench: FakeBench | None = None,
        frames_per_second: float = 30.0,
        refusal: Refusal | None = None,
        edit: Callable[[Scene], Scene] | None = None,
    ) -> None:
        self._bench = bench or FakeBench()
        self._period_s = 1.0 / frames_per_second
        self._edit = edit
        self.refusal = refusal
        self.silent = False
        self.problem: str | None = None
        self.fail_with: Exception | None = None
        self.pilot = FakePilot()
        self.targets: list[Point | None] = []
        self.perceptions: list[PerceptionConfig] = []
        self.closed = threading.Event()
        self._target: Point | None = None
        self._index = 0
        self._start_s = self._next_s = time.monotonic()

    def step(self, timeout_s: float) -> Tick | None:
        if self.fail_with is not None:
            raise self.fail_with
        wait = self._next_s - time.monotonic()
        if self.silent or wait > timeout_s:
            time.sleep(min(timeout_s, 0.02))
            return None
        time.sleep(max(0.0, wait))
        now = time.monotonic()
        self._next_s = max(self._next_s + self._period_s, now)
        self._index += 1
        image, scene = self._bench.scene_at(self._index, now - self._start_s, self._target)
        scene = replace(scene, captured_s=now)
        if self.refusal is not None:
            scene = replace(scene, pose=None, refusal=self.refusal, robot_vector=None, vessel_vector=None)
            scene = replace(scene, path=None, centerline=None)
        if self._edit is not None:
            scene = self._edit(scene)
        status = RobotStatus(now, 84.0, 12.0, (0.4, 0.0, 0.0, 0.0), (130.0, 20.0, 20.0, 20.0), 0.02)
        return Tick(Frame(self._index, now, image), scene, advise(scene), None, status, 3, 1.0 / self._period_s)

    @property
    def jogs(self) -> list[Jog]:
        return self.pilot.jogs

    def bus_status(self) -> None:
        return None

    def set_target(self, point: Point | None) -> None:
        self._target = point
        self.targets.append(point)

    def set_perception(self, config: PerceptionConfig) -> bool:
        self.perceptions.append(config)
        return True

    def close(self) -> None:
        self.closed.set()


def until(qtbot: QtBot, condition: Callable[[], bool]) -> None:
    qtbot.waitUntil(condition, timeout=30_000)


def turn_the_wheel(over: QWidget, notches: int = -1, modifier: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> QWheelEvent:
    at, none, phase = QPointF(over.rect().center()), Qt.MouseButton.NoButton, Qt.ScrollPhase.NoScrollPhase
    event = QWheelEvent(at, over.mapToGlobal(at), QPoint(), QPoint(0, 120 * notches), none, modifier, phase, False)
    QApplication.sendEvent(over, event)
    return event
