"""The schema knows every setting of the configuration, with unit, range and meaning."""

from typing import Any

import pytest

from core.config.models import load_config
from core.config.schema import Bounds, Effect, FieldKind, schema, settings_by_key, value_at, with_value


def leaves(data: Any, key: str = "") -> set[str]:
    if isinstance(data, dict):
        return {leaf for name, value in data.items() for leaf in leaves(value, f"{key}.{name}" if key else name)}
    if isinstance(data, list):
        return {leaf for place, value in enumerate(data) for leaf in leaves(value, f"{key}.{place}")}
    return {key}


def test_no_setting_is_left_out() -> None:
    known = set(settings_by_key())
    names = {f"servos.joints.{place}.{what}" for place in range(7) for what in ("name", "kind", "angle_deg")}
    names |= {"twin.behaviour"}  # measured
    assert leaves(load_config().model_dump(mode="json")) - names == known


def test_every_setting_says_what_it_means_and_every_number_its_range() -> None:
    for key, setting in settings_by_key().items():
        assert setting.description, key
        assert setting.title, key
        if setting.kind in (FieldKind.NUMBER, FieldKind.WHOLE):
            assert setting.bounds.low is not None, key
            assert setting.bounds.high is not None, key
    assert all(section.description for section in schema().walk() if section.key)


@pytest.mark.parametrize(
    ("key", "kind", "unit", "range_text", "effect"),
    [
        ("perception.pose.d_allow_px", FieldKind.NUMBER, "px", "above 0 and at most 200 px", Effect.NOW),
        ("perception.pose.theta_allow_deg", FieldKind.NUMBER, "°", "above 0 and at most 180 °", Effect.NOW),
        ("perception.segmentation.vessel_threshold", FieldKind.NUMBER, "", "above 0 and below 1", Effect.NOW),
        ("perception.segmentation.model", FieldKind.TEXT, "", "", Effect.RIG),
        ("perception.working_size_px", FieldKind.WHOLE, "px", "128 to 4096 px", Effect.RIG),
        ("advice.fast_mm_s", FieldKind.NUMBER, "mm/s", "0 to 50 mm/s", Effect.RIG),
        ("policy.drive.max_acceleration_mm_s2", FieldKind.NUMBER, "mm/s²", "above 0 and at most 1000 mm/s²", Effect.RIG),
        ("perception.cleaning.min_robot_area_px", FieldKind.WHOLE, "px²", "0 to 100000 px²", Effect.NOW),
        ("perception.gaps.rule", FieldKind.CHOICE, "", "components, every_pair", Effect.NOW),
        ("servos.joints.3.sign", FieldKind.CHOICE, "", "-1, 1", Effect.RIG),
        ("rig.camera", FieldKind.CHOICE, "", "twin, realsense, webcam, basler, video_file, image_folder", Effect.PROGRAM),
        ("window.theme", FieldKind.CHOICE, "", "dark, light, system", Effect.NOW),
        ("window.language", FieldKind.CHOICE, "", "auto, en, zh", Effect.PROGRAM),
        ("safety.pose_hold_s", FieldKind.NUMBER, "s", "0.05 to 0.15 s", Effect.RIG),
    ],
)
def test_settings_as_they_are_shown(key: str, kind: FieldKind, unit: str, range_text: str, effect: Effect) -> None:
    setting = settings_by_key()[key]
    assert (setting.kind, setting.unit, setting.range_text, setting.effect) == (kind, unit, range_text, effect)


def test_optional_settings_are_known() -> None:
    assert settings_by_key()["camera.exposure_ms"].is_optional
    assert not settings_by_key()["camera.width_px"].is_optional


def test_ranges_in_words() -> None:
    assert Bounds(0, 10).text("mm") == "0 to 10 mm"
    assert Bounds(0, None).text() == "at least 0"
    assert Bounds(None, 5, high_open=True).text("s") == "below 5 s"
    assert Bounds().text("s") == ""


def test_sections_are_a_tree_with_the_joints_by_name() -> None:
    titles = {section.key: section.title for section in schema().walk()}
    assert titles["perception.pose"] == "Pose state"
    assert titles["servos.joints.0"] == "Joint right"
    assert titles["servos.joints.6"] == "Joint delivery 2"


def test_values_at_dotted_paths() -> None:
    data = {"a": {"b": [{"c": 1}, {"c": 2}]}}
    assert value_at(data, "a.b.1.c") == 2
    changed = with_value(data, "a.b.1.c", 3)
    assert value_at(changed, "a.b.1.c") == 3
    assert data["a"]["b"][1]["c"] == 2
    with pytest.raises(KeyError):
        value_at(data, "a.b.2.c")
