"""A run in virtual time that can be paused: the emulated robot in memory follows the same time scales as on a pty."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import pytest

from config.load import load_settings
from config.settings import Settings
from drivers.emulator.faults import Fault
from drivers.emulator.robot_device import RobotDevice
from drivers.emulator.time_channel import TimeScaleFollower
from drivers.registry import make_device
from runtime.timing.run_clock import ScaledClock
from runtime.timing.time_control import EmulatorTimeControl
from runtime.timing.wake import LoopTimer
from tests.runtime.virtual_time import STEP_S, MemoryLink, VirtualLoop

TRANSIT_S = 0.001
"""Time from sending a time scale until the emulator receives it, s."""


class ScaledTimeLink(MemoryLink):
    """A line to a robot that lives by its follower's time; exchanges go on where that stands still."""

    follower: TimeScaleFollower
    control: EmulatorTimeControl
    is_hung = False

    def live(self) -> bytes:
        run_s = self.follower.run_at(self._loop.time())
        data = self._robot.advance(run_s - self._begin_s)
        for line in self.follower.acknowledge(run_s).splitlines():
            self._loop.call_soon(self.control.receive, line)
        return data

    def _exchange(self) -> None:
        if self.is_hung:
            self._turn = self._loop.call_later(STEP_S, self._exchange)
        else:
            super()._exchange()
            if self._turn is not None and self.is_open:
                self._turn.cancel()
                pause_s = STEP_S / max(1.0, self.follower.scale.factor)
                self._turn = self._loop.call_later(pause_s, self._exchange)


class PausableRun(NamedTuple):
    """A run and what controls its time."""

    loop: VirtualLoop
    settings: Settings
    robot: RobotDevice
    links: list[ScaledTimeLink]
    control: EmulatorTimeControl
    follower: TimeScaleFollower


@contextlib.contextmanager
def pausable_run(
    monkeypatch: pytest.MonkeyPatch, *sets: str, faults: tuple[Fault, ...] = ()
) -> Iterator[PausableRun]:
    """Give a loop in which `RobotProcess` runs by `control.clock`."""
    settings = load_settings("hallway", ["link.port=memory", *sets])
    assert settings.world is not None
    loop, links, follower = VirtualLoop(), list[ScaledTimeLink](), TimeScaleFollower()
    robot = make_device(settings, settings.world, 3, faults=faults)

    on_the_way: deque[bytes] = deque()

    def send(line: bytes) -> None:
        if not links or not links[0].is_hung:
            on_the_way.append(line)
            loop.call_later(TRANSIT_S, lambda: follower.receive(on_the_way.popleft()))

    control = EmulatorTimeControl(send, ScaledClock(loop.time))

    def link(*args: object) -> ScaledTimeLink:
        made = ScaledTimeLink(robot, loop, *args)  # type: ignore[arg-type]
        made.follower, made.control = follower, control
        links.append(made)
        return made

    monkeypatch.setattr("runtime.cycle.process.Link", link)
    monkeypatch.setattr("runtime.timing.wake.best_timer", LoopTimer)
    monkeypatch.setattr("runtime.cycle.process.apply_realtime", lambda _realtime: ())
    asyncio.set_event_loop(None)
    try:
        yield PausableRun(loop, settings, robot, links, control, follower)
    finally:
        loop.close()
