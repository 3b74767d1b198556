"""The order of a ring log's columns: as in the robot file, mirrored, or counted from another sensor."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig, RobotConfig
from drivers.messages import Floats
from runtime.recording.conventions.headings import Angles, echo_scores, sureness
from runtime.recording.conventions.table import HEADINGS, Table
from runtime.recording.ring_log import RingLogError

MIRROR_M: Final = 0.02
"""How far a sensor's mirror image may lie from the sensor that takes its column, m and rad."""
FEW_ECHOES, LIKELY = 400, 3
"""Echoes by which the likeliest of all orders are found, and how many of these are then compared by all echoes."""


def mirrored_columns(ring: RingConfig) -> NDArray[np.int64]:
    """Return for each sensor the one at its mirror image.

    Raises
    ------
    RingLogError
        The ring is not its own mirror image.
    """
    mounts = np.array(ring.mounts)
    image = mounts * [1.0, -1.0, -1.0]
    off = np.hypot(*(mounts[:, None, :2] - image[None, :, :2]).transpose(2, 0, 1))
    off += np.abs(np.angle(np.exp(1j * (mounts[:, None, 2] - image[None, :, 2]))))
    columns: NDArray[np.int64] = off.argmin(axis=0)
    if float(off.min(axis=0).max()) > MIRROR_M:
        raise RingLogError(
            "--sensor-order mirrored: this ring is not its own mirror image; name the robot's own file"
        )
    return columns


class Shift(NamedTuple):
    """A column order that begins with another sensor."""

    angles: Angles
    sensor: int
    surely: float
    """By how many standard errors the echoes agree better than by every order that begins with sensor 0."""

    def words(self, ring: RingConfig) -> str:
        """Return what it means, and what to do."""
        found = f"r00 is sensor {self.sensor} of the robot file"
        if HEADINGS[self.angles.heading].hand < 0:
            image = mirrored_columns(ring)[self.sensor]
            found += f" and {self.angles.words}, or r00 is sensor {image} and the columns run the other way round"
        return (
            f"{found}: the sensors are counted from another one, or the ring is turned (write them into the robot "
            "file in the log's order)"
        )


def find_shift(
    table: Table,
    robot: RobotConfig,
    ways: Sequence[Angles],
    range_m: float,
    length_per_range: float,
    others: Iterable[Floats],
) -> Shift:
    """Return the sensor of the first column by which the echoes agree best; sensor 0 at no standard errors.

    Parameters
    ----------
    table : Table
        Of a robot that moved, in the file's units, without silence and repeats.
    robot : RobotConfig
        Its ring.
    ways : sequence of Angles
        How headings may be counted.
    range_m, length_per_range : float
        The unit of the ranges, m, and that of positions over it.
    others : iterable of (blocks,) float
        Of `echo_scores`, by orders that begin with sensor 0.
    """

    def scores(way: Angles, shift: int, **more: int) -> Floats:
        shifted = table._replace(ranges=np.roll(table.ranges, shift, axis=1))
        return echo_scores(shifted, robot, [way], range_m, length_per_range, **more)[way]

    orders = [(way, shift) for way in ways for shift in range(table.ranges.shape[1])]
    orders.sort(key=lambda order: float(scores(*order, echoes=FEW_ECHOES).mean()))
    likely = {order: scores(*order) for order in orders[-LIKELY:]}
    way, shift = max(likely, key=lambda order: float(likely[order].mean()))
    if shift == 0:
        return Shift(way, 0, 0.0)
    found = likely[way, shift]
    return Shift(way, shift, min(sureness(found, other) for other in (scores(way, 0), *others)))
