"""How long an echo waits on a real line until its cycle begins, beside a bare loop."""

from __future__ import annotations

import asyncio
import contextlib
import os
import statistics
import sys
import time
import tty
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path

import pytest

from config.load import load_settings
from config.settings import LogConfig
from drivers.driver import RobotDriver
from runtime.cli.commands.run.run_settings import with_port
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.step import CycleRecord, State
from runtime.support.logs import open_log
from runtime.timing.cycle_stats import CycleStats
from tests.hil.machine import TIMEOUT_S, stalls_excused
from tests.hil.running import ROOT

pytestmark = pytest.mark.usefixtures("warm_kernels")

EMULATOR = """
import sys, time
from drivers.denning.codec import Decoder
from drivers.denning.frames import Echo
from drivers.emulator.pty_transport import PtyPort
from runtime.cli.app import main
decoder, write, log = Decoder("robot"), PtyPort.write, open(sys.argv[1], "w", buffering=1)
def traced(port, data):
    host_s = time.monotonic()
    write(port, data)
    for frame in decoder.feed(data):
        if isinstance(frame, Echo):
            log.write(f"{frame.t_us} {host_s!r}\\n")
PtyPort.write = traced
main(["emulate", "--config", "hallway", "--link", sys.argv[2]])
"""
"""The emulator, noting when it has put the last byte of each echo on the line."""

CONTROL = """
import os, sys, time
line = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
while True:
    time.sleep(0.0471)
    os.write(line, f"{time.monotonic()!r}\\n".encode())
"""
"""Program that writes the time to a pty: the delay of any line to any loop on this machine, as a control."""

ECHOES = 150
SETTINGS = load_settings("hallway")
PERIOD_S = 1.0 / SETTINGS.cycle.rate_hz


@contextlib.asynccontextmanager
async def program(text: str, *arguments: str) -> AsyncIterator[asyncio.StreamReader]:
    """Run a few lines of Python in another process and yield its output."""
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", text, *arguments, stdout=asyncio.subprocess.PIPE, env=env
    )
    try:
        assert process.stdout is not None
        yield process.stdout
    finally:
        process.kill()
        await process.wait()


@contextlib.contextmanager
def control_line(ages_s: list[float]) -> Iterator[str]:
    """Give a line on which a program may say what time it is, and note how long each word took to this loop."""
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    pending = bytearray()

    def hear() -> None:
        host_s = time.monotonic()
        pending.extend(os.read(master, 4096))
        *words, rest = pending.split(b"\n")
        ages_s.extend(host_s - float(word) for word in words)
        pending[:] = rest

    asyncio.get_running_loop().add_reader(master, hear)
    try:
        yield os.ttyname(slave)
    finally:
        asyncio.get_running_loop().remove_reader(master)
        os.close(master)
        os.close(slave)


@stalls_excused
async def test_an_echo_waits_for_no_timer(tmp_path: Path, measured: Callable[[str], None]) -> None:
    """From the last byte's way into the line, on the other process's word, to the beginning of its cycle."""
    began: dict[int, float] = {}
    waited_s: list[float] = []
    control_s: list[float] = []

    def note(record: CycleRecord, *_: State | CycleStats | RobotDriver) -> None:
        for firing in record.inputs.received.firings:
            began[round(firing.robot_s * 1e6)] = record.inputs.run_s
        if record.inputs.echo_age_s is not None:
            waited_s.append(record.inputs.echo_age_s)
        if len(began) >= ECHOES:
            process.stop()

    log_path, port = tmp_path / "echoes", str(tmp_path / "robot")
    async with contextlib.AsyncExitStack() as stack:
        ready = await stack.enter_async_context(program(EMULATOR, str(log_path), port))
        await asyncio.wait_for(ready.readline(), TIMEOUT_S)
        line = stack.enter_context(control_line(control_s))
        await stack.enter_async_context(program(CONTROL, line))
        with open_log(LogConfig(file=str(tmp_path / "log.jsonl")), terminal=False) as log:
            process = RobotProcess(with_port(SETTINGS, port), log, Observers(on_cycle=note))
            summary = await process.run(arm=True, seconds=TIMEOUT_S)
    written = {int(t_us): float(at_s) for t_us, at_s in map(str.split, log_path.read_text().splitlines())}
    # The emulator is ended in the middle of whatever it does: the last echoes may not be in its log.
    ages_s = [at_s - written[t_us] for t_us, at_s in began.items() if t_us in written][5:]
    assert len(ages_s) >= ECHOES - 10
    assert min(ages_s) > 0.0
    figures = {
        "age_ms": 1e3 * statistics.median(ages_s), "control_ms": 1e3 * statistics.median(control_s),
        "own word_ms": 1e3 * statistics.median(waited_s), "timing": summary["timing"],
    }  # fmt: skip
    measured(
        f"{len(ages_s)} echoes waited {1e3 * statistics.median(ages_s):.2f} ms for their cycle, median (control "
        f"{1e3 * statistics.median(control_s):.2f})"
    )
    # A cycle that waited for a timer would begin half a period after the echo.
    assert statistics.median(ages_s) <= 2.0 * statistics.median(control_s) + 0.1 * PERIOD_S, figures
    assert summary["timing"]["following"] > 0.8, figures
    assert summary["timing"]["echo_wait"]["p50"] == pytest.approx(1e6 * statistics.median(waited_s), abs=5e3), figures
