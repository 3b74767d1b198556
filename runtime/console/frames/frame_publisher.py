"""The frame publisher: encodes frames after cycles, at a bounded rate, and only while clients are connected.

During a cycle the publisher only stores a reference to the record. The frame is encoded in a callback of its own
after the cycle, measured under its own name in the timing table.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from config.settings import Settings
from drivers.driver import RobotDriver
from runtime.console.clients.client_hub import ClientHub
from runtime.console.commands.command import CommandContext
from runtime.console.frames.frame_encoder import NO_LINK_COUNTS, FrameContext, FrameEncoder, robot_status
from runtime.console.frames.run_history import RunHistory
from runtime.console.protocols import Run
from runtime.cycle.callbacks import CONSOLE_FRAME
from runtime.cycle.step import CycleRecord, State
from runtime.support.health import describe_exception
from runtime.timing.cycle_stats import CycleStats

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

FRAME_PERIOD_S: Final = 0.05
"""Mean time between frames; a display that shows more is not worth the cost."""
EARLY_MAX_S: Final = 0.01
"""A cycle that ends this much before a frame is due still gets it."""
IDLE_PERIOD_S: Final = 1.0
"""Time between frames while no cycle ends: the run is paused, or the robot has not answered yet."""


class FramePublisher:
    """Encodes frames of a run and passes them to its clients.

    Each frame shows the time control and recording of `commands`. The clock is monotonic; `on_stalled` gets the name
    of each client that was disconnected because it takes nothing any more.

    Attributes
    ----------
    failure
        The error that ended the frames; None while they continue.
    """

    def __init__(
        self,
        run: Run,
        hub: ClientHub,
        commands: CommandContext,
        settings: Settings,
        log: FilteringBoundLogger,
        clock: Callable[[], float],
        on_stalled: Callable[[str], None],
    ) -> None:
        self._run = run
        self._hub = hub
        self._commands = commands
        self._log = log
        self._clock = clock
        self._on_stalled = on_stalled
        self._encoder = FrameEncoder(settings)
        self.history = RunHistory()
        """What a page that is opened now shows of the time before."""
        self.publish = run.timing_monitor.timed(CONSOLE_FRAME, self._publish)
        """Encodes a frame now; measured."""
        self._timed_tick = run.timing_monitor.timed(CONSOLE_FRAME, self._tick)
        self._last: tuple[CycleRecord, State, CycleStats, RobotDriver] | None = None
        """Of the last cycle; None before the first."""
        self._is_scheduled = False
        """Whether the loop will call `publish` soon."""
        self._due_s = 0.0
        """Host time from which the next frame is due."""
        self._published_s = 0.0
        """Host time of the last frame."""
        self._ticker: asyncio.TimerHandle | None = None
        self.failure: str | None = None

    def open(self) -> None:
        """Publish frames from now on, also while no cycle ends."""
        self._ticker = asyncio.get_running_loop().call_later(IDLE_PERIOD_S, self._timed_tick)

    def close(self) -> None:
        """Publish no more frames while no cycle ends."""
        if self._ticker is not None:
            self._ticker.cancel()

    @property
    def is_first_cycle(self) -> bool:
        """Whether no cycle has been taken in yet."""
        return self._last is None

    def take(self, record: CycleRecord, state: State, stats: CycleStats, driver: RobotDriver) -> None:
        """Take in a cycle and schedule a frame if one is due.

        The state is read when the frame is encoded.
        """
        self._encoder.take(record)
        if record.inputs.received.rebooted:
            self.history.clear()
        if state.odometry is not None:
            last_cycle = self._run.timing_monitor.last_cycle
            self.history.take(state.odometry, self._encoder.ranges, lambda: last_cycle().phases_s or {})
        self._last = (record, state, stats, driver)
        host_s = self._clock()
        # While cycles overrun, the idle period is enough: the display must not cost the robot more time.
        is_due = host_s >= self._due_s - EARLY_MAX_S and not self._run.timing_monitor.overruns_in_a_row
        if self._hub.clients and is_due:
            # Counted from when the frame was due, so that a late frame does not delay all later ones.
            self._due_s = max(self._due_s + FRAME_PERIOD_S, host_s + FRAME_PERIOD_S - 2.0 * EARLY_MAX_S)
            if not self._is_scheduled:
                self._is_scheduled = True
                asyncio.get_running_loop().call_soon(self.publish)

    def adopt(self, settings: Settings) -> None:
        """Use other settings from the next frame on."""
        self.expedite()
        self._encoder.adopt(settings)

    def expedite(self) -> None:
        """Publish a frame after the next cycle, whenever the last one was."""
        self._due_s = 0.0

    def fail(self, error: Exception) -> None:
        """End the frames because of an unexpected error, and log it."""
        self.failure = describe_exception(error)
        self._log.error("the console cannot show the run any more", exc_info=error)

    def _publish(self) -> None:
        """Encode a frame now; an error ends all frames, see `failure`."""
        self._is_scheduled = False
        if self.failure is not None:
            return
        try:
            self._encode()
        except Exception as error:  # noqa: BLE001 - the console's health probe reports it, and the robot stops
            self.fail(error)

    def _encode(self) -> None:
        """Disconnect stalled clients, then encode a frame of the last cycle and give it to all others."""
        host_s = self._clock()
        self._published_s = host_s
        for client in self._hub.disconnect_stalled(host_s):
            self._on_stalled(client.name)
        if not self._hub.clients:
            return
        latest = self._run.timing_monitor.last_cycle()
        record, state, missed, late, link = None, self._run.state, 0, 0, NO_LINK_COUNTS
        if self._last is not None:
            record, state, stats, driver = self._last
            missed, late, link = stats.missed, stats.late, driver.counts
        time, recording = self._commands.time, self._commands.recording
        context = FrameContext(
            host_s=host_s,
            clients=len(self._hub.clients),
            phases_s=latest.phases_s,
            late_s=latest.late_s,
            missed=missed,
            late=late,
            link=link,
            recording=None if recording is None else recording.now,
            is_paused=time is not None and time.is_paused,
            speed=1.0 if time is None else time.speed,
        )
        self._hub.publish(self._encoder.frame(state, record, context))
        self._hub.inform_viewers(robot_status(state, context))

    def _tick(self) -> None:
        """Publish a frame if no cycle has had one for a while."""
        self._ticker = asyncio.get_running_loop().call_later(IDLE_PERIOD_S, self._timed_tick)
        is_idle = self._clock() - self._published_s > 0.5 * IDLE_PERIOD_S
        if self._hub.clients and not self._is_scheduled and is_idle:
            self._publish()
