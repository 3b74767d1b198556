"""The robots on which the contract of drivers is tested: one of each family, and what the contract leaves open."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import EntryPoint
from types import MappingProxyType
from typing import Final

from config.load import load_robot
from config.robot import BodyConfig, DriverConfig, LinkConfig, RingConfig, RobotConfig
from config.world import WallConfig, WorldConfig
from drivers.driver import LineState
from drivers.emulator.faults import Fault
from drivers.messages import Twist
from drivers.registry import GROUP
from tests.drivers.cable import ROBOT, STEP_S, Cable

ROOM: Final = WorldConfig(
    wall=tuple(WallConfig(x1_m=x1, y1_m=y1, x2_m=x2, y2_m=y2) for x1, y1, x2, y2 in (
        (2.5, -2.0, 2.5, 2.0), (2.5, 2.0, -1.5, 2.0), (-1.5, 2.0, -1.5, -2.0), (-1.5, -2.0, 2.5, -2.0),
    ))
)  # fmt: skip
"""Room to drive a metre, and an echo for every sensor."""
AHEAD: Final = Twist(0.3, 0.0)
PLAIN: Final = WorldConfig()
"""Nothing in range, and endless room."""


@dataclass(frozen=True, slots=True)
class Family:
    """A robot of a family, and how quick its protocol is.

    Attributes
    ----------
    robot
        A robot file of the family.
    other_ring
        Its ring with another firing pattern.
    connect_s
        Longest time from an open line to READY, and from there to the first firing.
    silent_s, deaf_s
        Longest times until a robot that sends nothing, or reads nothing, is DOWN.
    halt_s
        Longest time in which a halted base stands, from 0.3 m/s.
    handshake_bytes
        The line is cut before each of so many bytes, those of the handshake.
    cut_stride
        After them it is cut before each byte of this distance.
    """

    robot: RobotConfig
    other_ring: RingConfig
    connect_s: float
    silent_s: float
    deaf_s: float
    halt_s: float
    handshake_bytes: int
    cut_stride: int

    @property
    def name(self) -> str:
        """The driver's."""
        return self.robot.robot.driver

    def cable(self, *faults: Fault, world: WorldConfig = ROOM) -> Cable:
        """Return a line to the robot that is not plugged in yet, and on which nothing is driven."""
        return Cable(faults, self.robot, world=world, twist=None)

    def connected(self, *faults: Fault, world: WorldConfig = ROOM) -> Cable:
        """Return a line on which the robot is READY."""
        cable = self.cable(*faults, world=world)
        cable.plug()
        self.until_ready(cable)
        return cable

    def until_ready(self, cable: Cable) -> None:
        """Run until the line is READY and the robot fires."""
        cable.until(lambda: cable.driver.state is LineState.READY, self.connect_s, "READY")
        cable.until_echo(self.connect_s)

    def driving(self, twist: Twist = AHEAD, *faults: Fault, world: WorldConfig = PLAIN) -> Cable:
        """Return a line on which the robot has been released and drives at full speed."""
        cable = self.connected(*faults, world=world)
        cable.driver.release()
        cable.twist = twist
        cable.until(lambda: is_near(cable.robot.truth.twist, twist), 3.0, "motion")
        return cable


def ring_with(ring: RingConfig, **firing: object) -> RingConfig:
    """Return a ring with another firing pattern."""
    return RingConfig.model_validate(ring.model_dump(exclude={"firing"}) | {"firing": firing})


DENNING: Final = Family(
    ROBOT, ring_with(ROBOT.ring, preset="quadrants", step_period_s=0.06), connect_s=0.2, silent_s=0.5, deaf_s=0.5,
    halt_s=0.15, handshake_bytes=60, cut_stride=7,
)  # fmt: skip
P3DX: Final = load_robot("p3dx")
ARCOS: Final = Family(
    P3DX, ring_with(P3DX.ring, sets=[[k, 15 - k] for k in (3, 4, 0, 7)], step_period_s=0.06), connect_s=1.5,
    silent_s=0.65, deaf_s=1.6, halt_s=0.3, handshake_bytes=0, cut_stride=29,
)  # fmt: skip
B21R: Final = load_robot("b21r")
RFLEX: Final = Family(
    B21R, B21R.ring.model_copy(update={"firing": B21R.ring.firing.model_copy(update={"step_period_s": 0.04})}),
    connect_s=0.4, silent_s=0.5, deaf_s=1.0, halt_s=0.35, handshake_bytes=0, cut_stride=29,
)  # fmt: skip
ROS2: Final = Family(
    DENNING.robot.model_copy(update={
        "robot": DriverConfig(driver="ros2"), "body": DENNING.robot.body.model_copy(update={"synchro": False}),
    }),
    DENNING.other_ring, connect_s=0.2, silent_s=0.5, deaf_s=0.5, halt_s=0.15, handshake_bytes=0, cut_stride=29,
)  # fmt: skip
"""Without ROS, which tests/drivers/ros2 adds in plain data."""
SERVO1_FILE: Final = load_robot("servo1")
SERVO1_RING: Final = ring_with(
    SERVO1_FILE.ring.model_copy(update={"range_max_m": 4.0}), preset="single", step_period_s=0.024
)
SERVO1: Final = Family(
    SERVO1_FILE.model_copy(update={"ring": SERVO1_RING, "body": ROBOT.body.model_copy(update={"synchro": False})}),
    ring_with(SERVO1_RING, preset="single", step_period_s=0.03), connect_s=0.2, silent_s=0.5, deaf_s=0.5, halt_s=0.15,
    handshake_bytes=80, cut_stride=29,
)  # fmt: skip
"""A sensor on a servo, which sees the whole room."""
CHIRP_RING: Final = RingConfig.model_validate({
    "count": 12, "radius_m": 0.2, "beam_half_angle_deg": 15.0, "resolution_m": 0.001, "range_min_m": 0.05,
    "range_max_m": 4.0, "firing": {"preset": "thirds", "step_period_s": 0.05},
})  # fmt: skip
CHIRP: Final = Family(
    RobotConfig(
        robot=DriverConfig(driver="chirp"), ring=CHIRP_RING,
        body=BodyConfig(radius_m=0.2, speed_max_m_s=0.6, turn_max_rad_s=1.5), link=LinkConfig(port="/dev/chirp"),
    ),
    ring_with(CHIRP_RING, preset="quadrants", step_period_s=0.06), connect_s=0.3, silent_s=0.5, deaf_s=0.5,
    halt_s=0.15, handshake_bytes=0, cut_stride=29,
)  # fmt: skip
"""The example of docs/extending.md."""
CHIRP_ENTRY: Final = EntryPoint("chirp", "tests.drivers.contract.example.family", GROUP)
FAMILIES: Final = MappingProxyType(
    {"arcos": ARCOS, "chirp": CHIRP, "denning": DENNING, "rflex": RFLEX, "ros2": ROS2, "servo1": SERVO1}
)


def is_near(twist: Twist, wanted: Twist) -> bool:
    """Return whether a velocity is the wanted one, as far as protocols with whole degrees can say it."""
    return abs(twist.v - wanted.v) < 1e-3 and abs(twist.w - wanted.w) < 0.01


def steps(seconds: float) -> int:
    """Return a time in steps of a cable."""
    return round(seconds / STEP_S)
