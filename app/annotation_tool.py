"""What the rater's hand does in the picture: the tools, with key, name and meaning."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from app.palette import ON_PICTURE
from core.study.annotation_edits import ROBOT, VESSEL
from core.study.annotations import MaskTarget


@dataclass(frozen=True, slots=True)
class ToolText:
    """``line`` is what a line tool draws, ``target`` what a mask tool covers; ``hint`` is shown below the picture."""

    key: str
    label: str
    role: str
    hint: str
    line: int | None = None
    target: MaskTarget | None = None

    @property
    def colour(self) -> str:
        """Over the picture, the same in both schemes."""
        return str(getattr(ON_PICTURE, self.role))


_LINE_HINT = "Enter or double click ends it · drag a point, click the line to put one in, right click takes one out"
_MASK_HINT = "drag points · click the outline to put one in · T brush · S simplify · G take the model's masks"


class Tool(Enum):
    """The tools in the order of their keys."""

    ROBOT = ToolText("1", "Robot line", "ROBOT", f"Click along the robot from its tail to its HEAD · {_LINE_HINT}", line=ROBOT)
    VESSEL = ToolText(
        "2", "Vessel line", "VESSEL", f"Click along the vessel's centerline beside the head · {_LINE_HINT}", line=VESSEL
    )
    ROBOT_MASK = ToolText("3", "Robot mask", "ROBOT", f"Robot mask: {_MASK_HINT}", target=MaskTarget.ROBOT)
    VESSEL_MASK = ToolText("4", "Vessel mask", "VESSEL", f"Vessel mask: {_MASK_HINT}", target=MaskTarget.VESSEL)

    @property
    def is_mask(self) -> bool:
        return self.value.target is not None


BRUSH_HINT = (
    "Drag paints, Shift + drag or right drag takes away · [ ] size · Insert and Delete paint at the cross · T back to points"
)
