"""A driver and an emulated robot connected in memory, in virtual time.

The caller advances time in short steps, so that commands and answers alternate as on a real line. No call blocks,
and the same seed gives the same run.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias

from drivers.driver import RobotDriver
from drivers.emulator.robot_device import RobotDevice

OnBytes: TypeAlias = Callable[[Literal["in", "out"], float, bytes], None]

STEP_S = 0.005
"""Time between exchanges, s."""


class MemoryLine:
    """The line between `driver` and `robot`.

    Parameters
    ----------
    driver
        The host's end.
    robot
        The robot's end, not yet advanced.
    start_s
        The run's time at the robot's start.
    on_bytes
        Called with the direction as seen from the host, the run's time, and the bytes.
    step_s
        Time between exchanges, s.
    """

    def __init__(
        self, driver: RobotDriver, robot: RobotDevice, start_s: float = 0.0, on_bytes: OnBytes | None = None,
        step_s: float = STEP_S,
    ) -> None:  # fmt: skip
        self._driver = driver
        self._robot = robot
        self._start_s = start_s
        self._step_s = step_s
        self._on_bytes = on_bytes
        self._steps = 0
        self._open = False

    def exchange(self, run_s: float) -> None:
        """Move bytes both ways up to the run's time `run_s`; notify the driver when the line opens and closes."""
        while (self._steps + 1) * self._step_s <= run_s - self._start_s:
            self._steps += 1
            self._exchange_at(self._steps * self._step_s)
        self._exchange_at(run_s - self._start_s)

    def _exchange_at(self, emulated_s: float) -> None:
        """Advance the robot to an emulated time, s, and move what it sent to the driver and the answer back."""
        run_s = self._start_s + emulated_s
        data = self._robot.advance(emulated_s)
        plugged = self._robot.plugged
        if plugged and not self._open:
            self._driver.line_opened(run_s)
        elif self._open and not plugged:
            self._driver.line_closed()
        self._open = plugged
        if not plugged:
            return
        if data:
            self._driver.receive(data, run_s)
        self._driver.tick(run_s)
        answer = self._driver.outgoing(writable=True)
        self._robot.receive(answer)
        if self._on_bytes is not None:
            if data:
                self._on_bytes("in", run_s, data)
            if answer:
                self._on_bytes("out", run_s, answer)
