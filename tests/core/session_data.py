"""Small sessions for the tests: ticks that are quick to make and different from one another."""

import json
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from core.config.models import RecordConfig
from core.control.drive_view import DriveView
from core.control.faults import Cause, Fault
from core.control.gate import Source
from core.control.modes import Hindrance, Mode
from core.session.manifest import About, Event
from core.session.writer import SessionWriter
from core.types import (
    Advice,
    Centerline,
    Command,
    Frame,
    GraphEdge,
    Image,
    Masks,
    Pose,
    PoseState,
    Reason,
    Refusal,
    RobotPath,
    RobotStatus,
    Route,
    Scene,
    Skeletons,
    Speed,
    Tick,
    Vector,
    VesselGraph,
)

SIZE = (96, 64)
ABOUT = About("SIM", "twin", {"rig": {"name": "twin"}}, {"name": "default", "sha256": "0" * 64}, {"mm_per_px": 0.25})
QUICK = RecordConfig(ring_s=0.0, sync_s=0.0, stop_free_mb=0.0, warn_free_mb=0.0, warn_free_share=0.0, max_queue=1000)


def picture(index: int, size: tuple[int, int] = SIZE) -> Image:
    """A picture that tells its number: a bright column that wanders, and the number's bits as blocks in the last rows."""
    image = np.full((size[1], size[0], 3), 40, np.uint8)
    image[:-16, (3 * index) % size[0]] = (220, 200, 90)
    for bit in range(12):
        image[-16:, 8 * bit : 8 * bit + 8] = 230 if index >> bit & 1 else 10
    return image


def number_in(image: Image) -> int:
    """The number in a picture, also after lossy coding."""
    return sum(int(image[-9, 8 * bit + 4, 1] > 128) << bit for bit in range(12))


def full_scene(index: int, captured_s: float) -> Scene:
    vessel = np.zeros((SIZE[1], SIZE[0]), bool)
    vessel[20:44, :] = True
    vessel[28:34, 60:70] = False
    robot = np.zeros_like(vessel)
    robot[30:34, : 20 + index % 30] = True
    line = np.column_stack([np.arange(0.0, 50.0), 32.0 + np.sin(np.arange(50.0) / 8.0)])
    graph = VesselGraph(np.array([[0.0, 32.0], [95.0, 32.0]]), (GraphEdge(0, 1, line, np.full(50, 12.0)),))
    return Scene(
        index,
        captured_s,
        SIZE,
        1.0,
        masks=Masks(vessel, robot, vessel.astype(np.float32), robot.astype(np.float32)),
        skeletons=Skeletons(vessel, robot, (((1.0, 2.0), (3.0, 4.5)),)),
        path=RobotPath(line, 0.75, 0.5, True, 3.25, 2.5),
        vessel_graph=graph,
        route=Route(line[10:], 39.5, (90.0, 32.0)),
        centerline=Centerline(line[5:25], (15.0, 33.0), 12.0, 0.125),
        robot_vector=Vector((0.0, 30.0), (10.0, 31.0), (20.0, 32.0)),
        vessel_vector=Vector((0.0, 32.0), (20.0, 32.0), (40.0, 32.0)),
        pose=Pose(5.5, -5.5, 1.25, -2.5, True, PoseState.D, 0.875),
        latency_ms={"network": 12.5, "total": 20.25},
        scale_xy=(1.0, 1.0),
    )


def tick_of(index: int, captured_s: float, *, size: tuple[int, int] = SIZE, full: bool = False) -> Tick:
    """A tick with a refusal, or with all that a scene can have."""
    plain = Scene(index, captured_s, size, 1.0, refusal=Refusal(Reason.NO_ROBOT, "0 px"), latency_ms={"total": 3.0})
    scene = full_scene(index, captured_s) if full else plain
    advice = Advice(Speed.MODERATE, 5.0, 5.5, "turn right") if full else None
    status = RobotStatus(captured_s, 12.5, 0.5, (0.1, 0.2, 0.3, 0.4), (1.0, 2.0, 3.0, 4.0), 0.001)
    return Tick(Frame(index, captured_s, picture(index, size)), scene, advice, Command(bend=0.5), status, 0, 30.0)


def drive_of(time_s: float, mode: Mode = Mode.ARMED) -> DriveView:
    return DriveView(
        time_s=time_s,
        mode=mode,
        permitted=Source.OPERATOR,
        latched=Fault(Cause.HEAD_JUMP, "30 px"),
        active=(Fault(Cause.HEAD_JUMP, "30 px"), Fault(Cause.WARM)),
        against_arming=(Hindrance.ALREADY_ARMED,),
        against_hand_over=(Hindrance.NO_TARGET, Cause.POOR_VIEW),
        deadman=False,
        servos_on=True,
        busy="checking",
        operator_command=Command(bend=0.25),
        operator_moved_s=time_s - 1.0,
        advice=Advice(Speed.SLOW, 3.0, 0.0, "wait"),
        blanked="",
        program_command=Command(advance_mm_s=2.0),
        sent=Command(bend=0.125),
        sent_by=Source.OPERATOR,
        latency_s=0.05,
        follow_share=0.5,
    )


def record(
    folder: Path,
    ticks: Iterable[Tick],
    config: RecordConfig = QUICK,
    *,
    driven: bool = False,
    bus: object = None,
    events: Iterable[Event] = (),
) -> Path:
    """Record ticks into a session in `folder`, `driven` with ``drive_of``, and events after them; returns the session."""
    writer = SessionWriter(config, ABOUT, folder=folder, clock=lambda: 1000.0)
    writer.start()
    for tick in ticks:
        assert writer.put(tick, drive_of(tick.frame.captured_s) if driven else None, bus)
    for event in events:
        writer.add_event(event)
    assert writer.close()
    status = writer.status()
    assert not status.problem, status.problem
    return status.saved


def set_open(session: Path) -> None:
    """As a kill leaves the manifest."""
    content = json.loads((session / "manifest.json").read_text())
    content |= {"closed": False, "ended": "", "ended_utc": None, "counts": {}}
    (session / "manifest.json").write_text(json.dumps(content))


def wait_for(condition: object, timeout_s: float = 10.0) -> None:
    """Until a condition holds."""
    assert callable(condition)
    until_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < until_s, "waited in vain"
        time.sleep(0.005)
