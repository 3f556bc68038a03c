"""Statistics of angles and states against values worked out by hand or printed elsewhere."""

from typing import Any

import numpy as np
import pytest
from scipy.stats import spearmanr

from core.evaluation.metrics import (
    angle_metrics,
    are_too_few,
    icc_absolute,
    kappa,
    members,
    repeat_metrics,
    shares,
    state_metrics,
    wilson_95,
    within_subject,
)
from core.evaluation.paper import PAPER, PAPER_CONFUSION, PAPER_LABELS

MANUAL = np.array([10.0, 20.0, 30.0, 40.0])
ALGORITHM = np.array([11.0, 19.0, 33.0, 41.0])  # errors 1, -1, 3, 1


def test_bias_and_spread_by_hand() -> None:
    found = angle_metrics(MANUAL, ALGORITHM)
    sd = np.sqrt((0 + 4 + 4 + 0) / 3)
    assert found["n"] == 4
    assert found["mean_error_deg"] == pytest.approx(1.0)
    assert found["median_deg"] == pytest.approx(1.0)
    assert found["sd_deg"] == pytest.approx(sd)
    assert found["mean_abs_error_deg"] == pytest.approx(1.5)
    assert found["loa_low_deg"] == pytest.approx(1.0 - 1.96 * sd)
    assert found["loa_high_deg"] == pytest.approx(1.0 + 1.96 * sd)
    # deviations -15 -5 5 15 and -15 -7 7 15: 520 / sqrt(500 * 548)
    assert found["pearson"] == pytest.approx(520 / np.sqrt(500 * 548))
    assert found["spearman"] == pytest.approx(1.0)


def test_spearman_with_ties() -> None:
    first, second = np.array([1.0, 2.0, 2.0, 5.0, 9.0]), np.array([3.0, 1.0, 4.0, 4.0, 8.0])
    assert angle_metrics(first, second)["spearman"] == pytest.approx(spearmanr(first, second).statistic)


def test_shares_in_percent_of_180_degrees() -> None:
    """4 % are 7.2 degrees; an error on an edge belongs below it, in spite of rounding."""
    found = shares(np.array([0.0, -7.2, 47.2 - 40.0, 7.3, -14.4, 14.5, 25.0, 100.0]))
    assert {name: float(value) * 8 for name, value in found.items()} == {
        "share_0_4": 3, "share_4_8": 2, "share_8_12": 1, "share_12_16": 1, "share_over_16": 1, "share_0_8": 5,
    }  # fmt: skip


def test_icc_of_shrout_and_fleiss() -> None:
    """Their worked example of 1979: six targets, four judges; ICC(2,1) = .29."""
    ratings = [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]]
    assert icc_absolute(np.array(ratings, float)) == pytest.approx(0.2898, abs=5e-5)


def test_a_second_measure_that_is_always_larger_is_no_perfect_repeat() -> None:
    found = repeat_metrics(MANUAL, MANUAL + 4.0)
    assert found["repeatability_sd_deg"] == pytest.approx(4.0 / np.sqrt(2.0))


def test_the_spread_of_one_measure_over_raters_and_repeats_by_hand() -> None:
    """First image: ann 1 2 3 (squares 2, two degrees of freedom), bob 5 7 (2, one); second: ann 4 4 (0, one); third: none."""
    found = within_subject([[[1.0, 2.0, 3.0], [5.0, 7.0]], [[4.0, 4.0], [9.0]], [[1.0], [50.0]]])
    assert (found["n"], found["sd_deg"]) == (2, pytest.approx(np.sqrt((2 + 2 + 0) / (2 + 1 + 1))))
    assert within_subject([[[1.0], [2.0]]]) == within_subject([]) == {"n": 0, "sd_deg": None, "ci95": None}


@pytest.mark.parametrize(("first", "later"), [(1, 1), (3, 1), (3, 3), (4, 8)])
def test_of_means_over_raters_the_spread_of_one_measure_is_told(first: int, later: int) -> None:
    rng = np.random.default_rng(5)
    means = [rng.normal(40.0, 3.0, (4000, count)).mean(axis=1) for count in (first, later)]
    found = repeat_metrics(means[0], means[1], counts=np.tile([float(first), float(later)], (4000, 1)))
    assert found["repeatability_sd_deg"] == pytest.approx(3.0, rel=0.04)


@pytest.mark.parametrize("constant", [5.0, 0.1])
def test_constant_values_have_no_correlation(constant: float) -> None:
    found = angle_metrics(np.full(3, constant), np.array([1.0, 2.0, 3.0]))
    assert found["pearson"] is found["spearman"] is None
    assert found["ci95"]["pearson"] is None
    assert found["mean_error_deg"] == pytest.approx(2.0 - constant)
    assert angle_metrics(np.full(3, constant), np.full(3, constant))["icc"] is None


def test_one_value_has_an_error_but_no_spread() -> None:
    found = angle_metrics(MANUAL[:1], ALGORITHM[:1])
    assert (found["n"], found["mean_error_deg"], found["share_0_4"]) == (1, 1.0, 1.0)
    assert found["sd_deg"] is found["loa_low_deg"] is found["pearson"] is found["icc"] is None
    assert set(found["ci95"].values()) == {None}


def test_no_value_has_nothing_but_all_names() -> None:
    nothing = angle_metrics(MANUAL[:0], ALGORITHM[:0])
    assert nothing.keys() == angle_metrics(MANUAL, ALGORITHM).keys()
    assert {value for name, value in nothing.items() if name not in {"n", "ci95"}} == {None}


def test_rows_come_in_groups_wherever_these_are_known() -> None:
    few = members([f"s{k // 5}" for k in range(45)])
    assert (are_too_few(few), len(set(few.tolist()))) == (True, 9)
    assert are_too_few(members(["a"] * 40))
    assert are_too_few(members([f"s{k}" for k in range(9)])), "nine images of nine phantoms are nine groups, too"
    assert members([f"s{k}" for k in range(45)]) is None, "every row a group of its own: the same as one by one"
    assert members([None] * 5) is None
    assert not are_too_few(None)
    found = members([*(f"s{k // 2}" for k in range(18)), None, None])
    assert found.tolist() == [*(k // 2 for k in range(18)), 9, 10], "rows without a group stand alone"


def test_of_too_few_groups_there_is_no_interval_rather_than_a_narrow_one() -> None:
    """Nine phantoms of twenty images each: taken for 180 images they would seem far surer than nine phantoms can be."""
    rng = np.random.default_rng(2)
    manual = rng.uniform(20.0, 160.0, 180)
    nine, ten = (members([f"phantom {k % count}" for k in range(180)]) for count in (9, 10))
    found = angle_metrics(manual, manual + rng.normal(0.0, 5.0, 180), group=nine)
    assert found["mean_error_deg"] is not None
    assert set(found["ci95"].values()) == {None}
    assert set(repeat_metrics(manual, manual + 1.0, group=nine)["ci95"].values()) == {None}
    assert angle_metrics(manual, manual + 1.0, group=ten)["ci95"]["mean_error_deg"] is not None


def test_copies_of_an_image_make_no_interval_narrower() -> None:
    """Each of 20 images 16 times: drawn one by one their mean would seem four times as certain as it is."""
    rng = np.random.default_rng(5)
    errors = rng.normal(0.0, 5.0, 20)
    manual = rng.uniform(20.0, 160.0, 20)
    group = members([place for place in range(20) for _ in range(16)])
    once = angle_metrics(manual, manual + errors)
    alone = angle_metrics(np.repeat(manual, 16), np.repeat(manual + errors, 16))
    whole = angle_metrics(np.repeat(manual, 16), np.repeat(manual + errors, 16), group=group)

    def width(metrics: dict[str, Any]) -> float:
        low, high = metrics["ci95"]["mean_error_deg"]
        return float(high - low)

    assert width(alone) == pytest.approx(width(once) / 4, rel=0.2)
    assert width(whole) == pytest.approx(width(once), rel=0.1)
    assert whole["mean_error_deg"] == pytest.approx(once["mean_error_deg"])


@pytest.mark.parametrize(
    ("share", "n", "low", "high"),
    # 10 of 10: 1 / (1 + z²/10); none of 10 the other way round; 1 of 29 and 81 of 263 as Newcombe prints them (1998, table I)
    [(1.0, 10, 0.7225, 1.0), (0.0, 10, 0.0, 0.2775), (1 / 29, 29, 0.0061, 0.1718), (81 / 263, 263, 0.2553, 0.3662)],
)
def test_wilsons_interval(share: float, n: int, low: float, high: float) -> None:
    assert wilson_95(share, n) == pytest.approx([low, high], abs=5e-5)


def test_intervals_are_seeded_and_hold_the_value() -> None:
    rng = np.random.default_rng(5)
    manual = rng.uniform(0, 60, 200)
    algorithm = manual + rng.normal(1.0, 4.0, 200)
    found = angle_metrics(manual, algorithm, seed=3)
    assert found == angle_metrics(manual, algorithm, seed=3)
    assert found["ci95"] != angle_metrics(manual, algorithm, seed=4)["ci95"]
    low, high = found["ci95"]["mean_error_deg"]
    assert low < found["mean_error_deg"] < high
    # mean +- 1.96 SD / sqrt(n), which the bootstrap of a mean must come near
    assert high - low == pytest.approx(2 * 1.96 * found["sd_deg"] / np.sqrt(200), rel=0.1)


# states: the paper's 44 label pairs, and what is undefined


def label_pairs(confusion: object, labels: tuple[str, ...] = PAPER_LABELS) -> tuple[list[str], list[str]]:
    """Manual and algorithmic labels that give a confusion table."""
    table = np.array(confusion)
    pairs = [(labels[i], labels[j]) for i, j in np.ndindex(*table.shape) for _ in range(table[i, j])]
    return [manual for manual, _ in pairs], [algorithm for _, algorithm in pairs]


def test_frames_of_one_phantom_are_drawn_together() -> None:
    """Twelve phantoms of thirty frames each, all right or all wrong: as certain as twelve frames, not as 360."""
    right = [True] * 8 + [False] * 4
    manual = ["B"] * 360
    algorithm = ["B" if right[place // 30] else "C" for place in range(360)]
    group = members([place // 30 for place in range(360)])
    alone, whole = state_metrics(manual, algorithm), state_metrics(manual, algorithm, group=group)
    once = state_metrics(manual[::30], algorithm[::30])
    assert whole["accuracy"] == alone["accuracy"] == pytest.approx(8 / 12)
    assert whole["ci95"]["accuracy"] == pytest.approx(once["ci95"]["accuracy"], abs=0.09)
    assert alone["ci95"]["accuracy"][1] - alone["ci95"]["accuracy"][0] < 0.11
    assert whole["ci95"]["accuracy"][1] - whole["ci95"]["accuracy"][0] > 0.4


def test_the_papers_labels_give_the_papers_figures_digit_for_digit() -> None:
    found = state_metrics(*label_pairs(PAPER_CONFUSION))
    assert (found["n"], found["labels"]) == (44, ["B", "C", "D"])
    assert found["confusion"] == [[12, 1, 0], [2, 23, 1], [0, 1, 4]]
    assert f"{100 * found['accuracy']:.1f}" == "88.6"
    assert f"{found['kappa']:.3f}" == "0.796"
    assert f"{found['fowlkes_mallows_pairs']:.3f}" == "0.801"
    rows = {label: found["per_class"][label] for label in "BCD"} | {average: found[average] for average in ("macro", "weighted")}
    texts = {name: " ".join(f"{row[score]:.2f}" for score in ("precision", "recall", "f1")) for name, row in rows.items()}
    assert texts == {
        "B": "0.86 0.92 0.89",
        "C": "0.92 0.88 0.90",
        "D": "0.80 0.80 0.80",
        "macro": "0.86 0.87 0.86",
        "weighted": "0.89 0.89 0.89",
    }
    papers = PAPER["state"]["per_class"] | {average: PAPER["state"][average] for average in ("macro", "weighted")}
    assert {name: {score: round(rows[name][score], 2) for score in row} for name, row in papers.items()} == papers


def test_the_two_fowlkes_mallows_indices_are_different_things() -> None:
    found = state_metrics(*label_pairs(PAPER_CONFUSION))
    per_class = [np.sqrt(12 / 14 * 12 / 13), np.sqrt(23 / 25 * 23 / 26), 4 / 5]
    assert found["fowlkes_mallows_macro"] == pytest.approx(np.mean(per_class))
    # pairs: 66 + 1 + 253 + 6 = 326 together in both, 413 manually, 401 by the algorithm
    assert found["fowlkes_mallows_pairs"] == pytest.approx(326 / np.sqrt(413 * 401))


@pytest.mark.parametrize(("true", "found"), [("BBBB", "BBBB"), ("B", "B"), ("", "")])
def test_kappa_of_a_single_label_is_undefined(true: str, found: str) -> None:
    assert kappa(true, found) is None


def test_a_state_that_one_side_never_gives() -> None:
    found = state_metrics(list("BBC"), list("BBB"))
    assert found["per_class"]["C"] == {"precision": None, "recall": 0.0, "f1": 0.0, "fowlkes_mallows": None, "n": 1}
    assert found["macro"]["precision"] == pytest.approx((2 / 3 + 0) / 2)
    assert found["weighted"]["precision"] == pytest.approx((2 * 2 / 3 + 1 * 0) / 3)
    assert found["fowlkes_mallows_macro"] == pytest.approx((np.sqrt(2 / 3) + 0) / 2)
    assert found["macro"]["recall"] == pytest.approx(1 / 2)
    found = state_metrics(list("BB"), list("BA"))
    assert found["per_class"]["A"]["recall"] is None
    assert found["macro"]["recall"] == pytest.approx(1 / 2), "of B alone"
    assert found["fowlkes_mallows_macro"] == pytest.approx((np.sqrt(1 / 2) + 0) / 2)
    assert found["labels"] == ["A", "B"]


def test_to_find_a_part_of_a_state_is_better_than_to_find_none_of_it() -> None:
    none, one = ([[13, 0, 0], [0, 26, 0], [0, 5 - found, found]] for found in (0, 1))
    worse, better = state_metrics(*label_pairs(none)), state_metrics(*label_pairs(one))
    assert worse["fowlkes_mallows_macro"] == pytest.approx((1 + np.sqrt(26 / 31) + 0) / 3)
    assert better["fowlkes_mallows_macro"] == pytest.approx((1 + np.sqrt(26 / 30) + np.sqrt(1 / 5)) / 3)
    assert better["macro"]["precision"] > worse["macro"]["precision"]
    low, high = worse["ci95"]["fowlkes_mallows_macro"]
    assert low < worse["fowlkes_mallows_macro"] < high
    assert high < 0.75, "no class is as good as left out"


@pytest.mark.parametrize(("manual", "algorithm"), [("B", "B"), ("B", "C"), ("BB", "BB"), ("BC", "CB"), ("BBC", "DDA"), ("", "")])
def test_small_and_odd_sets_give_null_and_no_warning(manual: str, algorithm: str) -> None:
    found = state_metrics(list(manual), list(algorithm))
    assert found["n"] == len(manual)
    assert found["accuracy"] == (np.mean([a == b for a, b in zip(manual, algorithm, strict=True)]) if manual else None)
    values = [value for value in found["ci95"].values() if value is not None]
    assert all(np.isfinite(value).all() for value in values)
