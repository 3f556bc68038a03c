"""The bench twin as an environment of Gymnasium, ``LumenPilot/Bench-v0``: a policy steers the robot to a target, in lock-step.

Phantom, robot and target follow from the seed; trials use other seeds (``hardware/twin/trial.py``), so that a learnt policy can be
tried on benches that it has not seen. Actions pass the rules that turn an operator's commands into joint goals: speed and envelope
of every joint are those of the configuration. Observations are the twin's truth or its picture, without perception.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from core import geometry
from core.config.models import Config
from core.types import Command, Image, Points
from hardware.twin.actuation import DirectJoints
from hardware.twin.phantoms import make_phantom
from hardware.twin.rendering.appearance import named_appearance
from hardware.twin.trial import FIRST_SEED, REACHED_MM, choose_target, start_mm
from hardware.twin.truth import heading
from hardware.twin.world import TwinWorld

STEP_S = 0.1
"""Simulated time of one step."""
MAX_ADVANCE_MM_S = 10.0
"""Feed at an action of 1."""
AHEAD_MM = (0.0, 4.0, 8.0, 14.0, 22.0, 32.0)
"""Points of the route that are observed, ahead of the point nearest to the head."""
_AHEAD_SCALE_MM, _LEFT_SCALE_MM = 30.0, 100.0
"""Lengths that are observed as 1."""
_CONTACT_SCALE_N = 0.1
"""Wall force that is observed as 1."""
_PER_MM, _PER_N_S, _PER_S, _REACHED = 0.1, 2.0, 0.02, 10.0
"""Reward: for each mm of progress; cost of a wall force of 1 N for 1 s, and of a second; for reaching the target."""
_BEHIND_MM, _WITHIN_MM = 15.0, 25.0
"""The head is looked for on the route so far behind and ahead of where it was: the route may come near to itself."""
_IMAGE_SIZE = 128, 96
"""Width and height of the observed picture, px."""
_TARGET_COLOUR, _TARGET_PX = (0, 255, 0), 4
"""The target is a disc of this radius in the observed picture."""

Observation = NDArray[np.float32] | NDArray[np.uint8]


class BenchEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """One episode: from before the first fork to the target, at most `seconds` of simulated time.

    Parameters
    ----------
    observation : "state": float32 (19,), each -1..1: insertion and what is left of the route (in 100 mm), bend, pitch, wall
        force (in 0.1 N), radius of the lumen (in 30 mm), offset from the route over that radius, then ``AHEAD_MM`` points of the
        route as seen from the head, all forward and then all to the right (in 30 mm). "image": uint8 (96, 128, 3), the camera's
        picture with the target as a green disc.
    seconds : of an episode, then it is truncated.
    render_mode : "rgb_array": ``render`` returns the camera's picture, (480, 640, 3).
    config : sizes, speeds and limits; default: the program's.

    Notes
    -----
    The action is float32 (3,), -1..1: bend, pitch (of the tendons' full pull) and feed (of 10 mm/s). The reward of a step is 0.1
    for each mm of progress along the route, -0.02 a second, -2 for a wall force of 1 N for a second, and 10 for the target (head
    within 5 mm), which terminates the episode. ``info`` has ``left_mm``, ``wall_contact_n`` and ``reached``.
    ``reset(options={"trial": N})`` takes the bench of ``trial --seeds N``.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": round(1 / STEP_S)}  # noqa: RUF012 - as Gymnasium has it

    def __init__(
        self,
        observation: Literal["state", "image"] = "state",
        seconds: float = 60.0,
        render_mode: str | None = None,
        config: Config | None = None,
    ) -> None:
        if observation not in ("state", "image"):
            raise ValueError(f"observation {observation!r}: must be state or image")
        self.render_mode = render_mode
        self.action_space = spaces.Box(-1.0, 1.0, (3,), np.float32)
        width, height = _IMAGE_SIZE
        self.observation_space = (
            spaces.Box(0, 255, (height, width, 3), np.uint8)
            if observation == "image"
            else spaces.Box(-1.0, 1.0, (7 + 2 * len(AHEAD_MM),), np.float32)
        )
        self._sees_image = observation == "image"
        self._seconds = seconds
        self._config = config or Config()
        self._world: TwinWorld | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observation, dict[str, Any]]:
        """A new bench; returns the observation and the info."""
        super().reset(seed=seed)
        trial = (options or {}).get("trial")
        own_seed = int(self.np_random.integers(FIRST_SEED)) if trial is None else FIRST_SEED + int(trial)
        config = self._config
        phantom = make_phantom(f"random:{own_seed}")
        look = named_appearance(None, own_seed)
        world = self._world = TwinWorld(config.twin, phantom=phantom, appearance=look, seed=own_seed, servos=config.servos)
        target = choose_target(phantom, world.view, own_seed)
        world.insert(start_mm(phantom, target), target=target.node)
        joints = DirectJoints(config.servos, config.safety)
        world.drive = lambda duration_s: joints.command(world.command, duration_s)
        self._route, self._target = target.route, target
        self._along = geometry.arc_length(target.route)
        self._at_mm = geometry.nearest(target.route, world.physics.head_mm, self._along)[1]
        self._start_s, self._command = world.physics.time_s, Command()
        return self._observation(), self._info()

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for ``STEP_S``. Raises RuntimeError before the first reset, and ValueError for numbers that are not finite."""
        world = self._opened()
        bend, pitch, feed = np.clip(np.asarray(action, np.float64), -1.0, 1.0).tolist()
        self._command = world.send(Command(bend, pitch, feed * MAX_ADVANCE_MM_S))
        before_mm = self._at_mm
        world.advance(STEP_S)
        self._at_mm = self._progress()
        info = self._info()
        reward = _PER_MM * (self._at_mm - before_mm) - STEP_S * (_PER_S + _PER_N_S * info["wall_contact_n"])
        reward += _REACHED if info["reached"] else 0.0
        is_late = world.physics.time_s - self._start_s >= self._seconds
        return self._observation(), float(reward), bool(info["reached"]), bool(is_late and not info["reached"]), info

    def render(self) -> Image | None:
        """The camera's picture; None without the render mode."""
        return self._opened().frame().image if self.render_mode == "rgb_array" else None

    def _opened(self) -> TwinWorld:
        if self._world is None:
            raise RuntimeError("the environment was not reset: call reset() first")
        return self._world

    def _progress(self) -> float:
        """How far along the route the head is, mm."""
        near = np.flatnonzero((self._along > self._at_mm - _BEHIND_MM) & (self._along < self._at_mm + _WITHIN_MM))
        piece = self._route[near]
        return float(self._along[near[0]]) + geometry.nearest(piece, self._opened().physics.head_mm)[1]

    def _info(self) -> dict[str, Any]:
        physics = self._opened().physics
        reached = math.dist(physics.head_mm, self._target.point_mm) <= REACHED_MM
        left_mm = max(0.0, self._target.at_mm - self._at_mm)
        return {"left_mm": left_mm, "wall_contact_n": physics.status().wall_contact_n or 0.0, "reached": reached}

    def _observation(self) -> Observation:
        return self._image() if self._sees_image else self._state()

    def _state(self) -> NDArray[np.float32]:
        world, info = self._opened(), self._info()
        points = world.physics.robot_points_mm()
        head, forward = points[-1], heading(points)
        right = np.array([-forward[1], forward[0]])
        ahead = geometry.point_at(self._route, self._along, np.minimum(self._at_mm + np.array(AHEAD_MM), self._along[-1])) - head
        radius_mm = self._radius_mm(ahead[0] + head)
        first = [
            world.physics.insertion_mm / _LEFT_SCALE_MM - 1.0,
            info["left_mm"] / _LEFT_SCALE_MM - 1.0,
            self._command.bend,
            self._command.pitch,
            info["wall_contact_n"] / _CONTACT_SCALE_N,
            radius_mm / _AHEAD_SCALE_MM,
            float(ahead[0] @ right) / max(radius_mm, 1e-6),
        ]
        seen = np.concatenate([first, ahead @ forward / _AHEAD_SCALE_MM, ahead @ right / _AHEAD_SCALE_MM])
        return np.asarray(np.clip(seen, -1.0, 1.0), np.float32)

    def _radius_mm(self, point: Points) -> float:
        """Of the lumen at the nearest centerline."""
        graph = self._opened().phantom.graph
        edge = min(graph.edges, key=lambda edge: float(np.min(np.sum((edge.points - point) ** 2, axis=1))))
        return float(edge.radius[int(np.argmin(np.sum((edge.points - point) ** 2, axis=1)))])

    def _image(self) -> NDArray[np.uint8]:
        import cv2

        world = self._opened()
        image = world.frame().image
        small = np.ascontiguousarray(cv2.resize(image, _IMAGE_SIZE, interpolation=cv2.INTER_AREA))
        scale = _IMAGE_SIZE[0] / image.shape[1], _IMAGE_SIZE[1] / image.shape[0]
        at = tuple(round((value + 0.5) * factor - 0.5) for value, factor in zip(self._target.click_px, scale, strict=True))
        cv2.circle(small, at, _TARGET_PX, _TARGET_COLOUR, -1, cv2.LINE_AA)
        return np.asarray(small, np.uint8)
