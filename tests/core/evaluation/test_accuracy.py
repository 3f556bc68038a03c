"""Scores of frames against their truth, and their sums, with values counted by hand."""

import numpy as np
import pytest

from core.evaluation.accuracy import FrameScore, score_frame, summarise, summarise_looks
from core.evaluation.confidence import describe_confidence, describe_gates
from core.learning.dataset import DatasetError
from core.types import Masks, Pose, PoseState, Reason, Refusal, RobotPath, Scene
from tests.core.drawing import art

VESSEL = art("""
####
####
....
""")
ROBOT = art("""
.##.
....
....
""")
NOTHING = np.zeros_like(VESSEL)
BLANK = np.zeros(VESSEL.shape, np.float32)
TRUTH = {"state": "C", "theta_deg": 12.0, "theta_signed_deg": 12.0, "head_xy": [200.5, 100.5]}


def scene(theta_signed_deg: float = 14.0, head: tuple[float, float] = (103.0, 54.0)) -> Scene:
    """Half size: the true head lies at (100, 50) in working pixels."""
    pose = Pose(abs(theta_signed_deg), theta_signed_deg, 8.0, 4.0, False, PoseState.C, 0.8)
    path = RobotPath(np.array([[0.0, 0.0], head]), 1.0, None, True, 0.0, 4.0)
    return Scene(0, 0.0, (1280, 960), 0.5, masks=Masks(VESSEL, ROBOT, BLANK, BLANK), path=path, pose=pose)


def test_a_frame_with_a_pose() -> None:
    score = score_frame("a", scene(), VESSEL, ROBOT, TRUTH)
    assert score.expected
    assert score.answered
    assert score.head_error_px == pytest.approx(5.0)  # 3 across, 4 down
    assert score.theta_error_deg == pytest.approx(2.0)
    assert (score.vessel_dice, score.robot_dice) == (1.0, 1.0)
    assert (score.state, score.true_state) == ("C", "C")
    assert (score.theta_deg, score.true_theta_deg, score.confidence) == (14.0, 12.0, 0.8)


@pytest.mark.parametrize(
    ("found", "true", "error"), [(-14.0, 14.0, -28.0), (14.0, -14.0, 28.0), (179.0, -179.0, -2.0), (-178.0, 177.0, 5.0)]
)
def test_the_error_of_theta_is_signed_and_goes_the_short_way_round(found: float, true: float, error: float) -> None:
    truth = TRUTH | {"theta_deg": abs(true), "theta_signed_deg": true}
    assert score_frame("a", scene(found), VESSEL, ROBOT, truth).theta_error_deg == pytest.approx(error)


def test_beside_a_branch_the_nearest_of_the_accepted_lines_counts() -> None:
    branch = {"theta_deg": 40.0, "theta_signed_deg": -40.0, "state": "D"}
    truth = TRUTH | {"alternatives": [branch]}
    near = score_frame("a", scene(14.0), VESSEL, ROBOT, truth)
    assert (near.theta_error_deg, near.true_state, near.true_theta_deg) == (pytest.approx(2.0), "C", 12.0)
    far = score_frame("a", scene(-37.0), VESSEL, ROBOT, truth)
    assert (far.theta_error_deg, far.true_state, far.true_theta_deg) == (pytest.approx(3.0), "D", 40.0)


def test_a_frame_without_robot_or_masks() -> None:
    nothing = Scene(0, 0.0, (1280, 960), 0.5, refusal=Refusal(Reason.BLACK))
    score = score_frame("a", nothing, VESSEL, NOTHING, {"state": None, "theta_deg": None, "head_xy": None})
    assert not score.expected
    assert score.vessel_dice == 0.0
    assert score.robot_dice is None


def score(**more: object) -> FrameScore:
    values: dict[str, object] = {
        "stem": "a",
        "vessel_dice": 0.9,
        "robot_dice": 0.8,
        "expected": True,
        "answered": True,
        "reason": None,
        "head_error_px": 2.0,
        "theta_error_deg": 1.0,
        "theta_deg": 10.0,
        "true_theta_deg": 9.0,
        "state": "C",
        "true_state": "C",
        "confidence": 0.9,
    }
    return FrameScore(**(values | more))


REFUSED: dict[str, object] = {"answered": False, "head_error_px": None, "theta_error_deg": None, "theta_deg": None, "state": None}


def test_of_unmeasured_frames_only_the_masks_count() -> None:
    drawn = score(expected=False, true_state=None, true_theta_deg=None, theta_error_deg=None, head_error_px=None, is_measured=False)
    sums = summarise([score(), drawn, drawn])
    assert (sums["frames"], sums["expected"], sums["poseless_frames"], sums["empty_frames"]) == (3, 1, 0, 0)
    assert sums["robot_dice"] == pytest.approx(drawn.robot_dice)
    assert describe_confidence([score(), drawn])["reliability"]["0.90-0.95"]["n"] == 1


def test_stricter_gates_refuse_what_promises_less() -> None:
    empty = REFUSED | {"expected": False, "robot_dice": None, "true_state": None, "true_theta_deg": None}
    scores = [
        score(confidence=0.96),
        score(confidence=0.8, theta_error_deg=-3.0, theta_deg=20.0, true_theta_deg=23.0),
        score(confidence=0.75, theta_error_deg=20.0, theta_deg=40.0, true_theta_deg=20.0, state="B"),
        score(confidence=0.0, **REFUSED, reason=Reason.NO_ROBOT),
        score(**(empty | {"answered": True, "state": "A", "confidence": 0.6})),
    ]
    gates = describe_gates(scores)
    assert list(gates) == ["0.80", "0.90", "0.95", "0.98"]  # below all answers a gate changes nothing
    assert gates["0.80"] == {
        "answered_share": 2 / 4, "state_agreement": 1.0, "state_kappa": None, "theta_pearson": None,
        "answered_and_wrong_share": 0.0, "theta_mean_deg": 2.0,
    }  # fmt: skip
    assert (gates["0.95"]["answered_share"], gates["0.95"]["theta_mean_deg"]) == (1 / 4, 1.0)
    assert (gates["0.98"]["answered_share"], gates["0.98"]["state_agreement"], gates["0.98"]["theta_mean_deg"]) == (0.0, None, None)
    assert describe_gates([score(**empty)]) == {}


def test_sums_by_hand() -> None:
    empty = REFUSED | {"expected": False, "robot_dice": None, "true_state": None, "true_theta_deg": None}
    scores = [
        score(),
        score(theta_error_deg=-3.0, theta_deg=20.0, true_theta_deg=23.0, head_error_px=4.0),
        score(theta_error_deg=-20.0, theta_deg=40.0, true_theta_deg=60.0, state="B", head_error_px=3.0, vessel_dice=0.5),
        score(**REFUSED, reason=Reason.NO_ROBOT, robot_dice=0.0),
        score(**empty, reason=Reason.NO_ROBOT),
        score(**(empty | {"answered": True, "state": "A"})),
    ]
    sums = summarise(scores)
    assert (sums["frames"], sums["expected"], sums["empty_frames"], sums["answers_on_empty_frames"]) == (6, 4, 2, 1)
    assert sums["answered_share"] == 3 / 4
    assert sums["refused"] == {"no robot": 1}
    assert sums["vessel_dice"] == pytest.approx((5 * 0.9 + 0.5) / 6)
    assert sums["robot_dice"] == pytest.approx((3 * 0.8 + 0.0) / 4)
    assert sums["head_error_px"]["mean"] == pytest.approx(3.0)
    assert sums["theta_error_deg"]["median"] == 3.0  # of 1, 3 and 20: the size counts, not the sign
    assert sums["theta_error_deg"]["mean"] == pytest.approx(8.0)
    assert sums["state_agreement"] == pytest.approx(2 / 3)
    assert sums["answered_and_wrong_share"] == sums["confident_and_wrong_share"] == pytest.approx(1 / 3)
    assert sums["theta_pearson"] == pytest.approx(float(np.corrcoef([9, 23, 60], [10, 20, 40])[0, 1]))


def test_toss_up_states_are_counted_apart() -> None:
    far, near = TRUTH | {"c_head_px": 12.0, "c_tail_px": 4.0}, TRUTH | {"c_head_px": 12.0, "c_tail_px": 11.9}
    scores = [
        score_frame("a", scene(), VESSEL, ROBOT, far),
        score_frame("b", scene(), VESSEL, ROBOT, far | {"state": "D"}),
        score_frame("c", scene(), VESSEL, ROBOT, near | {"state": "B"}),
        score_frame("d", scene(), VESSEL, ROBOT, TRUTH),  # without distances
    ]
    assert [s.true_room_px for s in scores] == [pytest.approx(v) for v in (4.0, 4.0, 0.05)] + [None]
    sums = summarise(scores)
    assert (sums["state_agreement"], sums["state_agreement_but_toss_ups"]) == (2 / 4, 1 / 2)
    assert sums["state_toss_up_share"] == pytest.approx(1 / 3)
    assert summarise(scores[-1:])["state_toss_up_share"] is summarise(scores[2:])["state_agreement_but_toss_ups"] is None


def test_confident_answers_are_told_apart() -> None:
    far = {"head_error_px": 30.0, "true_theta_deg": 8.0}
    scores = [score(confidence=c, **more) for c, more in ((0.9, {}), (0.7, far), (0.5, {}), (0.49, far))]
    scores += [score(**REFUSED, reason=Reason.NO_ROBOT, confidence=0.0), score(expected=False, true_state=None, **REFUSED)]
    sums = summarise(scores)
    assert (sums["answered_share"], sums["answered_and_wrong_share"]) == (4 / 5, 2 / 4)
    assert (sums["confident_share"], sums["confident_and_wrong_share"]) == (3 / 5, pytest.approx(1 / 3))
    stricter = summarise(scores, 0.8)
    assert (stricter["confident_share"], stricter["confident_and_wrong_share"]) == (1 / 5, 0.0)
    assert stricter["answered_and_wrong_share"] == 2 / 4, "an answer that is unsure is one all the same"
    none = summarise(scores, 0.95)
    assert (none["confident_share"], none["confident_and_wrong_share"]) == (0.0, None)


def test_answers_where_there_is_no_pose_are_counted() -> None:
    """The head is outside the picture: whatever is answered is wrong, but no angle can say by how much."""
    without = score_frame("b", scene(), VESSEL, ROBOT, {"state": None, "theta_deg": None})
    sums = summarise([score_frame("a", scene(), VESSEL, ROBOT, TRUTH), without])
    assert (sums["poseless_frames"], sums["answers_on_poseless_frames"]) == (1, 1)
    assert (sums["empty_frames"], sums["expected"]) == (0, 1)


def test_a_truth_without_a_head_says_what_it_lacks() -> None:
    with pytest.raises(DatasetError, match=r"frame a: truth\.jsonl has theta_deg of it, but not head_xy"):
        score_frame("a", scene(), VESSEL, ROBOT, {"state": "C", "theta_deg": 12.0, "theta_signed_deg": 12.0})


def test_every_look_counts_alike() -> None:
    scores = [
        score(stem="a", vessel_dice=0.9),
        score(stem="b", vessel_dice=0.7, state="B"),
        score(stem="c", vessel_dice=0.5),
        score(stem="d", vessel_dice=0.1, robot_dice=0.2),
        score(**REFUSED, stem="e", reason=Reason.NO_ROBOT, vessel_dice=0.3, robot_dice=0.4),
    ]
    sums = summarise_looks(scores, {"a": "red", "b": "red", "c": "blue", "d": "x-ray", "e": "x-ray"})
    assert list(sums["looks"]) == ["blue", "red", "x-ray"]
    assert sums["looks"]["red"] == {
        "frames": 2,
        "answered_share": 1.0,
        "vessel_dice": pytest.approx(0.8),
        "robot_dice": pytest.approx(0.8),
        "head_error_px": 2.0,
        "theta_error_deg": 1.0,
        "state_agreement": 0.5,
        "answered_and_wrong_share": 0.0,
        "confident_share": 1.0,
        "confident_and_wrong_share": 0.0,
    }
    # every look counts alike, however many frames it has
    assert sums["mean_over_looks"]["vessel_dice"] == pytest.approx((0.8 + 0.5 + 0.2) / 3)
    assert (sums["mean_over_looks"]["looks"], sums["mean_over_looks"]["frames"]) == (3, 5)
