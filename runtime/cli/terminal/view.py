"""The live view of a run on a terminal (mode, plan, objects, ring, link and timing), and the keys it takes.

A terminal can be slow or held by Ctrl-S. So the loop only stores a snapshot of the latest cycle; a thread draws it.
Keys: a arms, space halts, q quits; p pauses and s steps an emulated run.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
import signal
import sys
import termios
import threading
import tty
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from textwrap import wrap
from types import MappingProxyType
from typing import Final

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.text import Text

from config.settings import Settings
from drivers.driver import RobotDriver
from drivers.messages import Floats, LinkCounts, Pose, Twist
from perception.detected_object import DetectedObject, MapCounts
from perception.localization.drift_correction import LocalizedPose
from runtime.cli.terminal.page_text import is_hidden, localized_place, object_row, twist
from runtime.cli.terminal.plan import draw_plan
from runtime.cycle.inputs import Request
from runtime.cycle.modes import ModeState
from runtime.cycle.step import CycleRecord, State
from runtime.support.health import Worker
from runtime.support.length_format import Units
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
WARNINGS_MAX: Final = 3
ROOMY_ROWS: Final = 14
"""From so many lines left on, the counts are all shown beside the objects."""
TALL_ROWS: Final = 20
REASON_LINES_MAX: Final = 3
"""Of a reason that does not fit beside the mode, on a terminal of so many lines."""
PLAN_ROWS_MIN: Final = 4
"""A plan of fewer lines shows nothing."""
LEGEND: Final = "→ robot   • outline segments   o objects   = walls"
KEY_LINES: Final = (
    "keys  a arm   space halt   p pause   s step   q quit", "a arm  ␣ halt  p pause  s step  q quit",
    "a arm ␣ halt q quit", "a ␣halt q",
)  # fmt: skip
"""The longest that fits is shown."""
CORNERED_M: Final = 0.1
"""What counts as the radius of a model without one, as on the page."""
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
    twist: Twist | None = None
    """Of the robot, by its odometry."""


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
        self._radii_m = {m.name: m.arc_radius_m or CORNERED_M for m in settings.models}
        self._ranges = np.full(len(settings.ring.mounts), np.nan)
        self._trail: deque[tuple[float, float]] = deque(maxlen=TRAIL)
        self.console_url: str | None = None
        """Address of the operator console; None without one."""
        self.is_paused: Callable[[], bool] = lambda: False
        """Whether time is paused now."""
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
            None if state.odometry is None else state.odometry.twist,
        )  # fmt: skip
        self._wake.set()

    def draw_again(self) -> None:
        """Draw the newest picture again, as when time was paused."""
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
        snapshot: Snapshot | None = None
        with Live(console=self._console, auto_refresh=False, screen=False) as live:
            while not self._done:
                self._wake.wait()
                self._wake.clear()
                newest, self._slot = self._slot, None
                snapshot = newest or snapshot
                if snapshot is not None:
                    live.update(self.picture(snapshot), refresh=True)

    def picture(self, snapshot: Snapshot) -> Text:
        """Return the view of a snapshot, which fits the terminal.

        What a person needs comes first: mode, address, keys, warnings, objects. Counts and the plan get what is left.
        """
        width, left = max(1, self._console.width), max(0, self._console.height - 1)
        parts: list[list[Text]] = []
        for lines in (self._head(snapshot, width), self._warnings(snapshot)):
            parts.append(lines[:left])
            left -= len(parts[-1])
        counts = self._counts(snapshot)
        # Objects give way to nothing but the head; counts to objects; the plan to both.
        objects = self._objects(snapshot, left - (len(counts) if left >= ROOMY_ROWS else 0))
        left -= len(objects)
        counts = counts[:left]
        left -= len(counts)
        plan = list[Text]()
        if snapshot.pose is None:
            plan = [Text("waiting for odometry")][:left]
        elif left > PLAN_ROWS_MIN:
            drawn = draw_plan(
                snapshot.pose, snapshot.trail, snapshot.segments, snapshot.objects, self._size_m, width, left - 1
            )
            plan = [*list(drawn.split())[: left - 1], Text(LEGEND, style="dim")]
        lines = [line for part in (*parts, plan, objects, counts) for line in part]
        for line in lines:
            line.truncate(width, overflow="ellipsis")
        return Text("\n", no_wrap=True).join(lines)

    def _head(self, snapshot: Snapshot, width: int) -> list[Text]:
        """Return mode and reason, the address of the console (whole, on as many lines as it needs), and the keys."""
        mode = snapshot.mode
        name = mode.mode.value.replace("_", " ")  # as on the page
        head = Text.assemble((f" {name} ", STYLES.get(mode.mode.value, "bold black on yellow")))
        if self.is_paused():
            head.append(" PAUSED ", style="bold black on cyan")
        head.append("" if snapshot.twist is None else f" {twist(snapshot.twist.v, snapshot.twist.w, self._units)}")
        reason, room = mode.reason or "", width - len(head.plain) - 2
        more = list[str]()
        if len(reason) > room and self._console.height >= TALL_ROWS:
            more, reason = wrap(reason, width, max_lines=REASON_LINES_MAX, placeholder=" …"), ""
        head.append(f"  {reason}" if reason else "")
        url = self.console_url or ""
        address = [Text(url[k : k + width], style="bold") for k in range(0, len(url), width)]
        return [
            head,
            *map(Text, more),
            *address,
            Text(next((keys for keys in KEY_LINES if len(keys) <= width), KEY_LINES[-1])),
        ]

    def _warnings(self, snapshot: Snapshot) -> list[Text]:
        return [Text(f"masked  {reason}", style="yellow") for reason in snapshot.sensors[:WARNINGS_MAX]]

    def _objects(self, snapshot: Snapshot, rows: int) -> list[Text]:
        """Return a line for each object as on the page, and how many have no room."""
        objects = sorted(snapshot.objects, key=lambda seen: math.inf if seen.number is None else seen.number)
        if rows < 1 or not objects:
            return []
        walls = sum(seen.ends is not None for seen in objects)
        shown = min(len(objects), rows - 1)
        count = f"objects  {len(objects) - walls}, and {walls} wall{'s' * (walls > 1)}" if walls else (
            f"objects  {len(objects)}")  # fmt: skip
        more = f"; {len(objects) - shown} have no room here" if shown < len(objects) else ""
        cells = [object_row(seen, self._units, hidden=self._is_hidden(seen, snapshot)) for seen in objects[:shown]]
        wide = [max((len(row[k]) for row in cells), default=0) for k in range(4)]
        lines = [
            Text(f"{no:>{wide[0]}} {name:<{wide[1]}}  {sure:>{wide[2]}}  {where:<{wide[3]}}  {size}")
            for no, name, sure, where, size in cells
        ]
        return [Text(count + more, style="bold"), *lines]

    def _is_hidden(self, seen: DetectedObject, snapshot: Snapshot) -> bool:
        radius_m = self._radii_m.get(seen.model, CORNERED_M)
        return snapshot.pose is not None and is_hidden(seen, radius_m, snapshot.pose, snapshot.objects)

    def _counts(self, snapshot: Snapshot) -> list[Text]:
        counts, took, lag = snapshot.counts, snapshot.cycle_us, snapshot.lag_us
        rows = [("ring", self._ring(snapshot.ranges)), ("map", map_text(snapshot.map_counts))]
        if snapshot.localized is not None:
            rows.append(("place", localized_place(snapshot.localized, self._units)))
        rows += [
            ("line", f"{counts.frames} frames, {counts.bad} bad, {counts.lost} lost"),
            ("cycle", f"{snapshot.cycles}, {snapshot.late} late, {snapshot.missed} missed; takes {millis(took)}"),
            ("", f"begins {millis(lag)} after it is due"),
        ]
        if snapshot.faults:
            worst = sorted(snapshot.faults, key=lambda fault: -fault[1])[:FAULTS_SHOWN]
            rows.append(("late by", ", ".join(f"{cause}: {count}" for cause, count in worst)))
        return [Text(f"{name:<8}{value}") for name, value in rows]

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
    return f"{text}; {counts.waiting} near objects wait for room" if counts.waiting else text


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

    def take_keys() -> None:
        # A process in the background may not change the terminal; fg continues it once more.
        if os.tcgetpgrp(fd) == os.getpgrp():
            tty.setcbreak(fd, termios.TCSANOW)  # which keeps a key that was pressed meanwhile

    tty.setcbreak(fd)
    loop.add_reader(fd, read)
    loop.add_signal_handler(signal.SIGCONT, take_keys)  # the shell sets its own mode meanwhile
    try:
        yield
    finally:
        loop.remove_signal_handler(signal.SIGCONT)
        loop.remove_reader(fd)
        with contextlib.suppress(termios.error):
            termios.tcsetattr(fd, termios.TCSADRAIN, before)
