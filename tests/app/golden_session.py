"""Makes the golden session that guards against regressions: ``python -m tests.app.golden_session`` rewrites it.

Twenty frames of the twin, a third of a second apart, of a robot that wanders towards the operator's target. The rows tell what
perception says of the pictures as they come out of the video, so that a replay must say the same. Made again only when perception
is meant to have changed.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

from core.config.models import PerceptionConfig, TwinConfig, load_config
from core.perception.pipeline import open_pipeline
from core.session.codec import row_of
from core.session.files import sealed
from core.session.manifest import FRAMES, about_rig, event_of_target
from core.session.reader import SessionReader
from core.session.writer import SessionWriter
from core.types import Frame, Point, Reason, Refusal, Scene, Tick
from hardware.twin.truth import RouteFollower
from hardware.twin.world import TwinWorld

GOLDEN = Path(__file__).resolve().parents[1] / "data" / "golden_session"
TRUTH = "truth.json"
TOLD = ("theta_signed_deg", "head_xy", "state")
COUNT, EVERY = 20, 10
_PHANTOM, _START_MM, _FEED_MM_S, _WANDER, _BACK = "tree", 55.0, 9.0, 0.9, 12


def make(folder: Path) -> None:
    """Writes ``folder``; one that is there is replaced."""
    config = load_config(overrides={"perception": {"segmentation": {"threads": 1, "device": "openvino"}}})
    settings = config.record.model_copy(update={"ring_s": 0.0, "masks": False, "max_queue": 1000, "sync_s": 0.0})
    world = TwinWorld(TwinConfig(phantom=_PHANTOM), perception=config.perception, seed=1)
    follower = max(
        (RouteFollower(world.phantom, node, wander=_WANDER, seed=1) for node in world.phantom.targets),
        key=lambda way: way.length_mm,
    )
    x, y = world.view.project(follower.route)[-_BACK].tolist()
    world.insert(_START_MM)
    writer = SessionWriter(settings, about_rig(config, "SIM", "twin"), folder=folder.parent)
    writer.start()
    truth = []
    period_s = 1.0 / world.config.frames_per_second
    for turn in range(COUNT * EVERY):
        world.send(follower.command(world.physics.robot_points_mm(), _FEED_MM_S, period_s))
        world.advance(period_s)
        if turn % EVERY == 0:
            frame = world.frame()
            if turn == 0:
                writer.add_event(event_of_target((x, y), frame.captured_s))
            truth.append(world.truth().to_json())
            assert writer.put(Tick(frame, unseen(frame), None, None, world.physics.status(), 0, 3.0))
    writer.stop("all recorded")
    assert writer.close()
    saved = writer.status().saved
    shutil.rmtree(folder, ignore_errors=True)
    saved.rename(folder)
    told = [{name: one[name] for name in TOLD} for one in truth]
    (folder / TRUTH).write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    _see_again(folder, config.perception, (x, y))


def unseen(frame: Frame) -> Scene:
    """A scene of a frame that nobody has looked at yet."""
    height, width = frame.image.shape[:2]
    return Scene(frame.index, frame.captured_s, (width, height), 1.0, refusal=Refusal(Reason.NO_MODEL))


def _see_again(folder: Path, config: PerceptionConfig, target: Point) -> None:
    perceive = open_pipeline(config)
    lines = [json.loads(line) for line in (folder / FRAMES).read_text(encoding="utf-8").splitlines()]
    with SessionReader(folder) as reader:
        reader.wait()
        for place, line in enumerate(lines):
            tick = reader.tick(place)
            line.update(row_of(replace(tick, scene=perceive(tick.frame, target)), None, with_masks=False))
            del line["crc"]
    text = "".join(sealed(json.dumps(line, separators=(",", ":"))) + "\n" for line in lines)
    (folder / FRAMES).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    GOLDEN.parent.mkdir(exist_ok=True)
    make(GOLDEN)
