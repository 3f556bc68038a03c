"""The ablation: its variants, figures with values counted by hand, and a run on a set."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from core.config.models import PoseConfig, load_config
from core.devices import UserError
from core.evaluation.accuracy import FrameScore
from core.types import Reason
from tools.ablation import (
    PAPER,
    STEPS,
    figures,
    make_variants,
    run_ablation,
)

LITERAL = load_config(preset="paper").perception
DEFAULTS = load_config().perception


# ---- variants ----


def test_the_rows_lead_from_the_papers_preset_to_ours() -> None:
    cumulative = make_variants(LITERAL, DEFAULTS)
    assert cumulative[0].name == PAPER
    literal = LITERAL.model_copy(update={"segmentation": DEFAULTS.segmentation})  # the same masks for all rows
    assert cumulative[0].config == literal, "every setting of the preset belongs to a step"
    assert cumulative[-1].config == DEFAULTS
    assert [variant.name for variant in cumulative[1:]] == [f"+ {step.name}" for step in STEPS]


def test_every_step_switches_something_and_nothing_else() -> None:
    variants = make_variants(LITERAL, DEFAULTS)
    for step, before, after in zip(STEPS, variants, variants[1:], strict=False):
        old = before.config.model_dump()
        changed = [
            (section, key)
            for section, values in after.config.model_dump().items()
            if isinstance(values, dict)
            for key, value in values.items()
            if value != old[section][key]
        ]
        assert changed, step.name
        assert all(f"{section}.{key}" in step.settings or section in step.settings for section, key in changed)


def test_a_difference_that_no_step_switches_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"no step of the ablation switches pose\.d_allow_px"):
        make_variants(DEFAULTS, DEFAULTS.model_copy(update={"pose": PoseConfig(d_allow_px=7.0)}))
    with pytest.raises(ValueError, match="no step of the ablation switches working_size_px"):
        make_variants(DEFAULTS, DEFAULTS.model_copy(update={"working_size_px": 320}))


# ---- figures ----


def test_of_too_few_phantoms_no_difference_has_an_interval() -> None:
    """Drawn one by one, twenty frames of two phantoms would make it too narrow."""
    rng = np.random.default_rng(4)
    rows = [[score(float(theta), stem=str(k)) for k, theta in enumerate(rng.normal(shift, 1.0, 20))] for shift in (3.0, 6.0)]
    few = figures(rows, [k // 10 for k in range(20)])[1]["theta_mean_deg"]
    enough = figures(rows, [k // 2 for k in range(20)])[1]["theta_mean_deg"]
    assert few.difference == enough.difference
    assert (few.low, few.high, few.is_clear) == (None, None, False)
    assert enough.is_clear


def score(theta: float | None, head: float = 1.0, state: str = "C", stem: str = "a") -> FrameScore:
    answered = theta is not None
    return FrameScore(
        stem=stem,
        vessel_dice=1.0,
        robot_dice=1.0,
        expected=True,
        answered=answered,
        reason=None if answered else Reason.LOW_CONFIDENCE,
        head_error_px=head if answered else None,
        theta_error_deg=theta,
        theta_deg=theta,
        true_theta_deg=0.0,
        state=state if answered else None,
        true_state="C",
        confidence=0.7 if answered else 0.0,
    )


def test_figures_by_hand() -> None:
    nobody = replace(score(None), expected=False, true_state=None)
    before = [score(1.0), score(-3.0, head=16.0), score(11.0, state="B"), score(2.0), nobody]
    after = [score(1.0), score(None), score(-5.0), score(2.0, head=3.0), nobody]
    first, second = figures([before, after], list("abcde"))
    assert {key: figure.value for key, figure in first.items()} == pytest.approx(
        {
            "theta_median_deg": 2.5,  # of 1, 2, 3 and 11: the size counts, not the sign
            "theta_mean_deg": 4.25,
            "theta_p95_deg": 3 + 0.85 * 8,
            "head_median_px": 1.0,
            "head_p95_px": 1 + 0.85 * 15,
            "state_agreement": 3 / 4,
            "answered_share": 1.0,
            "wrong_share": 2 / 4,  # one by its angle, one by its head
        }
    )
    assert first["theta_median_deg"].difference is None
    assert second["theta_median_deg"].value == 2.0
    assert second["theta_median_deg"].difference == -0.5
    assert second["theta_mean_deg"].value == pytest.approx(8 / 3), "of the three that were answered"
    assert second["answered_share"].value == 3 / 4, "the frame without a robot does not count"
    assert second["wrong_share"].difference == pytest.approx(-1 / 2)


def test_intervals_hold_the_difference_and_say_when_it_is_clear() -> None:
    rng = np.random.default_rng(0)
    worse = [score(float(value)) for value in rng.uniform(4, 8, 60)]
    better = [replace(one, theta_error_deg=(one.theta_error_deg or 0.0) - 2.0) for one in worse]
    table = figures([worse, better, better], list(range(60)))
    change = table[1]["theta_mean_deg"]
    assert (change.difference, change.low, change.high) == pytest.approx((-2.0, -2.0, -2.0))  # paired: each frame by as much
    assert change.is_clear
    median = table[1]["theta_median_deg"]
    assert median.low is not None
    assert median.high is not None
    assert median.difference is not None
    assert median.low <= median.difference <= median.high
    same = table[2]["theta_mean_deg"]
    assert (same.difference, same.low, same.high) == (0.0, 0.0, 0.0)
    assert not same.is_clear
    again = figures([worse, better, better], list(range(60)))
    assert again == table, "the same seed gives the same intervals"


# ---- a whole run ----


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from hardware.twin.dataset import SynthPlan, write_set

    out = tmp_path_factory.mktemp("synth") / "set"
    write_set(SynthPlan(out, 3, 77, (640, 480)))
    return out


@pytest.fixture(scope="module")
def done(frames: Path) -> dict[str, Any]:
    return run_ablation(frames, true_masks=True, out=frames.parent / "out")


def test_there_is_a_row_for_each_step(done: dict[str, Any], frames: Path) -> None:
    assert (done["frames"], done["masks"]) == (3, "true masks")
    assert [row["name"] for row in done["rows"]] == [PAPER, *(f"+ {step.name}" for step in STEPS[:-1])]
    by_name = {row["name"]: row for row in done["rows"]}
    extension = by_name["+ end extension"]["figures"]["head_median_px"]
    assert extension["difference"] < -1.0, "without it the head lies a radius too far back"
    assert extension["low"] is extension["high"] is None
    assert "too few for intervals" in done["drawn"]
    assert json.loads((frames.parent / "out" / "ablation.json").read_text()) == done
    table = [line for line in (frames.parent / "out" / "ablation.md").read_text().splitlines() if line.startswith("|")]
    assert len(table) == 2 + len(STEPS)
    assert len({line.count("|") for line in table}) == 1


def test_bad_input_is_one_clear_line(frames: Path, tmp_path: Path) -> None:
    poseless, file = tmp_path / "poseless", tmp_path / "file"
    shutil.copytree(frames, poseless)
    rows = [json.loads(line) | {"state": None} for line in (frames / "truth.jsonl").read_text().splitlines()]
    (poseless / "truth.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    file.write_text("")
    for folder, options, words in (
        (tmp_path / "missing", {}, "no labelled frames"),
        (poseless, {}, "no frame of truth.jsonl has a pose"),
        (frames, {"out": file}, "cannot be written"),
        (frames, {"model": str(tmp_path / "none")}, "none"),
    ):
        with pytest.raises(UserError) as failed:
            run_ablation(folder, **options)
        assert words in str(failed.value)
        assert "\n" not in str(failed.value)
