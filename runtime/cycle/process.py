"""The robot's main process: one asyncio loop that gathers inputs, runs the step, and carries out what it decides.

Everything that waits, reads a clock or touches a port is here or below in drivers/; everything that decides is in
`runtime.cycle.step` and below.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from config.settings import Settings
from drivers.driver import RobotDriver
from drivers.link import Link
from drivers.messages import Firing, Twist
from drivers.registry import make_driver
from perception.edits import Edit, Evidence
from perception.pipeline import Perception
from runtime.cycle.alerts import Alerts
from runtime.cycle.connection import Connection
from runtime.cycle.drive_requests import DriveRequest
from runtime.cycle.driver_io import gap_max, gather, give
from runtime.cycle.modes import Mode, Request
from runtime.cycle.step import Command, CycleRecord, State, step, take_over
from runtime.cycle.summary import RunSummary, run_summary
from runtime.support.health import Health, describe_exception
from runtime.support.sd_notify import SdNotifier
from runtime.timing.clock_sampler import ClockSample
from runtime.timing.cycle_scheduler import CycleScheduler
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.footprint import Footprint, FootprintRow
from runtime.timing.memory_policy import MemoryPolicy, collect_young
from runtime.timing.phases import Phase
from runtime.timing.realtime import ask
from runtime.timing.run_clock import run_clock
from runtime.timing.timekeeping import Timekeeper

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

Way: TypeAlias = Literal["in", "out"]

EDITS_MAX: Final = 64
"""Changes of the map that may wait for the next cycle: more than a person makes in a twentieth of a second."""

LINE_OPENED: Final = "line opened"
LINK_RECEIVE: Final = "link receive"
LINE_LOST: Final = "line lost"
COLLECTION: Final = "garbage collection"
CONSOLE_RECEIVE: Final = "console receive"
CONSOLE_FRAME: Final = "console frame"
CONSOLE_SEND: Final = "console send"
CALLBACKS: Final = (
    LINE_OPENED, LINK_RECEIVE, LINE_LOST, COLLECTION, CONSOLE_RECEIVE, CONSOLE_FRAME, CONSOLE_SEND
)  # fmt: skip
"""What of ours the loop calls between two cycles."""


@dataclass(frozen=True, slots=True)
class Observers:
    """Who watches the run; none of them may take long."""

    on_cycle: Callable[[CycleRecord, State, CycleStats, RobotDriver], None] | None = None
    on_firing: Callable[[Firing], None] | None = None
    on_bytes: Callable[[Way, float, bytes], None] | None = None
    """Gets the direction, the moment by the host's clock, and the bytes that went over the line."""
    on_settings: Callable[[Settings], None] | None = None
    """Gets settings taken over while the robot runs, before the first cycle under them."""


class RobotProcess:
    """One run on one robot.

    Parameters
    ----------
    settings : Settings
        With `link.port` set.
    log : structlog logger
        For what an operator should know afterwards.
    observers : Observers
        View and recorder.
    clock : callable
        Monotonic, s. One that can be held holds the run with it: see `runtime.timing.run_clock`.
    notifier : SdNotifier, optional
        Tells the service manager that started this process, where one did.

    Attributes
    ----------
    health : Health
        Whoever adds a part to the run has it watched here.
    """

    def __init__(
        self,
        settings: Settings,
        log: FilteringBoundLogger,
        observers: Observers = Observers(),
        clock: Callable[[], float] = time.monotonic,
        notifier: SdNotifier | None = None,
    ) -> None:
        self._settings = settings
        self._log = log
        self._observers = observers
        self._clock = run_clock(clock)
        self._notifier = SdNotifier() if notifier is None else notifier
        self.health = Health(log)
        self._driver = make_driver(settings)
        self._state = State(Perception(settings.ring, settings.models, settings.perception))
        self._rhythm = CycleScheduler(settings, self._clock, CALLBACKS)
        timed = self._rhythm.keeper.timed
        self._link = Link(
            settings.link,
            timed(LINE_OPENED, self._opened),
            timed(LINK_RECEIVE, self._received),
            timed(LINE_LOST, self._closed),
        )
        self._ends = Connection(self._link, self._driver, self._send, self._clock)
        self._memory = MemoryPolicy(timed(COLLECTION, collect_young))
        self._stop_reasons: list[str] = []
        self._notices = Alerts()
        self._request: Request | None = None
        self._edits: list[Edit] = []
        self._drive_request: DriveRequest | None = None
        self._arm_when_ready = False
        self._stop = asyncio.Event()
        self._next_settings: Settings | None = None

    def request(self, request: Request) -> None:
        """Take an operator's request into the next cycle; what stops is not overruled by an ARM in the same one.

        The base is told to halt at once; the next cycle only takes note of it.
        """
        if self._request is not Request.HALT and (self._request, request) != (Request.DISARM, Request.ARM):
            self._request = request
        if request is Request.HALT:
            self._halt()

    def drive_request(self, drive_request: DriveRequest) -> None:
        """Take what is to be driven into the next cycle; the newest counts."""
        self._drive_request = drive_request

    def edit(self, edit: Edit) -> bool:
        """Take a change of the map into the next cycle; return False where too many wait already."""
        if len(self._edits) >= EDITS_MAX:
            return False
        self._edits.append(edit)
        return True

    def evidence(self, number: int) -> Evidence | None:
        """Return what speaks for and against an object, None where there is no such object."""
        return self._state.perception.evidence(number)

    @property
    def state(self) -> State:
        """What the last cycle left; whoever looks at it between two cycles must not change it."""
        return self._state

    @property
    def keeper(self) -> Timekeeper:
        """The books of time; whoever adds callbacks to the loop has them timed here."""
        return self._rhythm.keeper

    @property
    def name(self) -> str | None:
        """What the robot calls itself, None until it has."""
        return None if self._driver.identity is None else self._driver.identity.name

    def reconfigure(self, settings: Settings) -> None:
        """Go on with other settings from the next cycle on; only such as `config.reload` lets through."""
        self._next_settings = settings

    def stop(self) -> None:
        """End the run in good order: halt the base, then close the line."""
        self._stop.set()
        self._halt()
        self._rhythm.wake()

    async def run(self, *, arm: bool, seconds: float | None) -> RunSummary:
        """Run until told to stop or `seconds` have passed, and return the summary.

        Parameters
        ----------
        arm : bool
            Arm once, as soon as the robot is ready.
        seconds : float, optional
            Counted from the first cycle.

        Raises
        ------
        Complaint
            The port cannot be opened, or the robot does not answer as it should.
        """
        with self.health.catching_unhandled_errors():
            await self._ends.connect(self._stop.is_set)
            self._log.info("robot ready", port=self._settings.link.port, robot=self.name)
            keeper = asyncio.create_task(self._link.run(), name="link")
            self.health.watch_task("link", keeper)
            for refusal in ask(self._settings.realtime):
                self._log.warning(refusal)
            footprint = Footprint(self._memory)
            try:
                self._arm_when_ready = arm
                with self._memory.driving():
                    await self._cycle(seconds)
            finally:
                cost = footprint.close()
                self._rhythm.close()
                await self._shut_down(keeper)
        return self._summary(cost)

    async def _cycle(self, seconds: float | None) -> None:
        """Run cycles in their rhythm until the run ends."""
        begin_run_s, rhythm = self._clock(), self._rhythm
        with rhythm.start(begin_run_s, gap_max(self._driver)):
            while not self._stop.is_set():
                try:
                    now = await rhythm.wait()
                    if now is None:
                        continue
                    if seconds is not None and now.run_s - begin_run_s >= seconds:
                        return
                    self._one_cycle(now)
                    left_s = rhythm.end(self._clock())
                    self._memory.cycle_done(left_s)
                except Exception as error:  # noqa: BLE001 - whatever it is, the robot must stand still first
                    self._fail(error)
                    return

    def _fail(self, error: Exception) -> None:
        """Halt before anything else, then say what happened; FAULT is not left."""
        self._halt()
        what = f"the cycle failed ({describe_exception(error)})"
        reason = f"{what}, likely by a fault of the program: see the log, then start it again"
        self._state.mode = self._state.mode.enter(Mode.FAULT, self._clock(), reason)
        self._note_mode()
        self._log.error("the cycle failed", exc_info=error)

    def _one_cycle(self, now: ClockSample) -> None:
        if self._next_settings is not None:
            self._settings, self._next_settings = self._next_settings, None
            self._driver.set_firing(self._settings.ring)
            take_over(self._state, self._settings)
            if self._observers.on_settings is not None:
                self._observers.on_settings(self._settings)
        if self._arm_when_ready and self._state.mode.mode is Mode.READY:
            self._arm_when_ready = False
            self.request(Request.ARM)
        rhythm, run_s, clock = self._rhythm, now.run_s, self._clock.host
        refine_until_host_s = now.host_s + self._settings.cycle.perception_budget_s
        mark = rhythm.keeper.mark
        request, self._request = self._request, None
        drive_request, self._drive_request = self._drive_request, None
        edits, self._edits = tuple(self._edits), []
        begun = rhythm.begin(now)
        fault = self.health.fault()
        inputs = gather(
            self._driver, run_s, request, echo_age_s=begun.echo_age_s, overrun=rhythm.overrun, fault=fault,
            edits=edits, drive_request=drive_request, host_s=now.host_s,
        )  # fmt: skip
        mark(Phase.GATHER)
        before = self._state.mode
        record = step(
            self._state,
            inputs,
            self._settings,
            lambda command: self._carry_out(command, run_s + inputs.gap_max_s),
            lambda _done: clock() < refine_until_host_s,
            mark,
        )
        if self._state.mode.entered_since(before):
            self._note_mode()
        for line in self._notices.news(inputs.heard, self._state.perception):
            self._log.warning(line)
        if self._observers.on_firing is not None:
            for firing in inputs.heard.firings:
                self._observers.on_firing(firing)
        if self._observers.on_cycle is not None:
            self._observers.on_cycle(record, self._state, rhythm.books, self._driver)
        if fault is None:
            self._notifier.alive(run_s)
        mark(Phase.OBSERVERS)

    def _note_mode(self) -> None:
        state = self._state.mode
        if state.mode in {Mode.SAFE_STOP, Mode.FAULT} and state.reason is not None:
            self._stop_reasons.append(state.reason)
        self._notifier.status(state.mode.value if state.reason is None else f"{state.mode.value}: {state.reason}")
        self._log.info("mode", mode=state.mode.value, reason=state.reason, cycle=self._state.cycle)

    def _carry_out(self, command: Command, stale_run_s: float) -> None:
        """Put the command on the line, but no velocity decided too long ago; the next cycle stops for such a gap."""
        if not isinstance(command, Twist):
            give(self._driver, command)
            self._send()
        elif self._clock() <= stale_run_s:
            give(self._driver, command)
            self._send()
            if self._clock() > stale_run_s:
                # Held up between the look at the clock and the line: a base that had stopped by itself was set in
                # motion. The HALT is right behind.
                self._halt()

    def _send(self) -> None:
        if self._link.is_open and (data := self._driver.outgoing(writable=self._link.writable)):
            taken = self._link.send(data)
            if taken and self._observers.on_bytes is not None:
                self._observers.on_bytes("out", self._clock.host(), data)

    def _halt(self) -> None:
        """Have the base told now, whatever else is under way; on a line that is gone, as soon as it is back."""
        self._driver.halt()
        self._send()

    def _opened(self) -> None:
        self._driver.line_opened(self._clock())
        self._send()

    def _received(self, data: bytes) -> None:
        (run_s, host_s), waiting = self._clock.both(), self._driver.firings_waiting
        self._driver.receive(data, run_s)
        if self._driver.firings_waiting > waiting:
            self._rhythm.hear(run_s)
        if self._observers.on_bytes is not None:
            self._observers.on_bytes("in", host_s, data)

    def _closed(self, reason: str) -> None:
        self._driver.line_closed()
        if not self._stop.is_set():
            self._log.warning("line lost", reason=reason)

    async def _shut_down(self, keeper: asyncio.Task[None]) -> None:
        """Halt the base and wait until it stands still; then close the line."""
        self._stop.set()
        self._clock.release()
        self.health.begin_shutdown()
        self._notifier.stopping()
        if not await self._ends.halt():
            self._log.warning("the base did not confirm the halt; its deadman stops it")
        keeper.cancel()
        await asyncio.gather(keeper, return_exceptions=True)

    def _summary(self, cost: FootprintRow) -> RunSummary:
        rhythm = self._rhythm
        return run_summary(self._state, rhythm.books, rhythm.keeper, self._driver, cost, self._stop_reasons)
