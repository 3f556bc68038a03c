"""``soak``: hours of twin under random faults and operator input, watched on the wire."""

from __future__ import annotations

import json
import logging
import sys
from dataclasses import asdict
from io import FileIO
from pathlib import Path
from typing import Any

from app.long_work import Interrupt, progress_bar
from app.soak import Soak
from app.soak_samples import Sample
from core.errors import UserError


def run_soak(hours: float, seed: int, out: Path | None, *, true_masks: bool, as_json: bool) -> int:
    """Soak; returns 0 when nothing unsafe was sent, no record was lost and nothing grew, else 1.

    Raises UserError, and KeyboardInterrupt once the figures so far are told.
    """
    seconds = 3600.0 * hours
    with _SampleFile(out) as file:
        summary = _soak(seconds, seed, file, true_masks=true_masks)
        # What cannot be told or written must not cost what hours have shown.
        try:
            sys.stdout.write((json.dumps(summary) if as_json else _text(summary)) + "\n")
            sys.stdout.flush()
        finally:
            file.add({"summary": summary})
    if summary["interrupted"]:
        raise KeyboardInterrupt
    if summary["ok"] and file.problem:
        raise UserError(f"{file.problem}; lines at its end are missing")
    return 0 if summary["ok"] else 1


def _soak(seconds: float, seed: int, file: _SampleFile, *, true_masks: bool) -> dict[str, Any]:
    """The summary, with ``interrupted`` in it."""
    logging.disable(logging.CRITICAL)  # breakdowns are injected; what was not is in the summary
    soak = Soak(seed, true_masks=true_masks)
    told = False
    try:
        with Interrupt() as interrupt, progress_bar() as bar:
            task = bar.add_task("seconds", total=round(seconds))

            def go_on(now: Soak) -> bool:
                nonlocal told
                seen, sample = now.watch.seen, now.tally.samples[-1] if now.tally.samples else None
                memory = f"{sample.memory_mb:.0f} MB, {sample.threads} threads, {sample.files} files" if sample else "starting"
                text = f"s, {seen.goals} goals, {seen.unsafe} unsafe, {now.tally.lost} lost, {memory}"
                bar.update(task, completed=int(now.elapsed_s), description=text)
                file.follow(now.tally.samples)
                if file.problem and not told:
                    told = True
                    bar.console.print(f"note: {file.problem}; the soak goes on, and tries again", soft_wrap=True)
                return not interrupt.asked

            soak.run(seconds, go_on)
            return soak.summary() | {"interrupted": interrupt.asked}
    finally:
        logging.disable(logging.NOTSET)


class _SampleFile:
    """Writes the samples as they come: a soak that breaks down after an hour has to tell what it saw until then.

    ``problem`` says why lines still wait to be written, a disk that is full for a while; "": none does.
    """

    def __init__(self, path: Path | None) -> None:
        self.problem = ""
        self._path = path
        self._file: FileIO | None = None
        self._written = 0
        self._waiting = b""
        if path is not None:
            try:
                self._file = path.open("wb", buffering=0)  # what was not written is known to the byte, and comes later
            except OSError as error:
                raise UserError(f"{self._said(error)}; choose another --out") from None

    def _said(self, error: OSError) -> str:
        return f"{self._path}: cannot be written ({error.strerror})"

    def __enter__(self) -> _SampleFile:
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()

    def follow(self, samples: list[Sample]) -> None:
        """Write those that are new."""
        for sample in samples[self._written :]:
            self.add(asdict(sample))
        self._written = len(samples)

    def add(self, record: dict[str, Any]) -> None:
        """Write one line, after those that wait; raises nothing."""
        if self._file is None:
            return
        self._waiting += json.dumps(record).encode() + b"\n"
        try:
            while self._waiting:
                self._waiting = self._waiting[self._file.write(self._waiting) :]
            self.problem = ""
        except OSError as error:
            self.problem = self._said(error)


def _text(summary: dict[str, Any]) -> str:
    flat, records = summary["flatness"], summary["records"]
    shares = ", ".join(f"{mode} {100 * share:.0f} %" for mode, share in summary["mode_shares"].items())
    steady = {True: "flat", False: "GROWS", None: "too short to tell"}[flat["flat"]]
    when = "until it was interrupted after" if summary["interrupted"] else "after"
    lines = [
        f"{'OK' if summary['ok'] else 'NOT OK'} {when} {summary['seconds']:.0f} s (seed {summary['seed']})",
        f"wire: {summary['packets']} packets, {summary['goals']} goals, {summary['unsafe']} unsafe",
        f"records: {records['rows']} rows in {records['sessions']} sessions, {records['lost']} lost",
        f"use: {steady}" + (f", from {flat['before']} to {flat['after']}" if flat["flat"] is not None else ""),
        f"modes: {shares}; {summary['rigs_opened']} rigs opened, {summary['breakdowns']} broke down",
        f"faults: {sum(summary['faults'].values())}; requests: {sum(summary['operator'].values())}",
    ]
    return "\n".join([*lines, *(f"problem: {text}" for text in (*summary["unsafe_texts"], *summary["problems"]))])
