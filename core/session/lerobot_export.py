"""A session as an episode of a LeRobotDataset v3.0: a folder of Parquet, MP4 and JSON. Exported into the same folder, sessions
become its episodes.

Rows are put on an even grid of time, as the format demands: each grid point takes the newest row. Where no row came for longer
than ``MAX_GAP_S`` the time is cut out. Each episode has files of its own.
"""

from __future__ import annotations

import json
import math
import os
import secrets
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.session.codec import RecordedRow
from core.session.export import Movie
from core.session.manifest import SessionError
from core.session.reader import SessionReader
from core.session.values import rotation_joints, tendon_names, values_of
from core.types import Command, Image

CODEBASE_VERSION = "v3.0"
"""Of the layout."""
VIDEO = "observation.images.top"
"""Name of the camera's pictures."""
MAX_GAP_S = 0.5
"""Longer times without a picture are cut out."""
_FILES_PER_CHUNK = 1000
"""A folder ``chunk-NNN`` has so many files at most."""
_TASK = "steer the robot through the vessel to the target"
"""The task of all episodes."""
_QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
"""Of each value, in the statistics."""
_SAMPLED_PICTURES, _SAMPLE_SIDE_PX = 100, 150
"""The statistics of the pictures are of so many of an episode, of about this size."""
_DATA_PATH, _VIDEO_PATH, _EPISODES_PATH = (
    "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
    "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
    "meta/episodes/chunk-000/file-000.parquet",
)
_INFO, _STATS, _TASKS = "meta/info.json", "meta/stats.json", "meta/tasks.parquet"
_POSE = ("theta_signed_deg", "c_head_px", "c_tail_px", "head_x_px", "head_y_px", "confidence")
"""Values of the pose; 0 without one, which ``has_pose`` tells."""
_TARGET = ("target_x_px", "target_y_px")
"""The end of the route; 0 without one, which ``has_target`` tells."""


def export_lerobot(reader: SessionReader, path: Path, *, on_row: Callable[[], None] = lambda: None) -> int:
    """Write a session as a new dataset, or as the next episode of the one that is there; returns its frames.

    Raises SessionError: nothing was driven in it or no picture is left; the folder is no such dataset, has this session already, or
    was made with another robot or picture size, or cannot be written. What was there is unchanged then. Raises UserError: pyarrow
    is not installed.
    """
    from core.program import need_package

    need_package("pyarrow")
    reader.wait()
    work = path.with_name(f".{secrets.token_hex(8)}.part")
    try:
        old = _existing(path)
        session = reader.manifest.id if reader.manifest is not None else reader.folder.name
        if any(episode.get("session") == session for episode in old):
            raise SessionError(f"{path}: has this session already; nothing was written")
        work.mkdir(parents=True)
        frames = _write_episode(reader, session, path, work, old, on_row)
        if path.exists():
            # the JSON with the number of episodes comes last: before it the new files are of no account
            for part in sorted((one for one in work.rglob("*") if one.is_file()), key=lambda one: one.name == "info.json"):
                target = path / part.relative_to(work)
                target.parent.mkdir(parents=True, exist_ok=True)
                os.replace(part, target)
        else:
            os.replace(work, path)
    except OSError as error:
        raise SessionError(f"{error.filename or path}: cannot be written ({error.strerror or error})") from None
    finally:
        with suppress(OSError):
            shutil.rmtree(work, ignore_errors=True)
    return frames


def _existing(path: Path) -> list[dict[str, Any]]:
    """The episodes of a dataset; none where there is nothing yet. Raises SessionError."""
    from pyarrow import ArrowException, parquet

    if not path.exists():
        return []
    try:
        info = json.loads((path / _INFO).read_text(encoding="utf-8"))
        if info["codebase_version"] != CODEBASE_VERSION or info["robot_type"] != "lumenpilot":
            raise ValueError
        rows: list[dict[str, Any]] = parquet.read_table(path / _EPISODES_PATH).to_pylist()
    except (OSError, ValueError, KeyError, TypeError, ArrowException):
        raise SessionError(f"{path}: is there already, and no dataset of this program; choose another folder") from None
    return rows


def _write_episode(
    reader: SessionReader, session: str, path: Path, work: Path, old: list[dict[str, Any]], on_row: Callable[[], None]
) -> int:
    """Write the files that the dataset at `path` gets, into `work`. Returns the frames."""
    number, begin = len(old), sum(int(episode["length"]) for episode in old)
    place = {"chunk_index": number // _FILES_PER_CHUNK, "file_index": number % _FILES_PER_CHUNK}
    info = json.loads((path / _INFO).read_text(encoding="utf-8")) if old else None
    times_s = reader.timeline().time_s
    usual_s = float(np.median(np.diff(times_s))) if len(times_s) > 1 else 0.0
    fps = int(info["fps"]) if info is not None else max(1, round(1.0 / usual_s)) if usual_s > 0.0 else 30
    names = _names(reader)
    movie_path = work / _VIDEO_PATH.format(video_key=VIDEO, **place)
    movie_path.parent.mkdir(parents=True)
    movie: Movie | None = None
    states, actions, pictures = list[list[float]](), list[list[float]](), list[Image]()
    action = [0.0] * len(names["action"])
    state: list[float] | None = None
    try:
        for row, image in _on_grid(reader, fps, on_row):
            state = _state(row, names["observation.state"], state)
            if state is None:  # nothing was measured yet
                continue
            movie = movie or Movie(movie_path, image, Fraction(1, fps), key_every=2)
            movie.add(image, len(states) / fps)
            # without a command the bend stays and the feeds stand
            held = [0.0 if name.endswith("_s") else value for name, value in zip(names["action"], action, strict=True)]
            action = held if row.sent is None else [float(getattr(row.sent, name)) for name in names["action"]]
            if len(states) % max(1, len(times_s) // _SAMPLED_PICTURES) == 0:
                pictures.append(_small(image))
            states.append(state)
            actions.append(action)
    finally:
        if movie is not None:
            movie.close()
    if movie is None:
        raise SessionError(f"{reader.folder}: no picture with a measured robot in it; nothing was written")
    features = _features(names, movie.size, fps)
    if info is not None and info["features"] != features:
        raise SessionError(f"{path}: was made with another robot, rate or picture size; choose another folder")
    count = len(states)
    columns: dict[str, NDArray[Any]] = {
        "observation.state": np.array(states, np.float32),
        "action": np.array(actions, np.float32),
        "next.done": np.arange(count) == count - 1,
        "timestamp": (np.arange(count) / fps).astype(np.float32),
        "frame_index": np.arange(count),
        "episode_index": np.full(count, number),
        "index": np.arange(begin, begin + count),
        "task_index": np.zeros(count, np.int64),
    }
    _write_rows(columns, work / _DATA_PATH.format(**place))
    stats = {name: _statistics(column.reshape(count, -1)) for name, column in columns.items()}
    pixels = np.concatenate([picture.reshape(-1, 3) for picture in pictures]) / 255.0
    of_pictures = {key: value.reshape(3, 1, 1) for key, value in _statistics(pixels).items() if key != "count"}
    stats[VIDEO] = of_pictures | {"count": np.array([len(pictures)])}
    episode: dict[str, Any] = {"episode_index": number, "tasks": [_TASK], "length": count, "session": session}
    episode |= {f"data/{key}": value for key, value in place.items()}
    episode |= {"dataset_from_index": begin, "dataset_to_index": begin + count}
    episode |= {f"videos/{VIDEO}/{key}": value for key, value in place.items()}
    episode |= {f"videos/{VIDEO}/from_timestamp": 0.0, f"videos/{VIDEO}/to_timestamp": count / fps}
    episode |= {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
    episode |= {f"stats/{name}/{key}": value.tolist() for name, of_one in stats.items() for key, value in of_one.items()}
    _write_meta(work, [*old, episode], features, fps)
    return count


def _on_grid(reader: SessionReader, fps: int, on_row: Callable[[], None]) -> Iterator[tuple[RecordedRow, Image]]:
    """Row and picture for each point of a grid of `fps` a second: the newest at that time; none where it is too old."""
    times_s = reader.timeline().time_s
    if not len(times_s):
        return
    half_s, last = 0.5 / fps, -1
    found: tuple[RecordedRow, Image] | None = None
    for point in range(math.floor((times_s[-1] - times_s[0] + half_s) * fps) + 1):
        at_s = float(times_s[0]) + point / fps
        place = int(np.searchsorted(times_s, at_s + half_s, side="right")) - 1
        for new in range(last + 1, place + 1):
            if new == place or reader.row(new) is None:
                row, frame = reader.row(new), reader.frame(new)
                found = (row, frame.image) if row is not None and frame is not None else found
            on_row()
        last = max(last, place)
        if found is not None and at_s - found[0].captured_s <= MAX_GAP_S:
            yield found


def _names(reader: SessionReader) -> dict[str, list[str]]:
    """The parts of state and action, by the first row with a measured robot. Raises SessionError without one."""
    config = reader.manifest.config if reader.manifest is not None else {}
    turning = ["rotation_deg"] if rotation_joints(config) else []
    for place in range(len(reader)):
        row = reader.row(place)
        if row is not None and row.status is not None:
            tendons = tendon_names(len(row.status.tendon_pull_mm))
            joints = [f"tendon_{what}_{tendon}" for what in ("pull_mm", "force_mn") for tendon in tendons]
            state = ["insertion_mm", "delivery_mm", *turning, *joints, *_POSE, "has_pose", *_TARGET, "has_target"]
            action = [name for name in Command.__slots__ if turning or name != "rotation_deg_s"]
            return {"observation.state": state, "action": action}
    raise SessionError(f"{reader.folder}: no robot in it; a LeRobot dataset needs joints and commands")


def _state(row: RecordedRow, names: Sequence[str], before: list[float] | None) -> list[float] | None:
    """The state of a row. Without a measured robot its joints are those of `before`; None where those are unknown, too."""
    values = values_of(row)
    has_joints = row.status is not None
    if not has_joints and before is None:
        return None
    values["has_pose"] = float(row.scene.pose is not None)
    route = row.scene.route
    values["has_target"] = float(route is not None)
    if route is not None:
        x, y = route.points[-1].tolist()
        values |= zip(_TARGET, row.scene.to_source((x, y)), strict=True)
    held = dict(zip(names, before, strict=True)) if before is not None and not has_joints else {}
    joint = ("insertion_mm", "delivery_mm", "rotation_deg", "tendon_")
    numbers = [held[name] if held and name.startswith(joint) else values.get(name) for name in names]
    return [float(number) if number is not None and math.isfinite(number) else 0.0 for number in numbers]


def _small(image: Image) -> Image:
    step = max(1, max(image.shape) // _SAMPLE_SIDE_PX)
    return np.ascontiguousarray(image[::step, ::step])


def _features(names: dict[str, list[str]], size: tuple[int, int], fps: int) -> dict[str, dict[str, Any]]:
    """The columns and the pictures, as ``info.json`` describes them."""
    video = {"video.height": size[1], "video.width": size[0], "video.codec": "h264", "video.pix_fmt": "yuv420p", "video.fps": fps}
    video |= {"video.is_depth_map": False, "video.channels": 3, "has_audio": False}
    shape = [size[1], size[0], 3]
    features: dict[str, dict[str, Any]] = {
        VIDEO: {"dtype": "video", "shape": shape, "names": ["height", "width", "channels"], "info": video}
    }
    features |= {name: {"dtype": "float32", "shape": [len(parts)], "names": parts} for name, parts in names.items()}
    features["next.done"] = {"dtype": "bool", "shape": [1], "names": None}
    features["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    integers = ("frame_index", "episode_index", "index", "task_index")
    return features | {name: {"dtype": "int64", "shape": [1], "names": None} for name in integers}


def _write_rows(columns: dict[str, NDArray[Any]], path: Path) -> None:
    """A column for each feature: numbers, or lists of one length."""
    import pyarrow as pa
    from pyarrow import parquet

    arrays = {}
    for name, column in columns.items():
        flat = pa.array(column.ravel())
        arrays[name] = flat if column.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, column.shape[1])
    path.parent.mkdir(parents=True)
    parquet.write_table(pa.table(arrays), path)


def _statistics(values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Of values (N, D): each of shape (D,), the count (1,)."""
    numbers = values.astype(np.float64)
    found = {name: getattr(np, name)(numbers, axis=0) for name in ("min", "max", "mean", "std")}
    quantiles = np.quantile(numbers, list(_QUANTILES.values()), axis=0)
    return found | {"count": np.array([len(values)])} | dict(zip(_QUANTILES, quantiles, strict=True))


def _pooled(parts: Sequence[dict[str, NDArray[Any]]]) -> dict[str, Any]:
    """The statistics of all episodes together; quantiles are weighted means of theirs, as LeRobot pools them."""
    counts = np.array([int(part["count"][0]) for part in parts], np.float64)
    weights = counts / counts.sum()

    def mean(values: Sequence[NDArray[Any]]) -> NDArray[Any]:
        return np.asarray(np.tensordot(weights, np.stack(values), 1))

    average = mean([part["mean"] for part in parts])
    variance = mean([part["std"] ** 2 + (part["mean"] - average) ** 2 for part in parts])
    pooled = {key: mean([part[key] for part in parts]) for key in parts[0] if key.startswith("q")}
    pooled |= {"min": np.min([part["min"] for part in parts], axis=0), "max": np.max([part["max"] for part in parts], axis=0)}
    pooled |= {"mean": average, "std": np.sqrt(variance), "count": np.array([int(counts.sum())])}
    return {key: value.tolist() for key, value in pooled.items()}


def _write_meta(work: Path, episodes: list[dict[str, Any]], features: dict[str, dict[str, Any]], fps: int) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    (work / _EPISODES_PATH).parent.mkdir(parents=True)
    parquet.write_table(pa.Table.from_pylist(episodes), work / _EPISODES_PATH)
    # pandas makes the column "task" the index again
    columns = [{"name": name, "field_name": name, "metadata": None} for name in ("task_index", "task")]
    columns[0] |= {"pandas_type": "int64", "numpy_type": "int64"}
    columns[1] |= {"pandas_type": "unicode", "numpy_type": "object"}
    about = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.0.0"}
    tasks = pa.table({"task_index": pa.array([0], pa.int64()), "task": [_TASK]})
    parquet.write_table(tasks.replace_schema_metadata({"pandas": json.dumps(about)}), work / _TASKS)
    stats = {}
    for name in features:
        begin = f"stats/{name}/"
        parts = [{key.removeprefix(begin): np.array(one[key]) for key in one if key.startswith(begin)} for one in episodes]
        stats[name] = _pooled(parts)
    info = {
        "codebase_version": CODEBASE_VERSION,
        "robot_type": "lumenpilot",
        "total_episodes": len(episodes),
        "total_frames": sum(int(episode["length"]) for episode in episodes),
        "total_tasks": 1,
        "chunks_size": _FILES_PER_CHUNK,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": fps,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": _DATA_PATH,
        "video_path": _VIDEO_PATH,
        "features": features,
    }
    for place, content in ((_STATS, stats), (_INFO, info)):
        (work / place).write_text(json.dumps(content, indent=4, allow_nan=False) + "\n", encoding="utf-8")
