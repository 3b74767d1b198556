"""An emulated robot in virtual time, and a host that records its frames; shared by the tests of the emulator."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any, TypeVar

from config.robot import BodyConfig, LinkConfig, RobotConfig
from config.world import AcousticsConfig, DrumConfig, OdometryConfig, StartConfig, WallConfig, WorldConfig
from drivers.contract.family import script
from drivers.denning.codec import Decoder, encode
from drivers.denning.device import DenningDevice
from drivers.denning.frames import (
    Drive,
    Frame,
    Odom,
)
from drivers.emulator.faults import Fault
from drivers.messages import Flags
from tests.drivers.ring import RING

__all__ = ["ALL", "WORLD", "Host", "host", "next_event_s", "robot_config", "script"]

F = TypeVar("F", bound=Frame)


ALL = (1 << 24) - 1


def robot_config(baud: int = 115200, **body: Any) -> RobotConfig:
    return RobotConfig(
        ring=RING,
        body=BodyConfig(**{"radius_m": 0.381, "speed_max_m_s": 0.6, "turn_max_rad_s": 1.5} | body),
        link=LinkConfig(baud=baud),
    )


WORLD = WorldConfig(
    drum=(DrumConfig(x_m=2.0, y_m=1.2, radius_m=0.3048), DrumConfig(x_m=0.0, y_m=-2.0, radius_m=0.3048)),
    wall=(WallConfig(x1_m=4.0, y1_m=-4.0, x2_m=4.0, y2_m=4.0),),
    start=StartConfig(x_m=0.5, y_m=0.0),
    acoustics=AcousticsConfig(noise_m=0.01, dropout=0.05, outliers=0.02, crosstalk=0.3),
    odometry=OdometryConfig(scale=1.01, heading_rad_per_sqrt_m=0.01),
)


def next_event_s(robot: DenningDevice) -> float:
    """Return when `advance` will next have something to do."""
    moments = [robot._next_us()]
    if robot._line.empty_us is not None:
        moments.append(robot._line.empty_us)
    return min(moments) * 1e-6


class Host:
    """A host that records every frame with the time of its arrival."""

    def __init__(self, robot: DenningDevice) -> None:
        self.robot = robot
        self.now = 0.0
        self.decoder = Decoder("robot")
        self.heard: list[tuple[float, Frame]] = []
        self.raw = bytearray()
        self._seq = itertools.count()

    def send(self, make: Any, *fields: Any) -> int:
        seq = next(self._seq) % 256
        self.robot.receive(encode(make(seq, *fields)))
        return seq

    def run(self, seconds: float, step: float = 0.001, drive: tuple[int, int] | None = None) -> None:
        until = self.now + seconds
        last_drive = -math.inf
        while self.now < until - 1e-9:
            if drive is not None and self.now - last_drive >= 0.1:
                self.send(Drive, *drive)
                last_drive = self.now
            self.now = min(until, self.now + step)
            data = self.robot.advance(self.now)
            self.raw += data
            self.heard += [(self.now, frame) for frame in self.decoder.feed(data)]

    def of(self, kind: type[F]) -> list[F]:
        return [frame for _, frame in self.heard if isinstance(frame, kind)]

    def last(self, kind: type[F]) -> F:
        return self.of(kind)[-1]

    def flags(self) -> Flags:
        """As last reported."""
        return Flags(self.last(Odom).flags)

    def flags_now(self) -> Flags:
        return self.robot.flags


def host(world: WorldConfig = WORLD, faults: Sequence[Fault] = (), seed: int = 1, **more: Any) -> Host:
    baud = more.pop("baud", 115200)
    clock_start_us = more.pop("clock_start_us", 0)
    robot = DenningDevice(robot_config(baud, **more), world, seed, faults=faults, clock_start_us=clock_start_us)
    return Host(robot)
