"""Named profiles in the user's folder, beside the presets that come with the program."""

from pathlib import Path

import pytest

from core.config.files import Profile, ProfileError, Profiles, check_name, own_config, own_settings_path, settings_of_windows
from core.config.models import Config, load_config

BRIGHT = Config.model_validate({"twin": {"phantom": "tree"}, "window": {"theme": "light"}})


def names(profiles: Profiles) -> list[str]:
    return [profile.name for profile in profiles.all()]


def test_presets_come_first_and_cannot_be_changed(tmp_path: Path) -> None:
    profiles = Profiles(tmp_path / "profiles")
    (paper,) = profiles.all()
    assert (paper.name, paper.is_preset) == ("paper", True)
    assert profiles.load(paper).config == load_config(preset="paper")
    with pytest.raises(ProfileError, match="cannot be deleted"):
        profiles.delete(paper)
    with pytest.raises(ProfileError, match="a preset has this name"):
        profiles.save("Paper", BRIGHT)
    assert paper.path.is_file()


def test_save_choose_and_delete(tmp_path: Path) -> None:
    profiles = Profiles(tmp_path / "profiles")
    saved, note = profiles.save("  bench of May ", BRIGHT)
    assert (saved.name, note) == ("bench of May", "")
    assert names(profiles) == ["paper", "bench of May"]
    assert profiles.exists("bench of May")
    assert profiles.load(saved).config == BRIGHT
    assert profiles.matching(BRIGHT) == saved
    assert profiles.matching(load_config()) is None
    profiles.delete(saved)
    assert names(profiles) == ["paper"]
    profiles.delete(saved)  # it is gone already, which is what was wanted
    with pytest.raises(ProfileError, match="no longer there"):
        profiles.load(saved)


@pytest.mark.parametrize("name", ["", "  ", "../up", ".hidden", "a/b", "x" * 61, "a\nb", "-", "con:1"])
def test_names_that_make_no_file_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ProfileError, match="1 to 60 letters"):
        check_name(name)
    with pytest.raises(ProfileError):
        Profiles(tmp_path).save(name, BRIGHT)
    assert list(tmp_path.iterdir()) == []


def test_names_of_any_language_are_fine() -> None:
    assert check_name("Prüfstand 2 (neu)") == "Prüfstand 2 (neu)"
    assert check_name("实验") == "实验"


def test_a_damaged_profile_is_told_and_does_not_stand_in_the_way(tmp_path: Path) -> None:
    profiles = Profiles(tmp_path)
    path = tmp_path / "old.toml"
    path.write_text("[broken", encoding="utf-8")
    assert profiles.matching(BRIGHT) is None
    file = profiles.load(Profile("old", path))
    assert "is no TOML" in file.problems[0]
    assert file.config == load_config()
    assert [one.name.startswith("old.toml.bad-") for one in tmp_path.iterdir()] == [True]


def test_a_disk_that_does_not_take_a_profile_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(ProfileError, match="cannot be written"):
        Profiles(tmp_path / "file").save("mine", BRIGHT)


def test_the_windows_begin_with_the_users_own_settings_or_a_named_file(tmp_path: Path) -> None:
    assert settings_of_windows().path == own_settings_path()
    assert own_settings_path().name == "settings.toml"
    named = tmp_path / "study.toml"
    named.write_text("[broken", encoding="utf-8")
    assert settings_of_windows(named).problems
    assert named.is_file(), "a named file is never moved"
    assert own_config() == load_config()
