"""The web server gives the files of a fixed list and a websocket to clients with the token; it refuses the rest."""

from __future__ import annotations

import asyncio
import contextlib
import random

import aiohttp
import orjson
import pytest
from aiohttp import WSServerHandshakeError

from runtime.console.http import server
from runtime.console.http.client_limits import Limits
from runtime.cycle.inputs import Request
from tests.hil.machine import TIMEOUT_S
from tests.runtime.console.console_case import ConsoleCase, open_console


async def refused(case: ConsoleCase, **how: str | None) -> tuple[int, str]:
    """Connect a page that is refused; return the status and the logged reason."""
    before = len(case.refusals())
    with pytest.raises(WSServerHandshakeError) as caught:
        await case.connect(**how)
    assert len(case.refusals()) == before + 1
    assert case.token not in case.refusals()[-1]
    return caught.value.status, case.refusals()[-1]


async def test_the_page_and_its_headers() -> None:
    async with open_console() as case, case.session.get(case.url) as answer:
        assert answer.status == 200
        assert answer.content_type == "text/html"
        headers = answer.headers
        assert headers["Content-Security-Policy"].startswith("default-src 'self'; ")
        assert headers["Cache-Control"] == "no-store"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert case.token not in await answer.text()


RAW = ["/page/../console.py", "/page/%2e%2e/console.py", "/page/..%2fconsole.py", "/../../etc/passwd", "//etc/passwd",
       "/page/", "/page", "/page/index.html%00.js", "/page/index.html/", "/runtime/console/page/index.html",
       "/page/\\..\\console.py", "/.git/config", "/page//index.html", "/ws/", "/page/./console.py"]  # fmt: skip


async def raw(case: ConsoleCase, *lines: str) -> bytes:
    """Send a request unchanged; return the answer, empty if the connection was dropped."""
    reader, writer = await asyncio.open_connection("127.0.0.1", case.url.port)
    try:
        writer.write("".join(f"{line}\r\n" for line in (*lines, "")).encode("latin-1", "replace"))
        return await asyncio.wait_for(reader.read(), TIMEOUT_S)
    except ConnectionError:
        return b""
    finally:
        writer.close()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()


@pytest.mark.parametrize("path", RAW)
async def test_no_path_escapes_the_folder(path: str) -> None:
    async with open_console() as case:
        answer = await raw(case, f"GET {path} HTTP/1.1", f"Host: 127.0.0.1:{case.url.port}")
        assert answer.startswith((b"HTTP/1.1 404", b"HTTP/1.1 400"))


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "HEAD", "TRACE", "CONNECT"])
async def test_only_get_is_allowed(method: str) -> None:
    async with open_console() as case:
        answer = await raw(case, f"{method} / HTTP/1.1", f"Host: 127.0.0.1:{case.url.port}")
        assert answer.startswith(b"HTTP/1.1 4")


@pytest.mark.parametrize("host", ["evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:80", ""])
async def test_a_foreign_host_is_refused(host: str) -> None:
    """As after DNS rebinding, when a foreign name resolves to this address."""
    async with open_console() as case:
        name = host.format(port=case.url.port)
        answer = await raw(case, "GET / HTTP/1.1", f"Host: {name}")
        assert answer.startswith(b"HTTP/1.1 421")
        assert "is not this console's" in case.refusals()[-1]
        status, _ = await refused(case, host=name or "x")
        assert status == 421


async def test_localhost_is_accepted() -> None:
    async with open_console() as case:
        name = f"localhost:{case.url.port}"
        page = await case.connect(host=name, origin=f"http://{name}")
        assert (await page.next("session"))["role"] == "control"


@pytest.mark.parametrize("token", [None, "wrong", "%00", "x" * 5000])
async def test_a_wrong_or_missing_token_is_refused(token: str | None) -> None:
    async with open_console() as case:
        assert await refused(case, token=token) == (403, "a wrong token, or none")
        for path in ("/log", "/recording", "/made", "/ws"):
            async with case.session.get(case.url.with_path(path).with_query({"token": token or ""})) as answer:
                assert answer.status == 403


@pytest.mark.parametrize(
    "origin", [None, "http://evil.example", "null", "http://127.0.0.1:1", "https://127.0.0.1:{port}"]
)
async def test_a_foreign_origin_is_refused(origin: str | None) -> None:
    async with open_console() as case:
        given = None if origin is None else origin.format(port=case.url.port)
        status, why = await refused(case, origin=given)
        assert status == 403
        assert why.startswith("Origin ")


async def test_a_client_without_token_may_be_allowed_to_watch_only() -> None:
    async with open_console("console.watch_without_token=true") as case:
        page = await case.connect(token=None)
        session = await page.next("session")
        assert session["role"] == "watch"
        assert session["has_token"] is False
        for kind in ("halt", "arm", "take_control", "undo_parameter", "save_toml", "list_recordings"):
            answer = await page.ask(type=kind)
            assert not answer["ok"]
            assert "may only watch" in answer["error"]
        assert case.run.asked == []
        case.cycles()
        assert (await page.next("state"))["cycle"] == 1
        assert await refused(case, token="wrong") == (403, "a wrong token, or none")
        assert "token=" not in orjson.dumps(page.received).decode()
        assert case.token not in orjson.dumps(page.received).decode()


async def test_only_the_log_has_the_token() -> None:
    async with open_console() as case:
        line = next(line for line in case.log if line["event"] == "console")
        assert line["start_url"] == str(case.url)
        assert case.token not in str(line["url"])
        case.console.hub.on_log({"event": "robot ready", "level": "info", "port": "/dev/x"})
        async with case.session.get(case.url.with_path("/log", keep_query=True)) as answer:
            assert answer.status == 200
            assert orjson.loads(await answer.read())["fields"] == {"port": "/dev/x"}
        async with case.session.get(case.url.with_path("/ws", keep_query=True)) as answer:
            assert answer.status == 426


async def test_a_message_too_long_closes_the_connection() -> None:
    async with open_console() as case:
        page = await case.page()
        await page.socket.send_str("x" * 65_537)
        assert await page.closed() == aiohttp.WSCloseCode.MESSAGE_TOO_BIG
        await case.settled(lambda: any("a malformed message" in why for why in case.refusals()), "a refusal")


async def test_the_longest_valid_message() -> None:
    async with open_console() as case:
        page = await case.page()
        await page.socket.send_str(" " * (65_536 - 24) + '{"id": 7, "type":"halt"}')
        assert (await page.answer(7))["ok"]


async def test_a_binary_message_closes_the_connection() -> None:
    async with open_console() as case:
        page = await case.page()
        await page.socket.send_bytes(b'{"id":1,"type":"halt"}')
        assert await page.closed() == aiohttp.WSCloseCode.UNSUPPORTED_DATA
        assert case.run.asked == []


async def test_too_many_messages_close_the_connection_but_a_halt_counts() -> None:
    async with open_console(limits=Limits(messages_per_s=50.0)) as case:
        page = await case.page()
        for _ in range(50):
            await page.send(type="take_control")
        await page.send(type="halt")
        await page.send(type="halt")
        assert await page.closed() == aiohttp.WSCloseCode.POLICY_VIOLATION
        assert case.run.asked == [Request.HALT]
        assert any("50 messages a second" in why for why in case.refusals())
        assert (await case.page()).received[0]["role"] == "control", "the console still serves"


async def test_the_number_of_clients_is_limited() -> None:
    async with open_console("console.clients_max=2") as case:
        first, _second = await case.page(), await case.page()
        assert (await refused(case))[0] == 503
        await first.socket.close()
        await case.settled(lambda: len(case.console.hub.clients) == 1, "the departure of one")
        await case.page()


GARBAGE = [
    b"\x16\x03\x01\x02\x00\x01",
    b"GET / HTTP/9.9\r\n\r\n",
    b"\r\n" * 500,
    bytes(range(256)),
    b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 500 + b"\r\n",
    b"GET /" + b"a" * 20_000,
]


@pytest.mark.parametrize("garbage", GARBAGE)
async def test_input_that_is_not_http(garbage: bytes, capfd: pytest.CaptureFixture[str]) -> None:
    async with open_console() as case:
        reader, writer = await asyncio.open_connection("127.0.0.1", case.url.port)
        writer.write(garbage)
        writer.write_eof()
        await asyncio.wait_for(reader.read(), TIMEOUT_S)
        writer.close()
        assert (await (await case.page()).ask(type="halt"))["ok"]
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")


HANDSHAKES = ["Sec-WebSocket-Key: x", "Sec-WebSocket-Version: 99", "Sec-WebSocket-Version: 13", "Upgrade: websocket"]


@pytest.mark.parametrize("header", HANDSHAKES)
async def test_a_malformed_handshake(header: str) -> None:
    async with open_console() as case:
        answer = await raw(
            case,
            f"GET /ws?token={case.token} HTTP/1.1",
            f"Host: 127.0.0.1:{case.url.port}",
            f"Origin: {case.origin}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            header,
        )
        assert answer.startswith(b"HTTP/1.1 400")
        assert case.run.health.fault() is None


PIECES = [
    *RAW, "/ws", "/ws?token=%ff%fe", "/?token=%", "http://[::1/", "http://[", "*", "//", "/%zz", "?", "#", "é",
    "\xff", "/ws?token=\udcff", "http://127.0.0.1:99999999/", "/" + "%2e" * 300, "javascript:", "/log?token=",
]  # fmt: skip
METHODS = ["GET", "GET", "GET", "POST", "G\xcaT", ""]
NAMES = [
    "Host", "Origin", "Upgrade", "Connection", "Content-Length", "Transfer-Encoding", "Expect", "Cookie", "Range",
    "Sec-WebSocket-Key", "If-Modified-Since", "Accept-Encoding", "\xe9", "",
]  # fmt: skip
VALUES = [
    "", "websocket", "Upgrade", "chunked", "-1", "99999999999999999999", "100-continue", "\xff\xfe", "x" * 4000,
    "gzip", "127.0.0.1:{port}", "bytes=0-", "a=b;" * 100, "evil.example", "[::1", "\x01",
]  # fmt: skip


async def test_random_requests_cause_no_fault(capfd: pytest.CaptureFixture[str]) -> None:
    """No request is reported as a fault of the program, so none stops the robot."""
    rng = random.Random(4)
    async with open_console() as case:
        port = case.url.port
        for _ in range(150):
            lines = [f"{rng.choice(METHODS)} {rng.choice(PIECES)} HTTP/1.{rng.choice('01')}"]
            if rng.random() < 0.8:
                lines.append(f"Host: 127.0.0.1:{port}")
            lines += [f"{rng.choice(NAMES)}: {rng.choice(VALUES)}".replace("{port}", str(port)) for _ in range(3)]
            case.clock[0] += 1.0
            # The last lines end a request that still waits for more.
            await raw(case, *lines, "", "\x00", "")
            assert case.run.health.fault() is None, lines
        assert (await (await case.page()).ask(type="halt"))["ok"]
    assert capfd.readouterr() == ("", "")


async def test_one_request_is_answered_on_a_connection() -> None:
    async with open_console() as case:
        request = f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{case.url.port}\r\n\r\n"
        answer = await raw(case, request * 1000)
        assert answer.count(b"HTTP/1.1 200") <= 1


async def test_the_end_of_the_run_closes_every_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "CLOSE_MAX_S", TIMEOUT_S)  # on a busy machine the pages may take long to answer
    async with open_console() as case:
        pages = [await case.page() for _ in range(3)]
        codes = asyncio.gather(*(page.closed() for page in pages))
        await asyncio.sleep(0)
    assert await codes == [aiohttp.WSCloseCode.GOING_AWAY] * 3
