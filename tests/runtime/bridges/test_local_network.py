"""What is read from the network is bounded, and what is announced is found, on the loopback interface."""

from __future__ import annotations

import asyncio
import errno
import socket
import struct

import pytest

from runtime.bridges import local_network
from runtime.bridges.local_network import LOOPBACK, TEXT_MAX, Announced, addresses_of, announced, find_robots, serve
from tests.hil.machine import TIMEOUT_S

GOOD = {b"name": b"alpha", b"mode": b"DRIVE", b"version": b"1.2"}


@pytest.fixture
def _multicast() -> None:
    """Skip a test where the loopback interface takes part in no multicast."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        try:
            group = struct.pack("4s4s", socket.inet_aton("224.0.0.251"), socket.inet_aton(LOOPBACK))
            one.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
        except OSError as error:
            pytest.skip(f"no multicast on loopback: {errno.errorcode.get(error.errno or 0, error)}")


def test_a_service_is_a_run_with_the_address_of_its_page() -> None:
    found = announced(GOOD, ["fe80::1", "192.168.0.7", "10.0.0.1"], 8765)
    assert found == Announced("alpha", "DRIVE", "192.168.0.7", 8765, "1.2")
    assert found is not None
    assert found.url == "http://192.168.0.7:8765/"
    assert announced({}, ["10.0.0.1"], 1) == Announced("a robot without a name", "?", "10.0.0.1", 1, "")


@pytest.mark.parametrize(
    ("addresses", "port"),
    [([], 80), (["fe80::1"], 80), (["evil.example"], 80), (["10.0.0.1"], 0), (["10.0.0.1"], None)],
)
def test_what_has_no_page_is_no_run(addresses: list[str], port: int | None) -> None:
    assert announced(GOOD, addresses, port) is None


def test_texts_of_strangers_are_bounded() -> None:
    found = announced({b"name": b"a\n\x1b[31m\xff" + 500 * b"x", b"mode": None}, ["10.0.0.1"], 80)
    assert found is not None
    assert found.name.isprintable()
    assert len(found.name) == TEXT_MAX
    assert found.mode == "?"


def test_only_the_address_of_the_console_is_announced() -> None:
    assert addresses_of("192.168.0.7") == ["192.168.0.7"]
    assert LOOPBACK not in addresses_of("0.0.0.0")


async def test_without_a_network_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_network, "addresses_of", lambda _: [])
    lines = asyncio.StreamReader()
    lines.feed_data(b'{"name": "a", "mode": "READY"}\n')
    with pytest.raises(OSError, match="no address that others reach"):
        await serve("0.0.0.0", 8765, lines)
    ended = asyncio.StreamReader()
    ended.feed_eof()
    await serve("0.0.0.0", 8765, ended)


@pytest.mark.usefixtures("_multicast")
async def test_an_announced_run_is_found_and_gone_with_its_input() -> None:
    lines, port = asyncio.StreamReader(), 49_151
    lines.feed_data(b'{"name": "alpha", "mode": "READY"}\n')
    serving = asyncio.create_task(serve(LOOPBACK, port, lines))
    async with asyncio.timeout(TIMEOUT_S):
        while not (found := [one for one in await find_robots(0.5, [LOOPBACK]) if one.port == port]):
            pass
        assert [(one.name, one.mode, one.address) for one in found] == [("alpha", "READY", LOOPBACK)]
        lines.feed_data(b'{"name": "alpha", "mode": "DRIVE"}\n')
        lines.feed_eof()
        await serving
        while any(one.port == port for one in await find_robots(0.1, [LOOPBACK])):
            pass
