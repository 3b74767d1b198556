"""The line in memory: answers between the host's cycles, unplugging, and the same run every time."""

from __future__ import annotations

import math
from collections.abc import Sequence

from config.robot import RingConfig
from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import (
    Drive,
    Echo,
    Hello,
    Ident,
    Odom,
    Pattern,
)
from drivers.driver import LineState, Received
from drivers.emulator.faults import Fault
from drivers.emulator.memory_transport import MemoryLine
from drivers.messages import Identity, LinkCounts, Pose, Twist
from drivers.registry import make_device
from tests.drivers.device_host import WORLD, robot_config, script
from tests.drivers.vectors import THIRDS


class PlainDriver:
    """A minimal driver: sends HELLO and PATTERN, and logs what it receives."""

    def __init__(self) -> None:
        self.decoder = Decoder("robot")
        self.log: list[tuple[float, object]] = []
        self.ticks: list[float] = []
        self._out = b""

    state = LineState.READY
    problem: str | None = None
    identity: Identity | None = None
    counts = LinkCounts()
    line_baud: int | None = None

    def line_opened(self, run_s: float) -> None:
        self.log.append((run_s, "opened"))
        self._out += encode(Hello(0)) + encode(Pattern(1, 50, 255, THIRDS))

    def line_closed(self) -> None:
        self.log.append((math.nan, "closed"))

    def receive(self, data: bytes, now_s: float) -> None:
        self.log += [(now_s, frame) for frame in self.decoder.feed(data)]

    def tick(self, now_s: float) -> None:
        self.ticks.append(now_s)

    def drive(self, twist: Twist) -> None:
        self._out += encode(Drive(2, round(twist.v * 1e3), round(twist.w * 1e3)))

    def halt(self) -> None: ...

    def release(self) -> None: ...

    def set_firing(self, ring: RingConfig) -> None: ...

    def end_session(self) -> None: ...

    def outgoing(self, *, writable: bool) -> bytes:
        assert writable
        out, self._out = self._out, b""
        return out

    @property
    def battery_v(self) -> float | None:
        return None

    @property
    def odometry_origin(self) -> Pose:
        return Pose(0.0, 0.0, 0.0)

    @property
    def firings_waiting(self) -> int:
        return 0

    def take_received(self) -> Received:
        return Received((), None, rebooted=False)


def memory_run(faults: Sequence[Fault] = (), cycle_s: float = 0.05) -> PlainDriver:
    driver = PlainDriver()
    line = MemoryLine(driver, make_device(robot_config(), WORLD, 1, faults=faults), start_s=100.0)
    for k in range(round(2.0 / cycle_s) + 1):
        driver.drive(Twist(0.3, 0.0))
        line.exchange(100.0 + k * cycle_s)
    return driver


def test_it_connects_a_driver_and_a_robot() -> None:
    driver = memory_run()
    assert driver.log[0] == (100.0, "opened")
    arrival = {type(frame): when for when, frame in reversed(driver.log)}
    assert arrival[Ident] <= 100.0 + 0.01, "answers flow between the host's cycles"
    assert sum(isinstance(frame, Echo) for _, frame in driver.log) == 40
    assert sum(isinstance(frame, Odom) for _, frame in driver.log) >= 98
    assert driver.ticks == sorted(driver.ticks)
    assert all(100.0 <= when <= 102.0 + 1e-9 for when, _ in driver.log)


def test_it_is_deterministic() -> None:
    assert memory_run().log == memory_run().log


def test_it_is_unplugged_and_plugged_in_again() -> None:
    driver = memory_run(script(kind="unplug", at_s=0.5, duration_s=0.5))
    assert [what for _, what in driver.log if isinstance(what, str)] == ["opened", "closed", "opened"]
    assert not [when for when, what in driver.log if 100.51 < when < 100.99]
    assert driver.decoder.bad <= 1
