"""A step of the wizard that is stopped half way leaves wires that nobody knows, and no zero is taken there."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from core.calibration.look import HeadNotSeen
from core.config import Config
from core.devices import DeviceError
from hardware import servo_wizard
from hardware.rig_draft import RigDraft
from hardware.servo_wizard import Zeros
from hardware.servos.probe import Stopped


class Bench:
    """No camera and no servos: the wizard's steps are told what happens."""

    bench = None

    def set_lens(self, _lens: object) -> None: ...

    def servos_config(self, servos: object) -> object:
        return servos


@pytest.fixture
def draft(monkeypatch: pytest.MonkeyPatch) -> RigDraft:
    monkeypatch.setattr(servo_wizard, "find_zeros", lambda *_: Zeros((0.1,) * 4))
    made = RigDraft(Bench(), Config())  # type: ignore[arg-type]
    made.find_zeros()
    return made


def ends(monkeypatch: pytest.MonkeyPatch, step: str, error: BaseException) -> None:
    def broken(*_: object) -> None:
        raise error

    monkeypatch.setattr(servo_wizard, step, broken)


@pytest.mark.parametrize("error", [Stopped("stopped"), KeyboardInterrupt()])
@pytest.mark.parametrize(("step", "run"), [("find_zeros", RigDraft.find_zeros), ("learn_steering", RigDraft.learn_steering)])
def test_stopped_half_way_there_are_no_zeros_until_they_are_found_anew(
    draft: RigDraft, monkeypatch: pytest.MonkeyPatch, step: str, run: Callable[[RigDraft], object], error: BaseException
) -> None:
    ends(monkeypatch, step, error)
    with pytest.raises(type(error)):
        run(draft)
    assert draft.zeros is None
    assert draft.zero is None
    assert not draft.are_zeros_known
    ends(monkeypatch, "learn_steering", AssertionError("zeroed where the wires happened to be"))
    with pytest.raises(DeviceError, match="find the zeros anew"):
        draft.learn_steering()
    monkeypatch.setattr(servo_wizard, "find_zeros", lambda *_: Zeros((0.2,) * 4))
    draft.find_zeros()
    assert draft.are_zeros_known
    ends(monkeypatch, "learn_steering", HeadNotSeen("no head"))
    with pytest.raises(HeadNotSeen):
        draft.learn_steering()
    assert draft.are_zeros_known, "a look that fails lets the wires go back"


def test_a_tendon_that_could_not_be_told_is_known_once_it_was_put_there_by_hand(
    draft: RigDraft, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(servo_wizard, "find_zeros", lambda *_: Zeros((0.0,) * 4, ("up: the head does not follow",)))
    monkeypatch.setattr(servo_wizard, "nudge", lambda *_: None)
    draft.find_zeros()
    assert not draft.are_zeros_known
    draft.nudge("up", 0.2)
    assert draft.are_zeros_known
    draft.find_zeros()
    assert not draft.are_zeros_known
