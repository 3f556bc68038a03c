"""Benches with a truth.json become labelled sets with their bench."""

import json
from pathlib import Path

import numpy as np
import pytest

from core.bench.bench import read_bench
from core.devices import UserError
from core.learning.dataset import find_labelled, write_mask, write_png
from tools.judged_benches import judged_benches


def _bench(folder: Path) -> None:
    rng = np.random.default_rng(4)
    image = np.kron(rng.integers(60, 200, (12, 16, 3)), np.ones((10, 10, 1))).astype(np.uint8)
    vessel = np.zeros((120, 160), bool)
    vessel[50:70] = True
    robot = np.zeros_like(vessel)
    robot[58:62, :90] = True
    frames = []
    for place, use in enumerate(("teach", "judge", "empty")):
        stem = f"f{place}"
        for name, mask in (("vessel", vessel), ("robot", robot & (use != "empty"))):
            (folder / "masks").mkdir(parents=True, exist_ok=True)
            write_mask(folder / "masks" / f"{stem}_{name}.png", mask)
        (folder / "frames").mkdir(exist_ok=True)
        write_png(folder / "frames" / f"{stem}.png", image)
        pose = {} if use == "empty" else {"theta_deg": 3.0, "theta_signed_deg": -3.0, "state": "A", "head_xy": [90.0, 60.0]}
        masks = {"vessel_mask": f"masks/{stem}_vessel.png", "robot_mask": f"masks/{stem}_robot.png"}
        frames.append({"stem": stem, "image": f"frames/{stem}.png", "use": use} | masks | pose)
    (folder / "truth.json").write_text(json.dumps({"frames": frames}))


def test_judged_and_empty_frames_make_a_set_with_its_bench(tmp_path: Path) -> None:
    _bench(tmp_path / "benches" / "wood")
    judged_benches(tmp_path / "benches", tmp_path / "sets")
    samples, truth = find_labelled(tmp_path / "sets" / "wood")
    assert [sample.stem for sample in samples] == ["f1", "f2"]
    assert (truth["f1"]["state"], truth["f2"]["state"]) == ("A", None)
    bench = read_bench(tmp_path / "sets" / "wood" / "bench")
    assert bench.vessel.any()
    with pytest.raises(UserError, match="is there already"):
        judged_benches(tmp_path / "benches", tmp_path / "sets")
    with pytest.raises(UserError, match="no bench there"):
        judged_benches(tmp_path / "sets", tmp_path / "other")
