"""A failure of the program itself: the base is halted first, the mode is FAULT, and the reason names the cause."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.load import load_settings
from config.settings import LogConfig
from drivers.driver import RobotDriver
from runtime.cli.commands.run import with_port
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.step import CycleRecord, State
from runtime.simulation.emulator_process import start_emulator
from runtime.support.logs import open_log
from runtime.timing.cycle_stats import CycleStats
from tests.hil.machine import TIMEOUT_S, stalls_excused
from tests.hil.truth import rows


@stalls_excused
@pytest.mark.realtime
@pytest.mark.usefixtures("warm_kernels")
async def test_a_cycle_that_fails_halts_the_base_and_ends_in_fault(tmp_path: Path) -> None:
    def fail(record: CycleRecord, *_: State | CycleStats | RobotDriver) -> None:
        if record.cycle == 40:
            raise ZeroDivisionError("planted")

    trace = tmp_path / "trace.csv"
    async with start_emulator(["--trace", str(trace)]) as (port, _):
        with open_log(LogConfig(file=str(tmp_path / "log.jsonl")), terminal=False) as log:
            process = RobotProcess(with_port(load_settings("hallway"), port), log, Observers(on_cycle=fail))
            summary = await process.run(arm=True, seconds=TIMEOUT_S)
    assert summary["mode"] == "FAULT"
    assert summary["cycles"] == 39
    assert "ZeroDivisionError: planted" in summary["stop_reasons"][-1]
    seen = rows(trace)
    assert max(row.v for row in seen) > 0.1
    assert seen[-1].still
    assert "planted" in (tmp_path / "log.jsonl").read_text()
