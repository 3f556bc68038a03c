"""The twin as a Gymnasium environment: by Gymnasium's own checker, and by what a policy must be able to do in it."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import lumenpilot.gym
from hardware.twin.bench_env import AHEAD_MM, BenchEnv


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")  # the checker's advice, such as on the range of actions
def test_gymnasium_accepts_it() -> None:
    check_env(gymnasium.make(lumenpilot.gym.ID, render_mode="rgb_array").unwrapped)


def test_it_can_be_seen_through_the_camera() -> None:
    env = BenchEnv("image")
    seen, _ = env.reset(options={"trial": 1})
    again, *_ = env.step(np.zeros(3, np.float32))
    assert env.observation_space.contains(seen)
    assert env.observation_space.contains(again)
    assert (np.abs(seen.astype(int) - (0, 255, 0)).sum(axis=2) < 60).sum() > 20, "the target"


def test_a_simple_rule_follows_the_route_and_is_rewarded() -> None:
    """Steering to the point 14 mm ahead; standing still gains nothing."""
    env = BenchEnv()
    seen, info = env.reset(options={"trial": 3})
    begin_mm, total = info["left_mm"], 0.0
    for _ in range(60):
        forward, right = seen[7 + 3], seen[7 + len(AHEAD_MM) + 3]
        seen, reward, terminated, _, info = env.step(np.array([1.6 * np.arctan2(right, forward), 0.0, 0.5], np.float32))
        total += reward
        if terminated:
            break
    assert begin_mm - info["left_mm"] > 20.0
    assert total > 1.0
    _, reward, *_ = env.step(np.zeros(3, np.float32))
    assert abs(reward) < 0.3


def test_episodes_end_in_time_and_repeat_with_their_seed() -> None:
    env = BenchEnv(seconds=0.2)
    first = [env.reset(seed=4)[0], *(env.step(np.array([0.5, 0.0, 1.0], np.float32)) for _ in range(2))]
    assert [step[2:4] for step in first[1:]] == [(False, False), (False, True)]
    again = [env.reset(seed=4)[0], *(env.step(np.array([0.5, 0.0, 1.0], np.float32)) for _ in range(2))]
    assert np.array_equal(first[2][0], again[2][0])
    assert not np.array_equal(first[0], env.reset()[0]), "the next bench is another one"


def test_a_bend_takes_the_time_that_the_joints_need() -> None:
    env = BenchEnv()
    env.reset(options={"trial": 1})
    env.step(np.array([1.0, 0.0, 0.0], np.float32))
    pull_mm = max(env._opened().drive(0.001).bend, 0.0)
    assert 0.0 < pull_mm < 0.9


def test_what_is_no_observation_is_refused() -> None:
    with pytest.raises(ValueError, match="must be state or image"):
        BenchEnv("sound")
    with pytest.raises(RuntimeError, match="call reset"):
        BenchEnv().step(np.zeros(3, np.float32))
