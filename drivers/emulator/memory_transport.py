"""A driver and an emulated robot joined in memory, in virtual time: the whole conversation without a line.

Time goes by as the caller says, in short steps on the way, so that question and answer follow each other as they
would on a real line. Nothing here waits, and one seed gives one run.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias

from drivers.driver import RobotDriver
from drivers.emulator.robot_device import RobotDevice

OnBytes: TypeAlias = Callable[[Literal["in", "out"], float, bytes], None]

STEP_S = 0.005
"""Bytes change hands this often."""


class MemoryLine:
    """The line between `driver` and `robot`.

    Parameters
    ----------
    driver
        The host's end.
    robot
        The robot's end, not yet advanced.
    start_s
        The host's time at which the robot's begins.
    on_bytes
        Gets what changes hands, seen from the host, and when.
    """

    def __init__(
        self, driver: RobotDriver, robot: RobotDevice, start_s: float = 0.0, on_bytes: OnBytes | None = None
    ) -> None:
        self._driver = driver
        self._robot = robot
        self._start_s = start_s
        self._on_bytes = on_bytes
        self._steps = 0
        self._open = False

    def exchange(self, now_s: float) -> None:
        """Move bytes both ways up to the host's time `now_s`; opens and closes the driver as the line does."""
        while (self._steps + 1) * STEP_S <= now_s - self._start_s:
            self._steps += 1
            self._exchange_at(self._steps * STEP_S)
        self._exchange_at(now_s - self._start_s)

    def _exchange_at(self, t_s: float) -> None:
        now_s = self._start_s + t_s
        data = self._robot.advance(t_s)
        plugged = self._robot.plugged
        if plugged and not self._open:
            self._driver.line_opened(now_s)
        elif self._open and not plugged:
            self._driver.line_closed()
        self._open = plugged
        if not plugged:
            return
        if data:
            self._driver.receive(data, now_s)
        self._driver.tick(now_s)
        answer = self._driver.outgoing(writable=True)
        self._robot.receive(answer)
        if self._on_bytes is not None:
            if data:
                self._on_bytes("in", now_s, data)
            if answer:
                self._on_bytes("out", now_s, answer)
