"""The bench twin as one world: phantom, physics, look and camera view share a clock that is stepped or follows the wall clock."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

import numpy as np

from core.config import PerceptionConfig, TwinConfig
from core.latest import Latest
from core.perception.route import plan_route
from core.types import Command, Frame, Point, Points
from hardware.twin.appearance import Appearance, make_view
from hardware.twin.autopilot import RouteFollower, nearest_target
from hardware.twin.look import appearance_of
from hardware.twin.phantom import Phantom
from hardware.twin.phantoms import make_phantom
from hardware.twin.physics import TwinPhysics
from hardware.twin.renderer import Picture, Renderer
from hardware.twin.robot import TwinRobot
from hardware.twin.truth import Truth, true_graph, truth_of

_log = logging.getLogger(__name__)

_CONTROL_S = 0.02
_COMMAND_EXPIRES_S = 0.3
_CATCH_UP_S = 0.2


class TwinWorld:
    """Steps the physics under the robot's current command and renders frames.

    Lock-step: call ``advance`` and ``frame``; nothing runs by itself, and the same seeds and commands give the same bits.
    Real time: ``start`` runs both in a thread; its clock gives up what it cannot catch up within 0.2 s, so a busy machine slows
    the world down instead of making it jump.
    """

    def __init__(
        self,
        config: TwinConfig,
        *,
        phantom: Phantom | None = None,
        appearance: Appearance | None = None,
        perception: PerceptionConfig | None = None,
        seed: int = 0,
    ) -> None:
        self.config = config
        self.phantom = phantom or make_phantom(config.phantom)
        if appearance is None:
            appearance = appearance_of(config)
        self.appearance = appearance
        self._perception = perception or PerceptionConfig()
        size = (config.image_width_px, config.image_height_px)
        self.view = make_view(appearance, size, self.phantom)
        self.physics = TwinPhysics(self.phantom, seed)
        self.robot = TwinRobot(self.physics)
        self._renderer = Renderer(self.phantom, appearance, size, seed)
        self._frame_index = 0
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self.frames: Latest[Frame] = Latest()
        self.failure: str | None = None
        self.drive: Callable[[float], Command] | None = None
        """Asked for the command of the coming seconds instead of the robot, when something else moves it (the servos)."""

    def advance(self, duration_s: float) -> None:
        """Step the physics by simulated seconds under the robot's current command."""
        with self._lock:
            left = duration_s
            while left > 1e-9:
                step = min(_CONTROL_S, left)
                self.physics.step(self.robot.current_command if self.drive is None else self.drive(step), step)
                left -= step

    def insert(self, length_mm: float, speed_mm_s: float = 40.0, target: int | None = None) -> None:
        """Feed the robot to an insertion length along the route to `target` (default: the farthest), so that there is a view."""
        nodes = self.phantom.targets
        follower = max((RouteFollower(self.phantom, node) for node in nodes), key=lambda f: f.length_mm)
        if target is not None:
            follower = RouteFollower(self.phantom, target)
        length_mm = min(length_mm, follower.length_mm - 5.0)
        for _ in range(int(4 * length_mm / speed_mm_s / _CONTROL_S)):
            if self.physics.insertion_mm >= length_mm:
                break
            # Past the robot's own speed limit, straight to the physics: this is set-up, not operation.
            with self._lock:
                self.physics.step(follower.command(self.physics.robot_points_mm(), speed_mm_s, _CONTROL_S), _CONTROL_S)
        with self._lock:
            self.physics.step(Command(), 0.3)

    def frame(self, captured_s: float | None = None) -> Frame:
        """Render the world as it is now; ``captured_s`` defaults to simulated time."""
        with self._lock:
            points, sheath_mm, now = self.physics.robot_points_mm(), self.physics.delivery_mm, self.physics.time_s
            index = self._frame_index
            self._frame_index += 1
        picture = self._renderer.render(points, sheath_mm, noise_seed=index)
        return Frame(index, now if captured_s is None else captured_s, picture.image)

    def picture(self, robot_points_mm: Points, sheath_mm: float = 0.0) -> Picture:
        """Image and exact masks for a robot shape."""
        return self._renderer.render(robot_points_mm, sheath_mm, noise_seed=self._frame_index)

    def truth(self, target_px: Point | None = None) -> Truth:
        """The exact truth of the present moment, by perception's 40-px rule; with a target its route decides at forks."""
        with self._lock:
            points = self.physics.robot_points_mm()
        route = None
        if target_px is not None:
            scale = self._perception.working_size_px / max(self.view.size)
            graph = true_graph(self.phantom, self.view, scale)
            ends = (self.view.project(points[-1:])[0] + 0.5) * scale - 0.5, (np.array(target_px) + 0.5) * scale - 0.5
            route = plan_route(graph, (float(ends[0][0]), float(ends[0][1])), (float(ends[1][0]), float(ends[1][1])))
        return truth_of(self.phantom, self.view, points, self.appearance.robot_radius_mm, self._perception, route)

    def target_at(self, point_px: Point) -> int:
        """The phantom's target node nearest to an image point."""
        point = self.view.unproject(np.array([point_px]))[0]
        return nearest_target(self.phantom, (float(point[0]), float(point[1])))

    def start(self) -> None:
        """Let the world run by itself, in step with the wall clock as far as the machine can."""
        if self._thread is None:
            self.failure = None
            self._stop.clear()
            self._thread = threading.Thread(target=self._run, name="twin-world", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Stop the world's thread; the world can be started again."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _run(self) -> None:
        try:
            self._follow_clock()
        except Exception as error:  # noqa: BLE001 - top of the thread: the camera reports it as its own loss
            _log.exception("the bench twin stopped")
            self.failure = f"the bench twin stopped ({type(error).__name__}: {error}); start the rig again"

    def _follow_clock(self) -> None:
        period = 1.0 / self.config.live_frames_per_second
        clock = next_frame = time.monotonic()
        while not self._stop.is_set():
            now = time.monotonic()
            clock = max(clock, now - _CATCH_UP_S)
            if self.robot.command_age_s() > _COMMAND_EXPIRES_S:
                # Whoever drives repeats the command; a program that hangs does not.
                self.robot.hold()
            if now - clock >= _CONTROL_S:
                self.advance(_CONTROL_S)
                clock += _CONTROL_S
            if now >= next_frame:
                self.frames.put(self.frame(captured_s=time.monotonic()))
                next_frame = max(next_frame + period, now)
            wait = min(clock + _CONTROL_S, next_frame) - time.monotonic()
            if wait > 0:
                self._stop.wait(wait)
