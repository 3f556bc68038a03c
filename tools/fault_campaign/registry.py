"""The register of the faults: what is injected, what must follow, and the function that injects and judges."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from core.devices import UserError


class CampaignError(UserError):
    """The campaign, or one of its faults, cannot be run."""


@dataclass(frozen=True, slots=True)
class Observation:
    """What followed a fault. ``problems`` are the differences from what is listed."""

    reaction: str
    alerts: tuple[str, ...] = ()
    events: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        return not self.problems


@dataclass(frozen=True, slots=True)
class Kit:
    """A folder for one fault, and whether it takes place over real lines, processes and windows (`live`) or in lock-step."""

    folder: Path
    live: bool

    def part(self, name: str) -> Kit:
        """The same in a folder inside."""
        folder = self.folder / name
        folder.mkdir(parents=True)
        return Kit(folder, self.live)


Inject = Callable[[Kit], Observation]


class FaultText(NamedTuple):
    """A row of the list. ``quick``: it runs in lock-step or on files alone, within a second or so."""

    name: str
    injected: str
    wanted: str
    quick: bool = True


# fmt: off
FAULTS = {
    1: FaultText("camera unplugged", "the camera gives nothing any more", "HOLD after 150 ms without a frame, DISARM after 500 ms"),
    2: FaultText("camera read blocks", "the camera's read waits for 1.5 s",
        "HOLD, DISARM by the age seen from outside its thread; the window stays alive"),
    3: FaultText("frozen camera", "the same picture, with fresh times", "DISARM at the fifth identical picture"),
    4: FaultText("dropped frames", "first every 7th frame is lost, then every 3rd",
        "warning above 10 % loss; above 20 % over 3 s HOLD, DISARM after 0.5 s"),
    5: FaultText("wrong size or format", "pictures of half the size; later grey ones; 16-bit ones", "each rejected; DISARM"),
    6: FaultText("black, white", "all pixels 0; later all 255", "HOLD at the third such picture"),
    7: FaultText("blur, occlusion, glare",
        "strong blur; a patch, glare over the head (network, lock-step)",
        "a named reason: HOLD or DISARM; 150 ms of low confidence: HOLD", quick=False),
    8: FaultText("camera moved", "the whole picture is shifted by 14 px",
        "DISARM by the landmarks' drift; no arming while it lasts"),
    9: FaultText("stale perception (overload)", "understanding a frame takes 250 ms; then 800 ms",
        "pose older than 150 ms: HOLD; older than 500 ms: DISARM"),
    10: FaultText("results out of order", "some pairs of frames come in the wrong order",
        "the late one is dropped and counted"),
    11: FaultText("NaN or infinity from network or fit",
        "one pose with theta = NaN; then NaN in a part of the masks for good",
        "discarded: HOLD; three in a row: DISARM"),
    12: FaultText("head lost", "the robot's mask is empty", "HOLD at the third frame, DISARM after 0.5 s"),
    13: FaultText("several robots", "a second robot of the same size is put into the mask", "DISARM"),
    14: FaultText("robot outside vessel", "the vessel's mask is shifted by 80 px", "DISARM"),
    15: FaultText("branch ambiguity", "a symmetric Y; no route, as the branch to the target is cut off",
        "HOLD, and the alert asks for a target"),
    16: FaultText("pose jump", "the head is 70 px further back in the next frame", "rejected, HOLD"),
    17: FaultText("state chatter", "the robot swings by 1 px about the threshold of state A",
        "the shown state does not change: hysteresis and dwell"),
    18: FaultText("model missing, truncated, bit-flipped", "a copy of the model: a file gone, cut in half, one bit flipped",
        "its hash tells: refuses to arm; the program opens all the same"),
    19: FaultText("malicious weights", "the weights are a pickle that runs code, and the manifest vouches for it",
        "refused: only safetensors and ONNX are read, nothing runs"),
    20: FaultText("wrong model", "the network's two outputs are swapped", "the golden picture tells: refuses to arm"),
    21: FaultText("one servo silent", "the advance servo hears and obeys, but does not answer",
        "after 3 misses DISARM of all seven", quick=False),
    22: FaultText("CRC, garbage, short packet", "one damaged answer of each kind; then forty with a wrong CRC",
        "one retry each, at most a short hold; more than 5 in a second: DISARM; nothing breaks", quick=False),
    23: FaultText("overload alert", "a servo raises its hardware error bit for overload", "register 70 is read: STOP", quick=False),
    24: FaultText("over-temperature, under-voltage",
        "a servo is warmed, then heated; elsewhere the supply sags, then falls at one servo",
        "a warning, then DISARM before the servo shuts itself down", quick=False),
    25: FaultText("tracking error, jam, slack wire",
        "the advance servo's horn is blocked while the program feeds; is pulled back; drifts while nobody drives",
        "STOP: 200 ms off its way, or by current", quick=False),
    26: FaultText("USB serial vanishes", "the pseudo-terminal is closed, and comes back two seconds later",
        "STOP; opened again and checked by itself, never armed by itself", quick=False),
    27: FaultText("servo rebooted", "a servo loses its power for a moment: RAM and turn count are gone",
        "DISARM, latched; it must be zeroed before it can be armed", quick=False),
    28: FaultText("wrong id, model, mode",
        "another model number; another id inside; mode altered in standby",
        "named; rig does not open, or servos cannot be switched on", quick=False),
    29: FaultText("two programs on one port",
        "a second program opens the port while the first drives; or switches the torque off",
        "refused by name, the first drives on; torque off: DISARM by its own cause, the zeros hold", quick=False),
    30: FaultText("GUI hangs", "a slot of the window sleeps for 0.8 s",
        "HOLD by the silent deadman within 100 ms, DISARM after 500 ms"),
    31: FaultText("worker dies", "in the window, perception raises while the program drives",
        "DISARM, said and latched; starting again acknowledges nothing", quick=False),
    32: FaultText("process killed or stopped",
        "SIGKILL and SIGSTOP, to the application and to the bus process, while the program drives",
        "the servos stand within 1 s and one bounded step", quick=False),
    33: FaultText("operator input in autonomy",
        "6 hand-overs ended by a touch of the controls, at random moments",
        "the operator has the hand in the same turn"),
    34: FaultText("deadman lost (focus, pedal unplugged, stuck)",
        "released; silent, its device gone; pressed since before arming (in lock-step)",
        "HOLD within 100 ms; a press from before arming does not count"),
    35: FaultText("clock jump, suspend", "the clock leaps by 2 s; live: the whole program stands still for 1.3 s",
        "DISARM after a gap of more than 1 s; only the monotonic clock counts"),
    36: FaultText("disk low, full",
        "free space falls to 5 %, then to nothing, in a recorded drive (in lock-step)",
        "warning below 7 %; the recording stops visibly, what was written stays; driving goes on"),
    37: FaultText("kill -9 while recording", "the recording program is killed at a random moment",
        "listed as cut, recovered into a copy that says what is lost", quick=False),
    38: FaultText("encoder too slow", "the encoder does not return while pictures come; the queue takes 3 (in lock-step)",
        "bounded queue; drops counted and shown; driving is not touched"),
    39: FaultText("malformed configuration, session, annotation",
        "24 copies of each: cut, zeroed, bits flipped",
        "read, or refused by one line; the original is untouched"),
    40: FaultText("kill during annotation save", "a program that saves annotations is killed, 8 times",
        "nothing is lost after it said that it was saved", quick=False),
    41: FaultText("quit while armed or recording", "the window is closed while it records, in three modes",
        "disarmed, flushed, joined; exit code 0; the session is whole", quick=False),
    42: FaultText("twin taken for the real rig", "the twin, a real camera and a recording are opened",
        "a permanent banner SIM, LIVE or PLAYBACK; the session keeps it"),
    43: FaultText("picture of an unknown kind",
        "three pictures unlike all that the model knows; then all",
        "HOLD at the first, and on again; then DISARM"),
    44: FaultText("too much current",
        "the advance servo gives nearly its force limit for 100 ms; then for good",
        "no fault; then STOP after half a second, and the tendons are let go", quick=False),
    45: FaultText("torque-off not proven",
        "one servo does not answer for 0.6 s when the torque is to go off at STOP",
        "STOP; said until all servos have confirmed, tried again",
        quick=False),
    46: FaultText("robot goes the other way",
        "right and left are swapped, or the feed is reversed, while the program drives (in lock-step)",
        "DISARM within some degrees, or a second, of the wrong motion", quick=False),
}
# fmt: on
COUNT = len(FAULTS)


@dataclass(frozen=True, slots=True)
class FaultCase:
    """A fault of the list and the function that injects it."""

    number: int
    text: FaultText
    inject: Inject


CASES: dict[int, FaultCase] = {}


def fault(number: int) -> Callable[[Inject], Inject]:
    """Register the function that injects fault `number` of the list."""

    def enter(inject: Inject) -> Inject:
        if number in CASES or number not in FAULTS:
            raise ValueError(f"fault {number} is registered twice, or there is none of that number")
        CASES[number] = FaultCase(number, FAULTS[number], inject)
        return inject

    return enter


def check(*checks: tuple[bool, str]) -> list[str]:
    """The texts of the conditions that do not hold."""
    return [problem for holds, problem in checks if not holds]


def run_parts(kit: Kit, *parts: tuple[str, Inject], named: bool = True) -> Observation:
    """Inject several kinds of a fault, each in a folder of its own, and join what was seen."""
    found: list[Observation] = []
    for name, inject in parts:
        seen = inject(kit.part(name))
        found.append(replace(seen, reaction=f"{name}: {seen.reaction}") if named else seen)

    def unique(texts: Iterable[tuple[str, ...]]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(text for part in texts for text in part))

    return Observation(
        "; ".join(seen.reaction for seen in found),
        unique(seen.alerts for seen in found),
        unique(seen.events for seen in found),
        tuple(problem for seen in found for problem in seen.problems),
    )
