"""``average``: one model of several that were trained from each other."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from core.devices import UserError


def run_average(models: Sequence[str], out: Path) -> None:
    """Write the mean of the models named to the folder `out`, and say what it lacks; raises UserError."""
    from core.learning.averaging import average_models
    from core.learning.model_writer import check_can_write, check_outside
    from core.perception.model_file import INFO, model_folder

    if len(models) < 2:
        raise UserError("name two models at least: main.py average MODEL MODEL --out DIR")
    folders = [model_folder(name) for name in models]
    if len({folder.resolve() for folder in folders}) == 1:
        raise UserError(f"{models[0]} is its own mean; name another model beside it")
    out = Path(os.path.realpath(out))  # the whole of it: a bare name may be that of another model
    check_outside(out, folders)
    if (out / INFO).is_file():
        raise UserError(f"{out}: is a model already; choose another --out")
    check_can_write(out)  # said before anything is read
    average_models(folders, out)
    sys.stderr.write(
        f"the mean of {', '.join(models)} written to {out}\n"
        "make its eight-bit copies and teach it what its confidence means: "
        f"main.py calibrate SET --eight-bit --model {shlex.quote(str(out))}\n"
    )
