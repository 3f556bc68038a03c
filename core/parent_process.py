"""What a worker process owes the process that started it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading


def begin_as_worker() -> None:
    """What every worker does first: Ctrl-C, which reaches it too, is its parent's business, and it ends with that."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()


def end_with_parent() -> None:
    """End this process when its parent is gone: a worker whose parent was killed would wait for work for ever."""

    def watch() -> None:
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
