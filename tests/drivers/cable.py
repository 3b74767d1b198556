"""A Denning on the line of the contract of drivers, between two drums."""

from __future__ import annotations

from dataclasses import dataclass

from config.robot import BodyConfig, LinkConfig, RobotConfig
from config.world import DrumConfig, WorldConfig
from drivers.contract.cable import CYCLE_STEPS, STEP_S, Way
from drivers.contract.cable import Cable as AnyCable
from drivers.emulator.faults import Fault
from tests.drivers.ring import RING

__all__ = ["CYCLE_STEPS", "ROBOT", "STEP_S", "WORLD", "Cable", "Way"]

ROBOT = RobotConfig(
    ring=RING,
    body=BodyConfig(radius_m=0.381, speed_max_m_s=0.6, turn_max_rad_s=1.5, synchro=True),
    link=LinkConfig(port="/dev/robot"),
)
WORLD = WorldConfig(drum=(DrumConfig(x_m=3.0, y_m=1.5, radius_m=0.3), DrumConfig(x_m=2.0, y_m=-1.5, radius_m=0.3)))


@dataclass
class Cable(AnyCable):
    """A cable to this robot in this world by default."""

    faults: tuple[Fault, ...] = ()
    config: RobotConfig = ROBOT
    world: WorldConfig = WORLD
