"""The driver of the seven servos, through the real SDK, against strict software servos on a pseudo-terminal."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from core.config.safety import JOINT_NAMES, JointConfig, ServosConfig
from core.config.servo_models import SERVO_MODELS, ServoModel
from core.control.kept_zero import ZeroBasis
from core.devices import DeviceError, UserError
from hardware.servos import registers
from hardware.servos.dynamixel_bus import ServoBus
from hardware.servos.dynamixel_port import (
    NoAnswer,
    NotReady,
    PortError,
    PortLost,
    PortTaken,
    ServoError,
    ServoLine,
    StoppedMeanwhile,
    StuffingHandler,
    TorqueStillOn,
    WriteRefused,
    WrongServo,
)
from hardware.servos.eeprom import CHANGED, restore_eeprom
from hardware.servos.registers import HardwareError, MissingServo, ServoReading, ServoState
from hardware.twin.servos.bus import SoftServoBus
from hardware.twin.servos.device import SoftServo
from hardware.twin.servos.protocol import Instruction

pytestmark = pytest.mark.real_time

# The servos' watchdog is long, so that a machine that stalls does not trip it; the tests of the watchdog turn the servos' clock.
CONFIG = ServosConfig(watchdog_s=2.0)
TENDON, ADVANCE = CONFIG.joints[0], CONFIG.joints[4]


def _joint(**changes: object) -> JointConfig:
    return TENDON.model_copy(update=changes)


class Clock:
    """The servos' time: the wall's, plus what a test lets pass at once."""

    def __init__(self) -> None:
        self.ahead_s = 0.0

    def __call__(self) -> float:
        return time.monotonic() + self.ahead_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def twin(start_servos: Callable[..., SoftServoBus], clock: Clock) -> SoftServoBus:
    return start_servos(CONFIG, clock=clock, positions=[1000 + joint.id for joint in CONFIG.joints])


@pytest.fixture
def closed(twin: SoftServoBus) -> Iterator[ServoBus]:
    bus = ServoBus(CONFIG, twin.port)
    yield bus
    bus.close()


@pytest.fixture
def bus(closed: ServoBus) -> ServoBus:
    closed.open()
    return closed


@pytest.fixture
def armed(bus: ServoBus) -> ServoBus:
    bus.set_zero()
    bus.arm()
    return bus


def _states(bus: ServoBus) -> list[ServoState]:
    """A read that must be whole. Machines that stall lose an answer now and then, so it is tried again."""
    for _ in range(20):
        readings = bus.read()
        if all(isinstance(reading, ServoState) for reading in readings):
            break
        time.sleep(0.02)
    states = [reading for reading in readings if isinstance(reading, ServoState)]
    assert len(states) == 7, readings
    return states


def _until(bus: ServoBus, index: int, wanted: Callable[[object], bool]) -> object:
    """Read until the reading of one servo is as wanted."""
    for _ in range(100):
        reading = bus.read()[index]
        if wanted(reading):
            return reading
        time.sleep(0.01)
    raise AssertionError(f"not seen: {reading}")


@contextmanager
def _armed_with(
    start_servos: Callable[..., SoftServoBus], clock: Clock, **tendon: object
) -> Iterator[tuple[SoftServoBus, ServoBus]]:
    """Tendons of another kind than the rest; armed."""
    joints = tuple(j.model_copy(update=tendon) if j.id <= 4 else j for j in CONFIG.joints)
    config = ServosConfig.model_validate({**CONFIG.model_dump(), "joints": joints})
    twin = start_servos(config, clock=clock, positions=[1000] * 7)
    bus = ServoBus(config, twin.port)
    bus.open()
    bus.set_zero()
    bus.arm()
    yield twin, bus
    bus.close()


@pytest.fixture
def mixed(start_servos: Callable[..., SoftServoBus], clock: Clock) -> Iterator[tuple[SoftServoBus, ServoBus]]:
    """Four small servos of 5 V for the tendons, three strong ones of 12 V."""
    with _armed_with(start_servos, clock, model=1200) as armed:
        yield armed


# --- millimetres and registers ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "zero", "position_mm", "ticks"),
    [
        ({"mm_per_turn": 40.0}, 0, 40.0, 4096),
        ({"mm_per_turn": 40.0}, 1000, 10.0, 2024),
        ({"mm_per_turn": 40.0, "sign": -1}, 1000, 10.0, -24),
        ({"mm_per_turn": 20.0}, -5, -5.0, -1029),
        ({"mm_per_turn": 40.0}, 0, 0.0049, 1),
        ({"mm_per_turn": 40.0}, 0, 0.0048, 0),
    ],
)
def test_millimetres_to_ticks(changes: dict[str, object], zero: int, position_mm: float, ticks: int) -> None:
    joint = _joint(**changes)
    assert registers.to_ticks(joint, position_mm, zero) == ticks
    assert registers.to_mm(joint, ticks, zero) == pytest.approx(position_mm, abs=0.005)


@given(st.sampled_from([-1, 1]), st.floats(1.0, 500.0), st.integers(-9000, 9000), st.integers(-20000, 20000))
def test_ticks_come_back_exactly(sign: int, mm_per_turn: float, zero: int, ticks: int) -> None:
    joint = _joint(sign=sign, mm_per_turn=mm_per_turn)
    assert registers.to_ticks(joint, registers.to_mm(joint, ticks, zero), zero) == ticks


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e300, 10241.0])
def test_no_ticks_for_what_is_no_place(bad: float) -> None:
    with pytest.raises(ValueError, match="joint right"):
        registers.to_ticks(TENDON, bad, 0)


def test_profiles_by_hand() -> None:
    """10 mm/s at 40 mm a turn: 15 rpm, 65.5 units of 0.229 rpm. 200 mm/s^2: 5 rev/s^2 = 18000 rev/min^2 = 83.9 of 214.577."""
    assert registers.profile_velocity(TENDON) == 65
    assert registers.profile_acceleration(TENDON) == 83
    assert registers.profile_velocity(ADVANCE) == 131
    assert registers.velocity_mm_s(TENDON, 65) == pytest.approx(9.92, abs=0.01)
    assert registers.velocity_mm_s(_joint(sign=-1), 65) == pytest.approx(-9.92, abs=0.01)


def test_a_slow_joint_never_gets_a_profile_of_zero_which_means_unlimited() -> None:
    slow = _joint(max_speed_mm_s=0.01, max_acceleration_mm_s2=0.01, mm_per_turn=500.0)
    assert (registers.profile_velocity(slow), registers.profile_acceleration(slow)) == (1, 1)
    fast = _joint(max_speed_mm_s=200.0, max_acceleration_mm_s2=10_000.0, mm_per_turn=1.0)
    assert (registers.profile_velocity(fast), registers.profile_acceleration(fast)) == (1023, 32767)


@pytest.mark.parametrize(("seconds", "steps"), [(0.2, 10), (0.02, 1), (0.05, 3), (2.54, 127)])
def test_watchdog_in_steps_of_20_ms(seconds: float, steps: int) -> None:
    assert registers.watchdog_units(seconds) == steps


XM430, XL330 = SERVO_MODELS[1020], SERVO_MODELS[1200]


def test_a_status_block_by_hand() -> None:
    block = bytes.fromhex("A7 02 01 20 FF 00FCFF 0AFF BFFF FFFFFD 2D 7800 1A00")
    state = registers.state_of(TENDON, XM430, -131_073, block, 5.0, 0xA7)
    assert (state.torque, state.error, state.watchdog_tripped) == (True, HardwareError.OVERLOAD, True)
    assert (state.goal_ticks, state.ticks, state.position_mm) == (-1024, -131_073, 0.0)
    assert (state.current_ma, state.voltage_v, state.temperature_c) == (pytest.approx(-246 * 2.69), 12.0, 45.0)
    limited = [registers.state_of(TENDON, XM430, 0, block, 5.0, 0xA7, units) for units in (26, 27, 26 + 256)]
    assert [one.is_limited for one in limited if one is not None] == [True, False, False]
    assert state.velocity_mm_s == pytest.approx(-65 * 0.229 / 60 * 40)
    small = registers.state_of(TENDON, XL330, -131_073, block[:-4] + b"\x32\x1a", 5.0, 0xA7)
    assert (small.current_ma, small.voltage_v, small.temperature_c) == (-246.0, 5.0, 45.0)


def test_a_supply_of_25_6_v_is_no_lost_block() -> None:
    block = bytes.fromhex("A7 02 01 00 00 000000 0000 0000 000000 2D 0001 1A00")
    assert registers.state_of(TENDON, SERVO_MODELS[1040], 0, block, 0.0, 0xA8) is None, "another mark: it has restarted"
    state = registers.state_of(TENDON, SERVO_MODELS[1040], 0, block, 0.0, 0xA7)
    assert state.voltage_v == pytest.approx(25.6)


@pytest.mark.parametrize("model", SERVO_MODELS.values(), ids=lambda model: model.name)
def test_zeros_are_no_servo_at_zero(model: ServoModel) -> None:
    length = registers.block_bytes(model)
    assert registers.state_of(TENDON, model, 0, bytes(length), 0.0, 0) is None
    with pytest.raises(ValueError, match=f"{length - 1} bytes"):
        registers.state_of(TENDON, model, 0, bytes(length - 1), 0.0, 0)


@pytest.mark.parametrize("model", SERVO_MODELS.values(), ids=lambda model: model.name)
def test_the_block_fits_the_servo(model: ServoModel) -> None:
    room, data = (20, 208) if model.name[:5] in ("XL330", "XC330") else (28, 224)
    assert len(registers.indirect_addresses(model)) // 2 == registers.block_bytes(model) + registers.TAG_BYTES <= room
    assert registers.indirect_data(model) == data


def test_hardware_errors_in_words() -> None:
    assert registers.describe(HardwareError(36)) == "overheating, overload"
    assert registers.describe(HardwareError(64)) == "error 64"


# --- stuffing --------------------------------------------------------------------------------------------------------------------


class Tape:
    """Stands in for the SDK's port: keeps what is sent, plays what is to be received."""

    def __init__(self, play: bytes = b"") -> None:
        self.is_using, self.sent, self.play = False, b"", play

    def clearPort(self) -> None:
        pass

    def writePort(self, packet: list[int]) -> int:
        self.sent += bytes(packet)
        return len(packet)

    def readPort(self, size: int) -> bytes:
        data, self.play = self.play[: max(0, size)], self.play[max(0, size) :]
        return data

    def setPacketTimeout(self, length: int) -> None:
        pass

    def isPacketTimeout(self) -> bool:
        return True


def test_a_payload_with_a_header_is_sent_stuffed() -> None:
    tape = Tape()
    StuffingHandler().write4ByteTxOnly(tape, 1, 116, 0xFFFDFFFF)
    # header, id, length 9 + 1, write, 116, FF FF FD FD FF
    assert tape.sent[:-2] == bytes.fromhex("FFFFFD00 01 0A00 03 7400 FFFFFDFD FF")


@given(st.lists(st.sampled_from([0xFF, 0xFD, 0x00]), max_size=30).map(bytes))
def test_answers_are_read_unstuffed(data: bytes) -> None:
    from hardware.twin.servos.protocol import status_packet

    packet, result = StuffingHandler().rxPacket(Tape(status_packet(9, 0, data)), False)
    assert result == 0
    assert bytes(packet[9:-2]) == data
    assert packet[5] | packet[6] << 8 == len(data) + 4


_BITS_OF_ANSWERS = st.sampled_from(
    [b"\xff\xff\xfd\x00", b"\x01\x00\x00", b"\x02\x04\x00\x55", b"\x01\x03\x00\x55", b"\xff\xff\xfd\xfd", b"\xff", b"\xfd", b"\x55"]
)


@given(st.lists(st.one_of(st.binary(max_size=30), _BITS_OF_ANSWERS), max_size=30).map(b"".join))
def test_no_bytes_on_the_line_make_a_group_read_fail(heard: bytes) -> None:
    line = ServoLine("nowhere", 1_000_000)
    line._port, line._owner = Tape(heard), threading.get_ident()
    answer = line.group_read([1, 2, 3], 224, 16)
    assert set(answer.data) | set(answer.missed) == {1, 2, 3}
    assert not line._port.is_using


def test_requests_that_follow_each_other_ask_for_different_lengths(twin: SoftServoBus, bus: ServoBus) -> None:
    """Two reads in between for which nobody was asked made the next request look like the one before; its late answers passed."""
    bus.read()
    line = bus._line
    line._quiet_until = {joint.id: math.inf for joint in CONFIG.joints}
    for _ in range(2):
        assert all(isinstance(reading, MissingServo) for reading in bus.read())
    line._quiet_until.clear()
    bus.read()
    *_, before, last = [p.parameters[2:4] for p in twin.log if p.instruction == Instruction.SYNC_READ]
    assert before != last


def test_a_goal_with_a_header_arrives_and_is_read_back(twin: SoftServoBus, bus: ServoBus) -> None:
    """-131073 ticks are FF FF FD FF in the packet to the servo, and FF FF FD in its answer."""
    twin.modify_servo(1, lambda servo: servo.turn(-131_073 - servo.table["present_position"]))
    bus.set_zero()
    bus.arm()
    assert bus.write([0.0] * 7) == (0.0,) * 7
    state = _states(bus)[0]
    assert (state.ticks, state.goal_ticks) == (-131_073, -131_073)
    assert bus.counts.corrupt == 0


# --- opening ---------------------------------------------------------------------------------------------------------------------


def test_open_names_the_seven_and_moves_nothing(twin: SoftServoBus, bus: ServoBus) -> None:
    assert [(i.name, i.id, i.model, i.firmware) for i in bus.identities] == [
        (n, k + 1, 1020, 46) for k, n in enumerate(JOINT_NAMES)
    ]
    assert bus.is_open
    assert not bus.is_armed
    assert not any(state.torque for state in _states(bus))
    assert twin.positions_mm() == (0.0,) * 7


def test_a_missing_port() -> None:
    with pytest.raises(PortError, match="does not exist: plug"):
        ServoBus(CONFIG, "/nowhere/ttyUSB0").open()


def test_a_file_is_no_port(tmp_path: Path) -> None:
    (tmp_path / "port").write_text("")
    with pytest.raises(PortError, match="cannot be used as servo port"):
        ServoBus(CONFIG, str(tmp_path / "port")).open()


@pytest.mark.parametrize(
    ("code", "kind", "words"),
    [(13, PortError, "group dialout"), (16, PortTaken, "close that program first"), (19, PortError, "no device behind it")],
)
def test_other_reasons_not_to_open(monkeypatch: pytest.MonkeyPatch, code: int, kind: type[PortError], words: str) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(code, "could not open\nport")

    monkeypatch.setattr(serial, "Serial", refuse)
    with pytest.raises(kind, match=words) as caught:
        ServoBus(CONFIG, "port").open()
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, DeviceError)


def test_no_port_is_configured() -> None:
    with pytest.raises(NotReady, match=r"set servos\.port"):
        ServoBus(CONFIG)


def test_a_speed_that_the_sdk_does_not_know(twin: SoftServoBus) -> None:
    bus = ServoBus(CONFIG.model_copy(update={"baud": 12345}), twin.port)
    with pytest.raises(PortError, match="baud 12345"):
        bus.open()


def test_wrong_baud_tells_the_right_one(twin: SoftServoBus) -> None:
    bus = ServoBus(CONFIG.model_copy(update={"baud": 57600}), twin.port)
    with pytest.raises(NoAnswer, match=r"set servos\.baud = 1000000"):
        bus.open()
    assert not bus.is_open


def test_servos_without_power(twin: SoftServoBus) -> None:
    for joint in CONFIG.joints:
        twin.faults.mute(joint.id)
    with pytest.raises(NoAnswer, match="no servo answers"):
        ServoBus(CONFIG, twin.port).open()


def test_a_servo_with_another_id_is_named_and_so_are_those_found(twin: SoftServoBus) -> None:
    joints = tuple(j.model_copy(update={"id": 9}) if j.name == "up" else j for j in CONFIG.joints)
    bus = ServoBus(CONFIG.model_copy(update={"joints": joints}), twin.port)
    with pytest.raises(NoAnswer, match=r"servo up \(id 9\): no answer; ids on the line: 1, 2, 3, 4, 5, 6, 7"):
        bus.open()
    assert not bus.is_open


@pytest.mark.parametrize(
    ("register", "value", "words"),
    [("model_number", 1060, r"is XL430-W250 \(1060\), not XM430-W350 \(1020\)"), ("id", 5, "says that its id is 5")],
)
def test_a_wrong_model_and_a_wrong_id_are_refused(
    twin: SoftServoBus, closed: ServoBus, register: str, value: int, words: str
) -> None:
    twin.modify_servo(4, lambda servo: servo.table.__setitem__(register, value))
    with pytest.raises(WrongServo, match=rf"servo down \(id 4\) {words}"):
        closed.open()
    assert not closed.is_open


WRITES = {Instruction.WRITE, Instruction.SYNC_WRITE}


@pytest.mark.parametrize(
    ("register", "value", "words"),
    [
        ("shutdown", 0, r"does not switch itself off at overheating, overload: set its Shutdown \(register 63\) to 52, with DYN"),
        ("shutdown", 4, r"does not switch itself off at overload: set"),
        ("shutdown", 32, r"does not switch itself off at overheating: set"),
        (
            "temperature_limit",
            100,
            r"gets 100 °C hot before it switches itself off: set its Temperature Limit \(register 31\) to 80",
        ),
        ("secondary_id", 3, r"also obeys what is sent to id 3: set its Secondary ID \(register 12\) to 255"),
        ("firmware", 37, r"has firmware 37, which has no bus watchdog: update it with DYNAMIXEL Wizard 2"),
    ],
)
def test_a_servo_that_cannot_protect_itself_is_refused_before_anything_is_written(
    twin: SoftServoBus, closed: ServoBus, register: str, value: int, words: str
) -> None:
    twin.modify_servo(6, lambda servo: servo.table.__setitem__(register, value))
    with pytest.raises(WrongServo, match=rf"^servo delivery_1 \(id 6\) {words}"):
        closed.open()
    assert not closed.is_open
    assert not any(packet.instruction in WRITES for packet in twin.log)


@pytest.mark.parametrize(("register", "value"), [("shutdown", 0), ("secondary_id", 5), ("temperature_limit", 81)])
def test_protection_that_was_taken_away_since_hinders_arming(twin: SoftServoBus, bus: ServoBus, register: str, value: int) -> None:
    bus.set_zero()
    twin.modify_servo(6, lambda servo: servo.table.__setitem__(register, value))
    with pytest.raises(WrongServo, match="register"):
        bus.arm()
    assert all(twin.servo(joint.id).table["torque"] == 0 for joint in CONFIG.joints)


@pytest.mark.parametrize(
    ("register", "value"), [("shutdown", 36), ("secondary_id", 253), ("temperature_limit", 60), ("firmware", 38)]
)
def test_what_protects_a_servo_enough_or_better(twin: SoftServoBus, closed: ServoBus, register: str, value: int) -> None:
    twin.modify_servo(6, lambda servo: servo.table.__setitem__(register, value))
    closed.open()


@pytest.mark.parametrize("level", [0, 1])
def test_only_the_servo_that_does_not_answer_is_told_to_answer(twin: SoftServoBus, closed: ServoBus, level: int) -> None:
    twin.modify_servo(3, lambda servo: servo.table.__setitem__("status_return", level))
    closed.open()
    assert twin.servo(3).table["status_return"] == 2
    told = [packet for packet in twin.log if packet.instruction == Instruction.WRITE and packet.parameters[:1] == bytes([68])]
    assert [packet.id for packet in told] == [3]


# --- the EEPROM is kept before it is changed -------------------------------------------------------------------------------------


def _eeprom(twin: SoftServoBus, servo_id: int) -> bytes:
    return twin.servo(servo_id).table.read(0, 64)[1]


def test_the_eeprom_is_kept_before_it_is_changed_and_restored(twin: SoftServoBus, tmp_path: Path) -> None:
    config = CONFIG.model_copy(update={"port": twin.port})
    twin.modify_servo(2, lambda servo: servo.table.__setitem__("homing_offset", -1234))
    before = {joint.id: _eeprom(twin, joint.id) for joint in CONFIG.joints}
    for _ in range(2):  # what the program has made of it is no backup
        bus = ServoBus(config, backups=tmp_path / "servos")
        bus.open()
        bus.close()
    assert _eeprom(twin, 2) != before[2]
    kept = sorted((tmp_path / "servos").glob("*.json"))
    assert [path.name for path in kept] == [f"servos_id{joint.id}_model1020.json" for joint in CONFIG.joints]
    said: list[str] = []
    assert restore_eeprom(config, tmp_path / "servos", said.append) == 7
    assert {joint.id: _eeprom(twin, joint.id) for joint in CONFIG.joints} == before
    assert "left (id 2), as of 20" in said[1]
    assert "homing offset 0 -> -1234" in said[1]
    assert sorted((tmp_path / "servos").glob("*.json")) == kept


def test_what_cannot_be_kept_is_not_changed(twin: SoftServoBus, tmp_path: Path) -> None:
    (tmp_path / "servos").write_text("a file where the folder should be")
    before = {joint.id: _eeprom(twin, joint.id) for joint in CONFIG.joints}
    with pytest.raises(ServoError, match=r"cannot be saved .*so it is not changed"):
        ServoBus(CONFIG, twin.port, tmp_path / "servos").open()
    assert {joint.id: _eeprom(twin, joint.id) for joint in CONFIG.joints} == before


def test_servos_that_hold_are_not_restored(twin: SoftServoBus, tmp_path: Path) -> None:
    config = CONFIG.model_copy(update={"port": twin.port})
    bus = ServoBus(config, backups=tmp_path)
    bus.open()
    bus.set_zero()
    bus.arm()
    bus.close()
    with pytest.raises(WrongServo, match=r"servo right \(id 1\) holds: switch the torque off first"):
        restore_eeprom(config, tmp_path, lambda _: None)


@pytest.mark.parametrize("content", ["", "{}", '{"eeprom": "00 01", "made_utc": "x"}', '{"eeprom": 5, "made_utc": "x"}', "[1, 2]"])
def test_a_damaged_backup_is_named_and_nothing_is_written(twin: SoftServoBus, tmp_path: Path, content: str) -> None:
    config = CONFIG.model_copy(update={"port": twin.port})
    (tmp_path / "servos_id4_model1020.json").write_text(content)
    with pytest.raises(UserError, match=r"servos_id4_model1020\.json: (no|the) backup of a"):
        restore_eeprom(config, tmp_path, lambda _: None)


def test_without_backups_there_is_nothing_to_restore(twin: SoftServoBus, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="there is no backup of these servos"):
        restore_eeprom(CONFIG.model_copy(update={"port": twin.port}), tmp_path, lambda _: None)


def test_all_that_the_driver_changes_is_restored(closed: ServoBus, twin: SoftServoBus) -> None:
    before = {joint.id: _eeprom(twin, joint.id) for joint in CONFIG.joints}
    closed.open()
    for joint in CONFIG.joints:
        changed = {
            at for at, (one, other) in enumerate(zip(before[joint.id], _eeprom(twin, joint.id), strict=True)) if one != other
        }
        assert changed <= {address + n for address, (_, size) in CHANGED.items() for n in range(size)}


def test_a_mode_that_was_altered_is_mended_but_must_be_zeroed(twin: SoftServoBus, armed: ServoBus) -> None:
    armed.torque_off()
    twin.modify_servo(2, lambda servo: servo.answer(3, 11, data=b"\3"))
    with pytest.raises(NotReady, match="not zeroed: left"):
        armed.arm()
    assert not armed.is_armed
    assert twin.servo(2).table["operating_mode"] == 5
    armed.set_zero()
    armed.arm()


def test_a_port_that_is_taken_is_refused_and_free_after_close(twin: SoftServoBus, bus: ServoBus) -> None:
    other = ServoBus(CONFIG, twin.port)
    with pytest.raises(PortTaken):
        other.open()
    bus.close()
    bus.close()
    other.open()
    other.close()


def test_one_thread_owns_it(bus: ServoBus) -> None:
    caught: list[BaseException] = []

    def read() -> None:
        try:
            bus.read()
        except RuntimeError as error:
            caught.append(error)

    thread = threading.Thread(target=read)
    thread.start()
    thread.join()
    assert "belongs to the thread" in str(caught[0])
    assert len(_states(bus)) == 7


# --- arming ----------------------------------------------------------------------------------------------------------------------


def _writes(twin: SoftServoBus, servo_id: int) -> list[tuple[int, bytes]]:
    """Address and first bytes of all that was written to a servo, group writes included, and reads of its position (as 132)."""
    found = []
    for packet in twin.log:
        if packet.id == servo_id and packet.instruction == Instruction.WRITE:
            found.append((int.from_bytes(packet.parameters[:2], "little"), packet.parameters[2:]))
        elif packet.id == servo_id and packet.instruction == Instruction.READ and packet.parameters[0] == 132:
            found.append((132, b""))
        elif packet.instruction == Instruction.SYNC_WRITE:
            items = packet.parameters[4:]
            found += [(packet.parameters[0], items[at + 1 : at + 5]) for at in range(0, len(items), 5) if items[at] == servo_id]
    return found


def test_the_arming_order(twin: SoftServoBus, closed: ServoBus) -> None:
    closed.open()
    opened = [address for address, _ in _writes(twin, 3)]
    assert opened == [9, 11, 168, 224]  # what differs from what we need, then the status block, its mark
    closed.set_zero()
    twin.log.clear()
    closed.arm()
    goal = (1003).to_bytes(4, "little")
    profile = (83).to_bytes(4, "little") + (65).to_bytes(4, "little")
    assert _writes(twin, 3) == [
        (98, b"\0"),
        (102, b"\x1a\0"),
        (108, profile),
        (132, b""),
        (116, goal),
        (64, b"\1"),
        (98, bytes([100])),
    ]
    order = [(packet.id, packet.parameters[0]) for packet in twin.log if packet.instruction == Instruction.WRITE]
    assert order.index((1, 64)) > order.index((7, 98)), "all watchdogs off before the first torque is touched"
    assert closed.is_armed


def _torques(twin: SoftServoBus) -> list[int]:
    return [twin.servo(joint.id).table["torque"] for joint in CONFIG.joints]


@pytest.mark.parametrize(("model", "servo_id"), [(1060, 4), (1020, 5)])
def test_a_servo_that_was_changed_since_the_opening_is_not_armed(
    twin: SoftServoBus, armed: ServoBus, model: int, servo_id: int
) -> None:
    """Nor does it cost the others their hold."""
    armed.disarm()
    twin.modify_servo(4, lambda servo: (servo.table.__setitem__("model_number", model), servo.table.__setitem__("id", servo_id)))
    with pytest.raises(WrongServo, match=r"servo down \(id 4\)"):
        armed.arm()
    assert not armed.is_armed
    assert _torques(twin) == [1] * 7


def test_a_servo_that_keeps_another_profile_is_not_armed(
    twin: SoftServoBus, bus: ServoBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would go to its goals as fast as it can."""
    bus.set_zero()
    write = ServoLine.write
    monkeypatch.setattr(
        ServoLine, "write", lambda line, i, address, data: None if address == 108 else write(line, i, address, data)
    )
    with pytest.raises(WriteRefused, match=r"servo right \(id 1\) did not take its greatest speed"):
        bus.arm()
    assert _torques(twin) == [0] * 7


@pytest.mark.parametrize(("register", "name"), [("velocity_limit", "velocity limit"), ("return_delay", "return delay")])
def test_neither_connecting_nor_arming_lets_go_of_a_wire(
    twin: SoftServoBus, armed: ServoBus, register: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The EEPROM can only be written with the torque off: the wire would be loose for some ten transactions."""
    armed.close()
    twin.modify_servo(3, lambda servo: servo.table.__setitem__(register, 7))
    changes = TorqueChanges(twin, monkeypatch)
    armed.open()
    armed.set_zero(basis=ZeroBasis.SEARCHED)
    with pytest.raises(NotReady, match=rf"servo up \(id 3\) holds with another {name}: .*switch the torque off.* then arm"):
        armed.arm()
    assert changes.seen == []
    assert twin.servo(3).table[register] == 7
    armed.torque_off()
    armed.arm()
    assert twin.servo(3).table[register] == {"velocity_limit": 200, "return_delay": 0}[register]
    assert _torques(twin) == [1] * 7


def test_another_speed_needs_nothing_of_the_eeprom(twin: SoftServoBus, armed: ServoBus, monkeypatch: pytest.MonkeyPatch) -> None:
    """The speed is in the profile, which a servo that holds takes, too; the velocity limit only may not be below it."""
    armed.close()
    changes = TorqueChanges(twin, monkeypatch)
    slow = CONFIG.model_copy(update={"joints": tuple(j.model_copy(update={"max_speed_mm_s": 2.0}) for j in CONFIG.joints)})
    for config, units in ((slow, 13), (CONFIG, 65)):
        bus = ServoBus(config, twin.port)
        bus.open()
        bus.set_zero(basis=ZeroBasis.SEARCHED)
        bus.arm()
        bus.close()
        assert twin.servo(3).table["profile_velocity"] == units
    assert changes.seen == []


def test_a_servo_that_holds_in_another_mode_is_not_zeroed_before_it_was_let_go(twin: SoftServoBus, armed: ServoBus) -> None:
    armed.close()
    twin.modify_servo(3, lambda servo: servo.table.__setitem__("drive_mode", 1))
    armed.open()
    assert _torques(twin) == [1] * 7
    with pytest.raises(NotReady, match=r"servo up \(id 3\) holds in a mode of another program: switch the torque off"):
        armed.set_zero(basis=ZeroBasis.HERE)
    armed.torque_off()
    armed.set_zero()
    assert twin.servo(3).table["drive_mode"] == 0
    armed.arm()


def test_opened_again_the_eeprom_is_not_written_again(twin: SoftServoBus, bus: ServoBus) -> None:
    bus.close()
    twin.log.clear()
    bus.open()
    assert _writes(twin, 3) == []


def test_arming_does_not_move_anything(twin: SoftServoBus, bus: ServoBus) -> None:
    twin.modify_servo(5, lambda servo: servo.turn(700))  # its goal register still says the old place
    bus.set_zero()
    before = twin.positions_mm()
    bus.arm()
    time.sleep(0.05)
    assert twin.positions_mm() == before
    assert all(state.torque and state.position_mm == 0.0 for state in _states(bus))


def test_not_armed_without_zeros(bus: ServoBus) -> None:
    bus.set_zero({"right": 0.0, "left": 0.0})
    with pytest.raises(NotReady, match="not zeroed: up, down, advance, delivery_1, delivery_2"):
        bus.arm()
    assert bus.zero_ticks[:3] == (1001, 1002, None)


def test_not_armed_with_a_hardware_error(twin: SoftServoBus, bus: ServoBus) -> None:
    bus.set_zero()
    twin.modify_servo(6, lambda servo: servo.alert(32))
    with pytest.raises(NotReady, match=r"servo delivery_1 \(id 6\) reports overload: .* reboot"):
        bus.arm()


@pytest.mark.parametrize("silent", [False, True])
def test_arming_that_fails_midway_leaves_no_torque_or_names_the_servos(
    twin: SoftServoBus, bus: ServoBus, monkeypatch: pytest.MonkeyPatch, silent: bool
) -> None:
    bus.set_zero()
    write = ServoLine.write

    def fail_at_the_fifth(line: ServoLine, servo_id: int, address: int, data: bytes) -> None:
        if (servo_id, address, data) == (5, 64, b"\1"):
            twin.faults.mute(1, silent)
            raise WriteRefused("servo 5 did not take it")
        write(line, servo_id, address, data)

    monkeypatch.setattr(ServoLine, "write", fail_at_the_fifth)
    if silent:
        with pytest.raises(
            TorqueStillOn, match=r"servo 5 did not take it; torque of right is not proven to be off: cut the servos'"
        ):
            bus.arm()
    else:
        with pytest.raises(WriteRefused):
            bus.arm()
        assert _torques(twin) == [0] * 7
    assert not bus.is_armed


class TorqueChanges:
    """Every change of a servo's torque between two packets, as (id, value)."""

    def __init__(self, twin: SoftServoBus, monkeypatch: pytest.MonkeyPatch) -> None:
        self.seen: list[tuple[int, int]] = []
        answer = SoftServo.answer

        def watched(servo: SoftServo, *args: object, **details: object) -> object:
            before = servo.table["torque"]
            reply = answer(servo, *args, **details)
            if servo.table["torque"] != before:
                self.seen.append((servo.id, servo.table["torque"]))
            return reply

        monkeypatch.setattr(SoftServo, "answer", watched)


def test_arming_again_lets_go_of_no_wire(twin: SoftServoBus, armed: ServoBus, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a STOP with the head bent all seven let go for 0.1 to 0.2 s."""
    armed.disarm()
    changes = TorqueChanges(twin, monkeypatch)
    armed.arm()
    assert changes.seen == []
    assert armed.is_armed


def test_a_servo_that_holds_in_another_mode_is_not_armed_and_does_not_let_go(twin: SoftServoBus, armed: ServoBus) -> None:
    armed.disarm()
    twin.modify_servo(3, lambda servo: servo.table.__setitem__("drive_mode", 1))
    with pytest.raises(NotReady, match=r"servo up \(id 3\) holds in a mode of another program: switch the torque off"):
        armed.arm()
    assert _torques(twin) == [1] * 7


@pytest.mark.parametrize("on_before", [(), (1, 2, 3, 4), (1, 2, 3, 4, 5, 6, 7)])
def test_an_arming_that_is_broken_off_leaves_the_torque_as_it_was(
    twin: SoftServoBus, armed: ServoBus, on_before: tuple[int, ...]
) -> None:
    armed.torque_off()
    for servo_id in on_before:
        twin.modify_servo(servo_id, lambda servo: servo.table.__setitem__("torque", 1))
    expected = [int(joint.id in on_before) for joint in CONFIG.joints]
    for calls in (0, 10, 40, 60, 75, 80, 84):
        left = [calls]

        def check(left: list[int] = left) -> None:
            left[0] -= 1
            if left[0] < 0:
                raise StoppedMeanwhile("stopped meanwhile")

        with armed.interruptible(check), pytest.raises(StoppedMeanwhile):
            armed.arm()
        assert _torques(twin) == expected, f"after {calls} transactions"
        assert not armed.is_armed
    armed.arm()


def test_armed_it_cannot_be_zeroed(armed: ServoBus) -> None:
    with pytest.raises(NotReady, match="disarm"):
        armed.set_zero()


def test_not_open_it_says_so(closed: ServoBus) -> None:
    for action in (closed.read, closed.arm, closed.set_zero, closed.hold, closed.torque_off):
        with pytest.raises(NotReady, match="open"):
            action()
    with pytest.raises(NotReady):
        closed.write([0.0] * 7)


# --- goals -----------------------------------------------------------------------------------------------------------------------


def test_goals_are_reached_in_the_joints_direction(twin: SoftServoBus) -> None:
    joints = tuple(joint.model_copy(update={"sign": -1 if joint.name == "left" else 1}) for joint in CONFIG.joints)
    bus = ServoBus(CONFIG.model_copy(update={"joints": joints}), twin.port)
    bus.open()
    bus.set_zero()
    bus.arm()
    goals = (0.3, 0.2, -0.1, 0.0, 0.5, 0.4, 0.4)
    sent = bus.write(goals)
    assert sent == pytest.approx(goals, abs=0.005)
    for _ in range(100):
        states = _states(bus)
        if [state.ticks for state in states] == [state.goal_ticks for state in states]:
            break
        time.sleep(0.01)
    assert tuple(state.position_mm for state in states) == pytest.approx(sent)
    assert [state.goal_ticks for state in states][:2] == [1001 + 31, 1002 - 20]
    bus.close()


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e9])
def test_a_bad_goal_sends_nothing(twin: SoftServoBus, armed: ServoBus, bad: float) -> None:
    twin.log.clear()
    with pytest.raises(ValueError, match="joint down"):
        armed.write([0.1, 0.1, 0.1, bad, 0.1, 0.1, 0.1])
    with pytest.raises(ValueError, match="argument"):
        armed.write([0.1] * 6)
    assert not twin.log


def test_no_goals_before_arming_and_after_disarming(armed: ServoBus) -> None:
    armed.disarm()
    with pytest.raises(NotReady, match="not armed"):
        armed.write([0.0] * 7)
    assert all(state.torque for state in _states(armed))


def test_hold_stops_where_it_is(twin: SoftServoBus, armed: ServoBus) -> None:
    armed.write([0.0, 0.0, 0.0, 0.0, 50.0, 0.0, 0.0])
    _until(armed, 4, lambda reading: isinstance(reading, ServoState) and reading.velocity_mm_s > 5.0)
    held = armed.hold()[4]
    state = _until(armed, 4, lambda reading: isinstance(reading, ServoState) and reading.ticks == reading.goal_ticks)
    assert state.position_mm == pytest.approx(held.position_mm)
    assert state.position_mm < 40.0


def test_tendons_are_slackened_without_being_armed(twin: SoftServoBus, armed: ServoBus) -> None:
    armed.write((0.5, 0.5, 0.5, 0.5, 0.5, 0.0, 0.0))
    _until(armed, 0, lambda r: isinstance(r, ServoState) and r.position_mm == r.goal_mm and (r.position_mm or 0.0) > 0.4)
    armed.disarm()
    armed.slacken((0.2, None, None, None, None, None, None), _states(armed))
    _until(armed, 0, lambda r: isinstance(r, ServoState) and (r.position_mm or 1.0) == pytest.approx(0.2, abs=0.01))
    assert twin.positions_mm()[1] > 0.4


@pytest.mark.parametrize(
    "goals_mm",
    [(0.1, None, None, None, None, None, None), (-0.7, None, None, None, None, None, None), (None,) * 4 + (-0.1, None, None),
     (math.nan, None, None, None, None, None, None)],
    ids=["tighter", "more than a step", "the feed", "not a number"],
)  # fmt: skip
def test_what_is_not_slackening_is_not_sent(twin: SoftServoBus, armed: ServoBus, goals_mm: tuple[float | None, ...]) -> None:
    armed.disarm()
    states = _states(armed)
    twin.log.clear()
    with pytest.raises(ValueError, match="cannot be slackened"):
        armed.slacken(goals_mm, states)
    assert not any(packet.instruction == Instruction.SYNC_WRITE for packet in twin.log)


def test_torque_off_is_one_packet_three_times_read_back(twin: SoftServoBus, armed: ServoBus) -> None:
    twin.log.clear()
    armed.torque_off()
    broadcasts = [packet for packet in twin.log if packet.id == 254 and packet.instruction == Instruction.WRITE]
    assert [packet.parameters for packet in broadcasts] == [bytes([64, 0, 0])] * 3
    assert not armed.is_armed
    assert not any(state.torque for state in _states(armed))


def test_torque_off_without_proof_is_an_error(twin: SoftServoBus, armed: ServoBus) -> None:
    twin.faults.mute(3)
    with pytest.raises(TorqueStillOn, match=r"torque of .*up.*cut the servos' power"):
        armed.torque_off()
    assert twin.servo(3).table["torque"] == 0


def test_who_hears_it_lets_go_though_the_seven_are_not_complete(twin: SoftServoBus, armed: ServoBus) -> None:
    armed.close()
    twin.faults.mute(3)
    with pytest.raises(NoAnswer, match=r"up \(id 3\)"):
        armed.open()
    with pytest.raises(TorqueStillOn, match="torque of up is not proven"):
        armed.let_go()
    assert [twin.servo(joint.id).table["torque"] for joint in CONFIG.joints if joint.name != "up"] == [0] * 6
    assert not armed.is_open


def test_close_holds_and_keeps_the_wires_tight(twin: SoftServoBus, armed: ServoBus) -> None:
    armed.write([0.0, 0.0, 0.0, 0.0, 50.0, 0.0, 0.0])
    _until(armed, 4, lambda reading: isinstance(reading, ServoState) and reading.velocity_mm_s > 5.0)
    armed.close()
    table = twin.servo(5).table
    assert table["goal_position"] < 1005 + 45 * 102.4
    assert table["torque"] == 1


# --- faults 21 to 27 of the bench's list -----------------------------------------------------------------------------------------


def test_21_a_silent_servo_is_missing_not_zero_and_the_others_are_read(twin: SoftServoBus, armed: ServoBus) -> None:
    twin.faults.mute(3)
    seen = []
    for _ in range(8):
        readings = armed.read()
        assert isinstance(readings[2], MissingServo)
        seen.append(readings[2].misses)
        time.sleep(0.02)
    assert seen == sorted(seen)
    assert seen[-1] >= 3
    assert any(all(isinstance(r, ServoState) for i, r in enumerate(armed.read()) if i != 2) for _ in range(5))
    twin.faults.mute(3, False)
    _until(armed, 2, lambda reading: isinstance(reading, ServoState))
    assert armed.is_armed


def test_21_all_silent_ends_in_bounded_time(twin: SoftServoBus, armed: ServoBus) -> None:
    for joint in CONFIG.joints:
        twin.faults.mute(joint.id)
    for _ in range(6):
        readings = armed.read()
        time.sleep(0.05)
    assert all(isinstance(reading, MissingServo) and reading.misses >= 3 for reading in readings)


def test_22_one_damaged_answer_is_asked_for_again(twin: SoftServoBus, armed: ServoBus) -> None:
    twin.faults.crc(1)
    assert len(_states(armed)) == 7
    assert armed.counts.corrupt == 1
    assert armed.counts.retries >= 1


def test_22_many_damaged_answers_are_counted_and_missing(twin: SoftServoBus, armed: ServoBus) -> None:
    twin.faults.crc(1000)
    readings = armed.read()
    assert all(isinstance(reading, MissingServo) and reading.reason == "damaged answer" for reading in readings)
    assert armed.counts.corrupt > 5
    twin.faults.crc(0)
    assert len(_states(armed)) == 7


@pytest.mark.parametrize("count", [3, 500])
def test_22_garbage(twin: SoftServoBus, armed: ServoBus, count: int) -> None:
    twin.faults.garbage(count)
    armed.read()
    assert len(_states(armed)) == 7


@pytest.mark.parametrize("fault", ["truncate", "short"])
def test_22_truncated_and_short_answers(twin: SoftServoBus, armed: ServoBus, fault: str) -> None:
    getattr(twin.faults, fault)(4, 1)
    armed.read()
    assert armed.counts.corrupt >= 1
    assert len(_states(armed)) == 7


@pytest.mark.parametrize("fault", ["truncate", "short"])
def test_22_in_single_requests_too(twin: SoftServoBus, bus: ServoBus, fault: str) -> None:
    getattr(twin.faults, fault)(4, 1)
    bus.set_zero()
    getattr(twin.faults, fault)(4, 10)
    with pytest.raises(NoAnswer, match="servo 4: damaged answer, 3 times"):
        bus.set_zero()


def test_22_a_late_answer_is_never_taken_for_a_new_one(twin: SoftServoBus, bus: ServoBus) -> None:
    """The horn turns between two reads; the answer to the first comes while the second waits, and tells the old place."""
    _states(bus)
    twin.faults.delay(4, 0.08)
    assert isinstance(bus.read()[3], MissingServo)
    twin.modify_servo(4, lambda servo: servo.turn(500))
    twin.faults.delay(4, 0.0)
    for _ in range(10):
        reading = bus.read()[3]
        assert isinstance(reading, MissingServo) or reading.ticks == 1504
        time.sleep(0.01)
    assert isinstance(reading, ServoState)


def test_22_a_late_answer_to_a_single_request(twin: SoftServoBus, bus: ServoBus) -> None:
    twin.faults.delay(4, 0.05)
    with pytest.raises(NoAnswer, match="servo 4: no answer, 3 times"):
        bus.set_zero()
    twin.modify_servo(4, lambda servo: servo.turn(500))
    twin.faults.delay(4, 0.0)
    bus.set_zero()
    assert bus.zero_ticks[3] == 1504


@pytest.mark.parametrize("bits", [1, 4, 32])
def test_23_an_alert_is_read(twin: SoftServoBus, armed: ServoBus, bits: int) -> None:
    twin.modify_servo(2, lambda servo: servo.alert(bits))
    state = _states(armed)[1]
    assert state.error == HardwareError(bits)
    assert state.torque == (bits == 1)
    assert armed.is_armed == (bits == 1)


def test_25_a_jam_shows_as_distance_and_never_as_more_force_than_the_joint_may_give(
    twin: SoftServoBus, armed: ServoBus, clock: Clock
) -> None:
    """The servo limits itself: neither half a second of overcurrent nor its own overload is waited for."""
    twin.modify_servo(1, lambda servo: servo.freeze(True))
    armed.write([2.0] + [0.0] * 6)
    time.sleep(0.3)
    state = _states(armed)[0]
    assert (state.position_mm, state.goal_mm) == (0.0, pytest.approx(2.0, abs=0.005))
    assert state.current_ma == pytest.approx(69.94)
    clock.ahead_s += 60.0
    state = _states(armed)[0]
    assert (state.error, state.torque) == (HardwareError(0), True)


def _force_n(twin: SoftServoBus, joint: JointConfig) -> float:
    """Force at the joint's drum."""
    return abs(twin.servo(joint.id).torque_mnm) / (joint.mm_per_turn / (2.0 * math.pi))


@pytest.mark.parametrize(
    ("model", "force_n", "mm_per_turn"),
    [(1020, 5.0, 40.0), (1020, 20.0, 62.8), (1020, 40.0, 20.0), (1130, 30.0, 40.0), (1200, 20.0, 40.0), (1060, 20.0, 40.0),
     (1160, 30.0, 20.0)],
)  # fmt: skip
def test_a_blocked_horn_gives_no_more_than_the_joints_force(
    start_servos: Callable[..., SoftServoBus], clock: Clock, model: int, force_n: float, mm_per_turn: float
) -> None:
    changed = {"max_force_n": force_n, "mm_per_turn": mm_per_turn, "model": model}
    config = CONFIG.model_copy(update={"joints": tuple(joint.model_copy(update=changed) for joint in CONFIG.joints)})
    twin = start_servos(config, clock=clock, positions=[1000] * 7)
    bus = ServoBus(config, twin.port)
    try:
        bus.open()
        bus.set_zero()
        bus.arm()
        for joint in config.joints:
            twin.modify_servo(joint.id, lambda servo: servo.freeze(True))
        for goal_mm in (0.6, -0.6, 2.5, -2.0):
            bus.write([goal_mm] * 7)
            for _ in range(10):
                _states(bus)
                assert all(_force_n(twin, joint) <= force_n for joint in config.joints)
                clock.ahead_s += 0.05
        assert all(_force_n(twin, joint) > 0.5 * force_n for joint in config.joints), "they do pull"
    finally:
        bus.close()


# --- force is limited in the servo -----------------------------------------------------------------------------------------------


def _limits(twin: SoftServoBus) -> list[int]:
    return [twin.servo(joint.id).table["goal_current"] for joint in CONFIG.joints]


def test_the_force_limit_is_in_the_servos_before_their_torque_comes_on(twin: SoftServoBus, bus: ServoBus) -> None:
    bus.set_zero()
    twin.log.clear()
    bus.arm()
    assert _limits(twin) == [26] * 4 + [39] * 3
    assert all(twin.servo(joint.id).table["operating_mode"] == 5 for joint in CONFIG.joints)
    for joint in CONFIG.joints:
        order = [packet.parameters[0] for packet in twin.log if packet.id == joint.id and packet.instruction == Instruction.WRITE]
        assert order.index(102) < order.index(64)


def test_a_servo_that_is_itself_limited_to_less_keeps_that(twin: SoftServoBus, bus: ServoBus) -> None:
    bus.set_zero()
    twin.modify_servo(2, lambda servo: servo.table.__setitem__("current_limit", 10))
    bus.arm()
    assert _limits(twin) == [26, 10, 26, 26, 39, 39, 39]
    assert all(state.is_limited for state in _states(bus))


def test_a_servo_that_takes_no_force_limit_is_not_switched_on(
    twin: SoftServoBus, bus: ServoBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus.set_zero()
    write = ServoLine.write
    monkeypatch.setattr(ServoLine, "write", lambda line, i, at, data: None if (i, at) == (4, 102) else write(line, i, at, data))
    with pytest.raises(WriteRefused, match=r"servo down \(id 4\) did not take its force limit"):
        bus.arm()
    assert _torques(twin) == [0] * 7


def test_a_force_limit_that_another_master_takes_away_is_seen(twin: SoftServoBus, armed: ServoBus) -> None:
    assert all(state.is_limited for state in _states(armed))
    twin.modify_servo(6, lambda servo: servo.answer(3, 102, data=(1193).to_bytes(2, "little")))
    assert [state.is_limited for state in _states(armed)] == [True] * 5 + [False, True]


def test_a_model_without_current_is_limited_by_its_duty(start_servos: Callable[..., SoftServoBus], clock: Clock) -> None:
    with _armed_with(start_servos, clock, model=1080, max_force_n=40.0) as (twin, bus):
        # 40 N on a drum of 40 mm a turn: 0.2546 Nm of 1.9 Nm at 12 V, at 14.8 V 10.9 %: 96 of 885
        assert [twin.servo(joint.id).table["goal_pwm"] for joint in CONFIG.joints] == [96] * 4 + [885] * 3
        assert [twin.servo(joint.id).table["operating_mode"] for joint in CONFIG.joints] == [4] * 4 + [5] * 3
        assert [state.current_ma is None for state in _states(bus)] == [True] * 4 + [False] * 3
        twin.modify_servo(2, lambda servo: servo.answer(3, 100, data=(885).to_bytes(2, "little")))
        assert [state.is_limited for state in _states(bus)] == [True, False, True, True, True, True, True]


def _has_backup(servo: SoftServo, startup: int) -> None:
    """As another program may leave it: a backup that a restart brings back (indirect addresses among it)."""
    servo.backup()
    servo.table["startup"] = startup


@pytest.mark.parametrize("startup", [1, 3])
def test_27_startup_configuration_is_set_to_0(
    twin: SoftServoBus, closed: ServoBus, caplog: pytest.LogCaptureFixture, startup: int
) -> None:
    """While the torque is off; a servo that holds is left alone, and not armed."""
    for servo_id in (3, 5):
        twin.modify_servo(servo_id, lambda servo: _has_backup(servo, startup))
    twin.modify_servo(5, lambda servo: servo.table.__setitem__("operating_mode", 5))
    twin.modify_servo(5, lambda servo: servo.table.__setitem__("torque", 1))
    closed.open()
    assert [twin.servo(servo_id).table["startup"] for servo_id in (3, 5)] == [0, startup]
    assert f"servo up (id 3) had Startup Configuration (register 60) {startup}: set to 0" in caplog.text
    closed.set_zero()
    with pytest.raises(
        NotReady, match=r"servo advance \(id 5\) holds with another .*startup configuration: .*switch the torque off"
    ):
        closed.arm()
    closed.torque_off()
    closed.arm()
    assert twin.servo(5).table["startup"] == 0


@pytest.mark.parametrize("startup", [0, 3])
def test_27_a_brown_out_is_seen_also_where_the_servo_restores_its_block(
    twin: SoftServoBus, armed: ServoBus, clock: Clock, startup: int
) -> None:
    """The feed is at 75 mm, and would be taken for two turns (80 mm) less."""
    twin.modify_servo(5, lambda servo: servo.carry(75 * 102.4 / 10.0))
    clock.ahead_s += 10.0
    twin.modify_servo(5, lambda servo: (servo.carry(0.0), _has_backup(servo, startup)))
    assert _states(armed)[4].position_mm == pytest.approx(75.0, abs=1.0)
    twin.brown_out()
    clock.ahead_s += 0.5
    for _ in range(20):
        readings = armed.read()
        if any(isinstance(reading, MissingServo) and reading.restarted for reading in readings):
            break
        time.sleep(0.05)
    assert not armed.is_armed
    assert armed.zero_ticks[4] is None
    assert twin.positions_mm()[4] == pytest.approx(75.0, abs=1.0)
    time.sleep(0.05)
    with pytest.raises(NotReady, match=r"not zeroed: .*advance"):
        armed.arm()


@pytest.mark.parametrize("startup", [0, 2])
def test_27_arming_sees_a_brown_out_that_no_read_has_seen(twin: SoftServoBus, bus: ServoBus, startup: int) -> None:
    bus.set_zero()
    twin.modify_servo(5, lambda servo: (_has_backup(servo, startup), servo.restart(silent_s=0.0)))
    with pytest.raises(NotReady, match="not zeroed: advance"):
        bus.arm()


def test_27_the_mark_of_a_session_is_known_again_by_the_next_one(twin: SoftServoBus, armed: ServoBus) -> None:
    """A servo that has not restarted keeps its mark; one that cannot keep any is still told by its block."""
    before = twin.servo(2).table.read(224, 1)
    armed.close()
    armed.open()
    assert twin.servo(2).table.read(224, 1) == before != (0, b"\0")


def test_26_a_vanished_port_is_lost_and_opens_again_clean(twin: SoftServoBus, armed: ServoBus) -> None:
    twin.vanish()
    with pytest.raises(PortLost, match="check the USB cable") as caught:
        armed.read()
    assert "\n" not in str(caught.value)
    assert not armed.is_open
    assert not armed.is_armed
    with pytest.raises(PortError, match="does not exist"):
        armed.open()
    twin.reappear()
    armed.open()
    assert len(_states(armed)) == 7
    assert not armed.is_armed
    assert armed.zero_ticks == (None,) * 7


@pytest.mark.parametrize("action", ["write", "hold", "torque_off", "arm", "set_zero"])
def test_26_whatever_is_asked_of_a_vanished_port(twin: SoftServoBus, armed: ServoBus, action: str) -> None:
    if action in {"arm", "set_zero"}:
        armed.disarm()
    twin.vanish()
    with pytest.raises(PortLost):
        getattr(armed, action)(*([[0.0] * 7] if action == "write" else []))
    armed.close()


def test_26_it_vanishes_while_an_answer_is_waited_for(twin: SoftServoBus, armed: ServoBus) -> None:
    for joint in CONFIG.joints:
        twin.faults.delay(joint.id, 1.0)
    timer = threading.Timer(0.01, twin.vanish)
    timer.start()
    with pytest.raises(PortLost):
        for _ in range(20):
            armed.read()
    timer.join()


def test_26_an_adapter_that_takes_no_bytes_is_lost_at_once(
    twin: SoftServoBus, armed: ServoBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hardware.servos.dynamixel_port.os.write", lambda _fd, data: len(data) - 1)
    with pytest.raises(PortLost, match="takes no more bytes"):
        armed.write([0.0] * 7)
    monkeypatch.undo()
    armed.open()


def test_27_a_restarted_servo_is_noticed_disarmed_and_must_be_zeroed(twin: SoftServoBus, armed: ServoBus) -> None:
    twin.modify_servo(3, lambda servo: servo.restart(silent_s=0.0))
    reading = armed.read()[2]
    assert isinstance(reading, MissingServo)
    assert reading.restarted
    assert not armed.is_armed
    assert armed.zero_ticks[2] is None
    states = _states(armed)
    assert states[2].position_mm is None
    assert not states[2].torque
    with pytest.raises(NotReady, match="not zeroed: up"):
        armed.arm()
    armed.set_zero({"up": 0.0})
    armed.arm()
    assert armed.is_armed


def test_27_a_servo_that_restarts_between_disarming_and_arming_is_not_armed(twin: SoftServoBus, armed: ServoBus) -> None:
    """Nobody has read it meanwhile: the block that it has forgotten is the only sign, and arming must not wipe it off."""
    armed.disarm()
    twin.modify_servo(5, lambda servo: servo.restart(silent_s=0.0))
    with pytest.raises(NotReady, match="not zeroed: advance "):
        armed.arm()
    assert not armed.is_armed
    assert [state.torque for state in _states(armed)] == [True] * 4 + [False] + [True] * 2, "what held goes on holding"
    assert [ticks is None for ticks in armed.zero_ticks] == [False] * 4 + [True] + [False] * 2
    armed.set_zero({"advance": 0.0})
    armed.arm()
    assert armed.is_armed


def test_27_a_reboot_clears_the_error_and_the_turns(twin: SoftServoBus, bus: ServoBus) -> None:
    twin.modify_servo(5, lambda servo: servo.turn(3 * 4096))
    twin.modify_servo(5, lambda servo: servo.alert(32))
    bus.set_zero()
    bus.reboot(5)
    assert bus.zero_ticks[4] is None
    state = _states(bus)[4]
    assert (state.error, state.ticks, state.position_mm) == (HardwareError(0), 1005, None)
    bus.set_zero({"advance": 0.0})
    bus.arm()


def test_27_a_reboot_without_return(twin: SoftServoBus, armed: ServoBus) -> None:
    twin.faults.mute(5)
    with pytest.raises(NoAnswer, match="did not come back"):
        armed.reboot(5)
    assert not armed.is_armed
    with pytest.raises(WrongServo, match="no servo with id 99"):
        armed.reboot(99)


# --- the servos' own watchdog ----------------------------------------------------------------------------------------------------


def test_a_tripped_watchdog_is_seen_though_writes_succeed_and_is_cleared_by_arming(
    twin: SoftServoBus, armed: ServoBus, clock: Clock
) -> None:
    clock.ahead_s += 2.1
    armed.write([0.2] * 7)
    states = _states(armed)
    assert all(state.watchdog_tripped and state.torque and state.goal_mm == 0.0 for state in states)
    armed.arm()
    armed.write([0.2] * 7)
    states = _states(armed)
    assert not any(state.watchdog_tripped for state in states)
    assert [state.goal_mm for state in states] == pytest.approx([0.2] * 7, abs=0.005)
    table = twin.servo(1).table
    assert (table["profile_velocity"], table["profile_acceleration"], table["watchdog"]) == (65, 83, 100)


def test_who_stops_talking_is_held_by_the_watchdog(twin: SoftServoBus, armed: ServoBus, clock: Clock) -> None:
    armed.write([0.0, 0.0, 0.0, 0.0, 100.0, 0.0, 0.0])
    _states(armed)  # who answers has heard the goals
    places = []
    for _ in range(40):
        clock.ahead_s += 0.1
        places.append(twin.positions_mm()[4])
    assert places[10] > 10.0
    assert places[-1] == places[-10]
    assert places[-1] == pytest.approx(2.0 * 20.0, abs=5.0)


# --- several models on one line --------------------------------------------------------------------------------------------------


def test_small_and_strong_servos_work_together(mixed: tuple[SoftServoBus, ServoBus]) -> None:
    _, bus = mixed
    assert [identity.model for identity in bus.identities] == [1200] * 4 + [1020] * 3
    states = _states(bus)
    assert [state.voltage_v for state in states] == [5.0] * 4 + [12.0] * 3
    assert all(not state.error for state in states)
    bus.write((0.3, 0.2, 0.1, 0.0, 0.4, 0.5, 0.6))
    for index, goal_mm in enumerate((0.3, 0.2, 0.1, 0.0, 0.4, 0.5, 0.6)):
        _until(bus, index, lambda r, goal_mm=goal_mm: isinstance(r, ServoState) and abs((r.position_mm or 0.0) - goal_mm) < 0.01)


def test_currents_of_several_models_are_told_in_their_units(mixed: tuple[SoftServoBus, ServoBus]) -> None:
    twin, bus = mixed
    twin.modify_servo(1, lambda servo: servo.grind(200.0))  # in the winding: 208 mA, of 1470 mA at stall
    twin.modify_servo(5, lambda servo: servo.grind(50.0))
    small, strong = (_until(bus, index, lambda r: isinstance(r, ServoState) and (r.current_ma or 0.0) > 25.0) for index in (0, 4))
    assert small.current_ma == pytest.approx(208.0**2 / 1470.0, abs=1.0), "of the supply"
    assert strong.current_ma == pytest.approx(58.0, abs=3.0)


def test_a_small_servo_that_restarts_is_seen_also_where_it_restores_its_block(mixed: tuple[SoftServoBus, ServoBus]) -> None:
    twin, bus = mixed
    twin.modify_servo(2, lambda servo: _has_backup(servo, 2))
    twin.modify_servo(2, lambda servo: servo.restart(0.0))
    reading = _until(bus, 1, lambda r: isinstance(r, MissingServo) and r.restarted)
    assert isinstance(reading, MissingServo)
    assert bus.zero_ticks[1] is None


@pytest.mark.parametrize("servo_id", [2, 6])
def test_a_silent_servo_of_one_model_hides_none_of_another(mixed: tuple[SoftServoBus, ServoBus], servo_id: int) -> None:
    twin, bus = mixed
    twin.faults.mute(servo_id)
    readings = _until_all(bus, lambda readings: isinstance(readings[servo_id - 1], MissingServo))
    assert [isinstance(reading, ServoState) for reading in readings] == [k != servo_id for k in range(1, 8)]


def _until_all(bus: ServoBus, wanted: Callable[[Sequence[ServoReading]], bool]) -> Sequence[ServoReading]:
    for _ in range(100):
        readings = bus.read()
        if wanted(readings):
            return readings
        time.sleep(0.01)
    raise AssertionError(readings)


def test_tendons_are_let_go_though_the_watchdogs_have_tripped(twin: SoftServoBus, armed: ServoBus, clock: Clock) -> None:
    """After it a servo takes no goals, and has neither speed nor acceleration to keep to."""
    armed.write([0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    _until(armed, 0, lambda state: state.position_mm == pytest.approx(0.5, abs=0.02))
    clock.ahead_s += 2.1
    states = _states(armed)
    assert all(state.watchdog_tripped for state in states)
    armed.disarm()
    armed.slacken([0.2] + [None] * 6, states)
    _until(armed, 0, lambda state: state.position_mm == pytest.approx(0.2, abs=0.02))
    first, second = twin.servo(1).table, twin.servo(2).table
    assert (first["profile_velocity"], first["profile_acceleration"], first["watchdog"]) == (65, 83, 100)
    assert second["watchdog"] == -1, "it is not needed"
    assert not armed.is_armed
