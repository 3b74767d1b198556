"""ROS has the rights of a page and no more, and its velocities end with its messages."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator
from typing import Any

import pytest

from runtime.bridges.console_client import ConsoleError
from runtime.bridges.ros2.operator import Operator
from tests.hil.machine import TIMEOUT_S


class FakeClient:
    """A connection that keeps every command, and refuses those named in `refused`."""

    def __init__(self, *, has_control: bool = False) -> None:
        self.has_control = has_control
        self.asked_by: int | None = None
        self.sent: list[tuple[str, Any]] = []
        self.refused: dict[str, str] = {}

    async def request(self, command: str, **arguments: Any) -> None:
        self.sent.append((command, tuple(arguments.values())))
        if command in self.refused:
            raise ConsoleError(self.refused[command])
        if command in {"take_control", "release_control", "grant_control"}:
            self.has_control = command == "take_control"


@contextlib.asynccontextmanager
async def driving(client: FakeClient, lines: list[str]) -> AsyncIterator[Operator]:
    clock = asyncio.get_running_loop().time
    operator = Operator(client, 0.03, lines.append, clock)  # type: ignore[arg-type]
    task = asyncio.create_task(operator.drive())
    yield operator
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


async def until(client: FakeClient, command: str, arguments: tuple[Any, ...]) -> None:
    async with asyncio.timeout(TIMEOUT_S):
        while (command, arguments) not in client.sent:
            await asyncio.sleep(0.001)


async def test_a_velocity_takes_control_is_sent_and_ends_by_itself() -> None:
    client, lines = FakeClient(), list[str]()
    async with driving(client, lines) as operator:
        operator.velocity(0.3, 0.1)
        was_driving = operator.is_driving
        await until(client, "teleoperate", (0.0, 0.0))
    assert client.sent == [("take_control", ()), ("teleoperate", (0.3, 0.1)), ("teleoperate", (0.0, 0.0))]
    assert (was_driving, operator.is_driving) == (True, False)
    assert lines == []


async def test_only_the_newest_velocity_is_sent_and_none_beyond_the_bounds() -> None:
    client = FakeClient(has_control=True)
    async with driving(client, []) as operator:
        operator.velocity(0.1, 0.0)
        operator.velocity(1e9, -1e9)
        await until(client, "teleoperate", (0.0, 0.0))
    assert client.sent == [("teleoperate", (10.0, -20.0)), ("teleoperate", (0.0, 0.0))]


async def test_a_refused_velocity_is_reported_once() -> None:
    client, lines = FakeClient(), list[str]()
    client.refused["take_control"] = "client 1 has control and was asked for it"
    async with driving(client, lines) as operator:
        for _ in range(3):
            operator.velocity(0.1, 0.0)
            client.sent.clear()
            await until(client, "take_control", ())
            await asyncio.sleep(0.025)
    assert lines == ["cmd_vel is not carried out: client 1 has control and was asked for it"]


async def test_control_is_left_to_pages_until_ros_asks_and_given_to_a_page_that_asks() -> None:
    client = FakeClient(has_control=True)
    operator = Operator(client, 0.1, [].append, lambda: 0.0)  # type: ignore[arg-type]
    await operator.begin()
    assert client.sent == [("release_control", ())]
    await operator.command("arm")
    assert client.sent[1:] == [("take_control", ()), ("arm", ())]
    client.asked_by = 4
    operator.velocity(0.1, 0.0)
    await operator.yield_control()
    assert client.has_control, "a robot that is driven is not handed over"
    operator._velocity = None
    await operator.yield_control()
    assert client.sent[-1] == ("grant_control", (4,))


async def test_a_halt_needs_no_control() -> None:
    client = FakeClient()
    client.refused["take_control"] = "client 1 has control"
    operator = Operator(client, 0.1, [].append, lambda: 0.0)  # type: ignore[arg-type]
    assert await operator.command("halt") == "done"
    assert client.sent == [("halt", ())]
    with pytest.raises(ConsoleError, match="client 1"):
        await operator.command("arm")


async def test_a_goal_is_a_route_of_one_place() -> None:
    client = FakeClient(has_control=True)
    operator = Operator(client, 0.1, [].append, lambda: 0.0)  # type: ignore[arg-type]
    await operator.goal(1.0, 2.0, 0.5 * math.pi, "map")
    await operator.goal(1.0, 2.0, None, "odom")
    await operator.place(1.0, 2.0, 0.3)
    assert client.sent == [
        ("set_route", ([[1.0, 2.0, 90.0]], "map")),
        ("set_route", ([[1.0, 2.0, None]], "odom")),
        ("place_robot", (1.0, 2.0, 0.3)),
    ]
