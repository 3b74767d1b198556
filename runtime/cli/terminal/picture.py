"""The picture of a run on a terminal: mode, plan, objects, ring, line and timing.

A process of its own draws it (`python -m runtime.cli.terminal`), which starts with the run and takes processor time
from it. So a snapshot holds plain numbers, and this module imports nothing that takes long, such as numpy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from textwrap import wrap
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from rich.console import Console
from rich.text import Text

from perception.detected_object import DetectedObject, MapCounts
from runtime.cli.terminal.page_text import is_hidden, object_row, twist
from runtime.cli.terminal.plan import draw_plan
from runtime.support.length_format import Units

if TYPE_CHECKING:
    from runtime.timing.cycle_stats import Quantiles

STYLES: Final = MappingProxyType(
    {"DRIVE": "bold white on green", "SAFE_STOP": "bold white on red", "FAULT": "bold white on red"}
)
BARS: Final = " ▁▂▃▄▅▆▇█"
FAULTS_SHOWN: Final = 3
WARNINGS_MAX: Final = 3
ROOMY_ROWS: Final = 14
"""From so many lines left on, the counts are all shown beside the objects."""
HEAD_ROWS: Final = 3
"""Mode, keys, and the line that a terminal keeps for its cursor."""
REASON_SHARE: Final = 2
"""A reason that does not fit beside the mode takes at most this part of the lines: its end says what to do."""
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


@dataclass(frozen=True, slots=True)
class Scale:
    """What a run's settings say about its picture."""

    units: Units
    """Of the table of objects."""
    reach_m: float
    """Longest range of the ring, m."""
    size_m: dict[str, float]
    """Radius at which to draw each model, m."""
    radii_m: dict[str, float]
    """Radius of each model for what a wall hides, m."""


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """What the view shows of a cycle; nothing in it changes any more."""

    mode: str
    reason: str | None
    pose: tuple[float, float, float] | None
    """Of the robot: x, y, m, and its direction, rad."""
    trail: list[tuple[float, float]]
    segments: list[tuple[float, float]]
    """Middles of the outline segments, m."""
    map_counts: MapCounts
    objects: tuple[DetectedObject, ...]
    ranges: list[float]
    """Newest of each sensor, m; NaN and inf are no echo."""
    line: tuple[int, int, int]
    """Frames that arrived, bad ones, and lost ones."""
    cycles: int
    late: int
    cycle_us: Quantiles
    lag_us: Quantiles
    missed: int = 0
    faults: tuple[tuple[str, int], ...] = ()
    """Causes of late and overrun cycles, with the number of cycles."""
    sensors: tuple[str, ...] = ()
    """Why sensors are masked."""
    place: str | None = None
    """The robot in the map frame; None where that is odometry's."""
    twist: tuple[float, float] | None = None
    """Of the robot by its odometry, m/s and rad/s."""
    console_url: str | None = None
    """Address of the operator console; None without one."""
    is_paused: bool = False
    """Whether time is paused."""


class Picture:
    """Draws snapshots for a terminal.

    Parameters
    ----------
    console : Console
        The terminal.
    scale : Scale
        Of the run.
    """

    def __init__(self, console: Console, scale: Scale) -> None:
        self._console = console
        self._units, self._reach_m = scale.units, scale.reach_m
        self._size_m, self._radii_m = scale.size_m, scale.radii_m

    def draw(self, snapshot: Snapshot) -> Text:
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
                snapshot.pose,
                snapshot.trail,
                snapshot.segments,
                snapshot.objects,
                self._size_m,
                width,
                left - 1,
            )
            plan = [*list(drawn.split())[: left - 1], Text(LEGEND, style="dim")]
        lines = [line for part in (*parts, plan, objects, counts) for line in part]
        for line in lines:
            shorten(line, width)
        return Text("\n", no_wrap=True).join(lines)

    def _head(self, snapshot: Snapshot, width: int) -> list[Text]:
        """Return mode and reason, the address of the console (whole, on as many lines as it needs), and the keys."""
        name = snapshot.mode.replace("_", " ")  # as on the page
        head = Text.assemble((f" {name} ", STYLES.get(snapshot.mode, "bold black on yellow")))
        if snapshot.is_paused:
            head.append(" PAUSED ", style="bold black on cyan")
        head.append("" if snapshot.twist is None else f" {twist(*snapshot.twist, self._units)}")
        reason, room = snapshot.reason or "", width - len(head.plain) - 2
        url = snapshot.console_url or ""
        address = [Text(url[k : k + width], style="bold") for k in range(0, len(url), width)]
        more, left = list[str](), (self._console.height - len(address) - HEAD_ROWS) // REASON_SHARE
        if len(reason) > room and left > 0:
            more, reason = wrap(reason, width, max_lines=left, placeholder=" …"), ""
        head.append(f"  {reason}" if reason else "")
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
        """Return whether another object stands between the robot and this one; its row of the list says so."""
        radius_m = self._radii_m.get(seen.model, CORNERED_M)
        return snapshot.pose is not None and is_hidden(seen, radius_m, snapshot.pose[:2], snapshot.objects)

    def _counts(self, snapshot: Snapshot) -> list[Text]:
        """Return the lines below the picture: ring, map, place, line and timing."""
        (frames, bad, lost), took, lag = snapshot.line, snapshot.cycle_us, snapshot.lag_us
        rows = [("ring", self._ring(snapshot.ranges)), ("map", map_text(snapshot.map_counts))]
        if snapshot.place is not None:
            rows.append(("place", snapshot.place))
        rows += [
            ("line", f"{frames} frames, {bad} bad, {lost} lost"),
            ("cycle", f"{snapshot.cycles}, {snapshot.late} late, {snapshot.missed} missed; takes {millis(took)}"),
            ("", f"begins {millis(lag)} after it is due"),
        ]
        if snapshot.faults:
            worst = sorted(snapshot.faults, key=lambda fault: -fault[1])[:FAULTS_SHOWN]
            rows.append(("late by", ", ".join(f"{cause}: {count}" for cause, count in worst)))
        return [Text(f"{name:<8}{value}") for name, value in rows]

    def _ring(self, ranges: list[float]) -> str:
        """Return a bar per sensor, higher for a nearer echo, or a dot without an echo."""
        bars = []
        for r in ranges:
            near = 0.0 if not math.isfinite(r) else 1.0 - min(r / self._reach_m, 1.0)
            bars.append("·" if not math.isfinite(r) else BARS[max(1, round(near * (len(BARS) - 1)))])
        return "".join(bars)


def shorten(line: Text, width: int) -> None:
    """Cut a line that is wider than the terminal, but not within a number: 2.13 would read as 2."""
    if line.cell_len <= width:
        return
    line.truncate(width - 1)
    last = line.plain.rpartition(" ")[2]
    if any(c.isdigit() for c in last) and last != line.plain:
        line.right_crop(len(last))
    line.append("…")


def map_text(counts: MapCounts) -> str:
    """Return what the map holds, as one line."""
    text = f"{counts.segments} segments, {counts.hypotheses} hypotheses"
    if counts.archived:
        text += f", {counts.archived} objects left behind"
    return f"{text}; {counts.waiting} near objects wait for room" if counts.waiting else text


def millis(quantiles: Quantiles) -> str:
    """Return median and 99th percentile as text, in milliseconds."""
    return f"{quantiles['p50'] / 1e3:.2f} ms (p99 {quantiles['p99'] / 1e3:.2f})"
