"""The foot pedal: its lines, what they mean, and the driver against a software pedal on a pseudo-terminal."""

from __future__ import annotations

import itertools
import re
import shutil
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from core.config.models import ConfigError, PedalConfig, load_config
from core.devices import DeviceError
from hardware.inputs.pedal import (
    Pedal,
    PedalError,
    PedalFilter,
    PedalLine,
    PedalLost,
    PedalParser,
    PedalPortError,
    PedalPortTaken,
    PedalReport,
    PedalUnheard,
    crc8,
    line_bytes,
    open_pedal_port,
)
from tests.hardware.inputs.listener import Listener
from tests.hardware.soft_pedal import SoftPedal

ROOT = Path(__file__).resolve().parents[3]
CONFIG = PedalConfig(port="pedal")
ESTOP_LINE = b"PDDE@B\n"
LINES = [
    PedalLine(number, down, stop, estop)
    for number in range(32)
    for down in (False, True)
    for stop, estop in ((False, False), (True, False), (False, True))
]

# --- lines -----------------------------------------------------------------------------------------------------------------------


def test_the_crc_is_the_well_known_one() -> None:
    assert crc8(b"123456789") == 0xF4


def test_lines_as_they_are_sent() -> None:
    lines = [PedalLine(1, False, False), PedalLine(2, True, False), PedalLine(3, False, True), PedalLine(4, True, False, True)]
    assert [line_bytes(line) for line in lines] == [b"PA--IE\n", b"PBD-F@\n", b"PC-SCN\n", ESTOP_LINE]


@pytest.mark.parametrize("size", [1, 2, 5, 7, 8, 10_000])
def test_lines_are_found_however_they_are_cut(size: int) -> None:
    stream = b"".join(line_bytes(line) for line in LINES)
    parser = PedalParser()
    assert [line for at in range(0, len(stream), size) for line in parser.feed(stream[at : at + size])] == LINES


@pytest.mark.parametrize(
    "text",
    [
        b"\n", b"P\n", b"PA--I\n", b"PA--IEE\n", b"A--IE\n", b"PA--IE\r\n", b"pA--IE\n", b"PA--ie\n", b"PA-DIE\n", b"PA--IF\n",
        b" PA--IE\n", b"PA--\0IE\n", b"\xff\xff\xff\xff\xff\xff\n", b"PBD-IE\n",
    ],
)  # fmt: skip
def test_what_is_nearly_a_line_is_damaged(text: bytes) -> None:
    assert set(PedalParser().feed(text)) == {None}


def test_endless_garbage_is_told_at_once_and_once_and_kept_nowhere() -> None:
    parser = PedalParser()
    assert parser.feed(b"x" * 6) == []
    assert parser.feed(b"x") == [None]
    assert parser.feed(b"x" * 100_000) == []
    assert parser.feed(b"x\n" + line_bytes(LINES[7])) == [LINES[7]]


@pytest.mark.parametrize(("flips", "lines"), [(1, LINES), (2, LINES[::9]), (3, LINES[1:2] + LINES[5:6])])
def test_no_line_with_up_to_three_wrong_bits_is_taken_for_another(flips: int, lines: list[PedalLine]) -> None:
    after = line_bytes(PedalLine(9, False, False))
    for line in lines:
        sound = int.from_bytes(line_bytes(line))
        for bits in itertools.combinations(range(56), flips):
            damaged = (sound ^ sum(1 << bit for bit in bits)).to_bytes(7)
            found = PedalParser().feed(damaged + after)
            assert found[0] is None and set(found[1:]) <= {None, PedalLine(9, False, False)}, damaged


@given(st.lists(st.binary(max_size=30) | st.sampled_from([line_bytes(line) for line in LINES[::5]]), max_size=20))
def test_no_bytes_make_the_parser_fail_and_it_finds_only_what_is_there(chunks: list[bytes]) -> None:
    parser, stream = PedalParser(), b"".join(chunks)
    found = [line for chunk in chunks for line in parser.feed(chunk)]
    there = [bytes(match[1]) for match in re.finditer(rb"(?<![^\n])(?=([^\n]{6}\n))", stream)]
    assert all(line is None or line_bytes(line) in there for line in found)
    assert len(found) <= stream.count(b"\n") + 1


@given(st.lists(st.tuples(st.sampled_from(["cut", "flip", "swap", "double", "insert"]), st.integers(0, 1000)), max_size=30))
def test_a_line_of_a_lifted_foot_is_never_read_as_a_press(damages: list[tuple[str, int]]) -> None:
    stream = bytearray(b"".join(line_bytes(PedalLine(number % 32, False, False)) for number in range(40)))
    for damage, where in damages:
        at = where % len(stream)
        match damage:
            case "cut":
                del stream[at : at + 1 + where % 3]
            case "flip":
                stream[at] ^= 1 << where % 8
            case "swap":
                stream[at : at + 2] = stream[at : at + 2][::-1]
            case "double":
                stream[at:at] = stream[at : at + 5]
            case "insert":
                stream.insert(at, where % 256)
    assert not any(line.down for line in PedalParser().feed(bytes(stream)) if line is not None)


# --- what they mean --------------------------------------------------------------------------------------------------------------


def play(script: str, config: PedalConfig = CONFIG) -> str:
    """Reports every 20 ms, and what the deadman is after each: 1, 0, ? when nobody knows, or a blank when nothing was said.

    ``-`` lifted, ``D`` down, ``x`` damaged, ``_`` nothing; of a foot that is down: ``=`` the number again, ``>`` a number left out,
    ``<`` a number from before, ``l`` late.
    """
    watch, number, said = PedalFilter(config), 0, ""
    for turn, what in enumerate(script):
        now_s = 5.0 + 0.02 * turn
        if what == "_":
            said += " "
            continue
        number += {"=": 0, ">": 2, "<": -1}.get(what, 1)
        line = None if what == "x" else PedalLine(number % 32, what != "-", False)
        report = watch.update(line, now_s, late=what == "l")
        assert (report.stop, report.time_s) == (False, now_s)
        said += {True: "1", False: "0", None: "?"}[report.deadman]
    return said


@pytest.mark.parametrize(
    ("script", "deadman"),
    [
        ("--DDDD--", "?0?11100"),  # the second report of a press counts, and the first of its end
        ("--D-D-DD", "?0?0?0?1"),  # shorter than two reports is no press
        ("--DDD-DDD", "?0?110?11"),  # a short lift is seen, for two reports
        ("DDDDDDDD", "????????"),  # down from the start
        ("-DDDDDDD", "????????"),  # the first report follows none, so it shows no lifted foot
        ("DDDD-DDD", "????0?11"),
        ("--DDxDDD", "?0?1???1"),
        ("--DDx--D", "?0?1??0?"),  # after damage the second report of a lifted foot tells that it is lifted
        ("--DDD=DDD", "?0?11??11"),
        ("--DDD====", "?0?11????"),
        ("--DDD>DDD", "?0?11??11"),
        ("--DDD<DDD", "?0?11??11"),
        ("--DDD<<<<", "?0?11????"),
        ("--DDDlDDD", "?0?11??11"),
        ("--DDD_DDD", "?0?11 111"),  # 40 ms
        ("--DDD____DDD", "?0?11    ??1"),  # 100 ms
        ("--" + "D" * 40, "?0?" + "1" * 39),  # past number 31
        ("--DDD" + "x" * 20 + "DDD", "?0?11" + "?" * 20 + "??1"),  # 400 ms of damage
        ("--DDD" + "x" * 30 + "DDDDD-DDD", "?0?11" + "?" * 30 + "?????0?11"),  # 620 ms: lift it first
        ("--DDD" + "=" * 30 + "DDDDD-DDD", "?0?11" + "?" * 30 + "?????0?11"),
        ("--DDD" + "_" * 30 + "DDDDD-DDD", "?0?11" + " " * 30 + "?????0?11"),
    ],
)
def test_the_deadman_by_its_reports(script: str, deadman: str) -> None:
    assert play(script) == deadman


def test_more_reports_for_a_press_can_be_asked_for() -> None:
    assert play("--DDDDD-", PedalConfig(port="pedal", press_reports=4)) == "?0???110"


def test_a_press_counts_however_soon_a_foot_must_be_lifted_after_an_interruption() -> None:
    config = PedalConfig(port="pedal", resume_s=0.06)
    assert play("--DDD_DDD", config) == "?0?11 111"
    assert play("--DDD____DDD-DD", config) == "?0?11    ???0?1"


def test_stop_counts_from_any_whole_report_and_from_nothing_else() -> None:
    watch = PedalFilter(CONFIG)
    assert watch.update(PedalLine(7, False, True), 1.0) == PedalReport(None, True, 1.0, False)
    assert watch.update(PedalLine(7, True, True), 1.02).stop  # stuck
    assert watch.update(PedalLine(20, False, True), 1.04, late=True).stop
    assert watch.update(PedalLine(21, False, False), 1.06) == PedalReport(False, False, 1.06, False)
    assert watch.update(None, 1.08) == PedalReport(None, False, 1.08)
    assert watch.silence(1.2) == PedalReport(None, False, 1.2)


_HEARD = st.tuples(st.integers(0, 31) | st.none(), st.booleans(), st.booleans(), st.sampled_from([0.0, 0.02, 0.05, 0.07, 0.6]))


@given(st.lists(_HEARD, max_size=40), st.booleans())
def test_a_press_is_always_the_second_good_report_of_a_foot_that_was_seen_lifted(
    heard: list[tuple[int | None, bool, bool, float]], in_order: bool
) -> None:
    watch, now_s, number = PedalFilter(CONFIG), 3.0, 0
    lines: list[tuple[PedalLine | None, float]] = []
    for told, down, late, pause_s in heard:
        now_s += pause_s
        number = number + 1 if in_order or told is None else told
        line = PedalLine(number % 32, down, False) if told is not None else None
        report = watch.update(line, now_s, late=late)
        lines.append((line, now_s))
        assert report.deadman is not False or (line is not None and not line.down and not late)  # a foot that was seen lifted now
        if report.deadman:
            (first, first_s), (second, second_s) = lines[-2:]
            assert first is not None and second is not None and not late
            assert first.down and second.down and second.number == (first.number + 1) % 32
            assert second_s - first_s <= CONFIG.silence_s
            assert any(line is not None and not line.down for line, _ in lines)


def test_an_e_stop_counts_at_once_and_silence_says_nothing_of_it() -> None:
    watch = PedalFilter(CONFIG)
    assert watch.update(PedalLine(7, True, False, True), 1.0, late=True).estop is True
    assert watch.update(None, 1.02).estop is None
    assert watch.silence(1.2).estop is None
    assert watch.update(PedalLine(9, True, False), 1.22).estop is False


# --- the driver ------------------------------------------------------------------------------------------------------------------


class PedalListener(Listener[PedalReport]):
    """Keeps what the pedal's thread says."""

    def __init__(self) -> None:
        super().__init__()
        self.problems: list[PedalError | None] = []

    def problem(self, problem: PedalError | None) -> None:
        self.add(self.problems, problem)

    @property
    def deadman(self) -> bool:
        return bool(self.states) and self.states[-1].deadman

    def since(self, action: Callable[[], object], what: Callable[[list[PedalReport]], bool]) -> list[PedalReport]:
        """Do something; the reports from then until they are as wanted."""
        start = len(self.states)
        action()
        self.until(lambda: what(self.states[start:]))
        return self.states[start:]

    def hears(self, count: int) -> list[PedalReport]:
        return self.since(lambda: None, lambda reports: len(reports) >= count)


@pytest.fixture
def soft() -> Iterator[SoftPedal]:
    with SoftPedal() as soft:
        yield soft


@pytest.fixture
def listener() -> PedalListener:
    return PedalListener()


@pytest.fixture
def pedal(soft: SoftPedal, listener: PedalListener) -> Iterator[Pedal]:
    pedal = Pedal(PedalConfig(port=soft.port, reconnect_s=0.05), listener.state, listener.problem)
    pedal.start()
    listener.until(lambda: listener.problems == [None])
    yield pedal
    pedal.close()


def _pressed(reports: list[PedalReport]) -> bool:
    return bool(reports) and reports[-1].deadman


def _released(reports: list[PedalReport]) -> bool:
    return bool(reports) and not reports[-1].deadman


@pytest.fixture
def held(soft: SoftPedal, listener: PedalListener, pedal: Pedal) -> Pedal:
    listener.hears(3)
    listener.since(soft.press, _pressed)
    return pedal


@pytest.mark.real_time
def test_it_says_released_first_and_then_follows_the_foot(soft: SoftPedal, listener: PedalListener, pedal: Pedal) -> None:
    assert listener.states[0] == PedalReport(None, False, listener.states[0].time_s)
    assert pedal.problem is None
    listener.hears(3)
    began_s = time.monotonic()
    for _ in range(3):
        listener.since(soft.press, _pressed)
        listener.since(soft.release, _released)
    times = [report.time_s for report in listener.states]
    assert times == sorted(times)
    assert began_s <= times[-1] <= time.monotonic()


@pytest.mark.real_time
def test_an_e_stop_is_told_while_it_is_pressed(soft: SoftPedal, listener: PedalListener, pedal: Pedal) -> None:
    reports = listener.since(soft.press_estop, lambda reports: bool(reports) and reports[-1].estop is True)
    assert not any(report.stop for report in reports)
    listener.since(soft.release_estop, lambda reports: bool(reports) and reports[-1].estop is False)


@pytest.mark.real_time
def test_a_short_stop_is_not_missed_and_a_broken_wire_is_one(soft: SoftPedal, listener: PedalListener, pedal: Pedal) -> None:
    def tap() -> None:
        soft.press_stop()
        soft.release_stop()

    reports = listener.since(tap, lambda reports: any(r.stop for r in reports) and not reports[-1].stop)
    assert sum(report.stop for report in reports) == 5
    assert all(report.stop for report in listener.since(soft.break_stop_wire, lambda reports: len(reports) > 8)[-6:])


@pytest.mark.real_time
def test_a_pedal_that_hangs_is_a_released_deadman_and_no_stop(soft: SoftPedal, listener: PedalListener, held: Pedal) -> None:
    reports = listener.since(soft.mute, _released)
    last_held = next(report for report in reversed(listener.states) if report.deadman)
    assert reports[-1].time_s - last_held.time_s >= 0.06
    silent = listener.hears(3)
    assert not any(report.deadman or report.stop for report in silent)
    listener.until(lambda: isinstance(held.problem, PedalUnheard))
    assert "silent" in str(held.problem)
    # it talks again with the foot still down, after more than half a second
    again = listener.since(lambda: soft.mute(False), lambda reports: len(reports) > 10)
    assert {report.deadman for report in again} == {None}
    assert held.problem is None
    listener.since(soft.release, lambda reports: len(reports) > 2)
    listener.since(soft.press, _pressed)


@pytest.mark.real_time
@pytest.mark.parametrize("fault", ["damage", "garbage"])
def test_damage_releases_the_deadman_at_once_and_stops_nothing(
    soft: SoftPedal, listener: PedalListener, held: Pedal, fault: str
) -> None:
    reports = listener.since(lambda: getattr(soft, fault)(3), _released)
    assert not any(report.stop for report in reports)
    listener.until(lambda: listener.deadman)


@pytest.mark.real_time
def test_a_number_that_stands_still_is_a_released_deadman(soft: SoftPedal, listener: PedalListener, held: Pedal) -> None:
    listener.since(soft.stick, _released)
    assert not any(report.deadman for report in listener.hears(10))


@pytest.mark.real_time
def test_a_pulled_plug_is_a_released_deadman_and_the_foot_must_be_lifted_after_it(
    soft: SoftPedal, listener: PedalListener, held: Pedal
) -> None:
    reports = listener.since(soft.vanish, _released)
    assert not any(report.stop for report in reports)
    listener.until(lambda: isinstance(held.problem, PedalPortError))  # tried again
    lost = next(problem for problem in listener.problems if problem is not None)
    assert isinstance(lost, PedalLost)
    assert "plug its USB cable in" in str(lost)
    back = listener.since(soft.reappear, lambda reports: len(reports) > 10)
    assert {report.deadman for report in (*reports, *back)} == {None}
    assert held.problem is None
    listener.since(soft.release, lambda reports: len(reports) > 2)
    listener.since(soft.press, _pressed)


@pytest.mark.real_time
def test_a_pedal_that_is_down_when_the_program_starts_does_not_count(soft: SoftPedal, listener: PedalListener) -> None:
    soft.press()
    pedal = Pedal(PedalConfig(port=soft.port), listener.state)
    pedal.start()
    try:
        assert not any(report.deadman for report in listener.hears(10))
        listener.since(soft.release, lambda reports: len(reports) > 3)
        listener.since(soft.press, _pressed)
    finally:
        pedal.close()


@pytest.mark.real_time
def test_what_waited_while_the_program_stood_still_is_no_press_but_a_stop(soft: SoftPedal) -> None:
    listener, stand = PedalListener(), threading.Event()
    reached, go_on = threading.Event(), threading.Event()

    def report(report: PedalReport) -> None:
        listener.state(report)
        if stand.is_set():
            stand.clear()
            reached.set()
            go_on.wait(5.0)

    pedal = Pedal(PedalConfig(port=soft.port), report)
    pedal.start()
    try:
        listener.hears(4)
        listener.since(soft.press, _pressed)
        stand.set()
        assert reached.wait(5.0)
        start = len(listener.states)
        soft.press_stop()
        soft.release_stop()
        time.sleep(0.25)  # the stop is told, and is over, all while nobody reads
        go_on.set()
        listener.until(lambda: len(listener.states) > start + 20)
        waited = [r for r in listener.states[start:] if r.time_s == listener.states[start].time_s]
        assert len(waited) >= 10
        assert sum(report.stop for report in waited) == 5
        assert not any(report.deadman for report in waited)
        listener.until(lambda: listener.deadman)  # the break was short
    finally:
        go_on.set()
        pedal.close()


@pytest.mark.real_time
def test_closed_it_is_released_and_the_port_is_free(soft: SoftPedal, listener: PedalListener, held: Pedal) -> None:
    with pytest.raises(PedalPortTaken, match=r"in use by another program.*close it there"):
        open_pedal_port(PedalConfig(port=soft.port))
    assert listener.deadman
    held.close()
    held.close()
    assert not listener.deadman
    open_pedal_port(PedalConfig(port=soft.port)).close()
    count = len(listener.states)
    held.start()
    listener.until(lambda: len(listener.states) > count + 5)


@pytest.mark.real_time
def test_a_port_that_talks_of_other_things(soft: SoftPedal, listener: PedalListener, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hardware.inputs.pedal._START_UP_S", 0.1)
    soft.damage(10_000)
    pedal = Pedal(PedalConfig(port=soft.port), listener.state, listener.problem)
    assert isinstance(pedal.problem, PedalUnheard)
    pedal.start()
    listener.until(lambda: bool(listener.problems))
    pedal.close()
    assert "no pedal's report: check pedal.baud" in str(listener.problems[0])
    assert not any(report.deadman or report.stop for report in listener.states)


def test_a_listener_that_fails_is_seen(soft: SoftPedal, listener: PedalListener, caplog: pytest.LogCaptureFixture) -> None:
    def fail(_: PedalReport) -> None:
        raise ZeroDivisionError("not today")

    pedal = Pedal(PedalConfig(port=soft.port), fail, listener.problem)
    pedal.start()
    listener.until(lambda: bool(listener.problems))
    pedal.close()
    assert str(pedal.problem) == "the pedal is no longer read (ZeroDivisionError: not today): start the program again"
    open_pedal_port(PedalConfig(port=soft.port)).close()  # it has been given back


# --- ports that cannot be opened -------------------------------------------------------------------------------------------------


def test_a_missing_port() -> None:
    with pytest.raises(PedalPortError, match="does not exist: plug the pedal in") as caught:
        open_pedal_port(PedalConfig(port="/nowhere/ttyACM0"))
    assert isinstance(caught.value, DeviceError)
    assert "\n" not in str(caught.value)


def test_no_port_is_configured(listener: PedalListener) -> None:
    with pytest.raises(PedalPortError, match=r"set pedal\.port"):
        Pedal(PedalConfig(), listener.state)
    with pytest.raises(PedalPortError, match=r"set pedal\.port"):
        open_pedal_port(PedalConfig())


@pytest.mark.parametrize(
    ("code", "kind", "words"),
    [
        (13, PedalPortError, "group dialout"),
        (16, PedalPortTaken, "in use by another program"),
        (19, PedalPortError, "no device behind it"),
        (22, PedalPortError, "set pedal.port and pedal.baud"),
    ],
)
def test_other_reasons_not_to_open(monkeypatch: pytest.MonkeyPatch, code: int, kind: type[PedalPortError], words: str) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(code, "could not open\nport")

    monkeypatch.setattr(serial, "Serial", refuse)
    with pytest.raises(kind, match=words) as caught:
        open_pedal_port(CONFIG)
    assert "\n" not in str(caught.value)


def test_a_file_is_no_port(tmp_path: Path) -> None:
    (tmp_path / "port").write_text("")
    with pytest.raises(PedalPortError, match="cannot be used as pedal port at 115200 baud"):
        open_pedal_port(PedalConfig(port=str(tmp_path / "port")))


@pytest.mark.parametrize(
    "text",
    ["silence_s = 0.5", "silence_s = nan", "press_reports = 1", "resume_s = 2", "resume_s = 0.05", "port = ''", "prot = 'x'"],
)
def test_the_configuration_cannot_be_loosened_nor_tightened_until_no_press_counts(tmp_path: Path, text: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(f"[pedal]\n{text}\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=rf"pedal\.{text.partition(' ')[0]}"):
        load_config(path)


# --- the firmware ----------------------------------------------------------------------------------------------------------------

_BOARD = r"""
#include <cstdio>
#include <algorithm>
using byte = unsigned char;
using std::min;
enum { LOW, HIGH, INPUT_PULLUP };
unsigned long clock_ms = 0;
unsigned long millis() { return clock_ms; }
void delay(int ms) { clock_ms += ms; }
void pinMode(int, int) {}
bool within(unsigned long from, unsigned long to) { return clock_ms >= from && clock_ms < to; }
int digitalRead(int pin) {
  if (pin == 2) return within(200, 401) || within(600, 605) ? LOW : HIGH;  // the foot, and a touch of 5 ms
  return within(700, 704) || within(900, 902) ? HIGH : LOW;                // a tap on STOP, and a spark
}
struct { void begin(long) {} void write(const byte *line, int count) { fwrite(line, 1, count, stdout); } } Serial;
"""
_RUN = "int main() { setup(); while (clock_ms < 1300) loop(); }\n"


@pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler")
def test_the_firmware_speaks_the_protocol(tmp_path: Path) -> None:
    sketch = (ROOT / "resources" / "pedal" / "pedal.ino").read_text(encoding="utf-8")
    (tmp_path / "board.cpp").write_text(_BOARD + sketch + _RUN, encoding="utf-8")
    subprocess.run(["g++", "-Wall", "-Wextra", "-Werror", "-o", tmp_path / "board", tmp_path / "board.cpp"], check=True)
    stream = subprocess.run([tmp_path / "board"], check=True, capture_output=True).stdout
    lines = PedalParser().feed(stream)
    assert [line.number for line in lines if line is not None] == [number % 32 for number in range(64)]
    down = [at for at, line in enumerate(lines) if line is not None and line.down]
    assert down == list(range(down[0], down[0] + 10))  # 200 ms, of which the first 10 do not count
    assert 20 * (down[0] + 1) >= 210 > 20 * down[0]
    stop = [at for at, line in enumerate(lines) if line is not None and line.stop]
    assert stop == list(range(stop[0], stop[0] + 5))
    assert 20 * (stop[0] + 1) >= 703 > 20 * stop[0]
