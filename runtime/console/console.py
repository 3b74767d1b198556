"""The console put together: it follows a run, serves its page, and hands on what operators ask for.

In a cycle it does next to nothing. What clients see is put together in a callback of its own after the cycle, and
only where there are clients; the books of time name it, as they name what is received and what is sent.
"""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Any, Final

from config.reload import differences
from config.settings import Settings
from drivers.driver import RobotDriver
from runtime.console.clients.client import Client
from runtime.console.clients.client_hub import Hub
from runtime.console.commands.async_commands import AsyncCommands
from runtime.console.commands.command_error import CommandError
from runtime.console.commands.dispatcher import CommandDispatcher
from runtime.console.commands.parameters import parameters
from runtime.console.commands.tuning import Tuning
from runtime.console.frames.frame_encoder import NO_FRAMES, FrameContext, FrameEncoder
from runtime.console.frames.session_info import session_info
from runtime.console.http.auth import SCHEME, Auth, in_address, is_loopback, new_token
from runtime.console.http.client_limits import ConsoleLog, Limits
from runtime.console.http.connection_limits import listen
from runtime.console.http.server import Server, ServerContext
from runtime.console.http.static_files import page_files
from runtime.console.protocols import NOT_HERE, Run
from runtime.console.timed_coroutine import timed_coroutine
from runtime.cycle.process import CONSOLE_FRAME, CONSOLE_RECEIVE
from runtime.cycle.reloader import Ready
from runtime.cycle.step import CycleRecord, State
from runtime.support.health import describe_exception
from runtime.support.length_format import Units
from runtime.timing.cycle_stats import CycleStats

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

FRAME_S: Final = 0.05
"""FrameEncoder are at least so far apart, on average."""
EARLY_S: Final = 0.01
"""A cycle that ends so much early still has its frame."""
STILL_S: Final = 1.0
"""So often there is a frame though no cycle ends: time stands still, or the robot has not answered yet."""


class Console:
    """The operator console of one run.

    Parameters
    ----------
    process : Run
        The run.
    settings : Settings
        It was started with.
    log : structlog logger
        Told of who comes and goes, and of who was refused what.
    take_over : callable
        Gets settings that were changed from the page.
    ready : Ready
        Awaited before a further model is looked for.
    emulated : bool
        Whether the settings' world is what the robot meets.
    units : {"m", "ft"}
        In which figures are shown at first.
    async_commands : AsyncCommands
        Whoever holds time and recordings.
    limits : Limits, optional
        What clients may cost.
    clock : callable
        The host's: monotonic, s, whatever the run's clock does.

    Attributes
    ----------
    url
        Where it is found, token included; empty before it is open.
    tunnel
        The call that brings it to another machine where it is found on this one only.
    """

    def __init__(
        self,
        process: Run,
        settings: Settings,
        log: FilteringBoundLogger,
        take_over: Callable[[Settings], None],
        ready: Ready,
        *,
        emulated: bool,
        units: Units = "m",
        async_commands: AsyncCommands | None = None,
        limits: Limits | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._process = process
        self._log = log
        self._clock = clock
        self._emulated = emulated
        self._units: Units = units
        self._config = settings.console
        self._overtime = AsyncCommands() if async_commands is None else async_commands
        self._limits = Limits(clients=settings.console.clients_max) if limits is None else limits
        self._encoder = FrameEncoder(settings)
        self._notes = ConsoleLog(log, clock)
        self._take_over = take_over
        self._shown = settings
        self.hub = Hub(self._limits, clock, self._control_left)
        self.tuning = Tuning(settings, self._tuned, ready, emulated=emulated)
        self.dispatcher = CommandDispatcher(
            process, self.hub, self.tuning, self._overtime, self._notes, self._spawn, clock
        )
        timed = process.timing_monitor.timed
        self._timed_frame = timed(CONSOLE_FRAME, self._frame)
        self._timed_tick = timed(CONSOLE_FRAME, self._tick)
        self._last: tuple[CycleRecord, State, CycleStats, RobotDriver] | None = None
        self._is_asked_for = False
        self._due_s = 0.0
        self._shown_s = 0.0
        self._ticker: asyncio.TimerHandle | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._failure: str | None = None
        self._server: Server | None = None
        self.url = ""
        self.tunnel: str | None = None

    def on_cycle(self, record: CycleRecord, state: State, stats: CycleStats, driver: RobotDriver) -> None:
        """Take note of a cycle; what is to be shown of it is put together after it."""
        if self._failure is None:
            try:
                self._note(record, state, stats, driver)
            except Exception as error:  # noqa: BLE001 - told by the probe; the cycle itself has not failed
                self._fail(error)

    def _note(self, record: CycleRecord, state: State, stats: CycleStats, driver: RobotDriver) -> None:
        self._encoder.take(record)
        if record.inputs.edits:
            refused = {one.edit: one.why for one in record.refused}
            self.dispatcher.edited([refused.get(k) for k in range(len(record.inputs.edits))])
        if self._last is None and self.hub.clients:
            # Now the robot has told its name.
            self.hub.greet(self._hello())
        self._last = (record, state, stats, driver)
        now_s = self._clock()
        # While cycles overrun, what is only looked at comes last: the ticker shows enough.
        if self.hub.clients and now_s >= self._due_s - EARLY_S and not self._process.timing_monitor.overruns_in_a_row:
            # From where it was due, so that a frame that comes late does not make all others later.
            self._due_s = max(self._due_s + FRAME_S, now_s + FRAME_S - 2.0 * EARLY_S)
            self._ask_for_frame()

    def _ask_for_frame(self) -> None:
        """Have a frame put together once the loop is free."""
        if self.hub.clients and not self._is_asked_for:
            self._is_asked_for = True
            asyncio.get_running_loop().call_soon(self._timed_frame)

    def adopt(self, settings: Settings) -> None:
        """Take note of settings that came from elsewhere, as from a file that was read again."""
        self.tuning.adopt(settings)
        self._show_settings(settings)

    def probe(self) -> str | None:
        """Say how it ended; None while it works. See `runtime.support.health`."""
        if self._failure is None and self._server is not None and not self._server.is_open:
            return "it does not listen any more"
        return self._failure

    @asynccontextmanager
    async def open(self) -> AsyncIterator[None]:
        """Serve while the run lasts.

        Raises
        ------
        Complaint
            There is nowhere to listen, or no page to show.
        """
        loop = asyncio.get_running_loop()
        pages = page_files()
        listening = await listen(self._config)
        address, port = listening.getsockname()[:2]
        token, host = new_token(), self._config.host
        own = (socket.gethostname(), f"{socket.gethostname()}.local")
        names = (host,) if is_loopback(address) else (host, *own)
        timed = self._process.timing_monitor.timed
        house = ServerContext(
            guard=Auth(token, names, port), hub=self.hub, limits=self._limits, notes=self._notes,
            files=pages, hello=self._hello, on_message=self.dispatcher.take, on_leave=self._left,
            on_fault=self._process.health.report, report=self._report,
            watch_without_token=self._config.watch_without_token, timed=timed, clock=self._clock,
        )  # fmt: skip
        self.hub.bind(loop)
        server = Server(house)
        await server.open(listening)
        self._server = server
        shown = own[0] if address in {"0.0.0.0", "::"} else host  # noqa: S104 - recognised, not bound to
        where = f"{SCHEME}://{in_address(shown)}:{port}/"
        self.url = f"{where}?token={token}"
        self.tunnel = f"ssh -L {port}:127.0.0.1:{port} {own[0]}" if is_loopback(address) else None
        elsewhere = {} if self.tunnel is None else {"from_elsewhere": self.tunnel}
        self._log.info("console", url=where, start_url=self.url, **elsewhere)
        if self.tunnel is None:
            self._log.warning(
                "the console is open to other machines: whoever has the token can drive, and nothing is encrypted"
            )
        self._ticker = loop.call_later(STILL_S, self._timed_tick)
        self._process.health.watch("console", self.probe)
        try:
            yield
        finally:
            self._ticker.cancel()
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)
            self._server = None
            await server.close()
            if self._overtime.player is not None:
                await self._overtime.player.close()

    def hints(self) -> list[str]:
        """Return what an operator at the terminal is told: where the page is, and how to get there from elsewhere."""
        lines = [f"console: {self.url}"]
        if self.tunnel is not None:
            lines.append(f"from another machine: {self.tunnel}, then the same address there")
        return lines

    def _frame(self) -> None:
        """Put a frame together and have it ready for every client; none of them is waited for."""
        self._is_asked_for = False
        if self._failure is not None:
            return
        try:
            self._show()
        except Exception as error:  # noqa: BLE001 - told by the probe, and the robot stands
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        self._failure = describe_exception(error)
        self._log.error("the console cannot show the run any more", exc_info=error)

    def _show(self) -> None:
        now_s = self._clock()
        self._shown_s = now_s
        for client in self.hub.look_after(now_s):
            self._notes.refuse(f"nothing was taken for {self._limits.stall_s:g} s", client.name)
        if not self.hub.clients:
            return
        latest = self._process.timing_monitor.last_cycle()
        record, state, missed, late, link = None, self._process.state, 0, 0, NO_FRAMES
        if self._last is not None:
            record, state, stats, driver = self._last
            missed, late, link = stats.missed, stats.late, driver.counts
        time_control, recording = self._overtime.time, self._overtime.recording
        context = FrameContext(
            host_s=now_s, clients=len(self.hub.clients), phases_s=latest.phases_s, late_s=latest.late_s,
            missed=missed, late=late, link=link, recording=None if recording is None else recording.now,
            is_paused=time_control is not None and time_control.is_paused,
            speed=1.0 if time_control is None else time_control.speed,
        )  # fmt: skip
        self.hub.publish(self._encoder.frame(state, record, context))

    def _tick(self) -> None:
        """Have a frame also where no cycle ends."""
        self._ticker = asyncio.get_running_loop().call_later(STILL_S, self._timed_tick)
        if self.hub.clients and not self._is_asked_for and self._clock() - self._shown_s > 0.5 * STILL_S:
            self._frame()

    def _hello(self) -> dict[str, Any]:
        # The first frame comes with the next cycle, whenever the last one was.
        self._due_s = 0.0
        return {
            **session_info(
                self.tuning.current, name=self._process.name, emulated=self._emulated, units=self._units
            ),
            "recording": self._overtime.recording is not None,
        }  # fmt: skip

    def _tuned(self, settings: Settings) -> None:
        changed = [str(difference) for difference in differences(self._shown, settings)]
        self._log.info("the configuration is changed from the console", changed=changed)
        self._take_over(settings)
        self._show_settings(settings)

    def _show_settings(self, settings: Settings) -> None:
        before, self._shown = self._shown, settings
        self._due_s = 0.0
        self._encoder.adopt(settings)
        if settings.models != before.models:
            self.hub.greet(self._hello())
        else:
            self.hub.tell({"type": "parameters", "parameters": parameters(settings)})

    def _left(self, client: Client) -> None:
        """Take note that a client is gone."""
        if client.task is not None:
            client.task.cancel()
        if self._overtime.player is not None:
            self._overtime.player.leave(client)

    def _control_left(self) -> None:
        self.dispatcher.release_teleoperation()

    async def _report(self) -> bytes:
        if self._overtime.player is None:
            raise CommandError(f"report: {NOT_HERE}")
        return await self._overtime.player.report()

    def _spawn(self, client: Client, work: Callable[[], Awaitable[None]]) -> None:
        """Have what takes its time done by a task that is looked after."""
        name = f"console work {client.number}"

        async def run() -> None:
            try:
                await timed_coroutine(self._process.timing_monitor.timed, CONSOLE_RECEIVE, _awaited(work))
            except asyncio.CancelledError:
                raise
            except Exception as error:  # noqa: BLE001 - told as a fault of the program
                self._process.health.report(f"task `{name}`", error)
            self._timed_frame()  # where time stands still now no cycle has one

        task = client.task = asyncio.create_task(run(), name=name)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


async def _awaited(work: Callable[[], Awaitable[None]]) -> None:
    await work()
