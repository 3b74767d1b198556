"""The speed that the field of view allows: nothing moves towards a direction in which the ring has not looked lately.

The path of the body, from where it leaves the clearance on, needs every direction within asin(R / (R + clearance)) of
the heading; what is nearer lies inside the clearance. A direction is seen while a sensor whose beam covers it has
given a usable range, or a believed silence, no longer ago than the age limit. The speed falls so that the robot
stands before the first of these directions is too old, and before its path turns to one that is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.robot import PASSAGE_M, BodyConfig
from perception.percept import FieldOfView, Floats, Percept, wrap_angle

ROUNDING_RAD: Final = 1e-6
"""A gap between two beams that is no wider than this comes from rounding."""
REACTION_S: Final = 0.1
"""Time from odometry until the wheels follow the velocity that was decided on it, s: two cycles."""
SENSORS_NAMED_MAX: Final = 8
"""Most sensors that a reason names."""


@dataclass(frozen=True, slots=True)
class UnseenWay:
    """A direction in which the robot must not move, for want of sensors that look there."""

    reason: str
    """Which sensors have not looked there, for the operator."""
    age_s: float
    """How long they have not, s; infinite if they never have."""
    sensors: tuple[int, ...]
    """The sensors that should look there and have not lately."""


def path_half_angle_rad(body: BodyConfig, clearance_m: float) -> float:
    """Return the angle from the heading within which the body's path leaves the clearance, rad."""
    return math.asin(body.radius_m / (body.radius_m + clearance_m))


def seen_speed_m_s(percept: Percept, body: BodyConfig, clearance_m: float, turn_rad_s: float = 0.0) -> float:
    """Return the highest speed from which the robot stands before it would move towards an unseen direction, m/s.

    With a the deceleration: a·t for the time t until the first direction is both in the path, to which a turn may
    bring it, and beyond the age limit; and √(2·a·d) for the distance d that the ring reaches beyond the clearance.

    Parameters
    ----------
    percept
        Pose and field of view of this cycle.
    body
        Radius and largest deceleration of the base.
    clearance_m
        Distance to keep between rim and echo, m.
    turn_rad_s
        The turning rate, rad/s. Both sides count, as the wheels may still turn the other way.
    """
    view, heading, half_angle = percept.field_of_view, percept.pose.theta, path_half_angle_rad(body, clearance_m)
    free_m = view.reach_m - body.radius_m - clearance_m
    left_s = seen_for_s(view, heading, half_angle, turn_rad_s, body.speed_max_m_s / body.acceleration_max_m_s2)
    if not (free_m > 0.0 and left_s > 0.0):
        return 0.0
    return min(body.acceleration_max_m_s2 * left_s, math.sqrt(2.0 * body.acceleration_max_m_s2 * free_m))


def oldest_look_s(view: FieldOfView, direction_rad: float, half_angle_rad: float) -> float:
    """Return the age of the direction that was looked in longest ago, s; infinite where no look is fresh.

    Parameters
    ----------
    view
        Where the ring has looked.
    direction_rad, half_angle_rad
        The directions from one to the other side of this one, in the odometry's frame.
    """
    sectors = _sectors(view.bearings_rad, view.ages_s, view.half_angle_rad, direction_rad, half_angle_rad)
    return max(age_s for _, _, age_s in sectors)


def seen_for_s(
    view: FieldOfView, heading_rad: float, half_angle_rad: float, turn_rad_s: float, horizon_s: float
) -> float:
    """Return the time until the first direction is both in the path and too old, s; not positive if one is now.

    Parameters
    ----------
    view
        Where the ring has looked.
    heading_rad, half_angle_rad
        The path's directions now, from one to the other side of this one, in the odometry's frame.
    turn_rad_s
        The rate at which the path turns, to either side.
    horizon_s
        Time beyond which directions that a turn brings into the path do not matter.
    """
    beam, rate, age_max_s = view.half_angle_rad, abs(turn_rad_s), view.age_max_s
    swept = min(rate * (horizon_s + REACTION_S), max(0.0, math.pi - half_angle_rad - beam))
    soonest_s = math.inf
    for begin, end, age_s in _sectors(view.bearings_rad, view.ages_s, beam, heading_rad, half_angle_rad + swept):
        left_s = age_max_s - age_s
        if left_s >= soonest_s:
            continue
        outside = begin - half_angle_rad if begin > -end else -half_angle_rad - end
        reached_s = -math.inf if outside < -ROUNDING_RAD else outside / max(rate, ROUNDING_RAD) - REACTION_S
        soonest_s = min(soonest_s, max(reached_s, left_s))
    return soonest_s


def unseen_way(percept: Percept, direction_rad: float, body: BodyConfig, clearance_m: float) -> UnseenWay | None:
    """Return which sensors lack for a motion in a direction, None if all have looked lately.

    The sensors count that look there now. After a turn a direction may be unseen although none lacks: then the next
    firings look there.

    Parameters
    ----------
    percept
        Pose and field of view of this cycle.
    direction_rad
        The direction, in the odometry's frame.
    body, clearance_m
        As for `seen_speed_m_s`.
    """
    view, half_angle = percept.field_of_view, path_half_angle_rad(body, clearance_m)
    sectors = _sectors(view.axes_rad, view.sensor_ages_s, view.half_angle_rad, direction_rad, half_angle)
    age_s = max(age_s for _, _, age_s in sectors)
    if age_s < view.age_max_s:
        return None
    turn_deg = math.degrees(wrap_angle(direction_rad - percept.pose.theta))
    side = "left" if turn_deg > 0.0 else "right"
    where = "ahead" if abs(turn_deg) < 1.0 else f"{abs(turn_deg):.0f}° to the {side} of the heading"
    lasting = f"for {age_s:.1f} s" if math.isfinite(age_s) else "yet"
    looks_there = np.abs(turn(direction_rad, view.axes_rad)) < half_angle + view.half_angle_rad
    missing = np.flatnonzero(looks_there & ~(view.sensor_ages_s < view.age_max_s)).tolist()
    if missing:
        cause = f"no usable range from sensor {listed(missing)}"
    elif looks_there.any():
        cause = (
            f"the beams of sensor {listed(np.flatnonzero(looks_there).tolist())} leave parts of the body's way out"
        )
    else:
        cause = "no sensor of the ring looks there"
    return UnseenWay(f"the ring has not looked {where} {lasting}: {cause}", age_s, tuple(missing))


def angle_to_look(percept: Percept, course_rad: float, presumed_rad: Floats | None = None) -> float | None:
    """Return the angle to the nearest direction in which the robot must look before it drives, None if there is none.

    On a course the robot comes nearer to walls that face it from anywhere within 90°, and a mirror answers only beams
    that meet it at a right angle.

    Parameters
    ----------
    percept
        Pose and field of view of this cycle.
    course_rad
        The direction of the way, in the odometry's frame.
    presumed_rad
        As of `presumed_ahead_rad`: the robot looks there as well.
    """
    unknown = percept.field_of_view.unknown_rad
    if presumed_rad is not None and len(presumed_rad):
        unknown = np.concatenate([unknown, presumed_rad])
    if not len(unknown):
        return None
    angles: list[float] = turn(percept.pose.theta, unknown)[
        np.abs(turn(course_rad, unknown)) < 0.5 * math.pi
    ].tolist()
    return min(angles, key=abs, default=None)


def presumed_ahead_rad(percept: Percept, body: BodyConfig, clearance_m: float) -> Floats:
    """Return the directions of presumed walls that stop the robot where it stands, in the odometry's frame, rad.

    A wall that was heard from elsewhere and need not go on is looked at before it keeps a robot standing.

    Parameters
    ----------
    percept
        Pose and field of view of this cycle.
    body, clearance_m
        As for `behaviors.surroundings.clearance.stoppable_speed_m_s`.
    """
    feet, pose = percept.field_of_view.presumed, percept.pose
    if not len(feet):
        return np.zeros(0)
    dx, dy = feet[:, 0] - pose.x, feet[:, 1] - pose.y
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    stops = (np.hypot(dx, dy) < body.radius_m + clearance_m) & (c * dx + s * dy > 0.0)
    stops &= np.abs(c * dy - s * dx) < body.radius_m + PASSAGE_M
    directions: Floats = np.arctan2(dy[stops], dx[stops])
    return directions


def listed(sensors: Sequence[int]) -> str:
    """Return the numbers of sensors as text; of many, the first ones."""
    return ", ".join(map(str, sensors[:SENSORS_NAMED_MAX])) + (" …" if len(sensors) > SENSORS_NAMED_MAX else "")


def turn(begin_rad: float, ends_rad: Floats) -> Floats:
    """Return the angles from one direction to others, within [−π, π), shape (n,)."""
    turned: Floats = np.remainder(ends_rad - begin_rad + math.pi, 2.0 * math.pi) - math.pi
    return turned


def _sectors(
    bearings_rad: Floats, ages_s: Floats, beam_rad: float, direction_rad: float, half_angle_rad: float
) -> list[tuple[float, float, float]]:
    """Return sectors that together are all directions within `half_angle_rad` of one: begin, end, age of the look.

    Begin and end count from `direction_rad`. The youngest beam is laid out first, and each older one where no younger
    one lies; where none lies, the age is infinite. Plain Python: a standing ring has a handful of beams ahead, for
    which numpy's calls cost several times as much.

    Parameters
    ----------
    bearings_rad, ages_s
        Axes and ages of the beams, shape (n,).
    beam_rad
        Half their width.
    direction_rad, half_angle_rad
        As for `oldest_look_s`.
    """
    reach = half_angle_rad + beam_rad
    beams = [
        (age_s, axis)
        for age_s, bearing in zip(ages_s.tolist(), bearings_rad.tolist(), strict=True)
        if -reach < (axis := (bearing - direction_rad + math.pi) % math.tau - math.pi) < reach
    ]
    beams.sort()
    sectors: list[tuple[float, float, float]] = []
    open_sectors = [(-half_angle_rad, half_angle_rad)]
    for age_s, axis in beams:
        left, right = axis - beam_rad, axis + beam_rad
        remaining = []
        for begin, end in open_sectors:
            low = begin if begin > left else left
            high = end if end < right else right
            if high - low <= ROUNDING_RAD:
                remaining.append((begin, end))
                continue
            sectors.append((low, high, age_s))
            if low - begin > ROUNDING_RAD:
                remaining.append((begin, low))
            if end - high > ROUNDING_RAD:
                remaining.append((high, end))
        open_sectors = remaining
        if not open_sectors:
            return sectors
    sectors += [(begin, end, math.inf) for begin, end in open_sectors]
    return sectors
