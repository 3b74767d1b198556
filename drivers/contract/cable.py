"""A driver and an emulated robot on a line in virtual time that can be cut before any byte, in either direction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.driver import LineState
from drivers.emulator.faults import Fault
from drivers.messages import Firing, Flags, Odometry, Twist
from drivers.registry import make_device, make_driver

Way: TypeAlias = Literal["to the robot", "to the host"]
STEP_S = 0.005
SLOWLY = Twist(0.1, 0.05)
CYCLE_STEPS = 10
"""A command every 50 ms."""


def whole(data: bytes) -> list[bytes]:
    return [data]


@dataclass
class Cable:
    """A driver, an emulated robot, and the line between them.

    Attributes
    ----------
    cut_after
        Direction and number of bytes after which each connection is cut; None = never.
    passed
        Bytes of this connection so far, by direction.
    twist
        What the host drives at in every cycle; None = nothing.
    split
        How the bytes for the driver are split.
    said, heard
        What the robot has said, as far as it got through, and what it heard, each with its time, s.
    firings, odometry, notes, restarts, flags
        What the driver passed on: all firings, samples, notes, number of restarts, and all flags.
    """

    faults: tuple[Fault, ...]
    config: RobotConfig
    cut_after: tuple[Way, int] | None = None
    world: WorldConfig = field(default_factory=WorldConfig)
    twist: Twist | None = SLOWLY
    split: Callable[[bytes], list[bytes]] = whole
    passed: dict[Way, int] = field(default_factory=dict)
    steps: int = 0
    plugged: bool = False
    frozen: bool = False
    said: bytearray = field(default_factory=bytearray)
    heard: list[tuple[float, bytes]] = field(default_factory=list)
    firings: list[Firing] = field(default_factory=list)
    odometry: list[Odometry] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    restarts: int = 0
    flags: Flags = Flags.NONE

    def __post_init__(self) -> None:
        self.robot = make_device(self.config, self.world, seed=1, faults=self.faults)
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
        if self.frozen:
            return
        if self.plugged:
            through = self._pass("to the host", said)
            self.said += through
            for part in self.split(through):
                self.driver.receive(part, self.now_s)
            self.driver.tick(self.now_s)
        if self.steps % CYCLE_STEPS == 0 and self.twist is not None:
            self.driver.drive(self.twist)
        if self.plugged:
            asked = self._pass("to the robot", self.driver.outgoing(writable=True))
            self.heard.append((self.now_s, asked))
            self.robot.receive(asked)
        self._take()
        if self.plugged and self.cut_after is not None and self.passed[self.cut_after[0]] == self.cut_after[1]:
            self.unplug()

    def _take(self) -> None:
        received = self.driver.take_received()
        self.firings += received.firings
        self.odometry += [] if received.odometry is None else [received.odometry]
        self.notes += received.notes
        self.restarts += received.rebooted
        self.flags |= received.flags

    def _pass(self, way: Way, data: bytes) -> bytes:
        """Return the bytes that get through before the cut."""
        if self.cut_after is not None and way == self.cut_after[0]:
            data = data[: self.cut_after[1] - self.passed[way]]
        self.passed[way] += len(data)
        return data

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.step()

    def until(self, done: Callable[[], bool], timeout_s: float, what: str) -> float:
        """Run until a condition holds, for `timeout_s` at most; return how long that took."""
        started = self.now_s
        while not done():
            assert self.now_s - started <= timeout_s, f"no {what} within {timeout_s} s: {self.driver.problem}"
            self.step()
        return self.now_s - started

    def until_state(self, state: LineState, timeout_s: float) -> float:
        """Run until the driver is in a state, for `timeout_s` at most; return how long that took."""
        return self.until(lambda: self.driver.state is state, timeout_s, state.name)

    def until_cut(self, timeout_s: float) -> float:
        """Run until the line is cut, for `timeout_s` at most; return how long that took."""
        return self.until(lambda: not self.plugged, timeout_s, "cut")

    def until_echo(self, timeout_s: float) -> float:
        """Run until a firing arrives, for `timeout_s` at most; return how long that took."""
        before = len(self.firings)
        return self.until(lambda: len(self.firings) > before, timeout_s, "echo")
