"""The folder of a campaign of trials: what was run with which settings, row by row as it is done."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from core.errors import UserError
from core.policy_config import PolicyName
from core.study.trial import Row, TrialLog, trial_row
from core.whole_file import write_whole
from hardware.twin.trial import TrialPlan

Job = tuple[PolicyName, int]
"""A policy and a seed."""
_KEYS = trial_row(TrialLog(), seed=0, policy="", phantom="", outcome="", way_mm=0.0, target_mm=(0.0, 0.0)).keys()
"""What every row has, whatever came of its trial."""


class TrialError(UserError):
    """The campaign cannot be run; the message is one line and says what to do."""


class KeptTrials:
    """The rows so far of these jobs, in ``trials.jsonl`` of the campaign's folder (if it has one)."""

    def __init__(self, out: Path | None, plan: TrialPlan, jobs: Iterable[Job]) -> None:
        self.rows: dict[Job, Row] = {}
        self._wanted = set(jobs)
        self._file: Path | None = None
        if out is not None:
            self._file = out / "trials.jsonl"
            self._open(out, plan)

    def add(self, row: Row) -> None:
        """Take in a row and write it at once. Raises TrialError."""
        self.rows[row["policy"], row["seed"]] = row
        if self._file is None:
            return
        try:
            with self._file.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(row, allow_nan=False) + "\n")
        except OSError as error:
            raise TrialError(f"{self._file}: cannot be written ({error.strerror}); free some space and go on") from None

    def _open(self, out: Path, plan: TrialPlan) -> None:
        described, path = _described(plan), out / "plan.json"
        try:
            out.mkdir(parents=True, exist_ok=True)
            if not path.is_file():
                write_whole(path, f"{json.dumps(described, indent=1)}\n".encode())
            elif json.loads(path.read_text(encoding="utf-8")) != described:
                raise TrialError(f"{out}: holds trials with other settings ({path.name}); choose another --out")
            self._read()
        except OSError as error:
            raise TrialError(f"{out}: cannot be used ({error.strerror}); choose another --out") from None
        except (ValueError, KeyError, TypeError, AttributeError):
            raise TrialError(f"{out}: plan.json or trials.jsonl is damaged; choose another --out") from None

    def _read(self) -> None:
        """Take over what is there; a last line that was cut off by a crash is dropped from the file."""
        assert self._file is not None
        if not self._file.is_file():
            return
        text = self._file.read_text(encoding="utf-8")
        if text and not text.endswith("\n"):
            text = text[: text.rfind("\n") + 1]
            write_whole(self._file, text.encode())
        for line in text.splitlines():
            row = json.loads(line)
            if not row.keys() >= _KEYS:
                raise KeyError
            if (row["policy"], row["seed"]) in self._wanted:
                self.rows[row["policy"], row["seed"]] = row


def _described(plan: TrialPlan) -> dict[str, Any]:
    """All that decides the result of a trial, apart from policy and seed."""
    settings = plan.config.model_dump(mode="json", exclude={"window", "rig", "servos"})
    settings["perception"]["segmentation"].pop("threads")
    settings["policy"].pop("name")
    settings["twin"].pop("phantom")
    settings["twin"].pop("appearance_seed")
    settings["twin"].pop("look")
    weights = None
    if not plan.true_masks:
        from core.learning.model_file import model_folder, read_model_info

        info = read_model_info(model_folder(plan.config.perception.segmentation.model), verify=())
        # What was measured of it decides nothing.
        weights = hashlib.sha256(info.model_dump_json(exclude={"figures"}).encode()).hexdigest()
    return {
        "true_masks": plan.true_masks,
        "max_seconds": plan.max_seconds,
        "look": plan.look,
        "model_sha256": weights,
        "config": settings,
    }
