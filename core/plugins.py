"""Plugins: cameras, drives, policies and exporters that other installed packages add, by the entry points of their package.

Names are checked without importing anything; a plugin is imported when it is used. The program's own names cannot be replaced.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Any

from core.devices import DeviceError, UserError

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema


class PluginError(DeviceError):
    """A plugin cannot be used; the message names its package."""


@cache
def _found(group: str, _path: tuple[str, ...]) -> dict[str, EntryPoint]:
    """Entry points of a group by name. Reading the metadata of all packages takes 15 to 150 ms."""
    return {entry.name: entry for entry in entry_points(group=group)}


@dataclass(frozen=True, slots=True)
class PluginKind:
    """What can be added of one kind. ``Annotated[str, kind]`` is a setting that holds one of its names.

    Attributes
    ----------
    group : of the entry points, without "lumenpilot.".
    own : names of the program itself.
    needs : methods that an object made by such a plugin must have.
    """

    group: str
    own: tuple[str, ...]
    needs: tuple[str, ...] = ()

    def _entries(self) -> dict[str, EntryPoint]:
        return {name: entry for name, entry in _found(f"lumenpilot.{self.group}", tuple(sys.path)).items() if name not in self.own}

    @property
    def plugins(self) -> tuple[str, ...]:
        """Names of plugins."""
        return tuple(sorted(self._entries()))

    @property
    def names(self) -> tuple[str, ...]:
        """The program's own names, then those of plugins."""
        return (*self.own, *self.plugins)

    def check(self, name: str) -> str:
        """Return `name`. Raises ValueError: one line with all names that there are."""
        if name not in self.own and name not in self._entries():
            raise ValueError(f"must be one of {', '.join(self.names)}; others come with the package of a plugin")
        return name

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        from pydantic_core import core_schema

        return core_schema.no_info_after_validator_function(self.check, handler(source))

    def load(self, name: str) -> Any:
        """Import what a plugin's entry point names. Raises PluginError."""
        with self.blame(name):
            return self._entries()[name].load()

    def make(self, name: str, *values: Any) -> Any:
        """Call what a plugin's entry point names, and check that the result has the methods ``needs``. Raises UserError."""
        make = self.load(name)
        with self.blame(name):
            made = make(*values)
            if missing := [method for method in self.needs if not callable(getattr(made, method, None))]:
                raise TypeError(f"what it makes has no {', '.join(missing)}")
        return made

    @contextmanager
    def blame(self, name: str) -> Iterator[None]:
        """Turn whatever a plugin's code raises, besides UserError, into PluginError."""
        entry = self._entries().get(name)
        if entry is None:
            raise PluginError(f"{name}: no such plugin among {self.group}; there are: {', '.join(self.names)}")
        try:
            yield
        except UserError:
            raise
        except Exception as error:  # foreign code: all that it raises becomes one line that names its package
            package = f"{entry.dist.name} {entry.dist.version}" if entry.dist is not None else entry.value
            text = " ".join(f"{type(error).__name__}: {error}".split())
            raise PluginError(f"plugin {name} of the package {package} failed ({text}); ask its author, or uninstall it") from error
