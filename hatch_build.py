"""Build hook: writes the commit that a package is built from into it (``core/program.py`` reads it)."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CommitHook(BuildHookInterface[Any]):
    """Adds the file ``commit``: of git, or of the source archive that the wheel is built from."""

    _folder: tempfile.TemporaryDirectory[str] | None = None

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        root = Path(self.root)
        kept = root / "commit"
        if not kept.is_file():
            self._folder = tempfile.TemporaryDirectory()
            kept = Path(self._folder.name) / "commit"
            kept.write_text(_commit_of(root), encoding="ascii")
        build_data["force_include"][str(kept)] = "commit" if self.target_name == "sdist" else "lumenpilot/commit"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if self._folder is not None:
            self._folder.cleanup()


def _commit_of(root: Path) -> str:
    """With "+" when files differ from it; "" without git."""
    command = ["git", "-C", str(root), "describe", "--always", "--exclude=*", "--dirty=+", "--abbrev=12"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.SubprocessError):
        return ""
