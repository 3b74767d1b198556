"""How a run begins and ends on its line: the robot has answered before the first cycle, and stands after the last."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final, NamedTuple

from config.errors import FAILED, UserError
from drivers.driver import LineState, RobotDriver
from drivers.link import Link
from drivers.messages import Flags
from runtime.cycle.step import STANDSTILL

CONNECT_MAX_S: Final = 5.0
"""A robot that has not answered properly by then will not without help."""

HALT_MAX_S: Final = 0.5
"""How long the end of a run waits for the base to confirm that it stands."""

TURN_S: Final = 0.005
"""So often the line is looked after while there is no cycle."""


class Connection(NamedTuple):
    """A line and the driver on it, while no cycle looks after them."""

    link: Link
    driver: RobotDriver
    send: Callable[[], None]
    clock: Callable[[], float]

    async def connect(self, is_stopping: Callable[[], bool]) -> None:
        """Open the port and wait until the robot is ready, or until the run is to stop.

        Raises
        ------
        LinkError
            The port cannot be opened.
        UserError
            The robot does not answer, or answers with errors.
        """
        link, driver = self.link, self.driver
        await link.open_once()
        give_up_s = self.clock() + CONNECT_MAX_S
        while driver.state is not LineState.READY and not is_stopping():
            run_s = self.clock()
            driver.tick(run_s)
            self.send()
            lost = None if link.is_open else link.last_error
            if run_s > give_up_s or lost is not None or driver.state is LineState.DOWN:
                await link.stop()
                port = link.config.port
                nobody = f"nothing on {port} answers like the robot: check its power and link.baud"
                raise UserError(lost or driver.problem or nobody, FAILED)
            await asyncio.sleep(TURN_S)

    async def halt(self) -> bool:
        """Halt the base and wait until it stands still; return whether it has said so."""
        self.driver.halt()
        give_up_s = self.clock() + HALT_MAX_S
        while self.link.is_open and self.clock() < give_up_s:
            self.driver.tick(self.clock())
            self.send()
            await asyncio.sleep(TURN_S)
            odometry = self.driver.take_received().odometry
            if odometry is not None and Flags.LATCHED in odometry.flags and odometry.twist == STANDSTILL:
                return True
        return False
