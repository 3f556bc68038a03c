"""What a LIVE rig needs before the program drives it: drums, directions, a model of this bench, a policy, an acceptance. Pure.

A rig without it stays advisory: pictures, advice and driving by hand. On a simulated rig nothing hinders. It is a function of the
settings in force: who changes them asks again.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from core.config.acceptance import Acceptance, AcceptanceError, is_outdated, read_acceptance
from core.config.models import Config, QualityConfig
from core.config.rig_file import RigFile, rig_in_use
from core.config.safety import LIMITS_FORCE, wiring_of
from core.control.modes import Hindrance
from core.perception.model_file import ModelError, ModelInfo, model_folder, read_model_info

BLIND_POLICIES = frozenset({"push", "random"})
"""Policies that do not look at the picture: baselines of trials."""
MOST_ROLL_DEG = 45.0
"""Beyond this roll right and left act mostly out of the picture, or the wrong way."""
_MOST_NOVELTY = float(QualityConfig().max_novelty)
"""A larger ``max_novelty`` lets pictures pass of kinds that the model does not know."""


@dataclass(frozen=True, slots=True)
class Readiness:
    """What stands against the program's driving of a rig; ``keyboard_deadman``: the keyboard alone may be the deadman."""

    hindrances: tuple[Hindrance, ...] = ()
    keyboard_deadman: bool = True


READY = Readiness()
"""Of a simulated rig."""


@dataclass(frozen=True, slots=True)
class RigRecords:
    """What is recorded of a rig: its file, the manifest of its model, and its acceptance; None: missing or unreadable.

    ``firmware`` is that of the seven servos; empty: they were not asked.
    """

    rig: RigFile | None = None
    model: ModelInfo | None = None
    accepted: Acceptance | None = None
    firmware: Sequence[int] = ()

    def readiness(self, config: Config) -> Readiness:
        """Of the LIVE rig as it is configured."""
        return readiness_of(config, self.rig, self.model, self.accepted, self.firmware)


def readiness_of(
    config: Config, rig: RigFile | None, model: ModelInfo | None, accepted: Acceptance | None, firmware: Sequence[int] = ()
) -> Readiness:
    """Of a LIVE rig, as it drives with `config`.

    None: it has no rig file, so nothing of it was learnt; the manifest of the model cannot be read, which another check
    reports; the acceptance is missing or unreadable. `firmware` is that of the seven servos; empty: they were not asked.
    """
    found: list[Hindrance] = []
    changed = accepted is not None and is_outdated(accepted, config, firmware)
    is_accepted = accepted is not None and not accepted.missing and not changed
    known = rig.calibration if rig is not None else None
    if config.servos.driver not in LIMITS_FORCE:
        found.append(Hindrance.FORCE_UNLIMITED)
    if known is None or known.drums is None or not known.drums.fit(config.servos):
        found.append(Hindrance.DRUMS_UNKNOWN)
    if known is None or known.wiring != wiring_of(config.servos):
        found.append(Hindrance.DIRECTIONS_UNKNOWN)
    elif known.assumed and not is_accepted:  # the acceptance has each direction confirmed by eye
        found.append(Hindrance.DIRECTIONS_ASSUMED)
    steering = known.steering if known is not None else None
    if steering is None or steering.turn_deg_per_mm is None:
        found.append(Hindrance.STEERING_UNKNOWN)
    elif abs(steering.roll_deg) > MOST_ROLL_DEG:
        found.append(Hindrance.STEERING_WRONG)
    if model is not None:
        reference = model.familiarity
        if model.calibration is None or reference is None or reference.working_size_px != config.perception.working_size_px:
            found.append(Hindrance.MODEL_UNCALIBRATED)
        elif rig is None or not _is_taught(config, rig, model):
            found.append(Hindrance.MODEL_UNTAUGHT)
    quality = config.perception.quality
    if not quality.enabled or quality.max_novelty > _MOST_NOVELTY:
        found.append(Hindrance.CHECKS_OFF)
    if config.policy.name in BLIND_POLICIES:
        found.append(Hindrance.POLICY_BLIND)
    if not is_accepted:
        found.append(Hindrance.ACCEPTANCE_OUTDATED if changed else Hindrance.NOT_ACCEPTED)
    return Readiness(tuple(found), keyboard_deadman=rig is not None and rig.keyboard_deadman)


def _is_taught(config: Config, rig: RigFile, model: ModelInfo) -> bool:
    """Whether the model was taught on the bench of the rig file, which is in force: pictures of another one are refused."""
    bench = str(Path(config.rig.file or "").parent / rig.bench) if rig.bench is not None else None
    is_its_bench = bench is not None and config.perception.bench == bench
    return is_its_bench and rig.model == config.perception.segmentation.model and "taught" in model.training


def read_readiness(config: Config, firmware: Sequence[int] = ()) -> Readiness:
    """The same with rig file, acceptance and manifest read from disk. Raises RigFileError."""
    return read_records(config, firmware).readiness(config)


def read_records(config: Config, firmware: Sequence[int] = ()) -> RigRecords:
    """What is recorded of the configured rig. Raises RigFileError."""
    found = rig_in_use(config)
    try:
        model = read_model_info(model_folder(config.perception.segmentation.model), verify=())
    except ModelError:
        model = None
    accepted = None
    if found is not None:
        with suppress(AcceptanceError):  # ``doctor`` and ``rig show`` say what is wrong with it
            accepted = read_acceptance(found[0])
    return RigRecords(found[1] if found is not None else None, model, accepted, firmware)
