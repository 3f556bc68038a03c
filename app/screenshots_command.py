"""``screenshots``: every picture of the documents, taken from the running program. No screen is needed."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from core.config import load_config
from core.errors import UserError

if TYPE_CHECKING:
    from app.screenshots.shots import Studio

NAMES = {
    "operator_window": "operator_pictures.advisory",
    "operator_driving": "operator_pictures.driving",
    "operator_arrived": "operator_pictures.arrived",
    "operator_stopped": "operator_pictures.stopped",
    "operator_no_answer": "operator_pictures.no_answer",
    "operator_keys": "operator_pictures.keys",
    "operator_tour": "operator_pictures.tour",
    "operator_light": "operator_pictures.small_and_light",
    "player": "other_pictures.player",
    "annotator": "other_pictures.annotator",
    "study_figures": "other_pictures.study_figures",
    "settings": "dialog_pictures.settings",
    "preflight": "dialog_pictures.preflight",
    "training": "dialog_pictures.training",
    "rig_wizard": "dialog_pictures.rig_wizard",
    "servo_table": "dialog_pictures.servo_table",
}
"""Name of the file, without its ending, and what makes it."""


def run_screenshots(out: Path, only: Sequence[str], config_path: Path | None) -> None:
    """Write the pictures to a folder. Raises UserError for unknown names, and when the folder cannot be written."""
    unknown = [name for name in only if name not in NAMES]
    if unknown:
        raise UserError(f"no picture is called {unknown[0]!r}; there are: {', '.join(NAMES)}")
    # The offscreen platform draws with the same fonts and at the same sizes on every machine; a screen of one's own does not.
    os.environ["QT_QPA_PLATFORM"] = "offscreen"
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{out}: cannot be made ({error.strerror})") from None
    folder = Path(tempfile.mkdtemp(prefix="lumenpilot_pictures_"))
    try:
        studio = _open_studio(out, folder, config_path)
        for name in only or NAMES:
            sys.stderr.write(f"{out / name}.png\n")
            _picture_of(name)(studio)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _open_studio(out: Path, folder: Path, config_path: Path | None) -> Studio:
    from app.application import make_application
    from app.screenshots.shots import Studio
    from core.perception.pipeline import open_pipeline

    places = {"record": {"folder": str(folder / "sessions")}, "window": {"pictures_folder": str(folder / "pictures")}}
    config = load_config(config_path, overrides={**places, "perception": {"segmentation": {"threads": 1}}})
    return Studio(make_application(), config, open_pipeline(config.perception), folder, out)


def _picture_of(name: str) -> Callable[[Studio], None]:
    from app.screenshots import dialog_pictures, operator_pictures, other_pictures

    modules = {
        "operator_pictures": operator_pictures,
        "other_pictures": other_pictures,
        "dialog_pictures": dialog_pictures,
    }
    module, _, function = NAMES[name].partition(".")
    make: Callable[[Studio], None] = getattr(modules[module], function)
    return make
