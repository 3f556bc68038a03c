"""One closed-loop trial in the twin: lock-step and bit-equal, with a target that the camera sees."""

from __future__ import annotations

import json

import numpy as np
import pytest

from core.config.models import Config, PolicyName, load_config
from core.evaluation.accuracy import TrueMasks
from core.evaluation.trial import Row
from core.perception.pipeline import Pipeline
from core.types import Advice, RobotStatus, Scene, Speed
from hardware.twin.phantoms import make_phantom
from hardware.twin.rendering.appearance import make_view, random_appearance
from hardware.twin.trial import FIRST_SEED, Trial, TrialPlan, _Operator, choose_target


def _run(seed: int, policy: PolicyName = "pursuit", seconds: float = 1.5, config: Config | None = None) -> Row:
    config = config or Config()
    masks = TrueMasks()
    plan = TrialPlan(config, true_masks=True, max_seconds=seconds)
    return Trial(plan, seed, policy, Pipeline(masks, config.perception), masks).run()


def test_the_same_seed_gives_the_same_bits() -> None:
    first = _run(0, seconds=0.6)
    assert json.dumps(_run(0, seconds=0.6)) == json.dumps(first)
    assert json.dumps(_run(0, "push", seconds=0.6)) != json.dumps(first)


def test_a_trial_tells_what_happened() -> None:
    row = _run(1)
    assert (row["seed"], row["policy"], row["phantom"], row["outcome"]) == (1, "pursuit", f"random:{FIRST_SEED + 1}", "time out")
    assert not row["reached"]
    assert row["insertion_mm"] > 23.0  # it was fed
    assert row["answered_share"] > 0.9
    assert row["theta_error_median_deg"] < 5.0
    assert row["head_error_median_px"] < 3.0
    assert sum(row["state_shares"].values()) == pytest.approx(1.0, abs=1e-3)
    assert row["track"]["time_s"] == pytest.approx([0.034 + 0.1 * k for k in range(16)], abs=2e-3)


def test_a_trial_without_any_pose_is_helped_and_then_given_up() -> None:
    # A threshold that nothing reaches: perception never answers, and the operator never learns why.
    config = load_config(None, None, {"perception": {"segmentation": {"robot_threshold": 0.999}}})
    row = _run(0, seconds=30.0, config=config)
    assert row["outcome"] in {"lost", "stuck"}
    assert row["answered_share"] == 0.0
    assert set(row["refusals"]) == {"no robot"}


def test_a_policy_that_gives_up_ends_the_trial_without_waiting_for_progress() -> None:
    config = Config()
    masks = TrueMasks()
    trial = Trial(TrialPlan(config, true_masks=True, max_seconds=30.0), 0, "pursuit", Pipeline(masks, config.perception), masks)
    trial._policy = _GivesUp()
    row = trial.run()
    assert row["outcome"] == "stopped short"
    assert 2.0 <= row["time_s"] < 3.0


@pytest.mark.parametrize("look", ["fluoroscopy", "tank"])
def test_the_look_may_be_named(look: str) -> None:
    config, masks = Config(), TrueMasks()
    trial = Trial(TrialPlan(config, true_masks=True, look=look), 3, "pursuit", Pipeline(masks, config.perception), masks)
    assert trial._world.appearance == random_appearance(FIRST_SEED + 3, look)


def test_the_policy_is_not_told_the_wall_force() -> None:
    config, masks, told = Config(), TrueMasks(), []
    plan = TrialPlan(config, true_masks=True, max_seconds=0.2)
    trial = Trial(plan, 1, "pursuit", Pipeline(masks, config.perception), masks)
    policy = trial._policy

    class Listening(_GivesUp):
        def __call__(self, scene: Scene, status: RobotStatus | None = None, *, followed: bool = True) -> Advice | None:
            told.append(status is not None and status.wall_contact_n is not None)
            return policy(scene, status, followed=followed)

    trial._policy = Listening()
    row = trial.run()
    assert told and not any(told)
    assert row["wall_contact_n"] is not None, "it is measured all the same"


class _GivesUp:
    def __call__(self, scene: Scene, status: RobotStatus | None = None, *, followed: bool = True) -> Advice | None:
        return Advice(Speed.STOP, 0.0, 0.0, "missed")

    def reset(self) -> None: ...


@pytest.mark.parametrize("seed", range(0, 40, 10))
def test_targets_are_seen_and_far_enough(seed: int) -> None:
    own = FIRST_SEED + seed
    phantom = make_phantom(f"random:{own}")
    view = make_view(random_appearance(own), (640, 480), phantom)
    target = choose_target(phantom, view, own)
    assert target.node in phantom.targets
    assert target.at_mm > 40.0
    assert np.all((np.array(target.click_px) > 0) & (np.array(target.click_px) < (640, 480)))
    assert choose_target(phantom, view, own).click_px == target.click_px
    back = view.unproject(np.array([target.click_px]))[0]
    assert back == pytest.approx(target.point_mm, abs=1e-3)


def test_the_operator_helps_after_the_patience_of_the_safety_rules() -> None:
    operator = _Operator(0.5)
    assert operator.acts(True, 0.0) is None
    assert operator.acts(False, 0.4) is None
    assert operator.acts(False, 0.6) is True
    assert operator.acts(True, 1.0) is False
    assert operator.acts(True, 1.7) is None
    assert operator.acts(False, 2.0) is None
