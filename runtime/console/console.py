"""The operator console of a run: puts together server, clients, commands and frames, and serves during the run."""

from __future__ import annotations

import asyncio
import socket
import time as host_time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from config.errors import UserError
from config.reload import Difference
from config.settings import Settings
from drivers.driver import RobotDriver
from runtime.console.clients.challenges import PERIOD_S
from runtime.console.clients.client import Client
from runtime.console.clients.client_hub import ClientHub
from runtime.console.clients.control import Holder
from runtime.console.commands.command import CommandContext
from runtime.console.commands.dispatcher import CommandDispatcher
from runtime.console.commands.parameters import parameters
from runtime.console.commands.place_commands import places_message
from runtime.console.commands.registry import reader
from runtime.console.commands.tuning import Tuning
from runtime.console.frames.frame_publisher import FramePublisher
from runtime.console.frames.session_info import session_info
from runtime.console.http.auth import SCHEME, Auth, is_loopback, new_token, url_host
from runtime.console.http.client_limits import ConsoleLog, Limits
from runtime.console.http.connection_limits import listen
from runtime.console.http.server import Server, ServerContext
from runtime.console.http.static_files import StaticFile, page_files
from runtime.console.protocols import NO_CONTROLS, Controls, Run
from runtime.console.timed_coroutine import timed_coroutine
from runtime.cycle.callbacks import CONSOLE_RECEIVE, CONSOLE_SEND
from runtime.cycle.inputs import Request
from runtime.cycle.live_settings import PrepareSettings
from runtime.cycle.modes import Mode
from runtime.cycle.step import CycleRecord, State
from runtime.support.kept_token import kept_token
from runtime.support.length_format import Units
from runtime.support.restart import console_before
from runtime.support.user_folders import state_folder
from runtime.timing.cycle_stats import CycleStats

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger


class Console:
    """The operator console of one run.

    Parameters
    ----------
    run : Run
        The robot's process.
    log : structlog logger
        Gets who connects, what is refused, and what is changed.
    prepare : PrepareSettings
        Awaited before a further model is recognised.
    emulated : bool
        Whether the robot is emulated in the settings' world.
    units : {"m", "ft"}
        In which the page shows lengths at first.
    controls : Controls
        What it can do beside driving.
    limits : Limits, optional
        What clients may cost.
    clock : callable
        The host's clock: monotonic, s; it continues while the run is paused.

    Attributes
    ----------
    url
        The start URL with the token; empty before the console is open.
    token
        What the start URL carries; empty before the console is open.
    listening
        The address and the port on which the console listens; None before it is open.
    tunnel
        The ssh command that forwards the console to another machine; None if it listens on other addresses anyway.
    """

    def __init__(
        self,
        run: Run,
        log: FilteringBoundLogger,
        prepare: PrepareSettings,
        *,
        emulated: bool,
        units: Units = "m",
        controls: Controls = NO_CONTROLS,
        limits: Limits | None = None,
        clock: Callable[[], float] = host_time.monotonic,
    ) -> None:
        settings = run.live_settings.current
        self._run = run
        self._log = log
        self._clock = clock
        self._emulated = emulated
        self._units: Units = units
        self._config = settings.console
        config = settings.console
        default = Limits(clients=config.clients_max, command_age_max_s=config.command_age_max_s)
        self._limits = default if limits is None else limits
        self._console_log = ConsoleLog(log, clock)
        self._shown, self._places = _in_session(settings), settings.places
        """What pages were sent last of these settings."""
        self.hub = ClientHub(self._limits, clock, self._on_control_lost)
        self.tuning = Tuning(run.live_settings, prepare, self._on_tuned, emulated=emulated)
        run.live_settings.subscribe(self._show_settings)
        self._commands = CommandContext(run, self.hub, self.tuning, clock, *controls)
        if controls.files is not None:
            controls.files.jobs.broadcast = self.hub.broadcast
        self.dispatcher = CommandDispatcher(self._commands, self._console_log, self._start_task)
        self._publisher = FramePublisher(run, self.hub, self._commands, settings, log, clock, self._on_stalled)
        self._issue_challenge = run.timing_monitor.timed(CONSOLE_SEND, self._challenge)
        self._challenge_timer: asyncio.TimerHandle | None = None
        self._mode = run.state.mode
        """Of the last cycle."""
        self._tasks: set[asyncio.Task[Any]] = set()
        """Asynchronous commands under way."""
        self._server: Server | None = None
        self.url, self.token = "", ""
        self.listening: tuple[str, int] | None = None
        self._robots: Sequence[Mapping[str, Any]] = ()
        self._local_runs: Sequence[Mapping[str, Any]] = ()
        self.tunnel: str | None = None
        self._replaced_port: int | None = None
        """The port of the settings, where another program has it."""

    def on_cycle(self, record: CycleRecord, state: State, stats: CycleStats, driver: RobotDriver) -> None:
        """Take in a cycle; its frame is encoded later."""
        before, self._mode = self._mode, state.mode
        if state.mode.entered_since(before) and state.mode.mode in {Mode.SAFE_STOP, Mode.FAULT}:
            self.hub.void_challenges()  # whatever stopped it, a command from before must not set it in motion again
        if self._publisher.failure is not None:
            return
        try:
            if record.inputs.received.rebooted:
                self._commands.history.clear()
            if record.inputs.edits:
                refused = {one.edit: one.why for one in record.refused}
                undos = state.undos or ((),) * len(record.inputs.edits)
                self.dispatcher.edits_done([(refused.get(k), undo) for k, undo in enumerate(undos)])
            if self._publisher.is_first_cycle and self.hub.clients:
                self.hub.begin_session(self._session())  # now the robot's name is known
            self._publisher.take(record, state, stats, driver)
        except Exception as error:  # noqa: BLE001 - the health probe reports it; the cycle itself has not failed
            self._publisher.fail(error)

    def probe(self) -> str | None:
        """Return how the console ended, None while it works. See `runtime.support.health`."""
        if self._publisher.failure is None and self._server is not None and not self._server.is_open:
            return "it does not listen any more"
        return self._publisher.failure

    @asynccontextmanager
    async def open(self) -> AsyncIterator[None]:
        """Serve while the context lasts.

        Raises
        ------
        UserError
            The console cannot listen, or its page is not installed.
        """
        files = page_files()
        before = console_before()
        listening = await listen(self._config, None if before is None else before.port)
        address, port = self.listening = listening.getsockname()[:2]
        host = self._config.host
        self.token = token = self._token() if before is None else before.token
        own_names = (socket.gethostname(), f"{socket.gethostname()}.local")
        names = (host,) if is_loopback(address) else (host, *own_names)
        self.hub.bind(asyncio.get_running_loop())
        self._server = Server(self._server_context(Auth(token, names, port), files))
        await self._server.open(listening)
        is_wildcard = address in {"0.0.0.0", "::"}  # noqa: S104 - compared, not bound to
        address_url = f"{SCHEME}://{url_host(own_names[0] if is_wildcard else host)}:{port}/"
        self.url = f"{address_url}?token={token}"
        self.tunnel = f"ssh -L {port}:127.0.0.1:{port} {own_names[0]}" if is_loopback(address) else None
        remote = {} if self.tunnel is None else {"from_elsewhere": self.tunnel}
        if self._config.port not in {0, port}:
            self._replaced_port = self._config.port
            self._log.warning(f"port {self._config.port} of console.port is in use, so the console has port {port}")
        self._log.info("console", url=address_url, start_url=self.url, **remote)
        if self.tunnel is None:
            self._log.warning(
                "the console accepts other machines: anyone with the token can drive, and nothing is encrypted"
            )
        self._publisher.open()
        # Made while the robot is being connected, or the first command would wait for it; no cycle waits for it.
        making = asyncio.create_task(self._run.in_thread(reader), name="reader of commands")
        self._tasks.add(making)
        making.add_done_callback(self._tasks.discard)
        self._challenge()
        self._run.health.watch("console", self.probe)
        try:
            yield
        finally:
            await self._close(self._server)

    def show_robots(self, robots: Sequence[Mapping[str, Any]]) -> None:
        """Show other robots of the local network on every page: name, mode, url, version of each."""
        self._robots = robots
        self.hub.broadcast({"type": "robots", "robots": self._others()})

    def show_local_runs(self, runs: Sequence[Mapping[str, Any]]) -> None:
        """Show the other runs of this machine on every page, in the same form."""
        self._local_runs = runs
        self.hub.broadcast({"type": "robots", "robots": self._others()})

    def _others(self) -> list[Mapping[str, Any]]:
        """Return the other runs that pages list, this machine's first."""
        return [*self._local_runs, *self._robots]

    def hints(self) -> list[str]:
        """Return lines for the terminal: where the page is, and how to reach it from another machine."""
        lines = [f"console: {self.url}"]
        if self._replaced_port is not None:
            lines.append(f"console.port {self._replaced_port} is in use by another program")
        if self.tunnel is not None:
            lines.append(f"from another machine: {self.tunnel}, then the same address there")
        return lines

    def _token(self) -> str:
        """Return the token of this run, kept in a file for later ones if the settings say so.

        Trouble with the file stops no robot: it is logged, and the run has a token of its own.
        """
        if not self._config.keep_token:
            return new_token()
        try:
            return kept_token(state_folder(), new_token)
        except UserError as error:
            self._log.warning(
                "this run has a token of its own: pages opened before cannot come back", reason=str(error)
            )
            return new_token()

    def _server_context(self, auth: Auth, files: dict[str, StaticFile]) -> ServerContext:
        """Return what the server serves."""
        return ServerContext(
            auth=auth,
            hub=self.hub,
            limits=self._limits,
            log=self._console_log,
            files=files,
            session=lambda: {**self._session(), "history": self._publisher.history.listed()},
            on_message=self.dispatcher.receive,
            on_leave=self._on_leave,
            on_fault=self._run.health.report,
            file_of=self._file_of,
            watch_without_token=self._config.watch_without_token,
            timed=self._run.timing_monitor.timed,
            clock=self._clock,
        )

    async def _close(self, server: Server) -> None:
        """End frames, challenges, commands under way, connections and replays, in this order."""
        self._publisher.close()
        if self._challenge_timer is not None:
            self._challenge_timer.cancel()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._server = None
        await server.close()
        if self._commands.replay is not None:
            await self._commands.replay.close()

    def _challenge(self) -> None:
        """Send every client a new challenge, now and after every period."""
        self._challenge_timer = asyncio.get_running_loop().call_later(PERIOD_S, self._issue_challenge)
        self.hub.issue_challenge()

    def _session(self) -> dict[str, Any]:
        """Return the session information; the first frame follows the next cycle."""
        self._publisher.expedite()
        info = session_info(
            self._run.live_settings.current, name=self._run.name, emulated=self._emulated, units=self._units
        )
        places = places_message(self._run.live_settings.current)
        return {
            **info,
            "robots": self._others(),
            "places": places,
        }

    def _on_tuned(self, changed: tuple[Difference, ...]) -> None:
        """Note in the log what pages changed."""
        self._console_log.note("configuration changed from the console", changed=[str(one) for one in changed])

    def _show_settings(self, settings: Settings) -> None:
        """Send pages the settings that have come into force: a new session only if that has what changed."""
        before, self._shown = self._shown, _in_session(settings)
        self._publisher.adopt(settings)
        if self._shown != before:
            self._commands.history.clear()  # what was kept of objects refers to the models there were
            self.hub.begin_session(self._session())
        else:
            self.hub.broadcast({"type": "parameters", "parameters": parameters(settings)})
        if settings.places != self._places:
            self._places = settings.places
            self.hub.broadcast(places_message(settings))

    def _on_stalled(self, client: str) -> None:
        self._console_log.refuse(f"it accepted no data for {self._limits.stall_s:g} s: disconnected", client)

    def _on_control_lost(self, client: Holder) -> None:
        """End what begins or keeps a motion only for the client that had control."""
        self.dispatcher.end_teleoperation()
        if self._commands.armed_by is client:
            self._commands.armed_by = None
            if self._run.state.mode.arming_run_s is not None:
                self._run.request(Request.DISARM)  # it would begin to drive for an operator who did not arm it

    def _on_leave(self, client: Client) -> None:
        """End the command and the replay of a client that has gone."""
        if client.task is not None:
            client.task.cancel()
        if self._commands.replay is not None:
            self._commands.replay.leave(client)

    async def _file_of(self, path: str, job: str, name: str) -> Path | None:
        """Return the path of a recording, or of a file that a job made; None if there is none of this name."""
        files = self._commands.files
        if files is None:
            return None
        if path == "/made":
            return files.jobs.path_of(int(job), name) if job.isascii() and job.isdigit() and len(job) < 10 else None
        try:
            return await files.find(name)
        except UserError:
            return None

    def _start_task(self, client: Client, work: Callable[[], Awaitable[None]]) -> None:
        """Run an asynchronous command as a task that ends with the console; report its unexpected errors."""
        name = f"console command {client.number}"

        async def run() -> None:
            try:
                await timed_coroutine(self._run.timing_monitor.timed, CONSOLE_RECEIVE, _as_coroutine(work))
            except asyncio.CancelledError:
                raise
            except Exception as error:  # noqa: BLE001 - reported as a fault of the program
                self._run.health.report(f"task `{name}`", error)
            self._publisher.publish()  # a paused run has no cycle that would

        task = client.task = asyncio.create_task(run(), name=name)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


async def _as_coroutine(work: Callable[[], Awaitable[None]]) -> None:
    await work()


def _in_session(settings: Settings) -> tuple[object, ...]:
    """Return what the session information has of the settings that a running process may change."""
    return settings.models, settings.perception.localization.known_room
