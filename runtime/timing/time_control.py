"""Control of a run's time: pause, resume, single step, speed.

To a run, a paused emulator alone would be a silent robot. So the run's own clock is paused together with it:
`runtime.timing.run_clock` is this process's side, `drivers.emulator.time_channel` the emulator's, and this module
controls both.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from typing import Final, Protocol

from drivers.emulator.time_channel import ACKNOWLEDGED, REFUSED
from drivers.emulator.time_scale import FACTOR_MAX, FACTOR_MIN, TimeScale
from runtime.timing.run_clock import ScaledClock

LEAD_S: Final = 0.02
"""Delay from the request of a pause until time stops, s: by then even a busy emulator has received it."""

ANSWER_MAX_S: Final = 2.0
"""Longest wait for the emulator's acknowledgement, s; beyond it the emulator hangs."""

ENDED: Final = "the emulator has ended, so the run has no robot: start the run again"
HANGS: Final = (
    f"the emulator did not answer within {ANSWER_MAX_S:.0f} s, likely it is stopped or the machine is overloaded; "
    "the run continues in real time"
)
NO_CYCLE: Final = "no cycle has started yet: wait until the robot has answered"
REAL_ROBOT: Final = (
    "the time of a robot on a port cannot be paused: only a run with an emulator of its own (without --port) can be "
    "paused, stepped or sped up"
)


class TimeControl(Protocol):
    """Controls a run's time; every call returns None, or why it failed, in one line."""

    @property
    def is_paused(self) -> bool:
        """Whether time is paused, except for single steps."""

    @property
    def speed(self) -> float:
        """Speed of time while it is not paused: 1 is real time."""

    async def pause(self) -> str | None:
        """Pause the time of robot and run."""

    async def resume(self) -> str | None:
        """Resume time after a pause."""

    async def single_step(self) -> str | None:
        """Advance time by exactly one cycle; pause first if it is not paused."""

    async def set_speed(self, factor: float) -> str | None:
        """Set the speed of time, now or after the pause; 1 is real time."""


class NoTimeControl:
    """The time control of a run with a real robot, whose time cannot be controlled."""

    is_paused = False
    speed = 1.0

    async def pause(self) -> str | None:
        """Return why this is impossible."""
        return REAL_ROBOT

    async def resume(self) -> str | None:
        """Return why this is impossible."""
        return REAL_ROBOT

    async def single_step(self) -> str | None:
        """Return why this is impossible."""
        return REAL_ROBOT

    async def set_speed(self, factor: float) -> str | None:  # noqa: ARG002 - refused whatever it is
        """Return why this is impossible."""
        return REAL_ROBOT


class EmulatorTimeControl:
    """Controls the time of an emulator and of the run on it.

    Parameters
    ----------
    send : callable
        Sends a line to the emulator.
    clock : ScaledClock
        The run's; the process must use the same one.
    """

    def __init__(self, send: Callable[[bytes], None], clock: ScaledClock) -> None:
        self.clock = clock
        self._send = send
        self._lock = asyncio.Lock()
        self._changed = asyncio.Event()
        self._sent = 0
        self._acknowledged = 0
        self._problem: str | None = None
        clock.send = self._send_time_scale
        clock.on_change(self._changed.set)

    @property
    def is_paused(self) -> bool:
        """Whether time is paused, except for single steps."""
        return self.clock.is_paused

    @property
    def speed(self) -> float:
        """Speed of time while it is not paused: 1 is real time."""
        return self.clock.factor

    def has_ended(self) -> bool:
        """Return whether the emulator has ended."""
        return self._problem == ENDED

    async def pause(self) -> str | None:
        """Pause the time of robot and run."""
        async with self._lock:
            return await self._pause()

    async def resume(self) -> str | None:
        """Resume time after a pause."""
        async with self._lock:
            return await self._resume() if self.is_paused else self._problem

    async def single_step(self) -> str | None:
        """Advance time by exactly one cycle; pause first if it is not paused."""
        async with self._lock:
            if (problem := await self._pause()) is not None:
                return problem
            self.clock.step()
            ahead_s = max(0.0, self.clock.time_scale.until_s - self.clock()) / self.clock.factor
            return await self._wait(lambda: self.clock.is_still, ahead_s)

    async def set_speed(self, factor: float) -> str | None:
        """Set the speed of time, now or after the pause; 1 is real time."""
        if not FACTOR_MIN <= factor <= FACTOR_MAX:
            return f"the speed must be from {FACTOR_MIN:g} to {FACTOR_MAX:g} times real time, not {factor:g}"
        async with self._lock:
            was_running = not self.is_paused
            if was_running and factor == self.speed:
                return self._problem
            if (problem := await self._pause()) is not None:
                return problem
            self.clock.factor = factor
            return await self._resume() if was_running else None

    def receive(self, line: bytes) -> None:
        """Process a line from the emulator."""
        match line.decode(errors="replace").split():
            case [word, number, run_s] if word == ACKNOWLEDGED and number.isdecimal():
                with contextlib.suppress(ValueError):
                    self.clock.acknowledged(float(run_s))
                    self._acknowledged = int(number)
            case [word, *why] if word == REFUSED:
                self._problem = f"the emulator refuses: {' '.join(why)}: a program error"
        self._changed.set()

    def emulator_ended(self) -> None:
        """Fail all pending requests, and continue in real time without the emulator."""
        self._problem = ENDED
        self.clock.release()
        self._changed.set()

    async def _pause(self) -> str | None:
        """Pause unless time is paused, and wait until run and emulator stand; return why that failed, or None."""
        if self._problem is not None:
            return self._problem
        if not self.clock.has_cycles:
            return NO_CYCLE
        if not self.clock.is_paused:
            self.clock.pause(LEAD_S)
        return await self._wait(lambda: self.clock.is_still, LEAD_S)

    async def _resume(self) -> str | None:
        self.clock.resume()
        number = self._sent
        return await self._wait(lambda: self._acknowledged >= number)

    async def _wait(self, done: Callable[[], bool], ahead_s: float = 0.0) -> str | None:
        """Wait until the emulator has followed; otherwise release time, so that the run detects the fault."""
        try:
            async with asyncio.timeout(ANSWER_MAX_S + ahead_s):
                while self._problem is None and not done():
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError:
            self.clock.release()
            return HANGS
        return self._problem

    def _send_time_scale(self, time_scale: TimeScale) -> None:
        self._sent += 1
        if self._problem is None:
            self._send(time_scale.encode(self._sent))
