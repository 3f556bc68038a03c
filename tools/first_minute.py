"""The first minute of a user on the bench twin: the real window on a screen of its own (Xvfb), real keys and clicks (xdotool),
and a window manager (openbox), which gives the keys to the list of checks when it opens.

``python -m tools.first_minute --times 5`` starts it so often, clicks a target, arms, holds Shift, hands over with F7, and says
of each time how long the first understood picture took, and whether the program arrived without a HOLD. The user's own settings are
not touched: the first start is that of a new user.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer

from core.devices import UserError
from core.program import ROOT
from tools.run import run_tool

if TYPE_CHECKING:
    from app.operator.window import OperatorWindow
    from core.config.models import TwinConfig

_STATE_EVERY_MS = 50
"""How often the window's state is written."""
_AHEAD_MM = 40.0
"""The target lies so far before the robot, along the longest route."""
_START_WITHIN_S, _ARM_WITHIN_S, _ARRIVE_WITHIN_S = 120.0, 240.0, 240.0
_ASK_EVERY_S = 3.0
"""Between two presses of F6."""


class Session:
    """The program on a screen; ``state`` is what its window showed last, ``alerts`` all that it said."""

    def __init__(self, screen: dict[str, str]) -> None:
        self._environment = screen
        self.state: dict[str, Any] = {}
        self.alerts: list[str] = []
        self.began_s = time.monotonic()
        command = [sys.executable, "-m", "tools.first_minute", "--inside"]
        self._process = subprocess.Popen(command, cwd=ROOT, env=screen, stdout=subprocess.PIPE, text=True)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            state = json.loads(line)
            self.alerts += state.pop("alerts")
            self.state = state

    def until(self, seconds: float, **wanted: Any) -> bool:
        """Wait until the state has these values."""
        end_s = time.monotonic() + seconds
        while any(self.state.get(name) != value for name, value in wanted.items()):
            if time.monotonic() > end_s or self._process.poll() is not None:
                return False
            time.sleep(0.01)
        return True

    def act(self, *words: object) -> None:
        subprocess.run(["xdotool", *map(str, words)], env=self._environment, check=True)

    def close(self) -> None:
        self._process.terminate()
        self._process.wait(30.0)
        self._reader.join()


@contextmanager
def _screen(size: str) -> Iterator[dict[str, str]]:
    """The environment of a program on a screen of this size, with settings and caches of its own."""
    if any(shutil.which(program) is None for program in ("Xvfb", "xdotool", "openbox")):
        raise UserError("this needs Xvfb, xdotool and openbox: apt install xvfb xdotool openbox")
    ours, theirs = os.pipe()
    command = ["Xvfb", "-displayfd", str(theirs), "-screen", "0", f"{size}x24"]
    with tempfile.TemporaryDirectory(prefix="lumenpilot_first_") as folder, open(ours, encoding="ascii") as told:
        server = subprocess.Popen(command, pass_fds=(theirs,), stderr=subprocess.DEVNULL)
        os.close(theirs)
        homes = {f"XDG_{kind}_HOME": f"{folder}/{kind.lower()}" for kind in ("CONFIG", "CACHE", "STATE", "DATA")}
        screen = {**os.environ, **homes, "DISPLAY": f":{told.readline().strip()}", "QT_QPA_PLATFORM": "xcb"}
        manager = subprocess.Popen(["openbox"], env=screen, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            yield screen
        finally:
            for process in (manager, server):
                process.terminate()
                process.wait()


def _drive(session: Session) -> str:
    """Click, arm, hand over; returns how it ended."""
    if not session.until(_ARM_WITHIN_S, armable=True):
        return f"arming was refused for {_ARM_WITHIN_S:g} s: {session.state.get('against')}"
    session.act("key", "Escape")  # the tour of a first start
    session.act("mousemove", *session.state["target_at"], "click", 1)
    for _ in range(round(_ARM_WITHIN_S / _ASK_EVERY_S)):  # the first press may begin the checks, as a user does
        session.act("key", "F6")
        if session.until(_ASK_EVERY_S, mode="ARMED"):
            break
    else:
        return f"not armed: {session.state.get('bar')}"
    session.act("keydown", "Shift_L")
    try:
        session.until(5.0, can_hand_over=True)
        session.act("key", "F7")
        if not session.until(5.0, mode="AUTONOMOUS"):
            return f"not handed over: {session.state.get('mode')}"
        began_s, slowest = time.monotonic(), 100
        while (state := session.state)["mode"] == "AUTONOMOUS" and time.monotonic() < began_s + _ARRIVE_WITHIN_S:
            slowest = min(slowest, state["percent"])
            time.sleep(0.01)
    finally:
        session.act("keyup", "Shift_L")
    seconds = time.monotonic() - began_s
    has_arrived = session.state["mode"] == "ARMED" and any("reached" in alert for alert in session.alerts)
    return f"{'arrived' if has_arrived else session.state['mode']} after {seconds:.1f} s, simulation at {slowest} % at the slowest"


def first_minute(
    times: Annotated[int, typer.Option(min=1, help="starts of the program")] = 5,
    size: Annotated[str, typer.Option(help="of the screen")] = "1600x1000",
    inside: Annotated[bool, typer.Option("--inside", hidden=True)] = False,
) -> None:
    """Start, click, arm, hand over, arrive; a line for each time, with the machine's load."""
    if inside:
        raise SystemExit(_run_program())
    arrived = 0
    with _screen(size) as screen:
        for number in range(1, times + 1):
            session = Session(screen)
            try:
                is_seen = session.until(_START_WITHIN_S, understood=True)
                first_s = time.monotonic() - session.began_s
                ended = _drive(session) if is_seen else f"no understood picture within {_START_WITHIN_S:g} s"
            finally:
                session.close()
            is_good = ended.startswith("arrived") and "HOLD" not in session.state.get("modes", ["HOLD"])
            arrived += is_good
            load = os.getloadavg()[0]
            sys.stdout.write(f"{number}: first picture {first_s:.1f} s; {ended}; load {load:.1f} on {os.cpu_count()} cores\n")
            for alert in dict.fromkeys(session.alerts):
                sys.stdout.write(f"     {alert}\n")
            sys.stdout.flush()
    sys.stdout.write(f"{arrived} of {times} arrived without a HOLD\n")


def _run_program() -> int:
    """The program as ``main.py`` runs it, and its window's state as lines of JSON."""
    from app.operator import startup

    make = startup.make_window

    def watched(*arguments: Any) -> OperatorWindow:
        window = make(*arguments)
        _watch(window)
        return window

    startup.make_window = watched  # type: ignore[assignment]
    return startup.run_window(None, None, None)


def _watch(window: OperatorWindow) -> None:
    from PySide6.QtCore import QPoint, QTimer

    from core.control.modes import Mode

    target = _target(window.rig.config.twin)
    modes: list[str] = []
    alerts: list[str] = []

    def keep(news: Any) -> None:
        alerts.extend(f"{alert.spec.text} {alert.detail}".strip() for alert in news.alerts)
        modes.extend(view.mode.name for view in (*news.changes, news.view) if not modes or modes[-1] != view.mode.name)

    def tell() -> None:
        view, tick, live = window.controls.view, window.shown_tick, window.panels.live
        at = live.mapToGlobal(live.place_of(target)) if tick is not None else QPoint()
        state = {
            "understood": tick is not None and tick.scene.pose is not None,
            "target_at": (at.x(), at.y()),
            "mode": view.mode.name if view is not None else "",
            "modes": modes,
            "armable": view is not None and view.mode is Mode.ADVISORY and not view.against_arming,
            "can_hand_over": view is not None and not view.against_hand_over,
            "against": [] if view is None else [str(why) for why in view.against_arming],
            "bar": window.panels.mode_bar.text,
            "percent": window.panels.banner.percent,
            "alerts": alerts[:],
        }
        alerts.clear()
        sys.stdout.write(json.dumps(state) + "\n")
        sys.stdout.flush()

    window.controls.reported.connect(keep)
    timer = QTimer(window, interval=_STATE_EVERY_MS)
    timer.timeout.connect(tell)
    timer.start()


def _target(config: TwinConfig) -> tuple[float, float]:
    """A place on the longest route, in source pixels."""
    from hardware.rig import START_INSERTION_MM
    from hardware.twin.phantoms import make_phantom
    from hardware.twin.rendering.appearance import appearance_of, make_view
    from hardware.twin.truth import RouteFollower

    phantom = make_phantom(config.phantom)
    view = make_view(appearance_of(config), (config.image_width_px, config.image_height_px), phantom)
    longest = max((RouteFollower(phantom, node) for node in phantom.targets), key=lambda follower: follower.length_mm)
    x, y = view.project(longest.point_at(START_INSERTION_MM + _AHEAD_MM)[None])[0]
    return float(x), float(y)


if __name__ == "__main__":
    run_tool(first_minute)
