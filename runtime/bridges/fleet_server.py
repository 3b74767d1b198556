"""The web server of the fleet page: one page for several runs, on this machine only unless another host is given.

The runs' tokens stay in this process. The page has a token of the fleet's own, in its address as a run's page has.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from typing import Any, Final

import orjson
from aiohttp import web

from config.errors import WRONG_CALL, UserError
from runtime.bridges.fleet import Fleet
from runtime.console.http.auth import Auth, new_token, url_host
from runtime.console.http.server import local_address
from runtime.console.http.static_files import page_files, security_headers

TOKEN_HEADER: Final = "X-Echolocate-Token"  # noqa: S105 - the name of a header
BODY_MAX: Final = 4096
PAGE: Final = "/page/fleet.html"


async def serve_fleet(fleet: Fleet, host: str, port: int, urls: Sequence[str], tell: Callable[[str], None]) -> None:
    """Serve the page until cancelled.

    Port 0 takes any that is free. `urls` are start URLs of runs on other machines; `tell` gets the page's own in a
    line.

    Raises
    ------
    UserError
        A URL is wrong, or it cannot listen there.
    """
    for url in urls:
        if (problem := fleet.add(url)) is not None:
            raise UserError(f"{url.partition('?')[0]}: {problem}", WRONG_CALL)
    handler = _Handler(fleet)
    server = web.Server(handler.answer, access_log=None)
    try:
        listening = await asyncio.get_running_loop().create_server(server, host, port)
    except OSError as error:
        raise UserError(
            f"cannot listen on {host}, port {port}: {error.strerror or error}; give an address of this machine with "
            f"--host, or another --port"
        ) from error
    port = listening.sockets[0].getsockname()[1]
    handler.auth = Auth(new_token(), (host,), port)
    tell(f"fleet: http://{url_host(host)}:{port}/?token={handler.auth.token}")
    watching = asyncio.create_task(fleet.watch_local(), name="local runs")
    try:
        await asyncio.get_running_loop().create_future()
    finally:
        watching.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await watching
        listening.close()
        await fleet.close()
        await server.shutdown(1.0)


class _Handler:
    """Answers the requests of the fleet page."""

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet
        self._files = page_files()
        self.auth = Auth(new_token(), (), 0)

    async def answer(self, request: web.BaseRequest) -> web.StreamResponse:
        """Return the response to a request, with its headers."""
        host = request.headers.get("Host", "")
        if self.auth.host_error(host, local_address(request)) is not None:
            return web.Response(status=421, text="this is not the address of the fleet page")
        response = await self._respond(request, host)
        response.headers.update(security_headers(host))
        return response

    async def _respond(self, request: web.BaseRequest, host: str) -> web.Response:
        """Return the response to a request whose Host is right; all but the page's files need the token."""
        path = PAGE if request.path == "/" else request.path
        if request.method == "GET" and (file := self._files.get(path)) is not None:
            return web.Response(body=file.body, headers={"Content-Type": file.content_type})
        if not self.auth.accepts(request.headers.get(TOKEN_HEADER, "")):
            return web.Response(status=403, text="a wrong token: open the address that `echolocate fleet` printed")
        if request.method == "GET" and path == "/runs":
            return _json(self._fleet.rows())
        if request.method == "POST" and self.auth.origin_error(request.headers.get("Origin"), host) is None:
            return await self._act(path, request)
        return web.Response(status=404, text="there is no such page")

    async def _act(self, path: str, request: web.BaseRequest) -> web.Response:
        """Carry out HALT, or a change of the list."""
        try:
            given = orjson.loads(await request.content.read(BODY_MAX))
            text = given["address"] if path != "/add" else given["url"]
        except (ValueError, TypeError, KeyError):
            return web.Response(status=400, text="malformed request")
        if path == "/halt" and (text is None or isinstance(text, str)):
            return _json({"asked": self._fleet.halt(text)})
        if path == "/remove" and isinstance(text, str):
            self._fleet.remove(text)
            return _json({})
        if path == "/add" and isinstance(text, str):
            problem = self._fleet.add(text.strip())
            return _json({}) if problem is None else web.Response(status=409, text=problem)
        return web.Response(status=404, text="there is no such command")


def _json(content: Any) -> web.Response:  # noqa: ANN401 - any JSON value
    return web.Response(body=orjson.dumps(content), content_type="application/json")
