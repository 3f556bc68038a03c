"""Opens a rig with its engine and pilot; the engine's thread runs it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from threading import Lock
from typing import TYPE_CHECKING

from core.bench.bench import BenchError
from core.config.models import Config, PerceptionConfig
from core.config.rig_file import RigFileError, as_calibrated, calibration_of
from core.control.engine import Engine, Perceive
from core.control.frame_reports import view_picture
from core.control.health import ModelReport
from core.control.pilot import LeftOver, Pilot
from core.control.policies import make_policy
from core.control.readiness import READY, RigRecords, read_records
from core.devices import DeviceError
from core.perception.inference import cores
from core.perception.model_file import ModelError
from core.perception.pipeline import NoPerception, Pipeline, open_pipeline
from core.system import lower_priority, return_free_memory
from core.types import Frame, Image, Point, Scene
from hardware.rig import START_INSERTION_MM, Rig, RigKind, open_rig
from hardware.servos.bus_ipc import BusStatus
from hardware.servos.servo_robot import ServoRobot

if TYPE_CHECKING:
    from hardware.twin.process import PrestartedProcesses


class RigEngine(Engine):
    """An engine that can also be asked for the newest status of the servo bus."""

    def __init__(self, rig: Rig, perceive: Perceive, config: Config, model: ModelReport, left_over: LeftOver | None = None) -> None:
        policy = make_policy(config.policy.name, config)
        status = rig.robot.bus_status() if isinstance(rig.robot, ServoRobot) else None
        firmware = status.firmware if status is not None else ()
        pilot, self._config, self._records = None, config, RigRecords()
        if rig.robot is not None:
            readiness, view = READY, None
            if rig.kind is RigKind.LIVE:
                self._records = read_records(config, firmware)
                readiness, view = self._records.readiness(config), _calibrated_view(config)
            pilot = Pilot(
                rig.robot, policy, config, model, left_over=left_over, readiness=readiness, view=view, bench_clock=rig.clock
            )
        super().__init__(rig.camera, perceive, policy, rig.close, pilot, rig.robot)
        self._is_live = rig.kind is RigKind.LIVE
        self._servos = rig.robot if isinstance(rig.robot, ServoRobot) else None
        self._network: Pipeline | None = None
        self._knows_past = True
        if pilot is not None and rig.kind is RigKind.SIM and left_over is None:
            pilot.switch_on()  # the twin can hurt no one

    def use_network(self, network: Pipeline, *, knows_past: bool) -> None:
        """What ``set_perception`` changes; without `knows_past` every frame is perceived by itself."""
        self._network, self._knows_past = network, knows_past

    def set_perception(self, config: PerceptionConfig) -> bool:
        """Perceive under other thresholds from the next frame on, with the same head; from any thread. False without a network.

        On a LIVE rig what stands against a hand-over is found again, before the first such frame.
        """
        if self._network is None:
            return False
        if self.pilot is not None and self._is_live:
            self.pilot.set_readiness(self._records.readiness(self._config.model_copy(update={"perception": config})))
        changed, running = self._network.with_config(config), self._perceive
        if isinstance(running, Pipeline):
            changed.follow_on(running)
        self._perceive = changed if self._knows_past else changed.perceive_single
        return True

    def bus_status(self) -> BusStatus | None:
        """None where there is no servo bus, and before its first status."""
        return self._servos.bus_status() if self._servos is not None else None


def _calibrated_view(config: Config) -> Image | None:
    """The picture of the rig's calibration, with which a moved camera is noticed; a rig with a bench is registered against that."""
    known = calibration_of(config) if config.perception.bench is None else None
    return view_picture(known.view) if known is not None and known.view is not None else None


class EngineMaker:
    """Opens rig and engine for a configuration, in the engine's thread, one at a time.

    The network is loaded once and kept. What the operator has not acknowledged when a rig is closed is kept, too, or F5 would clear
    a latched STOP.

    `ahead` is what ``start_ahead`` gave for the first rig; the caller's to end where none is opened.
    """

    def __init__(self, ahead: PrestartedProcesses | None = None) -> None:
        self._ahead = ahead
        self._pilot: Pilot | None = None
        self._left_over: LeftOver | None = None
        self._perceive: Perceive | None = None
        self._loaded: PerceptionConfig | None = None
        self._one_loads = Lock()

    def begin_twin(self, config: Config) -> None:
        """Let the twin that was started ahead build its bench; an error is reported when the rig is opened."""
        if self._ahead is not None:
            with suppress(RigFileError, DeviceError):
                self._ahead.begin(as_calibrated(config), START_INSERTION_MM)

    def begin_network(self, config: Config) -> None:
        """Begin to load the network; an error is reported when the rig is opened."""
        with suppress(RigFileError):
            beside = ThreadPoolExecutor(1, "network")
            beside.submit(self._perception, leaving_a_core(as_calibrated(config).perception))
            beside.shutdown(wait=False)

    def __call__(self, config: Config) -> RigEngine:
        """Raises DeviceError. A model that cannot be loaded is no error: the engine runs and refuses every frame, with why."""
        config = as_calibrated(config)
        if self._pilot is not None:  # nor does a rig that cannot be opened acknowledge anything
            self._left_over, self._pilot = self._pilot.left_over, None
            return_free_memory()  # garbage is collected in the window's thread alone
        with ExitStack() as undo, ThreadPoolExecutor(1, "network") as beside:
            loading = beside.submit(self._perception, leaving_a_core(config.perception))  # both take seconds
            ahead, self._ahead = self._ahead, None
            rig = self._open(config, ahead)
            undo.callback(rig.close)
            perceive, model = loading.result()
            network = perceive if isinstance(perceive, Pipeline) else None
            # Pictures that have nothing to do with each other have no past.
            knows_past = config.rig.camera != "image_folder"
            if network is not None and not knows_past:
                perceive = network.perceive_single
            engine = RigEngine(rig, perceive, config, model, self._left_over)
            undo.pop_all()
        if network is not None:
            engine.use_network(network, knows_past=knows_past)
        self._pilot = engine.pilot
        return engine

    def _open(self, config: Config, ahead: PrestartedProcesses | None) -> Rig:
        return open_rig(config, ahead)

    def _perception(self, config: PerceptionConfig) -> tuple[Perceive, ModelReport]:
        try:
            with self._one_loads:
                if isinstance(self._perceive, Pipeline) and self._loaded is not None and _same_network(self._loaded, config):
                    self._perceive = self._perceive.with_config(config)
                    self._loaded = config
                elif self._perceive is None or self._loaded != config:
                    pipeline = open_pipeline(config)
                    # At low priority only what leaves the interpreter free: for the rest the window would have to wait.
                    with ThreadPoolExecutor(1, "warm-up", lower_priority) as behind:
                        behind.submit(pipeline.warm_up).result()
                    self._perceive, self._loaded = pipeline, config
        except (ModelError, BenchError) as error:
            # Not kept: once the model or the bench is restored, starting the rig again is enough.
            return NoPerception(str(error)), ModelReport(False, str(error))
        assert self._perceive is not None
        return self._perceive, ModelReport(True)

    def perceive_again(self, frame: Frame, target: Point | None, config: PerceptionConfig) -> Scene | None:
        """A frame by itself under other thresholds, for a rig that is closed; None without a network."""
        if not isinstance(self._perceive, Pipeline):
            return None
        return self._perceive.with_config(config).perceive_single(frame, target)


def _same_network(first: PerceptionConfig, second: PerceptionConfig) -> bool:
    """Whether only thresholds differ."""
    thresholds = {"vessel_threshold": 0.5, "robot_threshold": 0.5}
    return first.segmentation.model_copy(update=thresholds) == second.segmentation.model_copy(update=thresholds)


def leaving_a_core(config: PerceptionConfig) -> PerceptionConfig:
    """With threads "all": one core less, for window, servos and camera.

    Two threads of a network wait for each other; on two cores, with a twin beside them, they took 32 ms (p95 of the frame 68 ms)
    where one takes 29 (51 ms).
    """
    if config.segmentation.threads:
        return config
    threads = max(1, cores() - 1)
    return config.model_copy(update={"segmentation": config.segmentation.model_copy(update={"threads": threads})})


def quick_sight(config: Config) -> Perceive:
    """Perception of single frames as the calibration wants it: quickly, with a core left for servos and camera."""
    perception = leaving_a_core(config.perception)
    plain = perception.segmentation.model_copy(update={"mirrored": "never"})
    # the camera may have been moved for the calibration: no bench
    return open_pipeline(perception.model_copy(update={"segmentation": plain, "bench": None})).perceive_single
