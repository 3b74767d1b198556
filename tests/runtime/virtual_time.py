"""The whole main process in virtual time: its own loop, scheduler, modes and driver, on an emulated robot in memory.

The loop never waits: where it would, the clock advances. Only the line and the kernel's timer are replaced. A test
simulates work by advancing the clock.
"""

from __future__ import annotations

import asyncio
import contextlib
import selectors
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from config.load import load_settings
from config.robot import LinkConfig
from config.settings import Settings
from drivers.emulator.faults import Fault
from drivers.emulator.robot_device import RobotDevice
from drivers.registry import make_device
from runtime.timing.wake import LoopTimer

STEP_S = 0.005
REOPEN_S = 0.05


class _Selector(selectors.SelectSelector):
    """Advances the clock instead of waiting."""

    def __init__(self) -> None:
        super().__init__()
        self.host_s = 100.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready = super().select(0.0)
        if not ready:
            assert timeout is not None, "nothing will ever happen again"
            self.host_s += max(0.0, timeout)
        return ready


class VirtualLoop(asyncio.SelectorEventLoop):
    """A loop whose clock is its selector's."""

    def __init__(self) -> None:
        self.clock_of = _Selector()
        super().__init__(self.clock_of)
        # Otherwise the loop waits forever for a moment that rounding puts just after the clock's.
        self._clock_resolution = 1e-7

    def time(self) -> float:
        return self.clock_of.host_s

    def spend(self, seconds: float) -> None:
        """Advance the clock as if a callback had blocked the loop."""
        self.clock_of.host_s += seconds


class MemoryLink:
    """In place of `drivers.link.Link`: the other end is an emulated robot, and its cable can be pulled."""

    def __init__(
        self,
        robot: RobotDevice,
        loop: VirtualLoop,
        config: LinkConfig,
        on_opened: Callable[[], None],
        on_data: Callable[[bytes], None],
        on_closed: Callable[[str], None],
    ) -> None:
        self.config = config
        self.is_open = False
        self.last_error: str | None = None
        self.opener = None
        self.plugged = True
        self.opened_s = 0.0
        self._robot = robot
        self._loop = loop
        self._begin_s = loop.time()
        self._calls = (on_opened, on_data, on_closed)
        self._turn: asyncio.TimerHandle | None = None
        self._arrived = b""
        self._held_until_s = 0.0

    @property
    def writable(self) -> bool:
        return self.is_open

    def send(self, data: bytes) -> bool:
        self._arrived += self.live()
        self._robot.receive(data)
        return True

    def set_baud(self, baud: int | None) -> None: ...

    def hold(self, seconds: float) -> None:
        self._held_until_s = self._loop.time() + seconds

    def release(self) -> None:
        self._held_until_s = 0.0

    async def open_once(self) -> None:
        if not self.is_open and self.plugged:
            self.is_open = True
            self._arrived = b""
            self.opened_s = self._loop.time()
            self._calls[0]()
            self._turn = self._loop.call_later(STEP_S, self._exchange)

    async def run(self) -> None:
        try:
            while True:
                await self.open_once()
                await asyncio.sleep(REOPEN_S)
        finally:
            await self.stop()

    async def stop(self) -> None:
        self.is_open = False
        if self._turn is not None:
            self._turn.cancel()

    def pull(self) -> None:
        """Pull the cable out."""
        self.plugged = self.is_open = False
        if self._turn is not None:
            self._turn.cancel()
        self.last_error = "pulled out"
        self._calls[2]("pulled out")

    def plug(self) -> None:
        """Plug it in again; it is opened again soon."""
        self.plugged = True

    def live(self) -> bytes:
        """Advance the robot to now, and return what it sent."""
        return self._robot.advance(self._loop.time() - self._begin_s)

    def _exchange(self) -> None:
        if self.is_open:
            self._turn = self._loop.call_later(STEP_S, self._exchange)
            self._arrived += self.live()
            if self._arrived and self._loop.time() >= self._held_until_s:
                data, self._arrived = self._arrived, b""
                self._calls[1](data)


@contextlib.contextmanager
def in_virtual_time(
    monkeypatch: pytest.MonkeyPatch, *sets: str, faults: tuple[Fault, ...] = (), robot_file: str = "denning"
) -> Iterator[tuple[VirtualLoop, Settings, RobotDevice, list[MemoryLink]]]:
    """Give a loop in which `RobotProcess` runs on a robot in memory; the list will hold its link."""
    settings = load_settings("hallway", ["link.port=memory", *sets], robot=robot_file)
    assert settings.world is not None
    loop, links = VirtualLoop(), list[MemoryLink]()
    robot = make_device(settings, settings.world, 3, faults=faults)

    def link(*args: Any) -> MemoryLink:
        links.append(MemoryLink(robot, loop, *args))
        return links[-1]

    monkeypatch.setattr("runtime.cycle.process.Link", link)
    monkeypatch.setattr("runtime.timing.wake.best_timer", LoopTimer)
    monkeypatch.setattr("runtime.cycle.process.apply_realtime", lambda _realtime: ())
    try:
        yield loop, settings, robot, links
    finally:
        loop.close()
