"""The live view of a run on a terminal: a process of its own draws it.

A terminal can be slow or held by Ctrl-S, and a thread that draws holds the interpreter for milliseconds. So the loop
only stores a snapshot of the latest cycle, a thread passes it on, and `python -m runtime.cli.terminal` draws it.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import pickle
import subprocess
import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from runtime.cli.terminal.page_text import localized_place
from runtime.cli.terminal.picture import CORNERED_M, Scale, Snapshot
from runtime.support.child_process import INTERPRETER, child_environment
from runtime.support.health import Worker

if TYPE_CHECKING:
    from rich.console import Console

    from config.settings import Settings
    from drivers.driver import RobotDriver
    from runtime.cycle.modes import Mode
    from runtime.cycle.process import OnCycle
    from runtime.cycle.step import CycleRecord, State
    from runtime.support.length_format import Units
    from runtime.timing.cycle_stats import CycleStats, Quantiles

EVERY_CYCLES: Final = 5
"""Draw every fifth cycle: 4 Hz at 20 Hz."""
QUANTILES_PERIOD_S: Final = 1.0
"""Time from one computation of their quantiles to the next, s: after an hour each takes 2 ms of the interpreter."""
TRAIL: Final = 400
PICTURE: Final = "runtime.cli.terminal"
"""The module that draws, run as a program."""
LAST_S: Final = 5.0
"""Time that the last picture may take, s: a terminal that is held by Ctrl-S would never show it."""


def after_each_cycle(call: OnCycle) -> OnCycle:
    """Return what calls `call` when a cycle has ended, before the loop sleeps: the cycle itself takes no longer."""

    def soon(record: CycleRecord, state: State, stats: CycleStats, driver: RobotDriver) -> None:
        asyncio.get_running_loop().call_soon(call, record, state, stats, driver)

    return soon


class View:
    """Shows the run on a terminal.

    Parameters
    ----------
    settings : Settings
        Of the run.
    console : Console
        The terminal.
    units : {"m", "ft"}
        Units of the table of objects.
    """

    def __init__(self, settings: Settings, console: Console, units: Units) -> None:
        self._console = console
        size_m = {m.name: m.reach_m for m in settings.models}
        radii_m = {m.name: m.arc_radius_m or CORNERED_M for m in settings.models}
        self._scale = Scale(units, settings.ring.range_max_m, size_m, radii_m)
        self._ranges = np.full(len(settings.ring.mounts), np.nan)
        self._trail: deque[tuple[float, float]] = deque(maxlen=TRAIL)
        self.console_url: str | None = None
        """Address of the operator console; None without one."""
        self.is_paused: Callable[[], bool] = lambda: False
        """Whether time is paused now."""
        self._lines: deque[str] = deque()
        self._mode: Mode | None = None
        """The mode that was drawn last; a new one is drawn at once."""
        self._slot: Snapshot | None = None
        self._stats: CycleStats | None = None
        self._quantiles: tuple[Quantiles, Quantiles] | None = None
        """Of all cycles up to `_counted`: how long they took, and how late they began."""
        self._counted = 0
        self._recount_cycles = math.ceil(QUANTILES_PERIOD_S * settings.cycle.rate_hz)
        self._wake = threading.Event()
        self._done = False
        self._thread = Worker("view", self._pass_on)
        self._picture: subprocess.Popen[bytes] | None = None

    def probe(self) -> str | None:
        """Return how its thread or its process ended; None while both run. See `runtime.support.health`."""
        return self._thread.probe()

    def on_cycle(self, record: CycleRecord, state: State, stats: CycleStats, driver: RobotDriver) -> None:
        """Store what the view shows next.

        Parameters
        ----------
        record, state : CycleRecord, State
            Of the cycle.
        stats : CycleStats
            Of the run.
        driver : RobotDriver
            For the counts of the link.
        """
        for firing in record.inputs.received.firings:
            fired = ~np.isnan(firing.ranges_m)
            self._ranges[fired] = firing.ranges_m[fired]
        is_new, self._mode = record.mode.mode is not self._mode, record.mode.mode
        if record.cycle % EVERY_CYCLES and not is_new:
            return
        odometry = state.odometry
        pose, twist = (None, None) if odometry is None else (odometry.pose, odometry.twist)
        if pose is not None:
            self._trail.append((pose.x, pose.y))
        localized, segments, counts = state.perception.localized(), state.perception.segment_geometry(), driver.counts
        middles = 0.5 * (segments[:, 0:2] + segments[:, 2:4])
        later: Quantiles = {"p50": 0.0, "p99": 0.0, "max": 0.0}  # see `_completed`
        self._slot = Snapshot(
            record.mode.mode.value, state.hold_reason or record.mode.reason or state.preparing,
            None if pose is None else (pose.x, pose.y, pose.theta), list(self._trail),
            [(x, y) for x, y in middles.tolist()], state.perception.counts,
            state.perception.labelled_objects(), self._ranges.tolist(), (counts.frames, counts.bad, counts.lost),
            stats.cycles, stats.late, later, later, stats.missed, tuple(stats.causes.items()),
            tuple(report.reason for report in state.perception.sensor_reports()),
            None if localized is None else localized_place(localized, self._scale.units),
            None if twist is None else (twist.v, twist.w), self.console_url,
        )  # fmt: skip
        self._stats = stats
        self._wake.set()

    def draw_again(self) -> None:
        """Draw the newest picture again, as when time was paused."""
        self._wake.set()

    def print(self, line: str) -> None:
        """Print a line above the picture."""
        self._lines.append(line)
        self._wake.set()

    @contextlib.contextmanager
    def shown(self) -> Iterator[None]:
        """Show the view during the block."""
        pipe = subprocess.PIPE
        picture = self._picture = subprocess.Popen(  # noqa: S603 - this very program
            [*INTERPRETER, "-m", PICTURE], stdin=pipe, stdout=self._console.file, stderr=pipe, env=child_environment()
        )
        self._thread.start()
        try:
            yield
        finally:
            self._done = True
            self._wake.set()
            try:
                picture.wait(LAST_S)
            except subprocess.TimeoutExpired:
                picture.kill()
                self._console.show_cursor()
            self._thread.join()
            with contextlib.suppress(BrokenPipeError), picture:  # closes the pipes
                pass

    def _completed(self, snapshot: Snapshot) -> Snapshot:
        """Add what would take a cycle too long: the quantiles of all cycles, anew now and then.

        That is after `QUANTILES_PERIOD_S`, and for each picture while few are counted, and for the last one.
        """
        stats, recount_cycles = self._stats, self._recount_cycles
        if stats is not None:
            is_due = stats.cycles < recount_cycles or stats.cycles >= self._counted + recount_cycles
            if self._quantiles is None or is_due or self._done:
                self._counted, self._quantiles = stats.cycles, (stats.cycle_us(), stats.lag_us())
            snapshot = replace(snapshot, cycle_us=self._quantiles[0], lag_us=self._quantiles[1])
        return replace(snapshot, is_paused=self.is_paused())

    def _pass_on(self) -> None:
        """Pass on what is new, the newest snapshot only; at the end, close the pipe, which ends the other process.

        Raises
        ------
        BrokenPipeError
            That process has ended before.
        """
        picture = self._picture
        if picture is None or picture.stdin is None or picture.stderr is None:
            return
        snapshot = None
        try:
            pickle.dump(self._scale, picture.stdin)
            is_last = False
            while not is_last:
                self._wake.wait()
                self._wake.clear()
                is_last = self._done
                while self._lines:
                    pickle.dump(self._lines.popleft(), picture.stdin)
                newest, self._slot = self._slot, None
                snapshot = newest or snapshot
                if snapshot is not None:
                    pickle.dump(self._completed(snapshot), picture.stdin)
                picture.stdin.flush()
            picture.stdin.close()
        except OSError as error:
            if not self._done:
                why = picture.stderr.read().decode(errors="replace").split("\n")[-2:]
                raise BrokenPipeError(f"the process that draws has ended: {' '.join(why)}") from error
