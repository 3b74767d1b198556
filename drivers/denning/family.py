"""The Denning family's entry in the driver registry: fulfils `drivers.registry.DriverFamily`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.denning.codec import Decoder
from drivers.denning.driver import DenningDriver
from drivers.driver import RobotDriver
from drivers.emulator.robot_device import RobotDevice

if TYPE_CHECKING:
    from drivers.emulator.faults import Fault

ROBOT: Final = "a Denning or another robot of the ring-and-base protocol, as of the file denning"


def make_driver(config: RobotConfig) -> RobotDriver:
    """Return the host's end; see `drivers.registry.make_driver`."""
    return DenningDriver(config)


def make_device(
    config: RobotConfig, world: WorldConfig, seed: int, *, faults: Sequence[Fault], clock_start_us: int
) -> RobotDevice:
    """Return an emulated Denning robot, whose clock wraps at 2³² µs."""
    from drivers.denning.device import DenningDevice  # it loads compiled kernels, which a real robot does not need

    return DenningDevice(config, world, seed, faults=faults, clock_start_us=clock_start_us)


def frames_in(data: bytes) -> int:
    """Return how many frames of such a robot the bytes hold."""
    return len(Decoder("robot", midway=True).feed(data))
