"""Statistics of states: the paper's 44 label pairs, scikit-learn as the second opinion, and what is undefined."""

import numpy as np
import pytest
from sklearn.metrics import accuracy_score, cohen_kappa_score, f1_score, fowlkes_mallows_score

from core.evaluation.metrics import fowlkes_mallows_pairs, kappa, members, state_metrics, table_statistics
from core.evaluation.paper import PAPER, PAPER_CONFUSION, PAPER_LABELS


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


def test_the_accuracys_interval_is_wilsons() -> None:
    """39 of 44 are right. Of 44 equal ones all are: still not certain."""
    assert state_metrics(*label_pairs(PAPER_CONFUSION))["ci95"]["accuracy"] == pytest.approx([0.7602, 0.9505], abs=5e-5)
    assert state_metrics(["B", "C"] * 22, ["B", "C"] * 22)["ci95"]["accuracy"] == pytest.approx([0.9197, 1.0], abs=5e-5)
    assert state_metrics(["B"], ["B"])["ci95"]["accuracy"] is None


def test_the_two_fowlkes_mallows_indices_are_different_things() -> None:
    found = state_metrics(*label_pairs(PAPER_CONFUSION))
    per_class = [np.sqrt(12 / 14 * 12 / 13), np.sqrt(23 / 25 * 23 / 26), 4 / 5]
    assert found["fowlkes_mallows_macro"] == pytest.approx(np.mean(per_class))
    # pairs: 66 + 1 + 253 + 6 = 326 together in both, 413 manually, 401 by the algorithm
    assert found["fowlkes_mallows_pairs"] == pytest.approx(326 / np.sqrt(413 * 401))


def test_pair_counting_does_not_care_what_the_groups_are_called() -> None:
    assert fowlkes_mallows_pairs("BBCC", "CCBB") == pytest.approx(1.0)
    assert fowlkes_mallows_pairs("BC", "CC") is None, "no manual pair"


@pytest.mark.parametrize(("true", "found"), [("BBBB", "BBBB"), ("B", "B"), ("", "")])
def test_kappa_of_a_single_label_is_undefined(true: str, found: str) -> None:
    assert kappa(true, found) is None


def test_many_tables_at_once_agree_with_one_at_a_time() -> None:
    rng = np.random.default_rng(1)
    tables = rng.integers(0, 12, (20, 3, 3))
    many = table_statistics(tables)
    for place, table in enumerate(tables):
        manual, algorithm = label_pairs(table)
        assert many["accuracy"][place] == pytest.approx(accuracy_score(manual, algorithm))
        assert many["kappa"][place] == pytest.approx(cohen_kappa_score(manual, algorithm))
        assert many["fowlkes_mallows_pairs"][place] == pytest.approx(fowlkes_mallows_score(manual, algorithm))
        assert many["macro_f1"][place] == pytest.approx(f1_score(manual, algorithm, average="macro"))
        assert many["weighted_f1"][place] == pytest.approx(f1_score(manual, algorithm, average="weighted"))


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


def test_intervals_are_seeded_and_hold_the_value() -> None:
    labels = label_pairs(PAPER_CONFUSION)
    found = state_metrics(*labels, seed=1)
    assert found == state_metrics(*labels, seed=1)
    for name in ("accuracy", "kappa", "fowlkes_mallows_pairs", "fowlkes_mallows_macro"):
        low, high = found["ci95"][name]
        assert low < found[name] < high
