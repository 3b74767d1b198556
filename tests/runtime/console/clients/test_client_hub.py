"""Messages to all clients: session information and lines of the log."""

from __future__ import annotations

import asyncio

from tests.runtime.console.console_case import open_console


async def test_a_client_that_joins_before_the_robot_answers_gets_its_name_later() -> None:
    async with open_console() as case:
        case.run.name = None
        page = await case.page()
        assert page.received[0]["name"] is None
        case.run.name = "denning"
        case.cycles()
        assert (await page.next("session"))["name"] == "denning"


async def test_log_lines_also_reach_later_clients() -> None:
    async with open_console() as case:
        page = await case.page()
        case.console.hub.on_log({"event": "mode", "level": "info", "timestamp": "now", "mode": "READY", "cycle": 3})
        line = await page.next("log")
        assert line == {"type": "log", "timestamp": "now", "level": "info", "event": "mode",
                        "fields": {"mode": "READY", "cycle": "3"}}  # fmt: skip
        later = await case.connect()
        assert await later.next("log") == line
        await asyncio.to_thread(case.console.hub.on_log, {"event": "from a thread", "level": "warning"})
        assert (await page.next("log"))["event"] == "from a thread"
