"""The house's rules that no linter knows: pins, the network's silence, licence, Makefile, text without leftovers."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

from packaging.markers import Marker
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tools import lock

ROOT = Path(__file__).resolve().parent.parent
OURS = ("app", "core", "hardware")
TEXT = {".py", ".toml", ".md", ".sh", ".yaml", ".lock", ".json", ".cfg", ".txt", ".css", ""}


def sources(*folders: str) -> list[Path]:
    return [ROOT / "main.py", *(path for folder in folders for path in sorted((ROOT / folder).rglob("*.py")))]


def tracked_text() -> list[Path]:
    """Text files of the repository, tracked or about to be; without git (an unpacked archive) all that is not a cache."""
    listing = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", "-z"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listing.returncode == 0:
        names = [name for name in listing.stdout.split("\0") if name]
    else:
        folders = (*OURS, "tests", "scripts", "docs", "resources")
        names = [str(path.relative_to(ROOT)) for folder in folders for path in (ROOT / folder).rglob("*")]
    return [ROOT / name for name in names if Path(name).suffix in TEXT and (ROOT / name).is_file() and "__pycache__" not in name]


def pins() -> dict[str, str]:
    """Canonical package name -> version of every line in requirements.lock that is for this Python."""
    found = {}
    for line in (ROOT / "requirements.lock").read_text(encoding="utf-8").replace("\\\n", " ").splitlines():
        if line and not line.startswith("#"):
            match = re.fullmatch(r"([\w.-]+)==([0-9][0-9a-z.]*)(?: ; ([^-]*?))?((?: +--hash=sha256:[0-9a-f]{64})*) *", line)
            assert match, f"not an exact pin: {line!r}"
            assert match[4] or match[1] == "torch", f"no hash: {line!r}"
            if match[3] is None or Marker(match[3]).evaluate():
                assert canonicalize_name(match[1]) not in found, f"pinned twice: {line!r}"
                found[canonicalize_name(match[1])] = match[2]
    return found


LOCKED = lock.EXTRAS
"""Extras that set-up installs."""


def asked_for() -> set[str]:
    """What pyproject.toml names, and set-up installs: to run and to test."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    lines = project["project"]["dependencies"] + project["dependency-groups"]["test"]
    lines += [line for extra in LOCKED for line in project["project"]["optional-dependencies"][extra]]
    return {canonicalize_name(Requirement(line).name) for line in lines}


def extras() -> set[str]:
    """What pyproject.toml names as optional, and is neither pinned nor installed by set-up."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    lines = [line for extra in project["project"]["optional-dependencies"].values() for line in extra]
    return {canonicalize_name(Requirement(line).name) for line in lines} - asked_for()


def needs(package: str) -> set[str]:
    """What an installed package needs here; torch's CUDA packages are left to torch."""
    lines = [Requirement(line) for line in metadata.requires(package) or []]
    names = {canonicalize_name(line.name) for line in lines if line.marker is None or line.marker.evaluate({"extra": ""})}
    return {name for name in names if not name.startswith(("nvidia-", "cuda-", "triton"))}


def imported_packages(paths: list[Path]) -> set[str]:
    tops = set()
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                tops.update(alias.name.partition(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
                tops.add(node.module.partition(".")[0])
    return tops - set(sys.stdlib_module_names) - {*OURS, "tests"}


def test_every_import_is_asked_for_by_name() -> None:
    owners = metadata.packages_distributions()
    for top in sorted(imported_packages(sources(*OURS))):
        names = {canonicalize_name(name) for name in owners.get(top, [top])}
        assert names & (asked_for() | extras()), f"{top} is imported, but pyproject.toml does not ask for {names or 'it'}"


def test_the_lock_is_closed() -> None:
    """All that is asked for, and all that those need in turn, is pinned; and nothing else is."""
    reached, waiting = set(), sorted(asked_for())
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            # openvino-telemetry needs nothing, and set-up removes it: it has no metadata to ask
            waiting.extend(needs(name) if name != "openvino-telemetry" else ())
    assert set(pins()) == reached
    assert not extras() & reached


def test_set_up_leaves_optional_packages_alone() -> None:
    script = (ROOT / "scripts" / "set_up.sh").read_text(encoding="utf-8")
    (kept,) = re.findall(r"listed - \{(.*)\}", script)
    assert extras() <= set(re.findall(r'"([^"]+)"', kept))


def test_what_is_installed_is_what_is_pinned() -> None:
    installed = {name: metadata.version(name).partition("+")[0] for name in pins() if name != "openvino-telemetry"}
    assert installed == {name: version for name, version in pins().items() if name != "openvino-telemetry"}


def test_the_lock_forces_no_index_and_no_cuda() -> None:
    text = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    assert not re.search(r"^(--|-[a-z] |nvidia)", text, re.MULTILINE)
    for path in [ROOT / "Makefile", ROOT / ".ci" / "run", *(ROOT / "scripts").glob("*.sh")]:
        assert not re.search(r"--(extra-)?index-url|--find-links|--trusted-host|https?://", path.read_text(encoding="utf-8")), path


def test_openvino_is_silenced_before_it_is_imported() -> None:
    """A plain ``import openvino`` reports itself over the network; with its telemetry package blocked it takes a stub instead."""
    for path in sources(*OURS):
        source = path.read_text(encoding="utf-8")
        imports = re.search(r"^\s*(import|from) openvino\b", source, re.MULTILINE)
        blocked = source.find('sys.modules["openvino_telemetry"] = None')
        assert imports is None or 0 <= blocked < imports.start(), f"{path}: block openvino_telemetry before importing openvino"


def test_the_licence_is_mit() -> None:
    text = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert text.startswith("MIT License") and "2026 LumenPilot contributors" in text


def test_the_makefile_offers_what_the_readme_promises() -> None:
    targets = set(re.findall(r"^([a-z]+):.*## ", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    assert targets >= {"run", "test", "lint", "clean", "setup", "help"}


def test_ci_is_executable() -> None:
    assert (ROOT / ".ci" / "run").stat().st_mode & 0o111


# Written in two parts, so that this file does not find itself.
LEFTOVERS = re.compile("TO" + r"DO|FIX" + r"ME|X" + r"XX\b|/(?:home|root|work|Users)" + r"/\w|/tmp" + r"/\w|file:" + "//")


def test_no_leftovers_and_no_machine_of_ours() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()[:100]}"
        for path in tracked_text()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if LEFTOVERS.search(line)
    ]
    assert not found, "\n".join(found)
