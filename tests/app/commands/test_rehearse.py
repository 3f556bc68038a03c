"""``rehearse``: what it writes, slower speeds, and too little time; the runs themselves are those of its own tests."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import app
from app.commands.rehearse import _print, _seen
from app.ui.i18n import FIXED
from core.config.models import Config, load_config
from core.config.rig_file import as_calibrated, find_rig, make_rig, with_rig, write_rig
from core.devices import UserError
from core.evaluation.rehearsal import RehearsalResult
from hardware.twin.rehearsal import WANDERS, RehearsalPicture, SeenHeads

TARGET = "430,400"
"""In the tree's lowest branch."""


SEEN = SeenHeads(np.arange(8.0).reshape(4, 2), np.array([(0.1, 0.0), (0.0, 0.1), (np.nan, np.nan), (0.0, 0.0)]), np.ones(4))


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.commands.rehearse._seen", lambda *_: SEEN)


def row(seed: int, *, reached: bool = True, force_n: float = 0.1) -> dict[str, Any]:
    track: dict[str, list[float | None]] = {
        "x_mm": [60.0, 80.0],
        "y_mm": [75.0, 75.0],
        "time_s": [1.0, 3.0],
        "wall_contact_n": [0.0, force_n],
    }
    track |= {key: [None, None] for key in ("offset_ratio", "theta_error_deg", "head_error_px")}
    about = {"seed": seed, "reached": reached, "outcome": "reached" if reached else "stuck", "time_s": 3.0, "interventions": 0}
    return about | {
        "wall_contact_n": {"max": force_n},
        "path_ratio": None,
        "answered_share": 1.0,
        "track": track,
        "state_shares": dict.fromkeys("ABCD", 0.25),
    }


@pytest.fixture
def rehearse(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[dict[str, Any]]]:
    config = tmp_path / "tree.toml"
    config.write_text('[twin]\nphantom = "tree"\n')

    def call(run: Callable[[float, int], dict[str, Any]], *options: str) -> list[dict[str, Any]]:
        def over(_workers: int, function: partial[Any], seeds: Sequence[int], _within_s: float) -> Iterator[dict[str, Any]]:
            yield from (run(function.args[0].speed, seed) for seed in seeds)

        monkeypatch.setattr("app.commands.rehearse.over_processes", over)
        result = CliRunner().invoke(app, ["rehearse", "--config", str(config), "--target", TARGET, *options])
        assert result.exit_code == 0, result.output
        return [json.loads(line) for line in result.stdout.splitlines() if line.startswith("{")]

    return call


def test_a_good_way_is_told_with_its_band(rehearse: Callable[..., list[dict[str, Any]]]) -> None:
    (told,) = rehearse(lambda _speed, seed: row(seed) | {"way_per_feed": 0.9 + 0.01 * seed}, "--json", "--runs", "20")
    found = RehearsalResult.model_validate(told)
    assert (found.runs, found.arrived.share, found.recommended_speed_mm_s) == (20, 1.0, told["speed_mm_s"])
    assert found.way.runs == (20, 20) and found.way.wall_force_n == (0.0, 0.1) and found.way.time_s[1] == (3.0, 3.0, 3.0)
    assert found.way_per_feed == pytest.approx((0.9095, 0.995, 1.0805))
    assert found.target_xy == pytest.approx((430, 400), abs=12) and found.size_px == (640, 480)
    assert found.based_on == {"pictures": 4, "missing": 0.25, "robot": "twin"}


def test_pictures_of_several_ways_are_perceived_by_the_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def over(workers: int, function: partial[Any], wanders: Sequence[float], within_s: float) -> Iterator[SeenHeads]:
        asked.extend((workers, function.args, tuple(wanders), within_s))
        yield from (SEEN for _ in wanders[: round(within_s)])

    monkeypatch.setattr("app.commands.rehearse.over_processes", over)
    config = Config.model_validate({"twin": {"phantom": "tree"}})
    picture = RehearsalPicture.of(config, (430.0, 400.0))
    seen = _seen(config, picture, 2, 60.0)
    assert seen is not None and asked == [2, (config, picture.target), WANDERS, 60.0]
    assert len(seen.heads_mm) == len(seen.confidence) == 4 * len(WANDERS) and seen.missing == 0.25
    part = _seen(config, picture, 2, 1.0)
    assert part is not None and len(part.heads_mm) == 4, "what was seen in this time"
    assert _seen(config, picture, 2, 0.0) is None


def test_no_picture_in_time_is_an_error_and_many_without_an_answer_are_told(
    rehearse: Callable[..., list[dict[str, Any]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.commands.rehearse._seen", lambda *_: None)
    result = CliRunner().invoke(app, ["rehearse", "--target", TARGET])
    assert isinstance(result.exception, UserError) and "give more --minutes" in str(result.exception)
    shown: list[str] = []
    monkeypatch.setattr("app.commands.rehearse.console.print", lambda *lines, **_: shown.extend(map(str, lines)))
    for missing in (2, 3):
        errors = np.array([(np.nan, np.nan)] * missing + [(0.0, 0.0)] * (4 - missing))
        monkeypatch.setattr("app.commands.rehearse._seen", lambda *_, _errors=errors: replace(SEEN, errors_mm=_errors))
        rehearse(lambda _speed, seed: row(seed), "--runs", "5")
    assert [line for line in shown if "no answer" in line] == [
        "75% of the pictures of the way give no answer: teach the bench (python main.py teach)"
    ]


def test_the_way_on_a_bench_is_perceived_with_the_bench(
    rehearse: Callable[..., list[dict[str, Any]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    at_bench = Config.model_validate({"twin": {"phantom": "tree"}, "perception": {"bench": "glass"}})
    perceived: list[Config] = []
    monkeypatch.setattr("hardware.twin.own_phantom.with_own_phantom", lambda config, _bench: config)
    monkeypatch.setattr("hardware.twin.own_phantom.with_own_perception", lambda _config, _bench: at_bench)
    monkeypatch.setattr("app.commands.rehearse._seen", lambda config, *_: perceived.append(config) or SEEN)
    rehearse(lambda _speed, seed: row(seed), "--bench", "glass", "--json", "--runs", "5")
    assert perceived == [at_bench]


def test_a_slower_speed_is_tried_and_given_up_early(rehearse: Callable[..., list[dict[str, Any]]]) -> None:
    asked: list[float] = []

    def run(speed: float, seed: int) -> dict[str, Any]:
        asked.append(speed)
        return row(seed, reached=speed == 0.5 or seed % 5 != 0)

    (told,) = rehearse(run, "--json", "--runs", "40")
    assert [(share, asked.count(share)) for share in (1.0, 0.7, 0.5)] == [(1.0, 40), (0.7, 11), (0.5, 40)]
    assert told["recommended_speed_mm_s"] == 0.5 * told["speed_mm_s"] and told["outcomes"] == {"reached": 32, "stuck": 8}


def test_a_short_time_gives_the_first_runs_and_no_advice(
    rehearse: Callable[..., list[dict[str, Any]]], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock = iter(range(0, 100_000, 4))
    monkeypatch.setattr("app.commands.rehearse.time", SimpleNamespace(monotonic=lambda: float(next(clock))))
    order = [0, 1, 3, 4, 2, *range(5, 50)]  # number 2 has not ended when the time is over
    (told,) = rehearse(lambda _speed, seed: row(order[seed]), "--json", "--minutes", "0.3")
    assert told["runs"] == 2 and told["recommended_speed_mm_s"] is None
    _print(told, 50)
    assert "too few runs ended to recommend a speed: give more --minutes" in capsys.readouterr().err


@pytest.mark.usefixtures("own_folder")
def test_tuned_settings_are_kept_where_they_are_better_and_it_was_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = tmp_path / "tree.toml"
    config.write_text('[twin]\nphantom = "tree"\n')
    path = write_rig(make_rig(load_config(), "bench 1", None))
    gain_of_best = 0.0

    def over(_workers: int, _function: object, tasks: Sequence[Any]) -> Iterator[tuple[int, dict[str, Any]]]:
        for number, tuned, seed in tasks:  # less gain is quicker
            told = row(seed) | {"time_s": 3.0 + max(tuned["gain"], gain_of_best) + 0.01 * (seed % 3)}
            yield number, told | {"wall_contact_n": {"p95": 0.1, "max": 0.1}}

    def tune(*options: str) -> str:
        arguments = ["rehearse", "--config", str(config), "--target", TARGET, "--runs", "8", *options]
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 0, result.output
        return result.stdout if "--json" in options else result.output

    monkeypatch.setattr("app.commands.rehearse.over_processes", over)
    assert "not kept" in tune("--tune") and find_rig("bench 1")[1].pursuit is None
    told = json.loads(tune("--tune", "--rig", "bench 1", "--json"))
    kept = find_rig("bench 1")[1].pursuit
    assert kept == told["found"] and kept["gain"] < 1.0 and told["kept"] == str(path)
    running = as_calibrated(with_rig(load_config(), find_rig("bench 1")[1], path))
    assert running.policy.pursuit.gain == kept["gain"]
    gain_of_best = 9.0  # all alike
    assert "the configured settings stay" in tune("--tune", "--rig", "bench 1")
    assert find_rig("bench 1")[1].pursuit == kept


def test_a_window_gives_configuration_and_picture_size_and_reads_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    def over(_workers: int, _function: object, seeds: Sequence[int], _within_s: float) -> Iterator[dict[str, Any]]:
        yield from (row(seed) for seed in seeds)

    monkeypatch.setattr("app.commands.rehearse.over_processes", over)
    monkeypatch.setattr("app.commands.rehearse._SHOWN_EVERY_S", 0.0)
    monkeypatch.setattr("app.commands.progress._writers", [])
    given = json.dumps(
        {"config": Config.model_validate({"twin": {"phantom": "tree"}}).model_dump(mode="json"), "size_px": [1280, 960]}
    )
    words = ["rehearse", "--given", "--target", "860,800", "--progress-json", "--runs", "5"]
    result = CliRunner().invoke(app, words, input=given)
    told = [json.loads(line) for line in result.stdout.splitlines()]
    assert any(line.get("done") == 5 for line in told) and told[0] == {"speed": 1.0}
    assert RehearsalResult.model_validate(told[2]["so_far"]).runs == 1
    found = RehearsalResult.model_validate(told[-1])
    assert found.size_px == (1280, 960) and found.target_xy == pytest.approx((860, 800), abs=24)
    monkeypatch.setattr("app.commands.rehearse.over_processes", lambda *_: (row(0) for _ in ()))
    result = CliRunner().invoke(app, words, input=given)
    assert isinstance(result.exception, UserError) and str(result.exception) in FIXED, "a toast of the window"
