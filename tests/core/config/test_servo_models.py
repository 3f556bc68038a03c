"""The table of servo models, against the figures of the ROBOTIS e-Manual's page of each."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from core.config.safety import JointConfig, ServosConfig
from core.config.servo_models import (
    GOAL_CURRENT,
    GOAL_PWM,
    PWM_FULL,
    SERVO_MODELS,
    drum_radius_mm,
    force_limit,
    model_name,
    unsupported,
)

# One of each size, supply and kind of current: number, name, unit of current (mA; None: a load), supply (V), recommended (V),
# stall (A, Nm), speed (1/min), temperature limit (C)
MANUAL = (
    (1020, "XM430-W350", 2.69, (10.0, 14.8), 12.0, 2.3, 4.1, 46, 80),
    (1040, "XH430-V350", 1.34, (24.0, 24.0), 24.0, 0.7, 3.3, 31, 80),
    (1060, "XL430-W250", None, (6.5, 12.0), 11.1, 1.3, 1.4, 57, 72),
    (1070, "XC430-W150", None, (6.5, 14.8), 12.0, 1.4, 1.6, 106, 80),
    (1120, "XM540-W270", 2.69, (10.0, 14.8), 12.0, 4.4, 10.6, 30, 80),
    (1200, "XL330-M288", 1.0, (3.7, 6.0), 5.0, 1.47, 0.52, 103, 70),
    (1210, "XC330-T181", 1.0, (6.5, 12.0), 11.1, 0.80, 0.76, 104, 70),
    (1240, "XC330-M288", 1.0, (3.7, 6.0), 5.0, 1.80, 0.93, 81, 70),
)
SMALL = frozenset({1200, 1210, 1240})
by_model = pytest.mark.parametrize("row", MANUAL, ids=lambda row: row[1])
Row = tuple[int, str, float | None, tuple[float, float], float, float, float, float, float]


def _servos(model: int, **changes: object) -> ServosConfig:
    return ServosConfig.model_validate({"model": model, **changes})


@by_model
def test_the_figures_of_the_manual(row: Row) -> None:
    number, name, unit_ma, supply_v, recommended_v, stall_a, stall_nm, rpm, limit_c = row
    model = SERVO_MODELS[number]
    assert (model.name, model.number, model.supply_v, model.recommended_v) == (name, number, supply_v, recommended_v)
    assert (model.stall_ma, model.stall_nm, model.no_load_rpm) == (pytest.approx(1000 * stall_a), stall_nm, rpm)
    assert (model.current_ma(100), model.current_ma(-100)) == ((None, None) if unit_ma is None else (100 * unit_ma, -100 * unit_ma))
    assert model.has_current_mode is (unit_ma is not None)
    assert model.max_temperature_c == limit_c
    assert (model.is_small, model.watchdog_firmware) == ((True, 1) if number in SMALL else (False, 38))


@by_model
def test_the_supply_that_the_manual_recommends_can_be_driven_with(row: Row) -> None:
    servos = _servos(row[0])
    assert all(servos.lowest_v(joint) < row[4] - 0.5 for joint in servos.joints)
    assert servos.lowest_v(servos.joints[0]) == pytest.approx({5.0: 4.4, 11.1: 9.7, 12.0: 10.5, 24.0: 21.0}[row[4]])


@by_model
def test_the_program_stops_before_the_servo_switches_itself_off(row: Row) -> None:
    servos = _servos(row[0], max_temperature_c=80.0)
    assert servos.hottest_c(servos.joints[0]) == row[8] - 5.0
    assert _servos(row[0]).hottest_c(servos.joints[0]) == min(70.0, row[8] - 5.0)


@by_model
def test_stall_current_gives_stall_torque(row: Row) -> None:
    model = SERVO_MODELS[row[0]]
    assert model.torque_nm(1000 * row[5]) == pytest.approx(row[6])
    assert model.torque_nm(-1000 * row[5]) == pytest.approx(-row[6])
    assert model.torque_nm(0.0) == 0.0


def test_a_small_servos_current_is_that_of_its_supply() -> None:
    # A tenth of the duty: a tenth of the stall current in the motor, a hundredth of it in the supply, a tenth of the stall torque.
    assert SERVO_MODELS[1200].torque_nm(14.7) == pytest.approx(0.052)
    assert SERVO_MODELS[1020].torque_nm(230.0) == pytest.approx(0.41)


@by_model
@pytest.mark.parametrize("force_n", [1.0, 20.0, 60.0])
@pytest.mark.parametrize("mm_per_turn", [20.0, 40.0, 62.8])
def test_the_limit_in_the_servo_is_never_above_the_force(row: Row, force_n: float, mm_per_turn: float) -> None:
    model = SERVO_MODELS[row[0]]
    limit = force_limit(model, mm_per_turn, force_n)
    radius_m = mm_per_turn / (2 * math.pi) / 1000.0
    assert limit.register == (GOAL_PWM if row[2] is None else GOAL_CURRENT)
    if row[2] is None:
        # a standing motor at this duty and the highest supply
        force = model.stall_nm * limit.units / PWM_FULL * row[3][1] / row[4] / radius_m
        step = model.stall_nm / PWM_FULL * row[3][1] / row[4] / radius_m
        assert limit.current_ma is None
    else:
        assert limit.current_ma == pytest.approx(limit.units * row[2])
        share = limit.units * row[2] / (1000.0 * row[5])
        if row[0] in SMALL:  # the same at the highest supply, of which the current is
            force = model.stall_nm * math.sqrt(share * row[3][1] / row[4]) / radius_m
            step = model.stall_nm * math.sqrt(row[2] / (1000.0 * row[5]) * row[3][1] / row[4]) / radius_m
        else:
            force, step = model.stall_nm * share / radius_m, model.stall_nm * row[2] / (1000.0 * row[5]) / radius_m
    assert force <= max(force_n, step) + 1e-9
    if model.stall_nm / radius_m > 2.0 * force_n > 10.0 * step:
        assert force >= 0.5 * force_n, "no weaker than the register's step demands"
    assert limit.force_n <= max(force_n, step) + 1e-9


@given(st.sampled_from(sorted(SERVO_MODELS)), st.floats(0.1, 150.0), st.floats(1.0, 500.0))
def test_no_force_drum_or_model_makes_a_register_that_the_servo_does_not_know(
    number: int, force_n: float, mm_per_turn: float
) -> None:
    model = SERVO_MODELS[number]
    limit, weaker = force_limit(model, mm_per_turn, force_n), force_limit(model, mm_per_turn, force_n / 2.0)
    most = PWM_FULL if limit.current_ma is None else model.stall_ma / (model.current_unit_ma or 1.0)
    assert 1 <= weaker.units <= limit.units <= most + 1e-6
    assert limit.force_n <= model.stall_nm / drum_radius_mm(mm_per_turn) * 1000.0 + 1e-6
    assert limit.current_ma is None or limit.strain_ma == pytest.approx(0.9 * limit.current_ma)


def test_by_hand() -> None:
    # 20 N on a drum of 40 mm a turn (radius 6.366 mm): 0.1273 Nm; XM430-W350, 4.1 Nm at 2.3 A: 71.4 mA; 26 units are 69.94 mA
    limit = force_limit(SERVO_MODELS[1020], 40.0, 20.0)
    assert (limit.register, limit.units, limit.current_ma) == (102, 26, pytest.approx(69.94))
    assert limit.force_n == pytest.approx(19.58, abs=0.01)
    # XL430-W250: 9.09 % of its stall torque at 11.1 V, at 12 V 8.41 %: 74 of 885, and 57 rpm at full duty: 3.18 mm/s
    limit = force_limit(SERVO_MODELS[1060], 40.0, 20.0)
    assert (limit.register, limit.units, limit.current_ma) == (100, 74, None)
    assert limit.speed_mm_s == pytest.approx(3.18, abs=0.01)
    assert drum_radius_mm(40.0) == pytest.approx(6.366, abs=0.001)


@pytest.mark.parametrize(
    ("number", "mm_per_turn", "force_n", "friction_n", "is_weak"),
    [
        (1020, 40.0, 20.0, 36.7, True),  # 0.234 N m on 6.366 mm
        (1020, 40.0, 38.0, 36.7, False),
        (1020, 94.2, 20.0, 15.6, False),  # a larger drum
        (1200, 40.0, 20.0, 4.7, False),  # a smaller servo
        (1060, 40.0, 20.0, 12.5, False),
    ],
)
def test_a_force_that_the_gears_own_friction_may_take_is_known(
    number: int, mm_per_turn: float, force_n: float, friction_n: float, is_weak: bool
) -> None:
    limit = force_limit(SERVO_MODELS[number], mm_per_turn, force_n)
    assert limit.friction_n == pytest.approx(friction_n, abs=0.1)
    assert limit.is_weak is is_weak


def test_joints_that_may_not_move_are_named_with_the_least_force() -> None:
    assert [(joint.name, least_n) for joint, least_n in ServosConfig().weak_joints] == [
        (joint.name, 39) for joint in ServosConfig().joints
    ]
    assert ServosConfig(model=1200).weak_joints == ()


@pytest.mark.parametrize(
    ("number", "name"),
    [(350, "XL-320 (350)"), (12, "AX-12A (12)"), (30, "MX-28(2.0) (30)"), (2000, "DYNAMIXEL P (2000)"),
     (4150, "DYNAMIXEL Y (4150)"), (1710, "XM335-T323 (1710)"), (9999, "model 9999")],
)  # fmt: skip
def test_other_servos_are_refused_by_name(number: int, name: str) -> None:
    assert model_name(number) == name
    assert unsupported(number).startswith(f"servo {name} is not supported")
    with pytest.raises(ValidationError, match="is not supported"):
        _servos(number)
    with pytest.raises(ValidationError, match="joint right: servo"):
        ServosConfig.model_validate({"joints": [_with_model(joint, number) for joint in ServosConfig().joints]})


def test_a_model_per_joint() -> None:
    plain = ServosConfig()
    joints = tuple(_with_model(joint, 1200) if joint.name in ("right", "left", "up", "down") else joint for joint in plain.joints)
    servos = ServosConfig.model_validate({"joints": joints})
    assert [servos.model_of(joint).name for joint in servos.joints] == ["XL330-M288"] * 4 + ["XM430-W350"] * 3
    assert [servos.lowest_v(joint) for joint in servos.joints] == [4.4] * 4 + [10.5] * 3
    assert [servos.hottest_c(joint) for joint in servos.joints] == [65.0] * 4 + [70.0] * 3


def _with_model(joint: JointConfig, number: int) -> JointConfig:
    return joint.model_copy(update={"model": number})


def test_the_limit_is_the_stall_current_itself_where_more_is_asked_for() -> None:
    """A whole number of units is not rounded down by one."""
    model = SERVO_MODELS[1190]
    assert force_limit(model, 40.0, 150.0).units == 1470 == model.stall_ma / model.current_unit_ma
