"""Opens a rig and puts engine and pilot on it; the window's thread runs what comes out."""

from __future__ import annotations

from contextlib import ExitStack

from core.config import Config, PerceptionConfig
from core.control.engine import Engine, Perceive
from core.control.health import ModelReport
from core.control.pilot import Pilot
from core.control.policies import make_policy
from core.learning.model_file import ModelError
from core.perception.pipeline import NoPerception, Pipeline, open_pipeline
from core.perception.segmentation import cores
from hardware.rig import Rig, RigKind, open_rig
from hardware.servos.bus_messages import BusStatus
from hardware.servos.servo_robot import ServoRobot


class RigEngine(Engine):
    """An engine that can also be asked for the newest status of the servo bus."""

    def __init__(self, rig: Rig, perceive: Perceive, config: Config, model: ModelReport) -> None:
        policy = make_policy(config.policy.name, config)
        pilot = Pilot(rig.robot, policy, config, model) if rig.robot is not None else None
        super().__init__(rig.camera, perceive, policy, rig.close, pilot, rig.robot)
        self._servos = rig.robot if isinstance(rig.robot, ServoRobot) else None
        if pilot is not None and rig.kind is RigKind.SIM:
            pilot.switch_on()  # there is nobody whom the twin could hurt

    def bus_status(self) -> BusStatus | None:
        """None where there is no servo bus, and before its first status."""
        return self._servos.bus_status() if self._servos is not None else None


class EngineMaker:
    """Opens rig and engine for a configuration, in the engine's thread. The network is loaded once and kept."""

    def __init__(self) -> None:
        self._perceive: Perceive | None = None
        self._loaded: PerceptionConfig | None = None

    def __call__(self, config: Config) -> RigEngine:
        """Raises DeviceError. A model that cannot be loaded is no error: the engine runs and refuses every frame, with why."""
        perceive, model = self._perception(_leaving_a_core(config.perception))
        if config.rig.camera == "image_folder" and isinstance(perceive, Pipeline):
            # Pictures that have nothing to do with each other have no past.
            perceive = perceive.perceive_single
        with ExitStack() as undo:
            rig = open_rig(config)
            undo.callback(rig.close)
            engine = RigEngine(rig, perceive, config, model)
            undo.pop_all()
        return engine

    def _perception(self, config: PerceptionConfig) -> tuple[Perceive, ModelReport]:
        if self._perceive is None or self._loaded != config:
            try:
                self._perceive = open_pipeline(config)
                self._loaded = config
            except ModelError as error:
                # Not remembered: once the model is restored, starting the rig again is enough.
                return NoPerception(str(error)), ModelReport(False, str(error))
        if isinstance(self._perceive, Pipeline):
            self._perceive.reset()
        return self._perceive, ModelReport(True)


def _leaving_a_core(config: PerceptionConfig) -> PerceptionConfig:
    """With threads "all": one core less, for window, servos and camera.

    Two threads of a network wait for each other; on two cores, with a twin beside them, they took 32 ms (p95 of the frame 68 ms)
    where one takes 29 (51 ms).
    """
    if config.segmentation.threads:
        return config
    threads = max(1, cores() - 1)
    return config.model_copy(update={"segmentation": config.segmentation.model_copy(update={"threads": threads})})
