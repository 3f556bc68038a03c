"""``python -m tools.benchmarks window|recording|stream|follow``: pace of windows, costs, drift of followed lines."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import psutil
import typer
from PySide6.QtCore import QObject, QTimer

from app.commands.benchmark import print_figures, quantiles, stream_config, use_offscreen
from app.commands.options import ConfigOption, JsonOption, ModelOption, PresetOption
from app.commands.progress import progress_bar
from app.operator.manual_drive import REPEAT_MS
from app.operator.rig_engine import EngineMaker, RigEngine, leaving_a_core
from app.operator.startup import finish_loading, make_window
from app.operator.window import OperatorWindow
from app.ui.texts import OperatorStep
from app.ui.window_base import make_application, quit_on_signal
from core import geometry
from core.annotation.follow import followed_lines
from core.annotation.model import Annotation
from core.config.models import PerceptionConfig, PursuitConfig, TwinConfig, choose_model, load_config
from core.control.drive_view import DriveView
from core.control.look_ahead import look_ahead
from core.control.modes import DRIVING_MODES, Mode
from core.control.motion import AT_REST, Jog
from core.evaluation.metrics import MIN_GROUPS, RESAMPLES
from core.perception.centerline import plan_route
from core.perception.pipeline import Pipeline, open_pipeline
from core.perception.vectors import fit_robot_vector
from core.session.live_output import FoxgloveServer, LiveOutput
from core.session.manifest import about_rig
from core.session.writer import SessionWriter
from core.types import Frame, Image, Point, Scene, Tick
from hardware.rig import rig_config
from hardware.twin.phantoms import make_phantom
from hardware.twin.rendering.appearance import named_appearance
from hardware.twin.truth import RouteFollower
from hardware.twin.world import TwinWorld
from tools.run import run_tool

FRAMES_PER_SECOND = 30.0
_BLOCK = 30  # frames with and without a recording in turn: a second, so that a busy moment of the computer affects both alike
_WARM_UP = 10  # frames
_STEPS = 24  # pictures of the stream, one way
_DRAWN_PX = 60.0  # length of the robot's line that is followed


def recording(
    frames: Annotated[int, typer.Option(min=3, max=10_000, help="of each kind; rounded up to whole seconds")] = 120,
    json: JsonOption = False,
    model: ModelOption = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
) -> None:
    """How much a recording slows perception of 640x480 pictures down: a second without and a second with one, in turn.

    The recorder encodes and writes to the system's temporary folder beside perception, and the network leaves a core to the rest of
    the program, as in the window. The slowdown is the ratio of the medians, with a 95 % interval over the seconds.
    """
    settings = stream_config(load_config(config, preset, choose_model(model)))
    pipeline = open_pipeline(leaving_a_core(settings.perception))
    images = _stream_images()
    record = settings.record.model_copy(update={"ring_s": 0.0, "stop_free_mb": 0.0})
    blocks = -(-frames // _BLOCK)
    without: list[list[float]] = []
    recorded: list[list[float]] = []
    with tempfile.TemporaryDirectory(prefix="lumenpilot_benchmark_") as folder, progress_bar() as bar:
        writer = SessionWriter(record, about_rig(settings, "SIM", "benchmark"), folder=Path(folder))
        task = bar.add_task("frames", total=2 * blocks * _BLOCK)
        try:
            writer.start()
            _stream(pipeline, images, _WARM_UP, 0, writer)
            for block in range(blocks):
                # the order alternates, so that warming up or cooling down favours neither
                for is_recorded in (False, True) if block % 2 else (True, False):
                    first = _WARM_UP + (2 * block + is_recorded) * _BLOCK
                    times = _stream(pipeline, images, _BLOCK, first, writer if is_recorded else None)
                    (recorded if is_recorded else without).append(times)
                    bar.advance(task, _BLOCK)
        finally:
            is_whole = writer.close()
        status = writer.status()
    minutes = max(status.frames, 1) / FRAMES_PER_SECOND / 60.0
    figures = {
        "without_ms": quantiles([ms for block in without for ms in block]),
        "with_ms": quantiles([ms for block in recorded for ms in block]),
        **_slowdown(without, recorded),
        "frames": blocks * _BLOCK,
        "recorded": status.frames,
        "dropped": status.dropped,
        "mb_per_minute": round(status.bytes / 1e6 / minutes, 1),
        "problem": status.problem or (None if is_whole else "the disk does not answer"),
        "engine": pipeline.engine,
        "cores": os.cpu_count(),
    }
    print_figures(figures, json, "recording")


def _stream_images() -> list[Image]:
    """A robot that goes in and comes back: unrelated pictures would need more disk space than a stream."""
    world = TwinWorld(TwinConfig(), seed=0)
    images: list[Image] = []
    for step in range(_STEPS):
        world.insert(50.0 + 1.5 * step)
        images.append(world.frame().image)
    return images + images[-2:0:-1]


def _stream(pipeline: Pipeline, images: Sequence[Image], count: int, first: int, writer: SessionWriter | None) -> list[float]:
    """Perceive `count` frames at the camera's pace; milliseconds of each."""
    times: list[float] = []
    began_s = time.monotonic()
    for place in range(count):
        time.sleep(max(0.0, began_s + place / FRAMES_PER_SECOND - time.monotonic()))
        frame = Frame(first + place, time.monotonic(), images[place % len(images)])
        before_s = time.perf_counter()
        scene = pipeline.perceive_single(frame)
        times.append(1e3 * (time.perf_counter() - before_s))
        if writer is not None:
            writer.put(Tick(frame, scene, None, None, None, 0, FRAMES_PER_SECOND))
    return times


def _slowdown(without: list[list[float]], recorded: list[list[float]]) -> dict[str, Any]:
    """Ratio of the medians with a percentile bootstrap over pairs of blocks; no interval if there are too few."""
    plain, beside = np.array(without), np.array(recorded)
    ratio = float(np.median(beside) / np.median(plain))
    if len(plain) < MIN_GROUPS:
        return {"slowdown": round(ratio, 3), "slowdown_ci95": None}
    rng = np.random.default_rng(0)
    draws = rng.integers(0, len(plain), (RESAMPLES, len(plain)))
    ratios = np.median(beside[draws].reshape(RESAMPLES, -1), axis=1) / np.median(plain[draws].reshape(RESAMPLES, -1), axis=1)
    low, high = np.percentile(ratios, (2.5, 97.5))
    return {"slowdown": round(ratio, 3), "slowdown_ci95": [round(float(low), 3), round(float(high), 3)]}


_STREAM_FRAMES = 120  # with and without a client in turn
_DRAIN = """
import base64, json, socket, struct, sys
client = socket.create_connection(("127.0.0.1", int(sys.argv[1])))
client.sendall(("GET / HTTP/1.1\\r\\nHost: x\\r\\nUpgrade: websocket\\r\\nConnection: Upgrade\\r\\nSec-WebSocket-Key: "
    + base64.b64encode(bytes(16)).decode()
    + "\\r\\nSec-WebSocket-Version: 13\\r\\nSec-WebSocket-Protocol: foxglove.sdk.v1\\r\\n\\r\\n").encode())
read = client.makefile("rb")
while read.readline() != b"\\r\\n":
    pass
told = {}
while told.get("op") != "advertise":
    size = read.read(2)[1]
    size = int.from_bytes(read.read({126: 2, 127: 8}[size]), "big") if size > 125 else size
    told = json.loads(read.read(size))
wanted = [{"id": channel["id"], "channelId": channel["id"]} for channel in told["channels"]]
text = json.dumps({"op": "subscribe", "subscriptions": wanted}).encode()
client.sendall(struct.pack("!BBH4x", 0x81, 0xFE, len(text)) + text)
while client.recv(1 << 20):
    pass
"""
"""A client that subscribes to all and drops what it gets: what is measured is the program, not the client."""


def stream(
    blocks: Annotated[int, typer.Option(min=1, max=200, help="of 120 frames, of each kind")] = 6,
    json: JsonOption = False,
    model: ModelOption = None,
    config: ConfigOption = None,
) -> None:
    """How much the live stream slows the twin's rig down: blocks with one client that takes all and without, in turn.

    Of perceiving a frame, and of the time from one turn of the pilot to the next; the slowdown is the ratio of the medians, with a
    95 % interval over the blocks.
    """
    settings = load_config(config, None, choose_model(model))
    twin = settings.twin.model_copy(update={"live_frames_per_second": FRAMES_PER_SECOND})
    engine = EngineMaker()(settings.model_copy(update={"twin": twin}))
    output = LiveOutput(partial(FoxgloveServer, 0))
    frames: dict[bool, list[list[float]]] = {False: [], True: []}
    turns: dict[bool, list[list[float]]] = {False: [], True: []}
    streamed_s = 0.0
    try:
        output.wait_open()
        port, pilot = output.address.rpartition(":")[2], engine.pilot
        assert pilot is not None
        times, tick = [time.monotonic()], pilot.tick

        def timed() -> DriveView:
            times.append(time.monotonic())
            return tick()

        pilot.tick = timed  # type: ignore[method-assign]
        _step(engine, _WARM_UP, None)
        with progress_bar() as bar:
            task = bar.add_task("blocks", total=2 * blocks)
            for block in range(2 * blocks):
                is_streamed = block % 4 in (1, 2)  # neither kind is always first
                client = subprocess.Popen([sys.executable, "-c", _DRAIN, port]) if is_streamed else None
                _step(engine, _WARM_UP, output if is_streamed else None)
                first, began_s = len(times), time.monotonic()
                frames[is_streamed].append(_step(engine, _STREAM_FRAMES, output if is_streamed else None))
                turns[is_streamed].append((1e3 * np.diff(times[first:])).tolist())
                if client is not None:
                    streamed_s += time.monotonic() - began_s
                    client.terminate()
                    client.wait()
                bar.advance(task)
    finally:
        output.close()
        engine.close()
    count = min(len(block) for kind in turns.values() for block in kind)
    cut = {kind: [block[:count] for block in found] for kind, found in turns.items()}
    figures = {
        name: {
            "without_ms": quantiles([ms for block in found[False] for ms in block]),
            "with_ms": quantiles([ms for block in found[True] for ms in block]),
            **_slowdown(found[False], found[True]),
        }
        for name, found in (("frame", frames), ("control", cut))
    } | {"frames_per_second": round(blocks * _STREAM_FRAMES / streamed_s, 1), "blocks": blocks, "cores": os.cpu_count()}
    print_figures(figures, json, "stream")


def _step(engine: RigEngine, count: int, output: LiveOutput | None) -> list[float]:
    """Perceive `count` frames; milliseconds of each."""
    times: list[float] = []
    while len(times) < count:
        tick, pilot = engine.step(0.1), engine.pilot
        assert pilot is not None
        pilot.window_alive()
        if tick is not None:
            times.append(tick.scene.latency_ms["total"])
            if output is not None:
                output.put(tick, pilot.view, engine.bus_status())
    return times


_MOVE_S = 1.5
_MOVES = (Jog(bend=0.4, advance=0.8), Jog(bend=-0.6, advance=0.6), Jog(bend=0.2, advance=-1.0), AT_REST)
_ASK_EVERY_S = 0.5
_REPEAT_S = REPEAT_MS / 1000.0
_MIN_ROUTE_PX = 60.0
_PURSUIT = PursuitConfig()


class ScriptedOperator(QObject):
    """Drives by hand for the first `by_hand_s` seconds after ``start``, then lets the program drive whenever possible.

    ``driven_s`` is how long the program drove. Servos that were switched off stay so.
    """

    def __init__(self, window: OperatorWindow, by_hand_s: float) -> None:
        super().__init__(window)
        self._window, self._by_hand_s = window, by_hand_s
        self._since_s = self._asked_s = 0.0
        self.driven_s = 0.0
        self._timer = QTimer(self)
        self._timer.setInterval(REPEAT_MS)
        self._timer.timeout.connect(self._act)

    def start(self) -> None:
        self._timer.start()

    def stop(self) -> None:
        self._timer.stop()
        self._window.controls.deadman.hold("mouse", False)

    def _act(self) -> None:
        self._since_s += _REPEAT_S
        if self._since_s < self._by_hand_s:
            # repeated, as by a held key: silence counts as released
            self._window.controls.drive(_MOVES[int(self._since_s / _MOVE_S) % len(_MOVES)])
            return
        view = self._window.controls.view
        if view is not None and view.mode in DRIVING_MODES:
            self.driven_s += _REPEAT_S * (view.mode is Mode.AUTONOMOUS)
        self._asked_s += _REPEAT_S
        if view is not None and self._asked_s >= _ASK_EVERY_S:
            self._asked_s = 0.0
            self._ask(view.mode, view.latched is not None)

    def _ask(self, mode: Mode, latched: bool) -> None:
        controls, tick = self._window.controls, self._window.shown_tick
        if latched:
            controls.ask_step(OperatorStep.ACKNOWLEDGE)
        elif mode is Mode.ADVISORY:
            controls.deadman.hold("mouse", False)
            controls.ask_step(OperatorStep.ARM)
        elif mode in {Mode.ARMED, Mode.HOLD}:
            if tick is not None and mode is Mode.ARMED and (target := _farthest_end(tick.scene)) is not None:
                self._window.choose_target(*target)
            controls.deadman.hold("mouse", True)
            controls.ask_step(OperatorStep.HAND_OVER)


def _farthest_end(scene: Scene) -> Point | None:
    """The end of the vessel with the longest route that begins ahead of the head, in source pixels; None when no route is long."""
    if scene.path is None or scene.vessel_graph is None:
        return None
    graph, head = scene.vessel_graph, scene.path.head
    degrees = Counter(node for edge in graph.edges for node in (edge.start, edge.end))
    ends = [graph.nodes[node].tolist() for node, degree in degrees.items() if degree == 1]
    routes = [(route, end) for end in ends if (route := plan_route(graph, head, (end[0], end[1]))) is not None]
    # This runs in the window's thread, where each look-ahead costs time: the longest route first is mostly the only one.
    for route, (x, y) in sorted(routes, key=lambda found: -found[0].length_px):
        if route.length_px <= _MIN_ROUTE_PX:
            break
        ahead = look_ahead(replace(scene, route=route), _PURSUIT.look_ahead_px, _PURSUIT)
        if ahead is not None and not ahead.behind:
            return scene.to_source((x, y))
    return None


_WARM_UP_S = 10.0
_FIRST_WITHIN_S = 60.0  # patience with a rig that shows nothing
_POLL_MS = 5


class WindowWatch(QObject):
    """Samples pace and memory from the first picture on for `seconds`, then closes the window.

    Half of that time the robot is driven by hand, then by the program.
    """

    def __init__(self, window: OperatorWindow, seconds: float) -> None:
        super().__init__(window)
        self._window = window
        self._seconds = seconds
        self._ended_s = time.monotonic() + _FIRST_WITHIN_S
        self.ended_early = False
        self._process = psutil.Process()
        self.shown = 0
        self.last_index = -1
        self.first_shown_s: float | None = None
        self.dropped = 0
        self.blocks: list[tuple[float, float, str]] = []
        self.bus_p99_ms: float | None = None
        self.latency_ms: list[float] = []
        self.servo_ms: list[float] = []
        self.memory_mb: list[tuple[float, float]] = []
        self._operator = ScriptedOperator(window, seconds / 2.0)
        self._timers: list[QTimer] = []
        for interval_ms, slot in ((_POLL_MS, self._sample_window), (1000, self._sample_process)):
            timer = QTimer(self)
            timer.timeout.connect(slot)
            timer.start(interval_ms)
            self._timers.append(timer)

    def _sample_window(self) -> None:
        tick, now = self._window.shown_tick, time.monotonic()
        if tick is not None and tick.frame.index != self.last_index:
            self.last_index = tick.frame.index
            self.shown += 1
            self.dropped = tick.dropped_frames
            self.latency_ms.append((now - tick.frame.captured_s) * 1e3)
            if self.first_shown_s is None:
                self.first_shown_s = now
                self._ended_s = now + self._seconds
                self._sample_process()
                self._operator.start()
        view, servo_ms = self._window.controls.view, self.servo_ms
        if view is not None and view.latency_s is not None and servo_ms[-1:] != [view.latency_s * 1e3]:
            servo_ms.append(view.latency_s * 1e3)
        if now >= self._ended_s:
            for timer in self._timers:
                timer.stop()
            self._operator.stop()
            self._window.close()

    def _sample_process(self) -> None:
        """Once a second. The heartbeat keeps a block for ten seconds, so one longer than any before is new."""
        if self.first_shown_s is None:
            return
        at_s = time.monotonic() - self.first_shown_s
        view, bus, block_ms = self._window.controls.view, self._window.controls.bus, self._window.max_block_ms
        if block_ms > max((ms for _, ms, _ in self.blocks), default=0.0):
            self.blocks.append((at_s, block_ms, view.mode.value if view is not None else ""))
        if bus is not None and at_s >= _WARM_UP_S:
            self.bus_p99_ms = max(self.bus_p99_ms or 0.0, bus.times.period_p99_ms)
        self.memory_mb.append((at_s, self._process.memory_info().rss / 2**20))

    def end(self) -> None:
        """The window was closed, perhaps before its time."""
        now = time.monotonic()
        self.ended_early, self._ended_s = now < self._ended_s, min(now, self._ended_s)

    def result(self) -> dict[str, Any]:
        """Pace since the first shown frame; memory 10 s after it, at the end, and its growth per minute in between.

        The bus cycle is the worst 99th percentile of ten seconds after these. The blocks, from 10 s before the first frame on, are
        those that were the longest so far.
        """
        if self.first_shown_s is None:
            return {"shown_fps": 0.0}
        lasted_s = max(self._ended_s - self.first_shown_s, 1e-9)
        steady = [(at, mb) for at, mb in self.memory_mb if at >= _WARM_UP_S] or self.memory_mb[-1:]
        span_min = max((steady[-1][0] - steady[0][0]) / 60.0, 1e-9)
        return {
            "seconds": round(lasted_s, 1),
            "shown_fps": round(self.shown / lasted_s, 2),
            "frames_dropped": self.dropped,
            "capture_to_screen_ms": quantiles(self.latency_ms),
            "capture_to_servo_ms": quantiles(self.servo_ms) if self.servo_ms else None,
            "driven_by_program_s": round(self._operator.driven_s, 1),
            "bus_cycle_p99_ms": round(self.bus_p99_ms, 1) if self.bus_p99_ms is not None else None,
            "gui_max_block_ms": round(self.blocks[-1][1], 1) if self.blocks else 0.0,
            "gui_longer_blocks": [{"at_s": round(at_s, 1), "ms": round(ms, 1), "mode": mode} for at_s, ms, mode in self.blocks],
            "memory_mb": {"after_10_s": round(steady[0][1], 1), "end": round(steady[-1][1], 1)},
            "memory_growth_mb_per_min": round((steady[-1][1] - steady[0][1]) / span_min, 2) if len(steady) > 1 else None,
        }


def window(
    seconds: Annotated[float, typer.Argument(min=5.0, max=3600.0, help="from the first picture on")],
    json: JsonOption = False,
    config: ConfigOption = None,
) -> None:
    """Run the operator window on the twin and measure its pace (offscreen when there is no display)."""
    use_offscreen(os.environ)
    settings, kind = rig_config("twin", config, None)
    application = make_application()
    finish_loading()
    shown = make_window(settings, kind)
    application.aboutToQuit.connect(shown.shut_down)
    shown.show()
    shown.start()
    watch = WindowWatch(shown, seconds)
    signals = quit_on_signal(application)
    application.exec()
    signals.stop()
    watch.end()
    if watch.first_shown_s is None:
        sys.stderr.write("note: no picture was shown; start the window (python main.py) to see why\n")
    elif watch.ended_early:
        sys.stderr.write(f"note: closed before its {seconds:g} s; the figures are of the time until then\n")
    print_figures(watch.result(), json, "window")


_AFTER = (10, 30, 60)  # pictures after the drawn one


def follow(
    clips: Annotated[int, typer.Option(min=1, max=200, help="of the twin, two seconds each")] = 8,
    json: JsonOption = False,
) -> None:
    """How far lines that are followed through a clip are off (Ctrl+F in the annotator), in direction and at the head."""
    vectors = PerceptionConfig().vectors
    degrees: dict[int, list[float]] = {count: [] for count in _AFTER}
    heads_px: dict[int, list[float]] = {count: [] for count in _AFTER}
    for seed in range(1, 2 * clips, 2):
        images, truths = _clip(seed, max(_AFTER) + 1)
        path = truths[0].robot_path
        length = float(geometry.arc_length(path)[-1])
        drawn = Annotation(tuple(map(tuple, geometry.cut(path, length - _DRAWN_PX, length).tolist())))
        for place, robot, _ in followed_lines(images.__getitem__, {0: drawn}, len(images)):
            vector = fit_robot_vector(np.array(robot), vectors.robot_length_px, vectors.line_fit)
            if place in _AFTER and vector is not None:
                cosine = float(np.dot(vector.direction, truths[place].robot_vector.direction))
                degrees[place].append(math.degrees(math.acos(min(1.0, cosine))))
                heads_px[place].append(math.dist(robot[-1], truths[place].robot_path[-1]))
    found = {
        f"after {count} pictures": {"direction_deg": quantiles(degrees[count]), "head_px": quantiles(heads_px[count])}
        for count in _AFTER
    }
    print_figures(found, json, "follow")


def _clip(seed: int, count: int) -> tuple[list[Image], list[Any]]:
    """Pictures of a robot that is driven along a random phantom, a thirtieth of a second apart, and the truth about them."""
    phantom = make_phantom(f"random:{seed}")
    world = TwinWorld(TwinConfig(), phantom=phantom, appearance=named_appearance(None, seed), seed=seed)
    follower = RouteFollower(phantom, phantom.targets[0])
    world.insert(45.0, target=phantom.targets[0])
    images, truths = [], []
    for _ in range(count):
        world.send(follower.command(world.physics.robot_points_mm(), 4.0, 1 / FRAMES_PER_SECOND))
        world.advance(1 / FRAMES_PER_SECOND)
        images.append(world.frame().image)
        truths.append(world.truth())
    return images, truths


if __name__ == "__main__":
    run_tool(window, recording, stream, follow)
