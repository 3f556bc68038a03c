"""Agreement of simulated raters whose errors are known, and the common answer of several."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.annotation.agreement_report import (
    agreement_report,
    choose_study,
    group_notes,
    manual_measurements,
    measured_alike,
    rater_notes,
    second_measure_notes,
    undecided,
    write_measures,
)
from core.annotation.model import AngleProvenance, Annotation, AnnotationError, ImageView, measure_lines
from core.annotation.store import ImageRecord, ItemKey, StoredAnnotation
from core.config.models import PerceptionConfig
from core.evaluation.evaluation import EvaluationError, evaluate, read_measurements, write_measurements
from core.types import PoseState

TRUE_DEG = np.linspace(0.0, 60.0, 200)


def answer(
    image: str, rater: str, repeat: int, theta_deg: float | None, state: PoseState | None, study: str = "s"
) -> StoredAnnotation:
    content = Annotation(((0.0, 0.0), (50.0, 0.0)), ((0.0, 5.0), (90.0, 5.0)), state, cannot_tell=theta_deg is None)
    measured = (theta_deg, theta_deg, 1.0, 2.0) if theta_deg is not None else (None,) * 4
    return StoredAnnotation(ItemKey(image, study, rater, repeat), ImageView.AS_IS, content, *measured, False, 20.0, "2026")


def state_of(theta_deg: float) -> PoseState:
    return PoseState.B if theta_deg < 30 else PoseState.C


def simulated(rater: str, sd_deg: float, bias_deg: float, seed: int) -> list[StoredAnnotation]:
    rng = np.random.default_rng(seed)
    angles = [(k, repeat, true + bias_deg + rng.normal(0, sd_deg)) for repeat in (1, 2) for k, true in enumerate(TRUE_DEG)]
    return [answer(str(k), rater, repeat, theta, state_of(theta)) for k, repeat, theta in angles]


def test_known_errors_come_out() -> None:
    """Ann errs by 1 degree (SD), Bob by 2 and he reads 3 degrees more; their difference has the SD sqrt(1 + 4)."""
    report = agreement_report(simulated("ann", 1.0, 0.0, 1) + simulated("bob", 2.0, 3.0, 2), {})
    ann, bob = report["raters"]["ann"], report["raters"]["bob"]
    assert ann["sd_deg"] == pytest.approx(1.0, rel=0.15)
    assert bob["sd_deg"] == pytest.approx(2.0, rel=0.15)
    assert report["within"]["sd_deg"] == pytest.approx(math.sqrt((ann["sd_deg"] ** 2 + bob["sd_deg"] ** 2) / 2))
    assert "repeatability_sd_deg" not in bob["angle"], "said once"
    assert ann["angle"]["icc"] > 0.99
    (pair,) = report["pairs"]
    assert pair["angle"]["mean_difference_deg"] == pytest.approx(3.0, abs=0.5)
    reach = 1.96 * math.sqrt(5.0)
    assert pair["angle"]["loa_high_deg"] - pair["angle"]["loa_low_deg"] == pytest.approx(2 * reach, rel=0.15)
    # within an image: half the variance of the difference, with its bias of 3: (9 + 5) / 2
    assert report["between"]["sd_deg"] == pytest.approx(math.sqrt(7.0), rel=0.1)
    assert 0.9 < report["between"]["icc"] < ann["angle"]["icc"]
    assert 0.7 < pair["state"]["kappa"] < 1.0
    assert report["raters"]["ann"]["median_time_s"] == 20.0
    assert (report["images"], report["annotations"]) == (200, 800)


def test_kappa_is_of_states_and_who_cannot_tell_gives_none() -> None:
    """Four images, three alike (kappa 1/2), five that neither and two that only Bob could tell: these change no agreement."""
    ann = [answer(str(k), "ann", 1, 5.0, s) for k, s in enumerate([PoseState.B] * 3 + [PoseState.C])]
    bob = [answer(str(k), "bob", 1, 5.0, s) for k, s in enumerate([PoseState.B] * 2 + [PoseState.C] * 2)]
    dark = [answer(f"dark {k}", who, 1, None, None) for k in range(5) for who in ("ann", "bob")]
    half = [answer(f"dim {k}", "ann", 1, None, None) for k in (1, 2)]
    half += [answer(f"dim {k}", "bob", 1, 5.0, PoseState.B) for k in (1, 2)]
    (pair,) = agreement_report(ann + bob + dark + half, {})["pairs"]
    none = {"one_cannot_tell": 0, "neither_can_tell": 0, "one_no_robot": 0, "both_no_robot": 0}
    unclear = none | {"one_cannot_tell": 2, "neither_can_tell": 5}
    assert pair["state"] == unclear | {"n": 4, "equal": 0.75, "kappa": pytest.approx(0.5)}
    (pair,) = agreement_report(dark, {})["pairs"]
    assert pair["state"] == none | {"n": 0, "equal": None, "kappa": None, "neither_can_tell": 5}
    empty = [replace(one, content=replace(one.content, cannot_tell=False, no_robot=True)) for one in dark[:5]]
    report = agreement_report(empty + dark[5:], {})
    states, ann = report["pairs"][0]["state"], report["raters"]["ann"]
    assert states == none | {"n": 0, "equal": None, "kappa": None, "neither_can_tell": 2, "both_no_robot": 2} | {
        "one_cannot_tell": 1,
        "one_no_robot": 1,
    }
    assert (ann["no_robot"], ann["cannot_tell"]) == (3, 2)


def test_a_picture_without_a_robot_is_an_answer_of_its_own(tmp_path: Path) -> None:
    """In the table, and among the figures: the algorithm may give no pose there."""
    seen = answer("1", "ann", 1, 4.0, PoseState.B)
    empty = [replace(answer(name, "ann", 1, None, None), content=Annotation(no_robot=True)) for name in "23"]
    taken = replace(answer("4", "ann", 1, 5.0, PoseState.B), provenance=AngleProvenance.CORRECTED, is_short=True)
    rows = manual_measurements([seen, *empty, taken, answer("5", "ann", 1, None, None)], {})
    rows = [replace(row, algorithm_angle=3.0, algorithm_state="B") if row.image in "124" else row for row in rows]
    write_measurements(tmp_path / "m.csv", rows)
    assert read_measurements(tmp_path / "m.csv") == rows
    assert [row.answer for row in rows] == [None, "no robot", "no robot", None, "can't tell"]
    assert [row.provenance for row in rows] == ["manual", None, None, "corrected", None]
    metrics = evaluate(rows)
    assert metrics["no_robot"] == {"n": 2, "pose_given": 1}
    assert metrics["angle"]["n"] == 2
    told = " ".join(metrics["notes"])
    assert "Images without a robot, by hand: 2; the algorithm gave a pose on 1 of them, wrongly." in told
    assert "could not tell the pose: 1;" in told
    assert "(corrected: 1)" in told
    assert "shorter than the fit wants: 1;" in told


def test_one_rater_alone_has_no_pairs(tmp_path) -> None:
    report = agreement_report([answer("1", "ann", 1, 4.0, PoseState.B)], {"1": "one.png"})
    assert report["pairs"] == []
    assert report["between"] == {"raters": 1, "n": 0, "sd_deg": None, "icc": None}
    write_measures(tmp_path / "m.csv", report["measures"])
    header, row = (tmp_path / "m.csv").read_text().splitlines()
    assert dict(zip(header.split(","), row.split(","), strict=True))["image"] == "one.png"


def test_the_common_answer() -> None:
    def common(*answers: StoredAnnotation) -> tuple[float | None, float | None, str | None]:
        (row,) = manual_measurements(answers, {})
        return row.angle_1, row.angle_2, row.state

    b, c = PoseState.B, PoseState.C
    assert common(answer("i", "ann", 1, 4.0, b)) == (4.0, None, "B")
    assert common(answer("i", "ann", 1, 4.0, b), answer("i", "ann", 2, 6.0, c)) == (4.0, 6.0, "B")
    assert common(answer("i", "bob", 1, 8.0, c), answer("i", "ann", 1, 4.0, b)) == (4.0, 8.0, "B")
    twice = [answer("i", who, k, 4.0 * k + shift, c) for who, shift in (("ann", 0.0), ("bob", 2.0)) for k in (1, 2)]
    assert common(*twice) == (5.0, 9.0, "C")
    assert common(answer("i", "ann", 1, None, None), answer("i", "bob", 1, 3.0, c)) == (3.0, None, "C")
    assert common(answer("i", "ann", 1, None, None)) == (None, None, None)


def test_the_common_angle_is_the_mean_of_all_measures_whatever_the_raters_are_called(tmp_path) -> None:
    for names in (("anna", "ben", "cleo"), ("zoe", "ben", "cleo")):
        answers = [answer("i", who, 1, theta, PoseState.B) for who, theta in zip(names, (10.0, 20.0, 30.0), strict=True)]
        (row,) = manual_measurements(answers, {})
        assert row.manual_angle_deg == pytest.approx(20.0)
    answers = [answer("i", who, 1, 10.0, PoseState.B) for who in names] + [answer("i", names[0], 2, 40.0, PoseState.B)]
    (row,) = manual_measurements(answers, {})
    assert row.manual_angle_deg == pytest.approx(17.5)
    write_measurements(tmp_path / "m.csv", [row])
    assert read_measurements(tmp_path / "m.csv") == [row], "also when it is read again"
    text = (tmp_path / "m.csv").read_text().replace(",3,1", ",0,1")
    (tmp_path / "m.csv").write_text(text)
    with pytest.raises(EvaluationError, match=r"line 2: count_1 is '0'; must be of how many measures"):
        read_measurements(tmp_path / "m.csv")


def test_a_row_tells_of_how_many_measures_its_angles_are_the_means() -> None:
    answers = [answer("i", who, k, 4.0, PoseState.B) for who, repeats in (("ann", (1, 2, 3)), ("bob", (1,))) for k in repeats]
    (row,) = manual_measurements(answers, {})
    assert row.counts == (2, 2)
    rows = [replace(row, image=str(k), angle_1=4.0 + k, algorithm_angle=5.0 + k) for k in range(3)]
    assert any("means over several raters" in note for note in evaluate(rows)["notes"])
    assert not any("means" in note for note in evaluate([replace(one, counts=(1, 1)) for one in rows])["notes"])


def test_several_studies_ask_for_a_choice() -> None:
    rows = [answer("1", "ann", 1, 4.0, PoseState.B, "pilot"), answer("1", "ann", 1, 5.0, PoseState.B, "main")]
    with pytest.raises(AnnotationError, match=r"holds several studies \('main', 'pilot'\); choose one with --study NAME"):
        choose_study(rows, None, "here")
    assert [one.key.study for one in choose_study(rows, "main", "here")] == ["main"]
    with pytest.raises(AnnotationError, match="no finished annotation of study 'other'"):
        choose_study(rows, "other", "here")


def test_the_round_trip_of_a_rater_with_a_pixel_of_noise() -> None:
    """48 known poses, drawn twice with 1 px of noise on every point: angles come back without bias, within what the noise explains.

    Noise of 1 px on both ends of a line of 80 px turns it by sqrt(2) / 80 = 1.01 degrees, two lines by 1.43 degrees.
    """
    rng = np.random.default_rng(3)
    config, answers, true = PerceptionConfig(), [], {}
    for k in range(48):
        theta, turn = rng.uniform(5, 60), rng.uniform(-180, 180)
        true[str(k)] = theta
        robot, vessel = _pose(theta, turn)
        for repeat in (1, 2):
            noisy = [tuple(tuple(p) for p in (np.array(line) + rng.normal(0, 1, (2, 2))).tolist()) for line in (robot, vessel)]
            pose = measure_lines(Annotation(noisy[0], noisy[1]), (640, 480), config).pose
            answers.append(answer(str(k), "ann", repeat, pose.theta_deg, pose.state))
    ann = agreement_report(answers, {})["raters"]["ann"]
    assert ann["sd_deg"] == pytest.approx(1.43, rel=0.25)
    errors = [
        row.manual_angle_deg - true[row.image] for row in manual_measurements(answers, {}) if row.manual_angle_deg is not None
    ]
    assert len(errors) == 48
    assert np.mean(errors) == pytest.approx(0.0, abs=0.45)
    assert np.std(errors, ddof=1) == pytest.approx(1.43 / math.sqrt(2), rel=0.3)


def _pose(theta_deg: float, turn_deg: float) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """A robot of 80 px whose head lies in the middle of a vessel line of 80 px, at an angle to it."""
    vessel, robot = (math.radians(turn_deg), math.radians(turn_deg + theta_deg))
    along, back = np.array([math.cos(vessel), math.sin(vessel)]), np.array([math.cos(robot), math.sin(robot)])
    head = np.array([320.0, 240.0])
    return [tuple(head - 80 * back), tuple(head)], [tuple(head - 40 * along), tuple(head + 40 * along)]


def test_images_on_which_no_state_was_given_most_often_are_counted() -> None:
    """There the name that comes first decides, which a reader has to know."""
    states = {"1": "BD", "2": "BBD", "3": "BDDB", "4": "A", "5": ""}
    answers = [answer(image, f"r{k}", 1, 1.0, PoseState(s)) for image, given in states.items() for k, s in enumerate(given)]
    assert undecided(answers) == 2
    assert undecided([*answers, answer("1", "r9", 1, None, PoseState.D)]) == 2, "who could not tell says nothing"


def test_names_that_may_be_one_persons_are_told() -> None:
    done = [answer("a", "Anna", 1, 10.0, PoseState.B), answer("b", "anna ", 1, 10.0, PoseState.B)]
    (note,) = rater_notes(done)
    assert note == "The raters 'Anna' and 'anna ' are taken for different people: figures between raters count them so."
    assert rater_notes(done[:1]) == []


@pytest.mark.parametrize("cannot_tell", [False, True])
def test_second_measures_of_two_kinds_are_told(cannot_tell: bool) -> None:
    """Image "a" was measured twice by Ann, "b" by two raters, "c" once; where Bob could not tell, "b" has one measure alone."""
    done = [answer("a", "ann", repeat, 10.0, PoseState.B) for repeat in (1, 2)]
    done += [answer("b", "ann", 1, 10.0, PoseState.B), answer("c", "ann", 1, 10.0, PoseState.B)]
    assert second_measure_notes(done) == []
    notes = second_measure_notes([*done, answer("b", "bob", 1, None if cannot_tell else 11.0, PoseState.B)])
    if cannot_tell:
        assert notes == []
    else:
        assert notes[0].startswith("The second manual measure is a rater's later one on 1 images and another rater's on 1;")
        rows = {row.image: row.counts for row in manual_measurements([*done, answer("b", "bob", 1, 11.0, PoseState.B)], {})}
        assert rows["b"] == rows["a"], "the same columns hold both kinds"


def test_too_few_groups_for_intervals_are_told() -> None:
    answers = [answer(str(k), rater, 1, 10.0 + k, PoseState.B) for k in range(12) for rater in ("ann", "ben")]
    assert group_notes(answers, {str(k): str(k % 2) for k in range(12)}) == [
        "No intervals between measures: the images are of 2 groups (sessions or phantoms), and images of one are alike; "
        "intervals need 10 groups."
    ]
    assert group_notes(answers, {str(k): str(k) for k in range(12)}) == group_notes(answers, {}) == []


IMAGE = ImageRecord("ab" * 32, "frame.png", 640, 480)
BENT = Annotation(((200.0, 240.0), (270.0, 240.0), (290.0, 220.0)), ((150.0, 200.0), (400.0, 200.0)), PoseState.C)
"""The robot's last 28 px lead elsewhere than what lies before them."""
METHODS = PerceptionConfig()
SHORTER = METHODS.model_copy(update={"vectors": METHODS.vectors.model_copy(update={"robot_length_px": 20.0})})


def kept(content: Annotation, config: PerceptionConfig) -> StoredAnnotation:
    """As the annotator keeps it under this configuration."""
    pose = measure_lines(content, IMAGE.size, config).pose
    key = ItemKey(IMAGE.sha256, "", "ann")
    values = pose.theta_deg, pose.theta_signed_deg, pose.d_head_px, pose.d_tail_px, pose.crossed
    return StoredAnnotation(key, ImageView.AS_IS, content, *values, 1.0, "2026-01-01")


def test_angles_of_other_lengths_are_measured_anew_and_told() -> None:
    other, own = kept(BENT, SHORTER), kept(BENT, METHODS)
    assert other.theta_deg == pytest.approx(45.0)
    assert own.theta_deg < 40.0
    (first, second), (note,) = measured_alike([other, own], {IMAGE.sha256: IMAGE}, METHODS)
    assert first == own == second
    assert measured_alike([own], {IMAGE.sha256: IMAGE}, METHODS) == ([own], [])
    assert measured_alike([other], {}, METHODS) == ([other], []), "without its image it stays as it was kept"
    assert "Of the manual angles 1 were fitted otherwise" in note
    assert "robot 40 px, vessel twice 20 px" in note


def test_lines_that_are_too_short_for_other_lengths_have_no_angle_any_more() -> None:
    one = kept(replace(BENT, vessel=((285.0, 200.0), (295.0, 200.0))), METHODS)
    vectors = METHODS.vectors.model_copy(update={"vessel_half_length_px": 60.0})
    (now,), notes = measured_alike([one], {IMAGE.sha256: IMAGE}, METHODS.model_copy(update={"vectors": vectors}))
    assert (now.theta_deg, now.theta_signed_deg, now.d_head_px, now.d_tail_px, now.crossed) == (None,) * 5
    assert now.content.state is PoseState.C, "what the rater said stays"
    (note,) = notes
    assert note.endswith("On 1 of them too little was drawn for these lengths: they have a state, and no angle.")
