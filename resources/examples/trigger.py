"""Records a session with a note for each of three trials, in the operator window that is open. Needs Python alone."""

import json
import os
import socket
import time

PATH = f"{os.environ['XDG_RUNTIME_DIR']}/LumenPilot/triggers.sock"  # as `lumenpilot trigger` prints it

with socket.socket(socket.AF_UNIX) as line:
    line.connect(PATH)
    answers = line.makefile(encoding="utf-8")

    def ask(command: str, **values: object) -> dict:
        """Send a request and wait for its answer."""
        line.sendall(json.dumps({"command": command, **values}).encode() + b"\n")
        answer = json.loads(answers.readline())
        if not answer["ok"]:
            raise SystemExit(answer["error"])
        return answer

    ask("record start")
    while not ask("status")["recording"]:  # a session begins with its first picture
        time.sleep(0.05)
    for trial in (1, 2, 3):
        ask("note", text=f"trial {trial}")
        time.sleep(0.1)
    print(ask("status")["session"])
    ask("record stop")
