"""What the software servo does to a wire, and what a restart, another master or a foreign EEPROM does to it."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest
from dynamixel_sdk import PortHandler, Protocol2PacketHandler

from core.config.safety import ServosConfig
from core.config.servo_models import SERVO_MODELS, ServoModel
from hardware.twin.servos.bus import SoftServoBus
from hardware.twin.servos.device import GEAR_FRICTION_MNM, STALL_MA, ElasticWire, MotorGoal, ServoMotor, SoftServo

CONFIG = ServosConfig()
ACCESS, RANGE, LIMIT = 7, 4, 6
WRITE, REBOOT = 3, 8
TICKS_PER_MM = 4096 / 40.0
RADIUS_MM = 40.0 / 6.2832


def _write(servo: SoftServo, address: int, value: int, size: int) -> int:
    return servo.answer(WRITE, address, data=value.to_bytes(size, "little", signed=value < 0)).error


def _servo(mode: int, *, current: int | None = None, pwm: int | None = None) -> SoftServo:
    """A servo at tick 100 with its torque on; `current` and `pwm` as goal registers."""
    servo = SoftServo(1, 1020, 100)
    assert _write(servo, 11, mode, 1) == 0
    if current is not None:
        assert _write(servo, 102, current, 2) == 0
    if pwm is not None:
        assert _write(servo, 100, pwm, 2) == 0
    for address, value, size in ((108, 20, 4), (112, 130, 4), (64, 1, 1)):
        assert _write(servo, address, value, size) == 0
    return servo


def _run(servo: SoftServo, seconds: float, step_s: float = 0.02, each: Callable[[], object] = lambda: None) -> SoftServo:
    start_s = servo._now_s
    for step in range(1, round(seconds / step_s) + 1):
        servo.advance(start_s + step * step_s)
        each()
    return servo


# --- force -----------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("step_mm", "current_ma", "force_n"), [(0.6, 990, 277), (1.0, 1658, 464)])
def test_in_mode_4_a_blocked_horn_draws_the_current_of_its_position_error(
    step_mm: float, current_ma: float, force_n: float
) -> None:
    """Position error * 800/128 of 885 units of PWM, of the 2.3 A at stall; 1.78 N m/A at a drum of 40 mm a turn."""
    servo = _servo(4)
    servo.freeze(True)
    _write(servo, 116, 100 + int(step_mm * TICKS_PER_MM), 4)
    _run(servo, 0.5)
    assert servo.current_ma == pytest.approx(current_ma, abs=10)
    assert servo.torque_mnm / RADIUS_MM == pytest.approx(force_n, abs=4)
    assert servo.table["present_current"] == pytest.approx(current_ma / 2.69, abs=5)


@pytest.mark.parametrize("blocked", ["frozen", "wire", "load"])
@pytest.mark.parametrize("goal", [100 + 2000, 100 - 2000])
def test_in_mode_5_no_block_draws_more_than_the_goal_current(blocked: str, goal: int) -> None:
    servo = _servo(5, current=74)  # 199 mA
    way = 1 if goal > 100 else -1
    servo.freeze(blocked == "frozen")
    if blocked == "wire":
        servo.motor.wire = ElasticWire(5.0, 100.0 + way * 50, way)
    if blocked == "load":
        servo.motor.load_mnm = way * 500.0
    currents: list[float] = []
    _run(servo, 4.0, each=lambda: currents.append(abs(servo.current_ma)))
    _write(servo, 116, goal, 4)
    _run(servo, 4.0, each=lambda: currents.append(abs(servo.current_ma)))
    assert max(currents) == pytest.approx(74 * 2.69)
    assert abs(servo.torque_mnm) == pytest.approx(74 * 2.69 * 4100 / 2300)
    assert servo.table["torque"] == 1
    assert abs(servo.table["present_position"] - goal) > 1000


def test_a_wire_is_pulled_as_far_as_the_goal_current_allows_and_holds() -> None:
    """199 mA less 40 mA of friction are 283 mN m, 56.6 ticks of a wire of 5 mN m a tick that is taut from tick 150 on."""
    servo = _servo(5, current=74)
    servo.motor.wire = ElasticWire(5.0, 150.0)
    _write(servo, 116, 1000, 4)
    _run(servo, 3.0)
    assert servo.mechanical_ticks == pytest.approx(206.6, abs=0.5)
    assert servo.table["present_velocity"] == 0
    assert servo.table["present_current"] == 74


def test_in_mode_4_goal_pwm_limits_current_and_speed() -> None:
    """A tenth of the PWM: 230 mA at stall, and 4.6 of 46 rev/min."""
    servo = _servo(4, pwm=88)
    servo.freeze(True)
    _write(servo, 116, 2000, 4)
    _run(servo, 3.0)
    assert servo.current_ma == pytest.approx(STALL_MA * 88 / 885)
    assert servo.table["present_pwm"] == 88
    servo.freeze(False)
    _run(servo, 0.5)
    before = servo.table["present_position"]
    _run(servo, 1.0)
    assert servo.table["present_position"] - before == pytest.approx(4096 * 46 / 60 * 88 / 885, rel=0.02)
    assert servo.current_ma == pytest.approx(40.0)


@pytest.mark.parametrize(("limit_at", "goal_at", "limit"), [(38, 102, 100), (36, 100, 300)])
def test_goals_of_current_and_pwm_stay_within_their_limits(limit_at: int, goal_at: int, limit: int) -> None:
    servo = SoftServo(1, 1020, 100)
    assert _write(servo, limit_at, limit, 2) == 0
    assert _write(servo, goal_at, limit, 2) == 0
    assert _write(servo, goal_at, limit + 1, 2) == LIMIT
    assert _write(servo, goal_at, 5, 2) == 0
    servo.restart(silent_s=0.0)
    assert servo.answer(2, goal_at, 2).data == limit.to_bytes(2, "little")


def test_another_mode_resets_limits_and_profile_and_turns() -> None:
    servo = SoftServo(1, 1020, 100)
    for address, value, size in ((11, 5, 1), (102, 20, 2), (112, 90, 4), (84, 100, 2)):
        assert _write(servo, address, value, size) == 0
    servo.turn(4096)
    assert servo.table["present_position"] == 4196
    assert _write(servo, 11, 5, 1) == 0
    assert (servo.table["goal_current"], servo.table["present_position"]) == (20, 4196)
    assert _write(servo, 11, 4, 1) == 0
    names = ("goal_current", "profile_velocity", "position_p_gain", "present_position")
    assert [servo.table[name] for name in names] == [1193, 0, 800, 100]


@pytest.mark.parametrize("mode", [4, 5])
def test_a_load_beyond_what_motor_and_gear_hold_turns_the_horn_back(mode: int) -> None:
    servo = _servo(mode, current=56, pwm=56)  # 151 mA or 146 mA: 268 or 259 mN m, and 233 mN m of the gear
    servo.motor.load_mnm = 480.0
    _run(servo, 1.0)
    held = servo.table["present_position"]
    assert held == pytest.approx(100, abs=15)
    servo.motor.load_mnm = 600.0
    _run(servo, 1.0)
    assert servo.table["present_position"] < held - 50
    assert servo.table["present_velocity"] < 0


@pytest.mark.parametrize(
    ("load_ma", "moves"),
    [
        (20.0, 1),  # 70 - 40 mA pull it up
        (50.0, 0),  # friction hinders the pull, and helps to hold
        (190.0, 0),
        (210.0, -1),  # more than motor and friction hold: 70 + 131 mA
    ],
)
def test_friction_hinders_a_motor_that_pulls_and_helps_one_that_holds(load_ma: float, moves: int) -> None:
    motor = ServoMotor(0.0)
    motor.load_mnm = load_ma * motor.mnm_per_ma
    motor.step(MotorGoal(torque=True, goal=100, limit_ma=70.0), 1.0)
    assert (motor.position > 1.0) - (motor.position < -1.0) == moves


@pytest.mark.parametrize(("gear_mnm", "left_mnm"), [(GEAR_FRICTION_MNM, GEAR_FRICTION_MNM), (1000.0, 500.0)])
def test_without_torque_a_wire_turns_the_horn_back_to_what_the_gear_holds(gear_mnm: float, left_mnm: float) -> None:
    servo = SoftServo(1, 1020, 100)
    servo.motor.gear_mnm = gear_mnm
    servo.motor.wire = ElasticWire(5.0, 0.0)
    servo.turn(0)
    assert servo.motor.wire.torque_mnm(servo.mechanical_ticks) == 500.0
    _run(servo, 5.0)
    assert servo.motor.wire.torque_mnm(servo.mechanical_ticks) == pytest.approx(left_mnm, abs=2.0)
    assert servo.current_ma == 0.0


@pytest.mark.parametrize("model", [1060, 1160])
def test_models_that_report_a_load_have_no_goal_current(model: int) -> None:
    servo = SoftServo(1, model, 100)
    assert [_write(servo, 11, mode, 1) for mode in (0, 5)] == [RANGE] * 2
    assert [_write(servo, register, 100, 2) for register in (38, 102)] == [ACCESS] * 2
    for address, value, size in ((11, 4, 1), (100, 300, 2), (64, 1, 1), (116, 3000, 4)):
        assert _write(servo, address, value, size) == 0
    servo.freeze(True)
    _run(servo, 0.9)
    kind = SERVO_MODELS[model]
    assert servo.torque_mnm == pytest.approx(1000.0 * kind.stall_nm * 300 / 885)
    assert servo.table["present_current"] == pytest.approx(1000 * 300 / 885, abs=1)


@pytest.mark.parametrize(
    "model", [model for model in SERVO_MODELS.values() if model.has_current_mode], ids=lambda model: model.name
)
def test_the_goal_current_of_every_model_means_the_torque_of_the_table(model: ServoModel) -> None:
    """Those of the 330 size limit and tell the current of their supply."""
    units = round(0.1 * model.stall_ma / model.current_unit_ma)
    servo = SoftServo(1, model.number, 100)
    for address, value, size in ((11, 5, 1), (102, units, 2), (64, 1, 1), (116, 9000, 4)):
        assert _write(servo, address, value, size) == 0
    servo.freeze(True)
    _run(servo, 0.5)
    assert servo.table["present_current"] == pytest.approx(units, abs=1)
    assert servo.torque_mnm == pytest.approx(1000.0 * model.torque_nm(units * model.current_unit_ma))


def test_the_small_motor_runs_on_when_its_watchdog_trips() -> None:
    servo = SoftServo(1, 1200, 100)
    for address, value, size in ((11, 4, 1), (112, 50, 4), (64, 1, 1), (98, 10, 1), (116, 4000, 4)):
        assert _write(servo, address, value, size) == 0
    _run(servo, 0.5)
    at = servo.table["present_position"]
    assert servo.table["watchdog"] == -1
    assert _write(servo, 116, 100, 4) == RANGE
    _run(servo, 0.5)
    assert servo.table["present_position"] > at + 100


# --- restart ---------------------------------------------------------------------------------------------------------------------


def _mapped(servo: SoftServo) -> SoftServo:
    assert _write(servo, 168, 132, 2) == 0
    assert _write(servo, 112, 90, 4) == 0
    return servo


@pytest.mark.parametrize("startup", [0, 1, 2, 3])
def test_a_restart_brings_back_what_the_startup_configuration_says(startup: int) -> None:
    servo = _mapped(SoftServo(1, 1020, 100))
    assert _write(servo, 60, startup, 1) == 0
    servo.backup()
    assert _write(servo, 250, 7, 1) == 0  # an indirect datum: in no backup
    _write(servo, 65, 1, 1)
    servo.turn(2 * 4096)
    servo.restart()
    assert servo.is_booting
    _run(servo, 0.4)
    table = servo.table
    assert not servo.is_booting
    assert table["present_position"] == 100
    assert table["torque"] == startup % 2
    assert (table["indirect_address_1"], table["profile_velocity"]) == ((132, 90) if startup >= 2 else (224, 0))
    assert (table["led"], servo.answer(2, 250, 1).data) == (0, b"\0")
    assert table["tick_ms"] < 500


def test_the_small_size_restores_its_20_addresses_and_no_datum() -> None:
    servo = SoftServo(1, 1200, 100)
    addresses = b"".join(number.to_bytes(2, "little") for number in (208, 132))
    assert servo.answer(WRITE, 168, data=addresses).error == 0
    assert _write(servo, 208, 9, 1) == 0
    assert servo.answer(2, 208, 2).data == b"\x09" + (100).to_bytes(1, "little")
    servo.backup()
    servo.table["startup"] = 2
    servo.restart(silent_s=0.0)
    assert servo.answer(2, 168, 4).data == addresses
    assert servo.answer(2, 208, 2).data == b"\0" + (100).to_bytes(1, "little")
    assert _write(servo, 210, 5, 2) == 0, "two data, not the 22nd address"


@pytest.mark.parametrize(("firmware", "register", "error"), [(37, 98, ACCESS), (38, 98, 0), (44, 60, ACCESS), (45, 60, 0)])
def test_old_firmware_lacks_registers(firmware: int, register: int, error: int) -> None:
    servo = SoftServo(1, 1020, 100)
    servo.table["firmware"] = firmware
    assert _write(servo, register, 1, 1) == error
    servo.backup()
    servo.table["startup"] = 3
    servo.restart()
    assert servo.table["torque"] == (firmware >= 45)


def test_without_shutdown_bits_nothing_switches_the_torque_off() -> None:
    servo = _servo(4)
    servo.table["shutdown"] = 0
    servo.heat(90.0)
    _run(servo, 0.1)
    assert (servo.table["hardware_error"], servo.table["torque"]) == (4, 1)


# --- the line --------------------------------------------------------------------------------------------------------------------


def test_a_secondary_id_obeys_in_the_ram_and_never_answers() -> None:
    bus = SoftServoBus(CONFIG, positions=[100] * 7)
    bus.servo(6).table["secondary_id"] = 1
    bus.write_by_other(65, b"\1", servo_id=1)
    bus.write_by_other(9, bytes([20]), servo_id=1)
    assert [bus.servo(i).table["led"] for i in (1, 2, 6)] == [1, 0, 1]
    assert [bus.servo(i).table["return_delay"] for i in (1, 6)] == [20, 250]
    assert [answer[4] for _, _, answer in bus._due] == [1, 1], "the ids of those that answer"


def test_another_master_switches_all_torque_off() -> None:
    bus = SoftServoBus(CONFIG, positions=[100] * 7)
    for joint in CONFIG.joints:
        bus.modify_servo(joint.id, lambda servo: servo.answer(WRITE, 64, data=b"\1"))
    bus.write_by_other(64, b"\0")
    assert [bus.servo(joint.id).table["torque"] for joint in CONFIG.joints] == [0] * 7
    bus.write_by_other(65, b"\1", servo_id=3)
    assert [bus.servo(joint.id).table["led"] for joint in CONFIG.joints] == [0, 0, 1, 0, 0, 0, 0]


def test_latency_delays_every_transaction(start_servos: Callable[..., SoftServoBus]) -> None:
    bus = start_servos(CONFIG, positions=[100] * 7, latency_s=0.008)
    port, sdk = PortHandler(bus.port), Protocol2PacketHandler()
    try:
        assert port.openPort()
        starts_s = time.monotonic()
        for joint in CONFIG.joints:
            sdk.ping(port, joint.id)
        assert time.monotonic() - starts_s >= 7 * 0.008
    finally:
        port.closePort()


def test_a_brown_out_restarts_all() -> None:
    bus = SoftServoBus(CONFIG, clock=lambda: 1.0, positions=[100] * 7)
    bus.servo(5).turn(3 * 4096)
    bus.brown_out()
    assert all(bus.servo(joint.id).is_booting for joint in CONFIG.joints)
    assert bus.servo(5).table["present_position"] == 100
    assert bus.positions_mm()[4] == pytest.approx(120.0)
