"""JSON schemas of what is written to MCAP. Viewers know the messages named foxglove.* by its public definitions."""

from __future__ import annotations

from typing import Any

Schema = dict[str, Any]

_NUMBER: Schema = {"type": "number"}
_MAYBE: Schema = {"type": ["number", "null"]}
_TEXT: Schema = {"type": "string"}
_TIME: Schema = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_COLOUR: Schema = {"type": "object", "properties": dict.fromkeys("rgba", _NUMBER)}
_POINT: Schema = {"type": "object", "properties": {"x": _NUMBER, "y": _NUMBER}}
_DATA: Schema = {"type": "string", "contentEncoding": "base64"}


def _message(title: str, **properties: Schema) -> Schema:
    return {"title": title, "type": "object", "properties": {"timestamp": _TIME, **properties}}


def _list(item: Schema) -> Schema:
    return {"type": "array", "items": item}


_MOTION = {
    f"{who}_{what}": _MAYBE for who in ("asked", "commanded", "sent") for what in ("bend", "pitch", "advance_mm_s", "delivery_mm_s")
}

SCHEMAS: dict[str, Schema] = {
    str(schema["title"]): schema
    for schema in (
        _message("foxglove.CompressedVideo", frame_id=_TEXT, data=_DATA, format=_TEXT),
        _message("foxglove.CompressedImage", frame_id=_TEXT, data=_DATA, format=_TEXT),
        _message("foxglove.Log", level={"type": "integer"}, message=_TEXT, name=_TEXT, file=_TEXT, line={"type": "integer"}),
        {
            "title": "foxglove.ImageAnnotations",
            "type": "object",
            "properties": {
                "circles": _list(
                    _message(
                        "foxglove.CircleAnnotation",
                        position=_POINT,
                        diameter=_NUMBER,
                        thickness=_NUMBER,
                        fill_color=_COLOUR,
                        outline_color=_COLOUR,
                    )
                ),
                "points": _list(
                    _message(
                        "foxglove.PointsAnnotation",
                        type={"type": "integer"},
                        points=_list(_POINT),
                        outline_color=_COLOUR,
                        outline_colors=_list(_COLOUR),
                        fill_color=_COLOUR,
                        thickness=_NUMBER,
                    )
                ),
                "texts": _list(
                    _message(
                        "foxglove.TextAnnotation",
                        position=_POINT,
                        text=_TEXT,
                        font_size=_NUMBER,
                        text_color=_COLOUR,
                        background_color=_COLOUR,
                    )
                ),
            },
        },
        _message(
            "lumenpilot.Pose",
            theta_signed_deg=_MAYBE,
            c_head_px=_MAYBE,
            c_tail_px=_MAYBE,
            source_px_per_working_px=_NUMBER,
            confidence=_MAYBE,
            novelty=_MAYBE,
            state={"type": ["string", "null"]},
            state_number=_MAYBE,
            refusal=_TEXT,
        ),
        _message("lumenpilot.Robot", insertion_mm=_NUMBER, delivery_mm=_NUMBER, wall_contact_n=_MAYBE, **{
            f"tendon_{what}_{side}": _NUMBER for what in ("pull_mm", "force_mn") for side in ("right", "left", "up", "down")
        }),
        _message("lumenpilot.Motion", mode=_TEXT, mode_number=_MAYBE, sent_by=_TEXT, **_MOTION),
        _message("lumenpilot.Pace", frames_per_second=_NUMBER, dropped_frames=_NUMBER, dropped_rows=_NUMBER, perception_ms=_MAYBE),
    )
}  # fmt: skip
