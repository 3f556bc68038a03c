"""Faults 30, 33, 34, 35: window, hands, deadman, clock."""

from __future__ import annotations

import random
import time

from app.faults.bench import FaultBench, open_bench
from app.faults.judge import Wanted, judge, mark
from app.faults.registry import Kit, Seen, fault
from core.control.faults import Cause
from core.control.gate_checks import Source
from core.control.hand import AT_REST, Jog
from core.control.modes import Act, Mode
from core.control.pilot import PERIOD_S

_ROUNDS = 6
_DEADMAN_S = 0.1
_SUSPEND_S = 1.3


@fault(
    30,
    "GUI hangs",
    injected="a slot of the window sleeps for 0.8 s: no sign of life, and the deadman that it reports is silent, too",
    wanted="HOLD by the silent deadman within 100 ms, DISARM after 500 ms",
)
def window_hangs(kit: Kit) -> Seen:
    if kit.live:
        from app.faults.window_cases import hung_window

        return hung_window(kit)
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        bench.hooks.window_lives = False
        bench.run(0.8)
        bench.hooks.window_lives = True
        bench.run(0.1)
        wanted = Wanted((Mode.HOLD, Mode.ADVISORY), (Cause.DEADMAN, Cause.WINDOW_HUNG), Cause.WINDOW_HUNG, within_s=0.14)
        return judge(bench, start, wanted)


@fault(
    33,
    "operator input in autonomy",
    injected=f"{_ROUNDS} hand-overs, each ended by a touch of the controls at a random moment, mixed with other requests",
    wanted="the operator has the hand in the same turn; nothing of the program leaves in it",
)
def override(kit: Kit) -> Seen:
    draw = random.Random(33)
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        problems = []
        for _ in range(_ROUNDS):
            bench.run(draw.uniform(0.02, 0.3))
            problems += _touch(bench, draw)
            bench.run(0.4)
            bench.hand_over()
        modes = [view.mode for view in bench.views[start.views :]]
        back = sum(a is Mode.AUTONOMOUS and b is Mode.ARMED for a, b in zip(modes, modes[1:], strict=False))
        problems += [] if back >= _ROUNDS else [f"only {back} of {_ROUNDS} touches ended autonomy"]
        path = tuple(mode for before, mode in zip([start.mode, *modes], modes, strict=False) if mode is not before)
        seen = judge(bench, start, Wanted(path, ()), *problems)
        overrides = "override" in " ".join(seen.events)
        more = () if overrides else ("no override in the session",)
        return Seen(f"{back} of {_ROUNDS} in the same turn", seen.alerts, seen.events, (*seen.problems, *more))


def _touch(bench: FaultBench, draw: random.Random) -> list[str]:
    """One touch, in the middle of whatever else is asked for in that turn; what went wrong."""
    if bench.mode is not Mode.AUTONOMOUS:
        bench.hand_over()
    if draw.random() < 0.5:
        bench.pilot.ask(draw.choice((Act.HAND_OVER, Act.TAKE_BACK, Act.ARM)))
    bench.jog = draw.choice((Jog(advance=1.0), Jog(bend=-1.0), Jog(straighten=True), Jog(delivery=-0.3)))
    view = bench.turn()
    bench.jog = AT_REST
    problems = []
    if view.mode is not Mode.ARMED:
        problems.append(f"after a touch the mode is {view.mode}")
    if view.commanded is not None or view.permitted is Source.PROGRAM:
        problems.append("the program still drives in the turn of the touch")
    return problems


@fault(
    34,
    "deadman lost (focus, pedal unplugged, stuck)",
    injected="released; then silent, as when its device is gone; then pressed since before arming (in lock-step)",
    wanted="HOLD within 100 ms; a press from before arming does not count",
)
def deadman(kit: Kit) -> Seen:
    with open_bench(kit, live=False) as bench:
        start = mark(bench.hand_over())
        bench.held = False
        released_s = _time_to_hold(bench)
        bench.hand_over()
        bench.deadman_speaks = False
        silent_s = _time_to_hold(bench)
        bench.run(0.7)  # longer than a hold clears itself
        bench.deadman_speaks = True
        bench.run(0.3)
        expired = bench.mode is Mode.HOLD
        bench.pilot.ask(Act.DISARM)
        bench.held = True
        bench.until(lambda view: not view.against_arming)
        bench.pilot.ask(Act.ARM)
        bench.run(0.1)
        bench.pilot.ask(Act.HAND_OVER)
        bench.run(0.1)
        problems = [
            f"{what} held after {1000 * s:.0f} ms" for what, s in (("released", released_s), ("silent", silent_s)) if s > 0.121
        ]
        problems += [] if expired else ["a hold of which the deadman was lost for long cleared itself"]
        problems += [] if bench.mode is Mode.ARMED else ["a deadman that was down before arming counted"]
        modes = [view.mode for view in bench.views[start.views :]]
        path = tuple(mode for before, mode in zip([start.mode, *modes], modes, strict=False) if mode is not before)
        seen = judge(bench, start, Wanted(path, (Cause.DEADMAN,)), *problems)
        reaction = f"HOLD {1000 * released_s:.0f} ms after the release, {1000 * silent_s:.0f} ms after the last word"
        return Seen(reaction, seen.alerts, seen.events, seen.problems)


def _time_to_hold(bench: FaultBench) -> float:
    """From now until HOLD, by the pilot's clock, less the turn in which the last word was said."""
    since_s = bench.view.time_s
    bench.until(lambda view: view.mode is Mode.HOLD, 1.0)
    return bench.view.time_s - since_s


@fault(
    35,
    "clock jump, suspend",
    injected="the clock leaps by 2 s; live: the whole program stands still for 1.3 s",
    wanted="DISARM after a gap of more than 1 s; only the monotonic clock counts",
)
def clock(kit: Kit) -> Seen:
    with open_bench(kit) as bench:
        start = mark(bench.hand_over())
        if bench.live:
            time.sleep(_SUSPEND_S)
        else:
            bench.jump(2.0)
        bench.run(5 * PERIOD_S)
        return judge(bench, start, Wanted((Mode.ADVISORY,), (Cause.CLOCK,), Cause.CLOCK))
