"""The Pioneer family's entry in the driver registry: fulfils `drivers.registry.DriverFamily`."""

from __future__ import annotations

from collections.abc import Sequence

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.arcos.driver import ArcosDriver
from drivers.driver import DriverError, RobotDriver
from drivers.emulator.faults import Fault
from drivers.emulator.robot_device import RobotDevice


def make_driver(config: RobotConfig) -> RobotDriver:
    """Return the host's end; see `drivers.registry.make_driver`."""
    return ArcosDriver(config)


def make_device(
    config: RobotConfig,  # noqa: ARG001
    world: WorldConfig,  # noqa: ARG001
    seed: int,  # noqa: ARG001
    *,
    faults: Sequence[Fault],  # noqa: ARG001
    clock_start_us: int,  # noqa: ARG001
) -> RobotDevice:
    """Raise `DriverError`: this family has no emulator."""
    raise DriverError('robot.driver = "arcos": there is no emulated Pioneer; give the port of a robot')
