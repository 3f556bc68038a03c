"""The entries of the File menu that switch the live output on and off, and say where it is."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import QObject, Signal

from app.operator.window import OperatorWindow
from app.ui.actions import MenuEntry, add_menu
from app.ui.i18n import mark, tr, tr_text
from core.session.live_output import LiveOutput, OutputKind, open_output

_TEXTS = {OutputKind.FOXGLOVE: mark("Stream for &Foxglove"), OutputKind.LSL: mark("Outlets for LS&L")}


class LiveMenuController(QObject):
    """Lives as long as the window, whose recorder hands frames and events to the outputs that are on.

    Parameters
    ----------
    window : gets the entries.
    outputs : those that are being opened.
    """

    _changed = Signal(object)
    """An output, from its thread."""

    def __init__(self, window: OperatorWindow, outputs: dict[OutputKind, LiveOutput]) -> None:
        super().__init__(window)
        self._window, self._outputs = window, dict(outputs)
        entries = [MenuEntry(tr(text), partial(self.toggle, kind), checked=False) for kind, text in _TEXTS.items()]
        self._actions = dict(zip(_TEXTS, add_menu(window, tr("&File"), entries), strict=True))
        self._ended: list[LiveOutput] = []
        self._changed.connect(self._on_changed)
        for output in outputs.values():
            self._follow(output)
        self._use()

    def close(self) -> None:
        ending = [*self._ended, *self._outputs.values()]
        for output in ending:
            output.end()
        for output in ending:
            output.close()

    def toggle(self, kind: OutputKind) -> None:
        running = self._outputs.pop(kind, None)
        if running is not None:
            running.end()
            self._ended.append(running)
        else:
            self._outputs[kind] = output = open_output(kind, self._window.rig.config.stream.port)
            self._follow(output)
        self._use()

    def _follow(self, output: LiveOutput) -> None:
        output.on_change = partial(self._changed.emit, output)
        if output.address or output.problem:  # it was quicker
            self._changed.emit(output)

    def _on_changed(self, output: LiveOutput) -> None:
        kind = next((kind for kind, one in self._outputs.items() if one is output), None)
        if kind is None:  # switched off meanwhile
            return
        if output.problem:
            del self._outputs[kind]
            self._window.say(tr_text(output.problem), is_fault=True)
        else:
            self._window.say(tr("Live output: {address}", address=output.address))
        self._use()

    def _use(self) -> None:
        """Hand frames to those that are on, and show which are."""
        self._window.recorder.use_outputs(self._outputs.values())
        for kind, action in self._actions.items():
            output = self._outputs.get(kind)
            action.setChecked(output is not None)
            address = output.address if output is not None else ""
            action.setText(f"{tr(_TEXTS[kind])}: {address}" if address else tr(_TEXTS[kind]))
