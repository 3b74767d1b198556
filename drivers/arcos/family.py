"""The Pioneer family's entry in the driver registry: fulfils `drivers.registry.DriverFamily`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.arcos.codec import Decoder, decode_packet
from drivers.arcos.driver import ArcosDriver
from drivers.arcos.firmware import Firmware
from drivers.arcos.frames import Other, SyncEcho
from drivers.arcos.wire_units import discs_of
from drivers.driver import RobotDriver
from drivers.emulator.robot_device import RobotDevice

if TYPE_CHECKING:
    from drivers.emulator.faults import Fault

ROBOT: Final = "a Pioneer or AmigoBot, as of the file p3dx"


def make_driver(config: RobotConfig) -> RobotDriver:
    """Return the host's end; see `drivers.registry.make_driver`."""
    return ArcosDriver(config)


def make_device(
    config: RobotConfig,
    world: WorldConfig,
    seed: int,
    *,
    faults: Sequence[Fault],
    clock_start_us: int,  # noqa: ARG001 - a Pioneer reports no time
) -> RobotDevice:
    """Return an emulated Pioneer of the robot file's first model."""
    from drivers.arcos.device import ArcosDevice  # it loads compiled kernels, which a real robot does not need

    return ArcosDevice(config, world, firmware_of(config), seed, faults)


def firmware_of(config: RobotConfig) -> Firmware:
    """Return the flash settings of an emulated robot that the robot file describes.

    Raises
    ------
    DriverError
        The numbers of the discs do not fit the ring.
    """
    arcos = config.arcos
    return Firmware(
        subclass=arcos.subclasses[0] if arcos.subclasses else "p3dx",
        mm_per_count=arcos.distance_factor,
        mm_s_per_count=arcos.velocity_factor,
        mm_per_range=arcos.range_factor,
        rad_s_per_mm_s=arcos.turn_factor,
        sensor_numbers=discs_of(config),
    )


def frames_in(data: bytes) -> int:
    """Return how many frames of such a robot the bytes hold."""
    decoder = Decoder(decode_packet)
    packets = decoder.feed(data) + decoder.skip()
    return sum(not isinstance(packet, Other | SyncEcho) for packet in packets)
