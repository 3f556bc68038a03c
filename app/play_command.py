"""``play``: opens the player on a session."""

from __future__ import annotations

import logging
from pathlib import Path

from pydantic import ValidationError

from core.config import Config
from core.errors import UserError
from core.perception.compiled import loops
from core.profiles import own_config
from core.session.manifest import Manifest
from core.session.reader import SessionReader


def run_play(session: Path, against: Path | None = None) -> int:
    """Show the player until it is closed; returns the exit code. Raises SessionError for what is no session, UserError."""
    from app.application import check_display, make_application, run_until_closed

    check_display()
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    if against is not None and not against.is_file():
        raise UserError(f"{against}: no such file; write one with: replay SESSION --jsonl FILE")
    reader = SessionReader(session)
    try:
        config = recorded_config(reader.manifest)
        loops.load()  # drawing uses them, and may not wait
        application = make_application(own_config().window)

        from app.layout_keeper import LayoutKeeper, Parts, overlay_switches
        from app.player_window import PlayerWindow
        from app.widgets.overlays import Layer

        window = PlayerWindow(reader, config, against)
        panels = window.panels
        switches = overlay_switches(panels.overlay_bar, without=(Layer.LOUPE,) if against is not None else ())
        LayoutKeeper(window, "player", Parts({"main": panels.columns}, {"right": panels.pages}, switches))
        return run_until_closed(application, window, window.say)
    finally:
        reader.close()


def recorded_config(manifest: Manifest | None) -> Config:
    """The user's own configuration, with the limits and the scale of the recording where its manifest tells them."""
    own = own_config()
    recorded = manifest.config if manifest is not None else {}
    try:
        told = Config.model_validate({key: recorded[key] for key in ("perception", "policy") if key in recorded})
    except ValidationError:  # of another version; its limits are only lines on the dials
        return own
    return own.model_copy(update={"perception": told.perception, "policy": told.policy})
