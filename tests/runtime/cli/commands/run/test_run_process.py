"""The signals of a run: requests while it lasts, a halt from before it, and an end before the robot is ready."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
import structlog

from config.errors import UserError
from config.load import load_settings
from runtime.cli.commands.run.run_process import run_process, signals
from runtime.cli.first_signals import ENDING, Remembered
from runtime.cycle.inputs import Request
from runtime.cycle.line_messages import ROBOT_LINE
from runtime.cycle.process import Observers, RobotProcess
from tests.hil.machine import TIMEOUT_S


class StubProcess:
    """Notes what it is asked for."""

    def __init__(self) -> None:
        self.asked: asyncio.Queue[object] = asyncio.Queue()

    def request(self, request: Request) -> None:
        self.asked.put_nowait(request)

    def stop(self) -> None:
        self.asked.put_nowait("stop")


class StubReloader:
    """Notes its requests in the process's queue."""

    def __init__(self, asked: asyncio.Queue[object]) -> None:
        self.asked = asked
        self.is_cancelled = False

    def request(self) -> None:
        self.asked.put_nowait("reload")

    def cancel(self) -> None:
        self.is_cancelled = True


@pytest.fixture
def _handlers_restored() -> Iterator[None]:
    handlers = {number: signal.getsignal(number) for number in (*ENDING, signal.SIGUSR1, signal.SIGUSR2)}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("_handlers_restored")
async def test_signals_are_requests_while_the_run_lasts() -> None:
    process = StubProcess()
    reloader = StubReloader(process.asked)
    expected = {
        signal.SIGINT: "stop",
        signal.SIGTERM: "stop",
        signal.SIGUSR1: Request.ARM,
        signal.SIGUSR2: Request.HALT,
        signal.SIGHUP: "reload",
    }
    with signals(process, reloader) as ending:  # type: ignore[arg-type]
        for number, asked in expected.items():
            signal.raise_signal(number)
            assert await asyncio.wait_for(process.asked.get(), TIMEOUT_S) == asked
    assert ending == [signal.SIGINT, signal.SIGTERM]
    assert reloader.is_cancelled
    for number in ENDING:
        with pytest.raises(SystemExit) as ended:  # a second one ends an end that takes long
            signal.raise_signal(number)
        assert ended.value.code == 128 + number
    assert {signal.getsignal(number) for number in expected.keys() - {*ENDING}} == {signal.SIG_DFL}


@pytest.mark.promise("P19")
@pytest.mark.usefixtures("_handlers_restored")
async def test_a_halt_from_before_the_run_stops_it_from_arming_the_robot() -> None:
    process = StubProcess()
    for number in (signal.SIGUSR1, signal.SIGUSR2):
        signal.signal(number, Remembered())
        signal.raise_signal(number)
    with signals(process, StubReloader(process.asked)):  # type: ignore[arg-type]
        assert process.asked.get_nowait() is Request.HALT
    assert process.asked.empty(), "no robot is armed later than it was asked for"


CAUSE = "the cycle failed: no space is left on the disk"


@pytest.mark.parametrize(
    ("is_connected", "number", "reasons"),
    [
        (True, None, [CAUSE]),
        (True, signal.SIGTERM, [CAUSE]),
        (False, None, [CAUSE, "ended before the robot was ready"]),
        (False, signal.SIGTERM, None),
    ],
)
@pytest.mark.usefixtures("_handlers_restored")
async def test_a_run_without_a_cycle_keeps_its_reason_unless_it_ended_before_the_robot_was_ready(
    is_connected: bool, number: signal.Signals | None, reasons: list[str] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A failure in the first cycle has its own reason, as that a kernel could not be compiled."""

    async def run(process: RobotProcess, **_: object) -> dict[str, Any]:
        process.is_connected = is_connected
        if number is not None:
            signal.raise_signal(number)
            await asyncio.wait_for(process._stop.wait(), TIMEOUT_S)
        return {"cycles": 0, "mode": "FAULT", "stop_reasons": [CAUSE], "process": {"compilations": 0}}

    monkeypatch.setattr(RobotProcess, "run", run)
    settings = load_settings("hallway", ["link.port=/none", "console.enabled=false"])
    plan: Any = SimpleNamespace(
        settings=settings, log_status=SimpleNamespace(listeners=[], probe=None), clock=lambda: 0.0, reload=None,
        is_armed=False, seconds=None,
    )  # fmt: skip
    recording: Any = SimpleNamespace(observers=lambda on_cycle, _log: Observers(on_cycle), probe=None)
    parts: dict[str, Any] = {"control": None, "view": None, "recording": recording, "preparation": None}
    running = run_process(plan, structlog.get_logger(), **parts, line_messages=ROBOT_LINE)
    if reasons is not None:
        assert (await running)["stop_reasons"] == reasons
        return
    with pytest.raises(UserError, match="ended by SIGTERM before the robot was ready") as ended:
        await running
    assert ended.value.exit_code == 128 + signal.SIGTERM
