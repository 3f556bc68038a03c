"""The exporters of sessions, by the ending of the file or folder that they write: the program's own, and those of plugins."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NamedTuple, Protocol, cast

from core.plugins import PluginKind
from core.session.manifest import SessionError
from core.session.reader import SessionReader


class Export(Protocol):
    """Writes a session to `path`, which must not be there; calls `on_row` after every row. Returns how many items it wrote."""

    def __call__(self, reader: SessionReader, path: Path, *, on_row: Callable[[], None]) -> int: ...


class Exporter(NamedTuple):
    """The items that an exporter counts, and its function as ``module:name``, which is imported when it is used."""

    items: str
    function: str


EXPORTERS = {
    "mp4": Exporter("pictures", "core.session.export:export_mp4"),
    "csv": Exporter("rows", "core.session.export:export_csv"),
    "mcap": Exporter("messages", "core.session.mcap_export:export_mcap"),
    "ros2.mcap": Exporter("messages", "core.session.mcap_export:export_ros2"),
    "lerobot": Exporter("frames", "core.session.lerobot_export:export_lerobot"),
}
"""The program's own exporters by ending, without its dot."""
PLUGINS = PluginKind("exporters", tuple(EXPORTERS))


def exporter_name(path: Path) -> str:
    """The longest ending of `path` that an exporter has. Raises SessionError."""
    name = path.name.lower()
    fitting = [ending for ending in PLUGINS.names if name.endswith(f".{ending.lower()}")]
    if not fitting:
        known = ", ".join(f".{ending}" for ending in PLUGINS.names)
        raise SessionError(f"{path}: unknown format; the ending must be one of {known}")
    return max(fitting, key=len)


def items_of(name: str) -> str:
    """What an exporter counts."""
    return EXPORTERS[name].items if name in EXPORTERS else "items"


def export_session(reader: SessionReader, path: Path, on_row: Callable[[], None]) -> int:
    """Write a session by the exporter of `path`'s ending. Returns how many items it wrote.

    Raises SessionError; PluginError for whatever a plugin raises.
    """
    name = exporter_name(path)
    if name not in EXPORTERS:
        export = cast(Export, PLUGINS.load(name))
        with PLUGINS.blame(name):
            return int(export(reader, path, on_row=on_row))
    module, _, function = EXPORTERS[name].function.partition(":")
    own: Export = getattr(import_module(module), function)
    return own(reader, path, on_row=on_row)
