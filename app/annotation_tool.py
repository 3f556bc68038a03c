"""What the rater's hand does in the picture: the tools, with key, name and meaning."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from app.language import mark, tr
from app.palette import ON_PICTURE
from core.study.annotation_edits import ROBOT, VESSEL
from core.study.annotations import MaskTarget


@dataclass(frozen=True, slots=True)
class ToolText:
    """``line`` is what a line tool draws, ``target`` what a mask tool covers; ``hint`` is shown below the picture."""

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
        """What to do first, and then."""
        return f"{tr(self.first)} \N{MIDDLE DOT} {tr(self.then)}"


_LINE_HINT = mark("Enter or double click ends it · drag a point, click the line to put one in, right click takes one out")
_MASK_HINT = mark("click the outline to put one in · T brush · S simplify · G take the model's masks")


class Tool(Enum):
    """The tools in the order of their keys."""

    ROBOT = ToolText(
        "1", mark("Robot line"), "ROBOT", mark("Click along the robot from its tail to its HEAD"), _LINE_HINT, line=ROBOT
    )
    VESSEL = ToolText(
        "2", mark("Vessel line"), "VESSEL", mark("Click along the vessel's centerline beside the head"), _LINE_HINT, line=VESSEL
    )
    ROBOT_MASK = ToolText("3", mark("Robot mask"), "ROBOT", mark("Robot mask: drag points"), _MASK_HINT, target=MaskTarget.ROBOT)
    VESSEL_MASK = ToolText(
        "4", mark("Vessel mask"), "VESSEL", mark("Vessel mask: drag points"), _MASK_HINT, target=MaskTarget.VESSEL
    )

    @property
    def is_mask(self) -> bool:
        return self.value.target is not None


BRUSH_HINT = mark(
    "Drag paints, Shift + drag or right drag takes away · [ ] size · Insert and Delete paint at the cross · T back to points"
)
