"""An operator who never rests: jogs, clicks, arms, hands over, lets go, stops, acknowledges, zeroes, restarts servos, records."""

from __future__ import annotations

import random
from collections import Counter

from app.soak_rig import SoakRig
from core.control.faults import Cause
from core.control.hand import AT_REST, Jog
from core.control.modes import ARMED_MODES, Act, Mode
from core.session.writer import SessionWriter
from hardware.twin.wire_watch import WireWatch

_DECIDES_S = (0.2, 1.2)
_HANGS_S = 0.9


class RandomOperator:
    """Wants to hand over most of the time, and does everything else now and then. All goes through the pilot, as from a window.

    ``hangs`` tells that he, or his window, shows no sign of life just now.
    """

    def __init__(self, seed: int, watch: WireWatch, writer: SessionWriter) -> None:
        self._draw = random.Random(seed)
        self._watch, self._writer = watch, writer
        self._decide_s = self._hangs_until_s = 0.0
        self._jog, self._held = AT_REST, False
        self._zeroing = False
        self.count: Counter[str] = Counter()
        self.hangs = False
        self.wants_restart = False

    def turn(self, rig: SoakRig, now_s: float) -> None:
        """To be called fifty times a second."""
        self.hangs = now_s < self._hangs_until_s
        if self.hangs:
            return
        pilot = rig.pilot
        pilot.deadman("soak", self._held)
        if not self._jog.is_rest:
            pilot.jog("soak", self._jog)
        if self._zeroing and not pilot.view.busy:
            # the joints stand: where they are now is what was taken for zero
            self._zeroing = False
            rig.bus.zeroed()
            self._do("servos on", pilot.switch_on)
        if now_s >= self._decide_s:
            self._decide_s = now_s + self._draw.uniform(*_DECIDES_S)
            self._decide(rig, now_s)

    def _do(self, what: str, action: object) -> None:
        self.count[what] += 1
        assert callable(action)
        action()

    def _decide(self, rig: SoakRig, now_s: float) -> None:
        draw, pilot, view = self._draw, rig.pilot, rig.pilot.view
        self._jog = AT_REST
        if draw.random() < 0.04:
            self._do("rare", lambda: self._rare(rig, now_s))
        elif view.mode is Mode.STOPPED or view.latched is not None:
            self._watch.stopped(None)
            self._do("acknowledge", lambda: pilot.ask(Act.ACKNOWLEDGE))
        elif not view.servos_on:
            if not view.busy and not self._zeroing:
                self._mend(rig)
        elif view.mode is Mode.ADVISORY:
            self._held = False
            if view.against_arming or draw.random() < 0.4:
                self._drive_by_hand()
            else:
                self._do("arm", lambda: pilot.ask(Act.ARM))
        elif view.mode in {Mode.ARMED, Mode.HOLD}:
            self._hand_over(rig)
        else:
            self._interfere(rig)

    def _mend(self, rig: SoakRig) -> None:
        """Servos that are off: a restart where one has an error, zero where they have none, and on again."""
        pilot, status = rig.pilot, rig.robot.bus_status()
        causes = {fault.cause for fault in (*rig.pilot.view.active, *(status.active if status is not None else ()))}
        if Cause.SERVO_ALERT in causes:
            errors = [r.id for r in status.servos if getattr(r, "error", 0)] if status is not None else []
            if errors:
                self._do("restart a servo", lambda: pilot.reboot(errors[0]))
        elif status is not None and not all(status.zeroed):
            self._zeroing = True
            self._do("zero", pilot.zero)
        else:
            self._do("servos on", pilot.switch_on)

    def _drive_by_hand(self) -> None:
        draw = self._draw
        self.count["jog"] += 1
        self._jog = Jog(
            bend=draw.uniform(-1.0, 1.0),
            pitch=draw.choice((0.0, 0.0, draw.uniform(-1.0, 1.0))),
            advance=draw.uniform(-1.0, 1.0),
            delivery=draw.choice((0.0, 0.0, draw.uniform(-1.0, 1.0))),
            straighten=draw.random() < 0.1,
        )

    def _hand_over(self, rig: SoakRig) -> None:
        draw, pilot = self._draw, rig.pilot
        self._held = draw.random() < 0.9
        if draw.random() < 0.3 or not rig.pilot.view.against_hand_over:
            pass
        else:
            width, height = rig.config.twin.image_width_px, rig.config.twin.image_height_px
            target = draw.uniform(0.3, 0.95) * width, draw.uniform(0.15, 0.85) * height
            self._do("click", lambda: rig.engine.set_target(target))
        if not rig.pilot.view.against_hand_over:
            pilot.deadman("soak", self._held)
            self._do("hand over", lambda: pilot.ask(Act.HAND_OVER))
        elif draw.random() < 0.15:
            self._drive_by_hand()

    def _interfere(self, rig: SoakRig) -> None:
        """While the program drives: mostly nothing."""
        draw, pilot = self._draw, rig.pilot
        choice = draw.random()
        if choice < 0.12:
            self._drive_by_hand()
        elif choice < 0.2:
            self._held = False
        elif choice < 0.25:
            self._do("take back", lambda: pilot.ask(Act.TAKE_BACK))
        elif choice < 0.3:
            self._do("click", lambda: rig.engine.set_target((draw.uniform(200.0, 600.0), draw.uniform(60.0, 420.0))))

    def _rare(self, rig: SoakRig, now_s: float) -> None:
        draw, pilot = self._draw, rig.pilot
        choice = draw.choice(("stop", "stop", "hang", "disarm", "record", "record", "save last", "torque off", "restart"))
        self.count[choice] += 1
        if choice == "stop":
            pilot.ask(Act.STOP)
            self._watch.stopped(now_s)
        elif choice == "hang":
            self._hangs_until_s = now_s + draw.uniform(0.2, _HANGS_S)
        elif choice == "disarm" and pilot.view.mode in ARMED_MODES:
            pilot.ask(Act.DISARM)
        elif choice == "record":
            (self._writer.stop if self._writer.status().recording else self._writer.start)()
        elif choice == "save last":
            self._writer.save_last()
        elif choice == "torque off":
            pilot.torque_off()
        elif choice == "restart":
            self.wants_restart = True
