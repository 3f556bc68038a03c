"""The supported DYNAMIXEL X servos: number, units, supply, stall figures, protection. Pure; from each model's page of the e-Manual.

``ServosConfig.model_of`` gives a joint's model. A servo that is not in the table is refused by name, because its current, voltage
and force would be misread.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

PWM_FULL = 885
"""Goal PWM(100) and PWM Limit(36) at a duty of 100 %."""
_WATCHDOG_FIRMWARE = 38
"""First firmware with Bus Watchdog(98) in the 430 and 540 size; the 330 size had it from its first firmware on."""
_LOWEST_SUPPLY_SHARE = 0.875
"""Of the recommended supply: 10.5 of 12 V, 4.4 of 5 V. Below, the supply sags, and the motor is weaker than its figures say."""
_FRICTION_SHARE = 0.057
"""Of the stall torque: what the gear's friction takes at most. The line of the XM430-W350's performance graph in the e-Manual
(0.84 N m at 0.60 A, 2.45 N m at 1.50 A) ends at no torque with 0.13 A, which are 0.23 of 4.1 N m. Without load it takes less: a
user saw 13 mA (DynamixelSDK issue 564)."""
_SHUTDOWN_MARGIN_C = 5.0
"""The program ends the driving so far below the temperature at which the servo switches itself off."""

_STRAIN_SHARE = 0.9
"""Of the current to which a servo limits itself: from there on it is strained."""


@dataclass(frozen=True, slots=True)
class ServoModel:
    """One model.

    Attributes
    ----------
    number : of register 0.
    current_unit_ma : one unit of Present Current(126) and Goal Current(102); None: the model reports a load in 0.1 % there, and has
        neither a goal current nor the current-based position mode (5).
    supply_v : lowest and highest supply; ``recommended_v`` is the one of the stall figures and of ``no_load_rpm``.
    max_temperature_c : factory value of Temperature Limit(31).
    is_small : the 330 size. It has 20 indirect addresses instead of 28, its motor goes on when the bus watchdog trips, and its
        current is that of the supply.
    """

    number: int
    name: str
    current_unit_ma: float | None
    supply_v: tuple[float, float]
    recommended_v: float
    stall_ma: float
    stall_nm: float
    no_load_rpm: float
    max_temperature_c: float
    is_small: bool = False

    @property
    def has_current_mode(self) -> bool:
        """Whether the servo limits its own current: mode 5 with Goal Current(102)."""
        return self.current_unit_ma is not None

    @property
    def watchdog_firmware(self) -> int:
        """First firmware that has the bus watchdog."""
        return 1 if self.is_small else _WATCHDOG_FIRMWARE

    @property
    def lowest_v(self) -> float:
        """A lower supply ends the driving."""
        return round(_LOWEST_SUPPLY_SHARE * self.recommended_v, 1)

    @property
    def hottest_c(self) -> float:
        """A hotter servo ends the driving, before it switches itself off."""
        return self.max_temperature_c - _SHUTDOWN_MARGIN_C

    @property
    def friction_ma(self) -> float:
        """A higher current is not taken for friction of gear and wire."""
        return _FRICTION_SHARE * self.stall_ma

    @property
    def friction_nm(self) -> float:
        """Torque at the horn that the gear's friction takes at most; it hinders a motor that pulls, and helps one that holds."""
        return _FRICTION_SHARE * self.stall_nm

    def current_ma(self, units: int) -> float | None:
        """Current of a register; None for models that report a load."""
        return None if self.current_unit_ma is None else units * self.current_unit_ma

    def torque_nm(self, current_ma: float) -> float:
        """Torque at the horn of a standing motor, its gear's friction included.

        Notes
        -----
        The 330 size measures the current of its supply (e-Manual, XC330, Current Limit). At a duty d that is d times the motor's
        current, and d is the share of the stall current that the motor draws: so the torque grows with the root of the current.
        Taken in proportion, a tenth of the stall current would be a tenth of the stall torque, where it really is a third.
        """
        share = current_ma / self.stall_ma
        return self.stall_nm * (math.copysign(math.sqrt(abs(share)), share) if self.is_small else share)

    def current_for_ma(self, torque_nm: float) -> float:
        """The current that gives no more than this torque, whatever the supply within its range."""
        share = torque_nm / self.stall_nm
        if not self.is_small:
            return self.stall_ma * share
        return self.stall_ma * share * share * self.recommended_v / self.supply_v[1]

    def pwm_for(self, torque_nm: float) -> int:
        """The duty (of ``PWM_FULL``) that gives no more than this torque, whatever the supply within its range."""
        return min(PWM_FULL, math.floor(PWM_FULL * torque_nm / self.stall_nm * self.recommended_v / self.supply_v[1]))


@dataclass(frozen=True, slots=True)
class ForceLimit:
    """How a servo keeps a joint's force: in register 102 (current-based position mode) or 100 (duty, in extended position mode).

    Attributes
    ----------
    units : value of the register, at least 1: 0 would switch the motor off.
    force_n : what it means at the drum, the gear's friction included.
    current_ma : the same as current; None for models without it.
    speed_mm_s : what the joint reaches at most without load.
    friction_n : what the gear's friction takes of the force at the drum at most.
    """

    register: int
    units: int
    force_n: float
    current_ma: float | None
    speed_mm_s: float
    friction_n: float

    @property
    def is_weak(self) -> bool:
        """Whether friction may take it all: the joint may not move, and its current does not tell a wire that is pulled."""
        return self.force_n <= self.friction_n

    @property
    def strain_ma(self) -> float | None:
        """A servo that draws more gives all that it may; None for models that report no current."""
        return None if self.current_ma is None else _STRAIN_SHARE * self.current_ma


GOAL_PWM, GOAL_CURRENT = 100, 102
"""Registers of the two limits."""


def drum_radius_mm(mm_per_turn: float) -> float:
    """Radius of a drum that moves its wire so far in a turn."""
    return mm_per_turn / (2.0 * math.pi)


def force_limit(model: ServoModel, mm_per_turn: float, max_force_n: float) -> ForceLimit:
    """The register that keeps a joint's force below `max_force_n`."""
    radius_m = drum_radius_mm(mm_per_turn) / 1000.0
    full_mm_s, friction_n = model.no_load_rpm / 60.0 * mm_per_turn, model.friction_nm / radius_m
    if model.current_unit_ma is not None:
        most_ma = min(model.current_for_ma(max_force_n * radius_m), model.stall_ma)
        units = max(1, math.floor(most_ma / model.current_unit_ma + 1e-9))
        limit_ma = units * model.current_unit_ma
        return ForceLimit(GOAL_CURRENT, units, model.torque_nm(limit_ma) / radius_m, limit_ma, full_mm_s, friction_n)
    units = max(1, model.pwm_for(max_force_n * radius_m))
    duty = units / PWM_FULL
    return ForceLimit(GOAL_PWM, units, model.stall_nm * duty / radius_m, None, full_mm_s * duty, friction_n)


_12_V = (10.0, 14.8)
_24_V = (24.0, 24.0)
_XL430_V, _XC430_V = (6.5, 12.0), (6.5, 14.8)
_M330_V, _T330_V = (3.7, 6.0), (6.5, 12.0)

# Number, name, unit in mA, supply and the recommended one; at that one stall current in mA, stall torque in Nm and speed without
# load in revolutions per minute; temperature limit.
_ROWS = (
    ServoModel(1000, "XH430-W350", 2.69, _12_V, 12.0, 1300.0, 3.4, 30.0, 80.0),
    ServoModel(1001, "XD430-T350", 2.69, _12_V, 12.0, 1300.0, 3.4, 30.0, 80.0),
    ServoModel(1010, "XH430-W210", 2.69, _12_V, 12.0, 1300.0, 2.5, 50.0, 80.0),
    ServoModel(1011, "XD430-T210", 2.69, _12_V, 12.0, 1300.0, 2.5, 50.0, 80.0),
    ServoModel(1020, "XM430-W350", 2.69, _12_V, 12.0, 2300.0, 4.1, 46.0, 80.0),
    ServoModel(1030, "XM430-W210", 2.69, _12_V, 12.0, 2300.0, 3.0, 77.0, 80.0),
    ServoModel(1040, "XH430-V350", 1.34, _24_V, 24.0, 700.0, 3.3, 31.0, 80.0),
    ServoModel(1050, "XH430-V210", 1.34, _24_V, 24.0, 700.0, 2.6, 52.0, 80.0),
    ServoModel(1060, "XL430-W250", None, _XL430_V, 11.1, 1300.0, 1.4, 57.0, 72.0),
    ServoModel(1070, "XC430-W150", None, _XC430_V, 12.0, 1400.0, 1.6, 106.0, 80.0),
    ServoModel(1080, "XC430-W240", None, _XC430_V, 12.0, 1400.0, 1.9, 70.0, 80.0),
    ServoModel(1090, "2XL430-W250", None, _XL430_V, 11.1, 1300.0, 1.4, 57.0, 72.0),
    ServoModel(1100, "XH540-W270", 2.69, _12_V, 12.0, 4900.0, 9.9, 39.0, 80.0),
    ServoModel(1110, "XH540-W150", 2.69, _12_V, 12.0, 4900.0, 7.1, 70.0, 80.0),
    ServoModel(1120, "XM540-W270", 2.69, _12_V, 12.0, 4400.0, 10.6, 30.0, 80.0),
    ServoModel(1130, "XM540-W150", 2.69, _12_V, 12.0, 4400.0, 7.3, 53.0, 80.0),
    ServoModel(1140, "XH540-V270", 2.69, _24_V, 24.0, 2400.0, 9.2, 34.0, 80.0),
    ServoModel(1150, "XH540-V150", 2.69, _24_V, 24.0, 2400.0, 6.4, 60.0, 80.0),
    ServoModel(1160, "2XC430-W250", None, _XC430_V, 12.0, 1400.0, 1.8, 64.0, 80.0),
    ServoModel(1190, "XL330-M077", 1.0, _M330_V, 5.0, 1470.0, 0.215, 383.0, 70.0, is_small=True),
    ServoModel(1200, "XL330-M288", 1.0, _M330_V, 5.0, 1470.0, 0.52, 103.0, 70.0, is_small=True),
    ServoModel(1210, "XC330-T181", 1.0, _T330_V, 11.1, 800.0, 0.76, 104.0, 70.0, is_small=True),
    ServoModel(1220, "XC330-T288", 1.0, _T330_V, 11.1, 800.0, 0.92, 65.0, 70.0, is_small=True),
    ServoModel(1230, "XC330-M181", 1.0, _M330_V, 5.0, 1800.0, 0.60, 129.0, 70.0, is_small=True),
    ServoModel(1240, "XC330-M288", 1.0, _M330_V, 5.0, 1800.0, 0.93, 81.0, 70.0, is_small=True),
)
SERVO_MODELS = {model.number: model for model in _ROWS}
"""By model number."""

_OTHERS = {
    12: "AX-12A", 18: "AX-18A", 300: "AX-12W", 350: "XL-320", 29: "MX-28", 30: "MX-28(2.0)", 310: "MX-64", 311: "MX-64(2.0)",
    320: "MX-106", 321: "MX-106(2.0)", 360: "MX-12W", 1710: "XM335-T323",
}  # fmt: skip
"""Servos that stand beside these in a shop, by number: their registers are others, or (XM335) their torque is not in the manual."""


def model_name(number: int) -> str:
    """Name and number of a model, as printed on the servo; "model NUMBER" for one that is not known."""
    known = SERVO_MODELS.get(number)
    name = known.name if known is not None else _OTHERS.get(number)
    if name is None:
        name = "DYNAMIXEL P" if 2000 <= number < 2200 else "DYNAMIXEL Y" if 4000 <= number < 4200 else None
    return f"{name} ({number})" if name is not None else f"model {number}"


def unsupported(number: int) -> str:
    """Why a model cannot be used, in one line; "" for those that can."""
    if number in SERVO_MODELS:
        return ""
    return f"servo {model_name(number)} is not supported: use a DYNAMIXEL X of the 330, 430 or 540 size (docs/bench.md lists them)"
