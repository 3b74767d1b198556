"""The operator console of the real command on a real pty: it is found, drives, halts, and ends with the run."""

from __future__ import annotations

import asyncio
import json
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
from runtime.cli.commands.run import with_port
from runtime.console.console import Console
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.step import CycleRecord, State
from runtime.recording.channels import LOG
from runtime.recording.reader import open_recording
from runtime.simulation.emulator_process import start_emulator
from runtime.support.kernel_loader import KernelLoader
from runtime.support.logs import open_log
from runtime.timing.cycle_stats import CycleStats
from tests.hil.machine import TIMEOUT_S, stalls_excused
from tests.hil.running import emulated, running, start_url
from tests.hil.truth import Truth
from tests.rawpage import RawPage

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

FREE_PORT = ("--set", "console.port=0")
CYCLE_S = 0.05
WATCHDOG_S = 0.25
SLOW_M_S = 0.1
STOPPING_S = SLOW_M_S / 0.5
"""At the base's own deceleration."""


@stalls_excused
def test_from_the_start_url_to_the_end_of_the_run(tmp_path: Path) -> None:
    recording, more = tmp_path / "run.mcap", tmp_path / "more.toml"
    more.write_text('robot = "denning"\nbehaviors.move_ahead.distance_m = 6.1\n', "utf-8")
    with emulated(tmp_path) as robot, running(
        tmp_path, "run", "run", str(more), "--port", robot.port, "--record", str(recording), *FREE_PORT
    ) as run:  # fmt: skip
        url = start_url(run)
        token = url.partition("token=")[2]
        assert "from_elsewhere='ssh -L " in run.err
        page = RawPage(url)
        session = page.next("session")
        assert (session["role"], session["emulated"], session["truth"]) == ("control", False, None)
        run.comes_to("READY")
        assert page.ask(type="arm")["ok"]
        run.comes_to("DRIVE")
        assert page.ask(type="set_parameter", path="behaviors.arbiter.base_velocity_m_s", value=0.2)["ok"]
        while (frame := page.next("state"))["mode"] != "DRIVE":
            pass
        assert frame["controller"]
        assert page.ask(type="halt")["ok"]
        run.comes_to("SAFE_STOP")
        more.write_text('robot = "denning"\nbehaviors.move_ahead.distance_m = 5.0\n', "utf-8")
        run.signal(signal.SIGHUP)
        values = {p["path"]: p["value"] for p in page.next("parameters")["parameters"]}
        if values["behaviors.move_ahead.distance_m"] != 5.0:
            values = {p["path"]: p["value"] for p in page.next("parameters")["parameters"]}
        assert values["behaviors.move_ahead.distance_m"] == 5.0
        assert values["behaviors.arbiter.base_velocity_m_s"] == 0.3, "as the file has it"
        run.signal(signal.SIGTERM)
        with pytest.raises(ConnectionError, match="the run is over"):
            page.next("nothing that is ever said")
        page.close()
        assert run.end() == 0
        log = (tmp_path / "run.jsonl").read_text("utf-8")
        assert token in log
        assert '"event":"a part' not in log
        with open_recording(recording) as recorded:
            lines = [bytes(entry.data).decode() for entry in recorded.messages() if entry.topic == LOG]
        assert [line for line in lines if '"console"' in line]
        assert not [line for line in lines if token in line]


@stalls_excused
def test_without_one(tmp_path: Path) -> None:
    with emulated(tmp_path) as robot, running(
        tmp_path, "run", "run", "--port", robot.port, "--no-console", "--no-record", "--seconds", "0.5"
    ) as run:  # fmt: skip
        assert run.end() == 0
        assert "console" not in run.err


def test_where_there_is_nowhere_to_listen(tmp_path: Path) -> None:
    with emulated(tmp_path) as robot:
        for name, host, code in (("far", "192.0.2.1", 1), ("none", "no.such.host.invalid", 2)):
            with running(
                tmp_path, name, "run", "--port", robot.port, "--no-record", "--set", f"console.host={host}"
            ) as run:
                assert run.end() == code
                assert len(run.error_lines) == 1
                assert host in run.error_lines[0]


class Hand:
    """A page that holds a key down."""

    def __init__(self, page: RawPage) -> None:
        self._page = page
        self._let_go = threading.Event()
        self._worker = threading.Thread(target=self._hold, name="hand")
        self.last_s = 0.0
        self._worker.start()

    def let_go(self) -> float:
        """Say nothing more; return when the last word was said, by the host's clock."""
        self._let_go.set()
        self._worker.join()
        return self.last_s

    def _hold(self) -> None:
        while not self._let_go.wait(0.05):
            self._page.say(type="teleoperate", v=SLOW_M_S, w=0.0)
            self.last_s = time.monotonic()


@stalls_excused
@pytest.mark.parametrize("how", ["the page falls silent", "the tab is closed", "the network is gone"])
def test_the_hand_leaves_the_stick(how: str, tmp_path: Path) -> None:
    """By the emulator's truth: it stands a watchdog, a cycle and the way it needs to stop after the last word."""
    with emulated(tmp_path) as robot, running(
        tmp_path, "run", "run", "--port", robot.port, "--no-record", *FREE_PORT
    ) as run:  # fmt: skip
        truth, page = Truth(robot.trace), RawPage(start_url(run))
        run.comes_to("READY")
        page.say(type="teleoperate", v=0.0, w=0.0)
        page.say(type="arm")
        page.read_on()
        run.comes_to("DRIVE")
        hand = Hand(page)
        truth.wait(lambda row: row.v > 0.9 * SLOW_M_S, "the wheels turning")
        last_s = hand.let_go()
        if how == "the tab is closed":
            page.close()
        elif how == "the network is gone":
            page.cut()
        still = truth.wait(lambda row: row.host_s > last_s and row.still, "standing")
        moving = [row.host_s for row in truth.rows if row.host_s > last_s and not row.still]
        stood_s = (moving[-1] if moving else still.host_s) - last_s
        watchdog_s = WATCHDOG_S if how == "the page falls silent" else 0.0
        assert stood_s < watchdog_s + CYCLE_S + STOPPING_S + 0.15, f"it stood {stood_s:.3f} s after the last word"
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


@pytest.mark.promise("P2")
async def test_halt_from_a_page_in_time(tmp_path: Path, measured: Callable[[str], None]) -> None:
    """Within one cycle and 10 ms, with cycles busy for most of their time and another page that never reads."""
    operator = Operator(asyncio.get_running_loop())
    ears, settings = Decoder("host"), load_settings("hallway", ["console.port=0"])

    def on_bytes(way: str, host_s: float, data: bytes) -> None:
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


BOX = 'name = "crate"\nclosed = true\nvertices_m = [[0.4, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.4, -0.3]]\n'


@stalls_excused
def test_the_first_model_with_corners_while_it_drives(tmp_path: Path) -> None:
    """Its kernels are prepared in another process: the robot drives on, and none is compiled or loaded later."""
    summary = tmp_path / "summary.json"
    with emulated(tmp_path) as robot, running(
        tmp_path, "run", "run", "--port", robot.port, "--arm", "--no-record", "--json", str(summary), *FREE_PORT
    ) as run:  # fmt: skip
        page = RawPage(start_url(run))
        assert page.ask(type="take_control")["ok"]
        run.comes_to("DRIVE")
        assert page.ask(type="load_model", toml=BOX)["data"] == {"name": "crate"}
        assert page.ask(type="place_model", model="crate", x=2.0, y=1.0, theta=0.3)["ok"]
        seen = next(o for o in page.next("state")["objects"] if o["model"] == "crate")
        assert page.ask(type="evidence", object=seen["number"])["ok"]
        assert page.ask(type="reject_object", object=seen["number"])["ok"]
        page.close()
        run.signal(signal.SIGTERM)
        assert run.end() == 0
        assert run.modes() == ["READY", "DRIVE"], run.err
    assert json.loads(summary.read_text("utf-8"))["process"]["compilations"] == 0
