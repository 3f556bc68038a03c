"""``make mutation``: does a test fail for every small change of the code that safety rests on?

Each mutant of gate and supervisor differs from the code in one place: a comparison, an operator, a condition, a number, a returned
value. Its own unit tests are run against it, then the long ones (state machines, pilot). A mutant that they all pass is a survivor:
either a test is missing, or the change changes nothing, which ``EXPLAINED`` has to say. Ends with 1 when a survivor is unexplained.

Works on copies in a temporary folder; takes a quarter of an hour on two cores. `python scripts/mutation.py NAME ...` does only the
modules of these names.
"""

from __future__ import annotations

import ast
import copy
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import Queue

from rich.progress import Progress

ROOT = Path(__file__).resolve().parent.parent
FOLDER = "core/control"
TESTS = {
    "gate": ("test_gate.py",),
    "gate_checks": ("test_gate.py",),
    "joint_limits": ("test_gate.py",),
    "supervisor": ("test_supervisor.py", "test_health.py"),
    "health": ("test_supervisor.py", "test_health.py"),
}
"""Module -> the tests that should find its mutants."""
LONG_TESTS = ("test_safety_machine.py", "test_pilot.py", "test_pilot_machine.py")
JOBS = len(os.sched_getaffinity(0))
TIMEOUT_S = 300.0

MISTRUST = "without a measurement to believe there is an objection already; it stands there for the type checker"
MOVING = "who moves has goals and a time; it stands there for the type checker"
TIE = "differs only where two numbers are equal to the last bit, a billionth of a millimetre apart"
TWICE = "a deadman that is not pressed neither counts nor is held: either place alone would do"
EXPLAINED = {
    ("gate", "if objection is not None or request is None or believed is None:", "without term 3"): MISTRUST,
    (
        "gate",
        "believed = tuple(measurement.positions_mm) if measurement is not None and mistrust is None else None",
        "without term 1",
    ): MISTRUST,
    ("gate", "if not self.moving or self.goals_mm is None or self.time_s is None:", "without term 2"): MOVING,
    ("gate", "if not self.moving or self.goals_mm is None or self.time_s is None:", "without term 3"): MOVING,
    ("gate", "if abs(goal_mm - from_mm) > joint.max_speed_mm_s * passed_s + _RECORDED_MM:", "Gt -> GtE"): TIE,
    ("gate", "if abs(asked - goal) > _RECORDED_MM", "Gt -> GtE"): TIE,
    ("gate", "if limit is not None and abs(asked_mm - goal_mm) > _RECORDED_MM:", "Gt -> GtE"): TIE,
    (
        "gate",
        "if limit is not None and abs(asked_mm - goal_mm) > _RECORDED_MM:",
        "without term 1",
    ): "a goal that no limit touched is the one asked for; it stands there for the type checker",
    ("joint_limits", "direction = 1.0 if asked_mm > last_mm else -1.0", "Gt -> GtE"): "where both are equal the step is 0",
    (
        "joint_limits",
        "to_end_mm = joint.high_mm - last_mm if direction > 0 else last_mm - joint.low_mm",
        "Gt -> GtE",
    ): "a direction is 1 or -1",
    (
        "joint_limits",
        "faster_mm_s = max(0.0, speed_mm_s * direction) + joint.max_acceleration_mm_s2 * passed_s",
        "Mult -> Div",
    ): "a direction is 1 or -1",
    ("joint_limits", "return inside_mm, Limit.STEP if abs(inside_mm - goal_mm) > _ROUNDING_MM else limit", "Gt -> GtE"): TIE,
    ("health", "reported_s: float = 0.0", "0.0 -> 1.0"): "nobody reads it before the first report",
    ("health", "counts: bool = False", "False -> True"): "what is not pressed does not count",
    (
        "health",
        "counts = pressed and ((before is True and deadman.counts) or (before is False and armed))",
        "without term 1",
    ): TWICE,
    (
        "health",
        "return deadman.pressed is True and deadman.counts and now_s - deadman.reported_s <= safety.deadman_timeout_s",
        "without term 1",
    ): TWICE,
}

COMPARISONS = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
ARITHMETIC = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
OPPOSITES = {"min": "max", "max": "min", "any": "all", "all": "any"}
HARMLESS = {"strict", "frozen", "slots"}
"""Keywords that forbid what does not happen; whether they are there changes no result."""


@dataclass(frozen=True)
class Mutant:
    """A module with one change. ``line`` is the changed line's old text, ``change`` says what was done to it."""

    module: str
    number: int
    line: str
    change: str
    source: str


def mutants(module: str, source: str) -> Iterator[Mutant]:
    """All mutants of a module's source. Each parses; none is the source."""
    tree = ast.parse(source)
    lines = source.splitlines()
    harmless = {id(word.value) for word in ast.walk(tree) if isinstance(word, ast.keyword) and word.arg in HARMLESS}
    for node in list(ast.walk(tree)):
        if id(node) in harmless:
            continue
        for change, replacement in _changes(node):
            changed = ast.unparse(_Swap(node, replacement).visit(tree))
            _Swap(replacement, node).visit(tree)
            number = getattr(node, "lineno", 0)
            yield Mutant(module, number, lines[number - 1].strip(), change, changed)


class _Swap(ast.NodeTransformer):
    def __init__(self, old: ast.AST, new: ast.AST) -> None:
        self._old, self._new = old, new

    def visit(self, node: ast.AST) -> ast.AST:
        return self._new if node is self._old else self.generic_visit(node)


def _changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """What a node may be replaced by, and in words."""
    new = copy.deepcopy(node)
    if isinstance(new, ast.Compare):
        for place, op in enumerate(new.ops):
            if (other := COMPARISONS.get(type(op))) is not None:
                changed = copy.deepcopy(new)
                changed.ops[place] = other()
                yield f"{type(op).__name__} -> {other.__name__}", changed
    elif isinstance(new, ast.BoolOp):
        other_op = ast.Or() if isinstance(new.op, ast.And) else ast.And()
        yield f"{type(new.op).__name__} -> {type(other_op).__name__}", ast.BoolOp(other_op, new.values)
        for place in range(len(new.values)):
            rest = new.values[:place] + new.values[place + 1 :]
            yield f"without term {place + 1}", rest[0] if len(rest) == 1 else ast.BoolOp(new.op, rest)
    elif isinstance(new, ast.BinOp) and (other := ARITHMETIC.get(type(new.op))) is not None:
        yield f"{type(new.op).__name__} -> {other.__name__}", ast.BinOp(new.left, other(), new.right)
    elif isinstance(new, ast.UnaryOp) and isinstance(new.op, ast.Not | ast.USub):
        yield f"without {type(new.op).__name__}", new.operand
    elif isinstance(new, ast.Constant) and isinstance(new.value, bool | int | float):
        value = not new.value if isinstance(new.value, bool) else new.value + 1
        yield f"{new.value} -> {value}", ast.Constant(value)
    elif isinstance(new, ast.IfExp):
        yield "branches swapped", ast.IfExp(new.test, new.orelse, new.body)
    elif isinstance(new, ast.If):
        for value in (True, False):
            yield f"if {value}", ast.If(ast.Constant(value), new.body, new.orelse)
    elif isinstance(new, ast.Call) and isinstance(new.func, ast.Name) and new.func.id in OPPOSITES:
        opposite = OPPOSITES[new.func.id]
        yield f"{new.func.id} -> {opposite}", ast.Call(ast.Name(opposite), new.args, new.keywords)
    elif isinstance(new, ast.Return) and new.value is not None and not isinstance(new.value, ast.Constant):
        yield "returns None", ast.Return(ast.Constant(None))


def survives(mutant: Mutant, tree: Path) -> bool:
    """Whether all tests pass in `tree`, a copy of the project, with the mutant in it."""
    path = tree / FOLDER / f"{mutant.module}.py"
    path.write_text(mutant.source, encoding="utf-8")
    try:
        return all(_passes(tree, tests) for tests in (TESTS[mutant.module], LONG_TESTS))
    finally:
        path.write_bytes((ROOT / FOLDER / path.name).read_bytes())


def _passes(tree: Path, tests: tuple[str, ...]) -> bool:
    command = [
        sys.executable,
        "-B",
        "-m",
        "pytest",
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        *(f"tests/core/{name}" for name in tests),
    ]
    try:
        return subprocess.run(command, cwd=tree, capture_output=True, timeout=TIMEOUT_S, check=False).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def copy_project(folder: Path) -> Path:
    """A copy of what is tracked, as it lies here."""
    files = subprocess.run(["git", "ls-files", "-z", "--", "core", "hardware", "tests", "resources", "*.toml"], cwd=ROOT,
                           capture_output=True, check=True).stdout.decode().split("\0")  # fmt: skip
    for name in filter(None, files):
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes((ROOT / name).read_bytes())
    return folder


def main(modules: list[str]) -> int:
    """Try all mutants of the modules; returns the exit code."""
    if unknown := set(modules) - TESTS.keys():
        sys.stderr.write(f"unknown: {', '.join(sorted(unknown))}; known are {', '.join(TESTS)}\n")
        return 2
    todo = [
        mutant
        for module in modules or TESTS
        for mutant in mutants(module, (ROOT / FOLDER / f"{module}.py").read_text(encoding="utf-8"))
    ]
    with tempfile.TemporaryDirectory() as folder, Progress() as bar, ThreadPoolExecutor(JOBS) as pool:
        trees: Queue[Path] = Queue()
        for job in range(JOBS):
            trees.put(copy_project(Path(folder) / str(job)))
        task = bar.add_task("mutants", total=len(todo))

        def judge(mutant: Mutant) -> bool:
            tree = trees.get()
            try:
                return survives(mutant, tree)
            finally:
                trees.put(tree)
                bar.advance(task)

        survivors = [mutant for mutant, survived in zip(todo, pool.map(judge, todo), strict=True) if survived]
    return _report(todo, survivors)


def _report(todo: list[Mutant], survivors: list[Mutant]) -> int:
    unexplained = 0
    for mutant in survivors:
        why = EXPLAINED.get((mutant.module, mutant.line, mutant.change))
        unexplained += why is None
        place = f"{FOLDER}/{mutant.module}.py:{mutant.number}"
        sys.stdout.write(f"{place}: {mutant.change}\n    {mutant.line}\n    {why or 'NOT EXPLAINED'}\n")
    found = len(todo) - len(survivors)
    sys.stdout.write(f"{len(todo)} mutants, {found} found by tests, {len(survivors)} survive, {unexplained} of them unexplained\n")
    return 1 if unexplained else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
