"""The Model menu: which models there are and how good, which one is used, and another one on request; training a new one."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QMainWindow, QMenu

from app.installed_models import InstalledModel, installed_models
from app.language import tr, tr_text
from app.menus import MenuEntry, add_menu
from app.recovery_desk import Offers
from app.widgets.offer_strip import Answer, Offer

_KEY = "model"


class ModelMenu(QObject):
    """Lists the models anew each time it opens. Nothing is chosen without a question, and nothing while the program may drive.

    ``chosen`` carries the name of the model that is to be used from now on; ``said`` a line for people and whether it is a fault.

    Parameters
    ----------
    current : the name of the model in use.
    hindrance : why no other one may be chosen now, "" when one may.
    cost : what choosing another one costs now, as a sentence.
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
        train: Callable[[], object],
    ) -> None:
        super().__init__(window)
        self._window, self._offers = window, offers
        self._current, self._hindrance, self._cost = current, hindrance, cost
        (self._train,) = add_menu(window, tr("&Model"), [MenuEntry(tr("&Train on my annotations..."), train)])
        menu = self._train.associatedObjects()
        self._menu = next(one for one in menu if isinstance(one, QMenu))
        self._menu.setToolTipsVisible(True)
        self._actions: list[QAction] = []
        self._group = QActionGroup(self)
        self._menu.aboutToShow.connect(self.renew)
        self.renew()

    @property
    def entries(self) -> list[str]:
        """What is listed, as it was when the menu was opened last."""
        return [action.text() for action in self._actions if not action.isSeparator()]

    def renew(self) -> None:
        """Read the folders again: a training may have put a model there."""
        for action in self._actions:
            self._menu.removeAction(action)
            action.deleteLater()
        self._actions = []
        current = self._current()
        for model in installed_models():
            self._add(model, model.name == current or str(model.folder) == current)
        separator = self._menu.insertSeparator(self._train)
        self._actions.append(separator)

    def _add(self, model: InstalledModel, is_current: bool) -> None:
        own = tr(", own") if model.is_own else ""
        action = QAction(f"{model.name.replace('&', '&&')}{own}:  {model.figures}", self._menu)
        action.setCheckable(True)
        action.setChecked(is_current)
        action.setEnabled(not model.problem)
        action.setToolTip(str(model.folder))
        action.triggered.connect(partial(self._on_chosen, model.name))
        self._group.addAction(action)
        self._menu.insertAction(self._train, action)
        self._actions.append(action)

    def _on_chosen(self, name: str, _checked: bool = False) -> None:
        current = self._current()
        if name == current:
            return
        if why := self._hindrance():
            self.said.emit(tr("The model stays {current}: {why}", current=current, why=tr_text(why)), True)
            return
        use = Answer(tr("Use {name}", name=name), partial(self._take, name))
        text = tr("Use model {name} instead of {current}?", name=name, current=current)
        self._offers.offer(Offer(_KEY, text, self._cost(), (use, Answer(tr("No"), lambda: None))))

    def _take(self, name: str) -> None:
        if why := self._hindrance():  # since the question was asked
            self.said.emit(tr("The model stays {current}: {why}", current=self._current(), why=tr_text(why)), True)
        else:
            self.chosen.emit(name)
