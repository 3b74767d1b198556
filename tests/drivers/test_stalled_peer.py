"""P6: a peer that falls silent or stops reading harms nothing: the loop runs on, nothing piles up, it is noticed."""

from __future__ import annotations

import asyncio
import contextlib
import os
import threading
import time
from collections.abc import AsyncIterator, Callable, Coroutine
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from config.robot import LinkConfig
from drivers.denning.codec import Decoder, encode
from drivers.denning.driver import DenningDriver
from drivers.denning.frames import Ack, Drive, Frame, Halt, Hello, Ident, Odom, Pattern, Release, RobotFrame
from drivers.driver import LineState
from drivers.link import Link
from drivers.messages import Twist
from tests.drivers.cable import ROBOT
from tests.drivers.pty_pair import PtyPair, running
from tests.hil.machine import TIMEOUT_S, stalls_excused

pytestmark = pytest.mark.promise("P6")

CYCLE_S = 0.05
STALL_S = 5.0
TICK_S = 0.005
UNSENT_MAX = 4096
DEAD_WITHIN_S = 0.5
GAP_MARGIN_S = 0.005
ATTEMPTS = 8
"""The machine may hold up this loop and not its control; it does not do so eight times in a row."""


class Peer(PtyPair):
    """A robot that sends odometry at 50 Hz and answers, and can be made to fall silent or to stop reading."""

    def __init__(self, path: Path, *, names_drives: bool = True) -> None:
        super().__init__(path)
        self.mute = self.deaf = False
        self.heard: list[Frame] = []
        self.bytes_read = self.bytes_sent = 0
        self._names_drives = names_drives
        self._ears, self._seq, self._t_us, self._last_drive = Decoder("host"), 0, 0, 0

    async def run(self) -> None:
        """Send odometry and listen in real time."""
        while True:
            await asyncio.sleep(0.02)
            self.send_odometry(time.monotonic())
            self.listen()

    def send_odometry(self, host_s: float) -> None:
        """Send one frame of odometry."""
        self._t_us = round(1e6 * host_s) % 2**32
        self._say(Odom(0, self._t_us, 0, 0, 0, 0, 0, 0, 0, self._last_drive))

    def listen(self) -> None:
        """Read everything there is, and answer."""
        with contextlib.suppress(BlockingIOError):
            while not self.deaf:
                data = os.read(self.master, 4096)
                self.bytes_read += len(data)
                for frame in self._ears.feed(data):
                    self.heard.append(frame)
                    self._answer(frame)

    def _answer(self, frame: Frame) -> None:
        match frame:
            case Hello():
                self._say(Ident(0, 1, 24, 381, 500, 20, 7, "denning"))
            case Pattern() | Halt() | Release():
                self._say(Ack(0, frame.seq))
            case Drive() if self._names_drives:
                self._last_drive = frame.seq
            case _:
                pass

    def _say(self, frame: RobotFrame) -> None:
        if not self.mute:
            with contextlib.suppress(BlockingIOError):
                self.bytes_sent += os.write(self.master, encode(replace(frame, seq=self._seq)))
            self._seq = (self._seq + 1) % 256


@dataclass
class Gaps:
    """How far apart the ticks of a loop lie, at worst, in the time that is looked at."""

    worst_s: float = 0.0
    counting: bool = False

    async def run(self) -> None:
        last_s = time.monotonic()
        while True:
            await asyncio.sleep(TICK_S)
            now_s = time.monotonic()
            if self.counting:
                self.worst_s = max(self.worst_s, now_s - last_s)
            last_s = now_s


class Control:
    """The same ticks at the same time in a loop of another thread, which has nothing to do with the line."""

    def __init__(self) -> None:
        self.gaps = Gaps()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._work)

    def _work(self) -> None:
        with contextlib.suppress(asyncio.CancelledError):
            self._loop.run_until_complete(self._task)
        self._loop.close()

    def __enter__(self) -> Gaps:
        self._task = self._loop.create_task(self.gaps.run())
        self._thread.start()
        return self.gaps

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join()


@dataclass
class Host:
    """A main process in miniature: twenty times a second it drives, and once the robot is down it halts."""

    path: Path
    now: Callable[[], float] = time.monotonic
    unsent_max: int = 0
    bytes_sent: int = 0
    bytes_received: int = 0
    asked: int = 0
    down_s: float | None = None
    driver: DenningDriver = field(default_factory=lambda: DenningDriver(ROBOT))

    def __post_init__(self) -> None:
        self.link = Link(
            LinkConfig(port=str(self.path)),
            lambda: self.driver.line_opened(self.now()),
            self._receive,
            lambda _: self.driver.line_closed(),
        )

    def _receive(self, data: bytes) -> None:
        self.bytes_received += len(data)
        self.driver.receive(data, self.now())

    def cycle(self) -> None:
        self.driver.tick(self.now())
        if self.driver.state is LineState.DOWN and self.down_s is None:
            self.down_s = self.now()
            self.driver.halt()
        if self.down_s is None and self.driver.state is LineState.READY:
            self.asked += 1
            self.driver.drive(Twist(1e-3 * (self.asked % 500), 0.0))
        self.driver.take_received()
        self.send()

    def send(self) -> None:
        data = self.driver.outgoing(writable=self.link.writable)
        if self.link.is_open and data and self.link.send(data):
            self.bytes_sent += len(data)
        self.unsent_max = max(self.unsent_max, self.link.waiting)

    async def run(self) -> None:
        while True:
            self.cycle()
            await asyncio.sleep(CYCLE_S)

    async def until(self, done: Callable[[], bool]) -> None:
        async with asyncio.timeout(TIMEOUT_S):
            while not done():
                await asyncio.sleep(TICK_S)


@contextlib.asynccontextmanager
async def tasks(*work: Callable[[], Coroutine[None, None, None]]) -> AsyncIterator[None]:
    """Have work done beside; none of it may end by itself."""
    under_way = [asyncio.create_task(one()) for one in work]
    try:
        yield
        assert not any(task.done() for task in under_way)
    finally:
        for task in under_way:
            task.cancel()
        await asyncio.gather(*under_way, return_exceptions=True)


@dataclass
class Exchange:
    """A host and a peer on a pty whose clock advances by turns: how busy the machine is makes no difference."""

    peer: Peer
    host: Host
    clock_s: float = 0.0

    @classmethod
    def on(cls, path: Path, *, names_drives: bool = True) -> Exchange:
        exchange = cls(Peer(path, names_drives=names_drives), Host(path))
        exchange.host.now = lambda: exchange.clock_s
        return exchange

    async def turn(self) -> None:
        """Let one cycle pass on both sides."""
        await self.settle()
        for _ in range(2):
            self.clock_s += CYCLE_S / 2.0
            self.peer.send_odometry(self.clock_s)
            await self.settle()
        self.host.cycle()
        await self.settle()

    async def settle(self) -> None:
        """Wait until everything sent has arrived, but for what the peer does not read."""
        async with asyncio.timeout(TIMEOUT_S):
            while not self._is_settled():
                await asyncio.sleep(0.0005)
                self.peer.listen()

    def _is_settled(self) -> bool:
        read = self.peer.deaf or self.peer.bytes_read == self.host.bytes_sent
        return self.host.link.is_open and read and self.host.bytes_received == self.peer.bytes_sent

    async def turns_until(self, done: Callable[[], bool], turns_max: int = 1000) -> None:
        for _ in range(turns_max):
            if done():
                return
            await self.turn()
        raise AssertionError(f"not done after {turns_max} cycles")


async def stall(path: Path, how: str, seconds: float) -> tuple[float, float, int, float]:
    """Let a peer stall and come back; return worst gap, control's worst gap, most bytes unsent, and time to death."""
    peer, host, gaps = Peer(path), Host(path), Gaps()
    try:
        with Control() as control:
            async with running(host.link), tasks(peer.run, host.run, gaps.run):
                await host.until(lambda: host.driver.state is LineState.READY and host.asked > 10)
                gaps.counting = control.counting = True
                start_s = time.monotonic()
                peer.mute, peer.deaf = how != "not reading", how != "mute"
                await asyncio.sleep(seconds)
                gaps.counting = control.counting = False
                assert host.link.is_open, "a stalled line is not a lost one"
                assert host.down_s is not None, "the link was not called dead"
                before = len(peer.heard)
                peer.mute = peer.deaf = False
                await host.until(lambda: host.driver.state is LineState.READY)
        assert_halt_is_newest(peer.heard, before)
        return gaps.worst_s, control.worst_s, host.unsent_max, host.down_s - start_s
    finally:
        peer.unplug()


def assert_halt_is_newest(heard: list[Frame], before: int) -> None:
    """Assert that the peer gets no velocity after the HALT, and of older ones no more than fit into the time."""
    first_halt = next(i for i, frame in enumerate(heard) if isinstance(frame, Halt))
    assert not any(isinstance(frame, Drive) for frame in heard[first_halt:]), "the newest command is HALT"
    stale = [frame for frame in heard[before:first_halt] if isinstance(frame, Drive)]
    assert len(stale) <= DEAD_WITHIN_S / CYCLE_S


async def survive(path: Path, how: str, seconds: float) -> str:
    """Stall until the worst gap is no worse than the control's; return the figures of that attempt."""
    seen = []
    for _ in range(ATTEMPTS):
        gap_s, control_s, unsent, dead_s = await stall(path, how, seconds)
        assert unsent <= UNSENT_MAX
        seen.append((gap_s, control_s, dead_s))
        if gap_s <= control_s + GAP_MARGIN_S and 0.0 < dead_s <= DEAD_WITHIN_S:
            return (
                f"{how} for {seconds:g} s: worst gap {1e3 * gap_s:.1f} ms (control {1e3 * control_s:.1f}), at most "
                f"{unsent} bytes unsent, called dead after {dead_s:.2f} s"
            )
    raise AssertionError(f"the loop stands still while the peer is {how}: (gap, control, dead) {seen}")


HOWS = ("mute", "not reading", "mute and not reading")


@pytest.mark.parametrize("how", HOWS)
async def test_a_stalled_peer_is_harmless(tmp_path: Path, how: str, measured: Callable[[str], None]) -> None:
    exchange = Exchange.on(tmp_path / "robot")
    peer, host = exchange.peer, exchange.host
    try:
        async with running(host.link):
            await exchange.turns_until(lambda: host.driver.state is LineState.READY and host.asked > 10)
            start_s = exchange.clock_s
            peer.mute, peer.deaf = how != "not reading", how != "mute"
            while exchange.clock_s < start_s + STALL_S:
                await exchange.turn()
            assert host.link.is_open, "a stalled line is not a lost one"
            assert host.unsent_max <= UNSENT_MAX
            assert host.down_s is not None, "the link was not called dead"
            assert 0.0 < host.down_s - start_s <= DEAD_WITHIN_S
            before = len(peer.heard)
            peer.mute = peer.deaf = False
            await exchange.turns_until(lambda: host.driver.state is LineState.READY)
    finally:
        peer.unplug()
    assert_halt_is_newest(peer.heard, before)
    measured(
        f"{how} for {STALL_S:g} s by the host's clock: at most {host.unsent_max} bytes unsent, called dead after "
        f"{host.down_s - start_s:.2f} s"
    )


@pytest.mark.soak
@pytest.mark.parametrize("how", HOWS)
@stalls_excused
async def test_a_peer_stalled_for_a_minute_is_harmless(
    tmp_path: Path, how: str, measured: Callable[[str], None]
) -> None:
    measured(await survive(tmp_path / "robot", how, 60.0))


async def test_the_newest_drive_wins_over_a_full_line(tmp_path: Path, measured: Callable[[str], None]) -> None:
    """A peer that talks and does not read: DRIVEs stop leaving, and once it reads again the newest is the next."""
    exchange = Exchange.on(tmp_path / "robot", names_drives=False)
    peer, host = exchange.peer, exchange.host
    try:
        async with running(host.link):
            await exchange.turns_until(lambda: host.driver.state is LineState.READY)
            peer.deaf = True
            while host.link.writable:
                host.cycle()
                await asyncio.sleep(0)
            for _ in range(500):
                host.cycle()
            newest = host.asked % 500
            assert host.unsent_max <= UNSENT_MAX
            assert host.down_s is None
            peer.deaf = False
            async with asyncio.timeout(TIMEOUT_S):
                while not any(isinstance(f, Drive) and f.v_mm_s == newest for f in peer.heard[-3:]):
                    host.send()
                    await asyncio.sleep(TICK_S)
                    peer.listen()
    finally:
        peer.unplug()
    drives = [frame.v_mm_s for frame in peer.heard if isinstance(frame, Drive)]
    assert drives[-1] == newest
    replaced = host.asked - len(drives)
    assert replaced >= 499, "those that no one could take were replaced, not kept"
    measured(f"not reading: {replaced} DRIVEs replaced by newer ones, ≤ {host.unsent_max} bytes unsent")
