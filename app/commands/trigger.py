"""``trigger``: what the operator window takes from other programs, from a shell."""

from __future__ import annotations

import json
import socket
import sys
from typing import Annotated, Any

import typer

from core.config.files import trigger_socket
from core.devices import UserError

_WITHIN_S = 5.0
"""A window answers in milliseconds; one that opens a dialog or a rig may take longer."""


def request_of(words: list[str]) -> dict[str, Any]:
    """The request that these words mean. Raises UserError."""
    if words[0] == "note":
        return {"command": "note", "text": " ".join(words[1:])}
    if words[0] == "target":
        try:
            x, y = map(float, words[1:])
        except ValueError:
            raise UserError("a target is two numbers, in pixels of the camera: trigger target 320 240") from None
        return {"command": "target", "x": x, "y": y}
    return {"command": " ".join(words)}


def trigger(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            help="record start, record stop, mark, note TEXT, snapshot, target X Y or status; none: print the socket's path"
        ),
    ] = None,
) -> None:
    """Trigger the operator window that is open, and print its answer, a JSON object. Nothing moves, arms or hands over by this."""
    path = trigger_socket()
    if not words:
        sys.stdout.write(f"{path}\n")
        return
    request = request_of(words)
    try:
        with socket.socket(socket.AF_UNIX) as line:
            line.settimeout(_WITHIN_S)
            line.connect(str(path))
            line.sendall(json.dumps(request).encode() + b"\n")
            answer = line.makefile(encoding="utf-8").readline()
    except OSError as error:
        raise UserError(f"{path}: no window answers ({error.strerror or error}); its menu Session says why") from None
    told = json.loads(answer or '{"ok": false, "error": "the window has closed"}')
    if not told["ok"]:
        raise UserError(told["error"])
    sys.stdout.write(answer)
