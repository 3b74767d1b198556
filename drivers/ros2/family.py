"""The entry of ROS 2 in the driver registry: fulfils `drivers.registry.DriverFamily`, and opens its own line.

A process of its own holds ROS, so that no cycle waits for DDS. It speaks the ring-and-base protocol, which has all
that ranges, odometry and a velocity need; so the driver of that protocol supervises it like any other robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.denning.driver import DenningDriver
from drivers.driver import DriverError, RobotDriver
from drivers.emulator.robot_device import RobotDevice
from drivers.ros2.gateway_port import GatewayPort

if TYPE_CHECKING:
    from drivers.emulator.faults import Fault
    from drivers.registry import LineOptions

OPEN_TIMEOUT_S = 30.0
"""Longest time until ROS has found the robot's topics."""


def make_driver(config: RobotConfig) -> RobotDriver:
    """Return the host's end; see `drivers.registry.make_driver`.

    Raises
    ------
    DriverError
        The robot file lacks a sensor's frame, or describes a ring that does not turn with the base.
    """
    frames, sensors = len(config.ros2.frames), len(config.ring.mounts)
    if frames not in {0, sensors}:
        raise DriverError(f"ros2.frames names {frames} frames for the ring's {sensors} sensors: name one for each")
    if config.body.synchro:
        raise DriverError("body.synchro: the ring of a robot with ROS turns with its base frame; remove it")
    return DenningDriver(config)


def deadman_s(config: RobotConfig) -> float:
    """Return the time without a command after which the base begins to stop, s, as its file says."""
    return config.ros2.deadman_s


def make_device(
    config: RobotConfig, world: WorldConfig, seed: int, *, faults: Sequence[Fault], clock_start_us: int
) -> RobotDevice:
    """Return an emulated robot, without ROS."""
    from drivers.denning.device import DenningDevice  # it loads compiled kernels, which a real robot does not need

    return DenningDevice(config, world, seed, faults, clock_start_us)


def line_options(config: RobotConfig) -> LineOptions:
    """Return how the line is opened: by a process with ROS; see `drivers.registry.line_options`."""
    return {"opener": lambda _: GatewayPort(config), "open_timeout_s": OPEN_TIMEOUT_S}
