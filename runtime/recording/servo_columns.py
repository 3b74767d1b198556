"""Bearings of sensors on servos in a ring log: a column h00 beside r00, radians from the robot's front.

Inside the program such a sensor is one mount for each bearing (`drivers.servo_views`); here rows of sensors and their
bearings become rows of mounts, and the other way round.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Final

import numpy as np

from config.robot import RingConfig
from drivers.messages import Floats
from drivers.servo_views import ServoViews

COLUMN: Final = re.compile(r"h(\d{2,3})")
HINT: Final = (
    "h00 is the bearing of sensor 0 on its servo, in radians from the robot's front, in each row in which it fired; "
    "bearings and sweep_deg of ring.sensors in the robot file must have it"
)


class ServoColumns:
    """The columns of a ring's bearings.

    Parameters
    ----------
    ring : RingConfig
        The ring; without servos rows pass as they are.
    """

    def __init__(self, ring: RingConfig) -> None:
        self._views = ServoViews(ring)
        self.sensors = tuple(i for i, is_on in enumerate(self._views.on_servo) if is_on)
        """Those on servos, each with a column."""
        self.sensor_count = ring.sensor_count
        """Columns of ranges."""

    @property
    def names(self) -> list[str]:
        """The names of the columns, which stand behind those of the ranges."""
        return [f"h{i:02d}" for i in self.sensors]

    def mounts(self, ranges: Floats, bearings: Sequence[float]) -> Floats:
        """Return the ranges of a row by mount.

        Parameters
        ----------
        ranges : (sensors,) float
            NaN where a sensor did not fire.
        bearings : sequence of float
            Of `sensors`, rad; NaN where a cell is empty.

        Raises
        ------
        ValueError
            A sensor that fired has no bearing, or one that its servo does not have; the text names the column.
        """
        found = np.full(self._views.count, math.nan)
        turned = dict(zip(self.sensors, bearings, strict=True))
        for sensor, range_m in enumerate(ranges.tolist()):
            if math.isnan(range_m):
                continue
            mount = self._views.mount(sensor, turned.get(sensor, math.nan))
            if mount is None:
                raise ValueError(f"column 'h{sensor:02d}' is {turned[sensor]:g}")
            found[mount] = range_m
        return found

    def row(self, ranges: Floats) -> tuple[list[float], list[float]]:
        """Return the ranges by sensor, and the bearings of `sensors`, of ranges by mount.

        Raises
        ------
        ValueError
            A sensor fired at two bearings at once.
        """
        by_sensor = [math.nan] * self.sensor_count
        turned: dict[int, float] = {}
        for mount in np.flatnonzero(~np.isnan(ranges)).tolist():
            sensor = self._views.sensor_of[mount]
            if not math.isnan(by_sensor[sensor]):
                raise ValueError(f"sensor {sensor} at two bearings at once")
            by_sensor[sensor], turned[sensor] = float(ranges[mount]), self._views.bearing(mount)
        return by_sensor, [math.remainder(turned[i], math.tau) if i in turned else math.nan for i in self.sensors]
