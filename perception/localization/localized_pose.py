"""What every localization reports: the robot in the map frame, and how sure that is."""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

from drivers.messages import Pose
from perception.kernel import Floats

Status: TypeAlias = Literal["tracking", "localizing", "lost"]


class LocalizedPose(NamedTuple):
    """The robot in the map frame."""

    pose: Pose
    """Position (m) and direction of travel (rad)."""
    ring_yaw: float
    """Direction of the ring's sensor 0, rad."""
    covariance: Floats
    """Of x, y (m) and heading (rad), shape (3, 3)."""
    status: Status
    probability: float
    """Share of the expected echoes that came lately: near 1 where pose and map are right."""


class KnownWay(NamedTuple):
    """The way as it is known now, by maps of a few metres of it."""

    path: Floats
    """Places of the ring along it, x, y, m; shape (m, 2)."""
    maps: Floats
    """The middle of each map: x, y (m) and their covariance xx, xy, yy (m²), seen from the first; shape (n, 5)."""
    loops: Floats
    """Maps that were matched although others lie between them on the way: x, y of one and of the other, m; (k, 4)."""


class Moment(NamedTuple):
    """A moment of a run, whose pose may become known better later on."""

    submap: int
    """Number of the map of a few metres of way that goes on then."""
    odometry: Floats
    """The ring's pose by odometry, x, y (m) and direction (rad), which is not wrapped; shape (3,)."""
    turned: float
    """Direction of travel less that of the ring, rad."""
