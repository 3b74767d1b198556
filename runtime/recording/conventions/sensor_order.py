"""The order of a ring log's columns: as in the robot file, mirrored, or counted from another sensor."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig, RobotConfig
from drivers.messages import Floats
from runtime.recording.conventions.headings import SURE, Angles, echo_scores, sureness
from runtime.recording.conventions.table import Table
from runtime.recording.ring_log import RingLogError

MIRROR_M: Final = 0.02
"""How far a sensor's mirror image may lie from the sensor that takes its column, m and rad."""
FEW_ECHOES: Final = 400
"""Echoes by which the likeliest of all orders is found; it is then compared by all of them."""


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


def check_shift(table: Table, robot: RobotConfig, angles: Angles, range_m: float, length_per_range: float) -> None:
    """Raise an error if the echoes agree only where the columns begin with another sensor.

    Parameters
    ----------
    table : Table
        Of a robot that moved, in the file's units, without silence and repeats.
    robot : RobotConfig
        Its ring.
    angles : Angles
        How headings are counted.
    range_m, length_per_range : float
        The unit of the ranges, m, and that of positions over it.

    Raises
    ------
    RingLogError
        They do.
    """

    def scores(shift: int, **more: int) -> Floats:
        shifted = table._replace(ranges=np.roll(table.ranges, shift, axis=1))
        return echo_scores(shifted, robot, [angles], range_m, length_per_range, **more)[angles]

    sensors = table.ranges.shape[1]
    best = max(range(sensors), key=lambda shift: float(scores(shift, echoes=FEW_ECHOES).mean()))
    if best and sureness(scores(best), scores(0)) > SURE:
        raise RingLogError(
            f"later echoes fall on earlier ones if r00 is sensor {best} of the robot file, not if it is sensor 0: "
            "the sensors are counted from another one, or the ring is turned; write them into the robot file in the "
            "log's order"
        )
