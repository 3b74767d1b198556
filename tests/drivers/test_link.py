"""The serial line over real ptys: what goes well, and everything that ends a line."""

from __future__ import annotations

import asyncio
import math
import os
import select
import termios
import threading
from itertools import pairwise
from pathlib import Path

import pytest
import serial

from config.robot import LinkConfig
from drivers.link import Link, LinkError
from tests.drivers.pty_pair import Host, PtyPair, running, soon
from tests.hil.machine import TIMEOUT_S

pytestmark = pytest.mark.usefixtures("loop_errors")

LONG_S, SLOW_BAUD = 30.0, 300
"""A hold that no test waits for, and a line slow enough for it."""


async def test_bytes_go_both_ways(pty: PtyPair) -> None:
    host = Host()
    link = host.link(pty.path)
    assert not link.send(b"too early")
    await link.open_once()
    await soon(host.opened)
    async with running(link):
        assert link.is_open
        assert link.writable
        assert link.last_error is None
        assert link.send(bytes(range(256)))
        assert await pty.read(256) == bytes(range(256))
        os.write(pty.master, b"\0\x11\x13\n\r\xff")
        got = bytearray()
        while len(got) < 6:
            chunk = await soon(host.data)
            got += chunk
        assert got == b"\0\x11\x13\n\r\xff"
    assert await soon(host.closed) == "closed by this program"
    assert host.opened.empty()


async def test_the_speed_changes_while_the_line_is_open(pty: PtyPair) -> None:
    host = Host()
    link = host.link(pty.path, baud=9600)
    link.set_baud(38400)
    async with running(link):
        await soon(host.opened)
        assert termios.tcgetattr(pty.slave)[4] == termios.B9600
        for baud, code in ((38400, termios.B38400), (None, termios.B9600)):
            link.set_baud(baud)
            assert termios.tcgetattr(pty.slave)[4] == code
        assert link.is_open
        link.set_baud(2**40)
        assert "cannot be set to 1099511627776 baud" in await soon(host.closed)


@pytest.mark.promise("P1")
async def test_what_is_sent_leaves_though_the_loop_is_held_up_right_then(pty: PtyPair) -> None:
    """Else a command would leave when the loop goes on, long after it was right."""
    host = Host()
    link = host.link(pty.path)
    async with running(link):
        await soon(host.opened)
        assert link.send(b"drive")
        assert link.waiting == 0
        ready, _, _ = select.select([pty.master], [], [], TIMEOUT_S)
        assert ready, "it waits for a turn of the loop"
        assert os.read(pty.master, 64) == b"drive"


async def test_while_the_line_is_held_nothing_is_read_and_everything_is_sent(pty: PtyPair) -> None:
    host = Host()
    link = host.link(pty.path, baud=SLOW_BAUD)
    link.hold(1.0)
    link.release()
    async with running(link):
        await soon(host.opened)
        link.hold(LONG_S)
        link.hold(LONG_S)
        os.write(pty.master, b"here")
        assert select.select([pty.slave], [], [], TIMEOUT_S)[0]
        assert link.send(b"halt")
        assert await pty.read(4) == b"halt"
        assert host.data.empty()
        link.release()
        assert host.data.get_nowait() == b"here", "read at once"
        link.hold(LONG_S)
        link.release()
        link.release()
        assert host.data.empty()
        os.write(pty.master, b"there")
        assert await soon(host.data) == b"there"


async def test_a_hold_ends_by_itself(pty: PtyPair) -> None:
    host = Host()
    link = host.link(pty.path)
    async with running(link):
        await soon(host.opened)
        for seconds in (-math.inf, 0.0, 0.001, 0.02, math.inf):
            link.hold(seconds)
            os.write(pty.master, b"x")
            assert await soon(host.data) == b"x"


async def test_a_hold_ends_before_the_buffer_of_a_fast_line_is_full(
    pty: PtyPair, monkeypatch: pytest.MonkeyPatch
) -> None:
    delays: list[float] = []
    monkeypatch.setattr("drivers.link._Transport.hold", lambda _, seconds: delays.append(seconds))
    for baud in (115200, 921600):
        host = Host()
        link = host.link(pty.path, baud=baud)
        async with running(link):
            await soon(host.opened)
            link.hold(1.0)
    assert delays == pytest.approx([1024 * 10 / 115200, 1024 * 10 / 921600])


@pytest.mark.parametrize("how", ["unplugged", "stopped"])
async def test_a_line_that_ends_while_it_is_held_is_reported(pty: PtyPair, how: str) -> None:
    host = Host()
    link = host.link(pty.path)
    async with running(link):
        await soon(host.opened)
        link.hold(0.05)
        if how == "unplugged":
            pty.unplug()
            assert "was lost" in await soon(host.closed)
        else:
            await asyncio.wait_for(link.stop(), TIMEOUT_S)
            assert host.closed.get_nowait() == "closed by this program"
            await asyncio.sleep(0.06)  # until the end of the hold, which must not fail


async def test_the_last_bytes_are_sent_before_the_line_closes(pty: PtyPair) -> None:
    host = Host()
    link = host.link(pty.path)
    async with running(link):
        await soon(host.opened)
        link.send(b"halt")
    assert await pty.read(4) == b"halt"


async def test_unplugged_and_plugged_again(pty: PtyPair) -> None:
    host = Host()
    link = host.link(pty.path)
    async with running(link):
        for _ in range(3):
            await soon(host.opened)
            link.send(b"under way")
            pty.unplug()
            reason = await soon(host.closed)
            assert "was lost" in reason
            assert "plug it in again" in reason
            assert not link.is_open
            assert not link.writable
            assert not link.send(b"gone")
            pty.plug()
        await soon(host.opened)
        assert link.last_error is None
        os.write(pty.master, b"back")
        got = await soon(host.data)
        assert got == b"back"


async def test_attempts_to_reopen_are_spaced_out(pty: PtyPair) -> None:
    host = Host()
    attempts: asyncio.Queue[float] = asyncio.Queue()
    loop = asyncio.get_running_loop()

    def opener(config: LinkConfig) -> serial.Serial:
        loop.call_soon_threadsafe(attempts.put_nowait, loop.time())
        raise serial.SerialException(2, f"could not open port {config.port}")

    link = host.link(pty.path, opener=opener)
    async with running(link):
        times = [await soon(attempts) for _ in range(6)]
    gaps = [after - before for before, after in pairwise(times)]
    # The waits are at least 5, 10, 20, 20, 20 ms; the opening itself comes on top.
    assert all(gap >= wait for gap, wait in zip(gaps, (0.004, 0.009, 0.019, 0.019, 0.019), strict=True)), gaps
    assert "no such port" in (link.last_error or "")


@pytest.mark.parametrize("name", ["missing", "missing/deeper", "file", "folder", "file/below"])
async def test_a_wrong_path_is_reported_in_one_line(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("not a port")
    (tmp_path / "folder").mkdir()
    link = Host().link(tmp_path / name)
    with pytest.raises(LinkError) as caught:
        await link.open_once()
    text = str(caught.value)
    expected = "is not a serial port" if name in ("file", "folder") else "no such port"
    assert expected in text
    assert str(tmp_path / name) in text
    assert "\n" not in text
    assert link.last_error == text
    assert not link.is_open


async def test_a_missing_port_setting_is_reported() -> None:
    with pytest.raises(LinkError, match="no serial port is named; give it as --port"):
        await Host().link(None).open_once()


async def test_a_port_in_use_is_reported(pty: PtyPair) -> None:
    host = Host()
    first, second = host.link(pty.path), Host().link(pty.path)
    async with running(first):
        await soon(host.opened)
        with pytest.raises(LinkError, match="in use by another program; find it with `fuser"):
            await second.open_once()


async def test_a_port_that_never_opens_does_not_hold_the_loop(pty: PtyPair) -> None:
    host, release, closed = Host(), threading.Event(), threading.Event()

    class Late(serial.Serial):
        def close(self) -> None:
            super().close()
            closed.set()

    late = Late()  # kept here, or the garbage collector would close it

    def opener(_: LinkConfig) -> serial.Serial:
        release.wait(TIMEOUT_S)
        return late

    with pytest.raises(LinkError, match="takes too long"):
        await asyncio.wait_for(host.link(pty.path, opener=opener, open_timeout_s=0.02).open_once(), TIMEOUT_S)
    release.set()
    assert await asyncio.to_thread(closed.wait, TIMEOUT_S), "what opens too late is closed again"


async def test_a_peer_that_stops_reading_neither_fills_memory_nor_blocks_stopping(pty: PtyPair) -> None:
    host = Host()
    link = host.link(pty.path)
    async with running(link):
        await soon(host.opened)
        sent = 0
        was_writable = False
        for _ in range(100_000):
            was_writable = was_writable or link.writable
            if not link.send(b"x" * 64):
                break
            sent += 64
            await asyncio.sleep(0)
        assert was_writable
        assert not link.writable
        assert not link.send(b"x" * 64)
        assert sent < 200_000
        assert link.send(b""), "nothing always fits"
    assert await soon(host.closed) == "closed by this program"


async def test_unplugged_while_bytes_wait_is_reported_at_once_and_without_a_traceback(pty: PtyPair) -> None:
    host = Host()
    link = host.link(pty.path)
    async with running(link):
        await soon(host.opened)
        while link.send(b"x" * 64):
            await asyncio.sleep(0)
        pty.unplug()
        assert "was lost" in await soon(host.closed)
        assert not link.is_open


async def test_bytes_of_a_line_that_is_lost_while_they_wait_have_not_left(pty: PtyPair) -> None:
    host = Host()
    link = host.link(pty.path)
    async with running(link):
        await soon(host.opened)
        line = link._line
        assert line is not None
        while link.send(b"x" * 64):
            await asyncio.sleep(0)
        flushed = asyncio.create_task(line.flush(TIMEOUT_S))
        await asyncio.sleep(0)
        pty.unplug()
        await soon(host.closed)
        assert not await flushed


async def test_a_full_line_still_has_room_for_a_halt(pty: PtyPair) -> None:
    host = Host()
    link = host.link(pty.path)
    async with running(link):
        await soon(host.opened)
        sent = 0
        while link.writable:  # no one reads
            assert link.send(b"x" * 64)
            sent += 64
        assert link.waiting > 256
        assert link.send(b"halt")
        assert not link.send(b"x" * 4000), "a frame is taken whole or not at all"
        assert (await pty.read(sent + 4))[sent:] == b"halt"
        assert link.writable


async def test_an_exception_in_a_handler_ends_the_line_and_is_named(pty: PtyPair) -> None:
    host = Host()

    def careless(data: bytes) -> None:
        raise KeyError(data.decode())

    link = Link(
        LinkConfig(port=str(pty.path), reopen_first_s=0.001),
        lambda: host.opened.put_nowait(None),
        careless,
        host.closed.put_nowait,
    )
    async with running(link):
        await soon(host.opened)
        os.write(pty.master, b"boom")
        reason = await soon(host.closed)
        assert "the handler of received data failed with KeyError: 'boom'" in reason
        assert "test_link.py" in reason
        assert "careless" in reason
        await soon(host.opened)


async def test_handlers_of_opening_and_closing_may_fail_too(pty: PtyPair) -> None:
    opened: asyncio.Queue[None] = asyncio.Queue()
    times = iter(range(2))

    def on_opened() -> None:
        opened.put_nowait(None)
        if next(times) == 0:
            raise ZeroDivisionError("at opening")

    def on_closed(_: str) -> None:
        raise ZeroDivisionError("at closing")

    link = Link(LinkConfig(port=str(pty.path), reopen_first_s=0.001), on_opened, lambda _: None, on_closed)
    async with running(link):
        await soon(opened)
        assert not link.is_open
        await soon(opened)
        assert link.send(b"well")
    assert "closing failed with ZeroDivisionError: at closing" in (link.last_error or "")


async def test_stop_without_a_line_does_nothing() -> None:
    link = Host().link(None)
    await link.stop()
    assert not link.is_open
