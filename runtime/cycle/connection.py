"""Connecting before the first cycle, until the robot answers, and halting it after the last one."""

from __future__ import annotations

import asyncio
import errno
import os
from collections.abc import Callable
from typing import Final, NamedTuple

from config.errors import FAILED, UserError
from config.robot import BodyConfig
from drivers.base_model import stop_s
from drivers.driver import LineState, RobotDriver
from drivers.heard_bytes import HeardBytes
from drivers.link import Link
from drivers.messages import Flags
from drivers.serial_port import LinkError, is_missing, open_port, opening_error
from drivers.tcp_port import explain_hang_up, is_tcp
from runtime.cycle.line_messages import ROBOT_LINE, LineMessages
from runtime.cycle.step import STANDSTILL

CONNECT_MAX_S: Final = 5.0
"""Longest wait for the robot's first answer, s; beyond it the run ends with an error."""

ANSWER_TIMEOUT_S: Final = 2.0
"""Least wait, s, also where the driver gave up earlier: a robot may be starting, or its emulator kept waiting."""

UNCONFIRMED_END: Final = "the base did not confirm the halt; if it moves, stop it by its emergency switch"
"""Said at the end of a run."""

POLL_S: Final = 0.005
"""Period of the line's exchanges while no cycle runs, s."""


class Connection(NamedTuple):
    """A line and its driver while no cycle runs."""

    link: Link
    driver: RobotDriver
    send: Callable[[], None]
    clock: Callable[[], float]
    """The run's clock, s."""
    body: BodyConfig
    """How fast the base brakes."""
    line_messages: LineMessages = ROBOT_LINE

    async def connect(self, is_stopping: Callable[[], bool]) -> None:
        """Open the port and wait until the robot is ready, or until the run is ending.

        Raises
        ------
        LinkError
            The port cannot be opened.
        UserError
            The robot does not answer, or answers with errors.
        """
        link, driver = self.link, self.driver
        if not is_stopping():
            await self._open()
        begin_run_s = self.clock()
        while driver.state is not LineState.READY and not is_stopping():
            run_s = self.clock()
            driver.tick(run_s)
            self.send()
            lost = self._why_lost()
            waited_max_s = ANSWER_TIMEOUT_S if driver.state is LineState.DOWN else CONNECT_MAX_S
            if run_s - begin_run_s > waited_max_s or lost is not None:
                no_answer = f"no robot answers on {link.config.port}; check its power and link.baud"
                text = lost or driver.problem or no_answer
                reason = self.line_messages.problem(LineState.CLOSED if lost else driver.state, text)
                await link.stop()
                raise UserError(reason or text, FAILED)
            await asyncio.sleep(POLL_S)

    def _why_lost(self) -> str | None:
        """Return why the line that was opened is closed; None while it is open."""
        if self.link.is_open or self.link.last_error is None:
            return None
        heard = getattr(self.driver, "heard", None)  # not of each driver
        return why_ended(self.link, self.driver, heard if isinstance(heard, HeardBytes) else None)

    def refuse_missing(self) -> None:
        """Raise what `connect` would raise if there is no such port; nothing is opened.

        Raises
        ------
        LinkError
            There is none.
        """
        config = self.link.config
        if self.link.opener is open_port and is_missing(config):
            raise self._worded(opening_error(config, FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))))

    async def _open(self) -> None:
        try:
            await self.link.open_once()
        except LinkError as error:
            raise self._worded(error) from error

    def _worded(self, error: LinkError) -> LinkError:
        """Return the error in the words for what is at the other end of the line."""
        text = self.line_messages.problem(LineState.CLOSED, str(error))
        return error if text in (None, str(error)) else LinkError(text, FAILED)

    async def shut_down(self) -> bool:
        """Halt the base and end the session; return whether the base confirmed that it stopped."""
        is_confirmed = await self._halt()
        self.driver.end_session()
        self.send()
        return is_confirmed

    async def _halt(self) -> bool:
        """Halt the base; return whether it reports a set latch and no motion in its time to answer and brake."""
        self.driver.halt()
        begin_run_s, answer_max_s = self.clock(), self.link.config.answer_max_s
        deadline_run_s = begin_run_s + answer_max_s
        while self.link.is_open and self.clock() < deadline_run_s:
            self.driver.tick(self.clock())
            self.send()
            await asyncio.sleep(POLL_S)
            odometry = self.driver.take_received().odometry
            if odometry is None:
                continue
            if Flags.LATCHED in odometry.flags and odometry.twist == STANDSTILL:
                return True
            deadline_run_s = max(deadline_run_s, begin_run_s + answer_max_s + stop_s(odometry.twist, self.body))
        return False


def why_ended(link: Link, driver: RobotDriver, heard: HeardBytes | None) -> str | None:
    """Return why a line that was opened is closed; None if it was not lost.

    What was heard, if it is known, may show what is at the other end. A connection that its other end ends before any
    frame came may be to another program; any other loss is a loss.
    """
    if heard is not None and heard.stranger is not None:
        return heard.stranger
    port = link.config.port
    if (
        link.last_error is None
        or port is None
        or not is_tcp(port)
        or driver.counts.frames > 0
        or not link.has_hung_up
    ):
        return link.last_error
    return explain_hang_up(port)
