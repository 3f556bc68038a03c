"""How a network that learns does on frames that it does not learn from."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.progress_lines import Teller


class HeldOutWatch:
    """Looks now and then how the network does on the frames that it does not learn from; without any it does nothing."""

    def __init__(self, folder: Path | None, out: Path, teller: Teller | None, log: Callable[[str], object]) -> None:
        from core.learning.dataset import find_samples

        self._samples = find_samples([folder]) if folder is not None else []
        self._name = folder.name if folder is not None else ""
        self._pictures = out.with_name(out.name + "_pictures")
        self._teller, self._log = teller, log
        self.figures: dict[str, Any] = {}
        """For the model's manifest: what is known now, and what was before."""

    @property
    def is_on(self) -> bool:
        """Whether there are such frames."""
        return bool(self._samples)

    def look(self, network: Any, step: int) -> None:
        """Measure, write pictures, tell."""
        if not self._samples:
            return
        from app.training_pictures import write_pictures
        from core.learning.held_out import measure_held_out

        seen = measure_held_out(network, self._samples)
        now = {"vessel_dice": round(seen.vessel_dice, 4), "robot_dice": round(seen.robot_dice, 4)}
        before = self.figures.get("before", now)
        self.figures = {"set": self._name, "held_out": True, "frames": len(self._samples)} | now | {"before": before}
        self._log(f"{time.strftime('%H:%M:%S')} step {step} held out {now}\n")
        try:
            pictures = write_pictures(seen, self._pictures, "after" if step else "before")
        except OSError as error:
            pictures = []
            self._log(f"the pictures cannot be written ({error.strerror})\n")
        if self._teller is not None:
            self._teller.tell({"held_out_step": step, "pictures": pictures} | now)
