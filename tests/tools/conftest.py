"""Tools that open windows are tested with the fixtures of the windows' tests."""

from tests.app.conftest import (  # noqa: F401
    all_orientations,
    bench,
    engine,
    engines,
    imported,
    looked_at_once,
    make_window,
    no_leaks,
    running,
    themed,
)
