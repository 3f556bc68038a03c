"""A rig that is being calibrated: every step by itself, in any order that makes sense, by a window or by a command."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from core.calibration.camera import (
    BoardError,
    BoardSpec,
    BoardView,
    LensError,
    distort,
    find_board,
    fit_lens,
    scale_of_board,
    scale_of_clicks,
    undistort,
)
from core.calibration.servos import (
    Assignment,
    HeadNotSeen,
    NotIdentified,
    ServoFinding,
    SteeringNotSeen,
    alike,
    assign,
    feed_disagreement,
)
from core.config.calibration import CalibrationConfig, DrumsConfig, LensConfig, ScaleConfig, SteeringConfig, ZeroConfig
from core.config.models import Config
from core.config.rig_file import RigFile, make_rig
from core.config.safety import JointKind, JointName, ServosConfig, wiring_of
from core.config.servo_models import model_name, unsupported
from core.control.frame_reports import kept_view
from core.devices import DeviceError
from core.messages import message
from core.types import Image, Point
from hardware.calibration import servo_identification
from hardware.calibration.bench import CalibrationBench
from hardware.calibration.servo_probe import ProcedureStopped
from hardware.rig import RigKind
from hardware.servos.discovery import BAUDS, FoundServos, find_servos
from hardware.servos.dynamixel_port import ServoError

_NOTICEABLE_PX = 1.0
"""A lens that moves nothing by more than this in a picture 640 px wide is ignored: undistorting costs a millisecond a frame."""

_BOARD_MISSES = 6
"""Pictures in a row without the board, three seconds: a hand laid on it must not start the servos."""
_BOARD_LOOK_S, _BOARD_GONE_WITHIN_S = 0.5, 180.0
_MIRRORED_DEG = 90.0
"""Beyond this roll the head went left where it should go right."""

DRUMS_FIRST = (
    "say the diameters of the drums before anything moves, they decide how far and how hard a servo pulls: page Drums of the rig "
    "wizard, or rig calibrate --drums TENDONS,FEED,DELIVERY in mm"
)

Say = Callable[[str], object]


class RigDraft:
    """What is known so far. Each step replaces what it found before; ``rig_file`` puts all of it together.

    The steps that move servos (``identify``, ``identify_one``, ``find_zeros``, ``learn_steering``) need ``search_servos``
    before, and are ended by ``bench.stop``. They raise DeviceError or a UserError of ``core.calibration``, one line that says
    what to do.

    The `bench` is open, and the caller closes it; what was `known` stays where nothing new is found.
    """

    def __init__(
        self, bench: CalibrationBench, config: Config, known: CalibrationConfig | None = None, say: Say = lambda _: None
    ) -> None:
        self.bench, self.say = bench, say
        self.config = config
        self.spec = BoardSpec()
        self.views: list[BoardView] = []
        self.lens: LensConfig | None = known.lens if known is not None else None
        self.scale: ScaleConfig | None = known.scale if known is not None else None
        self.steering: SteeringConfig | None = known.steering if known is not None else None
        self.zero: ZeroConfig | None = known.zero if known is not None else None
        self.found: FoundServos | None = None
        self.findings: dict[int, ServoFinding] = {}
        self.assignments: tuple[Assignment, ...] = ()
        self.port = known.port if known is not None else None
        self._view = known.view if known is not None else None
        self._viewed_scale = self.scale
        self._assumed_earlier = known.assumed if known is not None else None
        self._wiring = known.wiring if known is not None else None
        self.drums: DrumsConfig | None = known.drums if known is not None else None
        self.zeros: servo_identification.Zeros | None = None
        self.notes: list[str] = []
        self._is_displaced = False
        self._nudged: set[str] = set()
        self.head_px: Point | None = None
        """Where the head was when the steering was learnt; None when it was not, or in an earlier calibration."""
        self._begun_with = self._findings()
        bench.set_lens(self.lens)

    @property
    def servos(self) -> ServosConfig:
        """As found out so far, on the bench's port."""
        return self.bench.servos_config(self.config.servos)

    @property
    def has_news(self) -> bool:
        """Whether something was found since, or set by hand, that is gone if ``rig_file`` is not saved."""
        return self._findings() != self._begun_with

    def _findings(self) -> tuple[object, ...]:
        known = (self.drums, self.lens, self.scale, self.steering, self.zero, self.zeros, self.port)
        return (self.config, *known, self.assignments, len(self.views), len(self.findings))

    # ---- lens and scale

    def take_board(self) -> tuple[Image, BoardView]:
        """Take one picture of the board and keep its corners; raises BoardError when there is no board in it."""
        image = self.bench.board_picture(self.spec)
        view = find_board(image, self.spec)
        self.views.append(view)
        self.say(
            message(
                "board {a}: {b} of {c} corners",
                a=len(self.views),
                b=len(view.pixels),
                c=(self.spec.columns - 1) * (self.spec.rows - 1),
            )
        )
        return image, view

    def forget_boards(self) -> None:
        """Drop the pictures taken."""
        self.views.clear()

    def wait_for_no_board(self, within_s: float = _BOARD_GONE_WITHIN_S) -> None:
        """Until the board is out of sight: no robot is seen under it. Raises BoardError when it stays."""
        ends_s, misses, is_told = time.monotonic() + within_s, 0, False
        while misses < _BOARD_MISSES:
            try:
                find_board(self.bench.board_picture(self.spec), self.spec)
            except BoardError:
                misses += 1
                self.bench.stop.sleep(_BOARD_LOOK_S)
                continue
            if time.monotonic() > ends_s:
                raise BoardError("the board is still in the picture: take it away, then go on")
            if not is_told:
                self.say("take the board away: the servos move when it is out of sight")
            misses, is_told = 0, True
            self.bench.stop.sleep(_BOARD_LOOK_S)

    def solve_boards(self) -> tuple[LensConfig | None, ScaleConfig]:
        """Lens and scale from the pictures taken; no lens where it hardly bends anything. Raises LensError, ScaleError."""
        if not self.views:
            raise LensError("no picture of the board was taken yet")
        size = self._picture_size()
        lens = fit_lens(self.views, size)
        width, height = lens.size_px
        border = np.array([(x, y) for x in (0.0, (width - 1) / 2, width - 1.0) for y in (0.0, (height - 1) / 2, height - 1.0)])
        bent_px = float(np.hypot(*(distort(border, lens) - border).T).max())
        straight: Sequence[BoardView] = self.views
        if bent_px * 640.0 / max(size) > _NOTICEABLE_PX:
            self.lens = lens
            straight = [BoardView(undistort(view.pixels, lens), view.board_mm) for view in self.views]
            self.say(message("lens: up to {a:.1f} px at the border, {b:.2f} px left over", a=bent_px, b=lens.residual_px))
        else:
            self.lens = None
            self.say(message("lens: straight enough ({a:.1f} px at the border)", a=bent_px))
        self.scale = scale_of_board(straight, size)
        self.bench.set_lens(self.lens)
        self._say_scale()
        return self.lens, self.scale

    def solve_clicks(self, first: Point, second: Point, length_mm: float) -> ScaleConfig:
        """The scale from two places of the (straightened) picture that are so far apart; raises ScaleError."""
        self.scale = scale_of_clicks(first, second, length_mm, self._picture_size())
        self._say_scale()
        return self.scale

    def _say_scale(self) -> None:
        assert self.scale is not None
        self.say(message("scale: {a:.4f} mm/px, ±{b:.2f} %", a=self.scale.mm_per_px, b=100 * self.scale.uncertainty_share))

    def _picture_size(self) -> tuple[int, int]:
        frame = self.bench.feed.newest or self.bench.feed.next_frames(1, 5.0)[0]
        return frame.image.shape[1], frame.image.shape[0]

    # ---- servos

    def search_servos(self, bauds: Sequence[int] | None = None) -> FoundServos:
        """Find the servos on the bench's port, and take over their speed and model.

        Raises DeviceError: no port, no answer, not as many as the robot has joints, or a model that is not supported.
        """
        servos = self.servos
        assert servos.port is not None
        if servos.driver != "dynamixel":
            raise DeviceError("only DYNAMIXEL servos can be told apart: write ids and signs of the joints into the rig file")
        count = len(servos.joints)
        chosen = bauds if bauds is not None else (servos.baud, *(baud for baud in BAUDS if baud != servos.baud))
        found = find_servos(servos.port, chosen, self.say, self.bench.stop.check, count)
        listed = ", ".join(f"{servo.id} {model_name(servo.model)}" for servo in found.servos)
        if found.elsewhere and len(found.servos) < count:
            others = "; ".join(f"{', '.join(map(str, ids))} at {baud} baud" for baud, ids in found.elsewhere)
            raise DeviceError(
                "servos at several speeds: {ids} at {a} baud; {others}; set all to one",
                ids=", ".join(map(str, found.ids)),
                a=found.baud,
                others=others,
            )
        if len(found.servos) != count:
            raise DeviceError(
                f"{len(found.servos)} servos answer, {count} are needed: {listed}; check cables, and that no id is used twice"
            )
        if refused := [f"id {servo.id}: {why}" for servo in found.servos if (why := unsupported(servo.model))]:
            raise DeviceError(refused[0])
        self.say(message("{count} servos at {a} baud: {ids}", count=count, a=found.baud, ids=", ".join(map(str, found.ids))))
        self.found = found
        self.findings = {servo_id: finding for servo_id, finding in self.findings.items() if servo_id in found.ids}
        if any(one.id not in found.ids for one in self.assignments):  # a servo was changed for another one
            self.assignments, self._wiring = (), None
        self._set_servos(_with_found(servos, found))
        return found

    def set_drums(self, drums: DrumsConfig) -> None:
        """The operator has measured the drums. What was found with other ones is unknown again: its millimetres were others."""
        before = self.config.servos
        self.drums = drums
        self._set_servos(drums.applied(before))
        if self.config.servos != before:
            self._forget_wires("zero and steering were found with other drums: find them anew")

    def _forget_wires(self, why: str) -> None:
        had = (self.zero, self.zeros, self.steering)
        self.zero = self.zeros = self.steering = self.head_px = None
        if any(one is not None for one in had):
            self.say(why)

    def wiggle(self, servo_id: int) -> None:
        """Turn one servo both ways, for the operator to watch."""
        with self._moving():
            servo_identification.wiggle(self.bench, self.servos, self._found().models, servo_id)

    def identify_one(self, servo_id: int) -> ServoFinding | None:
        """What one servo does, as the camera sees it; None when nothing is clear."""
        with self._moving():
            finding = servo_identification.identify_servo(self.bench, self.servos, self._found().models, servo_id, self.say)
        self.findings.pop(servo_id, None)
        if finding is not None:
            self.findings[servo_id] = finding
        return finding

    def identify(self) -> tuple[Assignment, ...]:
        """Who is who; raises NotIdentified when not all are clear."""
        for servo_id in self._found().ids:
            self.identify_one(servo_id)
        return self.take_findings()

    def take_findings(self) -> tuple[Assignment, ...]:
        """Name the servos after what was found; raises NotIdentified."""
        assigned = assign(self.findings, self.servos, self.found.ids if self.found is not None else ())
        self.set_assignments(assigned)
        if self.scale is not None:
            feed = feed_disagreement(self.findings, assigned, self.servos, self.scale, self._picture_size())
            if feed:
                self.say(feed)
                self.notes.append(feed)
        if alike(self.servos):
            self.notes.append(
                "up and down are assumed by the order of their ids: one camera cannot tell them apart; swap them if it is wrong"
            )
        return assigned

    @property
    def assumed(self) -> tuple[JointName, ...]:
        """Joints whose servos were not told apart: the order of their ids decided."""
        if not self.assignments:
            return self._assumed_earlier or ()
        return tuple(one.name for one in self.assignments if one.assumed)

    def confirm(self) -> None:
        """The operator has looked: what was assumed is right."""
        self.set_assignments([replace(one, seen="seen by eye", assumed=False) if one.assumed else one for one in self.assignments])

    def set_assignments(self, assignments: Sequence[Assignment]) -> None:
        """Take over who is who. Raises NotIdentified when a servo has two names, or a name no servo.

        Zero and steering are those of joints: where another servo is one of them, or turns the other way, they are unknown again.
        """
        names = [one.name for one in assignments]
        ids = {one.id for one in assignments}
        if sorted(names) != sorted(self.config.servos.names) or len(ids) != len(names):
            raise NotIdentified("every servo must have one name, and every name one servo")
        self.assignments = tuple(assignments)
        before = wiring_of(self.config.servos)
        servos = servo_identification.identified(self.servos, assignments)
        self._set_servos(servos if self.found is None else _with_found(servos, self.found))
        self._wiring = wiring_of(self.config.servos)
        if self._wiring != before:  # what was found by moving the servos was found with others in their places
            self._forget_wires("zero and steering were found with the servos in other places: find them anew")

    def find_zeros(self) -> servo_identification.Zeros:
        """Leave every tendon where it just becomes taut."""
        with self._moving():
            zeros = servo_identification.find_zeros(self.bench, self.servos, self.say)
        self.zeros, self.zero = zeros, None
        self._is_displaced = False
        self._nudged.clear()
        self.notes += zeros.problems
        self._keep_zero()
        return zeros

    def _keep_zero(self) -> None:
        """Remember where the servos stand, if all tendons are known to be at their zeros: the steering need not be learnt again."""
        if not self.are_zeros_known:
            return
        try:
            self._set_zero(servo_identification.standing_ticks(self.bench, self.servos))
        except ProcedureStopped:
            raise
        except ServoError as error:  # nothing has turned: the steering can be learnt all the same
            self.zero = None
            self.say(
                message("where the servos stand could not be kept ({why}): learn the steering, which keeps it, too", why=error)
            )

    def _set_zero(self, ticks: tuple[int, ...]) -> None:
        slack = self.zeros.slack_mm if self.zeros is not None else (0.0,) * len(self.config.servos.tendons)
        self.zero = ZeroConfig(
            ticks=ticks,
            slack_mm=slack,
            pretension_mm=self.config.servos.pretension_mm,
            found_utc=datetime.now(UTC).replace(microsecond=0),
        )

    @property
    def are_zeros_known(self) -> bool:
        """Whether all tendons are where they become taut: found so, or put there by hand."""
        return self.zeros is not None and all(problem.partition(":")[0] in self._nudged for problem in self.zeros.problems)

    @contextmanager
    def _moving(self) -> Iterator[None]:
        """A step that turns servos, and turns them back. After one that was stopped half way the wires' places are unknown.

        Raises DeviceError on a LIVE rig whose drums were not measured.
        """
        if self.bench.kind is RigKind.LIVE and self.drums is None:
            raise DeviceError(DRUMS_FIRST)
        try:
            yield
        except BaseException as error:
            went_back = isinstance(error, (HeadNotSeen, SteeringNotSeen, DeviceError))
            if went_back and not isinstance(error, ServoError):
                raise  # the wires went back
            self.zero = self.zeros = None
            self._is_displaced = True
            raise

    def learn_steering(self) -> SteeringConfig:
        """Learn in which direction each tendon moves the head, from where the wires become taut.

        Raises DeviceError, too, when that is not known: by a search in this draft, or an earlier one whose zero they stand at.
        """
        if self._is_displaced:
            raise DeviceError("a step was stopped half way and the wires are where it left them: find the zeros anew")
        kept = None if self.are_zeros_known else self.zero
        if kept is None and not self.are_zeros_known:
            raise DeviceError("it is not known where the wires are taut: find the zeros first")
        with self._moving():
            learnt = servo_identification.learn_steering(self.bench, self.servos, self.say, kept)
            if abs(learnt.steering.roll_deg) > _MIRRORED_DEG and self._turn_rotation_round():
                self.say("the head went to the other side: the rotation turns the other way; learning once more")
                learnt = servo_identification.learn_steering(self.bench, self.servos, self.say, kept)
        steering = learnt.steering
        self.steering, self.head_px = steering, learnt.head_px
        self._set_zero(learnt.zero_ticks)
        self.say(
            message(
                "steering: roll {a:+.0f}°, way and heading {b:.1f}° from a right angle, the head turns by {c:.0f}° per mm",
                a=steering.roll_deg,
                b=steering.disagreement_deg,
                c=steering.turn_deg_per_mm or 0.0,
            )
        )
        return steering

    def _turn_rotation_round(self) -> bool:
        """Take the other direction for a rotation whose direction is assumed; False without one. The wires' zeros stay."""
        rotation = self.config.servos.names[self.config.servos.places(JointKind.ROTATION)]
        if not set(rotation) & {one.name for one in self.assignments if one.assumed}:
            return False
        zeros = self.zero, self.zeros
        self.set_assignments([replace(one, sign=-one.sign) if one.name in rotation else one for one in self.assignments])
        self.zero, self.zeros = zeros
        return True

    def nudge(self, name: str, way_mm: float) -> None:
        """Tighten one tendon by so much, or let it go (negative), for the operator to watch."""
        with self._moving():  # a wire that strains lets all of them go
            servo_identification.nudge(self.bench, self.servos, name, way_mm)
            self.zero = None
            self._nudged.add(name)
        self._keep_zero()

    def set_pretension(self, pretension_mm: float) -> None:
        """Pull of every tendon at zero bend."""
        self._set_servos(ServosConfig.model_validate({**self.config.servos.model_dump(), "pretension_mm": pretension_mm}))
        if self.zero is not None:
            self.zero = self.zero.model_copy(update={"pretension_mm": pretension_mm})

    def _found(self) -> FoundServos:
        if self.found is None:
            raise DeviceError("search the servos first")
        return self.found

    def _set_servos(self, servos: ServosConfig) -> None:
        self.config = self.config.model_copy(update={"servos": servos})

    # ---- the end

    def calibration(self) -> CalibrationConfig:
        """All that was found, with a picture of now if the scale is new, or there was none."""
        if self._view is None or self.scale != self._viewed_scale:
            self._view, self._viewed_scale = self._view_now(), self.scale
        return CalibrationConfig(
            made_utc=datetime.now(UTC).replace(microsecond=0),
            assumed=self.assumed or None,
            wiring=self._wiring,
            drums=self.drums,
            lens=self.lens,
            scale=self.scale,
            steering=self.steering,
            zero=self.zero,
            port=self.port,
            view=self._view,
        )

    def _view_now(self) -> str | None:
        """What the camera shows, for noticing later that it was moved; None without a picture, or with the board in it."""
        frame = self.bench.feed.newest
        if frame is None:
            return None
        try:
            find_board(frame.image, self.spec)
        except BoardError:
            return kept_view(frame.image)
        return None

    def rig_file(self, name: str) -> RigFile:
        """The rig under this name, not saved yet; raises RigFileError."""
        return make_rig(self.config, name, self.calibration())


def _with_found(servos: ServosConfig, found: FoundServos) -> ServosConfig:
    """The bus with speed and models as found; joints whose servo is of another model than most have their own."""
    ((common, _), *_) = Counter(found.models.values()).most_common()
    joints = tuple(
        joint.model_copy(update={"model": None if (model := found.models.get(joint.id, common)) == common else model})
        for joint in servos.joints
    )
    change: dict[str, Any] = {"baud": found.baud, "model": common, "joints": joints}
    if {servos.model_of(joint).number for joint in servos.joints} != set(found.models.values()):
        change["min_voltage_v"] = None  # it was that of other servos
    return servos.model_copy(update=change)
