"""What is remembered of maps of a few metres of way: their readings, as they grow in number with the way."""

from __future__ import annotations

import math
from typing import Annotated, Any, Final

import numpy as np
from numpy.typing import NDArray

from drivers.messages import wrap_angle
from perception.bounds import PLACE, Finite, bounds, up_to
from perception.kernel import Floats
from perception.localization.submaps.pose_graph import Link, Node
from perception.records import Record, zeros

SUBMAP_READINGS_MAX: Final = 512
"""Of one map, which ends with them."""


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


class Submaps:
    """The maps' readings."""

    BOUNDS: Final = bounds(archived_rows=Submap.BOUNDS)

    def __init__(self) -> None:
        self.archived_rows: NDArray[Any] = zeros(Submap, 0)


class Nodes:
    """The maps' poses in the map frame."""

    BOUNDS: Final = bounds(archived_rows=Node.BOUNDS)

    def __init__(self) -> None:
        self.archived_rows: NDArray[Any] = zeros(Node, 0)


class Links:
    """Odometry from one map to the next, and matches."""

    BOUNDS: Final = bounds(archived_rows=Link.BOUNDS)

    def __init__(self) -> None:
        self.archived_rows: NDArray[Any] = zeros(Link, 0)


def between(of: Floats, to: Floats) -> Floats:
    """Return a pose `to` in the frame of another one, x, y (m) and direction (rad), which is not wrapped."""
    c, s = math.cos(of[2]), math.sin(of[2])
    dx, dy = to[0] - of[0], to[1] - of[1]
    return np.array([c * dx + s * dy, c * dy - s * dx, to[2] - of[2]])


def compose(of: Floats, by: Floats) -> Floats:
    """Return the pose that lies at `by` in the frame of a pose."""
    c, s = math.cos(of[2]), math.sin(of[2])
    return np.array([of[0] + c * by[0] - s * by[1], of[1] + s * by[0] + c * by[1], of[2] + by[2]])


def scaled(moved: Floats, scales: Floats) -> Floats:
    """Return a motion of a few metres by odometry with its scales of way and turn; its turns are even on its way."""
    half = 0.5 * scales[1] * moved[2]
    c, s, share = math.cos(half), math.sin(half), 1.0 + scales[0]
    x, y, turn = moved
    return np.array([share * (c * x - s * y), share * (s * x + c * y), (1.0 + scales[1]) * turn])


def odometry_link(of: int, moved: Floats, information: Floats) -> NDArray[Any]:
    """Return what odometry says of the next map: how it moved, and the derivatives by its scales."""
    row = zeros(Link, 1)
    x, y, turn = moved
    row["of"], row["to"], row["pose"], row["information"], row["weight"] = of, of + 1, moved, information, 1.0
    row["by_scale"][0, :2] = (x, y, 0.0), (-0.5 * turn * y, 0.5 * turn * x, turn)
    return row


def match_link(of: int, to: int, pose: Floats, information: Floats, *, is_next: bool) -> NDArray[Any]:
    """Return a match of two maps, of which one may have been driven right after the other."""
    row = zeros(Link, 1)
    row["of"], row["to"], row["is_match"], row["weight"] = of, to, 1, 1.0
    row["pose"], row["information"] = (pose[0], pose[1], wrap_angle(pose[2])), information
    if is_next:
        row["by_scale"][0, 2] = pose[0], pose[1], 0.0
    return row


def node_at(pose: Floats) -> NDArray[Any]:
    """Return a map's pose as a record."""
    row = zeros(Node, 1)
    row["x"], row["y"], row["theta"] = pose
    return row


def pose_of(node: NDArray[Any]) -> Floats:
    """Return the pose of a map's record, shape (3,)."""
    return np.array([node["x"], node["y"], node["theta"]])
