"""A robot of a family under contract: how quick its protocol is, and what it cannot do."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import EntryPoint
from typing import Any, Final

from config.files import list_shipped
from config.load import load_robot
from config.robot import RingConfig, RobotConfig
from config.world import WallConfig, WorldConfig
from drivers.base_model import stop_s
from drivers.capabilities import CAPABILITIES, missing
from drivers.contract.cable import STEP_S, Cable
from drivers.driver import LineState
from drivers.emulator.faults import Fault, FaultScript
from drivers.messages import Twist
from drivers.registry import capabilities

ROOM: Final = WorldConfig(
    wall=tuple(WallConfig(x1_m=x1, y1_m=y1, x2_m=x2, y2_m=y2) for x1, y1, x2, y2 in (
        (2.5, -2.0, 2.5, 2.0), (2.5, 2.0, -1.5, 2.0), (-1.5, 2.0, -1.5, -2.0), (-1.5, -2.0, 2.5, -2.0),
    ))
)  # fmt: skip
"""Room to drive a metre, and an echo for every sensor."""
SPEED_M_S: Final = 0.5
TURN_RAD_S: Final = 1.0
"""A robot that is slower drives the whole contract as much slower."""
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
    has
        What the robot can do (`drivers.capabilities`).
    volts
        Voltages of its emulated battery, full and nearly empty; None if it reports none.
    """

    robot: RobotConfig
    other_ring: RingConfig
    connect_s: float
    silent_s: float
    deaf_s: float
    halt_s: float
    handshake_bytes: int = 0
    cut_stride: int = 29
    has: frozenset[str] = frozenset(CAPABILITIES)
    volts: tuple[float, float] | None = None

    @property
    def name(self) -> str:
        """The driver's."""
        return self.robot.robot.driver

    @property
    def lacks(self) -> dict[str, str]:
        """What the robot cannot do, with what follows."""
        return {name: f"{self.name}: {text}" for name, text in missing(self.has).items()}

    def at(self, v: float, w: float = 0.0) -> Twist:
        """Return a velocity, made slower as far as the robot's body is slower than those that the contract is for."""
        share = min(1.0, self.robot.body.speed_max_m_s / SPEED_M_S, self.robot.body.turn_max_rad_s / TURN_RAD_S)
        return Twist(v * share, w * share)

    @property
    def ahead(self) -> Twist:
        """A quick velocity straight ahead."""
        return self.at(0.3)

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
        cable.until_state(LineState.READY, self.connect_s)
        cable.until_echo(self.connect_s)

    def driving(self, twist: Twist | None = None, *faults: Fault, world: WorldConfig = PLAIN) -> Cable:
        """Return a line on which the robot has been released and drives at full speed, by default ahead."""
        twist = self.ahead if twist is None else twist
        cable = self.connected(*faults, world=world)
        cable.driver.release()
        cable.twist = twist
        cable.until(lambda: is_near(cable.robot.truth.twist, twist), 2.4 + stop_s(twist, self.robot.body), "motion")
        return cable


def ring_with(ring: RingConfig, **firing: object) -> RingConfig:
    """Return a ring with another firing pattern."""
    return RingConfig.model_validate(ring.model_dump(exclude={"firing"}) | {"firing": firing})


def family_of(robot: RobotConfig | str, **known: Any) -> Family:
    """Return a robot under contract, given by its file or name, with times that follow from the file.

    `known` replaces any attribute of `Family`.
    """
    if isinstance(robot, str):
        robot = load_robot(robot)
    ring, link, body = robot.ring, robot.link, robot.body
    firing = ring.firing.model_copy(update={"step_period_s": 1.25 * ring.firing.step_period_s})
    usual: dict[str, Any] = {
        "other_ring": ring.model_copy(update={"firing": firing}),
        "connect_s": 1.0 + link.answer_max_s,
        "silent_s": link.silence_max_s + 0.15,
        "deaf_s": 2.0 * link.answer_max_s,
        "halt_s": link.answer_max_s + stop_s(Twist(0.3, 0.0), body),
        "has": capabilities(robot),
    }
    return Family(robot, **(usual | known))


def find_family(name: str) -> Family:
    """Return the family that a call names: a robot, by its name or its file, or `module:FAMILY`.

    A module without that name which a robot is called after is this robot's: what its file says describes it whole.
    """
    module, _, attribute = name.partition(":")
    if not attribute:
        return family_of(name)
    try:
        found = EntryPoint("family", name, "").load()
    except AttributeError:
        if module not in list_shipped("robots"):
            raise
        return family_of(module)
    if not isinstance(found, Family):
        raise TypeError(f"{name} is {type(found).__name__}, expected a drivers.contract.family.Family")
    return found


def script(**fault: Any) -> tuple[Fault, ...]:
    """Return a script of one fault."""
    return FaultScript.model_validate({"fault": [fault]}).fault


def is_near(twist: Twist, wanted: Twist) -> bool:
    """Return whether a velocity is the wanted one, as far as protocols with whole degrees can say it."""
    return abs(twist.v - wanted.v) < 1e-3 and abs(twist.w - wanted.w) < 0.01


def steps(seconds: float) -> int:
    """Return a time in steps of a cable."""
    return round(seconds / STEP_S)
