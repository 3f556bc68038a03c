"""The Model menu: the installed models with their measured accuracy, the one in use, and training a new one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QMainWindow, QMenu

from app.ui.actions import MenuEntry, add_menu
from app.ui.i18n import tr, tr_text
from app.widgets.messages import Offer, OfferButton
from core.perception.model_file import MODELS, ModelError, ModelInfo, models_in, own_models, read_model_info

if TYPE_CHECKING:  # the training dialog needs this file where there is no robot: not on Linux
    from app.ui.opening import Offers


@dataclass(frozen=True, slots=True)
class InstalledModel:
    """A model by the name it is called. ``problem``: why it cannot be used, "" when it can."""

    name: str
    folder: Path
    is_own: bool
    info: ModelInfo | None
    problem: str = ""

    @property
    def figures(self) -> str:
        """Its measured accuracy, in one line."""
        return figures_line(self.info) if self.info is not None else self.problem


def installed_models() -> list[InstalledModel]:
    """All models, shipped ones first; a damaged one is named as such. Hashes are checked when one is opened, not here."""
    found = []
    for place, is_own in ((MODELS, False), (own_models(), True)):
        for folder in models_in(place):
            try:
                info, problem = read_model_info(folder, verify=()), ""
            except ModelError as error:
                info, problem = None, str(error)
            found.append(InstalledModel(folder.name, folder, is_own, info, problem))
    return found


def figures_line(info: ModelInfo) -> str:
    """Dice of vessel and robot, on what; and whether it was taught what its confidence means."""
    figures: dict[str, Any] = info.figures
    parts = [tr("not measured")]
    if "vessel_dice" in figures and "robot_dice" in figures:
        vessel, robot = _figure(figures, "vessel_dice"), _figure(figures, "robot_dice")
        of_set = tr("pictures of {name}", name=figures.get("set", tr("a test set")))
        what = tr("held-out pictures") if figures.get("held_out") else of_set
        on = tr(" on {count} {what}", count=figures.get("frames", "?"), what=what)
        parts = [tr("Dice vessel {vessel}, robot {robot}", vessel=vessel, robot=robot) + on]
    if "state_agreement" in figures:
        parts.append(tr("state {share:.0f} %", share=100 * figures["state_agreement"]))
    if info.calibration is None:
        parts.append(tr("confidence not calibrated"))
    return ", ".join(parts)


def _figure(figures: dict[str, Any], name: str) -> str:
    """Now, and before training where that is known."""
    before = figures.get("before")
    now = f"{figures[name]:.2f}"
    return f"{before[name]:.2f} \N{RIGHTWARDS ARROW} {now}" if isinstance(before, dict) and name in before else now


_KEY = "model"


class ModelMenu(QObject):
    """Lists the models each time it opens. Choosing one is confirmed first, and refused while the program may drive.

    ``chosen`` carries the name of the model that is to be used from now on; ``said`` a line and whether it is a fault.

    Parameters
    ----------
    current : the name of the model in use.
    hindrance : why no other one may be chosen now, "" when one may.
    cost : what choosing another one costs now, as a sentence.
    teach : opens the window that teaches a bench.
    train : opens the training.
    """

    chosen = Signal(str)
    said = Signal(str, bool)

    def __init__(
        self,
        window: QMainWindow,
        offers: Offers,
        current: Callable[[], str],
        hindrance: Callable[[], str],
        cost: Callable[[], str],
        teach: Callable[[], object],
        train: Callable[[], object],
    ) -> None:
        super().__init__(window)
        self._window, self._offers = window, offers
        self._current, self._hindrance, self._cost = current, hindrance, cost
        entries = [MenuEntry(tr("Teach this &bench..."), teach), MenuEntry(tr("&Train on my annotations..."), train)]
        self._below = add_menu(window, tr("&Model"), entries)[0]
        self._menu = next(one for one in self._below.associatedObjects() if isinstance(one, QMenu))
        self._menu.setToolTipsVisible(True)
        self._actions: list[QAction] = []
        self._group = QActionGroup(self)
        self._menu.aboutToShow.connect(self.update_entries)
        self.update_entries()

    @property
    def entries(self) -> list[str]:
        """What is listed, as it was when the menu was opened last."""
        return [action.text() for action in self._actions if not action.isSeparator()]

    def update_entries(self) -> None:
        """Read the folders again: a training may have put a model there."""
        for action in self._actions:
            self._menu.removeAction(action)
            action.deleteLater()
        self._actions = []
        current = self._current()
        for model in installed_models():
            self._add(model, model.name == current or str(model.folder) == current)
        self._actions.append(self._menu.insertSeparator(self._below))

    def _add(self, model: InstalledModel, is_current: bool) -> None:
        own = tr(", own") if model.is_own else ""
        problem = f":  {model.problem}" if model.problem else ""
        name = f"{model.name.replace('&', '&&')}{own}{problem}"
        action = QAction(name, self._menu, checkable=True, checked=is_current)
        action.setEnabled(not model.problem)
        action.setToolTip(f"{model.figures}\n{model.folder}")
        action.triggered.connect(partial(self._on_chosen, model.name))
        self._group.addAction(action)
        self._menu.insertAction(self._below, action)
        self._actions.append(action)

    def _on_chosen(self, name: str, _checked: bool = False) -> None:
        current = self._current()
        if name == current:
            return
        if why := self._hindrance():
            self.said.emit(tr("The model stays {current}: {why}", current=current, why=tr_text(why)), True)
            return
        use = OfferButton(tr("Use {name}", name=name), partial(self._use, name))
        text = tr("Use model {name} instead of {current}?", name=name, current=current)
        self._offers.offer(Offer(_KEY, text, self._cost(), (use, OfferButton(tr("No"), lambda: None))))

    def _use(self, name: str) -> None:
        if why := self._hindrance():  # since the question was asked
            self.said.emit(tr("The model stays {current}: {why}", current=self._current(), why=tr_text(why)), True)
        else:
            self.chosen.emit(name)
