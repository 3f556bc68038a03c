"""Statistics of angles against values worked out by hand or printed elsewhere."""

from typing import Any

import numpy as np
import pytest
from scipy.stats import spearmanr

from core.evaluation.metrics import (
    angle_metrics,
    are_too_few,
    bootstrap_rows,
    correlation,
    icc_absolute,
    interval_95,
    members,
    repeat_metrics,
    shares,
    wilson_95,
    within_subject,
)

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


def test_the_median_is_signed_like_the_papers() -> None:
    assert angle_metrics(np.zeros(3), np.array([-5.0, -1.0, 4.0]))["median_deg"] == -1.0


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


def test_icc_counts_a_bias_that_correlation_does_not_see() -> None:
    """Second rater 10 higher: mean squares of subjects 200, of raters 150, residual 0."""
    first = np.array([0.0, 10.0, 20.0])
    assert correlation(first, first + 10) == pytest.approx(1.0)
    assert icc_absolute(np.stack([first, first + 10], -1)) == pytest.approx(200 / (200 + 2 * 150 / 3))
    assert icc_absolute(np.stack([first, first], -1)) == pytest.approx(1.0)


def test_two_manual_measures() -> None:
    """Variances within the images: half the squared differences, 1/2, 1/2 and 8; their mean is 3."""
    found = repeat_metrics(np.array([10.0, 20.0, 30.0]), np.array([11.0, 21.0, 34.0]))
    assert found["mean_difference_deg"] == pytest.approx(2.0)
    assert found["repeatability_sd_deg"] == pytest.approx(np.sqrt(3.0))


def test_a_second_measure_that_is_always_larger_is_no_perfect_repeat() -> None:
    found = repeat_metrics(MANUAL, MANUAL + 4.0)
    assert found["repeatability_sd_deg"] == pytest.approx(4.0 / np.sqrt(2.0))


def test_the_spread_of_one_measure_over_raters_and_repeats_by_hand() -> None:
    """First image: ann 1 2 3 (squares 2, two degrees of freedom), bob 5 7 (2, one); second: ann 4 4 (0, one); third: nobody."""
    found = within_subject([[[1.0, 2.0, 3.0], [5.0, 7.0]], [[4.0, 4.0], [9.0]], [[1.0], [50.0]]])
    assert (found["n"], found["sd_deg"]) == (2, pytest.approx(np.sqrt((2 + 2 + 0) / (2 + 1 + 1))))
    assert within_subject([[[1.0], [2.0]]]) == within_subject([]) == {"n": 0, "sd_deg": None, "ci95": None}


def test_of_one_rater_with_two_repeats_both_ways_give_one_figure() -> None:
    rng = np.random.default_rng(2)
    first = rng.uniform(0.0, 60.0, 48)
    second = first + rng.normal(0.5, 2.0, 48)
    pairs, all_repeats = repeat_metrics(first, second), within_subject([[[a, b]] for a, b in zip(first, second, strict=True)])
    assert all_repeats["sd_deg"] == pytest.approx(pairs["repeatability_sd_deg"])
    assert all_repeats["ci95"] == pytest.approx(pairs["ci95"]["repeatability_sd_deg"])


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
    assert few is not None, "nine groups: too few for an interval, and no reason to take their images for independent"
    assert (are_too_few(few), len(set(few.tolist()))) == (True, 9)
    assert are_too_few(members(["a"] * 40))
    assert are_too_few(members([f"s{k}" for k in range(9)])), "nine images of nine phantoms are nine groups, too"
    assert members([f"s{k}" for k in range(45)]) is None, "every row a group of its own: the same as one by one"
    assert members([None] * 5) is None
    assert not are_too_few(None)
    found = members([*(f"s{k // 2}" for k in range(18)), None, None])
    assert found is not None
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
    assert group is not None
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


def test_ten_of_ten_are_not_certain() -> None:
    """The bootstrap draws nothing but hits then, and its interval would be from all to all."""
    manual = np.linspace(10.0, 100.0, 20)
    alone = angle_metrics(manual, manual + 1.0)
    assert (alone["share_0_4"], alone["ci95"]["share_0_4"]) == (1.0, pytest.approx([0.8389, 1.0], abs=5e-5))
    assert alone["ci95"]["share_over_16"] == pytest.approx([0.0, 0.1611], abs=5e-5)
    grouped = angle_metrics(manual, manual + 1.0, group=members([k // 2 for k in range(20)]))
    assert grouped["ci95"]["share_0_4"] == pytest.approx([0.7225, 1.0], abs=5e-5), "of ten groups, not of twenty images"
    mixed = angle_metrics(manual, manual + np.where(np.arange(20) < 6, 10.0, 1.0), group=members([k // 2 for k in range(20)]))
    assert mixed["ci95"]["share_0_4"] == pytest.approx([0.4, 1.0], abs=0.1), "whole groups were drawn"
    assert angle_metrics(manual, manual + 1.0, group=members([k // 4 for k in range(20)]))["ci95"]["share_0_4"] is None


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


def test_an_interval_is_the_middle_95_percent() -> None:
    assert interval_95(np.arange(1001.0)) == [25.0, 975.0]
    assert interval_95(np.array([1.0] * 8 + [np.nan] * 2)) is None, "undefined in a fifth of the resamples"


def test_large_sets_are_drawn_in_blocks() -> None:
    seen: list[int] = []

    def mean(values: np.ndarray) -> dict[str, np.ndarray]:
        seen.append(values.size)
        return {"mean": values.mean(-1)}

    assert bootstrap_rows(mean, (np.arange(5000.0),), seed=0)["mean"] is not None
    assert max(seen) <= 500_000
    assert sum(seen) == 2000 * 5000
