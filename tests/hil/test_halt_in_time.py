"""P2 in real time: from the request to the HALT on a real pty, perception saturated and the disk standing still.

This is the long form; `make bench` asks thirty times, and virtual time a thousand times (test_halt_bounded.py).
"""

from __future__ import annotations

import asyncio
import os
import random
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from config.load import load_settings
from config.settings import LogConfig
from drivers.denning.codec import Decoder
from drivers.denning.frames import Halt
from drivers.driver import RobotDriver
from drivers.messages import Flags
from runtime.cli.commands.run.run_settings import with_port
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.step import CycleRecord, State
from runtime.recording.recorder import Recorder
from runtime.recording.storage import SingleFile
from runtime.simulation.emulator_process import start_emulator
from runtime.support.logs import open_log
from runtime.timing.cycle_stats import CycleStats
from tests.hil.machine import TIMEOUT_S
from tests.hil.truth import Truth

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels"), pytest.mark.promise("P2")]

CYCLE_S = 0.05
BOUND_S = CYCLE_S + 0.010
BUSY_S = 0.04
"""How long a cycle holds the loop: perception that has more to do than there is time."""
TURN_S = 0.002
ATTEMPTS = 8
"""A machine that holds up this loop and not its control does not do so eight times in a row."""


@dataclass
class Operator:
    """A thread that asks for a HALT again and again, and looks at its own clock meanwhile: the control."""

    trials: int
    loop: asyncio.AbstractEventLoop
    drives: threading.Event = field(default_factory=threading.Event)
    halted: threading.Event = field(default_factory=threading.Event)
    halted_s: float = 0.0
    asked_s: float | None = None
    waits_s: list[float] = field(default_factory=list)
    controls_s: list[float] = field(default_factory=list)
    failure: str | None = None
    process: RobotProcess | None = None

    def work(self) -> None:
        rng, failed = random.Random(5), 0
        while len(self.waits_s) < self.trials and self.failure is None:
            if not self.drives.wait(TIMEOUT_S):
                self.failure = "it does not drive"
                break
            time.sleep(rng.uniform(0.0, CYCLE_S))
            waited_s, control_s = self._ask()
            failed = failed + 1 if waited_s > BOUND_S + control_s else 0
            if failed == 0:
                self.waits_s.append(waited_s)
                self.controls_s.append(control_s)
            elif failed == ATTEMPTS:
                self.failure = f"{1e3 * waited_s:.1f} ms (control {1e3 * control_s:.1f})"
        assert self.process is not None
        self.loop.call_soon_threadsafe(self.process.stop)

    def _ask(self) -> tuple[float, float]:
        """Return how long a HALT took, and by how much the control overslept at worst meanwhile."""
        assert self.process is not None
        self.drives.clear()
        self.halted.clear()
        worst_s, last_s = 0.0, time.monotonic()
        self.asked_s = asked_s = last_s
        self.loop.call_soon_threadsafe(self.process.request, Request.HALT)
        while not self.halted.is_set() and last_s < asked_s + TIMEOUT_S:
            time.sleep(TURN_S)
            host_s = time.monotonic()
            worst_s, last_s = max(worst_s, host_s - last_s - TURN_S), host_s
        return self.halted_s - asked_s, worst_s


async def halts(folder: Path, monkeypatch: pytest.MonkeyPatch, trials: int) -> Operator:
    """Ask for so many halts while the process has its hands full."""
    monkeypatch.setattr(os, "fsync", lambda _fd: time.sleep(5.0))
    operator = Operator(trials, asyncio.get_running_loop())
    ears, trace = Decoder("host"), folder / "trace.csv"
    settings = load_settings("hallway")

    def on_bytes(way: str, run_s: float, host_s: float, data: bytes) -> None:
        recorder.on_bytes(way, run_s, host_s, data)
        is_halt = way == "out" and any(isinstance(frame, Halt) for frame in ears.feed(data))
        if is_halt and operator.asked_s is not None:
            operator.asked_s, operator.halted_s = None, host_s
            operator.halted.set()

    def on_cycle(record: CycleRecord, state: State, _stats: CycleStats, _driver: RobotDriver) -> None:
        recorder.on_cycle(record, state)
        mode = record.mode
        if mode.mode is Mode.DRIVE:
            if operator.asked_s is None:
                operator.drives.set()
            while time.monotonic() < record.inputs.run_s + BUSY_S:
                pass
        elif mode.arming_run_s is None and operator.asked_s is None:
            process.request(Request.ARM)

    with Recorder(settings, SingleFile(folder / "run.mcap")) as recorder:
        async with start_emulator(["--trace", str(trace)]) as (port, _):
            with open_log(LogConfig(file=str(folder / "log.jsonl")), terminal=False) as log:
                process = operator.process = RobotProcess(
                    with_port(settings, port), log, Observers(on_cycle, on_bytes=on_bytes)
                )
                asking = threading.Thread(target=operator.work)
                asking.start()
                await process.run(arm=True, seconds=TIMEOUT_S + 3.0 * trials)
                operator.failure = operator.failure or ("it ended too soon" if asking.is_alive() else None)
                asking.join()
    last = Truth(trace).read()[-1]
    assert last.still
    assert last.flags & Flags.LATCHED
    assert recorder.status.sync_max_s == 0.0 or recorder.status.sync_max_s >= 5.0
    return operator


def report(operator: Operator, measured: Callable[[str], None]) -> None:
    assert operator.failure is None, operator.failure
    worst = max(range(len(operator.waits_s)), key=lambda k: operator.waits_s[k])
    wait_ms, control_ms = 1e3 * operator.waits_s[worst], 1e3 * operator.controls_s[worst]
    measured(
        f"{len(operator.waits_s)} requests on the pty, cycles busy for {1e3 * BUSY_S:g} ms, the disk at a stand: "
        f"HALT on the line ≤ {wait_ms:.1f} ms later (control {control_ms:.1f})"
    )


@pytest.mark.soak
async def test_a_thousand_halts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, measured: Callable[[str], None]
) -> None:  # fmt: skip
    report(await halts(tmp_path, monkeypatch, 1000), measured)
