"""The habits of pyserial-asyncio 0.6 that cost others a day: one test for each that `drivers/link.py` survives it."""

from __future__ import annotations

import asyncio
import os
import threading
import time

import pytest
import serial

from config.robot import LinkConfig
from drivers.link import Link, LinkError
from drivers.serial_port import Port, open_port
from tests.drivers.pty_pair import Host, PtyPair, running, soon
from tests.hil.machine import TIMEOUT_S

pytestmark = pytest.mark.usefixtures("loop_errors")


async def test_write_buffers_without_bound_past_pause_writing(pty: PtyPair) -> None:
    """Ours takes 4 KiB and then says no, frame by frame, and what was taken arrives whole."""
    host = Host()
    link = host.link(pty.path)
    async with running(link):
        await soon(host.opened)
        frame, taken, waited = b"0123456789abcdef", 0, 0
        for _ in range(20_000):
            taken += link.send(frame)
            waited = max(waited, link.waiting)
            assert link.waiting <= 4096
        assert taken < 20_000
        assert waited > 4096 - len(frame)
        assert await pty.read(taken * len(frame)) == frame * taken
        assert link.waiting == 0


async def test_an_exception_in_data_received_goes_to_the_loop_and_the_port_stays_up(pty: PtyPair) -> None:
    """Ours ends the line with the cause's name and opens it again; the loop's handler is not bothered."""
    host = Host()

    def careless(data: bytes) -> None:
        if data == b"bad":
            raise ArithmeticError("planted")
        host.data.put_nowait(data)

    config = LinkConfig(port=str(pty.path), reopen_first_s=0.001)
    link = Link(config, lambda: host.opened.put_nowait(None), careless, host.closed.put_nowait)
    async with running(link):
        await soon(host.opened)
        os.write(pty.master, b"bad")
        assert "ArithmeticError: planted" in await soon(host.closed)
        assert not link.is_open
        await soon(host.opened)
        os.write(pty.master, b"good")
        assert await soon(host.data) == b"good"


async def test_close_on_a_stalled_peer_never_reports_connection_lost(pty: PtyPair) -> None:
    """Ours aborts: the end is reported within its fifth of a second, though no one reads what waits."""
    host = Host()
    link = host.link(pty.path)
    async with running(link):
        await soon(host.opened)
        while link.send(bytes(64)):
            await asyncio.sleep(0)
        await asyncio.wait_for(link.stop(), TIMEOUT_S)
        assert host.closed.get_nowait() == "closed by this program"
        assert not link.is_open
        assert link.waiting == 0


@pytest.mark.parametrize("busy", [False, True], ids=["idle", "with bytes waiting"])
async def test_after_an_unplug_read_drain_and_wait_closed_all_raise(pty: PtyPair, busy: bool) -> None:
    """Ours reports it once, by the handler; sending, asking and stopping afterwards raise nothing."""
    host = Host()
    link = host.link(pty.path)
    await link.open_once()
    await soon(host.opened)
    while busy and link.send(bytes(64)):
        await asyncio.sleep(0)
    pty.unplug()
    assert "was lost" in await soon(host.closed)
    assert not link.send(b"gone")
    assert not link.is_open
    assert not link.writable
    assert link.waiting == 0
    await link.stop()
    assert host.closed.empty()
    with pytest.raises(LinkError, match="no such port"):
        await link.open_once()


async def test_opening_blocks(pty: PtyPair) -> None:
    """Ours opens in a thread: the loop goes on meanwhile, and an opening without end is given up and reported."""
    host, release, ticks = Host(), threading.Event(), 0

    def opener(config: LinkConfig) -> Port:
        assert threading.current_thread() is not threading.main_thread()
        release.wait(TIMEOUT_S)
        return open_port(config)

    link = host.link(pty.path, opener=opener, open_timeout_s=TIMEOUT_S)
    opening = asyncio.create_task(link.open_once())
    while ticks < 20:
        await asyncio.sleep(0.001)
        ticks += 1
        assert not opening.done()
    release.set()
    await asyncio.wait_for(opening, TIMEOUT_S)
    await soon(host.opened)
    await link.stop()


@pytest.mark.parametrize("opens", [True, False])
async def test_wait_for_swallows_a_cancellation_that_comes_with_the_result(pty: PtyPair, opens: bool) -> None:
    """Ours ends when it is asked to, also in the very turn of the loop in which the port opens, and closes it."""
    host, release, ports = Host(), threading.Event(), list[Port]()

    def opener(config: LinkConfig) -> Port:
        release.wait(TIMEOUT_S)
        if not opens:
            raise serial.SerialException(2, "no such port")
        ports.append(open_port(config))
        return ports[-1]

    link = host.link(pty.path, opener=opener, open_timeout_s=TIMEOUT_S)
    task = asyncio.create_task(link.run())
    await asyncio.sleep(0)
    (thread,) = [one for one in threading.enumerate() if one.name == f"open {pty.path}"]
    release.set()
    thread.join()  # what it has to say waits for the loop's next turn; so does the cancellation behind it
    asyncio.get_running_loop().call_soon(task.cancel)
    done, _ = await asyncio.wait([task], timeout=TIMEOUT_S)
    assert done, "it was asked to end and goes on for ever"
    assert task.cancelled()
    assert not any(port.is_open for port in ports if isinstance(port, serial.Serial))
    assert not link.is_open


async def test_the_fast_fork_freezes_the_loop_on_a_peer_that_stops_reading(pty: PtyPair) -> None:
    """Ours never waits for the port: with the line full every call returns, and the loop turns."""
    host = Host()
    link = host.link(pty.path)
    async with running(link):
        await soon(host.opened)
        while link.send(bytes(64)):
            await asyncio.sleep(0)
        longest_s = 0.0
        for _ in range(1000):
            start_s = time.thread_time()
            link.send(bytes(64))
            await asyncio.sleep(0)
            longest_s = max(longest_s, time.thread_time() - start_s)
        # A frozen loop would not come here at all. The processor's own time: a busy machine does not count.
        assert longest_s < 1.0
        assert link.is_open


async def test_a_pty_opens_twice_without_error_unless_it_is_exclusive(pty: PtyPair) -> None:
    """Ours asks for it alone, so the second to come is refused, and may have it once the first has gone."""
    first, second = Host(), Host()
    one, two = first.link(pty.path), second.link(pty.path)
    await one.open_once()
    await soon(first.opened)
    with pytest.raises(LinkError, match="in use by another program"):
        await two.open_once()
    await one.stop()
    await two.open_once()
    await soon(second.opened)
    await two.stop()


async def test_the_master_gets_eio_when_the_last_slave_closes_and_the_robot_lives_on(pty: PtyPair) -> None:
    """A host that comes back finds the same line, also after the other end has seen it hang up."""
    host = Host()
    link = host.link(pty.path)
    os.close(pty.slave)  # as the emulator does: the host's is the only one
    for _ in range(3):
        await link.open_once()
        await soon(host.opened)
        os.write(pty.master, b"hello")
        assert await soon(host.data) == b"hello"
        await link.stop()
        with pytest.raises(OSError, match="Input/output error"):
            os.read(pty.master, 100)
    pty.slave = os.open(os.devnull, os.O_RDONLY)
