"""The line over TCP keeps the promises of a serial one: both ways, at once, bounded, ended at once, opened again."""

from __future__ import annotations

import asyncio
import contextlib
import select
import socket
from collections.abc import Iterator

import pytest
import serial

from config.errors import FAILED, WRONG_CALL
from config.robot import LinkConfig
from drivers.link import LinkError
from drivers.serial_port import Port, open_port, opening_error
from tests.drivers.pty_pair import Host, running, soon
from tests.hil.machine import TIMEOUT_S

pytestmark = pytest.mark.usefixtures("loop_errors")

LONG_S, SLOW_BAUD = 30.0, 300
STALE_MAX = 256 * 1024
"""Most bytes that both ends' systems hold for a peer that reads nothing; its own buffer is the larger part."""


class TcpPeer:
    """The robot's end: it listens on a free port, and takes one connection after the other."""

    def __init__(self) -> None:
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.listener.settimeout(TIMEOUT_S)
        self.port = self.listener.getsockname()[1]
        self.url = f"socket://127.0.0.1:{self.port}"

    def accept(self) -> socket.socket:
        connection, _ = self.listener.accept()
        connection.settimeout(TIMEOUT_S)
        return connection


@pytest.fixture
def peer() -> Iterator[TcpPeer]:
    peer = TcpPeer()
    with peer.listener:
        yield peer


async def test_bytes_go_both_ways_and_leave_at_once(peer: TcpPeer) -> None:
    host = Host()
    link = host.link(peer.url)
    async with running(link):
        await soon(host.opened)
        with peer.accept() as robot:
            assert link.writable
            assert link.send(bytes(range(256)))
            assert link.waiting == 0
            assert select.select([robot], [], [], TIMEOUT_S)[0], "it waits for a turn of the loop"
            assert robot.recv(512) == bytes(range(256))
            robot.sendall(b"\0\x11\x13\n\r\xff")
            assert await soon(host.data) == b"\0\x11\x13\n\r\xff"
            link.send(b"halt")
            await asyncio.wait_for(link.stop(), TIMEOUT_S)
            assert robot.recv(64) == b"halt", "the last bytes are sent before it closes"
    assert await soon(host.closed) == "closed by this program"
    assert not link.has_hung_up


async def test_a_held_line_is_not_read_until_it_is_released(peer: TcpPeer) -> None:
    host = Host()
    link = host.link(peer.url, baud=SLOW_BAUD)
    async with running(link):
        await soon(host.opened)
        with peer.accept() as robot:
            link.hold(LONG_S)
            robot.sendall(b"here")
            while not (got := host.data.qsize()) and not _has_arrived(link):
                await asyncio.sleep(0)
            assert got == 0
            link.release()
            assert host.data.get_nowait() == b"here", "read at once"


def _has_arrived(link: object) -> bool:
    port = link._line._port  # type: ignore[attr-defined]
    return bool(select.select([port.fileno()], [], [], 0.0)[0])


@pytest.mark.parametrize("how", ["close", "reset"])
async def test_a_lost_connection_is_reported_and_made_again(peer: TcpPeer, how: str) -> None:
    host = Host()
    link = host.link(peer.url)
    async with running(link):
        for _ in range(3):
            await soon(host.opened)
            robot = peer.accept()
            if how == "reset":
                robot.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
            robot.close()
            reason = await soon(host.closed)
            assert f"the line {peer.url} was lost (" in reason
            assert link.has_hung_up
            assert "\n" not in reason
            assert not link.send(b"gone")


@pytest.mark.promise("P6")
async def test_a_peer_that_does_not_read_gets_bounded_bytes_and_is_left_at_once(peer: TcpPeer) -> None:
    host = Host()
    link = host.link(peer.url)
    async with running(link):
        await soon(host.opened)
        with peer.accept():
            sent = 0
            while link.send(bytes(64)):
                sent += 64
                assert link.waiting <= 4096
                assert sent <= STALE_MAX
                await asyncio.sleep(0)
            assert not link.writable
            await asyncio.wait_for(link.stop(), TIMEOUT_S)
            assert link.waiting == 0


async def test_a_refused_connection_names_its_likely_causes(peer: TcpPeer) -> None:
    peer.listener.close()
    link = Host().link(peer.url)
    with pytest.raises(LinkError, match="refuses the connection; likely the robot's side does not run, or serves"):
        await link.open_once()
    assert link.last_error is not None


@pytest.mark.parametrize(
    ("url", "text", "code"),
    [
        ("socket://", "not of the form socket://host:port; give a host and a port", WRONG_CALL),
        ("socket://robot", "not of the form socket://host:port", WRONG_CALL),
        ("socket://robot:0", "not of the form socket://host:port", WRONG_CALL),
        ("socket://robot:8101/path", "not of the form socket://host:port", WRONG_CALL),
        ("socket://robot:99999", "give a host and a port", WRONG_CALL),
        ("socket://robot:x", "give a host and a port", WRONG_CALL),
    ],
)
def test_a_wrong_address_is_one_line(url: str, text: str, code: int) -> None:
    config = LinkConfig(port=url)
    with pytest.raises((OSError, ValueError)) as caught:
        open_port(config)
    error = opening_error(config, caught.value)
    assert error.exit_code == code
    assert text in str(error)
    assert url in str(error)
    assert "\n" not in str(error)


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (socket.gaierror(-2, "Name or service not known"), "no such host ([Errno -2] Name or service not known)"),
        (TimeoutError("timed out"), "does not answer (timed out); likely the robot is off or in another network"),
        (OSError(113, "No route to host"), "cannot connect to socket://robot:8101 ([Errno 113] No route to host)"),
    ],
)
def test_each_cause_has_its_line(error: OSError, text: str) -> None:
    found = opening_error(LinkConfig(port="socket://robot:8101"), error)
    assert text in str(found)
    assert found.exit_code == (WRONG_CALL if isinstance(error, socket.gaierror) else FAILED)


def test_a_closed_peer_is_an_error_of_the_serial_library(peer: TcpPeer) -> None:
    """Its transport takes that one for a lost line, and any other for a fault of the program."""
    port = open_port(LinkConfig(port=peer.url))
    peer.accept().close()
    with contextlib.closing(port), pytest.raises(serial.SerialException):
        write_until_lost(port)


def write_until_lost(port: Port) -> None:
    while True:
        with contextlib.suppress(BlockingIOError):
            port.write(b"x")
