"""``make mutation``: does a test fail for every small change of the code that safety rests on?

A mutant of these modules differs from the code in one place: a comparison, an operator, a condition, a number, a returned
value. Its unit tests run against it, then the long ones (state machines, pilot). A mutant that passes them all survives: a test is
missing, or ``EXPLAINED`` says why the change has no effect; those run the unit tests alone. Exit code 1: a survivor is unexplained;
2: the tests fail without any mutant. Works on copies in a temporary folder, in forks of a process that has pytest loaded.
``python -m tools.mutation NAME ...`` does only these modules.
"""

from __future__ import annotations

import ast
import compileall
import copy
import multiprocessing
import os
import py_compile
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from queue import Queue

from rich.progress import Progress

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = {"bus_guard": "hardware/servos", "servo_models": "core/config"}
"""Where modules are that are not in core/control. Tests are below tests/ in the same folder."""
TESTS = {  # module -> the tests that should find its mutants
    "gate": ("test_gate.py",),
    "joints": ("test_gate.py", "test_joints.py"),
    "supervisor": ("test_supervisor.py", "test_health.py", "test_camera_monitor.py"),
    "health": ("test_supervisor.py", "test_health.py"),
    "camera_monitor": ("test_camera_monitor.py", "test_supervisor.py"),
    "bus_monitor": ("test_bus_monitor.py", "test_supervisor.py", "test_health.py"),
    "direction_monitor": ("test_direction_monitor.py",),
    "readiness": ("test_readiness.py",),
    "kept_zero": ("test_kept_zero.py",),
    "bus_guard": ("test_bus_guard.py", "test_bus_loop.py"),
    "servo_models": ("test_servo_models.py",),
}
LONG_TESTS = ("test_safety_machine.py", "test_pilot.py", "test_pilot_machine.py")
JOBS = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
TIMEOUT_S = 300.0
LOADED = ["__main__", "pytest", "hypothesis.stateful", "pytestqt.plugin", "PySide6.QtTest", "pydantic", "cv2"]
"""Loaded once for all mutants: what tests and code import that no mutant changes."""

# fmt: off
MISTRUST = "without a trusted measurement there is an objection already; it stands there for the type checker"
MOVING = "what moves has goals and a time; it stands there for the type checker"
TIE = "differs only where two numbers are equal to the last bit, a billionth of a millimetre apart"
MOMENT = "differs only at the very moment, to the last bit of the clock"
NUMBER = "a number is as good as another"
EXPLAINED = {
    ("gate", "if objection is not None or request is None or believed is None:", "without term 3"): MISTRUST,
    ("gate", "believed = tuple(measurement.positions_mm) if measurement is not None and mistrust is None else None",
        "without term 1"): MISTRUST,
    ("gate", "if not self.moving or self.goals_mm is None or self.time_s is None:", "without term 2"): MOVING,
    ("gate", "if not self.moving or self.goals_mm is None or self.time_s is None:", "without term 3"): MOVING,
    ("gate", "if abs(goal_mm - from_mm) > joint.max_speed_mm_s * passed_s + _RECORDED_MM:", "Gt -> GtE"): TIE,
    ("gate", "if abs(asked - goal) > _RECORDED_MM", "Gt -> GtE"): TIE,
    ("gate", "if limit is not None and abs(asked_mm - goal_mm) > _RECORDED_MM:", "Gt -> GtE"): TIE,
    ("gate", "if limit is not None and abs(asked_mm - goal_mm) > _RECORDED_MM:", "without term 1"):
        "a goal that no limit touched is the one asked for; it stands there for the type checker",
    ("joints", "direction = 1.0 if asked_mm > last_mm else -1.0", "Gt -> GtE"): "where both are equal the step is 0",
    ("joints", "to_end_mm = joint.high_mm - last_mm if direction > 0 else last_mm - joint.low_mm", "Gt -> GtE"):
        "a direction is 1 or -1",
    ("joints", "faster_mm_s = max(0.0, speed_mm_s * direction) + joint.max_acceleration_mm_s2 * passed_s",
        "Mult -> Div of speed_mm_s * direction"): "a direction is 1 or -1",
    ("joints", "return inside_mm, Limit.STEP if abs(inside_mm - goal_mm) > _ROUNDING_MM else limit", "Gt -> GtE"): TIE,
    ("joints", "found.append((kept_mm, Limit.TOGETHER) if abs(kept_mm - goal_mm) > _ROUNDING_MM else (goal_mm, limit))",
        "Gt -> GtE"): TIE,
    ("gate", "retracts = request.retracts if request is not None and request.source is Source.OPERATOR else Retracted.NONE",
        "without term 2"): "a request of another source is refused, whatever its envelope",
    ("kept_zero", "turns = (away + TICKS_PER_TURN // 2) // TICKS_PER_TURN", "2 -> 3"):
        "what was moved by more than a quarter of a turn is not offered, and nearer both round alike",
    ("direction_monitor", "is_deaf = abs(asked) >= _ENOUGH_DEG and turned[1] <= _LITTLE_DEG", "GtE -> Gt"): TIE,
    ("direction_monitor", "is_deaf = abs(asked) >= _ENOUGH_DEG and turned[1] <= _LITTLE_DEG", "LtE -> Lt"): TIE,
    ("direction_monitor", "is_held = abs(asked) >= _ENOUGH_DEG and -min(turned) <= _LITTLE_DEG", "GtE -> Gt"): TIE,
    ("direction_monitor", "is_held = abs(asked) >= _ENOUGH_DEG and -min(turned) <= _LITTLE_DEG", "LtE -> Lt"): TIE,
    ("direction_monitor", "is_held = abs(asked) >= _ENOUGH_MM and noise_mm - gone <= _LITTLE_MM", "GtE -> Gt"): TIE,
    ("direction_monitor", "is_held = abs(asked) >= _ENOUGH_MM and noise_mm - gone <= _LITTLE_MM", "LtE -> Lt"): TIE,
    ("direction_monitor", "turns = turns or is_held or followed >= _RIGHT_TURN_DEG", "GtE -> Gt"): TIE,
    ("direction_monitor", "feeds = feeds or is_held or min(gone - noise_mm, abs(asked)) >= _RIGHT_FEED_MM", "GtE -> Gt"): TIE,
    ("direction_monitor", "if against > wrong_deg:", "Gt -> GtE"): TIE,
    ("direction_monitor", "if against > wrong_mm:", "Gt -> GtE"): TIE,
    ("direction_monitor", "if age_s <= _WINDOW_S and (age_s <= _DENSE_S or is_apart):", "LtE -> Lt of age_s <= _WINDOW_S"): MOMENT,
    ("direction_monitor", "if age_s <= _WINDOW_S and (age_s <= _DENSE_S or is_apart):", "LtE -> Lt of age_s <= _DENSE_S"): MOMENT,
    ("direction_monitor", "is_apart = not kept or one.head.captured_s - kept[-1].head.captured_s >= _APART_S", "GtE -> Gt"): MOMENT,
    ("direction_monitor", "if not self.sent or head.captured_s < self.sent[0].time_s:", "Lt -> LtE"): MOMENT,
    ("direction_monitor", "is_early = head.captured_s < self.sent[0].time_s + _LAGS_S[-1]", "Lt -> LtE"): MOMENT,
    ("direction_monitor", "if before is None or not 0.0 <= motion.time_s - before.time_s <= _GAP_S:",
        "LtE -> Lt before _GAP_S"): MOMENT,
    ("direction_monitor", "is_next = 0.0 <= head.captured_s - last.captured_s <= _GAP_S", "LtE -> Lt before _GAP_S"): MOMENT,
    ("direction_monitor", "run: int = 0", "0 -> 1"): NUMBER,
    ("direction_monitor", "run += 1", "1 -> 2"): NUMBER,
    ("direction_monitor", "step = _each(lambda by, limit: by if abs(by) <= limit else 0.0, step, (*most[:2], -math.inf))",
        "LtE -> Lt"): TIE,
    ("direction_monitor", "step = _each(lambda by, limit: by if abs(by) <= limit else 0.0, step, (*most[:2], -math.inf))",
        "2 -> 3"):
        "a jump is longer than what is followed from frame to frame",
    ("direction_monitor", "if abs(step[2]) > _JUMP_MM + fed_mm + _noise_mm(earlier):", "Gt -> GtE"): TIE,
    ("direction_monitor", "if head.captured_s - before.head.captured_s < _JUMP_S:", "Lt -> LtE"): MOMENT,
    ("direction_monitor", "return replace(self, sent=(*(one for one in self.sent if one.time_s >= motion.time_s - _KEPT_S), now))",
        "GtE -> Gt"): MOMENT,
    ("direction_monitor", 'side = "right" if self.commanded[0] > 0.0 else "left"',
        "Gt -> GtE"): "no turn is wrong without a command",
    ("direction_monitor", 'side = "right" if self.commanded[0] > 0.0 else "left"',
        "0.0 -> 1.0"): "a turn is wrong only against a command that is larger",
    ("direction_monitor", "head, tail = fit_robot_vector(points, _LINE_PX), fit_robot_vector(points[::-1], _LINE_PX)", "1 -> 2"):
        "every second point gives the same line",
    ("direction_monitor", "return least if all(change * least > 0.0 for change in changes) else 0.0", "Gt -> GtE"):
        "where the smallest is 0, it is what is returned",
    ("direction_monitor", "return (angle_deg + 180.0) % 360.0 - 180.0", "Add -> Sub"):
        "half a turn before and after is the same angle",
    ("bus_guard", "if silent_s <= servos.heartbeat_timeout_s + LINGER_S + servos.watchdog_s + _TRIPPED_S:", "LtE -> Lt"): MOMENT,
    ("bus_guard", "fresh = beat is not None and now_s - beat.time_s <= self._safety.command_max_age_s", "LtE -> Lt"): MOMENT,
    ("bus_guard",
        "if not any(joint.name in tight and now_s <= self._end_s(place, joint) for place, joint in enumerate(self._joints)):",
        "LtE -> Lt"): MOMENT,
    ("bus_guard", "if at is not None and self._cycle_s - at.measured_s <= self._safety.measurement_max_age_s:",
        "LtE -> Lt"): MOMENT,
    ("bus_guard", "if order is None or order.command is None or self._measurement is None or order.issued_s < self._armed_s:",
        "Lt -> LtE"): MOMENT,
    ("bus_guard", "if silence_s > self._servos.heartbeat_timeout_s:", "Gt -> GtE"): MOMENT,
    ("bus_guard", "if not 0.0 <= gap_s <= self._safety.clock_gap_s:", "LtE -> Lt before self._safety.clock_gap_s"): MOMENT,
    ("bus_guard", "is_valid = found is not None and 0.0 <= now_s - found.issued_s <= self._safety.command_max_age_s",
        "LtE -> Lt before now_s - found.issued_s"): MOMENT,
    ("bus_guard", "is_valid = found is not None and 0.0 <= now_s - found.issued_s <= self._safety.command_max_age_s",
        "LtE -> Lt before self._safety.command_max_age_s"): MOMENT,
    ("bus_guard",
        "told[place][0] if place in told and told[place][1] >= oldest_s else None for place in range(len(self._servos.joints))",
        "GtE -> Gt"): MOMENT,
    ("bus_guard", "strained.append(0 if ma is None or most_ma is None or abs(ma) <= most_ma else count + 1)", "LtE -> Lt"): TIE,
    ("bus_guard", "strained.append(0 if ma is None or most_ma is None or abs(ma) <= most_ma else count + 1)", "without term 2"):
        "a model without that limit reports no current; it stands there for the type checker",
    ("bus_guard", "whole = bool(states) and not missing", "without term 1"): "no readings are no values in either case",
    ("bus_guard", "permitted: Source | None = beat.permitted if self.armed and beat is not None and fresh else None",
        "without term 2"): "what is fresh is there; it stands there for the type checker",
    ("bus_guard",
        "self.rejection = measurement_problem(self._measurement, now_s, self._servos, self._safety) or step.rejection",
        "without term 2"): "the gate gives no goals only where the measurement has a problem",
    ("bus_guard", "self._too_hot_c = max((0.0 if math.isnan(one) else one for one in above), default=-math.inf)", "0.0 -> 1.0"):
        "a temperature that is no number is too hot, by how much does not matter",
    ("bus_guard",
        'faults.append(Fault(Cause.HEARTBEAT_LOST, f"no heartbeat of the application for {1000 * silence_s:.0f} ms"))',
        "1000 -> 1001"): "a thousandth of a number that is told",
    ("health", "reported_s: float = 0.0", "0.0 -> 1.0"): "before the first report nothing is pressed, whenever that was",
}
# fmt: on

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    a: b
    for one, other in ((ast.Lt, ast.LtE), (ast.Gt, ast.GtE), (ast.Eq, ast.NotEq), (ast.Is, ast.IsNot), (ast.In, ast.NotIn))
    for a, b in ((one, other), (other, one))
}
ARITHMETIC = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
OPPOSITES = {"min": "max", "max": "min", "any": "all", "all": "any"}
HARMLESS = {"strict", "frozen", "slots"}  # keywords that change no result


@dataclass(frozen=True)
class Mutant:
    """A module with one change.

    ``line`` is the changed line's old text, ``change`` says what was done to it, and to which part where the line has several.
    """

    module: str
    number: int
    line: str
    change: str
    source: str

    @property
    def key(self) -> tuple[str, str, str]:
        return self.module, self.line, self.change


def path_of(module: str) -> Path:
    """From the project's root."""
    return Path(FOLDERS.get(module, "core/control")) / f"{module}.py"


def tests_of(module: str) -> tuple[list[str], list[str]]:
    """Unit tests, and those that run only when these pass; from the project's root."""
    folder = Path("tests") / path_of(module).parent
    long = LONG_TESTS if module not in FOLDERS else ()
    return [str(folder / name) for name in TESTS[module]], [str(folder / name) for name in long]


def mutants(module: str, source: str) -> Iterator[Mutant]:
    """All mutants of a module's source. Each parses; none is the source."""
    statements = ast.parse(source).body
    texts = [ast.unparse(statement) for statement in statements]
    lines = source.splitlines()
    found = [
        (place, node, change, new, lines[getattr(node, "lineno", 0) - 1].strip())
        for place, statement in enumerate(statements)
        for node, change, new in _changes_in(statement)
    ]
    alike = Counter((line, change) for _, _, change, _, line in found)
    for place, node, change, new, line in found:
        part = f" of {ast.unparse(node).splitlines()[0]}" if alike[line, change] > 1 else ""
        changed = ast.unparse(_Swap(node, new).visit(statements[place]))
        _Swap(new, node).visit(statements[place])
        whole = "\n".join([*texts[:place], changed, *texts[place + 1 :]])
        yield Mutant(module, getattr(node, "lineno", 0), line, change + part, whole)


def _changes_in(tree: ast.stmt) -> Iterator[tuple[ast.AST, str, ast.AST]]:
    harmless = {id(word.value) for word in ast.walk(tree) if isinstance(word, ast.keyword) and word.arg in HARMLESS}
    for node in ast.walk(tree):
        if id(node) not in harmless:
            for change, new in _changes(node):
                yield node, change, new


class _Swap(ast.NodeTransformer):
    def __init__(self, old: ast.AST, new: ast.AST) -> None:
        self._old, self._new = old, new

    def visit(self, node: ast.AST) -> ast.AST:
        return self._new if node is self._old else self.generic_visit(node)


def _changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Replacements of a node, and each in words."""
    new = copy.deepcopy(node)
    if isinstance(new, ast.Compare):
        for place, op in enumerate(new.ops):
            if (other := COMPARISONS.get(type(op))) is not None:
                changed = copy.deepcopy(new)
                changed.ops[place] = other()
                where = f" before {ast.unparse(new.comparators[place])}" if len(new.ops) > 1 else ""
                yield f"{type(op).__name__} -> {other.__name__}{where}", changed
    elif isinstance(new, ast.BoolOp):
        other_op = ast.Or() if isinstance(new.op, ast.And) else ast.And()
        yield f"{type(new.op).__name__} -> {type(other_op).__name__}", ast.BoolOp(other_op, new.values)
        for place in range(len(new.values)):
            rest = new.values[:place] + new.values[place + 1 :]
            yield f"without term {place + 1}", rest[0] if len(rest) == 1 else ast.BoolOp(new.op, rest)
    elif isinstance(new, ast.BinOp) and (arithmetic := ARITHMETIC.get(type(new.op))) is not None:
        yield f"{type(new.op).__name__} -> {arithmetic.__name__}", ast.BinOp(new.left, arithmetic(), new.right)
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


class Fate(Enum):
    """What became of a mutant. A test that hangs or is killed has found it, too, without a reason."""

    FOUND = "found"
    HANGS = "hangs"
    SURVIVES = "survives"


def fate_of(mutant: Mutant, tree: Path) -> Fate:
    """Run the tests in `tree`, a copy of the project, with the mutant in it."""
    path = path_of(mutant.module)
    (tree / path).write_text(mutant.source, encoding="utf-8")
    short, long = tests_of(mutant.module)
    try:
        fates = (run_tests(tree, tests) for tests in (short, [] if mutant.key in EXPLAINED else long) if tests)
        return next((fate for fate in fates if fate is not Fate.SURVIVES), Fate.SURVIVES)
    finally:
        (tree / path).write_bytes((ROOT / path).read_bytes())


def run_tests(tree: Path, tests: list[str]) -> Fate:
    """SURVIVES: they all pass."""
    process = multiprocessing.get_context("forkserver").Process(target=_pytest, args=(tree, tests))
    process.start()
    process.join(TIMEOUT_S)
    if process.exitcode is None:
        process.kill()
        process.join()
        return Fate.HANGS
    return Fate.SURVIVES if process.exitcode == 0 else Fate.FOUND if process.exitcode > 0 else Fate.HANGS


def _pytest(tree: Path, tests: list[str]) -> None:
    """Run pytest on tests of a copy, silently; its exit code is this process's."""
    import pytest

    os.chdir(tree)
    sys.path[:] = [str(tree), *(place for place in sys.path if place and Path(place) != ROOT)]
    sys.dont_write_bytecode = True
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)
    os.dup2(silent, 2)
    sys.exit(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning", *tests]))


def broken_tests(modules: list[str], tree: Path) -> list[str]:
    """The tests of the modules that do not pass on the code as it is."""
    asked = {name for module in modules for names in tests_of(module) for name in names}
    return [name for name in sorted(asked) if run_tests(tree, [name]) is not Fate.SURVIVES]


def copy_project(folder: Path) -> Path:
    """Copy the project with new files, without ignored ones."""
    listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "--"]
    parts = ["core", "hardware", "tests", "resources", "*.toml"]
    files = subprocess.run([*listed, *parts], cwd=ROOT, capture_output=True, check=True).stdout.decode().split("\0")
    for name in filter(None, files):
        if (ROOT / name).is_file():  # not one that was just deleted
            target = folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes((ROOT / name).read_bytes())
    # by their content, since mutants of the same second and length follow each other
    compileall.compile_dir(folder, quiet=2, invalidation_mode=py_compile.PycInvalidationMode.CHECKED_HASH)
    return folder


def main(modules: list[str]) -> int:
    """Try all mutants of the modules; returns the exit code."""
    if unknown := set(modules) - TESTS.keys():
        sys.stderr.write(f"unknown: {', '.join(sorted(unknown))}; known are {', '.join(TESTS)}\n")
        return 2
    modules = modules or list(TESTS)
    multiprocessing.get_context("forkserver").set_forkserver_preload(LOADED)
    todo = [mutant for module in modules for mutant in mutants(module, (ROOT / path_of(module)).read_text(encoding="utf-8"))]
    with tempfile.TemporaryDirectory() as folder, Progress() as bar, ThreadPoolExecutor(JOBS) as pool:
        copies = [copy_project(Path(folder) / str(job)) for job in range(JOBS)]
        if broken := broken_tests(modules, copies[0]):
            sys.stderr.write(f"{', '.join(broken)}: does not pass as it is; mend it first, or every change seems to be found\n")
            return 2
        trees: Queue[Path] = Queue()
        for tree in copies:
            trees.put(tree)
        task = bar.add_task("mutants", total=len(todo))

        def judge(mutant: Mutant) -> Fate:
            tree = trees.get()
            try:
                fate = fate_of(mutant, tree)
                if fate is Fate.SURVIVES and mutant.key not in EXPLAINED:
                    bar.console.print(f"{path_of(mutant.module)}:{mutant.number}: {mutant.change}: {mutant.line}", markup=False)
                return fate
            finally:
                trees.put(tree)
                bar.advance(task)

        fates = list(zip(todo, pool.map(judge, todo), strict=True))
    return report(fates)


def report(fates: list[tuple[Mutant, Fate]]) -> int:
    """Print what survives, and why it may; returns the exit code."""
    counts = Counter(fate for _, fate in fates)
    unexplained = 0
    for mutant, fate in fates:
        if fate is Fate.FOUND:
            continue
        why = EXPLAINED.get(mutant.key) if fate is Fate.SURVIVES else "the tests stood still"
        unexplained += why is None
        place = f"{path_of(mutant.module)}:{mutant.number}"
        sys.stdout.write(f"{place}: {mutant.change}\n    {mutant.line}\n    {why or 'NOT EXPLAINED'}\n")
    sys.stdout.write(
        f"{len(fates)} mutants, {counts[Fate.FOUND]} found by tests, {counts[Fate.HANGS]} by tests that stand still, "
        f"{counts[Fate.SURVIVES]} survive, {unexplained} of them unexplained\n"
    )
    return 1 if unexplained else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
