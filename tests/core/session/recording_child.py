"""A process that records until it is killed: says on standard output which frame was handed over, as soon as it was.

Arguments: folder, frames per second.
"""

import os
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from core.session.writer import SessionWriter
from tests.core.session_data import ABOUT, QUICK, tick_of


def main() -> None:
    folder, fps = Path(sys.argv[1]), float(sys.argv[2])
    writer = SessionWriter(QUICK.model_copy(update={"sync_s": 0.5}), ABOUT, folder=folder)
    writer.start()
    began_s = time.monotonic()
    index = 0
    while True:
        writer.put(tick_of(index % 4096, time.monotonic(), full=True))
        # one write, at once: what the reader of the pipe has seen was really handed over
        os.write(1, f"{index}\n".encode())
        index += 1
        time.sleep(max(0.0, began_s + index / fps - time.monotonic()))


main()
