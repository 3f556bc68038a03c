"""``soak``: hours of twin under random faults and operator input, watched on the wire."""

from __future__ import annotations

import json
import logging
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from app.learning_commands import Interrupt, progress_bar
from app.soak import Soak


def run_soak(hours: float, seed: int, out: Path | None, *, true_masks: bool, as_json: bool) -> int:
    """Soak; returns 0 when nothing unsafe was sent, no record was lost and nothing grew, else 1. Ctrl-C ends it early."""
    logging.disable(logging.CRITICAL)  # breakdowns are injected; what was not is in the summary
    soak = Soak(seed, true_masks=true_masks)
    seconds = 3600.0 * hours
    try:
        with Interrupt() as interrupt, progress_bar() as bar:
            task = bar.add_task("seconds", total=round(seconds))

            def go_on(now: Soak) -> bool:
                seen, sample = now.watch.seen, now.tally.samples[-1] if now.tally.samples else None
                memory = f"{sample.memory_mb:.0f} MB, {sample.threads} threads, {sample.files} files" if sample else "starting"
                text = f"s, {seen.goals} goals, {seen.unsafe} unsafe, {now.tally.lost} lost, {memory}"
                bar.update(task, completed=int(now.elapsed_s), description=text)
                return not interrupt.asked

            soak.run(seconds, go_on)
    finally:
        logging.disable(logging.NOTSET)
    summary = soak.summary()
    if out is not None:
        lines = [json.dumps(asdict(sample)) for sample in soak.tally.samples] + [json.dumps({"summary": summary})]
        out.write_text("\n".join(lines) + "\n", encoding="utf-8")
    sys.stdout.write((json.dumps(summary) if as_json else _text(summary)) + "\n")
    return 0 if summary["ok"] else 1


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
