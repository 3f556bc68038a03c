"""The bench twin: a world of phantom, physics, look and camera view, with its camera.

The world is stepped by the caller (lock-step) or follows the wall clock. It applies the newest command, unless servos drive it.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from core.config.models import PerceptionConfig, TwinConfig
from core.config.safety import SafetyConfig, ServosConfig
from core.control.joints import limited
from core.devices import DeviceError, Latest
from core.perception.centerline import plan_route
from core.types import Command, Frame, Point, Points
from hardware.simulated_clock import STEP_S, WorldClock
from hardware.twin.actuation import DirectJoints
from hardware.twin.phantom import Phantom
from hardware.twin.phantoms import make_phantom
from hardware.twin.physics import DriveProperties, Specimen, TwinPhysics
from hardware.twin.rendering.appearance import Appearance, appearance_of, make_view
from hardware.twin.rendering.renderer import RenderedFrame, Renderer
from hardware.twin.truth import RouteFollower, Truth, true_graph, truth_of

MAX_ADVANCE_MM_S = 20.0
MAX_DELIVERY_MM_S = 10.0
MAX_ROTATION_DEG_S = 90.0


_log = logging.getLogger(__name__)

_CONTROL_S = 0.02  # period of the command, in simulated time
_REST_S = 0.3
"""After an insertion the robot comes to rest."""


class TwinWorld:
    """Steps the physics under the newest command and renders frames.

    Lock-step: call ``advance`` and ``frame``; the same seeds and commands give the same bits. Real time: ``start`` runs both in a
    thread by a ``WorldClock``, so on a busy machine the world becomes slower and does not jump. Frames have the time of `clock`;
    without one that of the wall clock.
    """

    def __init__(
        self,
        config: TwinConfig,
        *,
        phantom: Phantom | None = None,
        appearance: Appearance | None = None,
        perception: PerceptionConfig | None = None,
        seed: int = 0,
        servos: ServosConfig | None = None,
        safety: SafetyConfig | None = None,
        clock: WorldClock | None = None,
        drive: DriveProperties | None = None,
    ) -> None:
        self.config = config
        self._clock = clock
        servos = servos or ServosConfig()
        self.phantom = phantom or make_phantom(config.phantom)
        self.appearance = appearance_of(config) if appearance is None else appearance
        self._perception = perception or PerceptionConfig()
        size = (config.image_width_px, config.image_height_px)
        self.view = make_view(self.appearance, size, self.phantom)
        known, specimen = config.behaviour, None
        if known is not None:
            specimen = Specimen.drawn(seed)
            specimen = replace(specimen, shaft_ei=known.shaft_to_head.value * specimen.tip_ei)
            drive = drive or DriveProperties.identified(known, servos.max_pull_mm, specimen.bend_deg_per_mm)
        tendons_deg = [joint.angle_deg or 0.0 for joint in servos.tendons]
        self.physics = TwinPhysics(self.phantom, seed, drive, tendons_deg, specimen)
        self.command = Command()
        self._renderer = Renderer(self.phantom, self.appearance, size, seed)
        self.appearance = self._renderer.appearance
        self._frame_index = 0
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self.frames: Latest[Frame] = Latest()
        self.failure: str | None = None
        self.drive: Callable[[float], Command] | None = None
        """Gives the command for the coming seconds in place of ``command``, when servos move the robot."""
        self._joints = None if servos.is_default else DirectJoints(servos, safety or SafetyConfig())
        if self._joints is not None:
            self.drive = lambda duration_s: self._of_joints(self.command, duration_s)

    def send(self, command: Command) -> Command:
        """Apply a command from now on, clamped to the robot's limits; returns it clamped.

        Raises ValueError when a number is not finite; the command before stays.
        """
        values = (command.bend, command.pitch, command.advance_mm_s, command.delivery_mm_s, command.rotation_deg_s)
        if not all(math.isfinite(value) for value in values):
            raise ValueError(f"command is not finite: {command}")
        limits = (1.0, 1.0, MAX_ADVANCE_MM_S, MAX_DELIVERY_MM_S, MAX_ROTATION_DEG_S)
        self.command = Command(*map(limited, values, limits))
        return self.command

    def advance(self, duration_s: float) -> None:
        """Step the physics by simulated seconds under the newest command."""
        with self._lock:
            left = duration_s
            while left > 1e-9:
                step = min(_CONTROL_S, left)
                self.physics.step(self.command if self.drive is None else self.drive(step), step)
                left -= step

    def _of_joints(self, command: Command, duration_s: float) -> Command:
        """What the physics does with a command, by the joints of a robot of another shape."""
        return command if self._joints is None else self._joints.command(command, duration_s)

    def insert(self, length_mm: float, speed_mm_s: float = 40.0, target: int | None = None) -> None:
        """Feed the robot to an insertion length along the route to `target` (default: the longest route)."""
        nodes = self.phantom.targets
        follower = max((RouteFollower(self.phantom, node) for node in nodes), key=lambda f: f.length_mm)
        if target is not None:
            follower = RouteFollower(self.phantom, target)
        length_mm = min(length_mm, follower.length_mm - 5.0)
        for _ in range(int(4 * length_mm / speed_mm_s / _CONTROL_S)):
            if self.physics.insertion_mm >= length_mm:
                break
            # Directly in the physics, without the robot's speed limit: this is set-up, not operation.
            with self._lock:
                command = follower.command(self.physics.robot_points_mm(), speed_mm_s, _CONTROL_S)
                self.physics.step(self._of_joints(command, _CONTROL_S), _CONTROL_S)
        with self._lock:
            self._come_to_rest()

    def _come_to_rest(self) -> None:
        """Straight and turned back: what drives the joints from now on begins with all of them at rest."""
        if self._joints is None:
            self.physics.step(Command(), _REST_S)
            return
        while not self._joints.is_at_rest:
            self.physics.step(self._joints.command_to_rest(_CONTROL_S), _CONTROL_S)
        self.physics.step(Command(), _REST_S)

    def frame(self, captured_s: float | None = None) -> Frame:
        """Render the present state; `captured_s` defaults to simulated time."""
        with self._lock:
            points, sheath_mm, now = self._shown_points_mm(), self.physics.delivery_mm, self.physics.time_s
            index = self._frame_index
            self._frame_index += 1
        picture = self._renderer.render(points, sheath_mm, noise_seed=index)
        return Frame(index, now if captured_s is None else captured_s, picture.image)

    def _shown_points_mm(self) -> Points | None:
        """The robot's line (N, 2); None where it is drawn out of the picture."""
        return None if self.physics.is_drawn_out else self.physics.robot_points_mm()

    def picture(self, robot_points_mm: Points, sheath_mm: float = 0.0) -> RenderedFrame:
        """Image and exact masks for a robot shape."""
        return self._renderer.render(robot_points_mm, sheath_mm, noise_seed=self._frame_index)

    def truth(self, target_px: Point | None = None) -> Truth:
        """The exact truth of the present state; with a target, its route decides at forks."""
        with self._lock:
            points = self._shown_points_mm()
        route = None
        if target_px is not None and points is not None:
            scale = self._perception.working_size_px / max(self.view.size)
            graph = true_graph(self.phantom, self.view, scale)
            ends = (self.view.project(points[-1:])[0] + 0.5) * scale - 0.5, (np.array(target_px) + 0.5) * scale - 0.5
            route = plan_route(graph, (float(ends[0][0]), float(ends[0][1])), (float(ends[1][0]), float(ends[1][1])))
        return truth_of(self.phantom, self.view, points, self.appearance.robot_radius_mm, self._perception, route)

    def start(self) -> None:
        """Run in a thread, in step with the wall clock as far as the machine can."""
        if self._thread is None:
            self.failure = None
            self._stop.clear()
            self._thread = threading.Thread(target=self._run, name="twin-world", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Stop the thread; it can be started again."""
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
        clock = self._clock or WorldClock()
        clock.begin()
        next_frame_s = clock.world_s
        while not self._stop.is_set():
            if (wait_s := clock.wait_s()) > 0.0:
                self._stop.wait(wait_s)
                continue
            self.advance(STEP_S)
            if clock.world_s >= next_frame_s:
                self.frames.put(self.frame(captured_s=time.monotonic() if self._clock is None else clock.world_s))
                next_frame_s = max(next_frame_s + period, clock.world_s)


class TwinCamera:
    """A ``Camera`` over a ``TwinWorld``. In lock-step every read advances the world by one frame period."""

    def __init__(self, world: TwinWorld, *, lock_step: bool = False) -> None:
        self._world = world
        self._lock_step = lock_step
        self.name = f"bench twin: {world.phantom.title}"

    def open(self) -> None:
        if not self._lock_step:
            self._world.start()

    def read(self, timeout_s: float) -> Frame | None:
        if self._lock_step:
            self._world.advance(1.0 / self._world.config.frames_per_second)
            return self._world.frame()
        frame = self._world.frames.take(timeout_s)
        if frame is None and self._world.failure is not None:
            raise DeviceError(self._world.failure)
        return frame

    def close(self) -> None:
        self._world.stop()
