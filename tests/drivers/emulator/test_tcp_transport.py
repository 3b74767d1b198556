"""The emulator on a TCP port: hosts come and go one at a time, and none of them can disturb it."""

from __future__ import annotations

import socket
from functools import partial

import pytest

from config.errors import WRONG_CALL
from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import Hello, Ident, Odom
from drivers.emulator.port_link import EmulatorError
from drivers.emulator.tcp_transport import TcpServerPort, parse_address
from tests.drivers.device_host import script
from tests.drivers.emulator.pty_host import Emulator, emulator
from tests.drivers.pty_pair import Host, running, soon
from tests.hil.machine import TIMEOUT_S

ANY = partial(TcpServerPort, "127.0.0.1", 0)


def connect(url: str) -> socket.socket:
    """Return a connection of a host that does not wait."""
    host, port = parse_address(url.removeprefix("socket://"))
    connection = socket.create_connection((host, port), timeout=TIMEOUT_S)
    connection.settimeout(0.0)
    return connection


async def hear(robot: Emulator, host: socket.socket) -> list[object]:
    """Return the frames up to the answer to a HELLO."""
    decoder, heard = Decoder("robot", midway=True), list[object]()

    def answered() -> bool:
        try:
            heard.extend(decoder.feed(host.recv(4096)))
        except BlockingIOError:
            return False
        return any(isinstance(frame, Ident) for frame in heard) and isinstance(heard[-1], Odom)

    host.send(encode(Hello(0)))
    await robot.until(answered, "an answer")
    return heard


async def test_hosts_come_and_go_and_a_second_one_is_refused() -> None:
    port = ANY()
    async with emulator(None, make_port=lambda: port) as robot:
        assert robot.path.startswith("socket://127.0.0.1:")
        for _ in range(3):
            with connect(robot.path) as host:
                await hear(robot, host)
                with pytest.raises(ConnectionRefusedError):
                    connect(robot.path)
            await robot.until(lambda: port.read() is None, "its end")


async def test_the_line_of_the_main_process_finds_it_and_sees_it_unplugged() -> None:
    faults = script(kind="unplug", at_s=2.0, duration_s=1.0)
    async with emulator(None, make_port=ANY, faults=faults) as robot:
        host = Host()
        link = host.link(robot.path)
        async with running(link):
            await soon(host.opened)
            assert await soon(host.data)
            assert "was lost (its other end is closed)" in await soon(host.closed)
            await soon(host.opened)
            assert await soon(host.data)


def test_a_host_that_does_not_read_blocks_nothing() -> None:
    port = ANY()
    with connect(port.path) as host:
        while port.read() is None:
            pass
        for _ in range(20_000):
            port.write(bytes(1000))
            if port.dropped:
                break
        assert port.dropped > 0
        host.send(b"still heard")
        heard = b""
        while len(heard) < len(b"still heard"):
            heard += port.read() or b""
        assert heard == b"still heard"
    port.close()


def test_a_port_in_use_and_a_foreign_address_are_refused_in_one_line() -> None:
    first = ANY()
    try:
        host, number = parse_address(first.path.removeprefix("socket://"))
        with pytest.raises(
            EmulatorError, match=f"cannot listen on 127.0.0.1:{number}: Address already in use; choose"
        ):
            TcpServerPort(host, number)
        with pytest.raises(EmulatorError, match=r"cannot listen on 192\.0\.2\.1:"):
            TcpServerPort("192.0.2.1", 0)
    finally:
        first.close()
    assert (first.is_open, first.watched) == (False, None)


def test_what_is_no_address_is_a_wrong_call() -> None:
    with pytest.raises(EmulatorError) as caught:
        parse_address("robot")
    assert caught.value.exit_code == WRONG_CALL


def test_bytes_without_a_host_are_lost() -> None:
    port = ANY()
    port.write(b"no one")
    assert port.read() is None
    assert port.read() is None
    assert port.dropped == 6
    port.close()
    assert port.read() is None


def test_bytes_that_leave_one_by_one_come_as_one_packet_when_they_pause() -> None:
    port = ANY()
    with connect(port.path) as host:
        while port.read() is None:
            pass
        for k in range(20):
            port.write(bytes((k,)))
            assert port.read() == b""
        with pytest.raises(BlockingIOError):
            host.recv(100)
        assert port.read() == b""
        host.settimeout(TIMEOUT_S)
        assert host.recv(100) == bytes(range(20))
    port.close()
