"""Wake-up latency of methods of sleeping until a deadline: the reason for the choice in `runtime/timing/wake.py`.

Every method sleeps to the same grid of deadlines, two seconds at a time, in turns with the others, so that other load
on the machine affects all of them alike. The control sleeps without an event loop.
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

from runtime.timing.realtime import request_slice
from runtime.timing.wake import Waker

PERIOD_S: Final = 0.05
"""Period of the cycle."""
WAKES_A_TURN: Final = 40
SPIN_S: Final = 0.001
SLICE_S: Final = 0.0001
"""As the setting realtime.slice_s."""
CONTROL: Final = "time.sleep, no event loop"

Sleep: TypeAlias = Callable[[float], Awaitable[object]]
NewLoop: TypeAlias = Callable[[], asyncio.AbstractEventLoop]


@dataclass
class SleepMethod:
    """Method of sleeping, and its measured lateness and CPU time."""

    name: str
    sleep: Callable[[], contextlib.AbstractContextManager[Sleep]]
    new_loop: NewLoop = asyncio.new_event_loop
    late_us: list[float] = field(default_factory=list)
    cpu_us: list[float] = field(default_factory=list)


@contextlib.contextmanager
def by_time_sleep() -> Iterator[Sleep]:
    """Sleep without an event loop."""

    async def until(deadline_s: float) -> None:
        time.sleep(max(0.0, deadline_s - time.monotonic()))

    yield until


@contextlib.contextmanager
def by_asyncio() -> Iterator[Sleep]:
    """Sleep by asyncio.sleep."""

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
def by_waker_with_slice() -> Iterator[Sleep]:
    """Sleep as the cycle does, with a short scheduler time slice requested, as a run does."""
    request_slice(SLICE_S)
    try:
        with by_waker() as sleep:
            yield sleep
    finally:
        request_slice(0.0)


def spinning(
    sleep: Callable[[], contextlib.AbstractContextManager[Sleep]], spin_s: float
) -> Callable[[], contextlib.AbstractContextManager[Sleep]]:
    """Return a method that sleeps until `spin_s` before the deadline and then polls the clock."""

    @contextlib.contextmanager
    def method() -> Iterator[Sleep]:
        with sleep() as sleeps:

            async def until(deadline_s: float) -> None:
                await sleeps(deadline_s - spin_s)
                while time.monotonic() < deadline_s:
                    pass

            yield until

    return method


def select_loop() -> asyncio.AbstractEventLoop:
    """Return an event loop on select(), whose timeouts have microsecond resolution."""
    return asyncio.SelectorEventLoop(selectors.SelectSelector())


def sleep_methods() -> list[SleepMethod]:
    """Return all methods; uvloop only if it is installed."""
    methods = [
        SleepMethod(CONTROL, by_time_sleep),
        SleepMethod("asyncio.sleep", by_asyncio),
        SleepMethod("asyncio.sleep + 1 ms spin", spinning(by_asyncio, SPIN_S)),
        SleepMethod("asyncio.sleep on select()", by_asyncio, select_loop),
        SleepMethod("timerfd (runtime/timing/wake.py)", by_waker),
        SleepMethod("timerfd, realtime.slice_s = 0.0001", by_waker_with_slice),
        SleepMethod("timerfd + 0.2 ms spin", spinning(by_waker, 0.0002)),
    ]
    with contextlib.suppress(ImportError):
        uvloop = importlib.import_module("uvloop")
        methods.insert(2, SleepMethod(f"uvloop {uvloop.__version__}", by_asyncio, uvloop.new_event_loop))
    return methods


@contextlib.contextmanager
def busy_processes(count: int) -> Iterator[None]:
    """Run `count` CPU-bound processes in the background."""
    started = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for process in started:
            process.kill()
            process.wait()


async def _turn(method: SleepMethod, wakes: int) -> None:
    with method.sleep() as sleep:
        begin_s, begin_cpu_s = time.monotonic(), time.process_time()
        for k in range(1, wakes + 1):
            deadline_s = begin_s + k * PERIOD_S
            await sleep(deadline_s)
            method.late_us.append(1e6 * (time.monotonic() - deadline_s))
        method.cpu_us.append(1e6 * (time.process_time() - begin_cpu_s) / wakes)


def measure(turns: int, busy: int, report: Callable[[str], None]) -> list[SleepMethod]:
    """Return every method with its measured lateness and CPU time.

    Parameters
    ----------
    turns
        Number of turns for each method.
    busy
        Number of CPU-bound background processes.
    report
        Called with a line on what is running.
    """
    methods = sleep_methods()
    with busy_processes(busy):
        for turn in range(turns):
            for method in methods:
                report(f"waking: {method.name}, turn {turn + 1} of {turns}, {busy} busy processes")
                with asyncio.Runner(loop_factory=method.new_loop) as runner:
                    runner.run(_turn(method, WAKES_A_TURN))
    return methods


def figures(measured: list[SleepMethod]) -> dict[str, dict[str, float]]:
    """Return lateness and CPU time of each method, µs per wake-up."""
    rows = {}
    for method in measured:
        p50, p99, p999 = np.quantile(method.late_us, [0.5, 0.99, 0.999])
        rows[method.name] = {
            "p50": round(float(p50), 1), "p99": round(float(p99), 1), "p99.9": round(float(p999), 1),
            "max": round(max(method.late_us), 1), "cpu": round(float(np.mean(method.cpu_us)), 1),
        }  # fmt: skip
    return rows


def waking_table(by_load: dict[str, dict[str, dict[str, float]]]) -> Table:
    """Return the table: one row per method, lateness and CPU time by the number of busy processes."""
    table = Table(title="wake-ups: µs after the deadline, at 20 Hz", title_justify="left")
    table.add_column("method")
    columns = ("p50", "p99", "p99.9", "max", "cpu")
    for load in by_load:
        for column in columns:
            table.add_column(f"{load}\n{column}", justify="right")
    for name in next(iter(by_load.values())):
        table.add_row(name, *(f"{rows[name][column]:.0f}" for rows in by_load.values() for column in columns))
    return table
