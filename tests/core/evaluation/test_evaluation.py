"""Tables of measures: what is read, what is refused in one line, what becomes of blanks; and the study like the paper's."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.evaluation.evaluation import EvaluationError, Measurement, angle_pairs, evaluate, read_measurements, write_measurements
from core.evaluation.paper import (
    PAPER_CONFUSION,
    Better,
    FigureFormat,
    Verdict,
    against_paper,
    choose_images,
    measure_twice,
    verdict,
    wanted_images,
)
from tests.core.evaluation.test_metrics import label_pairs

HEADER = "image,angle_1,angle_2,state,algorithm_angle,algorithm_state"
ROW = "a.png,10,12,B,14.5,C"


@pytest.fixture
def table(tmp_path: Path):
    def write(text: str, encoding: str = "utf-8") -> Path:
        path = tmp_path / "measures.csv"
        path.write_bytes(text.encode(encoding))
        return path

    return write


def test_a_row_as_it_stands(table) -> None:
    (row,) = read_measurements(table(f"{HEADER}\n{ROW}\n"))
    assert row == Measurement("a.png", 10.0, 12.0, "B", 14.5, "C")
    assert row.manual_angle_deg == 11.0
    (row,) = read_measurements(table(f"{HEADER},group\n{ROW},session 1", "utf-16"))  # as spreadsheets write Unicode text
    assert row == Measurement("a.png", 10.0, 12.0, "B", 14.5, "C", "session 1")


@pytest.mark.parametrize(
    "text",
    [
        f"\ufeff{HEADER}\r\n{ROW}\r\n\r\n",  # as Excel writes it
        f"note,{HEADER}\nx,{ROW}",
        "algorithm_state, image ,angle_2,angle_1,algorithm_angle,state\nc,a.png, 12.0 ,1e1,14.5, b \n",
        f"{HEADER}\n{ROW}".replace(",", ";").replace("14.5", "14,5"),  # where a comma is the decimal mark
        f"{HEADER}\n{ROW}".replace(",", "\t"),
        f"{HEADER}\n,,,,,\n{ROW},,\n",
        f"{HEADER.upper()}\n{ROW}",
        f"Image,Angle 1, angle-2 ,State,Algorithm angle,ALGORITHM STATE\n{ROW}",
        f"image,angle_1 (deg),angle_2 [°],state,algorithm_angle_deg,algorithmState\n{ROW}",
        "image,angle1,Angle2,state,algorithm_angle,algorithm_state\na.png,10°,12,B,14.5,C",
        f"sep=;\n{HEADER}\n{ROW}".replace(",", ";"),
        f"\n\n{HEADER}\n{ROW}",
    ],
)
def test_ways_to_write_the_same_table(table, text: str) -> None:
    assert read_measurements(table(text)) == [Measurement("a.png", 10.0, 12.0, "B", 14.5, "C")]


def test_blank_means_not_measured(table) -> None:
    rows = read_measurements(table(f"{HEADER}\na,,12,,,\nb,5\nc,,,B,3,\n"))
    assert rows[0] == Measurement("a", None, 12.0, None, None, None)
    assert rows[0].manual_angle_deg == 12.0
    assert rows[1] == Measurement("b", 5.0, None, None, None, None)
    assert rows[2].manual_angle_deg is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty; needs the columns image, angle_1"),
        ("\n \n", "empty"),
        (HEADER + "\n", "has a header but no rows"),
        (HEADER + "\n,,,,,\n", "has a header but no rows"),
        (HEADER.replace("angle_2,", "") + "\na,1,B,2,B", "'angle_2' is missing"),
        (
            HEADER.replace("algorithm_angle", "algoritm_angle") + "\n" + ROW,
            "'algorithm_angle' is missing; is 'algoritm_angle' meant?",
        ),
        (
            HEADER.replace("angle_1", "winkel") + "\n" + ROW,
            "'angle_1' is missing; needs the columns image, angle_1, angle_2, state, algorithm_angle, algorithm_state",
        ),
        (HEADER + ",Angle 1\n" + ROW + ",1", "column 'angle_1' occurs 2 times ('angle_1', 'Angle 1')"),
        (f"{HEADER}\n{ROW}\nb,1,2,B,14,B\n{ROW}", "line 4: image 'a.png' is in line 2 already; give it one row"),
        (HEADER + ",state\n" + ROW + ",B", "'state' occurs 2 times"),
        (f"{HEADER}\n{ROW}\nb,1_0,12,B,14,B", "line 3: angle_1 is '1_0'; must be an angle in degrees"),
        (f"{HEADER},count_1,count_2\n{ROW},{'9' * 5000},1", "line 2: count_1 is '99999999999999999999'; must be of"),
        (f"{HEADER}\n{ROW}\nb,ten,12,B,14,B", "line 3: angle_1 is 'ten'; must be an angle in degrees"),
        (f"{HEADER}\nb,1,nan,B,14,B", "line 2: angle_2 is 'nan'"),
        (f"{HEADER}\nb,1,2,B,inf,B", "algorithm_angle is 'inf'"),
        (f"{HEADER}\nb,1,2,B,1000,B", "algorithm_angle is '1000'"),
        (f"{HEADER}\nb,1,2,E,14,B", "state is 'E'; must be one of A, B, C, D"),
        (f"{HEADER}\nb,1,2,B,14,none", "algorithm_state is 'none'"),
        (f"{HEADER}\nb,1,2,B,14,B,7,8", "8 cells under 6 columns"),
        (f'{HEADER}\n"b,1,2,B,14,B', "not valid CSV"),
    ],
)
def test_a_bad_table_is_one_clear_line(table, text: str, words: str) -> None:
    path = table(text)
    with pytest.raises(EvaluationError) as caught:
        read_measurements(path)
    assert words in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    rows = [
        Measurement('odd, "name"\nof two lines', 1.25, None, None, 0.1 + 0.2, "D"),
        Measurement("b", None, None, "A", None, None),
    ]
    write_measurements(tmp_path / "out.csv", rows)
    assert read_measurements(tmp_path / "out.csv") == rows


@pytest.mark.parametrize(
    ("groups", "drawn"),
    [
        ([f"session {place // 4}" for place in range(48)], {"drawn": "groups", "groups": 12}),
        ([f"session {place // 24}" for place in range(48)], {"drawn": "nothing", "groups": 2}),
        ([f"session {place}" for place in range(48)], {"drawn": "images", "groups": 48}),
        ([None] * 48, {"drawn": "images", "groups": 0}),
    ],
)
def test_it_says_what_the_intervals_draw(groups: list[str | None], drawn: dict[str, object]) -> None:
    rng = np.random.default_rng(1)
    angles = rng.uniform(0.0, 60.0, (48, 2))
    rows = [Measurement(str(k), angles[k, 0], angles[k, 0], "B", angles[k, 1], "B", groups[k]) for k in range(48)]
    assert evaluate(rows)["intervals"] == drawn


def test_too_few_groups_give_no_interval_and_a_note() -> None:
    """Two phantoms: their images are alike, and taken one by one their intervals would be too narrow."""
    rng = np.random.default_rng(1)
    angles = rng.uniform(0.0, 60.0, (48, 2))
    rows = [Measurement(str(k), angles[k, 0], angles[k, 0], "BC"[k % 2], angles[k, 1], "B", f"phantom {k % 2}") for k in range(48)]
    found = evaluate(rows)
    assert {value for part in ("angle", "state", "manual") for value in found[part]["ci95"].values()} == {None}
    (note,) = [note for note in found["notes"] if note.startswith("No intervals")]
    assert note == (
        "No intervals of angles, states and manual measures: the images are of 2 groups (sessions or phantoms), "
        "and images of one are alike; intervals need 10 groups."
    )


def rows_of(*cells: tuple) -> list[Measurement]:
    return [Measurement(str(place), *values) for place, values in enumerate(cells)]


def test_each_statistic_takes_the_rows_that_have_what_it_needs() -> None:
    rows = rows_of(
        (10.0, 12.0, "B", 13.0, "B"),
        (20.0, None, None, 19.0, "C"),
        (30.0, 31.0, "D", None, None),
        (None, None, "C", 5.0, "C"),
        (None, None, None, 7.0, "A"),
    )
    found = evaluate(rows)
    assert angle_pairs(rows).manual_deg.tolist() == [11.0, 20.0]
    assert (found["angle"]["n"], found["angle"]["mean_error_deg"]) == (2, 0.5)
    assert (found["state"]["n"], found["state"]["accuracy"]) == (2, 1.0)
    assert found["manual"]["n"] == 2
    assert found["images"] == {"n": 5, "measured": 4, "answered": 3, "unanswered": 1}
    assert any("no answer for 1 of 4" in note for note in found["notes"])


def test_what_is_missing_is_counted() -> None:
    """Of each kind: measured by hand only, by the algorithm only, not at all; and the states likewise."""
    rows = rows_of(
        (10.0, 12.0, "B", 13.0, "B"),
        (10.0, None, "B", 13.0, None),
        (20.0, 21.0, "B", None, "B"),
        (20.0, 21.0, None, None, "C"),
        (None, None, "C", 7.0, "C"),
        (None, None, None, None, None),
    )
    notes = evaluate(rows)["notes"]
    lacking = "by hand only, 1 by the algorithm only, 1 by neither"
    assert f"The angle was given by hand and by the algorithm on 2 of 6 images (2 {lacking})." in notes
    assert f"The state was given by hand and by the algorithm on 3 of 6 images (1 {lacking})." in notes
    assert "Images that were measured once by hand, and not twice: 1." in notes
    assert not any("only" in note or "once" in note for note in evaluate(rows[:1] * 2)["notes"])
    nameless = "Rows that name no image: 1; whether one is there twice cannot be seen."
    assert nameless in evaluate([replace(rows[0], image="")])["notes"]


def test_angles_measured_to_the_other_side_are_told_and_not_turned() -> None:
    """180 minus, and with the other sign. A right angle goes to both sides, and a plain error of 30 degrees to neither."""
    rows = rows_of(
        (170.0, 172.0, "B", 10.0, "B"),
        (-20.0, -21.0, "B", 22.0, "B"),
        (90.0, 92.0, "B", 91.0, "B"),
        (10.0, 12.0, "B", 41.0, "B"),
        (10.0, 169.0, "B", 90.0, "B"),
    )
    found = evaluate(rows)
    told = [note for note in found["notes"] if "other side" in note]
    assert [note.split(" are more")[0] for note in told] == [
        "Images on which manual and algorithmic angle",
        "Images on which the two manual angles",
    ]
    assert "its sign changed): 2 (0, 1). They are taken as they are; look at them." in told[0]
    assert found["angle"]["mean_abs_error_deg"] == pytest.approx((161 + 42.5 + 0 + 30 + 0.5) / 5)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (rows_of((10.0, 11.0, "B", 12.0, "B")), "One image with angles"),
        (rows_of((10.0, 11.0, "B", 12.0, "B")), "kappa is undefined"),
        (rows_of((10.0, 11.0, "B", 12.0, "B")), "pair-counting Fowlkes-Mallows index is undefined"),
        (rows_of((10.0, 10.0, "B", 12.0, "C"), (10.0, 10.0, "B", 15.0, "B")), "correlation is undefined"),
        (rows_of((10.0, 10.0, "B", 12.0, "C"), (10.0, 10.0, "B", 15.0, "B")), "No image has the manual state C"),
        (rows_of((None, None, "B", None, "C"), (None, None, "B", None, "B")), "no angle statistics"),
        (rows_of((1.0, None, None, 1.0, None), (2.0, None, None, 3.0, None)), "no state statistics"),
        (rows_of((1.0, None, None, 1.0, None), (2.0, None, None, 3.0, None)), "Fewer than two images were measured twice"),
        (rows_of((-3.0, None, None, 190.0, None)), "2 angles lie outside"),
    ],
)
def test_what_is_undefined_is_null_with_a_note(rows: list[Measurement], words: str) -> None:
    found = evaluate(rows)
    json.dumps(found, allow_nan=False)
    assert any(words in note for note in found["notes"]), found["notes"]


def test_the_contracts_names() -> None:
    found = evaluate(rows_of((10.0, 12.0, "B", 13.0, "B"), (20.0, 20.0, "C", 19.0, "B")))
    angle = "n mean_error_deg sd_deg median_deg pearson spearman share_0_4 share_4_8 loa_low_deg loa_high_deg icc ci95"
    state = "n labels confusion accuracy kappa fowlkes_mallows_pairs fowlkes_mallows_macro per_class macro weighted ci95"
    assert found["angle"].keys() >= set(angle.split())
    assert found["state"].keys() >= set(state.split())
    assert found["state"]["per_class"]["B"].keys() >= {"precision", "recall", "f1"}
    assert found["state"]["macro"].keys() == found["state"]["weighted"].keys() == {"precision", "recall", "f1"}


# the study like the paper's


def test_the_papers_own_labels_equal_the_paper_and_do_not_better_it() -> None:
    rows = rows_of(*((None, None, m, None, a) for m, a in zip(*label_pairs(PAPER_CONFUSION), strict=True)))
    verdicts = against_paper(evaluate(rows))
    assert len(verdicts) == 27
    assert {name: value for name, value in verdicts.items() if name.startswith("state.")} == {
        name: "equal" for name in verdicts if name.startswith("state.")
    }
    assert {value for name, value in verdicts.items() if name.startswith("angle.")} == {None}


@pytest.mark.parametrize(
    ("kind", "better", "ours", "paper", "expected"),
    [
        (FigureFormat.COEFFICIENT, Better.LARGER, 0.8695, 0.869, Verdict.BETTER),
        (FigureFormat.COEFFICIENT, Better.LARGER, 0.8694, 0.869, Verdict.EQUAL),
        (FigureFormat.DEGREES, Better.NEARER_ZERO, -2.0, 2.25, Verdict.BETTER),
        (FigureFormat.DEGREES, Better.NEARER_ZERO, -9.0, -8.88, Verdict.WORSE),
        (FigureFormat.PERCENT, Better.LARGER, 0.7, 0.75, Verdict.WORSE),
        (FigureFormat.PERCENT, Better.NEITHER, 0.7, 0.75, None),
        (FigureFormat.PERCENT, Better.LARGER, None, 0.75, None),
    ],
)
def test_a_verdict_counts_the_digits_that_the_paper_prints(kind, better, ours, paper, expected) -> None:
    assert verdict(kind, better, ours, paper) is expected


def test_the_papers_shares_of_states() -> None:
    assert wanted_images(44) == {"B": 13, "C": 26, "D": 5}
    assert wanted_images() == {"B": 14, "C": 28, "D": 6}  # 14.18, 28.36 and 5.45: the largest remainder goes up


def test_images_are_drawn_by_seed_and_none_twice() -> None:
    states = {f"{place:03d}": "ABCD"[place % 4] for place in range(200)}
    chosen = choose_images(states, 1)
    assert chosen == choose_images(states, 1) == sorted(set(chosen))
    assert chosen != choose_images(states, 2)
    assert {label: sum(states[image] == label for image in chosen) for label in "ABCD"} == {"A": 0, "B": 14, "C": 28, "D": 6}


def test_two_manual_measures_have_the_asked_spread_and_stay_angles() -> None:
    truth = np.full(4000, 90.0)
    measured = np.array(measure_twice(truth, 1.5, 0))
    assert measured.std(ddof=1) == pytest.approx(1.5, rel=0.03)
    assert abs(np.corrcoef(measured.T)[0, 1]) < 0.05, "the two are independent"
    assert measure_twice([40.0], 0.0, 0) == [(40.0, 40.0)]
    edges = np.array(measure_twice([0.0, 180.0] * 200, 5.0, 0))
    assert edges.min() >= 0.0
    assert edges.max() <= 180.0
