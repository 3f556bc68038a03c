"""A process that records until it is killed: says on standard output how many frames the recorder has written by then.

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
        os.write(1, f"{writer.status().frames}\n".encode())  # one write, at once: no line is cut by the kill
        index += 1
        time.sleep(max(0.0, began_s + index / fps - time.monotonic()))


main()
