"""The robot's main process: one asyncio loop that gathers inputs, runs the step, and carries out what it decides.

This module, `runtime.timing` and drivers/ contain everything that waits, reads a clock or uses a port. All decisions
are made in `runtime.cycle.step` and in the functions that it calls.
"""

from __future__ import annotations

import asyncio
import gc
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from config.errors import UserError
from config.settings import Settings
from drivers.driver import LineState, RobotDriver
from drivers.line_budget import FLOOD_HOLD_S, ReceiveBudget
from drivers.link import Link
from drivers.messages import Firing, Twist
from drivers.registry import line_options, make_driver
from perception.edits import Edit, Evidence
from runtime.cycle.callbacks import CALLBACKS, COLLECTION, LINE_LOST, LINE_OPENED, LINE_SEND, LINK_RECEIVE
from runtime.cycle.connection import UNCONFIRMED_END, Connection
from runtime.cycle.drive_inputs import DriveInputs
from runtime.cycle.drive_requests import DriveInput
from runtime.cycle.inputs import Inputs, OperatorInput, Request, always_valid, command_gap_max_s, gather_inputs
from runtime.cycle.line_messages import ROBOT_LINE, LineMessages
from runtime.cycle.line_sender import LineSender
from runtime.cycle.live_settings import LiveSettings
from runtime.cycle.logs.alerts import Alerts
from runtime.cycle.logs.line_log import LineLog
from runtime.cycle.logs.mode_log import ModeLog
from runtime.cycle.logs.object_log import ObjectLog
from runtime.cycle.modes import NEVER_ARMED, Mode, ModeState
from runtime.cycle.preparation import Preparation, RunningPreparation, fresh_state
from runtime.cycle.step import Command, CycleRecord, State, apply_command, apply_settings, step
from runtime.cycle.summary import RunSummary, run_summary
from runtime.support.health import Health, describe_exception
from runtime.support.sd_notify import SdNotifier
from runtime.timing.clock_sampler import ClockSample
from runtime.timing.cycle_scheduler import CycleScheduler
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.footprint import Footprint
from runtime.timing.memory_policy import MemoryPolicy
from runtime.timing.phases import Phase
from runtime.timing.realtime import apply_realtime
from runtime.timing.run_clock import run_clock
from runtime.timing.timing_monitor import TimingMonitor

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

Direction: TypeAlias = Literal["in", "out"]
"""Of bytes on the line, as this process sees it."""

EDITS_MAX: Final = 64
"""Most edits of the map that wait: more than a person makes in a second."""
EDITS_PER_CYCLE: Final = 2
"""Most edits that one cycle carries out: each can take several milliseconds, in which no HALT is read."""

OnCycle: TypeAlias = Callable[[CycleRecord, State, CycleStats, RobotDriver], None]
"""Gets a cycle, the state it left, the timing of all cycles, and the driver for the counts of its line."""


@dataclass(frozen=True, slots=True)
class Observers:
    """Callbacks that follow the run; each must return quickly."""

    on_cycle: OnCycle | None = None
    on_firing: Callable[[Firing], None] | None = None
    on_bytes: Callable[[Direction, float, float, bytes], None] | None = None
    """Gets the direction, the moment by the run's clock and by the host's, and the bytes that went over the line."""
    on_settings: Callable[[Settings], None] | None = None
    """Gets settings that changed while the robot runs, before the first cycle under them."""
    on_starting: Callable[[str], None] | None = None
    """Gets how far the start is, now and then before the first cycle."""


class RobotProcess:
    """One run on one robot.

    Parameters
    ----------
    settings : Settings
        With `link.port` set.
    log : structlog logger
        Gets modes, alerts and failures.
    observers : Observers
        View, recorder and console.
    clock : callable
        Monotonic, s. A `RunClock` that can be paused pauses the run with it.
    notifier : SdNotifier, optional
        Reports to the service manager that started this process, if one did.
    preparation : Preparation, optional
        Prepares recognition beside the first cycles; None if it is ready.
    line_messages : LineMessages
        Words messages about the line for what is at its other end.

    Attributes
    ----------
    health : Health
        Watches the parts of the run; parts added to the run are registered here.
    live_settings : LiveSettings
        The settings in force; a change applies from the next cycle on.
    in_thread : callable
        Calls a function in a thread that rests while a cycle is due.
    is_connected : bool
        Whether the robot was ready before the first cycle.
    """

    def __init__(
        self,
        settings: Settings,
        log: FilteringBoundLogger,
        observers: Observers = Observers(),
        clock: Callable[[], float] = time.monotonic,
        notifier: SdNotifier | None = None,
        preparation: Preparation | None = None,
        line_messages: LineMessages = ROBOT_LINE,
    ) -> None:
        self._line_messages = line_messages
        self.live_settings = LiveSettings(settings)
        self._settings = settings
        """Those of the cycle in progress."""
        self._log, self._observers = log, observers
        self._clock = run_clock(clock)
        self._notifier = SdNotifier() if notifier is None else notifier
        self.health = Health(log)
        self._driver = make_driver(settings)
        self._state = fresh_state(settings, recognises=preparation is None)
        self._scheduler = CycleScheduler(settings, self._clock, CALLBACKS)
        self.in_thread = self._scheduler.gaps.to_thread
        used = (self.in_thread, self._state.perception)
        self._preparation = RunningPreparation(preparation, log, self._on_prepared, observers.on_starting, *used)
        timed = self.timing_monitor.timed
        handlers = (timed(LINE_OPENED, self._on_opened), timed(LINK_RECEIVE, self._on_data))
        self._link = Link(settings.link, *handlers, timed(LINE_LOST, self._on_closed), **line_options(settings))
        self._budget = ReceiveBudget(settings.link)
        self._clock.on_change(self._link.release)
        send_timed = partial(timed, LINE_SEND)
        self._sender = LineSender(self._link, self._driver, self._clock, observers.on_bytes, send_timed)
        line = (self._link, self._driver, self._sender.send, self._clock)
        self._connection = Connection(*line, settings.body, line_messages)
        self._memory = MemoryPolicy(timed(COLLECTION, gc.collect))
        self._mode_log = ModeLog(log, self._notifier)
        self._object_log, self._line_log = ObjectLog(log), LineLog(log, line_messages)
        self._alerts, self._stop = Alerts(), asyncio.Event()
        self._request: Request | None = None
        self._is_request_valid = always_valid
        self._edits, self._drive_inputs = list[Edit](), DriveInputs()
        self._arm_when_ready = self.is_connected = False
        self._footprint: Footprint | None = None

    def request(self, request: Request, is_valid: Callable[[], bool] = always_valid) -> None:
        """Pass a request to the next cycle; a stop is not overridden by an ARM in the same cycle.

        A HALT is sent to the base at once; the next cycle only changes the mode. The cycle drops a request whose
        `is_valid` returns False by then.
        """
        if self._request is not Request.HALT and (self._request, request) != (Request.DISARM, Request.ARM):
            self._request, self._is_request_valid = request, is_valid
        if request is Request.HALT:
            self._halt()

    def drive_request(self, drive_request: DriveInput, is_valid: Callable[[], bool] = always_valid) -> bool:
        """Pass a drive request to the next cycle, which drops it if `is_valid` is False; a later one replaces it.

        Return False, and pass none, where too many changes of a mission wait already, as while time is paused.
        """
        return self._drive_inputs.put(drive_request, is_valid)

    def edit(self, *edits: Edit) -> bool:
        """Pass edits of the map to the next cycles; return False, and pass none, where too many wait already."""
        if len(self._edits) + len(edits) > EDITS_MAX:
            return False
        self._edits.extend(edits)
        return True

    def evidence(self, number: int) -> Evidence | None:
        """Return the evidence for and against an object, None if it does not exist."""
        return self._state.perception.evidence(number)

    @property
    def state(self) -> State:
        """The state that the last cycle left; read-only for callers."""
        return self._state

    @property
    def timing_monitor(self) -> TimingMonitor:
        """Measures the cycle and its callbacks; callbacks added to the loop are wrapped by its `timed`."""
        return self._scheduler.timing_monitor

    @property
    def name(self) -> str | None:
        """The robot's name by its file, else as it reports it; None until it has."""
        return self._settings.robot.name or (self._driver.identity.name if self._driver.identity else None)

    def stop(self) -> None:
        """End the run in good order: halt the base, then close the line."""
        self._stop.set()
        self._halt()
        self._scheduler.wake()

    async def run(self, *, arm: bool, seconds: float | None) -> RunSummary:
        """Run until `stop` is called or `seconds` have passed, and return the summary.

        Parameters
        ----------
        arm : bool
            Arm once, as soon as the robot is ready.
        seconds : float, optional
            Counted from the first cycle with recognition, by the run's clock.

        Raises
        ------
        UserError
            The port cannot be opened, or the robot does not answer as it should.
        """
        with self.health.catching_unhandled_errors():
            await self._preparation.start(self._settings, self._connection, self._stop.is_set)
            self.is_connected = self._driver.state is LineState.READY
            if self.is_connected:  # else the run was ended before
                self._log.info("robot ready", port=self._settings.link.port, robot=self.name)
            link_task = asyncio.create_task(self._link.run(), name="link")
            self.health.watch_task("link", link_task)
            try:
                for refusal in apply_realtime(self._settings.realtime):
                    self._log.warning(refusal)
                footprint = self._footprint = Footprint(self._memory)
                self._arm_when_ready = arm
                with self._memory.driving():
                    await self._run_cycles(seconds)
                await self._preparation.close()
                process_row = footprint.close()
            finally:  # whatever failed, the base is halted and the line closed
                try:
                    await self._shut_down(link_task)
                finally:
                    await self._preparation.close()
                    self._scheduler.close()
        return run_summary(
            self._state, self._scheduler.stats, self.timing_monitor, self._driver, process_row, self._mode_log
        )

    def _on_prepared(self) -> None:
        """Recognition begins with the next cycle: what it took is no part of the run's own footprint."""
        if self._footprint is not None:  # else the first cycle is still to come, and begins it
            self._memory.settle()
            self._footprint.begin()

    async def _run_cycles(self, seconds: float | None) -> None:
        """Run cycle after cycle until the run ends: sleep until one is due, run it, plan the next."""
        begin_run_s, scheduler = self._clock(), self._scheduler
        recognised_run_s = math.inf if self._preparation.is_running else begin_run_s
        with scheduler.start(begin_run_s, command_gap_max_s(self._driver)):
            while not self._stop.is_set():
                try:
                    now = await scheduler.wait()
                    if now is None:
                        continue
                    if seconds is not None and now.run_s - recognised_run_s >= seconds:
                        return
                    self._cycle(now)
                    if self._state.preparing is None:
                        recognised_run_s = min(recognised_run_s, now.run_s)
                    slack_s = scheduler.end(end_run_s := self._clock())
                    if not self._preparation.is_running:  # loading kernels leaves much garbage, and then all is kept
                        self._memory.cycle_done(slack_s)
                    self._link.hold(scheduler.quiet_s(end_run_s))
                except Exception as error:  # noqa: BLE001 - whatever it is, the robot must stop first
                    self._fail(error)
                    return

    def _cycle(self, now: ClockSample) -> None:
        """Run one cycle in the order of DESIGN.md: gather, step (which sends the command and refines), record."""
        mark = self.timing_monitor.mark
        self._apply_live_settings()
        start = self._scheduler.begin(now)
        inputs = self._gather(now.run_s, now.host_s, start.echo_age_s)
        mark(Phase.GATHER)
        before = self._state.mode
        record = self._step(inputs, now, mark)
        self._report(record, before, self._observers.on_cycle)
        mark(Phase.OBSERVERS)

    def _apply_live_settings(self) -> None:
        if self.live_settings.current is self._settings:
            return
        self._settings = self.live_settings.current
        self._driver.set_firing(self._settings.ring)
        apply_settings(self._state, self._settings)
        if self._observers.on_settings is not None:
            self._observers.on_settings(self._settings)

    def _gather(self, run_s: float, host_s: float, echo_age_s: float | None = None) -> Inputs:
        """Return what the robot sent and the operator requested since the last cycle."""
        if self._arm_when_ready and self._driver.state is LineState.READY and self._state.mode.mode in NEVER_ARMED:
            self.request(Request.ARM)
        request, self._request = self._request if self._is_request_valid() else None, None
        edits, self._edits = tuple(self._edits[:EDITS_PER_CYCLE]), self._edits[EDITS_PER_CYCLE:]
        overrun = self._budget.flood(run_s) or self._scheduler.overrun
        operator = OperatorInput(request, self._drive_inputs.take(), edits)
        inputs = gather_inputs(
            self._driver, run_s, operator, echo_age_s=echo_age_s, overrun=overrun, fault=self.health.fault(),
            host_s=host_s, preparing=self._preparation.progress(run_s), line_messages=self._line_messages,
        )  # fmt: skip
        self._arm_when_ready &= request is None or inputs.line is not LineState.READY  # a lost line drops the request
        return inputs

    def _step(self, inputs: Inputs, now: ClockSample, mark: Callable[[Phase], None]) -> CycleRecord:
        """Run the pure step with this process's line and clock."""
        host_clock, refine_until_host_s = self._clock.host, now.host_s + self._settings.cycle.perception_budget_s
        return step(
            self._state,
            inputs,
            self._settings,
            lambda command: self._carry_out(command, inputs.run_s + inputs.gap_max_s),
            lambda _done: host_clock() < refine_until_host_s,
            mark,
        )

    def _report(self, record: CycleRecord, before: ModeState, on_cycle: OnCycle | None) -> None:
        """Record and show the cycle, and log what is new about mode, sensors and odometry."""
        received, on_firing = record.inputs.received, self._observers.on_firing
        self._mode_log.observe(self._state, before, record.inputs.run_s)
        self._line_log.observe(record, self._driver, self._budget.flood(record.inputs.run_s))
        self._object_log.observe(self._state.perception, record.inputs.run_s, is_edited=bool(record.inputs.edits))
        for line in self._alerts.update(received, self._state, record.inputs.run_s):
            self._log.warning(line)
        for line in self._alerts.recovered:
            self._log.info(line)
        if on_firing is not None:
            for firing in received.firings:
                on_firing(firing)
        if on_cycle is not None:
            on_cycle(record, self._state, self._scheduler.stats, self._driver)
        if record.inputs.fault is None:
            self._notifier.alive(record.inputs.run_s)

    def _fail(self, error: Exception) -> None:
        """Halt before anything else, then enter FAULT, which is never left, and log the error."""
        self._halt()
        is_known, what = isinstance(error, UserError), f"the cycle failed ({describe_exception(error)})"
        reason = str(error) if is_known else f"{what}, likely a program error: see the log, then restart the program"
        self._state.mode = self._state.mode.enter(Mode.FAULT, self._clock(), reason)
        self._mode_log.entered(self._state, self._clock())
        if not is_known:
            self._log.error("the cycle failed", exc_info=error)

    def _carry_out(self, command: Command, stale_run_s: float) -> None:
        """Send the command, but no velocity after `stale_run_s`: the next cycle stops the drive for such a gap."""
        self._sender.stale_run_s = stale_run_s
        if not isinstance(command, Twist):
            apply_command(self._driver, command)
            self._sender.send()
        elif self._clock() <= stale_run_s:
            apply_command(self._driver, command)
            self._sender.send()
            if self._clock() > stale_run_s:  # it was suspended: the base may move again that its deadman had stopped
                self._halt()

    def _halt(self) -> None:
        """Send HALT now, whatever else is in progress; on a lost line, as soon as it is open again."""
        self._driver.halt()
        self._sender.send()

    def _on_opened(self) -> None:
        self._driver.line_opened(self._clock())
        self._sender.send()

    def _on_data(self, data: bytes) -> None:
        (run_s, host_s), waiting = self._clock.both(), self._driver.firings_waiting
        if not self._budget.accepts(data, run_s):
            self._link.hold(FLOOD_HOLD_S)
            return
        self._driver.receive(data, run_s)
        if self._driver.firings_waiting > waiting:
            self._scheduler.on_echo(run_s)
        if self._observers.on_bytes is not None:
            self._observers.on_bytes("in", run_s, host_s, data)

    def _on_closed(self, reason: str) -> None:
        self._driver.line_closed()
        if self.is_connected and not self._stop.is_set():
            self._line_log.lost(reason, self._clock())

    async def _shut_down(self, link_task: asyncio.Task[None]) -> None:
        """Halt the base and wait until it has stopped; then close the line."""
        self._stop.set()
        self._clock.release()
        self.health.begin_shutdown()
        self._notifier.stopping()
        if not await self._connection.shut_down() and self.is_connected:
            self._log.warning(self._line_messages.message(UNCONFIRMED_END))
        link_task.cancel()
        await asyncio.gather(link_task, return_exceptions=True)
