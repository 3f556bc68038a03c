"""Annotation editing without widgets: the tools, and an editor that turns presses, moves and keys into edits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial

import numpy as np

from app.ui.i18n import mark, tr
from app.ui.theme import ON_PICTURE
from core.annotation.masks import paint, simplify
from core.annotation.model import (
    ROBOT,
    VESSEL,
    Annotation,
    Line,
    MaskPolygon,
    MaskTarget,
    Readout,
    Touch,
    line_of,
    move,
    put,
    remove,
    touched,
    with_line,
)
from core.annotation.outline import Polygons, with_region, with_tube
from core.types import Image, Point

_POINT_REACH_PX, _EDGE_REACH_PX = 10.0, 6.0
"""How near a press must be to a point, or to an edge between two, in screen pixels."""


@dataclass(frozen=True, slots=True)
class ToolText:
    """``line`` is what a line tool draws, ``target`` what a mask tool covers; ``first`` and ``then`` are its hint."""

    key: str
    label: str
    role: str
    first: str
    then: str
    line: int | None = None
    target: MaskTarget | None = None

    @property
    def colour(self) -> str:
        """Over the picture, the same in both schemes."""
        return str(getattr(ON_PICTURE, self.role))

    @property
    def hint(self) -> str:
        return f"{tr(self.first)} \N{MIDDLE DOT} {tr(self.then)}"


_LINE_HINT = mark("Enter or double click ends it · drag a point, click the line to put one in, right click takes one out")
_MASK_HINT = mark("then drag a point, click the outline to put one in · S fewer points · G the algorithm's mask of this tool")


class Tool(Enum):
    """The tools in the order of their keys."""

    ROBOT = ToolText(
        "1", mark("Robot line"), "ROBOT", mark("Click along the robot from its tail to its HEAD"), _LINE_HINT, line=ROBOT
    )
    VESSEL = ToolText(
        "2", mark("Vessel line"), "VESSEL", mark("Click along the vessel's centerline beside the head"), _LINE_HINT, line=VESSEL
    )
    ROBOT_MASK = ToolText(
        "3",
        mark("Robot mask"),
        "ROBOT",
        mark("Click around the robot, Enter closes the outline"),
        _MASK_HINT,
        target=MaskTarget.ROBOT,
    )
    VESSEL_MASK = ToolText(
        "4",
        mark("Vessel mask"),
        "VESSEL",
        mark("Click around the vessel, Enter closes the outline"),
        _MASK_HINT,
        target=MaskTarget.VESSEL,
    )

    @property
    def is_mask(self) -> bool:
        return self.value.target is not None


@dataclass(frozen=True, slots=True)
class ModeText:
    """The key that chooses a mode and leaves it again, its name, what it does, and how it is used."""

    key: str
    label: str
    meaning: str
    hint: str


class MaskMode(Enum):
    """What a press does with a mask tool: grab points of outlines, or draw with a circle."""

    POINTS = ModeText("", "", "", "")
    REGION = ModeText(
        "R",
        mark("Region"),
        mark("Add or take away what lies around a click, up to its edges"),
        mark(
            "Click adds the region around it, Shift + click or right click takes it away · wheel or [ ] size, Ctrl + wheel zoom · "
            "R back to points"
        ),
    )
    BRUSH = ModeText(
        "T",
        mark("Brush"),
        mark("Paint the mask instead of moving its points"),
        mark(
            "Drag paints, Shift + drag or right drag takes away · wheel or [ ] size, Ctrl + wheel zoom · Insert and Delete paint "
            "at the cross · S fewer points · T back to points"
        ),
    )
    TUBE = ModeText(
        "Y",
        mark("Tube"),
        mark("Drag along the middle of a vessel: both walls are found"),
        mark(
            "Drag along the middle, the circle as wide as the vessel: both walls are found · wheel or [ ] width, also in the drag, "
            "Ctrl + wheel zoom · right drag takes away · Y back to points"
        ),
    )


RADIUS_NOTCH = 1.15
"""A notch of the wheel changes the circle's radius by this factor."""
_RADIUS_RANGE_PX = (0.5, 200.0)
_ACTIONS = {
    MaskMode.REGION: ("add a region to the", "take a region from the"),
    MaskMode.BRUSH: ("paint", "erase"),
    MaskMode.TUBE: ("add a tube to the", "take a tube from the"),
}
"""In the journal, before the mask's name."""


@dataclass(frozen=True, slots=True, eq=False)
class MaskGesture:
    """A change of the masks that takes too long for the window's thread; ``change`` may run in another one.

    ``stroke`` is where the circle's middle went, ``radii`` its radius there, for showing it meanwhile.
    """

    action: str
    stroke: Line
    radii: tuple[float, ...]
    erases: bool
    change: Callable[[Polygons], Polygons]


Measure = Callable[[Annotation], Readout]
Edit = tuple[str, Annotation]
"""What was done, in words, and the annotation that it led to."""


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """All that is drawn over the picture, in pixels of the image as it is shown.

    ``rubber_band`` goes from the line's end to the cursor, ``draft`` is an outline that is not closed yet.
    """

    annotation: Annotation
    readout: Readout
    tool: Tool
    selected: Touch | None = None
    proposal: Annotation | None = None
    proposal_readout: Readout | None = None
    rubber_band: Line = ()
    draft: Line = ()
    masks_shown: bool = True
    handles_shown: bool = True


def short_words(readout: Readout) -> str:
    """The lengths of lines that are shorter than the fit wants: robot and vessel."""
    return tr("short: {robot:.0f} + {vessel:.0f} px", robot=readout.robot_length_px, vessel=readout.vessel_length_px)


def handle_lines(annotation: Annotation, tool: Tool) -> list[int]:
    """The lines whose points can be grabbed with a tool."""
    if not tool.is_mask:
        return [ROBOT, VESSEL]
    return [place for place, mask in enumerate(annotation.masks) if mask.target is tool.value.target]


class AnnotationEditor:
    """Turns presses, moves and keys into edits. A method that completes one returns it; what is under way is in ``drawing``.

    A line is *open* while it is drawn: a press on an empty place adds a point. A line that was ended only lets its points be moved;
    choosing its tool again reopens it, and then it grows at the nearer end. ``scale`` arguments are image pixels per screen pixel.
    """

    def __init__(self) -> None:
        self.drawing = Drawing(Annotation(), Readout(), Tool.ROBOT)
        self.size = (1, 1)
        self.stroke: list[Point] = []
        self.stroke_radii: list[float] = []
        self.stroke_erases = False
        self.radius_px = 6.0
        """Of the circle that draws masks."""
        self.held: Touch | None = None
        """The point that is being dragged."""
        self._measure: Measure = lambda _annotation: Readout()
        self._is_open = True
        self._is_reopened = False
        self._held_action = ""
        self._grip = (0.0, 0.0)

    @property
    def annotation(self) -> Annotation:
        """What is drawn now, with a point that is being dragged."""
        return self.drawing.annotation

    @property
    def tool(self) -> Tool:
        return self.drawing.tool

    def set_image(self, size: tuple[int, int], annotation: Annotation, measure: Measure) -> None:
        """Another image of `size` (width, height), with the robot tool."""
        self.size, self._measure = size, measure
        self.held, self.stroke = None, []
        shown = self.drawing.masks_shown
        self.drawing = Drawing(annotation, measure(annotation), Tool.ROBOT, masks_shown=shown)
        self._is_open, self._is_reopened = len(annotation.robot) < 2, False

    def set_annotation(self, annotation: Annotation) -> None:
        """The annotation after an edit, undo or redo."""
        self.held = None
        selected = self.drawing.selected
        if selected is not None and selected.place >= len(line_of(annotation, selected.line)):
            selected = None
        self._change(annotation=annotation, readout=self._measure(annotation), selected=selected, rubber_band=())
        line = self.tool.value.line
        if line is not None and len(line_of(annotation, line)) < 2:
            self._is_open, self._is_reopened = True, False

    def set_tool(self, tool: Tool) -> None:
        """Choose a tool; choosing the same line tool again reopens its line."""
        line, again = tool.value.line, tool is self.tool
        self.held, self.stroke = None, []
        self._change(tool=tool, selected=None, draft=(), rubber_band=(), readout=self._measure(self.annotation))
        if line is not None:
            is_drawn = len(line_of(self.annotation, line)) >= 2
            self._is_reopened = again and is_drawn
            self._is_open = self._is_reopened or not is_drawn

    def show_proposal(self, proposal: Annotation | None) -> None:
        self._change(proposal=proposal, proposal_readout=self._measure(proposal) if proposal is not None else None)

    # ---- lines and points

    def press(self, point: Point, scale: float) -> bool:
        """Grab what is there, or set a point; False on an empty place with nothing to draw."""
        touch = self.touch_at(point, scale)
        if touch is not None and touch.is_edge:
            self._hold(Touch(touch.line, touch.place), "put in a point", put(self.annotation, touch.line, touch.place, point))
        elif touch is not None:
            self._hold(touch, "move a point", self.annotation, point)
        elif self.tool.is_mask:
            self._change(draft=(*self.drawing.draft, self._inside(point)), selected=None)
        elif self._is_open or self._is_unfinished:
            self._is_open = True
            self._grow(point)
        else:
            self._change(selected=None)
            return False
        return True

    def touch_at(self, point: Point, scale: float) -> Touch | None:
        """What can be grabbed at a place. While a line is drawn, the other one cannot."""
        line = self.tool.value.line
        if self.tool.is_mask and not self.drawing.masks_shown:
            return None
        lines = [line] if self._is_open and line is not None else handle_lines(self.annotation, self.tool)
        return touched(self.annotation, lines, point, _POINT_REACH_PX * scale, _EDGE_REACH_PX * scale)

    def drag_to(self, point: Point) -> None:
        if self.held is not None:
            at = self._inside((point[0] + self._grip[0], point[1] + self._grip[1]))
            self._preview(move(self.annotation, self.held.line, self.held.place, at))

    def release(self) -> Edit | None:
        if self.held is None:
            return None
        self.held = None
        return self._done(self._held_action, self.annotation)

    def stretch(self, point: Point, scale: float) -> bool:
        """While a line is drawn it reaches to the cursor, and the readout says what a press would give; True when that changed."""
        line, draft = self.tool.value.line, self.drawing.draft
        if self.tool.is_mask and draft:
            self._change(rubber_band=(draft[-1], point, draft[0]))
            return False
        points = line_of(self.annotation, line) if line is not None else ()
        if line is None or not self._is_open or not points or self.touch_at(point, scale) is not None:
            return self.unstretch()
        place = self._growing_end(line, point)
        grown = put(self.annotation, line, place, self._inside(point))
        self._change(rubber_band=(points[min(place, len(points) - 1)], point), readout=self._measure(grown))
        return True

    def unstretch(self) -> bool:
        """Remove the rubber band; True when there was one."""
        if not self.drawing.rubber_band:
            return False
        self._change(rubber_band=(), readout=self._measure(self.annotation))
        return True

    def close_line(self) -> None:
        """No more points on the line."""
        self._is_open = self._is_reopened = False
        self.unstretch()

    def end(self) -> Edit | Tool | None:
        """Complete what is being drawn: the edit of an outline, or the tool of what ended without one; None: nothing was drawn."""
        target, line, draft = self.tool.value.target, self.tool.value.line, self.drawing.draft
        if target is not None and draft:
            self._change(draft=(), rubber_band=())
            if len(draft) < 3:
                return self.tool
            masks = (*self.annotation.masks, MaskPolygon(target, draft))
            return self._done(f"draw {target.value} mask", replace(self.annotation, masks=masks))
        if line is not None and self._is_open and len(line_of(self.annotation, line)) >= 2:
            self.close_line()
            return self.tool
        return None

    def complete(self) -> Edit | None:
        """Complete a brush stroke, a drag, or an outline that has an inside."""
        if self.stroke:
            return self.end_stroke()
        if self.held is not None:
            return self.release()
        ended = self.end() if self.drawing.draft else None
        return ended if isinstance(ended, tuple) else None

    def remove_point_at(self, point: Point, scale: float) -> Edit | None:
        touch = self.touch_at(point, scale)
        if touch is None or touch.is_edge:
            return None
        self._change(selected=None)
        return self._done("take out a point", remove(self.annotation, touch.line, touch.place))

    def insert(self, point: Point) -> Edit | None:
        """A point at the cross, by key; nothing is selected afterwards, so that the cross can move on."""
        if self.tool.is_mask:
            self._change(draft=(*self.drawing.draft, self._inside(point)), selected=None)
            return None
        if not self._is_open:
            return None
        self._grow(point)
        edit = self.release()
        self._change(selected=None)
        return edit

    def nudge(self, dx: float, dy: float) -> Edit | None:
        """Move the selected point by so many pixels."""
        selected = self.drawing.selected
        if selected is None or self.held is not None:
            return None
        x, y = line_of(self.annotation, selected.line)[selected.place]
        to = self._inside((round(x + dx, 6), round(y + dy, 6)))
        return self._done("nudge a point", move(self.annotation, selected.line, selected.place, to))

    def delete(self) -> Edit | None:
        """Remove the selected point; without one, the last point of what is being drawn."""
        selected, line = self.drawing.selected, self.tool.value.line
        if self.drawing.draft:
            self.drop_draft_point()
        elif selected is not None:
            fewer = remove(self.annotation, selected.line, selected.place)
            is_left = selected.line < len(fewer.masks) and len(fewer.masks) == len(self.annotation.masks)
            left = len(line_of(fewer, selected.line)) if is_left else 0
            self._change(selected=Touch(selected.line, min(selected.place, left - 1)) if left else None)
            return self._done("take out a point", fewer)
        elif line is not None and line_of(self.annotation, line):
            return self._done("take out a point", remove(self.annotation, line, len(line_of(self.annotation, line)) - 1))
        return None

    def drop_draft_point(self) -> bool:
        """Remove the last point of the outline that is being drawn; False when none is drawn."""
        if not self.drawing.draft:
            return False
        self._change(draft=self.drawing.draft[:-1], rubber_band=())
        return True

    def clear(self) -> Edit | None:
        """Remove the whole line or outline of the selected point; without one, the line of the tool."""
        selected, line = self.drawing.selected, self.tool.value.line
        chosen = selected.line if selected is not None else line
        self._change(selected=None, draft=(), rubber_band=())
        if chosen is None or not line_of(self.annotation, chosen):
            return None
        what = self.tool.value.label.lower() if chosen < 0 else "outline"
        return self._done(f"clear the {what}", with_line(self.annotation, chosen, ()))

    def select_next(self, step: int) -> Point | None:
        """Select the next (or previous) point of the tool's lines, beginning with the head; returns where it is."""
        annotation, lines = self.annotation, handle_lines(self.annotation, self.tool)
        places = [Touch(line, place) for line in lines for place in range(len(line_of(annotation, line)))]
        if not places:
            return None
        if self.drawing.selected in places:
            chosen = places[(places.index(self.drawing.selected) + step) % len(places)]
        else:
            own = [touch for touch in places if touch.line == self.tool.value.line] or places
            chosen = own[-1] if step > 0 else own[0]
        self.unstretch()
        self._change(selected=chosen)
        return line_of(annotation, chosen.line)[chosen.place]

    def cancel(self) -> bool:
        """Drop what is being drawn or selected, and let go of the line: a click goes on with one that has no end yet."""
        drawing = self.drawing
        had = self.held is not None or bool(self.stroke) or drawing.selected is not None or bool(drawing.draft)
        had |= bool(drawing.rubber_band)
        self.held, self.stroke = None, []
        self._is_open = self._is_reopened = False
        self._change(selected=None, draft=(), rubber_band=())
        return had

    # ---- masks

    def resize_circle(self, factor: float) -> None:
        """Make the circle larger or smaller, also during a stroke: what follows is as wide as it is then."""
        low, high = _RADIUS_RANGE_PX
        self.radius_px = min(max(self.radius_px * factor, low), high)

    def begin_stroke(self, point: Point, *, erase: bool) -> None:
        self.stroke, self.stroke_radii, self.stroke_erases = [point], [self.radius_px], erase

    def continue_stroke(self, point: Point) -> None:
        self.stroke.append(point)
        self.stroke_radii.append(self.radius_px)

    def end_stroke(self) -> Edit | None:
        stroke, self.stroke = np.array(self.stroke), []
        target = self.tool.value.target
        if target is None or len(stroke) == 0:
            return None
        self._change(selected=None)
        masks = paint(self.annotation.masks, target, stroke, self.stroke_radii[0], self.size, erase=self.stroke_erases)
        return self._done(self._mask_action(MaskMode.BRUSH), replace(self.annotation, masks=masks))

    def end_gesture(self, mode: MaskMode, image: Image) -> MaskGesture | None:
        """The stroke of a tube, or the click of a region, has ended; `image` (H, W, 3) is what the mask is fitted to."""
        stroke, self.stroke = tuple(self.stroke), []
        target = self.tool.value.target
        if target is None or not stroke:
            return None
        self._change(selected=None)
        radii, erase = tuple(self.stroke_radii), self.stroke_erases
        if mode is MaskMode.REGION:
            stroke, radii = stroke[:1], radii[:1]
            change = partial(with_region, target=target, image=image, point=stroke[0], radius_px=radii[0], erase=erase)
        else:
            drawn, widths = np.array(stroke, np.float64), np.array(radii)
            change = partial(with_tube, target=target, image=image, stroke=drawn, radius_px=widths, erase=erase)
        return MaskGesture(self._mask_action(mode), stroke, radii, erase, change)

    def apply_masks(self, action: str, masks: Polygons) -> Edit:
        return self._done(action, replace(self.annotation, masks=masks))

    def _mask_action(self, mode: MaskMode) -> str:
        target = self.tool.value.target
        return f"{_ACTIONS[mode][self.stroke_erases]} {target.value if target is not None else ''} mask"

    def simplify(self, tolerance_px: float) -> Edit | None:
        target = self.tool.value.target
        if target is None:
            return None
        self._change(selected=None)
        fewer = replace(self.annotation, masks=simplify(self.annotation.masks, target, tolerance_px))
        return self._done(f"simplify {target.value} mask", fewer)

    # ---- private

    @property
    def _is_unfinished(self) -> bool:
        """Whether the line of the tool has too few points to be one."""
        line = self.tool.value.line
        return line is not None and len(line_of(self.annotation, line)) < 2

    def _change(self, **fields: object) -> None:
        self.drawing = replace(self.drawing, **fields)  # type: ignore[arg-type]

    def _grow(self, point: Point) -> None:
        line = self.tool.value.line
        if line is not None:
            place = self._growing_end(line, point)
            self._hold(Touch(line, place), "add a point", put(self.annotation, line, place, self._inside(point)))

    def _growing_end(self, line: int, point: Point) -> int:
        points = line_of(self.annotation, line)
        if not self._is_reopened or len(points) < 2:
            return len(points)
        to_first, to_last = (np.hypot(end[0] - point[0], end[1] - point[1]) for end in (points[0], points[-1]))
        return 0 if to_first < to_last else len(points)

    def _hold(self, touch: Touch, action: str, annotation: Annotation, grip: Point | None = None) -> None:
        """`grip` is where the point was grabbed: it does not jump to the cursor. The tool becomes that of the line."""
        x, y = line_of(annotation, touch.line)[touch.place]
        self.held, self._held_action = touch, action
        self._grip = (x - grip[0], y - grip[1]) if grip is not None else (0.0, 0.0)
        tool = next((tool for tool in Tool if tool.value.line == touch.line and touch.line < 0), self.tool)
        if tool is not self.tool:
            self._is_open = self._is_reopened = False
        self._change(tool=tool, selected=touch, rubber_band=())
        self._preview(annotation)

    def _preview(self, annotation: Annotation) -> None:
        self._change(annotation=annotation, readout=self._measure(annotation), rubber_band=())

    def _done(self, action: str, annotation: Annotation) -> Edit:
        self._preview(annotation)
        return action, annotation

    def _inside(self, point: Point) -> Point:
        """Kept on the image."""
        width, height = self.size
        return min(max(point[0], -0.5), width - 0.5), min(max(point[1], -0.5), height - 0.5)
