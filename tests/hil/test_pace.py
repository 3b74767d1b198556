"""The cycle follows the ring over a real line, and one that cannot keep its time stops the robot and says why."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import os
import statistics
import sys
import time
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from config.load import load_settings
from config.settings import LogConfig
from drivers.driver import RobotDriver
from runtime.books import Books
from runtime.commands.run import on_port
from runtime.emulated import emulator
from runtime.logs import open_log
from runtime.modes import Mode
from runtime.process import Observers, RobotProcess
from runtime.step import CycleRecord, State
from tests.hil.running import PATIENCE_S, ROOT

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

EMULATOR = """
import sys, time
from drivers.denning.codec import Decoder
from drivers.denning.frames import Echo
from drivers.emulator.pty import PtyPort
from runtime.cli import main
decoder, write, log = Decoder("robot"), PtyPort.write, open(sys.argv[1], "w", buffering=1)
def told(port, data):
    now_s = time.monotonic()
    write(port, data)
    for frame in decoder.feed(data):
        if isinstance(frame, Echo):
            log.write(f"{frame.t_us} {now_s!r}\\n")
PtyPort.write = told
main(["emulate", "--config", "hallway", "--link", sys.argv[2]])
"""
"""The emulator, noting when it has put the last byte of each echo on the line."""

CONTROL = """
import sys, time
while True:
    time.sleep(0.0471)
    sys.stdout.write(f"{time.monotonic()!r}\\n")
    sys.stdout.flush()
"""
"""A program that says what time it is: how long any news takes to any loop on this machine just now."""

ECHOES = 150


@contextlib.asynccontextmanager
async def program(text: str, *arguments: str) -> AsyncIterator[asyncio.StreamReader]:
    """Run a few lines of Python beside this process and give what they print."""
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


async def listen(news: asyncio.StreamReader, ages_s: list[float]) -> None:
    while line := await news.readline():
        ages_s.append(time.monotonic() - float(line))


async def test_an_echo_waits_for_no_timer(tmp_path: Path) -> None:
    """From the last byte's way into the line, on the other process's word, to the beginning of its cycle."""
    began: dict[int, float] = {}
    waited_s: list[float] = []
    control_s: list[float] = []

    def note(record: CycleRecord, *_: State | Books | RobotDriver) -> None:
        for firing in record.inputs.heard.firings:
            began[round(firing.t_s * 1e6)] = record.inputs.now_s
        if record.inputs.echo_age_s is not None:
            waited_s.append(record.inputs.echo_age_s)
        if len(began) >= ECHOES:
            process.stop()

    log_path, port = tmp_path / "echoes", str(tmp_path / "robot")
    async with contextlib.AsyncExitStack() as beside:
        ready = await beside.enter_async_context(program(EMULATOR, str(log_path), port))
        await asyncio.wait_for(ready.readline(), PATIENCE_S)
        news = await beside.enter_async_context(program(CONTROL))
        listening = asyncio.create_task(listen(news, control_s))
        with open_log(LogConfig(file=str(tmp_path / "log.jsonl")), terminal=False) as log:
            process = RobotProcess(on_port(load_settings("hallway"), port), log, Observers(on_cycle=note))
            summary = await process.run(arm=True, seconds=PATIENCE_S)
        listening.cancel()
    written = {int(t_us): float(at_s) for t_us, at_s in map(str.split, log_path.read_text().splitlines())}
    ages_s = [at_s - written[t_us] for t_us, at_s in began.items()][5:]
    assert len(ages_s) >= ECHOES - 5
    assert min(ages_s) > 0.0
    figures = {
        "age_ms": 1e3 * statistics.median(ages_s), "control_ms": 1e3 * statistics.median(control_s),
        "own word_ms": 1e3 * statistics.median(waited_s), "timing": summary["timing"],
    }  # fmt: skip
    logging.getLogger(__name__).info("%s", figures)
    assert statistics.median(ages_s) <= statistics.median(control_s) + 0.002, figures
    assert summary["timing"]["following"] > 0.9, figures
    assert math.isclose(summary["timing"]["echo_wait"]["p50"], 1e6 * statistics.median(waited_s), abs_tol=5e3)


async def test_overruns_in_a_row_end_in_a_safe_stop_that_names_the_callback(tmp_path: Path) -> None:
    def hold_the_loop() -> None:
        end_s = time.monotonic() + 0.09
        while time.monotonic() < end_s:
            pass

    def plant(record: CycleRecord, *_: State | Books | RobotDriver) -> None:
        if record.cycle > 40:
            asyncio.get_running_loop().call_later(0.002, hold_the_loop)
        if record.mode.mode is Mode.SAFE_STOP:
            process.stop()

    settings = load_settings("hallway", ["cycle.overruns_max=5"])
    async with emulator([]) as port:
        with open_log(LogConfig(file=str(tmp_path / "log.jsonl")), terminal=False) as log:
            process = RobotProcess(on_port(settings, port), log, Observers(on_cycle=plant))
            summary = await process.run(arm=True, seconds=PATIENCE_S)
    assert summary["mode"] == "SAFE_STOP"
    (reason,) = summary["stop_reasons"]
    assert reason.startswith("5 cycles in a row left no time for the next one"), reason
    assert "hold_the_loop" in reason, reason
    assert 45 <= summary["cycles"] <= 60
    timing = summary["timing"]
    assert timing["overruns"] >= 5
    assert sum(count for culprit, count in timing["faults"].items() if "hold_the_loop" in culprit) >= 4, timing
