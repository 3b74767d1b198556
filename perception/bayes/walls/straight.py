"""The line of a sure wall, its spans and ends, as reported: after its last review, with the corners heard on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.bayes.inference.cross_path import LENGTH_MIN_M
from perception.bayes.memory.wall_records import WALL_BIN_M, WALL_BINS
from perception.bayes.walls.bins import HALF, bin_of
from perception.bayes.walls.fit import CRACK_PASSES_MIN, OPENING_MIN_M, OPENING_PASSES_MIN
from perception.bayes.walls.joint_fit import Lines, fit_together
from perception.bayes.walls.numbers import SPAN_MIN_M
from perception.kernel import Floats
from perception.records import Structured

FRAME: Final = ("origin_x", "origin_y", "normal_x", "normal_y")
LINE: Final = ("offset", "slope", "variance_offset", "covariance", "variance_slope")
"""Fields of a wall: its frame in the map, and its line in that frame."""


@dataclass(slots=True)
class Straight:
    """The line of a wall that is sure, and its spans."""

    wall: Any
    spans: Structured
    frame: tuple[float, ...]
    """Origin (m), normal, offset (m) and slope, as in `Wall`."""
    variances: tuple[float, ...]
    """Variance of the offset (m²), covariance (m), and variance of the slope."""
    ends: Floats
    """(n, 2): the ends of the spans along it in ascending order, m."""

    def point(self, along: float) -> tuple[float, float]:
        """Return the point at a position along the line, m."""
        ox, oy, nx, ny, offset, slope = self.frame
        off = offset + slope * along
        return ox + nx * off - ny * along, oy + ny * off + nx * along

    def along(self, x: float, y: float) -> float:
        """Return the position of a point along the line, m."""
        ox, oy, nx, ny, _, _ = self.frame
        return nx * (y - oy) - ny * (x - ox)

    def beyond(self, x: float, y: float) -> tuple[float, float, tuple[int, int]]:
        """Return where a point is along the line, how far beyond the nearest end (m), and which end that is."""
        along = self.along(x, y)
        span, side = divmod(int(np.abs(self.ends - along).argmin()), 2)
        return along, (along - float(self.ends[span, side])) * (2 * side - 1), (span, side)

    def is_passed(self, a: float, b: float) -> bool:
        """Return whether ranges passed through the wall between two positions along it, m."""
        low, high = min(a, b), max(a, b)
        between = self.wall["bins"][max(0, bin_of(low)) : min(WALL_BINS, bin_of(high))]
        is_covered = between["weight"] > np.maximum(between["passes"], 0.0)
        return bool(between["passes"][~is_covered].sum() >= OPENING_PASSES_MIN)

    def hold_to_review(self) -> None:
        """Let the spans go as far as the last review found, if there was one; it may leave none."""
        if not self.wall["reviewed"]["information"] > 0.0:
            return
        bins = self.wall["bins"]
        is_held = (bins["is_held"] == 1) | kept_bins(bins)
        on = np.flatnonzero(is_held)
        is_far = (np.diff(on) - 1) * WALL_BIN_M > OPENING_MIN_M + LENGTH_MIN_M
        opened = np.cumsum((bins["is_open"] == 1) & ~is_held)[on]
        parts = np.split(on, np.flatnonzero(is_far | (np.diff(opened) > 0)) + 1)
        ends, kept = [], []
        for low, high in ((int(part[0]), int(part[-1]) + 1) for part in parts if len(part)):
            own = self.spans[(self.spans["first_bin"] < high) & (low < self.spans["end_bin"])]
            if len(own) and (high - low) * WALL_BIN_M >= SPAN_MIN_M:
                kept.append(own[int(own["weight"].argmax())])
                ends.append(((low - HALF) * WALL_BIN_M, (high - HALF) * WALL_BIN_M))
        self.spans, self.ends = np.array(kept, self.spans.dtype), np.array(ends).reshape(-1, 2)

    def hold_to_stop(self) -> None:
        """Let the spans go as far as they did when the robot stopped, but not into one another."""
        kept = kept_bins(self.wall["bins"])
        low, high = np.rint(self.ends.T / WALL_BIN_M).astype(np.int64) + HALF
        for k in range(len(self.ends)):
            first, end = int(low[k]), int(high[k])
            while first > (int(high[k - 1]) if k else 0) and kept[first - 1]:
                first -= 1
            while end < (int(low[k + 1]) if k + 1 < len(low) else WALL_BINS) and kept[end]:
                end += 1
            low[k], high[k] = first, end
            self.ends[k, 0] = min(self.ends[k, 0], (first - HALF) * WALL_BIN_M)
            self.ends[k, 1] = max(self.ends[k, 1], (end - HALF) * WALL_BIN_M)


def kept_bins(bins: Structured) -> NDArray[np.bool_]:
    """Return where a wall was sure when the robot stopped, and ranges do not pass now, of records of `WallBin`.

    One range may be a stray; where the surroundings have changed, a sensor that stands counts more than one.
    """
    return np.asarray((bins["is_kept"] == 1) & (bins["passes"] < np.maximum(bins["weight"], CRACK_PASSES_MIN)))


def straight(wall: Structured, spans: Structured) -> Straight:
    """Return a wall with these of its spans."""
    frame, line = tuple(float(wall[name]) for name in FRAME), reported_line(wall)
    ends = np.column_stack([spans["low"], spans["high"]])
    return Straight(wall, spans, (*frame, *line[:2]), line[2:], ends)


def reported_line(wall: Structured) -> tuple[float, ...]:
    """Return the fields `LINE` of a wall's fit to its bins, or of its review where that had more information."""
    line, reviewed = (tuple(float(of[name]) for name in LINE) for of in (wall, wall["reviewed"]))
    information = float(wall["reviewed"]["information"])
    return reviewed if information * (line[2] * line[4] - line[3] ** 2) > 1.0 else line


def straighten(walls: dict[int, Straight], corners: Structured, edges: Structured) -> tuple[Structured, Structured]:
    """Fit the walls and the corners that are heard together.

    Parameters
    ----------
    walls : dict of Straight
        The walls by their number; their lines are updated.
    corners, edges : (n,) record of `RoomCorner`
        All corners and edges.

    Returns
    -------
    tuple of (n,) record of `RoomCorner`
        The corners and the edges, with their corrected places.
    """
    if not walls:
        return corners, edges
    points = np.concatenate([corners, edges])
    ends = points[len(corners) :]["second"].copy()
    points["second"][len(corners) :] = -1
    rows = np.array([(*of.frame, *of.variances) for of in walls.values()]).reshape(-1, 9)
    lines = fit_together(Lines(rows[:, :4], rows[:, 4:]), points, list(walls))
    points["second"][len(corners) :] = ends
    for of, line in zip(walls.values(), lines.tolist(), strict=True):
        of.frame, of.variances = (*of.frame[:4], *line[:2]), tuple(line[2:])
    return points[: len(corners)], points[len(corners) :]
