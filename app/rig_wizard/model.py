"""The model of the rig wizard: the open bench, the draft of the rig, and one job at a time beside the window."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

from PySide6.QtCore import QObject, Signal

from app.ui.i18n import tr
from app.ui.workers import Worker
from core.config.calibration import CalibrationConfig
from core.config.models import Config
from hardware.calibration.bench import CalibrationBench, Perceive
from hardware.calibration.rig_draft import RigDraft

OpenBench = Callable[[Config, Perceive], CalibrationBench]
MakeSight = Callable[[Config], Perceive]

_END_MS = 30_000


class RigWizardModel(QObject):
    """Jobs run one after the other in a thread of their own; STOP does not wait for them.

    ``message`` carries a line of progress, ``failed`` a line of what went wrong; ``changed`` comes when a job began or ended,
    ``closed`` when camera and port are free after ``close``.

    Parameters
    ----------
    config : what to start from.
    known : an earlier calibration of the rig, kept where nothing new is found.
    open_bench, make_sight : how a camera is opened, and how pictures are perceived; called in the thread.
    """

    message = Signal(str)
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
        self.config = self._first_config = config
        self._known = known
        self._open_bench, self._make_sight = open_bench, make_sight
        self._perceive: Perceive | None = None
        self.draft: RigDraft | None = None
        self.bench: CalibrationBench | None = None
        self._then: Callable[[object], None] | None = None
        self.busy = ""
        """The job that runs, in words."""
        self.is_failed = False
        """Whether the last job failed, or STOP came while it ran."""
        self._worker = Worker("rig wizard", self)
        self._worker.done.connect(lambda _key, result: self._end_job(result))
        self._worker.failed.connect(lambda _key, line: self._end_job(None, line))
        self._worker.ended.connect(self.closed)

    @property
    def is_busy(self) -> bool:
        return bool(self.busy)

    def run(self, what: str, job: Callable[[], object], then: Callable[[object], None] | None = None) -> None:
        """Do a job in the thread, then call `then` with its result in the window's. Ignored while another job runs."""
        if self.is_busy:
            return
        self.busy, self._then = what, then
        if self.bench is not None:
            self.bench.stop.release()  # asking for the next step acknowledges a STOP
        self.changed.emit()
        self._worker.submit(what, job)

    def _end_job(self, result: object, failure: str = "") -> None:
        then, self._then, self.busy = self._then, None, ""
        self.is_failed = bool(failure) or (self.bench is not None and self.bench.stop.is_pressed)
        if failure:
            self.failed.emit(failure)
        elif then is not None:
            then(result)
        self.changed.emit()

    def open_camera(self, config: Config) -> None:
        """Open another bench instead of the one that is open; what was found with that is lost."""
        self.config = config
        known = self._still_valid(config)

        def job() -> None:
            self._close_bench()
            if self._perceive is None:
                self._perceive = self._make_sight(config)
            self.bench = self._open_bench(config, self._perceive)
            with ExitStack() as undo:
                undo.callback(self._close_bench)  # a camera that gives no picture is not used
                self.bench.warm_up()
                self.draft = RigDraft(self.bench, config, known, self.message.emit)
                undo.pop_all()

        self.run(tr("opening the camera"), job)

    def _still_valid(self, config: Config) -> CalibrationConfig | None:
        """The earlier calibration, as far as it is valid for the bench that is opened now.

        Lens, scale and port belong to a camera with its picture size; what was learnt of the servos to a kind of bench.
        """
        before = self._first_config
        if self._known is None or _is_same_camera(before, config):
            return self._known
        lost: dict[str, None] = dict.fromkeys(("lens", "scale", "port"))
        if config.rig.camera != before.rig.camera:
            lost |= dict.fromkeys(("steering", "zero", "assumed"))
        return self._known.model_copy(update=lost)

    def stop(self) -> bool:
        """STOP: reaches the servos at once, from any thread. False: no step is running that could move them."""
        bench = self.bench  # read once: the thread may be closing it
        if bench is None:
            return False
        bench.stop.press()
        return self.is_busy

    def close(self) -> None:
        """Stop, and give camera and port back after the job that is still running; ``closed`` tells when."""
        self.stop()
        self._worker.submit("closing", self._close_bench)
        self._worker.stop(finish=True)

    def wait_closed(self) -> bool:
        """At the program's end: wait until camera and port are free; False where a driver hangs."""
        return self._worker.wait(_END_MS)

    def _close_bench(self) -> None:
        bench, self.bench, self.draft = self.bench, None, None
        if bench is not None:
            bench.close()


def _is_same_camera(before: Config, now: Config) -> bool:
    """Whether both have the same camera, and pictures of the same size.

    A configuration that names no camera means any: one that is found by its own identifier now is taken for the same.
    """
    if before.rig.camera != now.rig.camera or before.rig.source != now.rig.source:
        return False
    if now.rig.camera == "twin":
        sizes = [(config.twin.image_width_px, config.twin.image_height_px) for config in (before, now)]
        return sizes[0] == sizes[1]
    was, is_now = before.camera, now.camera
    signs = (was.device, is_now.device) if now.rig.camera == "webcam" else (was.serial, is_now.serial)
    return signs[0] in {None, signs[1]} and (was.width_px, was.height_px) == (is_now.width_px, is_now.height_px)
