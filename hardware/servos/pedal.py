"""Foot pedal: deadman and STOP over a serial line. It finds its port again by itself after the plug was pulled."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable

from core.pedal_config import PedalConfig
from hardware.device_thread import DeviceThread
from hardware.servos.pedal_port import PedalError, PedalPort, PedalPortError, PedalUnheard, open_pedal_port
from hardware.servos.pedal_protocol import PERIOD_S, PedalParser, PedalReport, PedalWatch

__all__ = ["Pedal", "PedalError", "PedalReport"]

_START_UP_S = 3.0
"""Opening the port resets many boards; they talk again when their boot loader has waited in vain."""
_PATIENCE_S = 0.5
"""Silence of a pedal that has talked before, until people are told. Nobody holds its deadman long before that."""
_PAUSE_S = PERIOD_S / 10
"""Who had to wait so long for bytes has read all that waited."""


class Pedal:
    """Reads the pedal in a thread of its own, from ``start`` to ``close``.

    Parameters
    ----------
    config : section `pedal`; its port must be set.
    on_report : gets every report, in order, from the pedal's thread, some 50 a second while the pedal talks and one every
        ``silence_s`` while it is silent; one with a deadman of which nobody knows comes first after every opening, and last before
        the port is given up. It should return within some milliseconds, and must not call ``close``. Without a pedal nothing is
        reported: nobody holds a silent deadman either.
    on_problem : gets the newest ``problem`` when it changes, from the same thread.

    Notes
    -----
    A report with ``stop`` is repeated while STOP is pressed, so that a latched stop cannot be acknowledged before it is let go.

    Reports that have waited in the port while this program stood still say nothing about now: of those only STOP counts, until
    the port is read empty.
    """

    def __init__(
        self,
        config: PedalConfig,
        on_report: Callable[[PedalReport], None],
        on_problem: Callable[[PedalError | None], None] | None = None,
    ) -> None:
        if config.port is None:
            raise PedalPortError("no pedal is configured: set pedal.port to its path in /dev/serial/by-id")
        self._config = config
        self._on_report = on_report
        self._on_problem = on_problem
        self._thread = DeviceThread("pedal", self._serve, self._fail)
        self._problem: PedalError | None = PedalUnheard(f"the pedal at {config.port} has not reported yet")

    @property
    def problem(self) -> PedalError | None:
        """Why the pedal is not heard, in one line that says what to do; None while it is."""
        return self._problem

    def start(self) -> None:
        """Start reading. It never raises: what hinders is the ``problem``, and it is tried again and again."""
        self._thread.start()

    def close(self) -> None:
        """Report that nobody knows of the deadman any more, give the port back; may be called twice."""
        self._thread.close()

    def _serve(self) -> None:
        while not self._thread.stopping:
            try:
                self._listen_to_next()
            except PedalError as error:
                self._set_problem(error)
                self._thread.wait(None, self._config.reconnect_s)

    def _listen_to_next(self) -> None:
        with contextlib.closing(open_pedal_port(self._config)) as port:
            try:
                self._listen(port)
            finally:
                self._on_report(PedalReport(None, False, time.monotonic()))

    def _listen(self, port: PedalPort) -> None:
        """From opening to the loss of the port, or to ``close``."""
        silence_s = self._config.silence_s
        parser, watch = PedalParser(), PedalWatch(self._config)
        opened_s = read_s = time.monotonic()
        self._on_report(watch.silence(opened_s))
        due_s, complain_s = opened_s + silence_s, opened_s + _START_UP_S
        behind = True
        damaged = 0
        while True:
            asked_s = time.monotonic()
            ready = self._thread.wait(port.fd, due_s - asked_s)
            if self._thread.stopping:
                return
            now_s = time.monotonic()
            if ready:
                if now_s - read_s > silence_s:
                    behind = True  # even when that was the pedal's silence: it costs one report
                elif now_s - asked_s >= _PAUSE_S:
                    behind = False
                read_s = now_s
                for line in parser.feed(port.read()):
                    self._on_report(watch.hear(line, now_s, late=behind))
                    if line is None:
                        damaged += 1
                    else:
                        damaged = 0
                        due_s, complain_s = now_s + silence_s, now_s + _PATIENCE_S
                        self._set_problem(None)
            if now_s >= due_s:
                self._on_report(watch.silence(now_s))
                due_s = now_s + silence_s
            if now_s >= complain_s:
                self._set_problem(_unheard(port.name, damaged))

    def _set_problem(self, problem: PedalError | None) -> None:
        if str(problem) != str(self._problem):
            self._problem = problem
            if self._on_problem is not None:
                self._on_problem(problem)

    def _fail(self, error: Exception) -> None:
        self._set_problem(PedalError(f"the pedal is no longer read ({type(error).__name__}: {error}): start the program again"))


def _unheard(port: str, damaged: int) -> PedalUnheard:
    if damaged:
        return PedalUnheard(f"what comes from {port} is no pedal's report: check pedal.baud, the cable, and that it is the pedal")
    return PedalUnheard(f"the pedal at {port} is silent: check its power and firmware, then plug it in again")
