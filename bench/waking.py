"""Which way of sleeping wakes a loop on time: the table behind `runtime/timing/wake.py`, as `make bench` measures it.

Every contestant sleeps to the same grid of deadlines, a few seconds at a time, in turns with the others, so that
whatever else the machine does meets all of them alike. The control is a thread that sleeps without any loop.
"""

from __future__ import annotations

import asyncio
import contextlib
import importlib
import selectors
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass, field
from typing import Final, TypeAlias

import numpy as np
from rich.table import Table

from runtime.timing.realtime import ask_slice
from runtime.timing.wake import Waker

PERIOD_S: Final = 0.05
"""The cycle's own."""
WAKES_A_TURN: Final = 40
SPIN_S: Final = 0.001
SLICE_S: Final = 0.0001
"""As realtime.slice_s."""
CONTROL: Final = "time.sleep, no loop"

Sleep: TypeAlias = Callable[[float], Awaitable[object]]
NewLoop: TypeAlias = Callable[[], asyncio.AbstractEventLoop]


@dataclass
class Way:
    """A way of sleeping, and what came of it."""

    name: str
    sleep: Callable[[], contextlib.AbstractContextManager[Sleep]]
    new_loop: NewLoop = asyncio.new_event_loop
    late_us: list[float] = field(default_factory=list)
    cpu_us: list[float] = field(default_factory=list)


@contextlib.contextmanager
def bare() -> Iterator[Sleep]:
    """Sleep without any loop."""

    async def until(deadline_s: float) -> None:
        time.sleep(max(0.0, deadline_s - time.monotonic()))

    yield until


@contextlib.contextmanager
def by_asyncio() -> Iterator[Sleep]:
    """Sleep as everyone does."""

    async def until(deadline_s: float) -> None:
        await asyncio.sleep(max(0.0, deadline_s - time.monotonic()))

    yield until


@contextlib.contextmanager
def by_waker() -> Iterator[Sleep]:
    """Sleep as the cycle does."""
    waker = Waker()
    try:
        yield waker.until
    finally:
        waker.close()


@contextlib.contextmanager
def by_waker_in_short_turns() -> Iterator[Sleep]:
    """Sleep as the cycle does, asking the system for short turns, as a run does."""
    ask_slice(SLICE_S)
    try:
        with by_waker() as sleep:
            yield sleep
    finally:
        ask_slice(0.0)


def spinning(
    sleep: Callable[[], contextlib.AbstractContextManager[Sleep]], spin_s: float
) -> Callable[[], contextlib.AbstractContextManager[Sleep]]:
    """Return a way that sleeps until shortly before the deadline and looks at the clock without rest from then on."""

    @contextlib.contextmanager
    def way() -> Iterator[Sleep]:
        with sleep() as sleeps:

            async def until(deadline_s: float) -> None:
                await sleeps(deadline_s - spin_s)
                while time.monotonic() < deadline_s:
                    pass

            yield until

    return way


def select_loop() -> asyncio.AbstractEventLoop:
    """Return a loop on select(), whose timeouts have microseconds."""
    return asyncio.SelectorEventLoop(selectors.SelectSelector())


def ways() -> list[Way]:
    """Return all contestants; uvloop only where it is installed."""
    entered = [
        Way(CONTROL, bare),
        Way("asyncio.sleep", by_asyncio),
        Way("asyncio.sleep + 1 ms spin", spinning(by_asyncio, SPIN_S)),
        Way("asyncio.sleep on select()", by_asyncio, select_loop),
        Way("timerfd (runtime/timing/wake.py)", by_waker),
        Way("timerfd, realtime.slice_s = 0.0001", by_waker_in_short_turns),
        Way("timerfd + 0.2 ms spin", spinning(by_waker, 0.0002)),
    ]
    with contextlib.suppress(ImportError):
        uvloop = importlib.import_module("uvloop")
        entered.insert(2, Way(f"uvloop {uvloop.__version__}", by_asyncio, uvloop.new_event_loop))
    return entered


@contextlib.contextmanager
def hogs(count: int) -> Iterator[None]:
    """Run `count` processes beside this one that never rest."""
    started = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for hog in started:
            hog.kill()
            hog.wait()


async def _turn(way: Way, wakes: int) -> None:
    with way.sleep() as sleep:
        begin_s, begin_cpu_s = time.monotonic(), time.process_time()
        for k in range(1, wakes + 1):
            deadline_s = begin_s + k * PERIOD_S
            await sleep(deadline_s)
            way.late_us.append(1e6 * (time.monotonic() - deadline_s))
        way.cpu_us.append(1e6 * (time.process_time() - begin_cpu_s) / wakes)


def measure(turns: int, beside: int, told: Callable[[str], None]) -> list[Way]:
    """Measure every way in turns, beside so many processes that never rest."""
    entered = ways()
    with hogs(beside):
        for turn in range(turns):
            for way in entered:
                told(f"waking: {way.name}, turn {turn + 1} of {turns}, {beside} busy processes beside it")
                with asyncio.Runner(loop_factory=way.new_loop) as runner:
                    runner.run(_turn(way, WAKES_A_TURN))
    return entered


def figures(measured: list[Way]) -> dict[str, dict[str, float]]:
    """Return lateness and CPU time of each way, µs a wake."""
    rows = {}
    for way in measured:
        p50, p99, p999 = np.quantile(way.late_us, [0.5, 0.99, 0.999])
        rows[way.name] = {
            "p50": round(float(p50), 1), "p99": round(float(p99), 1), "p99.9": round(float(p999), 1),
            "max": round(max(way.late_us), 1), "cpu": round(float(np.mean(way.cpu_us)), 1),
        }  # fmt: skip
    return rows


def waking_table(by_load: dict[str, dict[str, dict[str, float]]]) -> Table:
    """Return the table: a row a way, lateness and CPU time, idle and beside busy processes."""
    table = Table(title="waking: µs after the deadline, at 20 Hz", title_justify="left")
    table.add_column("way")
    columns = ("p50", "p99", "p99.9", "max", "cpu")
    for load in by_load:
        for column in columns:
            table.add_column(f"{load}\n{column}", justify="right")
    for name in next(iter(by_load.values())):
        table.add_row(name, *(f"{rows[name][column]:.0f}" for rows in by_load.values() for column in columns))
    return table
