"""The time of an emulator on a real pty, controlled by this process: paused, stepped, sped up; stopped and killed."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from config.load import load_settings
from config.settings import LogConfig
from drivers.driver import RobotDriver
from drivers.messages import Flags
from runtime.cli.commands.run.run_settings import with_port
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.step import CycleRecord, State
from runtime.recording.reader import open_recording
from runtime.recording.recorder import Recorder
from runtime.recording.storage import SingleFile
from runtime.recording.verification import verify_recording
from runtime.simulation.emulator_process import start_emulator
from runtime.support.logs import open_log
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.run_clock import ScaledClock
from runtime.timing.time_control import ENDED, HANGS, EmulatorTimeControl
from tests.hil.machine import TIMEOUT_S
from tests.hil.running import DEADMAN_S, PATIENT
from tests.hil.truth import Truth

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

SETTINGS = load_settings("hallway", PATIENT[1::2])
PAUSE_S = 1.2 * DEADMAN_S
STEPS = 5


async def until(done: Callable[[], bool]) -> None:
    """Wait for an event."""
    async with asyncio.timeout(TIMEOUT_S):
        while not done():
            await asyncio.sleep(0.002)


@dataclass
class Drive:
    """A run on an emulator of its own."""

    process: RobotProcess
    control: EmulatorTimeControl
    records: list[CycleRecord]
    truth: Truth
    recorded: Path

    async def comes_to(self, mode: Mode) -> None:
        """Wait for a mode; for DRIVE arm until it drives, because a busy machine may stop it by itself."""

        def is_there() -> bool:
            state = self.records[-1].mode if self.records else None
            if mode is Mode.DRIVE and state is not None and state.mode is not mode and state.arming_run_s is None:
                self.process.request(Request.ARM)
            return state is not None and state.mode is mode

        await until(is_there)

    async def advances(self, cycles: int) -> None:
        """Wait for so many further cycles."""
        last = len(self.records) + cycles
        await until(lambda: len(self.records) >= last)


@asynccontextmanager
async def driving(folder: Path) -> AsyncIterator[Drive]:
    """Drive on an emulator; the run has ended and its recording is complete afterwards."""
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
                yield Drive(process, control, records, Truth(trace), recorded)
            finally:
                process.stop()
                await running


async def test_paused_stepped_and_sped_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it does to the robot is tested in virtual time; here, that the emulator follows over its pipes."""
    monkeypatch.setattr("runtime.timing.time_control.ANSWER_MAX_S", TIMEOUT_S)
    monkeypatch.setattr("runtime.simulation.emulator_process.START_MAX_S", TIMEOUT_S)
    monkeypatch.setattr("runtime.cycle.connection.CONNECT_MAX_S", TIMEOUT_S)
    async with driving(tmp_path) as drive:
        control = drive.control
        await drive.comes_to(Mode.DRIVE)
        await drive.advances(20)

        assert await control.pause() is None
        cycles, here_s = len(drive.records), control.clock()
        await asyncio.sleep(PAUSE_S)
        assert (len(drive.records), control.clock()) == (cycles, here_s)
        for step in range(1, STEPS + 1):
            assert await control.single_step() is None
            assert len(drive.records) == cycles + step

        drive.process.request(Request.HALT)
        await asyncio.sleep(0.1)
        assert len(drive.records) == cycles + STEPS, "a HALT is no reason for a cycle"
        assert await control.resume() is None
        await drive.comes_to(Mode.SAFE_STOP)
        await until(lambda: (row := drive.truth.read()[-1]).still and bool(row.flags & Flags.LATCHED))

        for speed in (3.0, 0.5, 1.0):
            assert await control.set_speed(speed) is None
            assert control.speed == speed
            await drive.advances(5)

        (pid,) = emulators()
        os.kill(pid, signal.SIGSTOP)
        try:
            with monkeypatch.context() as impatient:
                impatient.setattr("runtime.timing.time_control.ANSWER_MAX_S", 0.1)
                assert await control.pause() == HANGS
        finally:
            os.kill(pid, signal.SIGCONT)
        assert await control.pause() is None
        os.kill(pid, signal.SIGKILL)
        await until(lambda: not control.is_paused)
        assert await control.resume() == ENDED
        assert await control.single_step() == ENDED
        await drive.advances(5)
    with open_recording(drive.recorded) as recording:
        result = verify_recording(recording)
    assert result.cycles > cycles
    assert result.first_difference is None
    assert not result.missing


def emulators() -> list[int]:
    """Return the emulators that this process started."""
    tasks = Path("/proc/self/task").iterdir()
    pids = [pid for task in tasks for pid in (task / "children").read_text().split()]
    return [int(pid) for pid in pids if b"emulate" in Path(f"/proc/{pid}/cmdline").read_bytes()]
