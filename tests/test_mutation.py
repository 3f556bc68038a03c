"""The mutation script: its mutants are changes of today's code, and what it explains away is still among them."""

from __future__ import annotations

import ast
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def mutation() -> ModuleType:
    spec = importlib.util.spec_from_file_location("mutation_script", ROOT / "scripts" / "mutation.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclass asks for its own module
    spec.loader.exec_module(module)
    return module


def test_a_small_module_has_all_its_mutants(mutation: ModuleType) -> None:
    source = "def f(a, b):\n    if a > 1 and not b:\n        return min(a, -b)\n    return 0\n"
    found = {mutant.change: mutant.source.splitlines() for mutant in mutation.mutants("gate", source)}
    assert found["Gt -> GtE"][1] == "    if a >= 1 and (not b):"
    assert found["And -> Or"][1] == "    if a > 1 or not b:"
    assert found["without term 1"][1] == "    if not b:"
    assert found["without Not"][1] == "    if a > 1 and b:"
    assert found["if True"][1] == "    if True:"
    assert found["min -> max"][2] == "        return max(a, -b)"
    assert found["without USub"][2] == "        return min(a, b)"
    assert found["returns None"][2] == "        return None"
    assert found["1 -> 2"][1] == "    if a > 2 and (not b):"
    assert found["0 -> 1"][3] == "    return 1"


def test_every_explained_survivor_is_a_change_of_todays_code(mutation: ModuleType) -> None:
    known = set()
    for module, tests in mutation.TESTS.items():
        source = (ROOT / mutation.FOLDER / f"{module}.py").read_text(encoding="utf-8")
        same = ast.unparse(ast.parse(source))
        for mutant in mutation.mutants(module, source):
            assert mutant.source != same, f"{module}:{mutant.number}: {mutant.change}"
            known.add((module, mutant.line, mutant.change))
        assert all((ROOT / "tests" / "core" / name).exists() for name in (*tests, *mutation.LONG_TESTS))
    assert mutation.EXPLAINED.keys() <= known


def test_an_unknown_module_is_one_line(mutation: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert mutation.main(["pedal"]) == 2
    assert capsys.readouterr().err == "unknown: pedal; known are gate, gate_checks, joint_limits, supervisor, health\n"
