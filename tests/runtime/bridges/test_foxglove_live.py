"""Foxglove's websocket before a real console: channels, messages, settings shown, and changed only where allowed."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator
from typing import Any

import aiohttp
import orjson
import pytest

from config.errors import UserError
from runtime.bridges.foxglove_live import READ_ONLY, serve_foxglove
from tests.hil.machine import TIMEOUT_S
from tests.runtime.console.console_case import ConsoleCase, open_console


class Viewer:
    """A connection as Foxglove makes it."""

    def __init__(self, connection: aiohttp.ClientWebSocketResponse) -> None:
        self.connection = connection
        self.binary = 0

    async def until(self, op: str) -> dict[str, Any]:
        """Return the next message of a kind."""
        async with asyncio.timeout(TIMEOUT_S):
            while True:
                message = await self.connection.receive()
                if message.type is aiohttp.WSMsgType.BINARY:
                    self.binary += 1
                    if op == "binary":
                        return {}
                elif message.type is aiohttp.WSMsgType.TEXT:
                    content: dict[str, Any] = orjson.loads(message.data)
                    if content["op"] == op:
                        return content
                else:
                    raise AssertionError(message)


@contextlib.asynccontextmanager
async def viewing(case: ConsoleCase, *, allow_set: bool) -> AsyncIterator[Viewer]:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    lines: list[str] = []
    serving = asyncio.create_task(
        serve_foxglove(lambda: case.console.url, "127.0.0.1", port, lines.append, allow_set=allow_set)
    )
    await case.settled(lambda: bool(lines and case.console.hub.clients), "the connection")
    try:
        async with case.session.ws_connect(f"ws://127.0.0.1:{port}", protocols=["foxglove.sdk.v1"]) as connection:
            yield Viewer(connection)
    finally:
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
        await case.settled(lambda: not case.console.hub.clients, "the end of the connection")


async def parameter(viewer: Viewer, path: str) -> Any:
    await viewer.connection.send_json({"op": "getParameters", "parameterNames": [path], "id": "1"})
    answer = await viewer.until("parameterValues")
    while not answer["parameters"]:
        await viewer.connection.send_json({"op": "getParameters", "parameterNames": [path], "id": "1"})
        answer = await viewer.until("parameterValues")
    return next(one["value"] for one in answer["parameters"] if one["name"] == path)


async def test_a_run_is_shown() -> None:
    async with open_console() as case, viewing(case, allow_set=False) as viewer:
        channels: dict[str, int] = {}
        while len(channels) < 8:
            advertised = await viewer.until("advertise")
            channels |= {one["topic"]: one["id"] for one in advertised["channels"]}
        assert {"/tf", "/ring", "/segments", "/models", "/log", "/state"} <= channels.keys()
        await viewer.connection.send_json(
            {"op": "subscribe", "subscriptions": [{"id": 1, "channelId": channels["/state"]}]}
        )

        async def drive() -> None:
            while True:
                case.cycles(1)
                await asyncio.sleep(0.005)

        driving = asyncio.create_task(drive())
        await viewer.until("binary")
        driving.cancel()
        await asyncio.gather(driving, return_exceptions=True)


async def test_a_setting_changes_only_where_that_is_allowed() -> None:
    async with open_console() as case, viewing(case, allow_set=False) as viewer:
        path = next(one["path"] for one in _parameters(case) if one["kind"] == "float" and one["value"])
        before = await parameter(viewer, path)
        change = {"op": "setParameters", "parameters": [{"name": path, "value": before * 0.99}], "id": "2"}
        await viewer.connection.send_json(change)
        assert READ_ONLY in (await viewer.until("status"))["message"]
        assert await parameter(viewer, path) == before
    async with open_console() as case, viewing(case, allow_set=True) as viewer:
        before = await parameter(viewer, path)
        await viewer.connection.send_json(change)
        await case.settled(
            lambda: next(one["value"] for one in _parameters(case) if one["path"] == path) == before * 0.99, "change"
        )


async def test_control_is_kept_only_while_a_setting_changes() -> None:
    async with open_console() as case, viewing(case, allow_set=True) as viewer:
        hub = case.console.hub

        def held() -> bool:
            return any(hub.control.is_held_by(client) for client in hub.clients.values())

        path = next(one["path"] for one in _parameters(case) if one["kind"] == "float" and one["value"])
        await parameter(viewer, path)
        change = {"op": "setParameters", "parameters": [{"name": path, "value": -1e9}], "id": "2"}
        await viewer.connection.send_json(change)
        assert path.rpartition(".")[2] in (await viewer.until("status"))["message"], "refused"
        await case.settled(lambda: not held(), "control back after a refused change")
        page = await case.page()
        assert (await page.ask(type="take_control"))["ok"]
        await viewer.connection.send_json(change)
        assert "has control" in (await viewer.until("status"))["message"]
        case.clock[0] += 11.0
        hub.control.expire(case.clock[0])
        await case.settled(lambda: not held(), "control back that came after the change was given up")
        await page.socket.close()


def _parameters(case: ConsoleCase) -> list[Any]:
    from runtime.console.commands.parameters import parameters

    return list(parameters(case.run.live_settings.current))


async def test_a_port_in_use_is_an_error() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(UserError, match=f"cannot listen on 127.0.0.1, port {port}"):
            await serve_foxglove(lambda: "", "127.0.0.1", port, print, allow_set=False)
