"""The mutation tool: its mutants are changes of today's code, and what it explains away is still among them."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

import pytest

from tools import mutation

ROOT = Path(__file__).parents[2]


def test_a_small_module_has_all_its_mutants() -> None:
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


@pytest.mark.slow
def test_every_explained_survivor_is_a_change_of_todays_code() -> None:
    known: Counter[tuple[str, str, str]] = Counter()
    for module in mutation.TESTS:
        source = (ROOT / mutation.path_of(module)).read_text(encoding="utf-8")
        same = "\n".join(map(ast.unparse, ast.parse(source).body))
        for mutant in mutation.mutants(module, source):
            assert mutant.source != same, f"{module}:{mutant.number}: {mutant.change}"
            known[module, mutant.line, mutant.change] += 1
        assert all((ROOT / name).exists() for names in mutation.tests_of(module) for name in names)
    assert {key: known[key] for key in mutation.EXPLAINED} == dict.fromkeys(mutation.EXPLAINED, 1), "one change each"


def test_a_survivor_without_an_explanation_is_a_failure(capsys: pytest.CaptureFixture[str]) -> None:
    key = next(iter(mutation.EXPLAINED))
    explained = mutation.Mutant(key[0], 3, key[1], key[2], "")
    new = mutation.Mutant("gate", 7, "if a > b:", "Gt -> GtE", "")
    fate = mutation.Fate
    assert mutation.report([(explained, fate.SURVIVES), (new, fate.FOUND), (new, fate.HANGS)]) == 0
    assert "3 mutants, 1 found by tests, 1 by tests that stand still, 1 survive, 0 of them unexplained" in capsys.readouterr().out
    assert mutation.report([(explained, fate.SURVIVES), (new, fate.SURVIVES)]) == 1
    assert "core/control/gate.py:7: Gt -> GtE\n    if a > b:\n    NOT EXPLAINED" in capsys.readouterr().out
