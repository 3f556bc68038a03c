"""Player, annotator and study."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QImage, QPainter
from PySide6.QtSvg import QSvgRenderer

from app.annotation_desk import AnnotationDesk, Item
from app.annotator_window import AnnotatorWindow
from app.evaluate_command import LikePaper, run_evaluate
from app.player_window import PlayerWindow
from app.screenshots.shots import SIZE, Studio
from app.screenshots.stage import Scenery, Stage
from app.synth_command import run_synth
from core.control.hand import AT_REST, Jog
from core.control.modes import Act
from core.errors import UserError
from core.learning.dataset import write_png
from core.session.events import Event, EventKind
from core.session.reader import SessionReader
from core.study.annotation_images import find_images
from core.study.annotation_records import ItemKey
from core.study.annotation_store import AnnotationStore
from core.study.annotations import View
from core.types import Point

_TARGET: Point = (560.0, 318.0)
_SHOWN_FRAME = 96
_PICTURES = 8
_STUDY_FRAMES, _STUDY_SEED = 64, 910_000
_FIGURE_WIDTH, _GAP = 780, 24


def player(studio: Studio) -> None:
    """A session: by hand, then handed over, stopped, and noted."""
    folder = _session(studio)
    window = PlayerWindow(SessionReader(folder), studio.config)
    window.resize(*SIZE)
    window.show()
    window.start()
    try:
        studio.until(lambda: window.rows > _SHOWN_FRAME and bool(window.events), "the session in the player")
        window.go(_SHOWN_FRAME)
        studio.until(lambda: window.place == _SHOWN_FRAME, "the frame in the player")
        window.select((window.time_s - 1.0, window.time_s + 1.5))
        studio.wait(0.3)
        studio.take(window, "player")
    finally:
        studio.close(window)


def _session(studio: Studio) -> Path:
    stage = Stage(studio.config, studio.pipeline, Scenery())
    try:
        stage.switch_on()
        stage.record(studio.folder / "sessions")
        stage.set_target(_TARGET)
        stage.jog = Jog(bend=0.2, advance=0.4)
        stage.run(24)
        stage.jog = AT_REST
        stage.run(8)
        stage.hand_over(_TARGET)
        stage.run(50)
        stage.note(Event(stage.now_s, EventKind.NOTE, "contrast agent is in"))
        stage.run(25)
        stage.pilot.ask(Act.STOP)
        stage.deadman = False
        stage.run(20)
        return stage.end_recording()
    finally:
        stage.close()


def annotator(studio: Studio) -> None:
    """Some pictures of the twin; the lines of the one in hand come from the algorithm, as G takes them over."""
    pictures = _pictures(studio)
    store = AnnotationStore(studio.folder / "annotations.sqlite")
    images, _ = find_images(pictures, store)
    items = [Item(image, ItemKey(image.sha256, "", "anna", 1), View.AS_IS) for image in images]
    window = AnnotatorWindow(AnnotationDesk(store, items, studio.config.perception, blind=False), "rater anna")
    window.resize(*SIZE)
    window.show()
    window.start()
    try:
        for place in (2, 1, 0):
            window.open(place)
            _annotate(studio, window)
        window.panels.toast.hide()
        studio.wait(0.3)
        studio.take(window, "annotator")
    finally:
        studio.close(window)


def _annotate(studio: Studio, window: AnnotatorWindow) -> None:
    desk = window.desk
    studio.until(lambda: desk.is_open, "the picture in the annotator")
    window.toggle_proposal()
    studio.until(lambda: desk.proposal is not None, "the algorithm's proposal")
    studio.wait(0.1)
    window.take_proposal()
    pose = desk.measure(desk.annotation).pose
    if pose is None:
        raise UserError("the algorithm had no lines for the annotator's picture; is the model the default one?")
    window.set_state(pose.state)
    studio.wait(0.1)


def _pictures(studio: Studio) -> list[Path]:
    folder = studio.folder / "annotated"
    folder.mkdir()
    paths = []
    for k, phantom in zip(range(_PICTURES), ("tree", "y_branch", "aortic_arch", "tortuous") * 2, strict=True):
        stage = Stage(studio.config, studio.pipeline, Scenery(phantom, start_mm=60.0 + 6.0 * k, seed=k))
        paths.append(folder / f"{phantom}_{k + 1}.png")
        write_png(paths[-1], stage.picture().image)
        stage.close()
    return paths


def study_figures(studio: Studio) -> None:
    """The figures of an evaluation like the paper's, on frames of the twin; none of them was trained on."""
    labelled, result = studio.folder / "labelled", studio.folder / "result"
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        run_synth(labelled, _STUDY_FRAMES, _STUDY_SEED, (640, 480), None, None)
        run_evaluate(
            labelled,
            None,
            result,
            as_json=True,
            model=None,
            preset=None,
            config_path=None,
            like_paper=LikePaper(1.5),
            seed=0,
        )
    figures = [QSvgRenderer(str(path)) for path in sorted(result.rglob("*.svg"))]
    scale = _FIGURE_WIDTH / max(figure.defaultSize().width() for figure in figures)
    sizes = [figure.defaultSize() * scale for figure in figures]
    rows = [max(size.height() for size in sizes[k : k + 2]) for k in range(0, len(sizes), 2)]
    room = 2 * _FIGURE_WIDTH + 3 * _GAP, sum(rows) + (len(rows) + 1) * _GAP
    page = QImage(*room, QImage.Format.Format_RGB32)
    page.fill(Qt.GlobalColor.white)
    painter = QPainter(page)
    for k, figure in enumerate(figures):
        left = _GAP + (k % 2) * (_FIGURE_WIDTH + _GAP)
        top = _GAP + sum(rows[: k // 2]) + (k // 2) * _GAP
        figure.render(painter, QRectF(left, top, sizes[k].width(), sizes[k].height()))
    painter.end()
    if not page.save(str(studio.out / "study_figures.png")):
        raise UserError(f"{studio.out}: cannot be written")
