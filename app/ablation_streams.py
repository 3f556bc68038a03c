"""The part of ``ablation`` that needs a stream: consecutive frames of the twin, with and without tracking."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from app.long_work import progress_bar
from core.config import PerceptionConfig, TwinConfig
from core.study.ablation import OURS, SameMasks
from core.study.ablation_stream import StreamFrame, stream_figures, stream_frame
from core.types import Frame

if TYPE_CHECKING:
    from core.perception.pipeline import Pipeline

_FEED_MM_S = 12.0
_START_MM = 35.0
_WANDER = 0.6
LIVE = f"{OURS}, as the window has it"


def measure_streams(
    configs: Mapping[str, PerceptionConfig],
    pipeline_of: Callable[[PerceptionConfig], Pipeline],
    masks: SameMasks,
    *,
    live: Pipeline | None,
    frames: int,
    phantoms: Sequence[str],
    seed: int,
) -> tuple[dict[str, Any] | None, bool]:
    """The same frames of the twin, in order, through pipelines of all `configs`, and through one that looks as the window does.

    Parameters
    ----------
    configs : by the variant's name, ``OURS`` among them: its settings tell the truth.
    pipeline_of : makes a new pipeline that looks through `masks`.
    masks : what all pipelines share.
    live : a pipeline as the window has it, which looks for itself, mostly around the head; None: it is left out.
    frames : to be divided among the `phantoms`.
    seed : of the twin.

    Returns
    -------
    The phantoms that were driven through and ``stream_figures`` by variant (None when there is none); whether it was interrupted.
    """
    each = -(-frames // len(phantoms))
    names = [*configs, *([LIVE] if live is not None else [])]
    streams: dict[str, list[list[StreamFrame]]] = {name: [] for name in names}
    driven: list[str] = []
    interrupted = False
    with progress_bar() as bar:
        task = bar.add_task("frames of the twin", total=each * len(phantoms))
        try:
            for look, phantom in enumerate(phantoms):
                pipelines = {name: pipeline_of(config) for name, config in configs.items()}
                if live is not None:
                    live.reset()
                    pipelines[LIVE] = live
                seen: dict[str, list[StreamFrame]] = {name: [] for name in names}
                for frame, row in _stream(phantom, look, each, seed, configs[OURS], masks):
                    for name, pipeline in pipelines.items():
                        seen[name].append(stream_frame(pipeline(frame), row))
                    bar.advance(task)
                driven.append(phantom)
                for name, part in seen.items():
                    streams[name].append(part)
        except KeyboardInterrupt:
            interrupted = True
    if not driven:
        return None, interrupted
    rows = [{"name": name, "figures": stream_figures(parts[: len(driven)])} for name, parts in streams.items()]
    return {"phantoms": driven, "frames_each": each, "rows": rows}, interrupted


def _stream(
    phantom: str, look: int, frames: int, seed: int, config: PerceptionConfig, masks: SameMasks
) -> Iterator[tuple[Frame, dict[str, Any]]]:
    """Consecutive frames of a robot that is driven along its longest route with a slow wander, and their truth."""
    from hardware.twin.autopilot import RouteFollower
    from hardware.twin.world import TwinWorld

    world = TwinWorld(TwinConfig(phantom=phantom, appearance_seed=look), perception=config, seed=seed)
    routes = (RouteFollower(world.phantom, node, wander=_WANDER, seed=seed) for node in world.phantom.targets)
    follower = max(routes, key=lambda route: route.length_mm)
    world.insert(_START_MM)
    world.robot.connect()
    period_s = 1.0 / world.config.frames_per_second
    for _ in range(frames):
        world.robot.send(follower.command(world.physics.robot_points_mm(), _FEED_MM_S, period_s))
        world.advance(period_s)
        frame = world.frame()
        picture = world.picture(world.physics.robot_points_mm(), world.physics.delivery_mm)
        masks.next_frame(picture.vessel, picture.robot)
        yield frame, world.truth().to_json()
