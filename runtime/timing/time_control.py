"""The time of a run in somebody's hands: paused, stepped by one cycle, faster, slower.

Pausing the emulator alone would be a robot that has gone silent. So the run's own clock is held together with it:
`runtime.timing.run_clock` is this process's side of that, `drivers.emulator.time_channel` the emulator's, and here is who asks
both.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from typing import Final, Protocol

from drivers.emulator.time_channel import ACKNOWLEDGED, REFUSED
from drivers.emulator.time_scale import FACTOR_MAX, FACTOR_MIN, TimeScale
from runtime.timing.run_clock import PacedClock

LEAD_S: Final = 0.02
"""Time is held so much later than it is asked for: by then the emulator knows of it, however it was busy."""

ANSWER_MAX_S: Final = 2.0
"""An emulator that has not answered by then hangs."""

GONE: Final = "the emulator has ended: what is left of the run is without a robot; start it again"
HANGS: Final = (
    f"the emulator did not answer within {ANSWER_MAX_S:.0f} s, likely it is stopped or the machine is overloaded; "
    "time goes on freely"
)
NO_CYCLE: Final = "no cycle has begun yet: wait until the robot has answered"
NOT_OURS: Final = (
    "the time of a robot on a port cannot be held: only a run with an emulator of its own (without --port) can be "
    "paused, stepped or sped up"
)


class TimeControl(Protocol):
    """Holds a run's time; every call returns None, or why it cannot be done, in one line."""

    @property
    def is_paused(self) -> bool:
        """Whether time stands still but for single steps."""

    @property
    def speed(self) -> float:
        """How fast time goes while it is not paused: 1 is real time."""

    async def pause(self) -> str | None:
        """Let time stand still, for the robot and for the run alike."""

    async def resume(self) -> str | None:
        """Let time go on."""

    async def single_step(self) -> str | None:
        """Let time go on for exactly one cycle; pauses first where it is not paused."""

    async def set_speed(self, factor: float) -> str | None:
        """Let time go by faster or slower, now or when it goes on."""


class NoTimeControl:
    """What there is for a real robot, whose time nobody holds."""

    is_paused = False
    speed = 1.0

    async def pause(self) -> str | None:
        """Say why not."""
        return NOT_OURS

    async def resume(self) -> str | None:
        """Say why not."""
        return NOT_OURS

    async def single_step(self) -> str | None:
        """Say why not."""
        return NOT_OURS

    async def set_speed(self, factor: float) -> str | None:  # noqa: ARG002 - refused whatever it is
        """Say why not."""
        return NOT_OURS


class EmulatorControl:
    """Holds the time of an emulator and of the run on it.

    Parameters
    ----------
    send : callable
        Puts a line on the way to the emulator.
    clock : PacedClock
        The run's; it is what the process must be given.
    """

    def __init__(self, send: Callable[[bytes], None], clock: PacedClock) -> None:
        self.clock = clock
        self._send = send
        self._lock = asyncio.Lock()
        self._news = asyncio.Event()
        self._number = 0
        self._answered = 0
        self._trouble: str | None = None
        clock.tell = self._tell
        clock.listen(self._news.set)

    @property
    def is_paused(self) -> bool:
        """Whether time stands still but for single steps."""
        return self.clock.is_held

    @property
    def speed(self) -> float:
        """How fast time goes while it is not paused: 1 is real time."""
        return self.clock.factor

    async def pause(self) -> str | None:
        """Let time stand still, for the robot and for the run alike."""
        async with self._lock:
            return await self._hold()

    async def resume(self) -> str | None:
        """Let time go on."""
        async with self._lock:
            return await self._go() if self.is_paused else self._trouble

    async def single_step(self) -> str | None:
        """Let time go on for exactly one cycle; pauses first where it is not paused."""
        async with self._lock:
            if (why := await self._hold()) is not None:
                return why
            self.clock.step()
            ahead_s = max(0.0, self.clock.pace.until_s - self.clock()) / self.clock.factor
            return await self._wait(lambda: self.clock.is_still, ahead_s)

    async def set_speed(self, factor: float) -> str | None:
        """Let time go by faster or slower, now or when it goes on."""
        if not FACTOR_MIN <= factor <= FACTOR_MAX:
            return f"the speed must be from {FACTOR_MIN:g} to {FACTOR_MAX:g} times real time, not {factor:g}"
        async with self._lock:
            goes_on = not self.is_paused
            if goes_on and factor == self.speed:
                return self._trouble
            if (why := await self._hold()) is not None:
                return why
            self.clock.factor = factor
            return await self._go() if goes_on else None

    def heard(self, line: bytes) -> None:
        """Take a line from the emulator."""
        match line.decode(errors="replace").split():
            case [word, number, run_s] if word == ACKNOWLEDGED and number.isdecimal():
                with contextlib.suppress(ValueError):
                    self.clock.lived(float(run_s))
                    self._answered = int(number)
            case [word, *why] if word == REFUSED:
                self._trouble = f"the emulator refuses: {' '.join(why)}: a fault of the program"
        self._news.set()

    def gone(self) -> None:
        """Take note that the emulator has ended: whoever waits for it is told, and time goes on without it."""
        self._trouble = GONE
        self.clock.release()
        self._news.set()

    async def _hold(self) -> str | None:
        if self._trouble is not None:
            return self._trouble
        if not self.clock.has_beat:
            return NO_CYCLE
        if not self.clock.is_held:
            self.clock.hold(LEAD_S)
        return await self._wait(lambda: self.clock.is_still, LEAD_S)

    async def _go(self) -> str | None:
        self.clock.go()
        number = self._number
        return await self._wait(lambda: self._answered >= number)

    async def _wait(self, done: Callable[[], bool], ahead_s: float = 0.0) -> str | None:
        """Wait until the emulator has followed; where it does not, let time go: the run will see what is wrong."""
        try:
            async with asyncio.timeout(ANSWER_MAX_S + ahead_s):
                while self._trouble is None and not done():
                    self._news.clear()
                    await self._news.wait()
        except TimeoutError:
            self.clock.release()
            return HANGS
        return self._trouble

    def _tell(self, pace: TimeScale) -> None:
        self._number += 1
        if self._trouble is None:
            self._send(pace.encode(self._number))
