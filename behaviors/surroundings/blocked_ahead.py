"""What is closed far ahead: an echo that stays where it is while the robot drives towards it.

From outside, nothing shows a canyon whose walls are mirrors but an echo of its back: its sides answer only beside the
robot that is already in. So what stands far ahead in the way is presumed to be such a back, and its sides to reach up
to the robot: a block, which the robot goes round while that costs little. It is as wide as the back was seen to be,
and grows while the robot drives past it and the back goes on answering straight ahead.

Walls that answer at any angle are heard from outside, but their sides hide the back: the nearest echo of a beam
between them is a side's, and moves along with the robot. There the echoes of neighbouring beams form a pocket: a
chain that recedes from either side towards its deepest place. Its block closes the mouth from one side to the other.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, TypeVar

import numpy as np

from config.bounded import Coordinate
from perception.percept import Floats, Pose, wrap_angle

T = TypeVar("T", float, Floats)

NEAR_M: Final = 1.2
"""What is nearer to the rim is no longer far ahead."""
STAYS_M: Final = 0.15
STAYS_SHARE: Final = 0.03
"""An echo stays where it is if it moves less than this, or than this share of its range, over `STAYS_FOR_M`."""
STAYS_FOR_M: Final = 0.4
"""Driving after which an echo is judged so. One that is not heard for this way is forgotten."""
FIRST_M: Final = 0.02
"""Weight of the first echo in the mean, as way."""
AHEAD_RAD: Final = math.radians(18.0)
"""An echo comes from ahead if its sensor looks no further to the side."""
TURNED_RAD: Final = math.radians(25.0)
"""An echo is ahead no more if the way has turned this far."""
NEIGHBOURS_RAD: Final = math.radians(20.0)
"""Echoes of neighbouring beams are nearer than this."""
RECEDES_M: Final = 1.0
RECEDES_SHARE: Final = 0.65
"""A pocket's deepest place is farther than its mouth by this, and its mouth nearer than this share of that."""
POCKET_MAX_M: Final = 5.0
"""Widest pocket, m: what is wider is a room."""
MOUTH_SHARE: Final = 0.5
"""The block of a pocket begins at this share of the way to its mouth: it may be nearer than its echoes."""
BESIDE_M: Final = 0.5
"""A robot that is farther beside the block sees other pockets."""
POINTS_M: Final = 0.15
POINTS_MAX: Final = 200
"""Distance between the points that stand for a straight line, and most of them."""


@dataclass(frozen=True, slots=True)
class Ahead:
    """An echo ahead on a way, in the frame of that way (m, rad)."""

    x: Coordinate
    y: Coordinate
    axis_rad: Coordinate
    """Where the way began, and its direction."""
    along_m: Coordinate
    """Where the echo lies along the way."""
    stays_m: Coordinate = 0.0
    """Driven while it stayed."""
    missed_m: Coordinate = 0.0
    """Driven since it was heard."""

    @property
    def is_sure(self) -> bool:
        """Whether it has stayed for long enough."""
        return self.stays_m >= STAYS_FOR_M


class Pocket(NamedTuple):
    """A chain of echoes that recedes between two sides, in the robot's place along a way (m)."""

    mouth_m: float
    back_m: float
    """Where the nearer of its sides begins, and how far it is heard, along the way."""
    low_m: float
    high_m: float
    """Its sides, across, counted to the left."""


@dataclass(frozen=True, slots=True)
class Block:
    """A rectangle that is given room, in a frame that looks at it (m, rad)."""

    x: Coordinate
    y: Coordinate
    axis_rad: Coordinate
    front_m: Coordinate
    back_m: Coordinate
    """Its extent along the axis."""
    low_m: Coordinate
    high_m: Coordinate
    """Its extent across, counted to the left."""


def pocket_ahead(echoes: Floats, pose: Pose, way_rad: float, reach_m: float) -> Pocket | None:
    """Return the pocket that a way leads into, None if there is none.

    Parameters
    ----------
    echoes
        Fresh ones, shape (n, 2), m.
    pose, way_rad
        The robot's place, and the direction of its way.
    reach_m
        How far an echo counts.
    """
    dx, dy = echoes[:, 0] - pose.x, echoes[:, 1] - pose.y
    c, s = math.cos(way_rad), math.sin(way_rad)
    along, across = c * dx + s * dy, c * dy - s * dx
    counts = (along > 0.0) & (np.hypot(along, across) < reach_m)
    along, across = along[counts], across[counts]
    bearings = np.arctan2(across, along)
    order = np.argsort(bearings)
    along, across, bearings = along[order], across[order], bearings[order]
    at = int(np.searchsorted(bearings, 0.0))
    if at in (0, len(bearings)):
        return None
    breaks = np.flatnonzero(np.diff(bearings) > NEIGHBOURS_RAD) + 1
    first = int(breaks[breaks <= at].max(initial=0))
    last = int(breaks[breaks > at].min(initial=len(bearings)))
    if not first < at < last:
        return None
    deepest = first + int(along[first:last].argmax())
    right, left = along[first : deepest + 1], along[deepest:last]
    low, high = first + int(right.argmin()), deepest + int(left.argmin())
    mouth_m = float(min(along[low], along[high]))
    found = Pocket(mouth_m, float(along[deepest]), float(across[low]), float(across[high]))
    if max(along[low], along[high]) > min(found.back_m - RECEDES_M, RECEDES_SHARE * found.back_m):
        return None
    return found if found.low_m < 0.0 < found.high_m < found.low_m + POCKET_MAX_M else None


def blocked_ahead(
    echoes: Floats,
    pose: Pose,
    way_rad: float,
    reach_m: float,
    ahead: Ahead | None,
    step_m: float,
    room_m: float,
    pocket: Pocket | None = None,
) -> Ahead | None:
    """Return the echo that stays ahead, None if there is none.

    Parameters
    ----------
    echoes, pose, way_rad, reach_m
        As for `pocket_ahead`.
    ahead
        The one so far.
    step_m
        Driven since.
    room_m
        Half the width of the way.
    pocket
        What the way leads into: its echoes move along, and are one all the same.
    """
    bearings = np.arctan2(echoes[:, 1] - pose.y, echoes[:, 0] - pose.x)
    ranges = np.hypot(echoes[:, 0] - pose.x, echoes[:, 1] - pose.y)
    off_way = np.abs(np.remainder(bearings - way_rad + math.pi, 2.0 * math.pi) - math.pi)
    # Of a wall's echo only the range is known well: it may come from anywhere in the beam.
    is_ahead = (off_way < AHEAD_RAD) | ((off_way < 0.5 * math.pi) & (ranges * np.sin(off_way) < room_m))
    is_ahead &= (ranges > room_m + NEAR_M) & (ranges < reach_m)
    if ahead is not None and abs(wrap_angle(way_rad - ahead.axis_rad)) < TURNED_RAD:
        here, _ = _local(pose.x, pose.y, ahead)
        along = here + ranges
        off = np.where(is_ahead, np.abs(along - ahead.along_m), math.inf)
        range_m = ahead.along_m - here
        if range_m < room_m + NEAR_M:
            return None
        if pocket is not None:
            return replace(ahead, along_m=here + pocket.back_m, stays_m=ahead.stays_m + step_m, missed_m=0.0)
        if len(off) and off.min() < max(STAYS_M, STAYS_SHARE * range_m):
            # A mean over the way: it lags behind an echo that moves along with the robot.
            share = step_m / (ahead.stays_m + step_m + FIRST_M)
            mean_m = ahead.along_m + share * (float(along[off.argmin()]) - ahead.along_m)
            return replace(ahead, along_m=mean_m, stays_m=ahead.stays_m + step_m, missed_m=0.0)
        if ahead.missed_m + step_m < STAYS_FOR_M:
            return replace(ahead, missed_m=ahead.missed_m + step_m)
    return Ahead(pose.x, pose.y, way_rad, float(ranges[is_ahead].min())) if is_ahead.any() else None


def presume(ahead: Ahead, pose: Pose, way_rad: float, front_m: float, pocket: Pocket | None = None) -> Block:
    """Return the block that an echo ahead may belong to; it begins `front_m` before the robot.

    That of a pocket is as wide as its mouth, and begins nearer to it.
    """
    here, _ = _local(pose.x, pose.y, ahead)
    if pocket is not None:
        front = max(front_m, MOUTH_SHARE * pocket.mouth_m)
        return Block(pose.x, pose.y, way_rad, front, max(front, pocket.back_m), pocket.low_m, pocket.high_m)
    return Block(pose.x, pose.y, ahead.axis_rad, front_m, ahead.along_m - here, 0.0, 0.0)


def widen(block: Block, echoes: Floats, pose: Pose, pocket: Pocket | None = None) -> Block:
    """Return the block as wide as the back is by now seen to be: as far as it answers straight ahead of the robot.

    A pocket that is seen along the block's axis from before it belongs to it.
    """
    here, across = _local(pose.x, pose.y, block)
    if pocket is not None and here < block.front_m and block.low_m - BESIDE_M < across < block.high_m + BESIDE_M:
        low, high = min(block.low_m, across + pocket.low_m), max(block.high_m, across + pocket.high_m)
        if high - low < POCKET_MAX_M:
            front = max(block.front_m, here + MOUTH_SHARE * pocket.mouth_m)
            block = replace(block, front_m=front, back_m=max(front, block.back_m), low_m=low, high_m=high)
    bearings = np.arctan2(echoes[:, 1] - pose.y, echoes[:, 0] - pose.x)
    ranges = np.hypot(echoes[:, 0] - pose.x, echoes[:, 1] - pose.y)
    range_m = block.back_m - here
    answers = np.abs(ranges - range_m) < max(STAYS_M, STAYS_SHARE * range_m)
    answers &= np.abs(np.remainder(bearings - block.axis_rad + math.pi, 2.0 * math.pi) - math.pi) < AHEAD_RAD
    if range_m < 0.0 or not answers.any():
        return block
    return replace(block, low_m=min(block.low_m, across), high_m=max(block.high_m, across))


def outline(block: Block) -> Floats:
    """Return points along the outline, shape (n, 2), m."""
    low, high, front, back = block.low_m, block.high_m, block.front_m, block.back_m
    corners = [(front, low), (front, high), (back, high), (back, low), (front, low)]
    local = np.concatenate([between(*a, *b) for a, b in itertools.pairwise(corners)])
    c, s = math.cos(block.axis_rad), math.sin(block.axis_rad)
    u, v = local.T
    return np.column_stack([block.x + c * u - s * v, block.y + s * u + c * v])


def between(x1: float, y1: float, x2: float, y2: float) -> Floats:
    """Return points from one place to another, both included, shape (n, 2), m."""
    count = 2 + min(POINTS_MAX, int(math.hypot(x2 - x1, y2 - y1) / POINTS_M))
    share = np.linspace(0.0, 1.0, count)[:, None]
    points: Floats = np.array([[x1, y1]]) * (1.0 - share) + np.array([[x2, y2]]) * share
    return points


def _local(x: T, y: T, frame: Ahead | Block) -> tuple[T, T]:
    """Return places along the axis of a frame, and left of it, m."""
    c, s = math.cos(frame.axis_rad), math.sin(frame.axis_rad)
    dx, dy = x - frame.x, y - frame.y
    return c * dx + s * dy, c * dy - s * dx
