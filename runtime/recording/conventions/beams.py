"""Which readings walls along the way explain, whose ranges stand for as long as the robot drives beside them.

A wall at the distance d is heard at d / cos(a) by a beam whose nearest ray is at the angle a from the wall's normal.
So sensors at one angle to the way share a range, and those at other angles do not. Silence is one and the same value
at every angle.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.robot import RobotConfig
from drivers.messages import Floats
from runtime.recording.conventions.headings import Angles
from runtime.recording.conventions.table import HEADINGS, LENGTHS, Table

WAY_STEPS: Final = 600
"""Steps of equal length into which the way is cut, over two of which its direction is measured."""
SLACK_RAD: Final = math.radians(3.0)
"""By how much a sensor's angle to the way may be wrong: what a heading is off, and how straight the way is."""
SEARCH_RAD: Final = np.radians(np.arange(0.0, 91.0))
BLOCKS: Final = 40
"""Parts of a drive, in each of which the walls beside the robot are at one distance."""
FORESEEN: Final = 0.05
"""By how much the distance of a wall may differ from that by the sensors which look straight at it, as a share."""


class Beams(NamedTuple):
    """Where sensors look."""

    bearing: Floats
    """(n, sensors): rad from the direction of the way, from −π to π; NaN where the robot does not move on."""
    radius_m: Floats
    """(sensors,): how far they are from the robot's centre."""
    mounted: Floats
    """(sensors,): angle from where they look to where they are on the robot, rad."""
    half_angle: float
    """Of a beam, rad."""
    range_max_m: float
    """The ring's greatest range."""

    @staticmethod
    def of(table: Table, robot: RobotConfig, angles: Angles) -> Beams:
        """Return the beams of a table whose headings are counted so."""
        x, y = table.pose[:, 0], HEADINGS[angles.heading].hand * table.pose[:, 1]
        way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
        step = way[-1] / WAY_STEPS
        a = np.maximum(np.searchsorted(way, way - step, side="right") - 1, 0)
        b = np.minimum(np.searchsorted(way, way + step, side="left"), len(way) - 1)
        dx, dy = x[b] - x[a], y[b] - y[a]
        ahead = np.where(np.hypot(dx, dy) > 0.5 * step, np.arctan2(dy, dx), np.nan)
        mounts = np.array(robot.ring.mounts)
        bearing = np.asarray(angles.yaw(table.pose[:, 3]) - ahead)[:, None] + mounts[:, 2]
        return Beams(
            np.angle(np.exp(1j * bearing)),
            np.hypot(mounts[:, 0], mounts[:, 1]),
            np.arctan2(mounts[:, 1], mounts[:, 0]) - mounts[:, 2],
            math.radians(robot.ring.beam_half_angle_deg),
            robot.ring.range_max_m,
        )

    @property
    def off_way(self) -> Floats:
        """Angles between beams and the line of the way, from 0 to π / 2."""
        off_way = np.abs(self.bearing)
        return np.minimum(off_way, math.pi - off_way)

    def at_one_angle(self, inside: NDArray[np.bool_], low: float, high: float) -> NDArray[np.bool_]:
        """Return which sensors would hear one wall along the way at some range from low to high, (n, sensors).

        Parameters
        ----------
        inside : (n, sensors) bool
            Readings between low and high; the wall is where most of them are explained.
        low, high : float
            In the file's unit.
        """
        nearest = np.minimum(SEARCH_RAD + self.half_angle, 0.5 * math.pi)
        begins = np.arcsin(np.clip(np.sin(nearest) * low / high, 0.0, 1.0)) - self.half_angle - SLACK_RAD
        ends = SEARCH_RAD + SLACK_RAD
        found = np.sort(self.off_way[inside & np.isfinite(self.bearing)])
        counts = np.searchsorted(found, ends) - np.searchsorted(found, begins)
        k = len(counts) - 1 - int(counts[::-1].argmax())
        shown: NDArray[np.bool_] = (self.off_way >= begins[k]) & (self.off_way <= ends[k])
        return shown

    def foreseen(self, ranges: Floats) -> NDArray[np.bool_]:
        """Return which ranges are those of the walls that the sensors which look straight at them hear.

        Parameters
        ----------
        ranges : (n, sensors) float
            In the file's unit, which may be any in which the ring can have them.
        """
        shown = np.zeros(ranges.shape, dtype=np.bool_)
        farthest = float(np.nanquantile(ranges, 0.99))
        nearest = np.minimum(self.off_way + self.half_angle, 0.5 * math.pi)
        for unit in LENGTHS.values():
            if 0.05 * self.range_max_m < unit * farthest < 1.2 * self.range_max_m:
                mounted = self.radius_m / unit * np.abs(np.sin(self.bearing + self.mounted))
                away = ranges * np.sin(nearest) + mounted
                for rows in np.array_split(np.arange(len(ranges)), min(BLOCKS, len(ranges))):
                    self._add_foreseen(away[rows], nearest[rows], self.bearing[rows], shown[rows[0] : rows[-1] + 1])
        return shown

    def _add_foreseen(self, away: Floats, nearest: Floats, bearing: Floats, shown: NDArray[np.bool_]) -> None:
        """Add to `shown` which distances from the way are those of one of its two sides, in a part of the drive."""
        for side in (bearing >= 0.0, bearing <= 0.0):
            walls = away[side & (nearest >= 0.5 * math.pi) & np.isfinite(away)]
            if len(walls):
                sees = side | (nearest <= 2.0 * self.half_angle)  # ahead or behind: both
                shown |= sees & (np.abs(away / float(np.median(walls)) - 1.0) < FORESEEN)

    def is_greatest(self, value: float) -> bool:
        """Return whether a range is exactly the ring's greatest one in any unit."""
        return any(math.isclose(value * unit, self.range_max_m, rel_tol=1e-3) for unit in LENGTHS.values())
