"""What was taken of a bench so far, in a folder: empty pictures, vessel, frames, corrections; and the step that comes next.

Without Qt. Everything is on disk as soon as it is taken, so that the window can be closed at any step and goes on there.
"""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum, StrEnum
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from app.ui.palette import ON_PICTURE, rgb
from core.bench.bench import Bench, BenchError, bench_from_frames, bench_from_pictures, read_bench, with_vessel, write_bench
from core.bench.coverage import VesselBranch, VesselCoverage, missing
from core.config.models import PerceptionConfig
from core.config.section import first_problem
from core.devices import UserError
from core.files import read_image, write_atomic
from core.learning import teaching
from core.learning.dataset import WORKING_SIZE_PX, mask_png, png, read_mask
from core.learning.teaching import Segment, TeachingFrame, TeachingPicture
from core.locks import FolderLock
from core.messages import message
from core.perception.segmentation import clean_mask, to_working
from core.types import Image, Mask, Point, Reason

FORMAT = 1
WANTED = 24
"""Frames that the model learns from, with those that are held out."""
ENOUGH_FRAMES, ENOUGH_BENDS = 16, 4
"""With so many frames, and so many of them that show a bend at a place where the robot had been, nothing more is asked for."""
MOST_FRAMES, _MOST_LIKE = 120, 40
"""More frames are not taken; from the second number on, with enough bends, only new places. The most diverse are learnt from."""
PLACES = 3
"""Places of the robot from which an empty picture is computed."""
_NEW_CELLS = 2
"""A frame in which the robot covers so many new cells of the vessel is taken."""
_OTHER_SHARE = 0.15
"""A frame whose robot differs this much (0..1) from that of each frame taken is taken, too."""
_BENT_PX = 6
"""Area, beyond unsure edges, that each of two robots covers alone that are as far inserted, when one is bent otherwise."""
_SAME_CELLS, _SAME_AREA = 1, 0.06
"""Robots are as far inserted when so many cells, at most, are covered by one alone, and their areas differ by this share."""
_STILL_LEVELS, _STILL_SHARE = 10, 4e-4
"""Pictures of which, a quarter as large, a smaller share differs by more than these grey levels show the same."""
_STILL_SIGMAS, _MOST_NOISE = 5.0, 6.0
"""In a noisy picture the difference must exceed so many standard deviations of the noise, too; more noise is a moved camera."""
_BUSY_SHARE = 2e-3
"""Share of the picture that changes while an empty picture is taken, when a hand or the robot moves."""
_LEAST_ROBOT_PX = 220
"""Area of what the model takes for a robot in the empty picture, above which it is pointed out."""
_LEAST_PIECE = 0.08
"""Pieces of a proposed vessel that are smaller, against the largest one, are left out."""
_CHECK_FROM, _CHECK_WITH = 5, 12
"""Frames, at least and at most, with which another one is compared before it is taken."""
_THUMB_WIDTH_PX = 152
_STATE, _BENCH, _VESSEL, _SET = "teaching.json", "bench", "vessel.png", "set"
_MASKS = "masks"
_PLANES = "vessel", "robot", "doubtful", "differs"
"""Masks of a frame, bits of one picture in ``masks/VERSION``; made again for another bench or ``teaching.MASKS_VERSION``."""
_OURS = ("empty", "places", "frames", "corrected", _MASKS)


class TeachingStep(IntEnum):
    """The steps in their order."""

    EMPTY = 0
    VESSEL = 1
    MOVE = 2
    FRAMES = 3
    TRAIN = 4


class LookKind(StrEnum):
    """What became of a picture while the robot is moved."""

    STILL = "still"
    SEEN = "seen"
    PLACE = "place"
    BEND = "bend"
    ABSENT = "absent"
    REJECTED = "rejected"
    FULL = "full"


@dataclass(frozen=True, slots=True)
class TakenLook:
    """What became of a picture.

    Attributes
    ----------
    reason : why it was rejected.
    needs_empty : no frame will do until the empty picture is taken again, or the camera is where it was.
    """

    kind: LookKind
    reason: str = ""
    needs_empty: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class TakenFrame:
    """A frame that was taken. ``thumb``: a small picture with the robot's mask on it, RGB. ``is_left_out``: by the user."""

    frame: TeachingFrame
    kind: LookKind
    thumb: Image
    is_left_out: bool = False
    is_corrected: bool = False

    @property
    def stem(self) -> str:
        return self.frame.picture.stem

    @property
    def is_used(self) -> bool:
        return not self.is_left_out and not self.frame.reason


@dataclass(frozen=True, slots=True, eq=False)
class TeachingView:
    """All that a window shows of a teaching; never changed.

    Attributes
    ----------
    empty, known, vessel : of the bench, None before they are known.
    drawn : the vessel as it is drawn so far, where it is not the bench's yet.
    places : pictures with the robot in other places, from which the empty one is computed.
    robot_like : outlines (N, 2) of what the model takes for a robot in the empty picture.
    frames : those taken, in their order.
    branches, tree : the vessel tree with where the robot has been; see ``VesselCoverage``.
    share : of the tree, 0..1.
    bends : frames that show a bend.
    model : name of the model that was trained, "" before that.
    """

    step: TeachingStep = TeachingStep.EMPTY
    empty: Image | None = None
    known: Mask | None = None
    vessel: Mask | None = None
    drawn: Mask | None = None
    places: tuple[Image, ...] = ()
    is_computed: bool = False
    robot_like: tuple[NDArray[np.int32], ...] = ()
    frames: tuple[TakenFrame, ...] = ()
    branches: tuple[VesselBranch, ...] = ()
    tree: NDArray[np.uint8] | None = None
    share: float = 0.0
    bends: int = 0
    model: str = ""

    @property
    def used(self) -> int:
        """Frames that are neither rejected nor left out."""
        return sum(taken.is_used for taken in self.frames)

    @property
    def missing(self) -> tuple[VesselBranch, ...]:
        """Branches in which the robot has not been."""
        return missing(self.branches)

    @property
    def is_enough(self) -> bool:
        return self.used >= ENOUGH_FRAMES and not self.missing and self.bends >= ENOUGH_BENDS

    @property
    def may_train(self) -> bool:
        return self.used >= teaching.FEWEST

    @property
    def may_leave(self) -> bool:
        """Whether the present step has what the next one needs."""
        return {
            TeachingStep.EMPTY: self.empty is not None,
            TeachingStep.VESSEL: self.vessel is not None,
            TeachingStep.MOVE: self.may_train,
            TeachingStep.FRAMES: self.may_train,
        }.get(self.step, bool(self.model))


class _FrameRow(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    stem: str = Field(pattern=r"^[0-9]{4}$")
    kind: LookKind
    left_out: bool = False


class _Record(BaseModel):
    """``teaching.json``; older ones say besides whether the model was used."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    format: int = Field(FORMAT, ge=1)
    step: TeachingStep = TeachingStep.EMPTY
    computed: bool = False
    robot_like: tuple[tuple[tuple[int, int], ...], ...] = ()
    frames: tuple[_FrameRow, ...] = ()
    next_stem: int = Field(0, ge=0)
    model: str = ""


class TeachingFolder:
    """The work on one bench. Its methods are called by one thread at a time, take up to seconds, and raise UserError.

    Nothing is read or written while another program, or another window, has the folder.

    Parameters
    ----------
    folder : made when the first picture is taken.
    name : what the bench is called.
    segment : the network that proposes a vessel, and points out a robot in the empty picture; called when it is first needed.
    on_frame : gets how many of how many frames are done in a job that takes long, and says whether to go on reading frames,
        or writing a set.
    """

    def __init__(
        self, folder: Path, name: str, segment: Callable[[], Segment], on_frame: Callable[[int, int], bool] = lambda *_: True
    ) -> None:
        self.folder, self._name, self._on_frame = folder, name, on_frame
        self._open_segment = segment
        self._segment: Segment | None = None
        self._lock = FolderLock()
        self._clear()

    def release(self) -> None:
        """Leave the folder to others."""
        self._lock.release()

    def _clear(self) -> None:
        self._record = _Record()
        self._bench: Bench | None = None
        self._drawn: Mask | None = None
        self._places: list[Image] = []
        self._frames: list[TakenFrame] = []
        self._blurred: list[NDArray[np.float32]] = []
        self._coverage: VesselCoverage | None = None
        self._last: Image | None = None

    # ---- from disk

    def load(self) -> None:
        """Read what was taken before; nothing where the folder is not there.

        Raises UserError for one that is damaged, or that another program has.
        """
        self._clear()
        if self.folder.is_dir():
            self._make_folder()
        path = self.folder / _STATE
        if not path.is_file():
            return
        try:
            record = _Record.model_validate_json(path.read_bytes())
        except OSError as error:
            raise BenchError(message("{path}: cannot be read ({why}); start over", path=path, why=error.strerror)) from None
        except ValidationError as error:
            raise BenchError(message("{path}: damaged ({why}); start over", path=path, why=first_problem(error))) from None
        if (self.folder / _BENCH).is_dir():
            self._bench = read_bench(self.folder / _BENCH)
        self._places = [read_image(place) for place in sorted((self.folder / "places").glob("*.png"))]
        bench, has_vessel = self._bench, self._bench is not None and self._bench.vessel is not None
        furthest = TeachingStep.TRAIN if has_vessel else TeachingStep.VESSEL if bench is not None else TeachingStep.EMPTY
        self._record = record.model_copy(update={"step": min(record.step, furthest)})
        if bench is not None and (self.folder / _VESSEL).is_file():
            with contextlib.suppress(UserError):  # damaged: it is drawn again
                drawn = read_mask(self.folder / _VESSEL)
                self._drawn = drawn if drawn.shape == bench.known.shape else None
        if has_vessel:
            for done, row in enumerate(record.frames):
                self._go_on(done, len(record.frames))
                with contextlib.suppress(UserError):  # a picture that was removed or is damaged: the others are kept
                    self._frames.append(self._taken(row.stem, row.kind, row.left_out))
            self._recount()
            self._check()

    def _taken(self, stem: str, kind: LookKind, is_left_out: bool) -> TakenFrame:
        """A frame from its files, with its mask by difference or as it was corrected."""
        assert self._bench is not None
        picture = TeachingPicture(stem, stem, read_image(self.folder / "frames" / f"{stem}.png"))
        frame = self._proposed(picture)
        corrected = self.folder / "corrected" / f"{stem}.png"
        is_corrected = corrected.is_file()
        if is_corrected:
            frame = _with_robot(frame, read_mask(corrected))
        return TakenFrame(frame, kind, thumb_of(frame), is_left_out, is_corrected)

    def _proposed(self, picture: TeachingPicture) -> TeachingFrame:
        """The frame with its masks by difference: those that were kept, or new ones, which are kept if usable."""
        assert self._bench is not None
        with contextlib.suppress(UserError):  # not kept, or damaged
            bits = read_image(self.folder / _masks() / f"{picture.stem}.png")[..., 0]
            if bits.shape == self._bench.known.shape:
                vessel, robot, doubtful, differs = (np.asarray(bits >> place & 1 > 0) for place in range(len(_PLANES)))
                return TeachingFrame(picture, vessel, robot, doubtful, differs=differs)
        frame = teaching.propose(picture, self._bench)
        if not frame.reason:
            self._keep_masks(frame)
        return frame

    def _keep_masks(self, frame: TeachingFrame) -> None:
        planes = [getattr(frame, name).astype(np.uint8) << place for place, name in enumerate(_PLANES)]
        self._write(_masks(), frame.picture.stem, png(np.bitwise_or.reduce(planes)))

    def _change_bench(self, bench: Bench) -> None:
        """Write another bench, for which no mask was made."""
        self._make_folder()
        if (self.folder / _MASKS).is_dir():
            try:
                shutil.rmtree(self.folder / _MASKS)
            except OSError as error:
                raise _not_written(self.folder / _MASKS, error) from None
        write_bench(bench, self.folder / _BENCH)
        self._bench = bench

    def start_over(self) -> None:
        """Remove all that was taken. A model that was trained stays."""
        self._make_folder()
        try:
            for name in (*_OURS, _BENCH, _SET):
                shutil.rmtree(self.folder / name, ignore_errors=False) if (self.folder / name).is_dir() else None
            for name in (_STATE, _VESSEL):
                (self.folder / name).unlink(missing_ok=True)
        except OSError as error:
            raise BenchError(message("{path}: cannot be removed ({why})", path=self.folder, why=error.strerror)) from None
        self._clear()

    def view(self) -> TeachingView:
        """What there is now."""
        bench, coverage, record = self._bench, self._coverage, self._record
        return TeachingView(
            record.step,
            bench.empty if bench is not None else None,
            bench.known if bench is not None else None,
            bench.vessel if bench is not None else None,
            self._drawn,
            tuple(self._places),
            record.computed,
            tuple(np.array(outline, np.int32) for outline in record.robot_like),
            tuple(self._frames),
            coverage.branches() if coverage is not None else (),
            coverage.tree() if coverage is not None else None,
            coverage.share if coverage is not None else 0.0,
            sum(taken.kind is LookKind.BEND and taken.is_used for taken in self._frames),
            record.model,
        )

    def go(self, step: TeachingStep) -> None:
        """Keep the step that the user is at."""
        self._keep(step=step)

    def keep_model(self, name: str) -> None:
        """Keep that a model of this name was trained from these frames."""
        self._keep(model=name)

    # ---- the empty bench

    def add_empty(self, pictures: Sequence[Image]) -> None:
        """Some pictures of the empty bench, taken at once, instead of those before.

        Raises
        ------
        BenchError
            Something moved, they are blurred, or the disk is full; what was taken before stays.
        """
        images = [to_working(picture, WORKING_SIZE_PX)[0] for picture in pictures]
        if _changed_share(images[0], images[-1]) > _BUSY_SHARE:
            raise BenchError("something moved while the pictures were taken: keep hands and robot still, and take them again")
        bench = bench_from_pictures(images, None, self._name, WORKING_SIZE_PX)
        self._use_bench(bench, is_computed=False)
        self._keep(robot_like=self._look_for_robot(bench.empty))

    def add_place(self, picture: Image) -> None:
        """A picture with the robot in another place; from the third one on the empty bench is computed of them.

        Raises
        ------
        BenchError
            The robot lies where it lay, or the disk is full.
        """
        image = to_working(picture, WORKING_SIZE_PX)[0]
        if self._places and self._places[0].shape != image.shape:
            self._places = []
        if any(_changed_share(image, other) < _STILL_SHARE for other in self._places):
            raise BenchError("the robot lies where it lay before: move it to another place, and take the picture again")
        places = [*self._places, image]
        bench = None
        if len(places) >= PLACES:
            segment = self._network()
            robots = [segment(one)[1] for one in places]
            bench = bench_from_frames(places, self._name, WORKING_SIZE_PX, None, robots)
        self._write("places", f"{len(places) - 1:02d}", png(image))
        self._places = places
        self._keep()
        if bench is not None:
            self._use_bench(bench, is_computed=True)

    def _use_bench(self, bench: Bench, *, is_computed: bool) -> None:
        """Put another empty bench in force, with the vessel that was drawn, where it fits; frames get other masks."""
        before = self._bench
        if before is not None and before.vessel is not None and before.vessel.shape == bench.known.shape:
            bench = with_vessel(bench, before.vessel)
        self._change_bench(bench)
        if self._drawn is not None and self._drawn.shape != bench.known.shape:
            self._drawn = None
        self._keep(computed=is_computed, robot_like=(), model="")
        self._propose_again()

    def _look_for_robot(self, empty: Image) -> tuple[tuple[tuple[int, int], ...], ...]:
        """Outlines, as points, of what the model takes for a robot, where it is large."""
        _, robot = self._network()(empty)
        outlines, _ = cv2.findContours((robot >= 0.5).view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        return tuple(tuple((x, y) for x, y in one[:, 0].tolist()) for one in outlines if cv2.contourArea(one) >= _LEAST_ROBOT_PX)

    # ---- the vessel

    def proposed_vessel(self) -> Mask:
        """The vessel (h, w) that the network sees in the empty picture; all False where it sees none."""
        assert self._bench is not None
        vessel, _ = self._network()(self._bench.empty)
        cleaning = PerceptionConfig().cleaning
        mask = clean_mask(vessel >= 0.5, cleaning.min_vessel_area_px, cleaning.max_hole_area_px)
        areas = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8)[2][1:, cv2.CC_STAT_AREA]
        return clean_mask(mask, int(_LEAST_PIECE * areas.max()), 0) if len(areas) else mask

    def set_vessel(self, vessel: Mask) -> None:
        """The vessel as it was drawn, (h, w). Raises BenchError where it cannot be one."""
        assert self._bench is not None
        if self._bench.vessel is None or not np.array_equal(self._bench.vessel, vessel):
            self._change_bench(with_vessel(self._bench, vessel))
            self._keep(model="")
            self._propose_again()
        self._drawn = None
        try:
            (self.folder / _VESSEL).unlink(missing_ok=True)
        except OSError as error:
            raise _not_written(self.folder / _VESSEL, error) from None

    def keep_drawn(self, vessel: Mask) -> None:
        """The vessel (h, w) as it is drawn so far, to go on with; nothing else is changed."""
        self._make_folder()
        try:
            write_atomic(self.folder / _VESSEL, mask_png(vessel))
        except OSError as error:
            raise _not_written(self.folder / _VESSEL, error) from None
        self._drawn = vessel

    def _propose_again(self) -> None:
        """Masks of all frames against another bench; corrected ones stay."""
        bench = self._bench
        if bench is None or bench.vessel is None:
            self._coverage = None
            return
        for place, taken in enumerate(self._frames):
            self._on_frame(place, len(self._frames))
            frame = self._proposed(taken.frame.picture)
            if taken.is_corrected:
                frame = _with_robot(frame, taken.frame.robot)
            self._frames[place] = replace(taken, frame=frame, thumb=thumb_of(frame))
        self._recount()
        self._check()

    # ---- frames

    def look(self, picture: Image) -> TakenLook:
        """Take a picture of the moving robot if it shows a new place or bend, and say what became of it."""
        bench, coverage = self._bench, self._coverage
        if bench is None or bench.vessel is None or coverage is None:
            return TakenLook(LookKind.STILL)
        if sum(taken.is_used for taken in self._frames) >= MOST_FRAMES:
            return TakenLook(LookKind.FULL)
        image = to_working(picture, WORKING_SIZE_PX)[0]
        if self._last is not None and self._last.shape == image.shape and _changed_share(image, self._last) < _STILL_SHARE:
            return TakenLook(LookKind.STILL)
        self._last = image
        stem = f"{self._record.next_stem:04d}"
        frame = teaching.propose(TeachingPicture(stem, stem, image), bench)
        if frame.reason.startswith(Reason.NO_ROBOT.value):
            return TakenLook(LookKind.ABSENT)
        if frame.reason:
            is_moved = frame.reason.startswith((Reason.BENCH_MOVED.value, Reason.OTHER_BENCH.value))
            return TakenLook(LookKind.REJECTED, frame.reason, needs_empty=is_moved)
        kind = self._kind_of(frame.robot)
        if kind is LookKind.SEEN:
            return TakenLook(kind)
        usable = [taken.frame for taken in self._frames if taken.is_used][-_CHECK_WITH:]
        if len(usable) >= _CHECK_FROM:
            try:
                reason = self._checked([*usable, frame])[-1].reason
            except teaching.TeachingError as error:
                return TakenLook(LookKind.REJECTED, str(error), needs_empty=True)
            if reason:
                return TakenLook(LookKind.REJECTED, reason)
        self._write("frames", stem, png(image))
        self._keep_masks(frame)
        self._frames.append(TakenFrame(frame, kind, thumb_of(frame)))
        self._blurred.append(_blurred(frame.robot))
        coverage.add(frame.robot)
        self._keep(frames=True, next_stem=self._record.next_stem + 1, model="")
        return TakenLook(kind)

    def _kind_of(self, robot: Mask) -> LookKind:
        """Whether a robot lies at a new place, or as deep as in other frames but bent otherwise; SEEN: neither."""
        coverage = self._coverage
        assert coverage is not None
        if not self._frames or coverage.new_cells(robot) >= _NEW_CELLS:
            return LookKind.PLACE
        bends = sum(taken.kind is LookKind.BEND and taken.is_used for taken in self._frames)
        if len(self._frames) >= _MOST_LIKE and bends >= ENOUGH_BENDS:
            return LookKind.SEEN
        cells, area = coverage.cells_under(robot), int(robot.sum())
        others = [taken.frame.robot for taken in self._frames]
        as_deep = [
            other
            for other in others
            if abs(int(other.sum()) - area) <= _SAME_AREA * area and (cells ^ coverage.cells_under(other)).sum() <= _SAME_CELLS
        ]
        if as_deep:
            return LookKind.BEND if all(_beside_px(robot, other) >= _BENT_PX for other in as_deep) else LookKind.SEEN
        blurred = _blurred(robot)
        return LookKind.PLACE if all(_apart(blurred, other) >= _OTHER_SHARE for other in self._blurred) else LookKind.SEEN

    def leave_out(self, stem: str, on: bool) -> None:
        """Leave a frame out, or take it in again."""
        self._replace(stem, is_left_out=on)
        self._keep(frames=True, model="")

    def correct(self, stem: str, robot: Mask | None) -> None:
        """Another mask (h, w) for the robot in a frame: it is certain there, and no check rejects it; None: that by difference."""
        place, taken = self._find(stem)
        if robot is not None:
            self._write("corrected", stem, mask_png(robot))
            frame = _with_robot(taken.frame, robot)
            self._frames[place] = replace(taken, frame=frame, thumb=thumb_of(frame), is_corrected=True, is_left_out=False)
            self._recount()
        else:
            path = self.folder / "corrected" / f"{stem}.png"
            try:
                path.unlink(missing_ok=True)
            except OSError as error:
                raise _not_written(path, error) from None
            self._frames[place] = self._taken(stem, taken.kind, taken.is_left_out)
            self._check()
        self._keep(frames=True, model="")

    def teaching_set(self) -> Path:
        """Write the frames to learn from, a quarter of them held out, and return their folder.

        Raises
        ------
        TeachingError, BenchError
            Too few frames are usable, the empty picture shows the robot, it was stopped, or the disk is full.
        """
        assert self._bench is not None
        self._check(raises=True)
        frames = [replace(taken.frame, reason=taken.frame.reason or _left_out(taken)) for taken in self._frames]
        corrected = {taken.stem for taken in self._frames if taken.is_corrected}
        chosen = teaching.choose(frames, WANTED)
        completed: list[TeachingFrame] = []
        for one in chosen:
            self._go_on(len(completed), len(chosen))
            completed.append(one if one.picture.stem in corrected else self._completed(one))
        chosen = [was if one.reason else now for was, now, one in zip(chosen, completed, self._checked(completed), strict=True)]
        teaching.write_teaching_set(self.folder / _SET, self._bench, chosen, [one for one in frames if one.reason], len(frames))
        self._go_on(len(chosen), len(chosen))
        return self.folder / _SET

    def _go_on(self, done: int, count: int) -> None:
        if not self._on_frame(done, count):
            raise teaching.TeachingError("stopped before the training began; the frames are kept")

    def _completed(self, frame: TeachingFrame) -> TeachingFrame:
        """The frame with what the network adds to its mask; while the robot moves there is no time for that."""
        assert self._bench is not None
        proposed = teaching.propose(frame.picture, self._bench, self._network())
        return frame if proposed.reason else replace(frame, robot=proposed.robot, doubtful=proposed.doubtful)

    def _checked(self, frames: Sequence[TeachingFrame]) -> list[TeachingFrame]:
        """A computed bench is not known where the robot always lay: no empty picture shows it there."""
        assert self._bench is not None
        return teaching.check(frames, self._bench, has_pictures=not self._record.computed)

    def _check(self, *, raises: bool = False) -> None:
        """Reasons against frames beside the others; corrected ones keep none."""
        try:
            checked = self._checked([taken.frame for taken in self._frames if not taken.is_left_out])
        except UserError:
            if raises:
                raise
            return
        found = {frame.picture.stem: frame for frame in checked}
        for place, taken in enumerate(self._frames):
            if taken.stem in found and not taken.is_corrected:
                self._frames[place] = replace(taken, frame=found[taken.stem])
        self._recount()

    def _recount(self) -> None:
        """Where the robot has been, from the frames that are used."""
        bench = self._bench
        assert bench is not None and bench.vessel is not None
        self._coverage = VesselCoverage(bench.vessel, bench.known)
        self._blurred = [_blurred(taken.frame.robot) for taken in self._frames]
        for taken in self._frames:
            if taken.is_used:
                self._coverage.add(taken.frame.robot)

    def _find(self, stem: str) -> tuple[int, TakenFrame]:
        return next((place, taken) for place, taken in enumerate(self._frames) if taken.stem == stem)

    def _replace(self, stem: str, *, is_left_out: bool) -> None:
        place, taken = self._find(stem)
        self._frames[place] = replace(taken, is_left_out=is_left_out)
        self._recount()

    # ---- to disk

    def _network(self) -> Segment:
        if self._segment is None:
            self._segment = self._open_segment()
        return self._segment

    def _make_folder(self) -> None:
        """Have the folder, for this program alone."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            is_ours = self._lock.take(self.folder)
        except OSError as error:
            raise _not_written(self.folder, error) from None
        if not is_ours:
            raise BenchError("another LumenPilot teaches this bench now: close it there, then close this window and open it again")

    def _write(self, kind: str, stem: str, data: bytes) -> None:
        self._make_folder()
        path = self.folder / kind / f"{stem}.png"
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomic(path, data)
        except OSError as error:
            raise _not_written(path, error) from None

    def _keep(self, *, frames: bool = False, **changes: object) -> None:
        """The record with these changes, on disk before it is in force; `frames`: their list, too."""
        if frames:
            rows = [_FrameRow(stem=taken.stem, kind=taken.kind, left_out=taken.is_left_out) for taken in self._frames]
            changes["frames"] = tuple(rows)
        record = self._record.model_copy(update=changes)
        self._make_folder()
        try:
            write_atomic(self.folder / _STATE, record.model_dump_json(indent=1).encode() + b"\n")
        except OSError as error:
            raise _not_written(self.folder / _STATE, error) from None
        self._record = record


def _masks() -> str:
    return f"{_MASKS}/{teaching.MASKS_VERSION}"


def _not_written(path: Path, error: OSError) -> BenchError:
    return BenchError(message("{path}: cannot be written ({why}); make room on the disk", path=path, why=error.strerror))


def _left_out(taken: TakenFrame) -> str:
    return "left out by hand" if taken.is_left_out else ""


def _with_robot(frame: TeachingFrame, robot: Mask) -> TeachingFrame:
    """A frame with a mask that was drawn: nothing of it is doubtful. One without a vessel stays rejected."""
    if not frame.vessel.any():
        return frame
    return replace(frame, robot=robot, doubtful=np.zeros(robot.shape, np.bool_), reason="")


def _changed_share(one: Image, other: Image) -> float:
    """Share of two pictures (h, w, 3) that differs, beyond noise and a change of light."""
    small = [cv2.resize(image, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA) for image in (one, other)]
    first, second = (image.astype(np.int16) for image in small)
    apart = second - first
    apart = np.abs(apart - np.median(apart[::2, ::2], axis=(0, 1)).astype(np.int16))
    noise = 1.4826 * np.median(apart[::2, ::2], axis=(0, 1))  # of a normal distribution by its median deviation
    return float(np.mean((apart > np.maximum(_STILL_LEVELS, _STILL_SIGMAS * np.minimum(noise, _MOST_NOISE))).any(axis=2)))


def _blurred(robot: Mask) -> NDArray[np.float32]:
    """The robot's mask as it is compared between frames."""
    return np.asarray(cv2.GaussianBlur(robot.astype(np.float32), (0, 0), 5.0)[::4, ::4], np.float32)


def _beside_px(one: Mask, other: Mask) -> int:
    """The lesser of the areas that each of two masks (h, w) covers alone, without unsure edges; 0 where a robot only goes on."""
    core = np.ones((3, 3), np.uint8)
    return min(int(cv2.erode(alone.view(np.uint8), core).sum()) for alone in (one & ~other, other & ~one))


def _apart(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """0: the same; 1: nothing in common."""
    return float(np.abs(one - other).sum() / max(float(one.sum() + other.sum()), 1.0))


def thumb_of(frame: TeachingFrame) -> Image:
    """The picture small, with the robot's mask in its colour."""
    image, robot = frame.picture.image, frame.robot
    scale = _THUMB_WIDTH_PX / image.shape[1]
    size = _THUMB_WIDTH_PX, max(1, round(image.shape[0] * scale))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    cover = cv2.resize(robot.astype(np.float32), size, interpolation=cv2.INTER_AREA)[:, :, None]
    ink = np.array(rgb(ON_PICTURE.ROBOT), np.float32)
    return np.asarray(small * (1 - 0.8 * cover) + ink * 0.8 * cover, np.uint8)


def middle_of(outline: NDArray[np.int32]) -> Point:
    """The middle of an outline (N, 2)."""
    x, y = outline.mean(axis=0).tolist()
    return x, y
