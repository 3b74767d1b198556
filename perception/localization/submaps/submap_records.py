"""What is remembered of maps of a few metres of way: their readings, as they grow in number with the way."""

from __future__ import annotations

import math
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from drivers.messages import wrap_angle
from perception.bounds import PLACE, Finite, bounds, up_to
from perception.kernel import Floats
from perception.localization.submaps.pose_graph import OF_ODOMETRY, OF_OTHER, Link, Node, spread_from
from perception.records import Record, Structured, records, zeros
from perception.shared_numbers import READING_M, READING_RAD

LOST_WAY: Final = (0.02, 0.01)
"""Share of its way that a match with the map before, and one with another, usually loses. Four real drives, two
buildings and 14 generated rooms with exact poses: -0.03 to 0.07, mean 0.02; and -0.02 to 0.02, mean 0.01."""
SUBMAP_M: Final = 3.0
"""A map ends after this way."""
SUBMAP_RAD: Final = 2.0
"""A map ends after these turns: scales of 3 % deform it by one cell."""
SUBMAP_READINGS_MAX: Final = 512
"""Of one map, which ends with them."""
PATH_PLACES: Final = 10
"""Places of the ring that are kept of one map: they show its way to 0.3 m."""


class Submap(Record):
    """The readings of a few metres of way, in the frame of the ring's pose in its middle."""

    pose: Annotated[Floats, 3, PLACE]
    """That pose by odometry, x, y (m) and direction (rad), which is not wrapped."""
    way: Finite
    turn: Finite
    """Way (m) and turns (rad) until there."""
    count: Annotated[int, up_to(SUBMAP_READINGS_MAX)]
    readings: Annotated[Floats, SUBMAP_READINGS_MAX, 4, PLACE._replace(infinite=True)]
    """Sensor's place x, y (m), direction (rad), and range, m; infinite if silent."""
    path: Annotated[Floats, PATH_PLACES, 3, PLACE]
    """The ring's poses from its begin to its end by odometry, x, y (m) and direction (rad), which is not wrapped."""


class Rows:
    """Records whose number grows with the way.

    Parameters
    ----------
    record : type of Record
        Their kind.
    """

    SCRATCH: Final = ("_store",)
    BOUNDS: Final = bounds(archived_rows=lambda self: self._record.BOUNDS)

    def __init__(self, record: type[Record]) -> None:
        self._record = record
        self.archived_rows: Structured = zeros(record, 0)
        self._store = self.archived_rows
        """What `archived_rows` is the begin of, unless it was replaced since, with room for more."""

    def append(self, row: Structured) -> None:
        """Add one."""
        count, store = len(self.archived_rows), self._store
        if self.archived_rows.base is not store or count == len(store):
            store = zeros(self._record, count + count // 4 + 16)
            store[:count] = self.archived_rows
        store[count : count + 1] = row
        self._store, self.archived_rows = store, store[: count + 1]


def fresh_sensors(ranges: Floats, here: Floats, latest: Floats) -> NDArray[np.bool_]:
    """Return which sensors have a reading from a pose apart from that of their last one.

    Parameters
    ----------
    ranges : (n,) float
        Of a firing, m; NaN where a sensor did not fire.
    here : (3,) float
        The ring's pose, x, y (m) and direction (rad), not wrapped.
    latest : (n, 3) float
        The ring's pose at each sensor's last reading; infinite before the first.
    """
    apart = here - latest
    turned = np.abs(apart[:, 2]) >= READING_RAD
    return ~np.isnan(ranges) & (turned | (np.hypot(apart[:, 0], apart[:, 1]) >= READING_M))


def between(of: Floats, to: Floats) -> Floats:
    """Return poses in the frame of one, x, y (m) and direction (rad), which is not wrapped; shape (…, 3)."""
    c, s = math.cos(of[2]), math.sin(of[2])
    dx, dy = to[..., 0] - of[0], to[..., 1] - of[1]
    return np.stack([c * dx + s * dy, c * dy - s * dx, to[..., 2] - of[2]], axis=-1)


def compose(of: Floats, by: Floats) -> Floats:
    """Return the poses (…, 3) that lie at `by` in the frame of a pose."""
    c, s = math.cos(of[2]), math.sin(of[2])
    x, y, turn = np.moveaxis(by, -1, 0)
    return np.stack([of[0] + c * x - s * y, of[1] + s * x + c * y, of[2] + turn], axis=-1)


def scaled(moved: Floats, scales: Floats) -> Floats:
    """Return motions (…, 3) of a few metres by odometry with its scales; their turns are even on their way."""
    x, y, turn = np.moveaxis(moved, -1, 0)
    half, share = 0.5 * scales[1] * turn, 1.0 + scales[0]
    c, s = np.cos(half), np.sin(half)
    return np.stack([share * (c * x - s * y), share * (s * x + c * y), (1.0 + scales[1]) * turn], axis=-1)


def odometry_link(of: int, moved: Floats, information: Floats) -> Structured:
    """Return what odometry says of the next map: how it moved, and the derivatives by its scales."""
    row = zeros(Link, 1)
    x, y, turn = moved
    row["of"], row["to"], row["pose"], row["information"], row["weight"] = of, of + 1, moved, information, 1.0
    row["by_scale"][0, :2] = (x, y, 0.0), (-0.5 * turn * y, 0.5 * turn * x, turn)
    return row


def unlost(pose: Floats, *, is_next: bool) -> tuple[Floats, Floats]:
    """Return the pose of a match that has not lost way, and its derivative by the way lost, shapes (3,)."""
    way = pose[:2] * (1.0 + LOST_WAY[not is_next])
    return np.array([*way, pose[2]]), np.array([*way, 0.0])


def match_link(of: int, to: int, pose: Floats, by_lost: Floats, information: Floats, *, is_next: bool) -> Structured:
    """Return a match of two maps, of which one may have been driven right after the other; as of `unlost`."""
    row = zeros(Link, 1)
    row["of"], row["to"], row["is_match"], row["weight"] = of, to, 1, 1.0
    row["pose"], row["information"] = (*pose[:2], wrap_angle(pose[2])), information
    row["by_scale"][0, OF_ODOMETRY if is_next else OF_OTHER] = by_lost
    return row


def node_at(pose: Floats) -> Structured:
    """Return a map's pose as a record."""
    row = zeros(Node, 1)
    row["x"], row["y"], row["theta"] = pose
    return row


def pose_of(node: Structured) -> Floats:
    """Return the pose of a map's record, shape (3,)."""
    return np.array([node["x"], node["y"], node["theta"]])


def spread_about(number: int, links: Structured, nodes: Structured) -> Floats:
    """Return how uncertain each map lies to one: variances of place (m²) and direction (rad²), shape (n, 2)."""
    spread = np.full((len(nodes), 2), math.inf)
    spread[number] = 0.0
    spread_from(records(Link, links), len(links), records(Node, nodes), spread)
    return spread


def spread_beyond(spread: Floats, link: Structured, here: Floats, there: Floats) -> Floats:
    """Return `spread_about`'s variances at the end of a link that leads to nothing else, from those at its begin."""
    only, both = link.copy(), np.concatenate([node_at(here), node_at(there)])
    only["of"], only["to"] = 0, 1
    spreads = np.array([spread, [math.inf, math.inf]])
    spread_from(records(Link, only), 1, records(Node, both), spreads)
    return np.asarray(spreads[1])
