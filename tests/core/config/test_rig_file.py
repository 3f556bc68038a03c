"""Rig files: round trips, names, broken files that are kept, and what of them reaches configuration and sessions."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from core.bench.bench import bench_from_pictures, bench_sha256, write_bench
from core.config.calibration import BehaviourConfig, CalibrationConfig, Estimate, LensConfig, PortConfig, ScaleConfig
from core.config.models import Config, load_config
from core.config.rig_file import (
    RigFileError,
    as_calibrated,
    calibration_of,
    check_rig_name,
    find_rig,
    has_rig,
    list_rigs,
    make_rig,
    read_again,
    read_rig,
    rig_path,
    rigs_folder,
    scaled,
    sections_of_rig,
    set_behaviour,
    set_bench,
    set_port,
    with_rig,
    write_rig,
)
from core.config.safety import TENDONS
from core.session.manifest import about_rig
from tests.core.bench.drawn_bench import board

MADE = datetime(2025, 3, 4, 5, 6, 7, tzinfo=UTC)
LENS = LensConfig(k1=-0.1, center_px=(319.5, 239.5), size_px=(640, 480), residual_px=0.1, pictures=3)
SCALE = ScaleConfig(mm_per_px=0.32, size_px=(640, 480), method="board", uncertainty_share=0.001)
KNOWN = CalibrationConfig(made_utc=MADE, lens=LENS, scale=SCALE)
REAL = load_config(
    overrides={
        "rig": {"camera": "webcam", "robot": "servos"},
        "camera": {"device": "/dev/v4l/by-id/cam"},
        "servos": {"port": "/dev/serial/by-id/u2d2"},
    }
)


pytestmark = pytest.mark.usefixtures("own_folder")


@pytest.mark.parametrize("config", [load_config(), REAL])
def test_a_rig_comes_back_as_it_was_saved(config: Config) -> None:
    rig = make_rig(config, "bench 1", KNOWN)
    path = write_rig(rig)
    assert path == rigs_folder() / "bench 1.toml"
    assert read_rig(path) == rig
    assert find_rig("BENCH 1") == (path, rig)
    assert [one.name for one in list_rigs()] == ["bench 1"]


def test_a_rig_with_real_servos_keeps_to_the_safety_rules() -> None:
    path = write_rig(make_rig(REAL, "bench 1", KNOWN))
    text = path.read_text()
    assert "heartbeat_timeout_s = 0.5" in text
    path.write_text(text.replace("heartbeat_timeout_s = 0.5", "heartbeat_timeout_s = 5.0"))
    with pytest.raises(RigFileError, match=r"servos: heartbeat_timeout_s must be 0\.5 at most"):
        read_rig(path)


def test_a_real_rigs_steps_have_a_ceiling_that_a_twins_have_not() -> None:
    path = write_rig(make_rig(REAL, "bench 1", KNOWN))
    path.write_text(path.read_text().replace("max_step_mm = 0.6", "max_step_mm = 50.0", 1))
    with pytest.raises(RigFileError, match=r"servos: joint right: max_step_mm must be 1 at most with real servos") as told:
        read_rig(path)
    assert "\n" not in str(told.value)
    twin = write_rig(make_rig(Config(), "soft", KNOWN))
    twin.write_text(twin.read_text().replace("max_step_mm = 0.6", "max_step_mm = 50.0", 1))
    assert read_rig(twin).servos.joints[0].max_step_mm == 50.0


def test_a_copy_of_a_rig_file_does_not_take_its_place() -> None:
    path = write_rig(make_rig(REAL, "bench", KNOWN))
    (path.parent / "a backup of bench.toml").write_text(path.read_text())
    assert find_rig("bench")[0] == path
    assert find_rig("BENCH")[0] == path
    assert find_rig("a backup of bench")[0].stem == "a backup of bench"
    assert has_rig("Bench")
    assert not has_rig("bench 2")


def test_a_copy_is_the_rig_that_its_file_says() -> None:
    """The way to a second bench: copied, and another port put in."""
    path = write_rig(make_rig(REAL, "bench 1", KNOWN))
    copied = path.with_name("bench 2.toml")
    copied.write_text(path.read_text())
    assert [(one.name, one.path) for one in list_rigs()] == [("bench 1", path), ("bench 2", copied)]
    assert with_rig(load_config(), read_rig(copied), copied).rig.name == "bench 2"
    assert find_rig("bench 2")[0] == copied


def test_the_configuration_takes_the_rig_over() -> None:
    path = write_rig(make_rig(REAL, "bench 1", KNOWN))
    config = with_rig(load_config(overrides={"advice": {"slow_mm_s": 2.0}}), read_rig(path), path)
    assert config.rig.name == "bench 1"
    assert config.rig.camera == "webcam"
    assert config.camera == REAL.camera
    assert config.servos == REAL.servos
    assert config.advice.slow_mm_s == 2.0
    assert calibration_of(config) == KNOWN
    assert sections_of_rig(config, load_config()) == {"camera", "servos"}
    named = load_config(overrides={"rig": {"file": str(path)}})  # its calibration only
    assert sections_of_rig(named, named) == sections_of_rig(REAL, load_config()) == frozenset()


def test_a_rig_is_read_again_and_nothing_that_was_chosen_instead_of_it() -> None:
    path = write_rig(make_rig(REAL, "bench 1", KNOWN))
    opened = with_rig(load_config(), read_rig(path), path)
    file = path.read_text(encoding="utf-8")
    path.write_text(file.replace("max_pull_mm = 2.0", "max_pull_mm = 3.5"), encoding="utf-8")
    assert read_again(opened, load_config()).servos.max_pull_mm == 3.5
    assert read_again(opened, load_config()).rig == opened.rig
    settings = load_config(
        overrides={"rig": {"file": str(path), "camera": "webcam", "robot": "servos"}, "servos": {"port": "/dev/x"}}
    )
    assert read_again(settings, settings) is settings, "its calibration only"
    for chosen in (
        {"name": "twin", "camera": "twin", "robot": "twin"},
        {"name": "webcam", "camera": "webcam", "robot": "none"},
        {"camera": "video_file", "robot": "none", "source": "clip.mp4"},
    ):
        running = settings.model_copy(update={"rig": settings.rig.model_copy(update=chosen)})
        assert read_again(running, settings) is running


def test_the_twins_scale_is_that_of_its_own_pictures() -> None:
    config = load_config(overrides={"twin": {"image_width_px": 1280, "image_height_px": 720}})
    known = KNOWN.model_copy(update={"scale": SCALE.model_copy(update={"size_px": (1280, 720), "mm_per_px": 0.2})})
    assert scaled(config, known).policy.pursuit.pixels_per_mm == pytest.approx(2.5)
    assert scaled(load_config(), known) == load_config()


@pytest.mark.parametrize(
    ("mm_per_px", "size_px", "working_px", "px_per_mm"),
    [
        (0.2, (640, 480), 640, 5.0),
        (0.2, (1280, 720), 640, 2.5),  # half a source pixel is a working pixel
        (0.2, (640, 480), 320, 2.5),
    ],
)
def test_the_measured_scale_goes_before_the_configured_one(
    mm_per_px: float, size_px: tuple[int, int], working_px: int, px_per_mm: float
) -> None:
    camera = {"width_px": size_px[0], "height_px": size_px[1]}
    said = {
        "rig": {"camera": "realsense", "robot": "none"},
        "perception": {"working_size_px": working_px},
        "policy": {"pursuit": {"pixels_per_mm": 7.0}},
        "camera": camera,
    }
    config = load_config(overrides=said)
    scale = SCALE.model_copy(update={"mm_per_px": mm_per_px, "size_px": size_px})
    found = scaled(config, KNOWN.model_copy(update={"scale": scale}))
    assert found.policy.pursuit.pixels_per_mm == pytest.approx(px_per_mm)
    assert found.policy.pursuit.look_ahead_px == config.policy.pursuit.look_ahead_px
    cropped = load_config(overrides=said | {"camera": {"width_px": 960, "height_px": 960}})
    assert scaled(cropped, KNOWN.model_copy(update={"scale": scale})) == cropped, "another part of the bench"
    assert scaled(config, None) is config
    assert scaled(config, CalibrationConfig(made_utc=MADE, lens=LENS)).policy.pursuit.pixels_per_mm == 7.0


@pytest.mark.parametrize(("turn_deg_per_mm", "turn_deg"), [(30.0, 60.0), (2.0, 10.0), (None, 94.0)])
def test_the_learnt_turn_of_the_head_reaches_the_drive(turn_deg_per_mm: float | None, turn_deg: float) -> None:
    tendons = [{"name": name, "moved_px": 8.0, "px_per_mm": 20.0} for name in TENDONS]
    steering = {"heading_deg": 0.0, "roll_deg": 0.0, "disagreement_deg": 1.0, "tendons": tendons}
    known = CalibrationConfig.model_validate({"made_utc": MADE, "steering": steering | {"turn_deg_per_mm": turn_deg_per_mm}})
    path = write_rig(make_rig(REAL, "bench 1", known))
    config = with_rig(load_config(), read_rig(path), path)
    assert (config.policy.drive.turn_deg, as_calibrated(config).policy.drive.turn_deg) == (94.0, turn_deg)
    assert as_calibrated(config).policy.pursuit == config.policy.pursuit


def test_the_insertion_port_is_kept_in_the_rig_file_and_reaches_perception() -> None:
    path = write_rig(make_rig(REAL, "bench 1", None))
    set_port(path, PortConfig(x_share=0.1, y_share=0.6))
    config = with_rig(load_config(), read_rig(path), path)
    found = as_calibrated(config).perception.path
    assert (found.port_x_share, found.port_y_share) == (0.1, 0.6)
    assert config.perception.path.port_x_share is None, "it is the rig's, not the user's"
    set_port(path, None)
    assert as_calibrated(config).perception == config.perception
    path = write_rig(make_rig(REAL, "bench 2", KNOWN))
    set_port(path, PortConfig(x_share=0.1, y_share=0.6))
    assert read_rig(path).calibration == KNOWN.model_copy(update={"port": PortConfig(x_share=0.1, y_share=0.6)})


def test_a_port_of_the_configuration_holds_for_rigs_that_tell_none() -> None:
    config = load_config(overrides={"perception": {"path": {"port_x_share": 0.2, "port_y_share": 0.3}}})
    assert as_calibrated(config).perception.path.port_x_share == 0.2


def test_the_bench_is_kept_in_the_rig_file_and_reaches_perception_and_the_session(tmp_path: Path) -> None:
    path = write_rig(make_rig(REAL, "bench 1", KNOWN))
    config = with_rig(load_config(), read_rig(path), path)
    assert as_calibrated(config).perception.bench is None
    write_bench(bench_from_pictures([board()], None, "lab", 640), tmp_path / "lab")
    set_bench(path, tmp_path / "lab")
    found = as_calibrated(config)
    assert found.perception.bench == str(tmp_path / "lab")
    assert read_rig(path).calibration == KNOWN
    assert about_rig(found, "LIVE", "bench 1").bench == {"name": "lab", "sha256": bench_sha256(tmp_path / "lab")}
    (tmp_path / "lab" / "bench.json").unlink()
    about = about_rig(found, "LIVE", "bench 1").bench
    assert "cannot be read" in about["problem"]
    set_bench(path, None)
    assert as_calibrated(config).perception.bench is None


def test_a_bench_beside_its_rig_file_is_found_from_there() -> None:
    path = write_rig(make_rig(REAL, "bench 1", None).model_copy(update={"bench": "lab"}))
    assert as_calibrated(with_rig(load_config(), read_rig(path), path)).perception.bench == str(path.parent / "lab")


def test_a_rig_that_is_calibrated_again_keeps_what_it_was_taught(tmp_path: Path) -> None:
    path = write_rig(make_rig(REAL, "bench 1", None))
    set_bench(path, tmp_path / "lab", "mine")
    again = make_rig(with_rig(REAL, read_rig(path), path), "bench 1", KNOWN)
    assert (again.bench, again.model) == (str(tmp_path / "lab"), "mine")
    assert make_rig(REAL, "bench 2", KNOWN).bench is None
    running = with_rig(REAL, read_rig(path), path)
    one = Estimate(value=1.0, low=0.9, high=1.1)
    fitted = {name for name, field in BehaviourConfig.model_fields.items() if field.annotation is Estimate}
    robot = BehaviourConfig(session="jog", head_p50_mm=0.2, head_p95_mm=0.5, **dict.fromkeys(fitted, one))
    set_behaviour(path, robot)
    assert make_rig(running, "bench 1", KNOWN).behaviour == robot
    joints = tuple(joint.model_copy(update={"mm_per_turn": 1.1 * joint.mm_per_turn}) for joint in running.servos.joints)
    other = running.model_copy(update={"servos": running.servos.model_copy(update={"joints": joints})})
    assert make_rig(other, "bench 1", KNOWN).behaviour is None, "identified with other ways per turn"
    path.unlink()
    assert make_rig(running, "bench 1", KNOWN).bench is None


def test_a_rig_without_a_model_does_not_keep_the_one_of_the_rig_before(tmp_path: Path) -> None:
    taught, plain = (write_rig(make_rig(REAL, name, None)) for name in ("bench 1", "bench 2"))
    set_bench(taught, tmp_path / "lab", "mine")
    config = with_rig(load_config(), read_rig(taught), taught)
    assert config.perception.segmentation.model == "mine"
    assert with_rig(config, read_rig(plain), plain).perception.segmentation.model == "default"
    chosen = load_config(overrides={"perception": {"segmentation": {"model": "own"}}})
    assert with_rig(chosen, read_rig(plain), plain).perception.segmentation.model == "own"


def test_a_session_keeps_the_calibration() -> None:
    path = write_rig(make_rig(load_config(), "bench 1", KNOWN))
    about = about_rig(with_rig(load_config(), read_rig(path), path), "SIM", "bench 1")
    assert CalibrationConfig.model_validate(about.calibration) == KNOWN
    assert about_rig(load_config(), "SIM", "twin").calibration is None


def test_a_recording_is_straight_already() -> None:
    path = write_rig(make_rig(load_config(), "bench 1", KNOWN))
    config = load_config(overrides={"rig": {"camera": "video_file", "source": "a.mp4", "file": str(path), "robot": "none"}})
    assert calibration_of(config) is None


def test_the_insertion_port_leaves_the_older_calibration_where_it_is() -> None:
    write_rig(make_rig(load_config(), "bench 1", KNOWN))
    path = write_rig(make_rig(load_config(), "bench 1", None))
    for share in (0.1, 0.2):
        set_port(path, PortConfig(x_share=share, y_share=0.6))
    assert read_rig(path.with_name("bench 1.older.toml")).calibration == KNOWN


@pytest.mark.parametrize("name", ["", "  ", "../up", "a/b", ".hidden", "twin", "Webcam", "x" * 61, "a.older"])
def test_names_that_are_none(name: str) -> None:
    with pytest.raises(ValueError, match=r"name|called"):
        check_rig_name(name)
    with pytest.raises(RigFileError):
        make_rig(load_config(), name, None)


BROKEN = (
    ("= 3", "no TOML"),
    ("format = 99", "newer version"),
    ('name = "b"', "made_utc: Field required"),
    ("\x00", "no TOML"),
    ("a = " + "[" * 5000 + "]" * 5000, "no TOML"),
    ("a = " + "9" * 5000, "no TOML"),
)


@pytest.mark.parametrize(("text", "problem"), BROKEN)
def test_a_broken_file_is_one_clear_line_and_is_kept(text: str, problem: str) -> None:
    path = rig_path("bench 1")
    path.parent.mkdir(parents=True)
    path.write_text(text)
    with pytest.raises(RigFileError, match=problem) as told:
        read_rig(path)
    assert "\n" not in str(told.value)
    assert str(path) in str(told.value)
    assert path.read_text() == text
    listed = list_rigs()
    assert [(one.name, one.rig) for one in listed] == [("bench 1", None)]
    assert problem in listed[0].problem
    with pytest.raises(RigFileError, match=problem):
        find_rig("bench 1")


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("id = 3", "id = 2", "two servos have the same id"),
        ("mm_per_px = 0.32", "mm_per_px = -0.32", "calibration.scale.mm_per_px"),
        ('kind = "twin"', 'kind = "webcam"', "twin"),
        ("roll_deg = 0.0", "roll_dog = 0.0", "twin.roll_dog"),
        ('robot = "twin"', 'robot = "servos"', "robot servos needs a real camera"),
    ],
)
def test_a_value_that_cannot_be_is_named(old: str, new: str, problem: str) -> None:
    path = write_rig(make_rig(load_config(), "bench 1", KNOWN))
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(RigFileError, match=problem):
        read_rig(path)


def test_a_missing_rig_names_those_that_there_are() -> None:
    write_rig(make_rig(load_config(), "bench 1", None))
    with pytest.raises(RigFileError, match="unknown rig 'bench 2'; known: twin, realsense, webcam, basler, bench 1"):
        find_rig("bench 2")
    with pytest.raises(RigFileError, match="no such rig file"):
        read_rig(rig_path("bench 2"))


def test_a_recording_is_no_rig() -> None:
    config = load_config(overrides={"rig": {"camera": "video_file", "source": "a.mp4", "robot": "none"}})
    with pytest.raises(RigFileError, match="plays a recording"):
        make_rig(config, "bench 1", None)


def test_a_rig_whose_file_was_renamed_is_not_saved_over_by_another_one_of_its_name() -> None:
    old = write_rig(make_rig(REAL, "bench", KNOWN))
    kept = old.rename(old.with_name("lab before the move.toml"))
    assert write_rig(make_rig(REAL, "bench", None)) == old
    assert read_rig(kept).calibration == KNOWN
    assert find_rig("bench")[0] == old


def test_a_rig_that_is_saved_again_in_other_letters_stays_one_file() -> None:
    path = write_rig(make_rig(REAL, "empt", None))
    assert write_rig(make_rig(REAL, "EMPT", KNOWN)) == path
    assert [one.path for one in list_rigs()] == [path]
    assert find_rig("empt")[1].calibration == KNOWN
    assert read_rig(path.with_name("empt.older.toml")).calibration is None
