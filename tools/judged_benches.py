"""Labelled sets from benches with a ``truth.json``, for ``benchmark --accuracy``: ``python -m tools.judged_benches BENCHES OUT``.

A bench is a folder with pictures, masks and ``truth.json``, whose frames have a ``use``: ``judge`` and ``empty`` go into the set
``OUT/NAME``; the empty pictures and the vessel's mask make the bench in ``OUT/NAME/bench``. Frames to teach with are left out.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Annotated, Any

import typer

from core.devices import UserError
from core.files import read_image
from tools.run import run_tool

_POSE = ("theta_deg", "theta_signed_deg", "state", "head_xy", "alternatives")


def judged_benches(
    benches: Annotated[Path, typer.Argument(help="folder of benches")],
    out: Annotated[Path, typer.Argument(help="folder for the sets; must not be there yet")],
) -> None:
    """Write a labelled set with its bench for every bench in a folder."""
    from core.bench.bench import bench_from_pictures, write_bench
    from core.learning.dataset import WORKING_SIZE_PX, read_mask

    found = sorted(path.parent for path in benches.glob("*/truth.json"))
    if not found:
        raise UserError(f"{benches}: no bench there; each is a folder with truth.json")
    if out.exists():
        raise UserError(f"{out}: is there already; choose another folder")
    for bench in found:
        frames: list[dict[str, Any]] = json.loads((bench / "truth.json").read_text(encoding="utf-8"))["frames"]
        target = out / bench.name
        for folder in ("images", "masks"):
            (target / folder).mkdir(parents=True)
        rows = []
        for frame in frames:
            if frame["use"] == "teach":
                continue
            image = bench / frame["image"]
            shutil.copyfile(image, target / "images" / image.name)
            for part in ("vessel", "robot"):
                shutil.copyfile(bench / frame[f"{part}_mask"], target / "masks" / f"{frame['stem']}_{part}.png")
            pose = {key: frame[key] for key in _POSE if key in frame}
            rows.append({"stem": frame["stem"], "family": bench.name, "state": None, "theta_deg": None} | pose)
        (target / "truth.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
        empty = [read_image(bench / frame["image"]) for frame in frames if frame["use"] == "empty"]
        vessel = read_mask(bench / frames[0]["vessel_mask"])
        write_bench(bench_from_pictures(empty, vessel, bench.name, WORKING_SIZE_PX), target / "bench")
        typer.echo(f"{target}: {len(rows)} frames")


if __name__ == "__main__":
    run_tool(judged_benches)
