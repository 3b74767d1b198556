"""What ROS may ask of the robot: velocities, goals, arm, disarm and halt, with the rights of a page and its dead-man.

The bridge takes control only when ROS asks for something that needs it, and gives it to a page that asks for it while
ROS drives nothing. A velocity ends with its messages: `timeout_s` after the last one the bridge sends zero; if the
bridge or its connection ends, the run stops the robot within a cycle.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable
from typing import Final

from runtime.bridges.console_client import ConsoleClient, ConsoleError

SEND_MIN_S: Final = 0.02
"""Least time between two velocities sent; of those that arrive in between the newest counts."""
SPEED_MAX, TURN_MAX = 10.0, 20.0
"""Bounds of the protocol, m/s and rad/s; the robot's own limits are lower."""


class Operator:
    """Passes what ROS asks to one connection.

    A velocity ends `timeout_s` after it arrived. `report` gets a line for each refusal of one. The clock is
    monotonic.
    """

    def __init__(
        self, client: ConsoleClient, timeout_s: float, report: Callable[[str], None], clock: Callable[[], float]
    ) -> None:
        self._client = client
        self._timeout_s = timeout_s
        self._report = report
        self._clock = clock
        self._velocity: tuple[float, float] | None = None
        """The newest velocity; None once it has ended."""
        self._arrived_s = -math.inf
        """When it arrived."""
        self._arrived = asyncio.Event()
        """Set when one has arrived that `drive` has not sent."""
        self._refusal = ""
        """The last reason reported; empty after a velocity that was sent."""
        self._has_asked = False
        """Whether ROS has ever asked for what needs control."""

    @property
    def is_driving(self) -> bool:
        """Whether a velocity of ROS is in force."""
        return self._velocity is not None

    def velocity(self, v: float, w: float) -> None:
        """Take a velocity (m/s, rad/s) that has just arrived; `drive` sends it."""
        self._velocity = max(-SPEED_MAX, min(SPEED_MAX, v)), max(-TURN_MAX, min(TURN_MAX, w))
        self._arrived_s = self._clock()
        self._arrived.set()

    async def drive(self) -> None:
        """Send the velocities that arrive, and zero when they end, until cancelled."""
        while True:
            await self._arrived.wait()
            self._arrived.clear()
            velocity = self._velocity
            if velocity is None:
                continue
            try:
                await self._take_control()
                await self._client.request("teleoperate", v=velocity[0], w=velocity[1])
                self._refusal = ""
            except ConsoleError as error:
                self._refuse(str(error))
            await asyncio.sleep(SEND_MIN_S)
            if not self._arrived.is_set():
                await self._wait_or_stop()

    async def _wait_or_stop(self) -> None:
        """Wait for the next velocity; send zero if none arrives in time."""
        left_s = self._arrived_s + self._timeout_s - self._clock()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(max(0.0, left_s)):
                await self._arrived.wait()
        if self._arrived.is_set():
            return
        self._velocity = None
        if self._client.has_control:
            try:
                await self._client.request("teleoperate", v=0.0, w=0.0)
            except ConsoleError as error:
                self._refuse(str(error))
        await self.yield_control()

    def _refuse(self, reason: str) -> None:
        """Report a refusal of a velocity, unless it is the same as the last."""
        if reason != self._refusal:
            self._refusal = reason
            self._report(f"cmd_vel is not carried out: {reason}")

    async def begin(self) -> None:
        """Leave control to the pages until ROS asks for something: the first client of a run has it."""
        if self._client.has_control and not self._has_asked:
            await self._client.request("release_control")

    async def yield_control(self) -> None:
        """Give control to the client that asks for it, unless ROS drives."""
        asking = self._client.asked_by
        if asking is None or self.is_driving or not self._client.has_control:
            return
        self._client.asked_by = None
        try:
            await self._client.request("grant_control", client=asking)
        except ConsoleError as error:
            self._report(str(error))

    async def command(self, name: str) -> str:
        """Carry out `arm`, `disarm` or `halt`, and return what to answer.

        Raises
        ------
        ConsoleError
            The run refuses it.
        """
        if name != "halt":
            await self._take_control()
        await self._client.request(name)
        return {"arm": "the robot is being armed: see the topic `mode`"}.get(name, "done")

    async def goal(self, x: float, y: float, heading_rad: float | None, frame: str) -> None:
        """Drive to a place (m) and, unless None, turn to a heading there; `frame` is odom or map.

        Raises
        ------
        ConsoleError
            The run refuses it.
        """
        await self._take_control()
        degrees = None if heading_rad is None else math.degrees(heading_rad)
        await self._client.request("set_route", waypoints=[[x, y, degrees]], frame=frame)

    async def place(self, x: float, y: float, theta: float) -> None:
        """Say where the robot is in the map.

        Raises
        ------
        ConsoleError
            The run refuses it.
        """
        await self._take_control()
        await self._client.request("place_robot", x=x, y=y, theta=theta)

    async def _take_control(self) -> None:
        """Get control, unless this client has it.

        Raises
        ------
        ConsoleError
            Another client has it.
        """
        self._has_asked = True
        if not self._client.has_control:
            await self._client.request("take_control")
