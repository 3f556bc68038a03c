"""What the rig wizard works on: the open bench and the draft of the rig, with one job at a time beside the window."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

from PySide6.QtCore import QObject, Signal, Slot

from app.ui.i18n import tr
from app.ui.workers import Worker
from core.config.calibration import CalibrationConfig
from core.config.models import Config
from core.config.rig_file import RigFile, write_rig
from hardware.calibration.bench import CalibrationBench, Perceive
from hardware.calibration.rig_draft import RigDraft

OpenBench = Callable[[Config, Perceive], CalibrationBench]
MakeSight = Callable[[Config], Perceive]

_END_MS = 30_000


class RigWizardModel(QObject):
    """Jobs run one after the other in a thread of their own; STOP does not wait for them.

    Signals: ``said`` a line of progress; ``failed`` a line of what went wrong; ``changed`` when a job began or ended; ``closed``
    when camera and port are free after ``close``.

    Parameters
    ----------
    config : what to start from.
    known : an earlier calibration of the rig, kept where nothing new is found.
    open_bench, make_sight : how a camera is opened, and how pictures are perceived; called in the thread.
    """

    said = Signal(str)
    failed = Signal(str)
    changed = Signal()
    closed = Signal()

    def __init__(
        self,
        config: Config,
        known: CalibrationConfig | None,
        open_bench: OpenBench,
        make_sight: MakeSight,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self.config = self._began_with = config
        self._known = known
        self._open_bench, self._make_sight = open_bench, make_sight
        self._see: Perceive | None = None
        self.draft: RigDraft | None = None
        self._bench: CalibrationBench | None = None
        self._then: Callable[[object], None] | None = None
        self.busy = ""
        self._thread = Worker("rig wizard", self)
        self._thread.done.connect(self._on_done)
        self._thread.failed.connect(self._on_failed)
        self._thread.ended.connect(self.closed)

    @property
    def is_busy(self) -> bool:
        return bool(self.busy)

    @property
    def bench(self) -> CalibrationBench | None:
        """The open bench."""
        return self._bench

    def run(self, what: str, job: Callable[[], object], then: Callable[[object], None] | None = None) -> None:
        """Do it beside the window, and then, in the window, go on with what it gave. Ignored while another job runs."""
        if self.is_busy:
            return
        self.busy, self._then = what, then
        if self._bench is not None:
            self._bench.stop.release()  # asking for the next step is the acknowledgement of a STOP
        self.changed.emit()
        self._thread.submit(what, job)

    def open_camera(self, config: Config, then: Callable[[object], None] | None = None) -> None:
        """Open another bench in the place of the one that is open; what was found with that is forgotten."""
        self.config = config
        known = self._known_of(config)

        def job() -> None:
            self._close_bench()
            if self._see is None:
                self._see = self._make_sight(config)
            self._bench = self._open_bench(config, self._see)
            with ExitStack() as undo:
                undo.callback(self._close_bench)  # a camera that gives no picture is none
                self._bench.warm_up()
                self.draft = RigDraft(self._bench, config, known, self.said.emit)
                undo.pop_all()

        self.run(tr("opening the camera"), job, then)

    def _known_of(self, config: Config) -> CalibrationConfig | None:
        """What was calibrated before, as far as it holds good for the bench that is opened now.

        Lens, scale and port are a camera's, with its size of picture; what was learnt of the servos is not another kind of bench's.
        """
        before = self._began_with
        if self._known is None or _is_same_camera(before, config):
            return self._known
        lost: dict[str, None] = dict.fromkeys(("lens", "scale", "port"))
        if config.rig.camera != before.rig.camera:
            lost |= dict.fromkeys(("steering", "zero", "assumed"))
        return self._known.model_copy(update=lost)

    @Slot()
    def stop(self) -> bool:
        """STOP: reaches the servos at once, from whatever thread. False: no step is running that could move them."""
        bench = self._bench  # asked once: the thread may be closing it
        if bench is None:
            return False
        bench.stop.press()
        return self.is_busy

    def save(self, rig: RigFile) -> str:
        """Save the rig; returns where. Raises RigFileError."""
        return str(write_rig(rig))

    def close(self) -> None:
        """Stop, and give camera and port back after the job that is still running; ``closed`` tells when."""
        self.stop()
        self._thread.submit("closing", self._close_bench)
        self._thread.stop(finish=True)

    def wait_closed(self) -> bool:
        """At the program's end: until all is given back; False where a driver hangs."""
        return self._thread.wait(_END_MS)

    def _close_bench(self) -> None:
        bench, self._bench, self.draft = self._bench, None, None
        if bench is not None:
            bench.close()

    @Slot(object, object)
    def _on_done(self, _key: object, given: object) -> None:
        then, self._then, self.busy = self._then, None, ""
        if then is not None:
            then(given)
        self.changed.emit()

    @Slot(object, str)
    def _on_failed(self, _key: object, line: str) -> None:
        self._then, self.busy = None, ""
        self.failed.emit(line)
        self.changed.emit()


def _is_same_camera(before: Config, now: Config) -> bool:
    """Whether both have the same camera, and pictures of the same size.

    One that was not named is whichever was there: found by its own sign now, it is taken for the same.
    """
    if before.rig.camera != now.rig.camera or before.rig.source != now.rig.source:
        return False
    if now.rig.camera == "twin":
        sizes = [(config.twin.image_width_px, config.twin.image_height_px) for config in (before, now)]
        return sizes[0] == sizes[1]
    was, is_now = before.camera, now.camera
    signs = (was.serial, is_now.serial) if now.rig.camera == "realsense" else (was.device, is_now.device)
    return signs[0] in {None, signs[1]} and (was.width_px, was.height_px) == (is_now.width_px, is_now.height_px)
