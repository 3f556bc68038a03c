"""Settings under edit: each entry is checked as it is typed, with one clear message."""

import pytest

from app.settings.draft import SettingsDraft, search, with_changes
from core.config.models import Config, load_config
from core.config.schema import Effect, schema
from tests.core.robots import THREE

D_ALLOW, THETA = "perception.pose.d_allow_px", "perception.pose.theta_allow_deg"
SECTIONS = {section.key: section for section in schema().walk()}


@pytest.fixture
def draft() -> SettingsDraft:
    return SettingsDraft(load_config())


@pytest.mark.parametrize(
    ("key", "entry", "message"),
    [
        (D_ALLOW, "", "must not be empty; allowed: above 0 and at most 200 px"),
        (D_ALLOW, "wide", "not a number; allowed: above 0 and at most 200 px"),
        (D_ALLOW, "0", "must be above 0 and at most 200 px"),
        (D_ALLOW, "200.1", "must be above 0 and at most 200 px"),
        (D_ALLOW, "nan", "not a finite number; allowed: above 0 and at most 200 px"),
        (D_ALLOW, "1e999", "not a finite number; allowed: above 0 and at most 200 px"),
        ("camera.width_px", "640.5", "must be a whole number; allowed: 160 to 4096 px"),
        ("camera.pixel_format", "mjpg", "has not the right form: webcam: FOURCC; MJPG is what USB 2 has the room for"),
        ("perception.gaps.rule", "nearest", "must be one of: components, every_pair"),
        ("rig.name", " ", "must not be empty"),
    ],
)
def test_what_is_not_allowed_has_one_message_and_changes_nothing(draft: SettingsDraft, key: str, entry: str, message: str) -> None:
    before = draft.value(key)
    assert draft.set_entry(key, entry) == message
    assert draft.error(key) == message
    assert draft.value(key) == before
    assert draft.entry(key) == entry
    assert draft.config is None
    assert draft.first_problem == (key, message)
    draft.reset([key])
    assert draft.config == load_config()
    assert not draft.is_dirty


@pytest.mark.parametrize(
    ("key", "entry", "value"),
    [
        (D_ALLOW, "7.5", 7.5),
        (D_ALLOW, " 7,5 ", 7.5),
        (D_ALLOW, "2e1", 20.0),
        ("camera.width_px", "800", 800),
        ("camera.exposure_ms", "", None),
        ("camera.exposure_ms", "3", 3.0),
        ("perception.tracking.enabled", False, False),
        ("servos.joints.1.sign", -1, -1),
        ("rig.source", "/data/run 1.mp4", "/data/run 1.mp4"),
    ],
)
def test_what_is_allowed_is_taken(draft: SettingsDraft, key: str, entry: object, value: object) -> None:
    assert draft.set_entry(key, entry) == ""
    assert draft.value(key) == value
    assert draft.config is not None


def test_what_does_not_go_together_is_told_of_the_section(draft: SettingsDraft) -> None:
    draft.set_entry("safety.pose_disarm_s", "0.12")
    assert draft.section_error("safety") == "pose_hold_s must be below pose_disarm_s"
    assert draft.is_wrong_in(SECTIONS["safety"])
    assert draft.config is None
    assert draft.error("safety.pose_disarm_s") == ""
    draft.set_entry("safety.pose_hold_s", "0.1")
    assert draft.section_error("safety") == ""
    assert draft.config is not None
    draft.set_entry("servos.joints.1.id", "1")
    assert draft.first_problem == ("servos", "joints: two servos have the same id")


def test_marks_count_what_differs_from_the_default(draft: SettingsDraft) -> None:
    draft.set_entry(D_ALLOW, "9")
    draft.set_entry(THETA, "12")
    assert draft.is_changed(D_ALLOW)
    assert [draft.changed_in(SECTIONS[key]) for key in ("perception.pose", "perception", "safety")] == [2, 2, 0]
    draft.set_entry(D_ALLOW, "6")
    assert not draft.is_changed(D_ALLOW)
    draft.reset(setting.key for setting in SECTIONS["perception"].all_settings())
    assert not draft.is_dirty


def test_a_section_whose_values_need_each_other_is_reset_as_a_whole() -> None:
    tight = Config.model_validate({"twin": {"phantom": "tree"}, "safety": {"pose_hold_s": 0.06, "pose_disarm_s": 0.12}})
    draft = SettingsDraft(tight)
    draft.reset(["safety.pose_hold_s"])
    assert draft.section_error("safety")
    draft.reset(setting.key for setting in SECTIONS["safety"].all_settings())
    assert draft.config == load_config()


def test_when_changes_act(draft: SettingsDraft) -> None:
    assert draft.effects() == set()
    draft.set_entry(D_ALLOW, "9")
    draft.set_entry("advice.fast_mm_s", "9")
    draft.set_entry("record.codec", "lossless")
    assert draft.effects() == {Effect.NOW, Effect.RIG, Effect.PROGRAM}
    draft.mark_saved()
    assert draft.effects() == set()
    assert draft.is_changed(D_ALLOW), "saved, but still not the default"


def test_changes_reach_a_running_configuration_that_has_more_from_elsewhere() -> None:
    before = load_config()
    draft = SettingsDraft(before)
    draft.set_entry(D_ALLOW, "9")
    draft.set_entry("advice.fast_mm_s", "9")
    after = draft.config
    assert after is not None
    running = load_config(overrides={"twin": {"phantom": "random:7"}})
    now = with_changes(running, before, after, frozenset({Effect.NOW}))
    assert (now.perception.pose.d_allow_px, now.advice.fast_mm_s, now.twin.phantom) == (9.0, 8.0, "random:7")
    both = with_changes(running, before, after, frozenset({Effect.NOW, Effect.RIG}))
    assert (both.advice.fast_mm_s, both.twin.phantom) == (9.0, "random:7")


def test_what_was_chosen_after_saving_is_the_newer_wish() -> None:
    before, after = load_config(), load_config(overrides={"twin": {"phantom": "coil"}})
    window_then = load_config()
    picked = load_config(overrides={"twin": {"phantom": "random:7"}})
    opened = with_changes(picked, before, after, frozenset(Effect), since=window_then)
    assert opened.twin.phantom == "random:7"
    assert with_changes(window_then, before, after, frozenset(Effect), since=window_then).twin.phantom == "coil"


def test_changes_that_do_not_go_together_with_what_runs_are_left_out() -> None:
    after = Config.model_validate({"twin": {"phantom": "tree"}, "safety": {"pose_disarm_s": 0.2}})
    running = Config.model_validate({"safety": {"frame_hold_s": 0.1}, "twin": {"phantom": "tree"}})
    clash = Config.model_validate({"twin": {"phantom": "tree"}, "safety": {"pose_hold_s": 0.1, "pose_disarm_s": 0.15}})
    assert with_changes(running, load_config(), after, frozenset(Effect)).safety.pose_disarm_s == 0.2
    stiff = running.model_copy(update={"safety": running.safety.model_copy(update={"frame_hold_s": 9.0})})
    assert with_changes(stiff, load_config(), clash, frozenset(Effect)) is stiff


@pytest.mark.parametrize(
    ("words", "key"),
    [
        ("d_allow", D_ALLOW),
        ("hysteresis °", "perception.pose.hysteresis_deg"),
        ("MM/S² feed", "policy.drive.max_acceleration_mm_s2"),
        ("pedal port", "pedal.port"),
        ("foot silence", "pedal.silence_s"),
    ],
)
def test_search_looks_at_name_meaning_unit_and_section(words: str, key: str) -> None:
    assert key in {setting.key for _, settings in search(words) for setting in settings}


def test_a_rig_whose_robot_has_another_shape_is_shown_and_its_joints_stay(draft: SettingsDraft) -> None:
    rig = {"name": "three", "camera": "twin", "robot": "twin", "file": "three.toml"}
    running = Config.model_validate({**load_config().model_dump(), "rig": rig, "servos": THREE.model_dump()})
    draft.show_rig(running)
    assert draft.value("servos.joints.0.high_mm") == 2.8
    assert draft.entry("servos.joints.6.high_mm") == "", "it has four joints"
    joints = [section for section in schema().walk() if section.key.startswith("servos.joints.")]
    assert [draft.title(one) for one in joints] == [
        "Joint tendon 1",
        "Joint tendon 2",
        "Joint tendon 3",
        "Joint advance",
        *[""] * 3,
    ]
    after = Config.model_validate({**load_config().model_dump(), "hand": {"advance_mm_s": 5.0}})
    changed = with_changes(running, load_config(), after, frozenset({Effect.RIG}))
    assert (changed.hand.advance_mm_s, changed.servos) == (5.0, THREE)
