"""Sessions as a LeRobotDataset: every part of the documented layout v3.0, read by pyarrow and PyAV."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from pyarrow import parquet

from core.session.exporters import export_session
from core.session.lerobot_export import VIDEO
from core.session.manifest import SessionError
from core.session.reader import SessionReader
from core.types import Command
from tests.core.session_data import number_in, record, tick_of

FPS = 10


def session(folder: Path, begin: int, times: list[int]) -> Path:
    """A picture at each of the times (1/10 s); commands and feeds that tell them apart."""
    ticks = []
    for k in times:
        tick = tick_of(begin + k, 1000.0 + k / FPS + 0.004 * (k % 2), full=k % 2 == 1)
        ticks.append(
            replace(tick, sent=Command(0.1 * (k % 5), advance_mm_s=1.0 * k), status=replace(tick.status, insertion_mm=5.0 + k))
        )
    return record(folder, ticks)


def export(folder: Path, out: Path) -> int:
    with SessionReader(folder) as reader:
        return export_session(reader, out, lambda: None)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sessions: of twelve pictures, and of ten with a gap of a second."""
    folder = tmp_path_factory.mktemp("lerobot")
    out = folder / "set.lerobot"
    assert export(session(folder / "a", 0, list(range(12))), out) == 12
    # for half a second the last picture stands, then the time is cut out
    assert export(session(folder / "b", 100, [0, 1, 2, 3, 14, 15, 16, 17, 18, 19]), out) == 15
    return out


def test_the_folder_has_the_files_of_the_layout(dataset: Path) -> None:
    names = sorted(path.relative_to(dataset).as_posix() for path in dataset.rglob("*") if path.is_file())
    assert names == [
        "data/chunk-000/file-000.parquet",
        "data/chunk-000/file-001.parquet",
        "meta/episodes/chunk-000/file-000.parquet",
        "meta/info.json",
        "meta/stats.json",
        "meta/tasks.parquet",
        f"videos/{VIDEO}/chunk-000/file-000.mp4",
        f"videos/{VIDEO}/chunk-000/file-001.mp4",
    ]
    assert not list(dataset.parent.glob(".*.part"))


def test_info_describes_every_column(dataset: Path) -> None:
    info = json.loads((dataset / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["total_episodes"], info["total_frames"]) == ("v3.0", FPS, 2, 27)
    assert (info["splits"], info["total_tasks"], info["chunks_size"]) == ({"train": "0:2"}, 1, 1000)
    assert info["features"][VIDEO]["shape"] == [64, 96, 3]
    assert info["features"]["action"]["names"] == ["bend", "pitch", "advance_mm_s", "delivery_mm_s"]
    for number in range(2):
        place = {"chunk_index": 0, "file_index": number}
        table = parquet.read_table(dataset / info["data_path"].format(**place))
        assert (dataset / info["video_path"].format(video_key=VIDEO, **place)).is_file()
        assert table.column_names == [name for name, one in info["features"].items() if one["dtype"] != "video"]
        for name, feature in info["features"].items():
            if feature["dtype"] == "video":
                continue
            kind = table.schema.field(name).type
            if feature["shape"] != [1]:
                assert kind.list_size == feature["shape"][0] == len(feature["names"])
                kind = kind.value_type
            assert str(kind) == {"float32": "float", "int64": "int64", "bool": "bool"}[feature["dtype"]]


def test_rows_are_state_and_command_on_an_even_grid(dataset: Path) -> None:
    info = json.loads((dataset / "meta/info.json").read_text())
    first, second = (parquet.read_table(dataset / f"data/chunk-000/file-00{k}.parquet").to_pydict() for k in range(2))
    assert first["timestamp"] == pytest.approx([k / FPS for k in range(12)])
    assert (second["index"], second["frame_index"]) == (list(range(12, 27)), list(range(15)))
    assert (set(first["episode_index"]), set(second["episode_index"])) == ({0}, {1})
    assert first["next.done"] == [False] * 11 + [True]
    assert [action[2] for action in first["action"]] == [float(k) for k in range(12)]
    names = info["features"]["observation.state"]["names"]
    state = np.array(first["observation.state"])
    assert state[:, names.index("insertion_mm")].tolist() == [5.0 + k for k in range(12)]
    assert state[:, names.index("has_pose")].tolist() == [0.0, 1.0] * 6
    assert state[1, names.index("theta_signed_deg")] == -5.5
    assert (state[1, names.index("has_target")], state[1, names.index("target_x_px")]) == (1.0, 49.0)
    assert "rotation_deg" not in names, "the robot's shaft is not turned"


def test_pictures_lie_at_the_times_of_their_rows(dataset: Path) -> None:
    with av.open(str(dataset / f"videos/{VIDEO}/chunk-000/file-001.mp4")) as container:
        frames = list(container.decode(video=0))
    assert [frame.time for frame in frames] == pytest.approx([k / FPS for k in range(15)], abs=1e-5)
    shown = [number_in(frame.to_ndarray(format="rgb24")) - 100 for frame in frames]
    assert shown == [0, 1, 2, 3, 3, 3, 3, 3, 3, 14, 15, 16, 17, 18, 19][: len(shown)]


def test_episodes_say_where_their_rows_and_pictures_are(dataset: Path) -> None:
    episodes = parquet.read_table(dataset / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [(one["dataset_from_index"], one["dataset_to_index"], one["length"]) for one in episodes] == [(0, 12, 12), (12, 27, 15)]
    assert [one["data/file_index"] for one in episodes] == [one[f"videos/{VIDEO}/file_index"] for one in episodes] == [0, 1]
    assert episodes[1][f"videos/{VIDEO}/to_timestamp"] == pytest.approx(1.5)
    tasks = parquet.read_table(dataset / "meta/tasks.parquet")
    assert tasks.to_pydict()["task_index"] == [0]
    assert tasks.to_pydict()["task"] == episodes[0]["tasks"]
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]


def test_statistics_are_of_all_episodes(dataset: Path) -> None:
    stats = json.loads((dataset / "meta/stats.json").read_text())
    rows = [parquet.read_table(dataset / f"data/chunk-000/file-00{k}.parquet").to_pydict() for k in range(2)]
    actions = np.concatenate([np.array(one["action"]) for one in rows])
    for name, value in (("mean", actions.mean(axis=0)), ("std", actions.std(axis=0)), ("max", actions.max(axis=0))):
        assert stats["action"][name] == pytest.approx(value.tolist())
    assert stats["action"]["count"] == [27]
    assert np.shape(stats[VIDEO]["mean"]) == (3, 1, 1)
    assert 0.0 < stats[VIDEO]["mean"][0][0][0] < 1.0
    assert set(stats) == set(json.loads((dataset / "meta/info.json").read_text())["features"])


def test_what_does_not_fit_leaves_the_dataset_as_it_is(dataset: Path, tmp_path: Path) -> None:
    def state() -> dict[str, Any]:
        return {path.as_posix(): path.read_bytes() for path in dataset.rglob("*") if path.is_file()}

    before = state()
    with pytest.raises(SessionError, match="has this session already"):
        export(next((dataset.parent / "a").iterdir()), dataset)
    other = record(tmp_path / "size", [tick_of(k, 1000.0 + k / FPS, size=(128, 64)) for k in range(3)])
    with pytest.raises(SessionError, match="was made with another robot, rate or picture size"):
        export(other, dataset)
    still = record(tmp_path / "none", [replace(tick_of(k, 1000.0 + k / FPS), status=None, sent=None) for k in range(3)])
    with pytest.raises(SessionError, match="no robot in it"):
        export(still, tmp_path / "x.lerobot")
    (tmp_path / "y.lerobot").mkdir()
    with pytest.raises(SessionError, match="no dataset of this program"):
        export(other, tmp_path / "y.lerobot")
    assert state() == before
    assert not list(tmp_path.glob(".*.part"))
