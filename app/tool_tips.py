"""What each quantity on the screen means, after the method: the one table behind all tool tips. No Qt here."""

from __future__ import annotations

import re
import textwrap
from dataclasses import dataclass

from app.language import ENGLISH, language_in_use, mark, tr
from app.next_step import DEADMAN_KEY
from app.wording import STATE_MEANING

_WIDTH = 96
_NEVER_FIRST = "，。；：？）、"
"""Signs that do not begin a line."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """Its name as it is written on the screen, its unit ("" where it has none), and its meaning in whole sentences."""

    name: str
    unit: str
    meaning: str


QUANTITY = {
    # ---- the pose
    "theta": Quantity(
        "theta",
        "degrees",
        mark(
            "Angle between the line through the robot's last 40 px and the line through 40 px of the vessel's centerline beside "
            "the "
            "head. Positive: the robot points to the right of the vessel's direction, as seen on screen."
        ),
    ),
    "d_head": Quantity(
        "d_head",
        mark("working px"),
        mark(
            "Distance of the robot's head from the vessel's line. Working pixels: the picture scaled to 640 px along its longer "
            "side."
        ),
    ),
    "d_tail": Quantity(
        "d_tail",
        mark("working px"),
        mark(
            "Distance of the point 40 px behind the head from the same line. On the other side than the head: the robot has "
            "crossed."
        ),
    ),
    "crossed": Quantity(
        mark("crossed"),
        "",
        mark("Head and tail of the robot's line lie on opposite sides of the vessel's line: one of them is past it."),
    ),
    "state": Quantity(mark("Pose state"), "", "\n".join(STATE_MEANING.values())),
    "confidence": Quantity(
        "confidence",
        mark("0 to 1"),
        mark(
            "Chance that the answer is right (theta within 5 degrees, head within 15 px), as learnt on pictures with known truth. "
            "Where it is low, the answer is shown as unsure, and its shape is not filled; where it is lower, there is a reason "
            "instead."
        ),
    ),
    "reason": Quantity(
        mark("No pose"), "", mark("The program sees that it cannot tell, and names why: better no answer than a wrong one.")
    ),
    # ---- the vessel and the way
    "clearance": Quantity(
        mark("Room"),
        mark("working px, about mm"),
        mark(
            "Between the edge of the robot's head and the wall of the vessel. The bar is full on the centerline and empty at the "
            "wall."
        ),
    ),
    "force": Quantity(
        mark("Wall force"), "N", mark("Sum of the contact forces of the robot on the vessel's wall. Known on the bench twin only.")
    ),
    "target": Quantity(
        mark("Destination"),
        mark("px to go"),
        mark(
            "Where you want to go: a click in the picture sets it, a right click or Esc clears it. "
            "The vessel's direction follows the way there, and the program drives to it."
        ),
    ),
    "phantom": Quantity(
        mark("Phantom"), "", mark("The vessel phantom that the bench twin shows; another one starts the twin again.")
    ),
    "seed": Quantity(mark("Seed"), "", mark("Of the random phantom: the same seed gives the same phantom.")),
    # ---- advice and commands
    "advice": Quantity(
        mark("Advice"),
        mark("mm/s and degrees"),
        mark(
            "How fast to advance or retract, and how far to turn the head (right and left as seen on screen). Unless you hand "
            "over, "
            "you steer, and nothing is sent to the robot but what you ask for."
        ),
    ),
    "commands": Quantity(
        mark("Commands"),
        "",
        mark(
            "Four things kept apart: advised, asked by you, commanded by the program, and sent after the gate. Bend and pitch: "
            "share "
            "of the tendons' full pull; advised: the turn in degrees. \N{NOT EQUAL TO}: the gate sent something else than was "
            "asked."
        ),
    ),
    "capture_to_servo": Quantity(
        mark("Capture to servo"), "ms", mark("From the picture to the command made of it. It should stay below 100 ms.")
    ),
    "following": Quantity(mark("Following"), "%", mark("How far your motions of the last ten seconds agreed with the advice.")),
    "bend": Quantity(
        mark("bend"),
        mark("share of full pull"),
        mark("How far the head is bent, as the tendons are pulled: left and right of the middle."),
    ),
    "pitch": Quantity(
        mark("pitch"), mark("share of full pull"), mark("How far the head is bent out of the picture's plane: right is lifted.")
    ),
    "hand_speeds": Quantity(
        mark("Speeds by hand"),
        "mm/s",
        mark(
            "What a key makes while it is held, at the chosen share of full speed: way of the feed, of the sheath, and pull of the "
            "tendons' wires. A press of a tenth of a second makes about a tenth of that way."
        ),
    ),
    "insertion": Quantity(mark("in"), "mm", mark("How far the robot is in, by the feed's servo.")),
    "mode": Quantity(
        mark("Mode"), "", mark("Who drives: ADVISORY and ARMED you, AUTONOMOUS the program, HOLD and STOPPED nobody.")
    ),
    "deadman": Quantity(
        mark("Deadman"),
        "",
        mark(
            "The program drives only while you hold this with the mouse, hold {deadman} or stand on the pedal. Let go and the "
            "robot holds. It must be pressed after arming: what was down before does not count."
        ),
    ),
    "tendon_balance": Quantity(
        mark("Tendon pair"),
        mark("mm and N"),
        mark(
            "Two wires that pull against each other: the sum of their pulls should be twice the pretension. Bar to the left: "
            "slack. "
            "Bar to the right: too tight. In N: tension of either wire as the motor's current tells it, friction included."
        ),
    ),
    # ---- pace
    "shown": Quantity(mark("shown/s"), "1/s", mark("Frames drawn on this screen per second.")),
    "engine": Quantity(mark("frames/s"), "1/s", mark("Frames perceived per second.")),
    "dropped": Quantity(
        mark("dropped"), mark("frames"), mark("The camera gave them, but nobody looked: a newer one was there already.")
    ),
    "gui_block": Quantity(mark("block"), "ms", mark("Longest time in the last 10 s in which this window could not react to you.")),
    "latency": Quantity(
        mark("Latency"),
        "ms",
        mark(
            "Time that each stage took for one frame, over the last seconds: half of the frames were quicker than p50, 95 % were "
            "quicker than p95."
        ),
    ),
    "trends": Quantity(
        mark("Last 30 seconds"),
        mark("degrees, px"),
        mark("Theta above, d_head and d_tail (dotted) below, and the state as a band. Gaps: no pose."),
    ),
    # ---- sessions and studies
    "timeline": Quantity(
        mark("Timeline"),
        "s",
        mark(
            "The whole session: states as a band, theta, gaps, and marks of alerts, steps, destinations and notes. Click or drag "
            "goes "
            "there, the wheel zooms, Shift and drag selects."
        ),
    ),
    "values": Quantity(
        mark("Recorded values"),
        "",
        mark("What no dial shows: frame, latency by stage, confidence, crossed, tendons, servo bus, faults."),
    ),
    "lines_used": Quantity(
        mark("lines used"),
        mark("working px"),
        mark("Length of robot and vessel that the two lines are fitted to: less than 40 + 40 is less sure."),
    ),
}


def tip(*names: str) -> str:
    """A tool tip: "name (unit): meaning" of each quantity on lines that fit a screen. Raises KeyError for an unknown one."""
    return "\n".join(_paragraph(QUANTITY[name]) for name in names)


def _paragraph(quantity: Quantity) -> str:
    unit = f" ({tr(quantity.unit)})" if quantity.unit else ""
    if "\n" in quantity.meaning:  # a list of its own
        return "\n".join(tr(line) for line in quantity.meaning.splitlines())
    return _filled(f"{tr(quantity.name)}{unit}: {tr(quantity.meaning).format(deadman=DEADMAN_KEY)}")


def _filled(text: str) -> str:
    """On lines of a width that fits a screen. Chinese has no spaces to break at, and its letters are twice as wide."""
    if language_in_use() == ENGLISH:
        return textwrap.fill(text, _WIDTH)
    lines, room = [""], _WIDTH
    for part in re.findall(r"[!-~]+ ?|.", text):
        width = sum(1 if letter.isascii() else 2 for letter in part)
        if width > room and part not in _NEVER_FIRST:
            lines.append("")
            room = _WIDTH
        lines[-1] += part
        room -= width
    return "\n".join(lines)
