"""A driver and an emulated robot on a line in virtual time that can be cut before any byte, in either direction."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from config.robot import BodyConfig, LinkConfig, RobotConfig
from config.world import DrumConfig, WorldConfig
from drivers.emulator.faults import Fault
from drivers.messages import Firing, Twist
from drivers.registry import make_device, make_driver
from tests.drivers.ring import RING

Way: TypeAlias = Literal["to the robot", "to the host"]
STEP_S = 0.005
CYCLE_STEPS = 10
"""A command every 50 ms."""

ROBOT = RobotConfig(
    ring=RING,
    body=BodyConfig(radius_m=0.381, speed_max_m_s=0.6, turn_max_rad_s=1.5, synchro=True),
    link=LinkConfig(port="/dev/robot"),
)
WORLD = WorldConfig(drum=(DrumConfig(x_m=3.0, y_m=1.5, radius_m=0.3), DrumConfig(x_m=2.0, y_m=-1.5, radius_m=0.3)))


@dataclass
class Cable:
    """A driver, an emulated robot, and the line between them.

    Attributes
    ----------
    cut_after
        Direction and number of bytes after which each connection is cut; None = never.
    passed
        Bytes of this connection so far, by direction.
    """

    faults: tuple[Fault, ...] = ()
    config: RobotConfig = ROBOT
    cut_after: tuple[Way, int] | None = None
    passed: dict[Way, int] = field(default_factory=dict)
    steps: int = 0
    plugged: bool = False
    firings: list[Firing] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.robot = make_device(self.config, WORLD, seed=1, faults=self.faults)
        self.driver = make_driver(self.config)

    @property
    def now_s(self) -> float:
        return self.steps * STEP_S

    def plug(self) -> None:
        self.plugged = True
        self.passed = {"to the robot": 0, "to the host": 0}
        self.driver.line_opened(self.now_s)

    def unplug(self) -> None:
        self.plugged = False
        self.driver.line_closed()

    def step(self) -> None:
        """Let one step pass while the host drives; cut the line when the chosen byte is reached."""
        self.steps += 1
        said = self.robot.advance(self.now_s)
        if self.plugged:
            self.driver.receive(self._pass("to the host", said), self.now_s)
            self.driver.tick(self.now_s)
        if self.steps % CYCLE_STEPS == 0:
            self.driver.drive(Twist(0.1, 0.05))
        if self.plugged:
            self.robot.receive(self._pass("to the robot", self.driver.outgoing(writable=True)))
        self.firings += self.driver.take_received().firings
        if self.plugged and self.cut_after is not None and self.passed[self.cut_after[0]] == self.cut_after[1]:
            self.unplug()

    def _pass(self, way: Way, data: bytes) -> bytes:
        """Return the bytes that get through before the cut."""
        if self.cut_after is not None and way == self.cut_after[0]:
            data = data[: self.cut_after[1] - self.passed[way]]
        self.passed[way] += len(data)
        return data

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.step()

    def until_echo(self, timeout_s: float) -> float:
        """Run until a firing arrives, for `timeout_s` at most; return how long that took."""
        started, before = self.now_s, len(self.firings)
        while len(self.firings) == before:
            assert self.now_s - started <= timeout_s, f"no echo within {timeout_s} s: {self.driver.problem}"
            self.step()
        return self.now_s - started
