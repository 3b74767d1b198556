"""P5 on a real pty: unplugged and plugged again, many times; echoes come again, and nothing is left behind."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import os
import threading
import tracemalloc
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import pytest

from config.robot import LinkConfig
from drivers.denning.codec import Decoder, encode
from drivers.denning.driver import DenningDriver
from drivers.denning.frames import Ack, Echo, Hello, Ident, Odom, Pattern, RobotFrame
from drivers.driver import LineState
from drivers.link import Link
from tests.drivers.cable import ROBOT
from tests.drivers.pty_pair import PtyPair, running, soon

GROWTH_MAX = 16 * 1024
"""Bytes by which memory may differ, whatever the number of cycles."""
SETTLED_CYCLES = 160
"""The history of the odometry and the like are full by then."""
SAMPLES = 40
"""Samples of the footprint in all cycles."""
CUTS = range(1, 85, 7)
"""Bytes of the robot after which the line is cut: within IDENT, ACK, ODOM or ECHO."""


QUICK: Final = ROBOT.model_copy(update={"ring": ROBOT.ring.model_copy(update={
    "firing": ROBOT.ring.firing.model_copy(update={"step_period_s": 0.007, "window_m": 1.1})})})  # fmt: skip
"""A robot that may fire as often as a fast machine plugs it in; echoes beyond its rate would be dropped."""


class Device(PtyPair):
    """A robot of few words on the other end: it answers, and fires once for each pattern."""

    def __init__(self, path: Path) -> None:
        self._t_us = 0
        self.cut_said: int | None = None
        super().__init__(path)

    def plug(self) -> None:
        super().plug()
        self._ears, self._seq = Decoder("host"), 0
        asyncio.get_running_loop().add_reader(self.master, self._hear)

    def unplug(self) -> None:
        if self.master >= 0:
            asyncio.get_running_loop().remove_reader(self.master)
        super().unplug()

    def _hear(self) -> None:
        for frame in self._ears.feed(os.read(self.master, 4096)):
            match frame:
                case Hello():
                    self._say(Ident(0, 1, 24, 381, 500, 20, 7, "denning"))
                case Pattern():
                    self._t_us += 100_000
                    self._say(Ack(0, frame.seq))
                    self._say(Odom(0, self._t_us, 0, 0, 0, 0, 0, 0, 0, 0))
                    self._say(Echo(0, self._t_us, 0, 1, (30,)))
                case _:
                    pass

    def _say(self, frame: RobotFrame) -> None:
        data = encode(replace(frame, seq=self._seq))
        self._seq = (self._seq + 1) % 256
        if self.cut_said is not None:
            data, self.cut_said = data[: self.cut_said], self.cut_said - len(data)
        if self.master >= 0:
            os.write(self.master, data)
        if self.cut_said is not None and self.cut_said <= 0:
            self.unplug()


def fast_link(path: Path) -> LinkConfig:
    """Return the configuration of a line that is opened again at once."""
    return LinkConfig(port=str(path), reopen_first_s=0.001, reopen_max_s=0.002)


class Footprint(NamedTuple):
    """What a process holds."""

    descriptors: int
    tasks: int
    threads: int
    memory: int

    @classmethod
    def now(cls) -> Footprint:
        gc.collect()
        descriptors = len(list(Path("/proc/self/fd").iterdir()))
        memory = tracemalloc.get_traced_memory()[0]
        return cls(descriptors, len(asyncio.all_tasks()), threading.active_count(), memory)


@contextlib.asynccontextmanager
async def hosted(config: LinkConfig) -> AsyncIterator[tuple[DenningDriver, asyncio.Queue[None], asyncio.Queue[str]]]:
    """Keep a driver on a line; gives it, a queue of firings, and a queue of losses."""
    driver, firings, lost = DenningDriver(QUICK), asyncio.Queue[None](), asyncio.Queue[str]()
    loop = asyncio.get_running_loop()

    def send() -> None:
        if data := driver.outgoing(writable=link.writable):
            link.send(data)

    def opened() -> None:
        driver.line_opened(loop.time())
        send()

    def received(data: bytes) -> None:
        driver.receive(data, loop.time())
        send()
        for _ in driver.take_received().firings:
            firings.put_nowait(None)

    def closed(reason: str) -> None:
        driver.line_closed()
        lost.put_nowait(reason)

    link = Link(config, opened, received, closed)
    async with running(link):
        yield driver, firings, lost


async def replug(path: Path, cycles: int) -> str:
    """Unplug and plug again, an echo each time; return how the footprint changed once it had settled."""
    device = Device(path)
    config = fast_link(path)
    samples: list[Footprint] = []
    settled, between = max(SETTLED_CYCLES, cycles // 5), max(1, cycles // SAMPLES)
    gc.collect()
    gc.freeze()  # what other tests left is not looked at in each sample
    tracemalloc.start()
    try:
        async with hosted(config) as (driver, firings, lost):
            for cycle in range(cycles):
                await soon(firings)
                assert driver.state is LineState.READY
                if cycle >= settled and (cycle - settled) % between == 0:
                    samples.append(Footprint.now())
                device.unplug()
                assert "was lost" in await soon(lost)
                device.plug()
            await soon(firings)
            samples.append(Footprint.now())
    finally:
        tracemalloc.stop()
        gc.unfreeze()
        device.unplug()
    # What is released only now and then, as the loop's cancelled timers, is there in some samples; a leak is in all.
    half = len(samples) // 2
    before, after = (Footprint(*map(min, zip(*part, strict=True))) for part in (samples[:half], samples[half:]))
    assert after.descriptors == before.descriptors
    assert after.tasks == before.tasks
    # The thread that opened the port may not have ended yet.
    assert after.threads <= before.threads + 1
    assert after.memory - before.memory < GROWTH_MAX, samples
    more = [now - then for now, then in zip(after, before, strict=True)]
    return (
        f"{cycles:,} cycles on a pty: {more[0]} descriptors, {more[1]} tasks, {more[3] / 1024:+.1f} KiB more at the "
        f"end than once settled"
    )


async def echo_after_cut(path: Path, cut: int, config: LinkConfig, outage_s: float = 0.0) -> float:
    """Cut the line after so many bytes of the robot, plug it in again; return how long the next echo took, s."""
    device = Device(path)
    try:
        async with hosted(config) as (_, firings, lost):
            await soon(firings)
            device.unplug()
            await soon(lost)
            device.cut_said = cut
            device.plug()
            await soon(lost)
            device.cut_said = None
            await asyncio.sleep(outage_s)
            device.plug()
            start_s = asyncio.get_running_loop().time()
            while not firings.empty():
                firings.get_nowait()
            await soon(firings)
            return asyncio.get_running_loop().time() - start_s
    finally:
        device.unplug()


@pytest.mark.promise("P5")
async def test_cut_for_real_within_what_the_robot_says(tmp_path: Path, measured: Callable[[str], None]) -> None:
    """Hung up within IDENT, ACK, ODOM or ECHO; echoes come again each time."""
    for cut in CUTS:
        await echo_after_cut(tmp_path / f"robot-{cut}", cut, fast_link(tmp_path / f"robot-{cut}"))
    measured(f"{len(CUTS)} cuts on a pty, within the robot's frames: an echo after each replug")


@pytest.mark.usefixtures("may_freeze")
@pytest.mark.promise("P5")
async def test_unplugged_and_plugged_again_many_times(
    tmp_path: Path, measured: Callable[[str], None]
) -> None:  # fmt: skip
    errors: list[object] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: errors.append(context))
    measured(await replug(tmp_path / "robot", 2 * SETTLED_CYCLES))
    assert errors == []


@pytest.mark.soak
@pytest.mark.usefixtures("may_freeze")
@pytest.mark.promise("P5")
async def test_twenty_thousand_times_unplugged_and_plugged_again(
    tmp_path: Path, measured: Callable[[str], None]
) -> None:
    measured(await replug(tmp_path / "robot", 20_000))
