"""``soak``: hours of twin under random faults and operator input, watched on the wire."""

from __future__ import annotations

import json
import logging
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from app.learning_commands import Interrupt, progress_bar
from app.soak import Soak
from app.soak_samples import Sample
from core.errors import UserError


def run_soak(hours: float, seed: int, out: Path | None, *, true_masks: bool, as_json: bool) -> int:
    """Soak; returns 0 when nothing unsafe was sent, no record was lost and nothing grew, else 1. Ctrl-C ends it early."""
    logging.disable(logging.CRITICAL)  # breakdowns are injected; what was not is in the summary
    soak = Soak(seed, true_masks=true_masks)
    seconds = 3600.0 * hours
    try:
        with _SampleFile(out) as file, Interrupt() as interrupt, progress_bar() as bar:
            task = bar.add_task("seconds", total=round(seconds))

            def go_on(now: Soak) -> bool:
                seen, sample = now.watch.seen, now.tally.samples[-1] if now.tally.samples else None
                memory = f"{sample.memory_mb:.0f} MB, {sample.threads} threads, {sample.files} files" if sample else "starting"
                text = f"s, {seen.goals} goals, {seen.unsafe} unsafe, {now.tally.lost} lost, {memory}"
                bar.update(task, completed=int(now.elapsed_s), description=text)
                file.follow(now.tally.samples)
                return not interrupt.asked

            soak.run(seconds, go_on)
    finally:
        logging.disable(logging.NOTSET)
    summary = soak.summary()
    if out is not None:
        with out.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps({"summary": summary}) + "\n")
    sys.stdout.write((json.dumps(summary) if as_json else _text(summary)) + "\n")
    return 0 if summary["ok"] else 1


class _SampleFile:
    """Writes the samples as they come: a soak that breaks down after an hour has to tell what it saw until then."""

    def __init__(self, path: Path | None) -> None:
        self._file: TextIO | None = None
        self._written = 0
        if path is not None:
            try:
                self._file = path.open("w", encoding="utf-8", buffering=1)
            except OSError as error:
                raise UserError(f"{path}: cannot be written ({error.strerror}); choose another --out") from None

    def __enter__(self) -> _SampleFile:
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()

    def follow(self, samples: list[Sample]) -> None:
        """Write those that are new."""
        if self._file is not None:
            for sample in samples[self._written :]:
                self._file.write(json.dumps(asdict(sample)) + "\n")
            self._written = len(samples)


def _text(summary: dict[str, Any]) -> str:
    flat, records = summary["flatness"], summary["records"]
    shares = ", ".join(f"{mode} {100 * share:.0f} %" for mode, share in summary["mode_shares"].items())
    steady = {True: "flat", False: "GROWS", None: "too short to tell"}[flat["flat"]]
    lines = [
        f"{'OK' if summary['ok'] else 'NOT OK'} after {summary['seconds']:.0f} s (seed {summary['seed']})",
        f"wire: {summary['packets']} packets, {summary['goals']} goals, {summary['unsafe']} unsafe",
        f"records: {records['rows']} rows in {records['sessions']} sessions, {records['lost']} lost",
        f"use: {steady}, from {flat['before']} to {flat['after']}",
        f"modes: {shares}; {summary['rigs_opened']} rigs opened, {summary['breakdowns']} broke down",
        f"faults: {sum(summary['faults'].values())}; requests: {sum(summary['operator'].values())}",
    ]
    return "\n".join([*lines, *(f"problem: {text}" for text in (*summary["unsafe_texts"], *summary["problems"]))])
