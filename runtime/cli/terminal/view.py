"""The live view of a run on a terminal (mode, plan, objects, ring, link and timing), and the keys it takes.

A terminal can be slow or held by Ctrl-S. So the loop only stores a snapshot of the latest cycle; a thread draws it.
Keys: a arms, space halts, q quits; p pauses and s steps an emulated run.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import termios
import threading
import tty
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from config.settings import Settings
from drivers.driver import RobotDriver
from drivers.messages import Floats, LinkCounts, Pose
from perception.detected_object import DetectedObject, MapCounts
from perception.localization.drift_correction import LocalizedPose
from runtime.cli.tables import objects_table
from runtime.cli.terminal.plan import draw_plan
from runtime.cycle.inputs import Request
from runtime.cycle.modes import ModeState
from runtime.cycle.step import CycleRecord, State
from runtime.cycle.summary import object_row
from runtime.support.health import Worker
from runtime.support.length_format import Units, format_length, format_point
from runtime.timing.cycle_stats import CycleStats, Quantiles

EVERY_CYCLES: Final = 5
"""Draw every fifth cycle: 4 Hz at 20 Hz."""
TRAIL: Final = 400
SWITCH_INTERVAL_S: Final = 0.0005
"""Longest wait of the loop for the interpreter while the thread draws."""
STYLES: Final = MappingProxyType(
    {"DRIVE": "bold white on green", "SAFE_STOP": "bold white on red", "FAULT": "bold white on red"}
)
BARS: Final = " ▁▂▃▄▅▆▇█"
FAULTS_SHOWN: Final = 3
KEYS_MAX: Final = 64
KEYS: Final = MappingProxyType({" ": Request.HALT, "h": Request.HALT, "a": Request.ARM})


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """What the view shows of a cycle; nothing in it changes any more."""

    mode: ModeState
    pose: Pose | None
    trail: list[tuple[float, float]]
    segments: Floats
    map_counts: MapCounts
    objects: tuple[DetectedObject, ...]
    ranges: Floats
    counts: LinkCounts
    cycles: int
    late: int
    cycle_us: Quantiles
    lag_us: Quantiles
    missed: int = 0
    faults: tuple[tuple[str, int], ...] = ()
    """Causes of late and overrun cycles, with the number of cycles."""
    sensors: tuple[str, ...] = ()
    """Why sensors are masked."""
    localized: LocalizedPose | None = None
    """The robot in the map frame; None where that is odometry's."""


class View:
    """Draws the run on a terminal.

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
        self._units: Units = units
        self._reach_m = settings.ring.range_max_m
        self._size_m = {
            m.name: m.arc_radius_m or max(float(np.hypot(x, y)) for x, y in m.vertices_m) for m in settings.models
        }
        self._ranges = np.full(len(settings.ring.mounts), np.nan)
        self._trail: deque[tuple[float, float]] = deque(maxlen=TRAIL)
        self.console_url: str | None = None
        """Address of the operator console; None without one."""
        self._slot: Snapshot | None = None
        self._wake = threading.Event()
        self._done = False
        self._thread = Worker("view", self._draw)

    def probe(self) -> str | None:
        """Return how its thread ended; None while it draws. See `runtime.support.health`."""
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
        if record.cycle % EVERY_CYCLES:
            return
        pose = None if state.odometry is None else state.odometry.pose
        if pose is not None:
            self._trail.append((pose.x, pose.y))
        mode = record.mode if state.hold_reason is None else replace(record.mode, reason=state.hold_reason)
        self._slot = Snapshot(
            mode, pose, list(self._trail), state.perception.segment_geometry(), state.perception.counts,
            state.perception.labelled_objects(), self._ranges.copy(), driver.counts,
            stats.cycles, stats.late, stats.cycle_us(), stats.lag_us(), stats.missed, tuple(stats.causes.items()),
            tuple(report.reason for report in state.perception.sensor_reports()), state.perception.localized(),
        )  # fmt: skip
        self._wake.set()

    @contextlib.contextmanager
    def shown(self) -> Iterator[None]:
        """Show the view during the block."""
        interval_s = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_INTERVAL_S)
        self._thread.start()
        try:
            yield
        finally:
            self._done = True
            self._wake.set()
            self._thread.join(timeout=1.0)
            sys.setswitchinterval(interval_s)

    def _draw(self) -> None:
        with Live(console=self._console, auto_refresh=False, screen=False) as live:
            while not self._done:
                self._wake.wait()
                self._wake.clear()
                snapshot, self._slot = self._slot, None
                if snapshot is not None:
                    live.update(self.picture(snapshot), refresh=True)

    def picture(self, snapshot: Snapshot) -> Group:
        """Return the view of a snapshot."""
        mode = snapshot.mode
        head = Text.assemble((f" {mode.mode.value} ", STYLES.get(mode.mode.value, "bold black on yellow")))
        head.append(f"  {mode.reason or ''}")
        columns = max(20, min(self._console.width - 4, 100))
        plan: Text | str = "waiting for odometry"
        if snapshot.pose is not None:
            plan = draw_plan(
                snapshot.pose, snapshot.trail, snapshot.segments, snapshot.objects, self._size_m, columns, 18
            )
        rows = [object_row(seen) for seen in snapshot.objects]
        legend = "→ robot   • outline segments   o objects   a arm   space halt   p pause   s step   q quit"
        parts: list[RenderableType] = [
            head,
            Panel(plan, subtitle=legend),
            objects_table(rows, self._units),
            self._numbers(snapshot),
        ]
        if self.console_url is not None:
            parts.append(Text(f"console  {self.console_url}", overflow="fold"))
        return Group(*parts)

    def _numbers(self, snapshot: Snapshot) -> Table:
        grid = Table.grid(padding=(0, 2))
        grid.add_row("ring", self._ring(snapshot.ranges))
        grid.add_row("map", map_text(snapshot.map_counts))
        if snapshot.localized is not None:
            grid.add_row("place", place_text(snapshot.localized, self._units))
        for reason in snapshot.sensors:
            grid.add_row("masked", reason)
        counts = snapshot.counts
        grid.add_row("line", f"{counts.frames} frames, {counts.bad} bad, {counts.lost} lost")
        took, lag = snapshot.cycle_us, snapshot.lag_us
        grid.add_row(
            "cycle",
            f"{snapshot.cycles}, {snapshot.late} late, {snapshot.missed} missed; takes {millis(took)}; "
            f"begins {millis(lag)} after it is due",
        )
        if snapshot.faults:
            worst = sorted(snapshot.faults, key=lambda fault: -fault[1])[:FAULTS_SHOWN]
            grid.add_row("late by", ", ".join(f"{cause}: {count}" for cause, count in worst))
        return grid

    def _ring(self, ranges: Floats) -> str:
        """Return a bar per sensor, higher for a nearer echo, or a dot without an echo."""
        bars = []
        for r in ranges:
            near = 0.0 if not np.isfinite(r) else 1.0 - min(float(r) / self._reach_m, 1.0)
            bars.append("·" if not np.isfinite(r) else BARS[max(1, round(near * (len(BARS) - 1)))])
        return "".join(bars)


def map_text(counts: MapCounts) -> str:
    """Return what the map holds, as one line."""
    text = f"{counts.segments} segments, {counts.hypotheses} hypotheses"
    if counts.archived:
        text += f", {counts.archived} objects left behind"
    return f"{text}; {counts.waiting} near ones have no room" if counts.waiting else text


def place_text(here: LocalizedPose, units: Units) -> str:
    """Return the robot's place in the map frame, as one line."""
    said = f"{here.status} {here.probability:.0%}"
    sigma_x, sigma_y, sigma_theta = np.sqrt(np.diag(here.covariance)).tolist()
    if not np.isfinite(sigma_x):
        return f"unknown, {said}"
    place, sigma = format_point(here.pose.x, here.pose.y, units), format_length(max(sigma_x, sigma_y), units, 3)
    return (
        f"{place} ± {sigma} {units}, "
        f"{np.degrees(here.pose.theta) % 360.0:.1f}° ± {np.degrees(sigma_theta):.1f}°, {said}"
    )


def millis(quantiles: Quantiles) -> str:
    """Return median and 99th percentile as text, in milliseconds."""
    return f"{quantiles['p50'] / 1e3:.2f} ms (p99 {quantiles['p99'] / 1e3:.2f})"


@contextlib.contextmanager
def keys(
    on_request: Callable[[Request], None],
    on_quit: Callable[[], None],
    on_other: Callable[[str], None] = lambda _key: None,
) -> Iterator[None]:
    """Read single keys from the terminal during the block, if there is one.

    Parameters
    ----------
    on_request : callable
        Called for the keys of `KEYS`.
    on_quit : callable
        Called for q, and when the terminal is gone.
    on_other : callable
        Called with any other key.
    """
    if not sys.stdin.isatty():
        yield
        return
    fd = sys.stdin.fileno()
    before = termios.tcgetattr(fd)
    loop = asyncio.get_running_loop()

    def read() -> None:
        # Not through sys.stdin: what is in its buffer does not wake the loop.
        try:
            pressed = os.read(fd, KEYS_MAX)
        except OSError:
            pressed = b""
        if not pressed:
            # The terminal is gone, and with it the keys that halt the robot.
            loop.remove_reader(fd)
            on_quit()
        for key in pressed.decode(errors="replace"):
            if key in KEYS:
                on_request(KEYS[key])
            elif key == "q":
                on_quit()
            else:
                on_other(key)

    tty.setcbreak(fd)
    loop.add_reader(fd, read)
    try:
        yield
    finally:
        loop.remove_reader(fd)
        with contextlib.suppress(termios.error):
            termios.tcsetattr(fd, termios.TCSADRAIN, before)
