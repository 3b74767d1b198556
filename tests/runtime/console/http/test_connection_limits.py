"""The listening port, and the limit on connections that are not websockets yet."""

from __future__ import annotations

import socket

from runtime.console.http.client_limits import Limits
from tests.runtime.console.console_case import open_console


async def test_the_oldest_connection_is_dropped_beyond_the_limit() -> None:
    async with open_console(limits=Limits(connections=8)) as case:
        page = await case.page()
        held = [socket.create_connection(("127.0.0.1", case.url.port or 0)) for _ in range(18)]
        await case.settled(lambda: len(case.refusals()) == 10, "ten refusals")
        assert set(case.refusals()) == {"too many connections: the oldest is dropped"}
        assert (await page.ask(type="halt"))["ok"]
        assert (await case.page()).received[0]["role"] == "watch", "new clients still get in"
        for one in held:
            one.close()


async def test_the_next_free_port_is_used() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        async with open_console(f"console.port={port}") as case:
            assert case.url.port is not None
            assert port < case.url.port <= port + 20
            async with open_console(f"console.port={port}") as another:
                assert another.url.port not in {port, case.url.port}
                assert another.token != case.token
