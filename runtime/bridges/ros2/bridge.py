"""The bridge's process: one connection to a run, one node of ROS, and what passes between them."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, Final

from config.errors import UserError
from runtime.bridges.console_client import ConsoleClient, ConsoleError, stay_connected
from runtime.bridges.ros2.node import BridgeNode
from runtime.bridges.ros2.operator import Operator
from runtime.bridges.ros2.topics import Topics, disconnected

GRID_PERIOD_S: Final = 1.0
NO_MAP: Final = (
    "the run has no map: publish the goal in the frame of odometry, start the run with --map FILE, or load a map on "
    "its page"
)
NO_PLACE: Final = (
    "the robot does not know its place in the map yet: give it one with initialpose, drive until `pose` is published,"
    " or publish the goal in the frame of odometry"
)
NO_RUN: Final = "there is no connection to the run: start it, or look at the bridge's log"


async def run_bridge(find: Callable[[], str], arguments: Sequence[str]) -> None:
    """Bridge a run and ROS until cancelled; connect again whenever the run restarts.

    `find` returns the start URL of the run. Arguments are those of ROS, as `--ros-args -r __ns:=/robot1`.
    """
    bridge = _Bridge(asyncio.get_running_loop())
    node = bridge.node = BridgeNode(arguments, bridge)
    node.publish(disconnected(round(1e9 * node.now_s())), ())
    try:
        await stay_connected(find, bridge.serve, node.warn)
    finally:
        node.close()


async def _ask_for_grid(client: ConsoleClient) -> None:
    """Ask for the evidence grid, again and again, until the connection ends."""
    with contextlib.suppress(ConsoleError):
        while True:
            await asyncio.sleep(GRID_PERIOD_S)
            await client.request("show_grid")


class _Bridge:
    """Fulfils `runtime.bridges.ros2.node.Commands`: passes what ROS asks into the loop."""

    node: BridgeNode

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._operator: Operator | None = None
        self._topics: Topics | None = None
        """Both of the connection; None without one."""
        self._tasks: set[asyncio.Task[None]] = set()

    async def serve(self, client: ConsoleClient) -> None:
        """Serve one connection until it ends."""
        node = self.node
        topics = self._topics = Topics(
            node.frames, max_range_for_silence=node.max_range_for_silence, with_scan=node.publishes_scan
        )
        operator = self._operator = Operator(client, node.timeout_s, node.warn, time.monotonic)
        work = asyncio.gather(operator.drive(), _ask_for_grid(client) if node.publishes_grid else asyncio.sleep(0.0))
        try:
            async for message in client.messages():
                match message["type"]:
                    case "state":
                        host_s = time.monotonic()
                        node.look_around(host_s)
                        frames, outputs = topics.take(message, node.now_s(), host_s, client.polylines)
                        if topics.note is not None:
                            node.warn(topics.note)
                        node.publish(outputs, frames)
                    case "session":
                        topics.begin(message)
                        node.publish_static(topics.static(round(1e9 * node.now_s())))
                        node.info(f"connected to the run of {message['name'] or 'a robot'}")
                        await operator.begin()
                    case "grid":
                        node.publish(topics.grid(message, round(1e9 * node.now_s())), ())
                    case "role":
                        await operator.yield_control()
        finally:
            self._operator = self._topics = None
            node.publish(disconnected(round(1e9 * node.now_s())), ())
            work.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await work

    def velocity(self, v: float, w: float) -> None:
        """Drive at a velocity."""
        self._loop.call_soon_threadsafe(self._velocity, v, w)

    def trigger(self, name: str, done: Callable[[bool, str], None]) -> None:
        """Carry out arm, disarm or halt."""

        async def work() -> None:
            try:
                answer = await self._connected().command(name)
            except UserError as error:
                done(False, str(error))  # noqa: FBT003 - whether it was done
            else:
                done(True, answer)  # noqa: FBT003 - whether it was done

        self._begin(work())

    def goal(self, x: float, y: float, heading_rad: float | None, frame: str) -> None:
        """Drive to a place.

        Refused, with a warning, in the frame `map` while the place in it is not known.
        """

        async def work(operator: Operator) -> None:
            place = None if self._topics is None else self._topics.place
            if frame == "map" and place != "tracking":
                raise UserError(NO_MAP if place is None else NO_PLACE)
            await operator.goal(x, y, heading_rad, frame)

        self._begin(self._reporting("goal_pose", work))

    def place(self, x: float, y: float, theta: float) -> None:
        """Say where the robot is in the map."""
        self._begin(self._reporting("initialpose", lambda operator: operator.place(x, y, theta)))

    async def _reporting(self, topic: str, work: Callable[[Operator], Coroutine[Any, Any, None]]) -> None:
        """Carry out what a topic asks; if it is refused, warn."""
        try:
            await work(self._connected())
        except UserError as error:
            self.node.warn(f"{topic} is not carried out: {error}")

    def _connected(self) -> Operator:
        """Return the operator of the connection.

        Raises
        ------
        ConsoleError
            There is none.
        """
        if self._operator is None:
            raise ConsoleError(NO_RUN)
        return self._operator

    def _velocity(self, v: float, w: float) -> None:
        if self._operator is not None:
            self._operator.velocity(v, w)

    def _begin(self, work: Coroutine[Any, Any, None]) -> None:
        """Run a coroutine in the loop; called in any thread."""

        def start() -> None:
            task = self._loop.create_task(work)
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

        self._loop.call_soon_threadsafe(start)
