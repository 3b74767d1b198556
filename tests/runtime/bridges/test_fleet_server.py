"""The server of the fleet page: its token, its headers, and what it carries out."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable

import aiohttp
import pytest
from yarl import URL

from config.errors import UserError
from runtime.bridges.fleet import Fleet
from runtime.bridges.fleet_server import TOKEN_HEADER, serve_fleet

RUN = "http://127.0.0.1:1/?token=secret"


def served(test: Callable[[aiohttp.ClientSession, URL, Fleet], Awaitable[None]]) -> None:
    async def body() -> None:
        lines: asyncio.Queue[str] = asyncio.Queue()
        fleet = Fleet(lambda: 0.0, list)
        serving = asyncio.create_task(serve_fleet(fleet, "127.0.0.1", 0, [RUN], lines.put_nowait))
        url = URL((await lines.get()).removeprefix("fleet: "))
        try:
            async with aiohttp.ClientSession() as session:
                await test(session, url, fleet)
        finally:
            serving.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await serving

    asyncio.run(body())


def test_the_page_needs_no_token_and_the_rest_does() -> None:
    async def body(session: aiohttp.ClientSession, url: URL, _fleet: Fleet) -> None:
        page = await session.get(url)
        assert "HALT all" in await page.text()
        assert page.headers["X-Frame-Options"] == "DENY"
        assert (await session.get(url.with_path("/runs"))).status == 403
        rows = await session.get(url.with_path("/runs"), headers={TOKEN_HEADER: url.query["token"]})
        assert [row["address"] for row in await rows.json()] == ["127.0.0.1:1"]
        assert "secret" not in await rows.text()
        assert (await session.get(url.with_path("/runs"), headers={"Host": "evil.example"})).status == 421

    served(body)


def test_commands_need_the_page_s_own_origin() -> None:
    async def body(session: aiohttp.ClientSession, url: URL, fleet: Fleet) -> None:
        async def post(path: str, origin: str, **content: object) -> int:
            headers = {TOKEN_HEADER: url.query["token"], "Origin": origin}
            return (await session.post(url.with_path(path), json=content, headers=headers)).status

        own = str(url.origin())
        assert await post("/halt", "http://evil.example", address=None) == 404
        assert fleet.rows()[0]["halt"] == "none"
        assert await post("/halt", own, address=None) == 200
        assert fleet.rows()[0]["halt"] == "sent"
        assert await post("/halt", own) == 400
        assert await post("/halt", own, address=5) == 404
        assert await post("/add", own, url="http://127.0.0.1:2/") == 409
        assert await post("/add", own, url="http://127.0.0.1:2/?token=x") == 200
        assert await post("/remove", own, address="127.0.0.1:1") == 200
        assert [row["address"] for row in fleet.rows()] == ["127.0.0.1:2"]

    served(body)


def test_an_address_of_another_computer_is_named() -> None:
    with pytest.raises(UserError, match=r"cannot listen on 192\.0\.2\.1, port 0"):
        asyncio.run(serve_fleet(Fleet(lambda: 0.0, list), "192.0.2.1", 0, [], print))


def test_a_wrong_url_is_refused() -> None:
    fleet = Fleet(lambda: 0.0, list)
    with pytest.raises(UserError, match="give the start URL"):
        asyncio.run(serve_fleet(fleet, "127.0.0.1", 0, ["http://host/"], print))
