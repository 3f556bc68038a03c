"""The house's arrows: app -> hardware -> core, Qt in app only, every vendor's SDK in its own driver only."""

from __future__ import annotations

import ast
import sys
from collections import Counter
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
LAYERS = {"core": {"core"}, "hardware": {"hardware", "core"}, "app": {"app", "hardware", "core"}}
QT = {"PySide6", "shiboken6", "pyqtgraph"}

# Who may import what talks to a device, a simulator or the network. A folder stands for all files in it.
ONLY_IN = {
    "mujoco": ("hardware/twin",),
    "pyrealsense2": ("hardware/cameras",),
    "pypylon": ("hardware/cameras",),
    "dynamixel_sdk": ("hardware/servos",),
    "serial": ("hardware/servos", "hardware/inputs"),
    "PySide6": ("app",),
    "shiboken6": ("app",),
    "pyqtgraph": ("app",),
    "typer": ("app",),
    "rich": ("app",),
}


@cache
def modules() -> dict[str, Path]:
    """Our modules by dotted name; a package is called as its folder."""
    found = {}
    for layer in LAYERS:
        for path in sorted((ROOT / layer).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported_names(source: str, package: str) -> set[str]:
    """Dotted names that a source imports, wherever: at the top, in functions, under TYPE_CHECKING, by import_module("...")."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package.rsplit(".", node.level - 1)[0] if node.level else ""
            origin = ".".join(part for part in (base, node.module) if part)
            names.add(origin)
            names.update(f"{origin}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("import_module", "__import__", "importorskip")):
            names.update(arg.value for arg in node.args[:1] if isinstance(arg, ast.Constant) and isinstance(arg.value, str))
    return names


@cache
def imports_of(module: str) -> frozenset[str]:
    path = modules()[module]
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    return frozenset(imported_names(path.read_text(encoding="utf-8"), package))


@cache
def reached_from(module: str) -> dict[str, tuple[str, ...]]:
    """Top-level packages that importing `module` can lead to, each with the chain of our modules that leads there."""
    reached: dict[str, tuple[str, ...]] = {}
    seen, waiting = {module}, [(module, (module,))]
    while waiting:
        current, chain = waiting.pop()
        for name in imports_of(current):
            top = name.partition(".")[0]
            reached.setdefault(top, chain)
            if name in modules() and name not in seen:
                seen.add(name)
                waiting.append((name, (*chain, name)))
    return reached


def test_the_import_reader_sees_every_way_to_import() -> None:
    source = """
import a.b
from c import d
from . import e
from ..f import g
def late():
    import h
if TYPE_CHECKING:
    from i.j import k
importlib.import_module("l.m")
"""
    assert imported_names(source, "x.y") == {
        "a.b", "c", "c.d", "x.y", "x.y.e", "x.f", "x.f.g", "h", "i.j", "i.j.k", "l.m",
    }  # fmt: skip


def test_there_is_a_house() -> None:
    assert {name.partition(".")[0] for name in modules()} == set(LAYERS)


def test_arrows_run_one_way_and_no_qt_or_device_is_below_its_layer() -> None:
    """Core and hardware know no Qt; core knows no device, but codecs where sessions are, which are videos."""
    wrong = []
    for module in modules():
        layer = module.partition(".")[0]
        forbidden = set(LAYERS) - LAYERS[layer]
        if layer != "app":
            forbidden |= QT
        if layer == "core":
            forbidden |= {"mujoco", "pyrealsense2", "pypylon", "dynamixel_sdk", "serial"}
            forbidden |= set() if module.startswith("core.session") else {"av"}
        reached = reached_from(module)
        wrong += [f"{' -> '.join(reached[package])} -> {package}" for package in forbidden & reached.keys()]
    assert not wrong


@pytest.mark.parametrize("package", ONLY_IN)
def test_devices_stay_in_their_drivers(package: str) -> None:
    homes = [ROOT / folder for folder in ONLY_IN[package]]
    strays = [
        module
        for module, path in modules().items()
        if package in {name.partition(".")[0] for name in imports_of(module)}
        and not any(path.is_relative_to(home) for home in homes)
    ]
    assert not strays, f"{package} belongs in {' or '.join(ONLY_IN[package])}"


def test_packages_hold_nothing_themselves() -> None:
    full = [str(path.relative_to(ROOT)) for path in modules().values() if path.name == "__init__.py" and path.read_text().strip()]
    assert not full, "__init__.py is empty in this house"


def test_no_public_class_name_occurs_twice() -> None:
    places: dict[str, set[str]] = {}
    for module, path in modules().items():
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, set()).add(module)
    assert not {name: found for name, found in places.items() if len(found) > 1}


def test_folders_fit_on_a_screen() -> None:
    sizes = Counter(path.parent.relative_to(ROOT).as_posix() for path in modules().values() if path.read_text(encoding="utf-8"))
    assert not {folder: size for folder, size in sizes.items() if size > 25}


def ours_imported_by(module: str) -> set[str]:
    return {
        name for name in imports_of(module) if name in modules() and name != module and not modules()[name].name.startswith("__")
    }


def test_imports_have_no_cycles() -> None:
    """Imports in functions and for type checking count, too."""
    sorter = TopologicalSorter({module: ours_imported_by(module) for module in modules()})
    try:
        sorter.prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_no_small_file_serves_one_neighbour_alone() -> None:
    """A file under 80 lines that one file of its own folder imports is a part of it; commands are imported by name."""
    importers: dict[str, set[str]] = {}
    for module in modules():
        for name in ours_imported_by(module):
            importers.setdefault(name, set()).add(module)
    small = [
        module
        for module, path in modules().items()
        if 0 < path.read_text(encoding="utf-8").count("\n") < 80
        and not module.startswith("app.commands.")
        and [name.rpartition(".")[0] for name in importers.get(module, ())] == [module.rpartition(".")[0]]
    ]
    assert not small


def test_every_folder_with_code_is_a_package() -> None:
    bare = {str(path.parent.relative_to(ROOT)) for path in modules().values() if not (path.parent / "__init__.py").is_file()}
    assert not bare


def test_main_only_hands_over() -> None:
    tree = ast.parse((ROOT / "main.py").read_text(encoding="utf-8"))
    ours = {name for name in imported_names(ast.unparse(tree), "") if name.partition(".")[0] not in sys.stdlib_module_names}
    assert ours == {"app.cli", "app.cli.main"}
    assert not [node for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)]
