"""What stood on a ring's blind sides when the ring last looked there: it is an obstacle while no sensor looks there.

A mirror answers only where a beam meets it at a right angle. A robot whose ring has gaps can drive towards a wall
whose normal lies in a gap, and never hear it. So the ring remembers walls as it heard them: for each direction in
the odometry's frame, how far away a wall stood that faces from there. As the robot moves, the foot of the
perpendicular on that wall moves along it, and stands for it as an echo would. A ring all round remembers walls, too:
they go on while it hears nothing new (`perception.obstacle_echoes.unheard_echoes`).

An echo may come from any direction in its beam, so it stands for a wall in each. The beams that cover a direction
decide by a likelihood ratio: an echo at the wall's distance is for it, silence and longer ranges are against it.
A look counts for some metres of way; then the direction is unknown, and the robot looks there before it drives on.
"""

from __future__ import annotations

import math
from typing import Annotated, Final

import numpy as np

from drivers.messages import Firing, Pose
from perception.angles import wrapped
from perception.bounds import CONSTANT, Bound, Flag, Place, bounds
from perception.kernel import Floats, entry_kernel, kernel
from perception.records import Record, Records, records, zeros
from perception.sensor_mounts import mounts_at, sensor_pose
from perception.shared_numbers import ROUNDING

TURN_DIRECTIONS: Final = 36
"""Directions of a turn that are distinguished: a wall's normal is known to about the width of a beam."""
WIDTH_RAD: Final = math.tau / TURN_DIRECTIONS
WALL_ECHO_M: Final = 0.15
"""A range this near to that of the wall is its echo: half a direction's width on a way of 1.7 m."""
HIT_NAT: Final = math.log(0.92 / 0.03)
MISS_NAT: Final = math.log(0.08 / 0.97)
"""Log of the likelihood ratio of an echo at the wall's distance, and of a look without it: a sensor hears the wall 92
times in 100, and by chance three times in 100 something at its distance, as the emulator's noise has it."""
MISSED_SHARE: Final = 0.9
"""Beams that cover a direction but for a degree have missed it: by so much a robot that drives straight ahead winds.
At the edge of a gap a drum that was passed else stayed a wall ahead, and a `hobby8` crept for half a minute."""
SURE_NAT: Final = 2.0 * HIT_NAT
"""Two echoes are as sure as it gets, so that a wall that has left is soon forgotten."""
KEPT_M: Final = 2.5
"""A look counts while the robot is within this of where it looked, m; as `behaviors.memory.near_memory`."""
NARROW_M: Final = 1.0
"""A wall in a gap narrower than a beam counts within this of where the ring heard it, m: a `p3at` touched one .6 m
on, and a drum .9 m beside its way would stand in it after 1.2 m."""
AGAIN_SHARE: Final = 0.5
"""Once a direction ahead is unknown, those count as unknown, too, that were looked in farther away than this share of
`KEPT_M`: so the robot looks round in one place."""

SILENT_WAY_M: Final = 0.25
"""A look counts only within this while the ring hears nothing and has lost what it heard, and before a robot that a
remembered wall stops, m."""


class BlindWall(Record):
    """What is remembered of a direction."""

    is_known: Flag
    """Whether the ring has looked there from near by."""
    odds: Annotated[float, Bound(0.0, SURE_NAT)]
    """Log odds of a wall that faces from there, nat; 0: it saw none."""
    offset: Place
    """Distance of its line from the odometry's origin along the direction, m."""
    x: Place
    """Place of the ring at the last look, m."""
    y: Place
    missed_low: Annotated[float, Bound(0.0, WIDTH_RAD)]
    """How much of the direction beams have missed since that look, rad, from its lower edge on."""
    missed_high: Annotated[float, Bound(0.0, WIDTH_RAD)]
    """How much of it they have missed up to its upper edge, rad."""


@kernel
def misses_all_of(one: BlindWall, off: float, half_angle: float) -> bool:
    """Enter that a beam misses the wall of a direction, and return whether beams have now missed it in all of that.

    One beam may hold but a part of a direction, and the next one the rest.

    Parameters
    ----------
    one : record
        What is remembered of the direction. Updated.
    off : float
        Angle from the beam's axis to the direction, rad.
    half_angle : float
        Half the width of a beam, rad.
    """
    low, high = off - 0.5 * WIDTH_RAD, off + 0.5 * WIDTH_RAD
    if low >= -half_angle:
        one.missed_low = max(one.missed_low, min(WIDTH_RAD, half_angle - low))
    if high <= half_angle:
        one.missed_high = max(one.missed_high, min(WIDTH_RAD, high + half_angle))
    return bool(one.missed_low + one.missed_high >= MISSED_SHARE * WIDTH_RAD)


@kernel
def forget_ahead(x: float, y: float, heading: float, walls: Records[BlindWall]) -> None:
    """Forget the directions ahead into which the ring looked from too far away.

    Parameters
    ----------
    x, y, heading, walls
        As of `enter_looks`.
    """
    least = KEPT_M
    for _ in range(2):
        for k in range(len(walls)):
            one = walls[k]
            is_ahead = abs(wrapped(k * WIDTH_RAD - heading)) < 0.5 * math.pi
            if is_ahead and one.is_known == 1 and math.hypot(x - one.x, y - one.y) > least:
                one.is_known, one.odds = 0, 0.0
        for k in range(len(walls)):
            if abs(wrapped(k * WIDTH_RAD - heading)) < 0.5 * math.pi and walls[k].is_known == 0:
                least = AGAIN_SHARE * KEPT_M


@entry_kernel
def enter_looks(
    ranges: Floats,
    mounts: Floats,
    x: float,
    y: float,
    yaw: float,
    heading: float,
    half_angle: float,
    walls: Records[BlindWall],
) -> None:
    """Enter the readings of a firing.

    Parameters
    ----------
    ranges : (n,) float
        As in a `Firing`, m.
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame.
    x, y, yaw, heading : float
        Place (m) and direction (rad) of the ring; the robot's heading, rad.
    half_angle : float
        Half the width of a beam, rad.
    walls : (`TURN_DIRECTIONS`,) records
        What is remembered. Updated.
    """
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if math.isnan(r):
            continue
        own_x, own_y, axis = sensor_pose(mounts, i, (x, y, yaw))
        for k in range(len(walls)):
            off = wrapped(k * WIDTH_RAD - axis)
            if abs(off) > half_angle + 0.5 * WIDTH_RAD:
                continue
            one = walls[k]
            if math.hypot(x - one.x, y - one.y) > KEPT_M:
                one.odds = 0.0
            along = own_x * math.cos(k * WIDTH_RAD) + own_y * math.sin(k * WIDTH_RAD)
            away = one.offset - along
            may_hear = abs(off) <= half_angle
            if may_hear and one.odds > 0.0 and abs(r - away) <= WALL_ECHO_M:
                one.odds = min(SURE_NAT, one.odds + HIT_NAT)
                one.offset += 0.5 * (r - away)
            elif may_hear and math.isfinite(r) and (one.odds <= 0.0 or r < away):  # what is nearer hides the wall
                one.odds = HIT_NAT
                one.offset = along + r
            elif (one.odds <= 0.0 or r > away + WALL_ECHO_M) and misses_all_of(one, off, half_angle):
                one.odds = max(0.0, one.odds + MISS_NAT)
            else:
                continue
            one.is_known, one.x, one.y, one.missed_low, one.missed_high = 1, x, y, 0.0, 0.0
    forget_ahead(x, y, heading, walls)


class BlindWalls:
    """The walls that a ring heard in each direction.

    Parameters
    ----------
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame.
    half_angle : float
        Half the width of a beam, rad.
    turning : tuple of int
        The sensors that turn with the wheels, as `config.robot.RingConfig.turning`.
    """

    SCRATCH: Final = ("records",)
    """A view of `_walls`."""
    BOUNDS: Final = bounds(
        _mounts=CONSTANT,
        _half_angle=CONSTANT,
        has_gaps=CONSTANT,
        is_blind=CONSTANT,
        _radius_m=CONSTANT,
        _walls=BlindWall.BOUNDS,
    )

    def __init__(self, mounts: Floats, half_angle: float, turning: tuple[int, ...] = ()) -> None:
        self._mounts, self._turning, self._half_angle = mounts, turning, half_angle
        self._walls = zeros(BlindWall, TURN_DIRECTIONS)
        self.records = records(BlindWall, self._walls)
        self.has_gaps = widest_gap(mounts) > 2.0 * half_angle + ROUNDING
        """Whether there are directions that no beam holds."""
        self.is_blind = has_blind_sides(mounts, half_angle)
        """Whether the robot must look into them; of narrower ones nothing is unknown or presumed."""
        self._radius_m = max(math.hypot(*mount[:2]) for mount in mounts.tolist())
        self.has_looked_round = False
        """Whether the robot was to look everywhere in this silence."""

    def update(self, firing: Firing) -> None:
        """Enter a firing."""
        mounts, pose = mounts_at(firing, self._mounts, self._turning), firing.pose
        enter_looks(
            firing.ranges_m,
            mounts,
            float(pose.x),
            float(pose.y),
            float(firing.ring_yaw),
            float(pose.theta),
            self._half_angle,
            self.records,
        )

    def sides(self, pose: Pose, axes_rad: Floats) -> tuple[Floats, Floats, Floats]:
        """Return what is known of the directions in which no sensor looks now, and what is not, within 90° of ahead.

        Walls behind count, too: one that no longer counted once it was abeam made a robot beside it turn to and fro.

        Parameters
        ----------
        pose : Pose
            The robot's now.
        axes_rad : (n,) float
            The axis of each sensor now, in the odometry's frame, rad.

        Returns
        -------
        (k, 2) float
            The feet of the perpendiculars on the walls there, m.
        (u,) float
            The directions of which nothing is known, in the odometry's frame, rad.
        (p, 2) float
            Those of the feet that are presumed: the robot has driven on since it heard the wall, m. Of a rough object
            or the end of a wall the ring heard something else.
        """
        directions = WIDTH_RAD * np.arange(TURN_DIRECTIONS)
        off = np.abs(np.remainder(directions[:, None] - axes_rad + math.pi, math.tau) - math.pi)
        nearest = off.min(axis=1)
        c, s = np.cos(directions), np.sin(directions)
        away = self._walls["offset"] - pose.x * c - pose.y * s
        is_known = self._walls["is_known"] == 1
        is_wall = is_known & (self._walls["odds"] > 0.0) & (away > self._radius_m)
        looked_m = np.hypot(self._walls["x"] - pose.x, self._walls["y"] - pose.y)
        stands = is_wall & (nearest > self._half_angle) & (looked_m <= (math.inf if self.is_blind else NARROW_M))
        feet = np.stack([pose.x + away * c, pose.y + away * s], axis=1)
        if not self.is_blind:
            return feet[stands], np.zeros(0), np.zeros((0, 2))
        # What lies partly in a beam is seen as the robot turns a little; beams that touch miss nothing between them.
        is_unseen = (nearest > self._half_angle + 0.5 * WIDTH_RAD + ROUNDING) & ~is_known
        # At the edge of what is unseen it is looked at whole: else the robot would turn to and fro between two edges.
        is_edge = (nearest > self._half_angle - 0.5 * WIDTH_RAD + ROUNDING) & ~is_known
        is_edge &= np.roll(is_unseen, 1) | np.roll(is_unseen, -1)
        is_unknown = (np.cos(directions - pose.theta) > 0.0) & (is_unseen | is_edge)
        is_presumed = stands & (looked_m > SILENT_WAY_M)
        return feet[stands], directions[is_unknown], feet[is_presumed]

    def look_again(self, x: float, y: float, is_lasting: bool) -> None:
        """Have the robot look where it last looked from farther than `SILENT_WAY_M` away; walls stay remembered.

        Parameters
        ----------
        x, y
            Place of the ring, which has lost what it heard and hears nothing else, m: few sensors often do.
        is_lasting
            Whether it has for long: then the robot looks everywhere, once.
        """
        walls, has_looked = self._walls, self.has_looked_round
        if is_lasting and not has_looked:
            walls["is_known"], self.has_looked_round = 0, True
        walls["is_known"] &= np.hypot(walls["x"] - x, walls["y"] - y) <= SILENT_WAY_M

    def offsets(self, x: float, y: float) -> Floats:
        """Return the distance of each direction's wall from the odometry's origin, m; infinite without one.

        Parameters
        ----------
        x, y
            Place of the ring, m.
        """
        offsets, directions = self._walls["offset"], WIDTH_RAD * np.arange(TURN_DIRECTIONS)
        away = offsets - x * np.cos(directions) - y * np.sin(directions)
        return np.where((self._walls["odds"] > 0.0) & (away > self._radius_m), offsets, math.inf)

    def clear(self) -> None:
        """Forget everything."""
        self._walls["is_known"] = 0
        self._walls["odds"] = 0.0


def middle_walls(offsets_m: Floats) -> Floats:
    """Return the offsets of the walls in the middle of each run of neighbours that are one wall; others infinite, m.

    An echo stands for a wall in each direction of its beam: of neighbours at one distance those in the middle count.

    Parameters
    ----------
    offsets_m : (`TURN_DIRECTIONS`,) float
        As of `BlindWalls.offsets`.
    """
    middles, is_wall = np.full(TURN_DIRECTIONS, math.inf), np.isfinite(offsets_m)
    finite = np.where(is_wall, offsets_m, 0.0)
    joins = is_wall & np.roll(is_wall, 1) & (np.abs(finite - np.roll(finite, 1)) <= WALL_ECHO_M)
    if joins.all():
        return offsets_m.copy()
    for first in np.flatnonzero(is_wall & ~joins).tolist():
        last = first
        while joins[(last + 1) % TURN_DIRECTIONS]:
            last += 1
        middle = np.arange(max(first, (first + last) // 2 - 1), min(last, (first + last + 1) // 2 + 1) + 1)
        middle %= TURN_DIRECTIONS
        middles[middle] = offsets_m[middle]
    return middles


def has_blind_sides(mounts: Floats, half_angle: float) -> bool:
    """Return whether a ring has a gap as wide as a beam, so that the robot must look into it; narrower ones close.

    Parameters
    ----------
    mounts, half_angle
        As of `BlindWalls`.
    """
    return widest_gap(mounts) > 4.0 * half_angle


def widest_gap(mounts: Floats) -> float:
    """Return the greatest angle between the axes of neighbouring sensors, rad.

    Parameters
    ----------
    mounts : (n, 3) float
        As of `BlindWalls`.
    """
    axes = np.sort(np.remainder(mounts[:, 2], math.tau))
    return float(np.diff(axes, append=axes[0] + math.tau).max())
