"""An operator without a person, for ``benchmark --window``: moves the robot to and fro by hand, then hands over to the program."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from PySide6.QtCore import QObject, QTimer

from app.deadman_key import REPEAT_MS
from app.next_step import Step
from app.operator_window import OperatorWindow
from core.control.hand import AT_REST, Jog
from core.control.modes import DRIVING_MODES, Mode
from core.control.way import look_ahead
from core.perception.route import plan_route
from core.policy_config import PursuitConfig
from core.types import Point, Scene

_MOVE_S = 1.5
_MOVES = (Jog(bend=0.4, advance=0.8), Jog(bend=-0.6, advance=0.6), Jog(bend=0.2, advance=-1.0), AT_REST)
_ASK_EVERY_S = 0.5
_LEAST_WAY_PX = 60.0
_LOOK_AHEAD = PursuitConfig()


class ScriptedOperator(QObject):
    """Drives by hand for the first `by_hand_s` seconds after ``start``, then wants the program to drive, as long as it is there.

    ``driven_s`` is how long the program drove. Servos that were switched off stay so: he only does what needs no looking.
    """

    def __init__(self, window: OperatorWindow, by_hand_s: float) -> None:
        super().__init__(window)
        self._window, self._by_hand_s = window, by_hand_s
        self._since_s = self._asked_s = 0.0
        self.driven_s = 0.0
        self._timer = QTimer(self)
        self._timer.setInterval(REPEAT_MS)
        self._timer.timeout.connect(self._act)

    def start(self) -> None:
        self._timer.start()

    def stop(self) -> None:
        self._timer.stop()
        self._window.desk.hold_deadman(False)

    def _act(self) -> None:
        self._since_s += REPEAT_MS / 1000.0
        if self._since_s < self._by_hand_s:
            # As a held key does, the motion is repeated: silence counts as let go.
            self._window.drive(_MOVES[int(self._since_s / _MOVE_S) % len(_MOVES)])
            return
        view = self._window.desk.view
        if view is not None and view.mode in DRIVING_MODES:
            self.driven_s += REPEAT_MS / 1000.0 * (view.mode is Mode.AUTONOMOUS)
        self._asked_s += REPEAT_MS / 1000.0
        if view is not None and self._asked_s >= _ASK_EVERY_S:
            self._asked_s = 0.0
            self._ask(view.mode, view.latched is not None)

    def _ask(self, mode: Mode, latched: bool) -> None:
        desk, tick = self._window.desk, self._window.shown_tick
        if latched:
            desk.take(Step.ACKNOWLEDGE)
        elif mode is Mode.ADVISORY:
            desk.hold_deadman(False)
            desk.take(Step.ARM)
        elif mode in {Mode.ARMED, Mode.HOLD}:
            if tick is not None and mode is Mode.ARMED and (target := _far_ahead(tick.scene)) is not None:
                self._window.choose_target(*target)
            desk.hold_deadman(True)
            desk.take(Step.HAND_OVER)


def _far_ahead(scene: Scene) -> Point | None:
    """The end of the vessel with the longest way that begins ahead of the head, in source pixels; None when no way is long."""
    if scene.path is None or scene.vessel_graph is None:
        return None
    graph, head = scene.vessel_graph, scene.path.head
    times = Counter(node for edge in graph.edges for node in (edge.start, edge.end))
    ends = [graph.nodes[node].tolist() for node, count in times.items() if count == 1]
    routes = [(route, end) for end in ends if (route := plan_route(graph, head, (end[0], end[1]))) is not None]
    # Here in the window's thread each look ahead counts: the longest way first, and mostly it is the only one.
    for route, (x, y) in sorted(routes, key=lambda found: -found[0].length_px):
        if route.length_px <= _LEAST_WAY_PX:
            break
        way = look_ahead(replace(scene, route=route), _LOOK_AHEAD.look_ahead_px, _LOOK_AHEAD)
        if way is not None and not way.behind:
            return scene.to_source((x, y))
    return None
