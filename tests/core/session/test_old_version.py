"""Files of earlier versions are read as those versions read them (``tests/data/old_version/README.txt``)."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from core.annotation.agreement_report import agreement_report, choose_study, manual_measurements, measured_alike
from core.annotation.model import AngleProvenance
from core.annotation.store import AnnotationStore, ItemKey
from core.config.files import read_settings
from core.config.models import Config
from core.config.rig_file import read_rig
from core.evaluation.evaluation import read_measurements, write_measurements
from core.session.export import export_csv
from core.session.reader import SessionReader, losses
from core.session.recovery import recover

OLD = Path(__file__).parents[2] / "data" / "old_version"
SESSIONS = {"today": next(OLD.glob("session_*")), "older": next(OLD.glob("older/session_*"))}
ANNOTATIONS = {"today": OLD / "annotations", "older": OLD / "older/annotations"}


@pytest.mark.parametrize("version", SESSIONS)
def test_a_session_is_read_exported_and_recovered(version: str, tmp_path: Path) -> None:
    expected = (OLD / "expected" / f"{version}_session.csv").read_text()
    session = Path(shutil.copytree(SESSIONS[version], tmp_path / SESSIONS[version].name))
    for folder in (session, recover(session).folder):
        out = tmp_path / f"{folder.name}.csv"
        with SessionReader(folder) as reader:
            rows = export_csv(reader, out)
            ticks = [reader.tick(place) for place in range(rows)]
            assert all(tick is not None and tick.scene.masks is not None and tick.scene.pose is not None for tick in ticks)
            assert losses(reader, reader.events) == []
            assert reader.problems == ()
        assert out.read_text() == expected


@pytest.mark.parametrize("version", ANNOTATIONS)
def test_annotations_are_read_measured_and_written(version: str, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(ANNOTATIONS[version], tmp_path / "annotations"))
    path = folder / "annotations.lumenpilot.sqlite"
    config = Config().perception

    def report() -> object:
        with AnnotationStore(path, read_only=True) as store:
            images = store.images()
            names = {sha256: image.name for sha256, image in images.items()}
            own, _ = measured_alike(choose_study(store.annotations(), "", ""), images, config)
            write_measurements(tmp_path / "out.csv", manual_measurements(own, names))
            study, _ = measured_alike(choose_study(store.annotations(), "pilot", ""), images, config)
            assert store.problems == []
            assert {key.rater for key in store.given_after_look()} == ({"bob"} if version == "today" else set())
            return json.loads(json.dumps({"study": "pilot"} | agreement_report(study, names)))

    expected = json.loads((OLD / "expected" / f"{version}_study_report.json").read_text())
    assert _has_all(report(), expected)
    now, then = (read_measurements(at) for at in (tmp_path / "out.csv", OLD / "expected" / f"{version}_annotations.csv"))
    for row, was in zip(now, then, strict=True):
        angles = (was.angle_1, was.angle_2)
        assert (row.image, row.state, row.angle_1, row.angle_2) == (was.image, was.state, *map(_about, angles))
    with AnnotationStore(path) as store:  # opened for writing once, it has what this version needs
        key = ItemKey(next(iter(store.images())), "", "ann")
        assert store.history(key).can_undo
        store.keep_look(key, 0)
        assert key in store.given_after_look()
    with AnnotationStore(path, read_only=True) as store:
        assert [one.provenance for one in store.annotations()].count(AngleProvenance.ALGORITHM) == 1


def test_a_rig_and_settings_are_read() -> None:
    rig = json.loads((OLD / "expected/rig_bench.json").read_text())
    del rig["path"]
    assert rig["servos"].pop("max_current_ma") == 600.0  # each joint has a force now
    now = read_rig(OLD / "rig_bench.toml")
    assert _has_all(now.model_dump(mode="json"), rig)
    assert [joint.max_force_n for joint in now.servos.joints] == [20.0] * 4 + [30.0] * 3
    settings = read_settings(OLD / "settings.toml", may_move=False)
    assert settings.problems == ()
    assert (settings.config.rig.name, settings.config.camera.gain, settings.config.policy.name) == ("webcam", 16.0, "table")


def _has_all(now: Any, then: Any) -> bool:
    """Whether each value of an older version is still there; newer ones have been added."""
    if isinstance(then, dict):
        return all(key in now and _has_all(now[key], value) for key, value in then.items())
    if isinstance(then, list):
        return len(now) == len(then) and all(map(_has_all, now, then))
    if isinstance(then, float):
        return bool(now == _about(then))
    return bool(now == then)


def _about(value: float | None) -> Any:
    """Angles are written with four decimals."""
    return value if value is None else pytest.approx(value, abs=1e-4)
