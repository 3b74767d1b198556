"""The order of a ring log's columns: as in the robot file, mirrored, counted from another sensor, or exchanged."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig, RobotConfig
from drivers.messages import Floats
from runtime.recording.conventions.headings import (
    KERNEL_M,
    Angles,
    echo_places,
    echo_scores,
    from_middle,
    mirror_image,
    nearness,
    sureness,
)
from runtime.recording.conventions.table import HEADINGS, Table
from runtime.recording.ring_log import RingLogError

MIRROR_M: Final = 0.02
"""How far a sensor's mirror image may lie from the sensor that takes its column, m and rad."""
FEW_ECHOES: Final = 400
"""Echoes by which the likeliest of all orders are found."""
LIKELY: Final = 3
"""How many of these are then compared by all echoes."""
EACH: Final = 100
"""Echoes of a column by which it is tried on every sensor."""
TRIED: Final = 3.5
"""Standard errors by which an exchange of two columns must gain before the other half of the echoes is asked."""
PLACED: Final = 800
"""Echoes that these are compared with."""
PARTS: Final = 12
"""Parts of the time in which an exchange is judged."""
GAIN_NAT: Final = math.log(300.0 * 100.0)
"""What the moved columns' echoes must gain before their own sum counts, nat: some 300 pairs of columns are tried, and
one log in a hundred has exchanged ones. In halls of mirrors columns in their order gained up to 6 nat, and evenly."""
ORDERS: Final = 3
"""How many of the orders that are tried are judged, besides the last one."""
ROUNDS: Final = 3
"""How often columns are tried: against the echoes as the last order places them, in the second round those that it
leaves where they are."""


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


class Exchange(NamedTuple):
    """Columns that belong to one another's sensors."""

    angles: Angles
    sensors: NDArray[np.int64]
    """Of each column."""
    surely: float
    """By how many standard errors the echoes agree better than in the file's order."""

    def words(self, ring: RingConfig, others: Sequence[Angles]) -> str:
        """Return what it means, and what to do.

        Parameters
        ----------
        ring : RingConfig
            The robot's.
        others : sequence of Angles
            How headings may be counted. The mirror image of an order says the same with that of the headings; the one
            that moves fewer columns is named, or both.
        """
        readings, image = [self], mirror_image(self.angles)
        if image in others:
            with contextlib.suppress(RingLogError):  # a ring without a mirror image
                readings.append(Exchange(image, mirrored_columns(ring)[self.sensors], self.surely))
        fewest = min(len(one.moved) for one in readings)
        readings = [one for one in readings if len(one.moved) == fewest]
        readings.sort(key=lambda one: HEADINGS[one.angles.heading].hand, reverse=True)
        named = []
        for one in readings:
            columns = ", ".join(f"r{column:02d} is sensor {one.sensors[column]}" for column in one.moved)
            named.append(f"{columns} of the robot file, and {one.angles.words}")
        return (
            f"columns are exchanged: {'; or '.join(named)} (put them in order, or write the sensors into the robot "
            "file in the log's order; or say --sensor-order file if they are right)"
        )

    @property
    def moved(self) -> list[int]:
        """The columns that are not those of their sensors."""
        columns: list[int] = np.flatnonzero(self.sensors != np.arange(len(self.sensors))).tolist()
        return columns


def find_exchange(
    table: Table,
    robot: RobotConfig,
    way: Angles,
    range_m: float,
    length_per_range: float,
    others: Sequence[Angles],
) -> Exchange | None:
    """Return the exchanged columns by which the echoes agree best; None if no exchange makes them agree better.

    An order is sought by half of the echoes and judged by the others, so that one that only chance favours fails.

    Parameters
    ----------
    table : Table
        Of a robot that moved, in the file's units, without silence and repeats.
    robot : RobotConfig
        Its ring.
    way : Angles
        How headings are counted; where that leaves a mirror image open, either.
    range_m, length_per_range : float
        The unit of the ranges, m, and that of positions over it.
    others : sequence of Angles
        How headings may be counted in the file's order.
    """
    is_first = np.random.default_rng(0).random(table.ranges.shape) < 0.5
    first, second = (table._replace(ranges=np.where(kept, table.ranges, np.nan)) for kept in (is_first, ~is_first))
    own = np.arange(table.ranges.shape[1])
    orders, units = [own], (range_m, range_m * length_per_range)
    for number in range(ROUNDS):
        among = _alike(orders[-1]) if number % 2 else None
        tried = _exchanged(_fits(first, robot, way, units, orders[-1], among), orders[-1])
        if not tried:
            break
        orders += tried
    if len(orders) == 1:
        return None
    kept = echo_scores(second, robot, list(dict.fromkeys([way, *others])), range_m, length_per_range)
    exchanges = []
    for order in orders[1 : 1 + ORDERS] + orders[-1:]:
        ordered = second._replace(ranges=second.ranges[:, np.argsort(order)])
        scores = echo_scores(ordered, robot, [way], range_m, length_per_range)[way]
        surely = {one: sureness(scores, kept[one]) for one in kept}
        moved = _gains(_fits(second, robot, way, units, order, _alike(order)), order)
        is_few = 2 * np.count_nonzero(order != own) <= len(own)  # of all columns' echoes, few differ
        if is_few and surely[way] > 0.0 and float(moved.sum()) > GAIN_NAT:
            surely[way] = max(surely[way], sureness(moved, np.zeros(PARTS)))
        exchanges.append(Exchange(way, order, min(surely.values())))
    return max(exchanges, key=lambda one: one.surely)


def _fits(
    table: Table,
    robot: RobotConfig,
    way: Angles,
    units: tuple[float, float],
    order: NDArray[np.int64],
    among: NDArray[np.bool_] | None = None,
) -> list[Floats]:
    """Return for each column how well other columns' echoes explain each of its own, (sensors, echoes).

    Parameters
    ----------
    table, robot, way
        As of `find_exchange`.
    units
        Of ranges and of positions, m.
    order
        The sensor of each column, for the others' echoes.
    among
        The columns that count as others; all if not given.
    """
    mounts, (range_m, length_m) = np.array(robot.ring.mounts), units
    pose = from_middle(table.pose)
    rng = np.random.default_rng(0)
    rows, columns = np.nonzero(np.isfinite(table.ranges))
    some = np.arange(len(rows)) if among is None else np.flatnonzero(among[columns])
    some = rng.permutation(some)[:PLACED]
    reach = range_m * table.ranges[rows[some], columns[some]]
    x, y = echo_places(pose[rows[some]], way, mounts[order[columns[some]]], reach, length_m)
    fits = []
    for column in range(len(mounts)):
        own, others = rows[columns == column], columns[some] != column
        own = np.sort(rng.permutation(own)[:EACH])
        reach = range_m * table.ranges[own, column]
        px, py = echo_places(pose[own], way, mounts[:, None], reach, length_m)
        near = [nearness(*places, x[others], y[others], KERNEL_M).sum(axis=1) for places in zip(px, py, strict=True)]
        density = np.array(near) / max(1, int(others.sum()))
        fits.append(np.log(density + 1e-3))
    return fits


def _alike(order: NDArray[np.int64]) -> NDArray[np.bool_] | None:
    """Return the columns that an order leaves to their sensors: their echoes speak for no order; None if none."""
    alike: NDArray[np.bool_] = order == np.arange(len(order))
    return alike if alike.any() else None


def _gains(fits: list[Floats], order: NDArray[np.int64]) -> Floats:
    """Return by how much moved columns' echoes are explained better than in the file's order, in parts of the time.

    Only these columns' echoes differ, so all others would only blur the sum.
    """
    gains = [fits[column][sensor] - fits[column][column] for column, sensor in enumerate(order) if sensor != column]
    return np.array([sum(float(part.sum()) for part in parts) for parts in _parts(gains)])


def _parts(gains: Iterable[Floats]) -> Iterator[tuple[Floats, ...]]:
    """Yield the gains of several columns in each part of the time."""
    return zip(*(np.array_split(each, PARTS) for each in gains), strict=True)


def _exchanged(fits: list[Floats], order: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Return the orders after one exchange of two columns that gain by it, after two, …; greatest gain first."""
    orders = [order]
    while True:
        order, best, gain = orders[-1], None, 0.0
        for i, j in itertools.combinations(range(len(order)), 2):
            gains = (fits[i][order[j]] - fits[i][order[i]], fits[j][order[i]] - fits[j][order[j]])
            total = sum(float(each.sum()) for each in gains)
            if total > gain and all(len(each) >= PARTS for each in gains):
                sums = np.array([sum(float(part.sum()) for part in both) for both in _parts(gains)])
                if sureness(sums, np.zeros(PARTS)) > TRIED:
                    best, gain = [i, j], total
        if best is None:
            return orders[1:]
        orders.append(order.copy())
        orders[-1][best] = order[best[::-1]]
