"""P10: when any part of the process ends or raises, the robot halts within two cycles; the reason names the part."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from collections.abc import Callable, Mapping, MutableMapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import structlog
from rich.console import Console

from drivers.denning.codec import Decoder
from drivers.denning.frames import Drive, Frame
from drivers.driver import RobotDriver
from drivers.messages import Flags
from runtime.cli.terminal.view import View
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.reloader import Reloader
from runtime.cycle.step import CycleRecord, State
from runtime.cycle.summary import RunSummary
from runtime.recording.recorder import Recorder
from runtime.recording.storage import SingleFile
from runtime.recording.writer import RecordingWriter
from runtime.support.background_writer import BackgroundWriter
from runtime.support.health import Worker
from runtime.support.kernel_loader import KernelLoader
from runtime.support.logs import LogStatus
from runtime.support.sd_notify import SdNotifier
from runtime.timing.cycle_stats import CycleStats
from tests.hil.machine import TIMEOUT_S
from tests.runtime.cli.terminal.test_view import EMPTY
from tests.runtime.virtual_time import VirtualLoop, in_virtual_time

pytestmark = [pytest.mark.compiled, pytest.mark.promise("P10")]

PLANT = 40
"""The cycle in which something is killed: the robot drives by then."""
LAST = 90
WITHIN = 2

Plant = Callable[[RobotProcess, VirtualLoop], None]


@dataclass
class Watched:
    """A run with something planted in it."""

    plant: Plant
    monkeypatch: pytest.MonkeyPatch
    arm_at: int | None = None
    modes: dict[int, Mode] = field(default_factory=dict)
    sent: list[tuple[int, Frame]] = field(default_factory=list)
    log: list[dict[str, object]] = field(default_factory=list)
    fed: list[int] = field(default_factory=list)
    flags: Flags = Flags.NONE
    observers: tuple[Callable[[CycleRecord, State], None], ...] = ()

    def run(self, prepare: Callable[[RobotProcess], None] = lambda _process: None) -> RunSummary:
        """Run for `LAST` cycles and keep what there was."""
        decoder = Decoder("host")

        def on_bytes(way: str, _run_s: float, _host_s: float, data: bytes) -> None:
            if way == "out":
                self.sent += [(len(self.modes), frame) for frame in decoder.feed(data)]

        def on_cycle(record: CycleRecord, state: State, _stats: CycleStats, _driver: RobotDriver) -> None:
            self.modes[record.cycle] = record.mode.mode
            for observer in self.observers:
                observer(record, state)
            while True:
                try:
                    datagram = manager.recv(4096)
                except BlockingIOError:
                    break
                self.fed += [record.cycle] * (datagram == b"WATCHDOG=1")
            if record.cycle == PLANT:
                assert record.mode.mode is Mode.DRIVE
                self.plant(process, loop)
            elif record.cycle == self.arm_at:
                process.request(Request.ARM)
            elif record.cycle == LAST:
                process.stop()

        def keep(_logger: object, _name: str, event: MutableMapping[str, Any]) -> Mapping[str, Any]:
            self.log.append(dict(event))
            raise structlog.DropEvent

        with (
            in_virtual_time(self.monkeypatch, "perception.method=paper") as (loop, settings, robot, links),
            socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager,
        ):
            name = f"echolocate-test-{id(self)}"
            manager.bind(f"\0{name}")
            manager.settimeout(0.0)
            with SdNotifier(f"@{name}", watchdog_s=0.2) as notifier:
                log = structlog.wrap_logger(None, processors=[keep])
                observers = Observers(on_cycle, on_bytes=on_bytes)
                process = RobotProcess(settings, log, observers, loop.time, notifier)
                prepare(process)
                summary = loop.run_until_complete(process.run(arm=True, seconds=None))
                links[0].live()
                self.flags = robot.truth.flags
        return summary

    def assert_stopped_because(self, summary: RunSummary, cause: str) -> None:
        """Assert that the robot stood within two cycles and reported the reason, and that nothing fed its deadman."""
        stopped = next(cycle for cycle, mode in self.modes.items() if cycle >= PLANT and mode is Mode.SAFE_STOP)
        assert stopped <= PLANT + WITHIN
        assert any(cause in reason for reason in summary["stop_reasons"]), summary["stop_reasons"]
        reason = next(reason for reason in summary["stop_reasons"] if cause in reason)
        assert "likely through a program error: see the log" in reason
        if self.arm_at is None:
            assert all(self.modes[cycle] is Mode.SAFE_STOP for cycle in range(stopped, LAST))
            assert not [frame for cycle, frame in self.sent if isinstance(frame, Drive) and cycle >= stopped]
        assert any(event.get("level") != "info" or "exc_info" in event for event in self.log)


def cancel(name: str) -> Plant:
    def plant(_process: RobotProcess, loop: VirtualLoop) -> None:
        (task,) = [task for task in asyncio.all_tasks(loop) if task.get_name() == name]
        task.cancel()

    return plant


def test_a_task_that_is_killed(monkeypatch: pytest.MonkeyPatch, measured: Callable[[str], None]) -> None:
    """The only task besides the cycle's; it is not restarted, so arming does not help."""
    names: set[str] = set()

    def plant(process: RobotProcess, loop: VirtualLoop) -> None:
        names.update(task.get_name() for task in asyncio.all_tasks(loop) if task is not asyncio.current_task(loop))
        cancel("link")(process, loop)

    run = Watched(plant, monkeypatch, arm_at=PLANT + 20)
    summary = run.run()
    assert names == {"link"}, "another task, which no test kills"
    run.assert_stopped_because(summary, "the part `link` of this program has ended (it ended without an error)")
    assert all(run.modes[cycle] is Mode.SAFE_STOP for cycle in range(PLANT + WITHIN, LAST))
    assert run.flags & Flags.DEADMAN, "its line is closed, so the deadman has stopped it"
    assert max(run.fed) <= PLANT + WITHIN < LAST - 20, "so the watchdog fires"
    measured("each task of the loop cancelled, each thread and callback raising: SAFE_STOP ≤ 2 cycles later, by name")


def test_a_task_that_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    async def broken() -> None:
        await asyncio.sleep(0.0)
        raise ZeroDivisionError("planted")

    def plant(process: RobotProcess, loop: VirtualLoop) -> None:
        process.health.watch_task("planner", loop.create_task(broken()))

    run = Watched(plant, monkeypatch)
    summary = run.run()
    run.assert_stopped_because(
        summary, "the part `planner` of this program has ended (ZeroDivisionError: planted, test_health"
    )


def test_a_task_that_is_not_awaited(monkeypatch: pytest.MonkeyPatch) -> None:
    async def broken() -> None:
        raise ZeroDivisionError("planted")

    def plant(_process: RobotProcess, loop: VirtualLoop) -> None:
        loop.create_task(broken(), name="stray")

    run = Watched(plant, monkeypatch)
    summary = run.run()
    run.assert_stopped_because(summary, "task `stray` (ZeroDivisionError: planted")


def test_a_callback_that_raises_is_over_and_may_be_armed_after(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail_at_once() -> None:
        raise ZeroDivisionError("planted")

    def plant(_process: RobotProcess, loop: VirtualLoop) -> None:
        loop.call_soon(fail_at_once)

    run = Watched(plant, monkeypatch, arm_at=PLANT + 20)
    summary = run.run()
    run.assert_stopped_because(summary, "callback `fail_at_once` (ZeroDivisionError: planted")
    assert run.modes[LAST] is Mode.DRIVE
    assert max(run.fed) >= LAST - 10


def test_the_cycle_itself_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The process halts the base before it ends."""

    def plant(_process: RobotProcess, loop: VirtualLoop) -> None:
        task = asyncio.current_task(loop)
        assert task is not None
        task.cancel()

    run = Watched(plant, monkeypatch)
    with pytest.raises(asyncio.CancelledError):
        run.run()
    assert not [frame for cycle, frame in run.sent if isinstance(frame, Drive) and cycle > PLANT]
    assert any(type(frame).__name__ == "Halt" for _, frame in run.sent)


def wait_for_end(worker: Callable[[], str | None]) -> None:
    """Wait until a thread has ended."""
    end_s = time.monotonic() + TIMEOUT_S
    while worker() is None:
        assert time.monotonic() < end_s
        time.sleep(0.001)


def test_a_thread_that_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    go = threading.Event()

    def work() -> None:
        go.wait()
        raise ZeroDivisionError("planted")

    worker = Worker("planner", work)
    worker.start()

    def plant(_process: RobotProcess, _loop: VirtualLoop) -> None:
        go.set()
        wait_for_end(worker.probe)

    run = Watched(plant, monkeypatch)
    summary = run.run(lambda process: process.health.watch("planner", worker.probe))
    run.assert_stopped_because(summary, "the part `planner` of this program has ended (ZeroDivisionError: planted")
    assert max(run.fed) <= PLANT + WITHIN


def test_the_recorders_thread(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """An error that the disk does not explain is a fault of the program."""
    broken = threading.Event()
    enter = RecordingWriter._enter

    def fail(self: RecordingWriter, item: object) -> None:
        if broken.is_set():
            raise ZeroDivisionError("planted")
        enter(self, item)  # type: ignore[arg-type]

    monkeypatch.setattr(RecordingWriter, "_enter", fail)
    from tests.recorded import hall

    with Recorder(hall(), SingleFile(tmp_path / "run.mcap")) as recorder:

        def plant(_process: RobotProcess, _loop: VirtualLoop) -> None:
            broken.set()
            recorder.on_log({"event": "one more"})
            wait_for_end(recorder.probe)

        run = Watched(plant, monkeypatch, observers=(recorder.on_cycle,))
        summary = run.run(lambda process: process.health.watch("recorder", recorder.probe))
    run.assert_stopped_because(summary, "the part `recorder` of this program has ended (ZeroDivisionError: planted")


def test_the_views_thread(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from tests.recorded import hall

    with (tmp_path / "screen").open("w") as screen:
        view = View(hall(), Console(file=screen, force_terminal=True), "m")

        def fail() -> bool:
            raise ZeroDivisionError("planted")

        view.is_paused = fail
        with view.shown():

            def plant(_process: RobotProcess, _loop: VirtualLoop) -> None:
                view._slot = EMPTY
                view.draw_again()
                wait_for_end(view.probe)

            run = Watched(plant, monkeypatch)
            summary = run.run(lambda process: process.health.watch("view", view.probe))
    run.assert_stopped_because(summary, "the part `view` of this program has ended (ZeroDivisionError: planted")


def test_the_logs_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_line: bytes) -> None:
        raise ZeroDivisionError("planted")

    standing = LogStatus()
    with BackgroundWriter("log", fail) as standing.file:

        def plant(_process: RobotProcess, _loop: VirtualLoop) -> None:
            assert standing.file is not None
            standing.file.put(b"a line\n")
            wait_for_end(standing.probe)

        run = Watched(plant, monkeypatch)
        summary = run.run(lambda process: process.health.watch("log", standing.probe))
    run.assert_stopped_because(summary, "the part `log` of this program has ended (ZeroDivisionError: planted")


def test_the_reload_that_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    log = structlog.wrap_logger(None, processors=[_drop])

    def prepare(process: RobotProcess) -> None:
        from tests.recorded import hall

        reloaders.append(Reloader(process.live_settings, hall, log, KernelLoader(log)))
        process.health.watch("reload", reloaders[0].probe)

    def plant(_process: RobotProcess, loop: VirtualLoop) -> None:
        async def forever() -> None:
            await asyncio.sleep(1e6)

        reloaders[0]._task = loop.create_task(forever(), name="reload")
        loop.call_soon(cancel("reload"), _process, loop)

    reloaders: list[Reloader] = []
    run = Watched(plant, monkeypatch)
    run.assert_stopped_because(run.run(prepare), "the part `reload` of this program has ended")


def _drop(*_: object) -> dict[str, object]:
    raise structlog.DropEvent
