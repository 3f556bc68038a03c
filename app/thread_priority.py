"""Which threads wait when there are more of them than cores."""

from __future__ import annotations

import contextlib
import os
import sys
import threading

_BEHIND = 4
"""Of the 19 steps of niceness: two threads that both want a core share it as 7 to 3."""


def let_the_window_first() -> None:
    """The calling thread, and those that it starts from now on, leave a core to window, pilot and servos when these want one.

    For perception: it computes all the time, they only now and then. In five alternating pairs of ``benchmark --window`` on two
    cores, with the whole engine behind the window by 4 or 10 steps, it stood still for 31 to 75 ms at most instead of for 49 to 84,
    and for 241 in the run in which the machine was busy with something else; from picture to servo it took as long. It cannot be
    taken back.
    """
    if sys.platform.startswith("linux"):  # where a priority is a thread's own
        thread = threading.get_native_id()
        with contextlib.suppress(OSError):  # where it is not to be had the window waits a little longer
            os.setpriority(os.PRIO_PROCESS, thread, os.getpriority(os.PRIO_PROCESS, thread) + _BEHIND)
