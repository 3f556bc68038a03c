"""The language of the windows, by Qt's own translation: English in the code, others from ``resources/translations``.

English is the language of everything that is kept or read by programs: session files, JSON, logs, the command line. A text is
translated only where it is shown. Core and hardware speak English; their texts with values are made by ``core.messages.message``
and translated by template. Those that come from a file or another process are recognised by the templates of the translation.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.config.models import RESOURCES
from core.config.schema import Effect, schema
from core.control.alerts import ALERTS, alert_of
from core.control.camera_monitor import RouteState
from core.control.faults import Cause
from core.control.gate import RejectReason
from core.control.joints import Limit
from core.control.modes import Hindrance
from core.messages import Message
from core.program import as_called
from core.types import Reason

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication


# Texts of core and hardware that no table and no ``message`` has, by subject: modes, requests, the settings file, joints, stages of
# perception, refusals, advice, faults, phantoms and looks of the twin, checks before driving, calibration, devices, edits.
FIXED = (
    "ADVISORY", "ARMED", "AUTONOMOUS", "HOLD", "STOPPED", "stop", "acknowledge", "arm", "hand over", "take back", "disarm",
    "port closed", "disarmed", "armed", "stopped", "quiet",
    "was no TOML",
    "was changed meanwhile", "had values that are not allowed", "too much is wrong", "right", "left", "up", "down", "advance",
    "rotation", "delivery_1", "delivery_2", "total", "prepare", "network", "masks", "skeletons", "gaps", "graph", "path",
    "pose", "sensitivity",
    "it has no pixels", "the network's output is not finite", "no centerline beside the robot's head",
    "it reaches the image border at its head, which may be out of view",
    "both of its ends lie at the image border, so its head may be out of view", "it has no direction",
    "the centerline beside the head has no direction", "no vessel was found", "no vessel that was found leads there",
    "on the centerline and along it", "straight on", "at the target", "along the route", "a bend ahead", "a bifurcation ahead",
    "the head must turn first", "the target is near",
    "the way seems to lie behind the head: looking again", "the way to the target branches off behind the head",
    "the robot is fed but its head does not move", "no report yet", "no frame yet", "no pose yet", "it shows something else",
    "not checked yet", "the servo process is not armed", "no sign of life yet", "the rig stopped while it was armed",
    "no frame behind the command", "checking the servos", "the torque is not proven to be off: cut the servos' power",
    "acknowledging", "zeroing the servos", "switching the torque off",
    "stopped meanwhile: acknowledge, then switch the servos on again",
    "the torque was switched off meanwhile: switch the servos on again", "S-curve", "Y-branch", "Tree with five ends",
    "Aortic arch with supra-aortic vessels", "Tortuous vessel", "Carotid siphon", "Three parallel channels", "Loop of two ways",
    "Coronary tree with stenosis", "Clear bench", "Your bench's own picture", "Silicone on white", "Silicone on red",
    "Silicone on dark", "Silicone on a coloured board", "Tinted liquid", "Opaque channels", "Channels in a clear block",
    "Lit from behind", "Fluoroscopy", "Subtraction angiography", "Turbid gel", "Creased drape", "Lamps of two colours",
    "Glowing liquid", "Tank of rippling water", "Printed photograph", "3D-printed resin", "camera", "picture", "cores and memory",
    "recordings", "clock", "model", "self-test", "python", "cameras found",
    "see the camera; close other programs that use it (fuser -v /dev/video*)", "packages", "system libraries",
    "display", "servo port", "servos", "adapter latency", "foot pedal", "gamepad", "not configured",
    "the rig has servos, but no port", "the bench twin needs none", "only real cameras are tried", "no RealSense camera",
    "no webcam", "plug it into a USB 3 port; if it is: another cable, or another port",
    "plug it in; if it is: another cable, or another port", "plug it in, or set camera.device",
    "check the cable; another USB port, without a hub", "lens cap, lamp, focus; or set camera.exposure_ms",
    "release STOP; check its wire", "release the E-stop; check the wire of its second contact", "check its USB cable",
    "check the pedal's power and firmware, then plug it in again",
    "set record.folder to one that can be written", "check the disk, or set record.folder",
    "restore the model folder, or set perception.segmentation.model to another one",
    "train it with the twin's frames too, or choose another model",
    "plug the USB adapter in, or set servos.port (ls /dev/serial/by-id)", "unplug the USB adapter and plug it in again",
    "see the servo port",
    "switch the servos' supply on, check cables, servos.baud and the joints' ids",
    "find the reason (jam, heat, supply), then restart that servo in the servo table", "Bench twin (no hardware)",
    "pulls the head to the right", "pulls the head to the left", "pulls the head out of the picture's plane", "feeds the robot",
    "feeds the catheter", "seen by eye",
    "up and down are assumed by the order of their ids: one camera cannot tell them apart; swap them if it is wrong",
    "zero and steering were found with the servos in other places: find them anew",
    "every servo must have one name, and every name one servo",
    "the robot's head is not seen: move the robot until all of its last centimetres are in the picture",
    "too little of the robot is seen: feed it farther into the vessel",
    "the robot's end has no direction: feed it farther into the vessel",
    "the head does not follow the wire: is it hung in, does the head lie free? Or zero it by eye",
    "a step was stopped half way and the wires are where it left them: find the zeros anew",
    "the board is still in the picture: take it away, then go on", "take the board away: the servos move when it is out of sight",
    "the head does not follow the wire's pull: pull it by hand, or zero it by eye",
    "the wire was taut before it was pulled: loosen it, then try again, or zero it by eye", "board", "two clicks",
    "draw the robot, from its tail to its head", "draw the vessel's centerline beside the head",
    "the vessel line ends too soon beside the head: draw it farther", "no answer", "the robot is not connected: connect it first",
    "the servo bus process does not listen: connect the robot again",
    "no RealSense camera: plug it into a USB 3 port; main.py doctor --rig realsense says more",
    "no webcam: plug it in; main.py doctor --rig webcam says more",
    "no pedal is configured: set pedal.port to its path in /dev/serial/by-id", "the bench twin has not told anything yet",
    "the bench twin did not start: free memory, then start the rig again (F5)", "put in a point", "move a point",
    "take out a point", "nudge a point", "add a point", "can tell", "can't tell", "no robot", "there is a robot",
    "note", "take the algorithm's lines",
    "nothing to save: no frames in memory yet", "the last seconds are still being saved", "relaxing the wires",
    "the tension is being let off: wait a moment, then try again", "stopped meanwhile: the wires are as they were then",
    "the wires were not let go in time: cut the servos' power", "the servo port is not open: switch the torque off",
    "the application ended meanwhile: nothing was switched on",
    "the twin's servos did not answer in time: close other programs, then try again; F5 starts the twin again", "bus speed",
    "adapter power", "screen lock", "inhibited while the servos follow",
    "switch screen lock and sleep off in the desktop's settings", "sleep cannot be inhibited: systemd-inhibit is not there",
    "the computer is too busy; close other programs, and rehearse again",
    "with DYNAMIXEL Wizard 2.0 set Baud Rate (8) of all seven to 1 Mbps, then servos.baud = 1000000",
    "images", "images looked at", "rows",
)  # fmt: skip

# Texts that core and hardware compose without ``message``. A value called by one letter is a number, any other may be a known text.
TEMPLATES = (
    "{path}: cut short: {a} of {b} pictures", "{path}: cut short: {a} of {b} s",
    "{path}: damaged after frame {a} ({why}), and not read on", "{path}: damaged before its first frame ({why}), and not read on",
    "highest vessel probability {a}, but only in specks",
    "highest robot probability {a}, but only in specks; it does not know such pictures: {why}",
    "highest robot probability {a}; it does not know such pictures: {why}", "highest robot probability {a}, but only in specks",
    "highest vessel probability {a}", "highest robot probability {a}",
    "what looks like it covers {a} % of the image (at most {b} %); it does not know such pictures: {why}",
    "what looks like one has walls beside the head that are blurred over {a} px (at most {b} px)",
    "the robot cannot go back any farther: take over, or choose another target", "newest frame {a} ms old", "{a} ms old",
    "{a} ms (at most {b} ms)", "outside its envelope: {where}: switch the torque off and move it back by hand, or zero it again",
    "{engine}, first frame in {a} ms: state {state} (true {truth}), theta off by {b} deg, head by {c} px",
    "not configured; none is plugged in", "{a} cores, {b} GB of memory, {c} GB free", "{a} core, {b} GB of memory, {c} GB free",
    "{what}; {a} V at least, {b} °C at most, torque off", "{port} reports; deadman released", "{port} reports; deadman pressed",
    "{names} can be loaded", "{joint}: taut {a} mm farther", "{joint}: taut {a} mm back",
    "the servo bus process cannot be started ({why}): free memory, then try again",
    "the pedal at {port} is silent: check its power and firmware, then plug it in again",
    "what comes from {port} is no pedal's report: check pedal.baud, the cable, and that it is the pedal",
    "gamepad {path} is not there: plug it in, or leave gamepad.device out to take the first",
    "gamepad {path} cannot be opened: plug it in, or leave gamepad.device out to take the first",
    "gamepad {name} is in use by another window, so its STOP does nothing here: close that window, or set gamepad.device",
    "gamepad {name} cannot be locked ({why}), so its STOP does nothing here: unplug it and plug it in again",
    "the bench twin cannot be started ({why}): free memory, then try again", "no answer", "damaged answer",
    "a late answer may still come", "no answer, behind two silent servos",
    "a rig's name has 1 to 60 letters, digits, or - _ . ( ) +, and begins with a letter or digit",
    "{path}: {key}: {why}; the default is used", "draw {what} mask", "simplify {what} mask", "clear the {what}",
    "take the algorithm's {what} mask", "{path}: has no video in it", "{path}: has a video of a kind that cannot be decoded here",
    "{path}: {key}: unknown key, kept but not used", "above {a} and at most {rest}", "above {a} and below {rest}",
    "at least {a} and below {rest}", "{a} to {end}, a multiple of {rest}", "at least {rest}", "above {rest}", "at most {rest}",
    "below {rest}", "it did not end properly: session recover {path} saves what can be had", "frames of {name}",
)  # fmt: skip


def texts_of_tables() -> Iterator[str]:
    """Texts that stand in tables of the core: reasons, every alert, every setting with its section and when it acts."""
    for words in (Reason, Cause, Hindrance, RouteState, RejectReason, Limit, Effect):
        yield from words
    for key, spec in ALERTS.items():
        yield from (spec.text, spec.what_to_do, alert_of(key, simulated=True).what_to_do)
    for section in schema().walk():
        yield from (section.title, section.description)
        for setting in section.settings:
            yield from (setting.title, setting.description)


CONTEXT = "LumenPilot"
"""The one context of all texts."""
FOLDER = RESOURCES / "translations"
AUTO, ENGLISH, CHINESE = "auto", "en", "zh"
"""What ``window.language`` may be."""
LOCALE = {CHINESE: "zh_CN"}
"""Languages that are translations, and how their files are called."""


@dataclass(slots=True)
class _InUse:
    """Which language the windows speak, how a text is looked up (None: English, as it stands in the code), what is missing."""

    code: str = ENGLISH
    lookup: Callable[[str], str] | None = None
    problem: str = ""


_IN_USE = _InUse()
_VALUE = re.compile(r"\{(\w+)\}")
_NUMBER = r"[-+]?\d[\d.]*"
_AS_WRITTEN: ContextVar[bool] = ContextVar("texts as written", default=False)


def mark(text: str) -> str:
    """A text in a table that is translated later, by ``tr`` where it is shown; it stays as it is."""
    return text


def tr(text: str, /, **values: object) -> str:
    """`text` in the language of the windows, with `values` in the places of its {names}."""
    shown = as_called(text if _IN_USE.lookup is None or _AS_WRITTEN.get() else _IN_USE.lookup(text))
    return shown.format(**values) if values else shown


def tr_text(text: str) -> str:
    """A finished text of a layer below in the language of the windows; an unknown one stays English."""
    if _IN_USE.lookup is None or _AS_WRITTEN.get() or not text:
        return as_called(text)
    if isinstance(text, Message) and text.values and (shown := tr(text.template)) != text.template:
        return shown.format(**{name: tr_text(value) for name, value in text.values.items()})
    return _recognised(str.__str__(text))


@lru_cache(maxsize=1024)
def _recognised(text: str) -> str:
    """A text of a file or another process: a known one, or one made by a known template."""
    whole = tr(text)
    if whole != text:
        return whole
    for template, pattern in _patterns():
        found = pattern.fullmatch(text)
        if found is not None:
            return tr(template, **{name: tr_text(part) for name, part in found.groupdict().items()})
    return text


@cache
def _patterns() -> tuple[tuple[str, re.Pattern[str]], ...]:
    """The more words of its own a template has, the earlier it is tried: a short one would fit the texts of longer ones."""

    def order(template: str) -> tuple[int, int]:
        return -len(_VALUE.sub("", template)), sum(len(name) > 1 for name in _VALUE.findall(template))  # numbers fit less

    templates = sorted(templates_below(), key=order)
    return tuple((template, _pattern(template)) for template in templates)


def templates_below() -> set[str]:
    """The templates of core and hardware that a translation has."""
    found = set(TEMPLATES)
    path = FOLDER / f"lumenpilot_{LOCALE[CHINESE]}.ts"
    for entry in ET.parse(path).getroot().iter("message") if path.is_file() else ():  # our own file
        place, source = entry.find("location"), entry.findtext("source") or ""
        is_below = place is not None and place.get("filename", "").startswith(("../../core/", "../../hardware/"))
        if is_below and _VALUE.search(source):
            found.add(source)
    return found


def _pattern(template: str) -> re.Pattern[str]:
    parts = _VALUE.split(template)
    made, named = [], set[str]()
    for k, part in enumerate(parts):
        if k % 2 == 0:
            made.append(re.escape(part))
        else:
            made.append(f"(?P={part})" if part in named else rf"(?P<{part}>{_NUMBER if len(part) == 1 else '.+?'})")
            named.add(part)
    return re.compile("".join(made), re.DOTALL)


@contextmanager
def english_texts() -> Iterator[None]:
    """In here, and in this thread only, texts are English: what is kept in a file is."""
    token = _AS_WRITTEN.set(True)
    try:
        yield
    finally:
        _AS_WRITTEN.reset(token)


def language_in_use() -> str:
    """ "en", or the translation's code."""
    return _IN_USE.code


def language_problem() -> str:
    """What ``use_language`` has said: empty, or one line about what is missing."""
    return _IN_USE.problem


def wanted(choice: str) -> str:
    """The language of a choice: the system's where it is "auto"; English where there is no such translation."""
    if choice != AUTO:
        return choice if choice in LOCALE else ENGLISH
    from PySide6.QtCore import QLocale

    names = QLocale.system().uiLanguages()
    code = names[0].replace("_", "-").partition("-")[0].lower() if names else ENGLISH
    return code if code in LOCALE else ENGLISH


def use_language(application: QApplication, choice: str = AUTO, folder: Path = FOLDER) -> str:
    """Speak this language from now on, in windows that are opened later.

    Parameters
    ----------
    application : the one there is.
    choice : "auto", "en" or "zh"; an unknown one is English.
    folder : of the translations.

    Returns
    -------
    str
        Empty, or one line about what is missing: the translation (it stays English then), or a font that has its letters.
    """
    from PySide6.QtCore import QCoreApplication, QLibraryInfo, QTranslator

    for old in application.findChildren(QTranslator):
        application.removeTranslator(old)
        old.deleteLater()
    _IN_USE.code, _IN_USE.lookup, _IN_USE.problem = ENGLISH, None, ""
    _recognised.cache_clear()
    code = wanted(choice)
    if code not in LOCALE:
        return ""
    own = QTranslator(application)
    path = folder / f"lumenpilot_{LOCALE[code]}.qm"
    if not own.load(str(path)) or own.isEmpty():
        own.deleteLater()
        _IN_USE.problem = f"{path.name} is missing or damaged, so the windows are in English: put back resources/translations"
        return _IN_USE.problem
    application.installTranslator(own)
    of_qt = QTranslator(application)  # buttons and dialogs of Qt itself
    if of_qt.load(f"qtbase_{LOCALE[code]}", QLibraryInfo.path(QLibraryInfo.LibraryPath.TranslationsPath)):
        application.installTranslator(of_qt)
    _IN_USE.code, _IN_USE.lookup, _IN_USE.problem = code, _looked_up(QCoreApplication.translate), font_problem(code)
    return _IN_USE.problem


def _looked_up(translate: Any) -> Callable[[str], str]:
    return lru_cache(maxsize=4096)(lambda text: str(translate(CONTEXT, text)))


def font_problem(code: str) -> str:
    """Empty, or one line: no font has the letters of this language. There must be an application."""
    from PySide6.QtGui import QFontDatabase

    if code != CHINESE or QFontDatabase.families(QFontDatabase.WritingSystem.SimplifiedChinese):
        return ""
    return "No font with Chinese letters is installed, so they show as boxes: install the package fonts-noto-cjk"
