"""The rFLEX family's entry in the driver registry: fulfils `drivers.registry.DriverFamily`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.driver import RobotDriver
from drivers.emulator.robot_device import RobotDevice
from drivers.rflex.codec import Decoder, Frame, report_of
from drivers.rflex.driver import RflexDriver

if TYPE_CHECKING:
    from drivers.emulator.faults import Fault

ROBOT: Final = "a robot with an rFLEX controller, as of the file b21r"


def make_driver(config: RobotConfig) -> RobotDriver:
    """Return the host's end; see `drivers.registry.make_driver`."""
    return RflexDriver(config)


def deadman_s(config: RobotConfig) -> float:
    """Return the time without a command after which the base begins to stop, s, as its file says."""
    return config.rflex.fail_safe_s


def make_device(
    config: RobotConfig, world: WorldConfig, seed: int, *, faults: Sequence[Fault], clock_start_us: int
) -> RobotDevice:
    """Return an emulated robot, whose clock wraps at 2³² µs."""
    from drivers.rflex.device import RflexDevice  # it loads compiled kernels, which a real robot does not need

    return RflexDevice(config, world, seed, faults, clock_start_us)


def frames_in(data: bytes) -> int:
    """Return how many frames of such a robot the bytes hold."""
    return sum(not isinstance(report_of(frame), Frame) for frame in Decoder().feed(data))
