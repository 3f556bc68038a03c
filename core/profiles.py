"""The user's own settings and named profiles, as TOML files in the user's configuration folder."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import platformdirs

from core.config import RESOURCES, Config, ConfigError, load_config
from core.config_write import write_settings
from core.errors import UserError
from core.settings_file import SettingsFile, read_settings

_NAME = re.compile(r"^[\w][\w .()+-]{0,59}$")
_ENDING = ".toml"


class ProfileError(UserError):
    """A profile cannot be saved, found or deleted; one line says what to do."""


def settings_folder() -> Path:
    """Where the program keeps what the user set; it need not exist."""
    return Path(platformdirs.user_config_dir("LumenPilot", appauthor=False))


def own_settings_path() -> Path:
    """The settings of the windows when no other file is named."""
    return settings_folder() / "settings.toml"


def settings_of_windows(named: Path | None = None) -> SettingsFile:
    """The settings that a window begins with and its dialog writes: of a file that was named, else the user's own.

    What is wrong with the user's own is among its problems; a named file is left where it is, whatever is wrong with it.
    """
    return read_settings(named or own_settings_path(), may_move=named is None)


def own_config() -> Config:
    """The user's own configuration, for a window that has no settings to change; no file is touched."""
    return read_settings(own_settings_path(), may_move=False).config


@dataclass(frozen=True, slots=True)
class Profile:
    """A named set of settings. Presets come with the program and cannot be changed."""

    name: str
    path: Path
    is_preset: bool = False


class Profiles:
    """The profiles in a folder, and the presets that come with the program."""

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder if folder is not None else settings_folder() / "profiles"

    @property
    def folder(self) -> Path:
        """Where the user's profiles are."""
        return self._folder

    def all(self) -> tuple[Profile, ...]:
        """Presets first, then the user's by name; a folder that cannot be read has none."""
        presets = sorted((RESOURCES / "config").glob(f"preset_*{_ENDING}"))
        try:
            own = sorted((p for p in self._folder.glob(f"*{_ENDING}") if p.is_file()), key=lambda p: p.stem.casefold())
        except OSError:
            own = []
        shipped = [Profile(path.stem.removeprefix("preset_"), path, is_preset=True) for path in presets]
        return (*shipped, *(Profile(path.stem, path) for path in own if _NAME.match(path.stem)))

    def load(self, profile: Profile) -> SettingsFile:
        """Its settings. Raises ProfileError when it is gone; what else is wrong with it is among the file's problems."""
        if not profile.path.is_file():
            raise ProfileError(f"profile {profile.name}: it is no longer there ({profile.path})")
        return read_settings(profile.path)

    def save(self, name: str, config: Config) -> tuple[Profile, str]:
        """Save under a name, over an older one of that name.

        Returns
        -------
        profile : as saved.
        note : empty, or one line about where a damaged older file is kept.

        Raises
        ------
        ProfileError
            No usable name, or the disk does not take it.
        """
        name = check_name(name)
        if any(profile.is_preset and profile.name.casefold() == name.casefold() for profile in self.all()):
            raise ProfileError(f"profile {name}: a preset has this name; choose another one")
        profile = Profile(name, self._folder / f"{name}{_ENDING}")
        try:
            return profile, write_settings(profile.path, config)
        except ConfigError as error:
            raise ProfileError(str(error)) from None

    def delete(self, profile: Profile) -> None:
        """Delete one of the user's. Raises ProfileError."""
        if profile.is_preset:
            raise ProfileError(f"profile {profile.name}: it comes with the program and cannot be deleted")
        try:
            profile.path.unlink()
        except FileNotFoundError:
            pass
        except OSError as error:
            raise ProfileError(f"profile {profile.name}: cannot be deleted ({error.strerror})") from None

    def exists(self, name: str) -> bool:
        """Whether the user has one of this name."""
        return (self._folder / f"{name.strip()}{_ENDING}").is_file()

    def matching(self, config: Config) -> Profile | None:
        """The first profile that says exactly `config`, None when none does."""
        for profile in self.all():
            try:
                if load_config(profile.path) == config:
                    return profile
            except ConfigError:  # it says so when it is chosen
                continue
        return None


def check_name(name: str) -> str:
    """The name without blanks around it. Raises ProfileError for one that makes no good file name."""
    name = name.strip()
    if not _NAME.match(name):
        raise ProfileError("a profile's name has 1 to 60 letters, digits, or - _ . ( ) +, and begins with a letter or digit")
    return name
