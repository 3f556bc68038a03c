"""The policies by name: scene -> advice. The same object advises the operator and drives."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, cast

import numpy as np

from core.config.models import POLICIES, AdviceConfig, Config
from core.control.joints import limited
from core.control.pursuit import Pursuit, speed_word
from core.messages import message
from core.types import Advice, PoseState, RobotStatus, Scene, Speed


def table_policy(scene: Scene, config: AdviceConfig) -> Advice | None:
    """The paper's state table ("4 states of interventional robot"); None when there is no pose.

    A: fast, no steering. B: slow, no steering. C: slowest, steer hardest. D: moderate, steer. The steering closes theta.
    """
    pose = scene.pose
    if pose is None:
        return None
    turn_deg = -pose.theta_signed_deg if pose.theta_signed_deg else -pose.c_head_px
    where = "right" if pose.c_head_px > 0 else "left"
    if pose.state is PoseState.A:
        return Advice(Speed.FAST, config.fast_mm_s, 0.0, "on the centerline and along it")
    if pose.state is PoseState.B:
        return Advice(Speed.SLOW, config.slow_mm_s, 0.0, message("coming back to the centerline from the {side}", side=where))
    if pose.state is PoseState.C:
        steer = limited(config.steer_gain_away * turn_deg, config.max_steer_deg)
        return Advice(
            Speed.SLOWEST, config.slowest_mm_s, steer, message("moving away from the centerline to the {side}", side=where)
        )
    steer = limited(config.steer_gain * turn_deg, config.max_steer_deg)
    return Advice(
        Speed.MODERATE, config.moderate_mm_s, steer, message("crossed the centerline to the {side}, angle left", side=where)
    )


class Policy(Protocol):
    """Advice for a scene; `status` is the robot's own, `followed` tells whether the advice drives the robot. None: no advice.

    ``reset`` makes a policy forget the frames before.
    """

    def __call__(self, scene: Scene, status: RobotStatus | None = None, *, followed: bool = True) -> Advice | None: ...
    def reset(self) -> None: ...


class Memoryless:
    """A policy that depends on the scene alone."""

    def __init__(self, advise: Callable[[Scene], Advice | None]) -> None:
        self._advise = advise

    def __call__(self, scene: Scene, status: RobotStatus | None = None, *, followed: bool = True) -> Advice | None:
        return self._advise(scene)

    def reset(self) -> None: ...


class RandomOperator:
    """Baseline: changes speed and steering at random every 0.5 to 1.5 s; seeded."""

    def __init__(self, config: Config, seed: int) -> None:
        self._config = config.advice
        self._seed = seed
        self.reset()

    def reset(self) -> None:
        self._rng = np.random.default_rng([self._seed, 50021])
        self._until_s: float | None = None
        self._advice: Advice | None = None

    def __call__(self, scene: Scene, status: RobotStatus | None = None, *, followed: bool = True) -> Advice | None:
        if self._until_s is None or scene.captured_s >= self._until_s:
            words, rng = self._config, self._rng
            speeds = (words.slowest_mm_s, words.slow_mm_s, words.moderate_mm_s, words.fast_mm_s, -words.slow_mm_s)
            speed_mm_s = float(rng.choice(speeds, p=(0.1, 0.2, 0.35, 0.25, 0.1)))
            steer_deg = float(rng.uniform(-1.0, 1.0)) * words.max_steer_deg
            self._advice = Advice(speed_word(abs(speed_mm_s), words), speed_mm_s, steer_deg, "at random")
            self._until_s = scene.captured_s + float(rng.uniform(0.5, 1.5))
        return self._advice


class StopsAtTarget:
    """Wraps a policy, and stops at the target, which the paper's table does not know."""

    def __init__(self, policy: Policy, arrive_px: float) -> None:
        self._policy = policy
        self._arrive_px = arrive_px

    def __call__(self, scene: Scene, status: RobotStatus | None = None, *, followed: bool = True) -> Advice | None:
        if scene.pose is not None and scene.route is not None and scene.route.length_px <= self._arrive_px:
            return Advice(Speed.STOP, 0.0, 0.0, "at the target")
        return self._policy(scene, status, followed=followed)

    def reset(self) -> None:
        self._policy.reset()


def make_policy(name: str, config: Config, seed: int = 0) -> Policy:
    """A new policy; `seed` is for the random operator. Raises PluginError."""
    policy: Policy
    if name == "pursuit":
        policy = Pursuit(config.policy.pursuit, config.advice, config.policy.drive.turn_deg)
    elif name == "table":
        policy = Memoryless(lambda scene: table_policy(scene, config.advice))
    elif name == "push":  # baseline: straight on at moderate speed, whatever the picture shows
        straight_on = Advice(Speed.MODERATE, config.advice.moderate_mm_s, 0.0, "straight on")
        policy = Memoryless(lambda _: straight_on)
    elif name == "random":
        policy = RandomOperator(config, seed)
    else:
        policy = cast(Policy, POLICIES.make(name, config, seed))
    return StopsAtTarget(policy, config.policy.pursuit.arrive_px)
