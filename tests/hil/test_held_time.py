"""The emulator's time in this process's hands, on a real pty: held, stepped and sped up while the robot drives."""

from __future__ import annotations

import asyncio
import itertools
import logging
import os
import signal
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from config.load import load_settings
from config.settings import LogConfig
from drivers.driver import RobotDriver
from drivers.messages import Flags
from runtime.cli.commands.run import with_port
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.step import CycleRecord, State
from runtime.cycle.summary import RunSummary
from runtime.recording.reader import open_recording
from runtime.recording.recorder import Recorder
from runtime.recording.storage import SingleFile
from runtime.recording.verification import verify_recording
from runtime.simulation.emulator_process import start_emulator
from runtime.support.logs import open_log
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.run_clock import ScaledClock
from runtime.timing.time_control import ENDED, HANGS, EmulatorTimeControl
from tests.hil.machine import TIMEOUT_S, stalls_excused
from tests.hil.truth import rows

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

SETTINGS = load_settings("hallway")
PERIOD_S = 1.0 / SETTINGS.cycle.rate_hz
PAUSE_S = 1.0
"""Twice the base's deadman, and more than any timeout of the line."""

Act = Callable[[RobotProcess, EmulatorTimeControl, list[CycleRecord]], Awaitable[None]]


async def until(done: Callable[[], bool]) -> None:
    async with asyncio.timeout(TIMEOUT_S):
        while not done():
            await asyncio.sleep(0.002)


async def run(folder: Path, act: Act) -> tuple[RunSummary, list[CycleRecord], Path, Path]:
    """Drive on an emulator of our own, do something to its time, and end; returns truth and recording as well."""
    trace, recorded, records = folder / "trace.csv", folder / "run.mcap", list[CycleRecord]()
    clock = ScaledClock()
    async with start_emulator(["--trace", str(trace)], clock) as (port, control):
        with (
            open_log(LogConfig(file=str(folder / "log.jsonl")), terminal=False) as log,
            Recorder(SETTINGS, SingleFile(recorded), clock, emulated=True) as recorder,
        ):

            def on_cycle(record: CycleRecord, state: State, _stats: CycleStats, _driver: RobotDriver) -> None:
                records.append(record)
                recorder.on_cycle(record, state)

            process = RobotProcess(with_port(SETTINGS, port), log, Observers(on_cycle), clock)
            running = asyncio.create_task(process.run(arm=True, seconds=None))
            try:
                await until(lambda: len(records) >= 20 and records[-1].mode.mode is Mode.DRIVE)
                await act(process, control, records)
            finally:
                process.stop()
                summary = await running
    return summary, records, trace, recorded


def replays_to_the_bit(recorded: Path) -> bool:
    with open_recording(recorded) as recording:
        result = verify_recording(recording)
    return result.cycles > 20 and result.first_difference is None and not result.missing


@stalls_excused
async def test_held_stepped_and_sped_up_the_robot_drives_on(tmp_path: Path) -> None:
    async def act(_process: RobotProcess, control: EmulatorTimeControl, records: list[CycleRecord]) -> None:
        assert await control.pause() is None
        cycles, here_s = len(records), control.clock()
        await asyncio.sleep(PAUSE_S)
        assert (len(records), control.clock()) == (cycles, here_s)
        for _ in range(10):
            assert await control.single_step() is None
            cycles += 1
            assert len(records) == cycles
        assert await control.resume() is None
        await until(lambda: len(records) >= cycles + 20)
        assert await control.set_speed(3.0) is None
        cycles, run_s, host_s = len(records), control.clock(), time.monotonic()
        await until(lambda: len(records) >= cycles + 60)
        speed = (control.clock() - run_s) / (time.monotonic() - host_s)
        logging.getLogger(__name__).info("three times real time was %.2f", speed)
        assert 1.2 < speed < 3.1
        assert await control.set_speed(0.5) is None
        cycles = len(records)
        await until(lambda: len(records) >= cycles + 10)
        assert await control.set_speed(1.0) is None
        cycles = len(records)
        await until(lambda: len(records) >= cycles + 20)

    summary, records, trace, recorded = await run(tmp_path, act)
    assert (summary["mode"], summary["stop_reasons"]) == ("DRIVE", [])
    assert (summary["link"]["bad"], summary["link"]["lost"]) == (0, 0)
    times = [record.inputs.run_s for record in records]
    assert max(b - a for a, b in itertools.pairwise(times)) < 4.0 * PERIOD_S, "the run knows of no pause"
    driven = [row for row in rows(trace) if not row.flags & (Flags.LATCHED | Flags.DEADMAN)]
    assert max(b.t_s - a.t_s for a, b in itertools.pairwise(driven)) < 0.1, "the deadman never tripped"
    assert replays_to_the_bit(recorded)


@stalls_excused
async def test_a_halt_while_it_is_held_leaves_nothing_to_move(tmp_path: Path) -> None:
    async def act(process: RobotProcess, control: EmulatorTimeControl, records: list[CycleRecord]) -> None:
        await until(lambda: rows(trace)[-1].v > 0.2)
        assert await control.pause() is None
        held_s.append(control.clock())
        process.request(Request.HALT)
        await asyncio.sleep(0.3)
        assert await control.resume() is None
        await until(lambda: records[-1].mode.mode is Mode.SAFE_STOP)

    trace, held_s = tmp_path / "trace.csv", list[float]()
    summary, _, trace, _ = await run(tmp_path, act)
    assert summary["stop_reasons"] == ["halted by the operator; re-arm to continue"]
    after = [row for row in rows(trace) if row.host_s > held_s[0] + 0.03]
    assert after
    assert all(row.flags & Flags.LATCHED for row in after), "it was heard where time stood still"
    assert all(row.still for row in after if row.host_s > held_s[0] + 0.3)


@stalls_excused
async def test_an_emulator_that_is_stopped_and_one_that_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def act(_process: RobotProcess, control: EmulatorTimeControl, records: list[CycleRecord]) -> None:
        (pid,) = children()
        os.kill(pid, signal.SIGSTOP)
        try:
            with monkeypatch.context() as impatient:
                impatient.setattr("runtime.timing.time_control.ANSWER_MAX_S", 0.3)
                assert await control.pause() == HANGS
            await until(lambda: records[-1].mode.mode is Mode.SAFE_STOP)
        finally:
            os.kill(pid, signal.SIGCONT)
        assert await control.pause() is None
        os.kill(pid, signal.SIGKILL)
        await until(lambda: not control.is_paused)
        assert await control.resume() == ENDED
        assert await control.single_step() == ENDED
        cycles = len(records)
        await until(lambda: len(records) >= cycles + 5)

    summary, _, _, _ = await run(tmp_path, act)
    assert "nothing received for" in summary["stop_reasons"][0]


def children() -> list[int]:
    """Return the emulators that this process started."""
    tasks = Path("/proc/self/task").iterdir()
    pids = [pid for task in tasks for pid in (task / "children").read_text().split()]
    return [int(pid) for pid in pids if b"emulate" in Path(f"/proc/{pid}/cmdline").read_bytes()]
