"""The Chirp's entry point: fulfils `drivers.registry.DriverFamily`."""

from __future__ import annotations

from collections.abc import Sequence

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.driver import RobotDriver
from drivers.emulator.faults import Fault
from drivers.emulator.robot_device import RobotDevice
from tests.drivers.contract.example.driver import ChirpDriver


def make_driver(config: RobotConfig) -> RobotDriver:
    """Return the host's end."""
    return ChirpDriver(config)


def make_device(
    config: RobotConfig,
    world: WorldConfig,
    seed: int,
    *,
    faults: Sequence[Fault],
    clock_start_us: int,  # noqa: ARG001
) -> RobotDevice:
    """Return the emulated robot."""
    from tests.drivers.contract.example.device import ChirpDevice  # loads compiled kernels, not needed to drive

    return ChirpDevice(config, world, seed, faults)
