"""A console over real sockets, on a stub of the robot's process that keeps every request."""

from __future__ import annotations

import asyncio
import contextlib
import time as host_time
from collections.abc import AsyncIterator, Callable, Mapping, MutableMapping
from dataclasses import dataclass, field, replace
from typing import Any
from unittest import mock

import aiohttp
import numpy as np
import orjson
import structlog
from yarl import URL

from config.load import load_settings
from config.settings import Settings
from drivers.driver import LineState, Received
from drivers.messages import Firing, Flags, LinkCounts, Odometry, Pose, Twist
from perception.edits import Edit, Evidence
from perception.pipeline import Perception
from runtime.console.console import Console
from runtime.console.http.client_limits import Limits
from runtime.console.protocols import Controls, FileControl, RecordingControl, ReplayControl, SettingsFileControl
from runtime.cycle.callbacks import CALLBACKS
from runtime.cycle.drive_requests import DriveInput
from runtime.cycle.inputs import Request
from runtime.cycle.live_settings import LiveSettings
from runtime.cycle.modes import Mode, ModeState
from runtime.cycle.step import CycleRecord, Inputs, Refused, State
from runtime.support.health import Health
from runtime.support.kernel_loader import KernelLoader
from runtime.timing.clock_sampler import ClockSampler
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.time_control import TimeControl
from runtime.timing.timing_monitor import TimingMonitor
from tests.hil.machine import TIMEOUT_S
from tests.page_types import shape_error

NO_IDLE_FRAMES_S = 1e6
FREE_PORT = "console.port=0"


@dataclass
class StubDriver:
    """The counts that frames show of a driver."""

    counts: LinkCounts = field(default_factory=lambda: LinkCounts(7, 1, 2))


@dataclass
class StubRun:
    """Stub of `RobotProcess` that keeps every request."""

    settings: Settings
    log: Any
    asked: list[object] = field(default_factory=list)
    validity: list[Callable[[], bool]] = field(default_factory=list)
    """Of each request, as the cycle would ask for it."""
    edits_max: int = 8
    name: str | None = "denning"

    def __post_init__(self) -> None:
        self.health = Health(self.log)
        self.live_settings = LiveSettings(self.settings)
        self.live_settings.subscribe(self.asked.append)
        self.stats = CycleStats(0.005)
        self.in_thread = asyncio.to_thread
        self.timing_monitor = TimingMonitor(self.stats, ClockSampler().read, callbacks=CALLBACKS)
        self.state = State(Perception(self.settings.ring, self.settings.models, self.settings.perception))

    def stop(self) -> None:
        self.asked.append("stop")

    def request(self, request: Request, is_valid: Callable[[], bool] = lambda: True) -> None:
        self.asked.append(request)
        self.validity.append(is_valid)

    def drive_request(self, drive_request: DriveInput, is_valid: Callable[[], bool] = lambda: True) -> bool:
        if self.edits_max == 0:
            return False
        self.asked.append(drive_request)
        self.validity.append(is_valid)
        return True

    def edit(self, *edits: Edit) -> bool:
        if self.edits_max == 0:
            return False
        self.asked.extend(edits)
        return True

    def evidence(self, number: int) -> Evidence | None:
        return Evidence(number, "semicircle", supporting=3.5, opposing=-1.0) if number == 1 else None


class Page:
    """A page, reduced to its websocket; each of its messages carries a challenge issued at that moment."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse, challenge: Callable[[], int]) -> None:
        self.socket = socket
        self._challenge = challenge
        self.received: list[dict[str, Any]] = []
        self._id = 0

    async def next(self, *kinds: str) -> dict[str, Any]:
        """Return the next message of these types; keep every message."""
        while True:
            message = await asyncio.wait_for(self.socket.receive(), TIMEOUT_S)
            assert message.type is aiohttp.WSMsgType.TEXT, message
            content: dict[str, Any] = orjson.loads(message.data)
            assert shape_error(content) is None
            self.received.append(content)
            if content["type"] in kinds:
                return content

    async def send(self, **message: Any) -> int:
        self._id += 1
        await self.socket.send_str(orjson.dumps({"id": self._id, "challenge": self._challenge(), **message}).decode())
        return self._id

    async def answer(self, number: int) -> dict[str, Any]:
        while (answer := await self.next("answer"))["id"] != number:
            pass
        return answer

    async def ask(self, **message: Any) -> dict[str, Any]:
        """Send a message and return its answer."""
        return await self.answer(await self.send(**message))

    async def closed(self) -> int | None:
        """Wait until the server has closed the connection; return the code that it gave.

        Where its connection is gone before this client answers it, as on a busy machine, aiohttp forgets that code.
        """
        while True:
            message = await asyncio.wait_for(self.socket.receive(), TIMEOUT_S)
            if message.type is aiohttp.WSMsgType.CLOSE:
                return int(message.data)
            if message.type in {aiohttp.WSMsgType.CLOSED, aiohttp.WSMsgType.CLOSING, aiohttp.WSMsgType.ERROR}:
                return self.socket.close_code


@dataclass
class ConsoleCase:
    """A console, the stub of its robot, and a session for pages."""

    run: StubRun
    console: Console
    session: aiohttp.ClientSession
    log: list[dict[str, Any]]
    clock: list[float]
    sockets: list[aiohttp.ClientWebSocketResponse] = field(default_factory=list)
    """Of every page that was connected."""
    cycle: int = 0

    @property
    def url(self) -> URL:
        return URL(self.console.url)

    @property
    def origin(self) -> str:
        return str(self.url.origin())

    @property
    def token(self) -> str:
        return self.url.query["token"]

    async def connect(self, *, token: str | None = "", origin: str | None = "", host: str | None = None) -> Page:
        """Connect a page; an empty token or origin stands for the right one."""
        query = {} if token is None else {"token": token or self.token}
        headers = {} if origin is None else {"Origin": origin or self.origin}
        if host is not None:
            headers["Host"] = host
        socket = await self.session.ws_connect(
            self.url.with_path("/ws").with_query(query), headers=headers, max_msg_size=0
        )
        self.sockets.append(socket)
        return Page(socket, self.console.hub.challenges.issue)

    async def page(self) -> Page:
        """Connect a page and wait for its session message."""
        page = await self.connect()
        await page.next("session")
        return page

    def cycles(
        self, count: int = 1, *, step_s: float = 0.05, outcomes: tuple[str | None, ...] = (), **inputs: Any
    ) -> None:
        """Run cycles, each with a firing of three sensors."""
        for _ in range(count):
            self.cycle += 1
            self.clock[0] += step_s
            robot_s = 0.05 * self.cycle
            ranges = np.full(len(self.run.settings.ring.mounts), np.nan)
            ranges[self.cycle % 8 :: 8] = 1.5, np.inf, 2.5
            pose = Pose(0.02 * self.cycle, 0.0, 0.0)
            odometry = Odometry(robot_s, pose, 0.0, Twist(0.3, 0.0), Flags.NONE, 0)
            received = Received((Firing(robot_s, pose, 0.0, ranges),), odometry, rebooted=False)
            state = self.run.state
            state.cycle, state.odometry = self.cycle, odometry
            refused = tuple(Refused(k, why) for k, why in enumerate(outcomes) if why is not None)
            made = sum(state.perception.observe(firing) for firing in received.firings)
            record = CycleRecord(
                self.cycle, replace(Inputs(robot_s, LineState.READY, None, received), **inputs),
                ModeState(Mode.DRIVE), Twist(0.3, 0.0), made, state.perception.counts.segments,
                state.perception.counts.hypotheses, 2, 2, "quota", refused,
            )  # fmt: skip
            self.console.on_cycle(record, state, self.run.stats, StubDriver())  # type: ignore[arg-type]

    def refusals(self) -> list[str]:
        """Return the reasons of all refusals in the log."""
        return [str(line["reason"]) for line in self.log if line["event"] == "console refused"]

    async def settled(self, done: Callable[[], bool], what: str) -> None:
        """Run the loop until a condition holds."""
        end_s = host_time.monotonic() + TIMEOUT_S
        while not done():
            assert host_time.monotonic() < end_s, f"timed out waiting for {what}"
            await asyncio.sleep(0.001)


@contextlib.asynccontextmanager
async def open_console(
    *sets: str,
    time: TimeControl | None = None,
    recording: RecordingControl | None = None,
    replay: ReplayControl | None = None,
    files: FileControl | None = None,
    settings_files: SettingsFileControl | None = None,
    limits: Limits | None = None,
    emulated: bool = True,
    idle_period_s: float = NO_IDLE_FRAMES_S,
) -> AsyncIterator[ConsoleCase]:
    """Open a console whose clock advances with cycles only.

    Its ticker for frames without a cycle follows the host's clock, so it is off unless `idle_period_s` is given: on a
    busy machine it would add frames.
    """
    lines: list[dict[str, Any]] = []
    clock = [1000.0]

    def keep(_logger: object, _name: str, event: MutableMapping[str, Any]) -> Mapping[str, Any]:
        lines.append(dict(event))
        raise structlog.DropEvent

    log = structlog.wrap_logger(None, processors=[structlog.processors.add_log_level, keep])
    settings = load_settings("hallway", ["perception.method=paper", FREE_PORT, *sets])
    run = StubRun(settings, log)
    console = Console(
        run,
        log,
        KernelLoader(log),
        emulated=emulated,
        controls=Controls(time, recording, replay, files, settings_files),
        limits=limits,
        clock=lambda: clock[0],
    )
    before = asyncio.all_tasks()
    with (
        run.health.catching_unhandled_errors(),
        mock.patch("runtime.console.frames.frame_publisher.IDLE_PERIOD_S", idle_period_s),
    ):
        async with aiohttp.ClientSession() as session:
            case = ConsoleCase(run, console, session, lines, clock)
            async with console.open():
                yield case
            for socket in case.sockets:
                await socket.close()  # else its collection may fail a later test
        left = [task for task in asyncio.all_tasks() - before if "aiohttp.connector" not in repr(task)]
        assert not left, "a task outlived the console"
    assert run.health.fault() is None
