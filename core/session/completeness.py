"""What a session that ended properly has lost since, by its own counts: rows cut off at the end, videos and events that went."""

from __future__ import annotations

from collections.abc import Sequence

from core.session.events import Event, was_added_later
from core.session.manifest import EVENTS, FRAMES
from core.session.reader import SessionReader


def rows_cut_off(reader: SessionReader) -> int:
    """Rows that were recorded after the last one that is there. Gaps between rows are ``reader.missing_rows``."""
    manifest = reader.manifest
    if manifest is None or not manifest.closed:
        return 0
    # The gaps that a recovered copy was made with are not among its own rows.
    gaps = reader.missing_rows if manifest.recovered is None else 0
    return max(0, manifest.counts.frames - len(reader) - gaps)


def losses(reader: SessionReader, events: Sequence[Event]) -> list[str]:
    """A line for each kind of loss; of a session that is still open or was cut, none: its counts were never written.

    `events` are those that are there; notes that were added later were never counted.
    """
    manifest = reader.manifest
    if manifest is None or not manifest.closed:
        return []
    counts, found = manifest.counts, []
    if cut := rows_cut_off(reader):
        found.append(f"{FRAMES}: the last {cut} of {counts.frames} rows are lost")
    if (videos := len(reader.videos)) < counts.videos:
        found.append(f"{counts.videos - videos} of {counts.videos} videos are lost")
    found += [f"{path.name}: empty, its pictures are lost" for path in reader.videos if path.stat().st_size == 0]
    kept = len(events) - sum(map(was_added_later, events))
    if kept < counts.events:
        found.append(f"{EVENTS}: {counts.events - kept} of {counts.events} events are lost")
    return found
