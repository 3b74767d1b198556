"""A robot drives while a client seeks in a recording and has a report made: no cycle becomes later."""

from __future__ import annotations

import asyncio
import itertools
import logging
import random
from pathlib import Path

import numpy as np
import pytest

from config.load import load_settings
from config.settings import LogConfig
from drivers.driver import RobotDriver
from runtime.cli.commands.run.run_settings import with_port
from runtime.console.files.jobs import Jobs
from runtime.console.playback.replay_client import ReplayClient
from runtime.cycle.modes import Mode
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.step import CycleRecord, State
from runtime.simulation.emulator_process import start_emulator
from runtime.support.logs import open_log
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.run_clock import ScaledClock
from tests.hil.machine import TIMEOUT_S, stalls_excused
from tests.recorded import hall, record
from tests.runtime.console.playback.test_replay_client import PROGRAM, Page

pytestmark = pytest.mark.usefixtures("warm_kernels")

WINDOWS = 4
WINDOW_S = 1.25


@stalls_excused
async def test_replay_and_report_do_not_make_cycles_late(tmp_path: Path) -> None:
    recorded = tmp_path / "hall.mcap"
    record(hall("recording.keyframe_period_s=40.0"), recorded, 12.0)
    settings, rng, page = load_settings("hallway"), random.Random(1), Page()
    late_s: dict[bool, list[float]] = {False: [], True: []}
    busy, records = [False], list[CycleRecord]()
    frames = 0

    def on_cycle(record: CycleRecord, _state: State, stats: CycleStats, _driver: RobotDriver) -> None:
        records.append(record)
        if stats.lag.count:
            late_s[busy[0]].append(stats.lag.newest_s)

    clock = ScaledClock()
    client, jobs = ReplayClient(tmp_path, PROGRAM, lambda: str(recorded)), Jobs()
    async with start_emulator([], clock) as (port, _):
        with open_log(LogConfig(file=str(tmp_path / "log.jsonl")), terminal=False) as log:
            process = RobotProcess(with_port(settings, port), log, Observers(on_cycle), clock)
            running = asyncio.create_task(process.run(arm=True, seconds=None))
            async with asyncio.timeout(TIMEOUT_S):
                while not (records and records[-1].mode.mode is Mode.DRIVE):
                    await asyncio.sleep(0.05)
            await client.open(page, "hall.mcap")
            report = None
            for _, busy[0] in itertools.product(range(WINDOWS // 2), (False, True)):
                if busy[0] and report is None:
                    report = jobs.start("report", recorded.name, recorded)
                end_s = clock() + WINDOW_S
                while clock() < end_s:
                    if busy[0]:
                        await client.seek(page, rng.uniform(0.0, 12.0))
                    await asyncio.sleep(0.1)
                if busy[0] and report is not None:
                    frames = len(page.frames)
            process.stop()
            summary = await running
    await client.close()
    assert report is not None
    async with asyncio.timeout(TIMEOUT_S):
        while not jobs.listed()[0]["over"]:
            await asyncio.sleep(0.05)
    assert jobs.listed()[0]["error"] is None
    await jobs.close()
    assert frames > 3, "frames were replayed meanwhile"
    assert (summary["mode"], summary["stop_reasons"]) == ("DRIVE", [])
    idle, busy_s = np.array(late_s[False]), np.array(late_s[True])
    quantiles_ms = {name: np.round(1e3 * np.quantile(values, [0.5, 0.9, 0.99]), 2).tolist()
            for name, values in (("idle", idle), ("replaying", busy_s))}  # fmt: skip
    logging.getLogger(__name__).info("lateness p50, p90, p99, ms: %s; %d frames", quantiles_ms, frames)
    assert np.quantile(busy_s, 0.5) <= 2.0 * np.quantile(idle, 0.5) + 0.001, quantiles_ms
    assert np.quantile(busy_s, 0.9) <= 2.0 * np.quantile(idle, 0.9) + 0.003, quantiles_ms
