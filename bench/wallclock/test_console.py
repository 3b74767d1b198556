"""How soon the robot stops for a page that teleoperates it and is gone, and for its HALT."""

from __future__ import annotations

import asyncio
import random
import signal
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
from runtime.cli.commands.run.run_settings import with_port
from runtime.console.console import Console
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.step import CycleRecord, State
from runtime.simulation.emulator_process import start_emulator
from runtime.support.kernel_loader import KernelLoader
from runtime.support.logs import open_log
from runtime.timing.cycle_stats import CycleStats
from tests.hil.machine import TIMEOUT_S, stalls_excused
from tests.hil.running import emulated, running, start_url
from tests.hil.truth import Truth
from tests.rawpage import RawPage

pytestmark = pytest.mark.usefixtures("warm_kernels")

FREE_PORT = ("--set", "console.port=0")
CYCLE_S = 0.05
WATCHDOG_S = 0.25
SLOW_M_S = 0.1
STOPPING_S = SLOW_M_S / 0.5
"""At the base's own deceleration."""


class Teleoperator:
    """A page that repeats a velocity, as for a key that is held down."""

    def __init__(self, page: RawPage) -> None:
        self._page = page
        self._released = threading.Event()
        self._worker = threading.Thread(target=self._hold, name="teleoperator")
        self.last_s = 0.0
        self._worker.start()

    def release(self) -> float:
        """Send nothing more; return when the last velocity was sent, by the host's clock."""
        self._released.set()
        self._worker.join()
        return self.last_s

    def _hold(self) -> None:
        while not self._released.wait(0.05):
            self._page.say(type="teleoperate", v=SLOW_M_S, w=0.0)
            self.last_s = time.monotonic()


@stalls_excused
@pytest.mark.parametrize("how", ["the page falls silent", "the tab is closed", "the network is gone"])
def test_teleoperation_that_ends(how: str, tmp_path: Path, measured: Callable[[str], None]) -> None:
    """By the emulator's truth: the last velocity's validity, one cycle, and the way that it needs to stop."""
    with emulated(tmp_path, fresh=True) as robot, running(
        tmp_path, "run", "run", "--port", robot.port, "--no-record", *FREE_PORT, fresh=True
    ) as run:  # fmt: skip
        truth, page = Truth(robot.trace), RawPage(start_url(run))
        run.comes_to("READY")
        page.say(type="teleoperate", v=0.0, w=0.0)
        page.say(type="arm")
        page.read_on()
        run.comes_to("DRIVE")
        operator = Teleoperator(page)
        truth.wait(lambda row: row.v > 0.9 * SLOW_M_S, "the wheels turning")
        last_s = operator.release()
        if how == "the tab is closed":
            page.close()
        elif how == "the network is gone":
            page.cut()
        still = truth.wait(lambda row: row.host_s > last_s and row.still, "standing")
        moving = [row.host_s for row in truth.rows if row.host_s > last_s and not row.still]
        stood_s = (moving[-1] if moving else still.host_s) - last_s
        watchdog_s = WATCHDOG_S if how == "the page falls silent" else 0.0
        assert stood_s < watchdog_s + CYCLE_S + STOPPING_S + 0.15, f"it stood {stood_s:.3f} s after the last velocity"
        measured(f"still {stood_s:.3f} s after the last velocity: {how}")
        assert run.modes()[-1] == "DRIVE", "it stands, and may be driven on"
        page.close()
        run.signal(signal.SIGTERM)
        assert run.end() == 0


BUSY_S = 0.04
BOUND_S = CYCLE_S + 0.010
TURN_S = 0.002
TRIALS, ATTEMPTS = 20, 8


@dataclass
class Operator:
    """A thread with a page that presses HALT again and again, and looks at its own clock meanwhile: the control."""

    loop: asyncio.AbstractEventLoop
    drives: threading.Event = field(default_factory=threading.Event)
    halted: threading.Event = field(default_factory=threading.Event)
    url: str = ""
    asked_s: float | None = None
    halted_s: float = 0.0
    waits_s: list[float] = field(default_factory=list)
    controls_s: list[float] = field(default_factory=list)
    failure: str | None = None
    process: RobotProcess | None = None

    def work(self) -> None:
        rng, failed = random.Random(7), 0
        page = RawPage(self.url)
        page.read_on()
        while len(self.waits_s) < TRIALS and self.failure is None:
            if not self.drives.wait(TIMEOUT_S):
                self.failure = "it does not drive"
                break
            time.sleep(rng.uniform(0.0, CYCLE_S))
            waited_s, control_s = self._ask(page)
            failed = failed + 1 if waited_s > BOUND_S + control_s else 0
            if failed == 0:
                self.waits_s.append(waited_s)
                self.controls_s.append(control_s)
            elif failed == ATTEMPTS:
                self.failure = f"{1e3 * waited_s:.1f} ms (control {1e3 * control_s:.1f})"
        page.close()
        assert self.process is not None
        self.loop.call_soon_threadsafe(self.process.stop)

    def _ask(self, page: RawPage) -> tuple[float, float]:
        """Return how long a HALT took, and by how much the control overslept at worst meanwhile."""
        self.drives.clear()
        self.halted.clear()
        worst_s, last_s = 0.0, time.monotonic()
        self.asked_s = asked_s = last_s
        page.say(type="halt")
        while not self.halted.is_set() and last_s < asked_s + TIMEOUT_S:
            time.sleep(TURN_S)
            host_s = time.monotonic()
            worst_s, last_s = max(worst_s, host_s - last_s - TURN_S), host_s
        return self.halted_s - asked_s, worst_s


async def test_halt_from_a_page_in_time(tmp_path: Path, measured: Callable[[str], None]) -> None:
    """Within one cycle and 10 ms, with cycles busy for most of their time and another page that never reads."""
    operator = Operator(asyncio.get_running_loop())
    ears, settings = Decoder("host"), load_settings("hallway", ["console.port=0"])

    def on_bytes(way: str, _run_s: float, host_s: float, data: bytes) -> None:
        is_halt = way == "out" and any(isinstance(frame, Halt) for frame in ears.feed(data))
        if is_halt and operator.asked_s is not None:
            operator.asked_s, operator.halted_s = None, host_s
            operator.halted.set()

    def on_cycle(record: CycleRecord, state: State, stats: CycleStats, driver: RobotDriver) -> None:
        console.on_cycle(record, state, stats, driver)
        mode = record.mode
        if mode.mode is Mode.DRIVE:
            if operator.asked_s is None:
                operator.drives.set()
            while time.monotonic() < record.inputs.run_s + BUSY_S:
                pass
        elif mode.arming_run_s is None and operator.asked_s is None:
            process.request(Request.ARM)

    async with start_emulator([]) as (port, _control):
        with open_log(LogConfig(file=str(tmp_path / "log.jsonl")), terminal=False) as log:
            process = operator.process = RobotProcess(
                with_port(settings, port), log, Observers(on_cycle, on_bytes=on_bytes)
            )
            console = Console(process, log, KernelLoader(log), emulated=True)
            async with console.open():
                operator.url = console.url
                deaf = await asyncio.to_thread(RawPage, console.url)
                asking = threading.Thread(target=operator.work)
                asking.start()
                await process.run(arm=True, seconds=TIMEOUT_S + 3.0 * TRIALS)
                operator.failure = operator.failure or ("it ended too soon" if asking.is_alive() else None)
                deaf.close()
                asking.join()
    assert operator.failure is None, operator.failure
    worst = max(range(TRIALS), key=lambda k: operator.waits_s[k])
    wait_ms, control_ms = 1e3 * operator.waits_s[worst], 1e3 * operator.controls_s[worst]
    measured(
        f"{TRIALS} HALTs from a page, cycles busy for {1e3 * BUSY_S:g} ms, another page that never reads: "
        f"on the line ≤ {wait_ms:.1f} ms later (control {control_ms:.1f})"
    )
