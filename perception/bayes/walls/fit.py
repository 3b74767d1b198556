"""Fit of the walls to their bins: the spans that the bins cover, their ends, and the line by least squares."""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.memory.parameters import SYSTEMATIC_M
from perception.bayes.memory.polygon_parameters import EDGE_REACH_M
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import StateRecord
from perception.bayes.memory.wall_records import CANDIDATE, SPANS_MAX, WALL_BIN_M, WALL_BINS, Wall, WallMap
from perception.bayes.walls.bins import HALF, clear_wall, is_covered, mean_error, middle_of
from perception.bayes.walls.contact import are_mirrors, edges_answer
from perception.bayes.walls.evidence import judge
from perception.bayes.walls.numbers import number_spans
from perception.kernel import entry_kernel, kernel
from perception.shared_numbers import OUTLIER_SIGMAS

SLOPE_SIGMA: Final = 0.15
"""Prior of a wall's slope in its frame."""
OFFSET_INFORMATION: Final = 1e-3
"""Prior information on a wall's offset, m⁻²."""
WALL_WEIGHT_MIN: Final = 3.0
"""A wall of less weight ends, and a span of less is not reported."""
GAP_MAX_M: Final = 0.75
"""Longest gap without readings inside a span; where everything echoes, an opening's width is one too long. So far a
wall may continue beyond its spans."""
ROUGH_WEIGHT_MIN: Final = 0.6
"""Where everything echoes, a bin counts if it holds more than one echo from a beam's edge: echoes of posts lie near
the line too."""
LONE_GAP_M: Final = 0.35
"""A light end beyond a gap as wide as this is left out: at so long a lever one outlier would prove any line."""
LONE_WEIGHT_MAX: Final = 1.0
"""An end of no more weight than this is light."""
OPENING_MIN_M: Final = 0.3
"""Least width of an opening."""
OPENING_PASSES_MIN: Final = 1.0
"""Passes in a gap of `OPENING_MIN_M` that make it an opening: echoes from its ends cover the rest."""
CRACK_PASSES_MIN: Final = 3.0
"""Passes in a narrower gap that make it an opening."""
STRAY_BINS: Final = 2
"""Neighbours on either side with which a bin is compared with the line."""
STRAY_SLACK_M: Final = 0.012
"""Distance in `OUTLIER_SIGMAS`: such echoes come mostly from the ends of an opening."""
STRAY_BEFORE_M: Final = 0.03
"""Echoes that lie this far before the line come from another wall at its corner, before that was known."""
PASSED_MIN: Final = 1.5
"""Passes of a bin and its neighbours that make it open."""
PASSED_SHARE: Final = 0.4
"""Least share of these passes in the weight there."""
TRIM_BINS_MAX: Final = 13
"""Fewer bins than this may be left out at an end of a span."""
TRIM_GAIN_NAT: Final = 0.5
"""Gain required of each earlier end."""
TRIM_FAR_NAT: Final = 2.0
"""Loss for each bin that is left out although no end between mirrors would be heard from so far."""
TRIM_REACH_SLACK_M: Final = 0.2
"""An end between mirrors is heard from no farther than this beyond `EDGE_REACH_M`."""


@kernel
def fit_line(wall: Wall) -> None:
    """Fit a wall's line to the covered bins of its spans, to all where it has none, by weighted least squares."""
    s0 = OFFSET_INFORMATION
    s1 = 0.0
    s2 = 1.0 / SLOPE_SIGMA**2
    t0 = 0.0
    t1 = 0.0
    total = 0.0
    for k in range(max(1, wall.span_count)):
        first = 0
        end = WALL_BINS
        if wall.span_count > 0:
            first = wall.spans[k].first_bin
            end = wall.spans[k].end_bin
        for b in range(first, end):
            of = wall.bins[b]
            if is_covered(of):
                total += of.weight
                u = middle_of(b)
                w = of.precision
                z = of.offset_sum / w
                s0 += w
                s1 += w * u
                s2 += w * u * u
                t0 += w * z
                t1 += w * u * z
    wall.weight = total
    det = s0 * s2 - s1 * s1
    wall.offset = (s2 * t0 - s1 * t1) / det
    wall.slope = (s0 * t1 - s1 * t0) / det
    wall.variance_offset = s2 / det
    wall.covariance = -s1 / det
    wall.variance_slope = s0 / det


@kernel
def trimmed_end(wall: Wall, low: int, high: int, side: int, reach: float) -> int:
    """Return the last bin of a run of bins at one side, by likelihood.

    A sensor beyond the end of a wall hears the end. Its range is longer than the line's would be, at first by less
    than the noise, so that the bins' means decide.

    Parameters
    ----------
    wall : Wall
        The wall.
    low, high : int
        First and last bin of the run.
    side : int
        1 for the high end, −1 for the low one.
    reach : float
        The end is not heard from beyond, m.
    """
    best = 0.0
    outer = high if side > 0 else low
    last = outer
    for k in range(1, min(TRIM_BINS_MAX, high - low - 2)):
        end = outer - side * k
        gain = 0.0
        for j in range(1, k + 1):
            of = wall.bins[end + side * j]
            if is_covered(of):
                e = mean_error(wall, end + side * j)
                d = of.range_sum / of.precision
                x = (j - 0.5) * WALL_BIN_M
                longer = math.sqrt(d * d + x * x) - d
                var = 1.0 / of.precision + SYSTEMATIC_M**2
                if d > reach:
                    gain -= TRIM_FAR_NAT
                else:
                    gain += (e * e - (e - longer) ** 2) / (2.0 * var)
        if gain > best + TRIM_GAIN_NAT:
            best = gain
            last = end
    return last


@kernel
def is_stray(room: WallMap, wall: Wall, b: int) -> bool:
    """Return whether the echoes of a covered bin and its neighbours lie too far behind the line."""
    total = 0.0
    precision = 0.0
    error = 0.0
    passes = 0.0
    for k in range(max(0, b - STRAY_BINS), min(WALL_BINS, b + STRAY_BINS + 1)):
        of = wall.bins[k]
        passes += of.passes
        if is_covered(of):
            total += of.weight
            precision += of.precision
            error += of.precision * mean_error(wall, k)
    if edges_answer(room) and passes >= PASSED_MIN and passes > PASSED_SHARE * total:
        return True
    slack = OUTLIER_SIGMAS / math.sqrt(precision)
    return error / precision > slack + STRAY_SLACK_M or error / precision < -slack - STRAY_BEFORE_M


@kernel
def passes_of_a_gap(room: WallMap, wall: Wall, b: int, is_rough: bool) -> float:
    """Return the weight of the ranges that passed a bin without a wall, −1 where there is one, or at the end."""
    if b == WALL_BINS:
        return -1.0
    of = wall.bins[b]
    if not is_covered(of) or (is_rough and of.weight < ROUGH_WEIGHT_MIN):
        return of.passes
    return of.weight if is_stray(room, wall, b) else -1.0


@kernel
def opens(width: float, passes: float, gap_max: float) -> bool:
    """Return whether a gap of so many m, which so many ranges passed, ends a span."""
    return width > gap_max or passes >= CRACK_PASSES_MIN or (width >= OPENING_MIN_M and passes >= OPENING_PASSES_MIN)


@kernel
def enter_span(wall: Wall, low: int, high: int, reach: float) -> None:
    """Add the span between two bins, both included, if it fits, without what its ends explain better."""
    if wall.span_count >= SPANS_MAX:
        return
    for side in range(1, -2, -2):  # a literal in the call would be a type of its own, compiled by itself
        end = trimmed_end(wall, low, high, side, reach)
        low = low if side > 0 else end
        high = end if side > 0 else high
    span = wall.spans[wall.span_count]
    span.first_bin = low
    span.end_bin = high + 1
    span.low = (low - HALF) * WALL_BIN_M
    span.high = (high + 1 - HALF) * WALL_BIN_M
    wall.span_count += 1


@kernel
def find_spans(room: WallMap, wall: Wall) -> None:
    """Find the spans of a wall: runs of covered bins without a long gap, and without passes in a gap.

    What the ends of a run explain better than the line is left out.
    """
    wall.span_count = 0
    is_rough = edges_answer(room)
    gap_max = OPENING_MIN_M if is_rough else GAP_MAX_M
    reach = EDGE_REACH_M + TRIM_REACH_SLACK_M if are_mirrors(room) else math.inf
    first = -1
    last = -1
    passes = 0.0
    weight = 0.0  # of the run since its last long gap, …
    before = -1  # … and the last bin before that
    for b in range(WALL_BINS + 1):
        passed = passes_of_a_gap(room, wall, b, is_rough)
        if passed >= 0.0:
            passes += passed
            continue
        width = (b - last - 1) * WALL_BIN_M
        is_opening = b == WALL_BINS or opens(width, passes, gap_max)
        is_gap = width >= LONE_GAP_M
        if is_gap and not is_opening and before < 0 and weight <= LONE_WEIGHT_MAX:
            first = b
        if is_opening and before >= 0 and weight <= LONE_WEIGHT_MAX:
            last = before
        if is_opening and first >= 0:
            enter_span(wall, first, last, reach)
        if first < 0 or is_opening:
            first = b
            weight = 0.0
            before = -1
        elif is_gap:
            before = last if first < b else -1
            weight = 0.0
        if b < WALL_BINS:
            weight += wall.bins[b].weight
        last = b
        passes = 0.0


@entry_kernel
def fit_walls(s: StateRecord, p: SettingsRecord, first: int, end: int, step: int) -> None:
    """Find the spans of the walls whose bins have changed, fit, judge and number them; end those that fade away.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    first, end, step : int
        Only every `step`-th wall from `first` on, `end` excluded.
    """
    room = s[0].room
    for k in range(first, end, step):
        wall = room.walls[k]
        if wall.is_changed == 1:
            wall.is_changed = 0
            if wall.span_count == 0:
                fit_line(wall)
            find_spans(room, wall)
            fit_line(wall)
            if wall.span_count == 0 or wall.weight < WALL_WEIGHT_MIN:
                clear_wall(wall)
            else:
                judge(wall, p)
                if k != CANDIDATE:
                    number_spans(s, k)
