"""The kernel that weighs how a ring is mounted: as the robot file says, or turned by a quarter, two or three.

The range of an echo changes with the motion of its sensor. It is compared with what each mounting lets expect, and
the logarithms of the likelihood ratios are summed in two ways:

- *Turned*: evidence that the ring is turned, in which nothing counts that a wall along the path may explain. It slows
  the robot down, and then stops it.
- *Excluded*: evidence since the start against each of the turned mountings. A wall along the path explains a range
  that stays, if the ring is mounted so that one may be there. A turned mounting that is not yet excluded limits the
  speed beside what would then be ahead (`runtime.cycle.mounting_limit`).
"""

from __future__ import annotations

import math
from typing import Final

from perception.angles import wrapped
from perception.kernel import Floats, kernel
from perception.records import Records
from perception.ring_faults.memory import (
    EVIDENCE_NAT,
    MOVES,
    QUARTERS,
    EchoTrace,
    Look,
    Reception,
    RingTrace,
    mark,
)
from perception.ring_faults.repeats import STEP_MIN_M, is_parallel_wall
from perception.sensor_faults.wall import fits_unseen_wall

EXCLUDED_NAT: Final = math.log(20.0)
"""Evidence that excludes a mounting, nat. Looks are alike, so it is no bound on errors: in 1 of 360 drives of turned
rings (`p3dx`, `magellan`; halls, rooms, corridors, circles) the true mounting was excluded. Evidence the other way
counts no more than this, so that an honest ring soon makes up for a corridor that misleads."""
DOUBTED_NAT: Final = 2.0
"""Evidence for a turned mounting that is not excluded, nat, with which the robot drives slowly until more decides.
Honest rings that wind by ±9° to ±20° through corridors gather up to 1.2; a `magellan` along and into corridors up to
2.3, for a moment, in 5 of 363 drives. Of 120 drives of turned rings 3 touch something above .05 m/s, with 2.5 nat 5,
with 3 nat 7."""
ECHO_KEPT_M: Final = 0.5
"""Way of the ring for which an echo is kept as what may be ahead, m. With .2 an `amigo` that is turned by
a half touches something at .2 m/s."""
FOLLOWS: Final = 0.7
"""Share of an honest ring's changes that follow the motion; the others come from surfaces that change places."""
ALIKE: Final = 2.5
"""Changes in succession of one surface's range that count as one: oblique rough walls deceive all of them alike.
Beams that overlap are counted apart."""
LEAN_RAD: Final = 0.35
"""A wall that leans to the path by up to this changes the ranges of sensors that graze it as nothing else does, rad:
robots wind. With .25 honest rings that wind by up to ±20° show 3 nat or more in 28 of 100 looks, with .35 in none."""
TURNED_SHARE: Final = 0.5
"""Echoes are compared while the sensor has turned by no more than this share of half its beam. With .2 a `hobby8`
that is turned by a half touches something at .3 m/s in a corridor."""
STRAIGHT_SHARE: Final = 0.2
"""The same for evidence that the ring is turned: in a beam that turns, a wall that it grazes changes its range by the
cotangent of the angle. With .5 honest rings that wind by up to ±20° show 3 nat or more in 5 of 100 looks."""


@kernel
def surfaces_heard(sensors: int, half_angle: float) -> float:
    """Return by what the evidence of one change is divided: sensors whose beams overlap hear the same surface."""
    return ALIKE * max(1.0, sensors * half_angle / math.pi)


@kernel
def anything_density(moved: float, error: float) -> float:
    """Return the density of a change of range that follows nothing, 1/m."""
    return 1.0 / (2.0 * (MOVES * moved + error))


@kernel
def change_density(angle: float, change: float, moved: float, error: float, half_angle: float) -> float:
    """Return the density of a change of range, 1/m, of an echo within the beam of a sensor.

    Parameters
    ----------
    angle : float
        From the motion to the sensor's axis, rad.
    change : float
        By how much the range has grown, m.
    moved, error : float
        By how much the sensor has moved, and the error of the change, m.
    half_angle : float
        Half the beam's width, rad.
    """
    angle = abs(wrapped(angle))
    most = -moved * math.cos(max(0.0, angle - half_angle)) - error
    least = -moved * math.cos(min(math.pi, angle + half_angle)) + error
    follows = FOLLOWS / (least - most) if most <= change <= least else 0.0
    return (1.0 - FOLLOWS) * anything_density(moved, error) + follows


@kernel
def may_graze_wall(
    i: int,
    r: float,
    axes: tuple[float, float],
    moved: tuple[float, float, float],
    slack: tuple[float, float],
    mounts: Floats,
    reception: Reception,
    echoes: Records[EchoTrace],
    path_m: float,
) -> bool:
    """Return whether a wall along the path may explain a change of range, one that is seen or one that is not.

    Parameters
    ----------
    i, r, mounts, reception, echoes, path_m
        As for `repeats.is_parallel_wall`.
    axes : (float, float)
        Directions of the sensor and of the ring, rad.
    moved : (float, float, float)
        By how much the sensor has moved, x and y, and the range has changed, m.
    slack : (float, float)
        As for `sensor_faults.wall.fits_unseen_wall`.
    """
    (axis, yaw), (dx, dy, change) = axes, moved
    path = math.atan2(dy, dx)
    return fits_unseen_wall(
        wrapped(axis - path), change, math.hypot(dx, dy), wrapped(yaw - path), mounts, reception[0], slack
    ) or is_parallel_wall(i, r, (dx, dy), yaw, mounts, reception, slack[1], echoes, path_m)


@kernel
def weigh_change(
    i: int,
    look: Look,
    yaw: float,
    mounts: Floats,
    reception: Reception,
    echoes: Records[EchoTrace],
    all_of: RingTrace,
) -> None:
    """Test whether the change of an echo's range follows the motion, or that of a ring that is turned.

    A surface whose normal lies in the beam comes nearer by d·cos ψ, for an angle ψ from the motion to a direction in
    the beam. A rough one that the beam grazes may change otherwise, hence `FOLLOWS`; a rough wall along the path
    says nothing, nor what may be one where no sensor sees it. Sensors whose beams overlap hear the same surface, and
    together count as one. How a ring is mounted does not change on the way, so evidence for the robot file counts,
    too: both sums may fall below zero.

    Parameters
    ----------
    i : int
        The sensor.
    look, reception, all_of
        As for `motion_tests.weigh_look`; the look has an echo.
    yaw, mounts, echoes
        As for `motion_tests.check_motion`.
    """
    c = echoes[i]
    r, x, y, axis = look
    half_angle, tolerance, _ = reception
    turned = abs(axis - c.anchor.axis)
    if not c.is_anchored or turned > TURNED_SHARE * half_angle:
        c.is_anchored = 1
        mark(c.anchor, r, x, y, axis, all_of.path_m)
        return
    if r == c.anchor.range_m and c.standstill == all_of.standstill:  # frozen looks as if it were turned
        return
    dx, dy = x - c.anchor.x, y - c.anchor.y
    moved = math.hypot(dx, dy)
    if moved < 2.0 * max(STEP_MIN_M, 3.0 * tolerance):
        return
    change, path = r - c.anchor.range_m, math.atan2(dy, dx)
    error = tolerance + 0.03 * r + r * turned
    lean = LEAN_RAD + turned  # a sensor off the centre moves sideways while the ring turns
    norm = surfaces_heard(len(echoes), half_angle)
    anything = anything_density(moved, error)
    filed, is_wall = 0.0, False
    for quarter in range(QUARTERS + 1):
        if quarter > 0 and is_wall and all_of.excluded_nat[quarter - 1] >= EXCLUDED_NAT:
            continue
        own, ring = axis + 0.5 * math.pi * quarter, yaw + 0.5 * math.pi * quarter
        density = change_density(own - path, change, moved, error, half_angle)
        may_stay = density
        if quarter == 0 or all_of.excluded_nat[quarter - 1] < EXCLUDED_NAT:
            motion = (dx, dy, change)
            if may_graze_wall(i, r, (own, ring), motion, (error, lean), mounts, reception, echoes, all_of.path_m):
                may_stay = max(density, anything)
                is_wall = is_wall or quarter == 0
        if quarter == 0:
            filed, filed_stays = density, may_stay
            continue
        k = quarter - 1
        if not is_wall and turned <= STRAIGHT_SHARE * half_angle:
            evidence = math.log(density / filed) / norm
            all_of.turned_nat[k] = max(-EVIDENCE_NAT, all_of.turned_nat[k] + evidence)
        if all_of.excluded_nat[k] < EXCLUDED_NAT:
            evidence = math.log(filed_stays / may_stay) / norm
            all_of.excluded_nat[k] = max(-EXCLUDED_NAT, all_of.excluded_nat[k] + evidence)
    mark(c.anchor, r, x, y, axis, all_of.path_m)


@kernel
def possible_places(
    mounts: Floats, pivot: Floats, echoes: Records[EchoTrace], ring: Records[RingTrace], places: Floats
) -> int:
    """Enter the places of the last echoes as each turned mounting has them that is not excluded; return how many.

    A silence does not remove an echo: a ring that is turned comes nearer to what it seems to leave behind.

    Parameters
    ----------
    mounts, echoes
        As for `motion_tests.check_motion`.
    pivot : (2,) float
        About which what is turned would be: the ring's centre or the servo's axis, x, y in the ring's frame, m.
    ring : (1,) record
        What is remembered of the ring.
    places : (n · QUARTERS, 2) float
        The first ones are the places x, y, m. Overwritten.
    """
    all_of, count = ring[0], 0
    for quarter in range(1, QUARTERS + 1):
        if all_of.excluded_nat[quarter - 1] >= EXCLUDED_NAT:
            continue
        c, s = math.cos(0.5 * math.pi * quarter), math.sin(0.5 * math.pi * quarter)
        for i in range(len(echoes)):
            heard = echoes[i].heard
            if heard.range_m < 0.0 or not echoes[i].is_known or all_of.path_m - heard.path_m > ECHO_KEPT_M:
                continue
            yaw = heard.axis - mounts[i, 2]
            off_x, off_y = mounts[i, 0] - pivot[0], mounts[i, 1] - pivot[1]
            dx = math.cos(yaw) * off_x - math.sin(yaw) * off_y
            dy = math.sin(yaw) * off_x + math.cos(yaw) * off_y
            x, y = heard.x - dx, heard.y - dy  # the pivot
            dx += heard.range_m * math.cos(heard.axis)
            dy += heard.range_m * math.sin(heard.axis)
            places[count, 0], places[count, 1] = x + c * dx - s * dy, y + s * dx + c * dy
            count += 1
    return count
