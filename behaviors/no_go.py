"""No-go lines and areas, and speed limits by area: what they leave of a velocity, and how schemas see them.

Schemas see the lines as echoes and as occupied cells, so that they steer round them. The limit here does not depend
on schemas: a velocity is reduced until the body stops before the line on each way of braking, as in the dynamic
window approach (Fox, Burgard & Thrun 1997), also while it turns and drives backwards. A robot that overlaps a line or
an area already may only come out of it. All lengths are m; poses and points are in the frame of the zones unless said
otherwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from config.places import PlacesConfig
from config.robot import BodyConfig
from perception.percept import Floats, OccupancyWindow, Percept, Pose, Twist

MARGIN_M: Final = 0.05
"""Distance kept between rim and line, m, for what a base does otherwise than its limits say. In 60 random drives with
sharp turns (`tests/behaviors/test_no_go.py`) the rim came 8 mm nearer than this."""
HALVINGS: Final = 4
"""The greatest free speed is found to this many halvings of the one that is asked for."""
SAMPLES: Final = np.linspace(0.0, 1.0, 21)
"""When on a way of braking the distance is taken, as shares of the longest time that it takes."""
EQUAL_M: Final = 1e-6
"""Ways that lead less deep than this count as parallel to the line, m."""
SPACING_M: Final = 0.1
"""Distance between two points that stand for a line, m: a body of 0.2 m gets 6 mm nearer between them."""
SIGHT_M: Final = 2.5
"""Lines farther away than this are not shown to schemas as echoes, m: repulsion ends before, as does the search for a
free way of wander."""


@dataclass(frozen=True, slots=True, eq=False)
class Zone:
    """A no-go line or area, or an area with a speed limit."""

    what: str
    """For the operator."""
    ends: Floats
    """(n, 4): its sides x1, y1, x2, y2, m."""
    is_area: bool
    """Whether its inside belongs to it."""
    speed_max_m_s: float
    """0 for a no-go line or area."""
    box: tuple[float, float, float, float]
    """Least and greatest x, least and greatest y, m."""

    def distances_m(self, points: Floats) -> Floats:
        """Return the distance of points (shape (…, 2), m) to it, shape (…): negative inside an area."""
        distances: Floats = side_distances_m(self.ends, points).min(axis=-1)
        if not self.is_area:
            return distances
        x, y = points[..., 0, None], points[..., 1, None]
        x1, y1, x2, y2 = self.ends.T
        dx, dy = x2 - x1, y2 - y1
        crosses = (y1 > y) != (y2 > y)
        at = x1 + (y - y1) * dx / np.where(dy == 0.0, 1.0, dy)
        inside = (crosses & (x < at)).sum(axis=-1) % 2 == 1
        return np.where(inside, -distances, distances)

    def is_near(self, x: float, y: float, reach_m: float) -> bool:
        """Return whether its box is within a distance of a place."""
        left, right, low, high = self.box
        return left - reach_m <= x <= right + reach_m and low - reach_m <= y <= high + reach_m


def side_distances_m(ends: Floats, points: Floats) -> Floats:
    """Return the distance of points (shape (…, 2), m) to each of n sides (shape (n, 4), m), shape (…, n)."""
    x, y = points[..., 0, None], points[..., 1, None]
    x1, y1, x2, y2 = ends.T
    dx, dy = x2 - x1, y2 - y1
    length = np.maximum(dx * dx + dy * dy, 1e-18)
    share = np.clip(((x - x1) * dx + (y - y1) * dy) / length, 0.0, 1.0)
    distances: Floats = np.hypot(x - x1 - share * dx, y - y1 - share * dy)
    return distances


@dataclass(frozen=True, slots=True, eq=False)
class Zones:
    """All zones of a run, prepared for its cycles."""

    places: PlacesConfig
    """What they were made from."""
    no_go: tuple[Zone, ...]
    speed: tuple[Zone, ...]


def zones_of(places: PlacesConfig) -> Zones:
    """Return the zones of a run's places."""
    no_go = tuple(_zone(what, corners, 0.0, is_area=closed) for what, corners, closed in places.no_go_outlines())
    speed = tuple(
        _zone(f"the speed area {area.name or number}", area.vertices_m, area.speed_max_m_s, is_area=True)
        for number, area in enumerate(places.speed_area, 1)
    )
    return Zones(places, no_go, speed)


def _zone(what: str, corners: tuple[tuple[float, float], ...], speed_m_s: float, *, is_area: bool) -> Zone:
    points = np.array(corners, np.float64)
    ends = np.hstack([points, np.roll(points, -1, axis=0)])
    low, high = points.min(axis=0), points.max(axis=0)
    return Zone(what, ends if is_area else ends[:-1], is_area, speed_m_s, (low[0], high[0], low[1], high[1]))


def no_go_at(zones: Zones, x: float, y: float, radius_m: float) -> str | None:
    """Return which no-go line or area a body of this radius overlaps at a place, as text; None if it does not."""
    here = np.array((x, y))
    near = (zone for zone in zones.no_go if zone.is_near(x, y, radius_m))
    return next((zone.what for zone in near if float(zone.distances_m(here)) < radius_m), None)


def speed_limit_m_s(zones: Zones, x: float, y: float, radius_m: float) -> float:
    """Return the least speed limit of the areas that a body of this radius touches at a place, m/s; inf without one.

    The margin of `MARGIN_M` counts as part of the body.
    """
    near = _within(zones.speed, np.array((x, y)), radius_m + MARGIN_M)
    return min((zone.speed_max_m_s for zone in near), default=math.inf)


def limited(
    asked: Twist, last: Twist, moving: Twist, pose: Pose, zones: Zones, body: BodyConfig, delay_s: float
) -> tuple[Twist, str | None]:
    """Return the part of a velocity that keeps out of the zones, and which no-go zone reduced it, as text.

    Parameters
    ----------
    asked
        The velocity that would be driven.
    last
        The command of the cycle before.
    moving
        Velocity of the base now, by its odometry.
    pose
        Of the robot, in the frame of the zones.
    zones
        The run's.
    body
        Radius and limits of the base.
    delay_s
        Longest time until the base follows another command, s.
    """
    asked = _within_speed_areas(asked, max(abs(last.v), abs(moving.v)), pose, zones, body, delay_s)
    fastest = max(abs(asked.v), abs(last.v), abs(moving.v))
    room_m = body.radius_m + MARGIN_M
    reach_m = room_m + fastest * delay_s + 0.5 * fastest * fastest / body.acceleration_max_m_s2
    here = np.array((pose.x, pose.y))
    near = [] if fastest == 0.0 else _within(zones.no_go, here, reach_m)
    if not near:
        return asked, None
    least_m = [min(0.0, float(zone.distances_m(here)) - room_m) - EQUAL_M for zone in near]

    def spare_m(speed_m_s: float, turns: Floats) -> list[float]:
        """Return how much nearer to each zone the body might come, m; negative: too near."""
        places = _braking_places(speed_m_s, (last.v, moving.v), turns, pose, body, delay_s)
        found = (float(zone.distances_m(places).min()) for zone in near)
        return [far - room_m - m for far, m in zip(found, least_m, strict=True)]

    turns = _turns(asked.w, last.w, moving.w, body, delay_s)
    tight = [zone.what for zone, m in zip(near, spare_m(asked.v, turns), strict=True) if m < 0.0]
    if not tight:
        return asked, None
    if min(spare_m(0.0, turns)) >= 0.0:
        free = 0.0
        for k in range(1, HALVINGS + 1):
            tried = free + asked.v / 2.0**k
            free = tried if min(spare_m(tried, turns)) >= 0.0 else free
        return Twist(free, asked.w), tight[0]
    # It brakes in any case: on the way that keeps out, or leads least deep.
    best, best_m = asked.w, -math.inf
    for w in (asked.w, last.w, moving.w, 0.0, body.turn_max_rad_s, -body.turn_max_rad_s):
        room = min(spare_m(0.0, _turns(w, last.w, moving.w, body, delay_s)[:1]))
        if room > best_m:
            best, best_m = w, room
        if room >= 0.0:
            break
    return Twist(0.0, best), tight[0]


def _within(zones: tuple[Zone, ...], here: Floats, reach_m: float) -> list[Zone]:
    """Return the zones within a distance of a place, without the sides of lines that are farther away."""
    x, y = here.tolist()
    near = []
    for zone in zones:
        if zone.is_near(x, y, reach_m):
            is_near = side_distances_m(zone.ends, here) < reach_m
            if zone.is_area and (is_near.any() or float(zone.distances_m(here)) < 0.0):
                near.append(zone)
            elif is_near.any():
                near.append(replace(zone, ends=zone.ends[is_near]))
    return near


def _turns(w: float, last_rad_s: float, moving_rad_s: float, body: BodyConfig, delay_s: float) -> Floats:
    """Return turning rates at the moments of `SAMPLES` while the base brakes, shape (ways, moments), rad/s.

    First as the base is expected to turn, then as one that follows at once, and as one that does not follow.
    """
    end_s = delay_s + body.speed_max_m_s / body.acceleration_max_m_s2
    time_s = end_s * (SAMPLES[1:] + SAMPLES[:-1]) / 2.0
    change = body.turn_acceleration_max_rad_s2 * np.maximum(time_s - delay_s, 0.0)
    expected = last_rad_s + np.clip(w - last_rad_s, -change, change)
    return np.stack([expected, np.full_like(time_s, w), np.full_like(time_s, moving_rad_s)])


def _within_speed_areas(
    asked: Twist, driven_m_s: float, pose: Pose, zones: Zones, body: BodyConfig, delay_s: float
) -> Twist:
    """Return a velocity on the same curve that comes down to an area's limit, by half of the base's deceleration."""
    limit, here = math.inf, np.array((pose.x, pose.y))
    kept_m = body.radius_m + delay_s * max(driven_m_s, abs(asked.v))
    for zone in zones.speed:
        to_m = asked.v * asked.v / body.acceleration_max_m_s2 + kept_m
        if abs(asked.v) > zone.speed_max_m_s and zone.is_near(pose.x, pose.y, to_m):
            rest_m = max(0.0, float(zone.distances_m(here)) - kept_m)
            square = zone.speed_max_m_s * zone.speed_max_m_s + body.acceleration_max_m_s2 * rest_m
            limit = min(limit, math.sqrt(square))
    return asked.at_most(limit)


def _braking_places(
    speed_m_s: float, driven_m_s: tuple[float, float], turns: Floats, pose: Pose, body: BodyConfig, delay_s: float
) -> Floats:
    """Return where the body comes if it drives for the delay, and then brakes: shape (ways, 2), m.

    Parameters
    ----------
    speed_m_s
        The command.
    driven_m_s
        Speeds of the last command and of the base. One that is faster, or backward, is driven on with at first.
    turns
        From `_turns`.
    pose, body, delay_s
        As of `limited`.
    """
    starts = {max(speed_m_s, 0.0, *driven_m_s), min(speed_m_s, 0.0, *driven_m_s)}
    moment_s = (delay_s + body.speed_max_m_s / body.acceleration_max_m_s2) / (len(SAMPLES) - 1)
    braked = body.acceleration_max_m_s2 * np.maximum(moment_s * np.arange(len(SAMPLES)) - delay_s, 0.0)
    turned = pose.theta + np.cumsum(turns, axis=1) * moment_s
    middle = turned - 0.5 * moment_s * turns
    c, s, places = np.cos(middle), np.sin(middle), []
    for start in starts:
        rates = np.maximum(abs(start) - braked, 0.0)
        steps = math.copysign(0.5 * moment_s, start) * (rates[1:] + rates[:-1])
        ways = np.stack([np.cumsum(steps * c, axis=1), np.cumsum(steps * s, axis=1)], axis=-1)
        places.append(ways.reshape(-1, 2))
    reached: Floats = np.concatenate(places) + np.array((pose.x, pose.y))
    return reached


def with_no_go(percept: Percept, zones: Zones, frame: Pose, radius_m: float) -> Percept:
    """Return a percept in which the no-go lines near the robot stand as echoes and as occupied cells.

    Zones that the robot overlaps are left out: their sides would keep it inside.

    Parameters
    ----------
    percept
        In odometry's frame.
    zones
        The run's.
    frame
        Pose of the zones' frame in odometry's.
    radius_m
        Of the body, m.
    """
    here = frame.inverse().compose(percept.pose)
    at, window = np.array((here.x, here.y)), percept.occupancy
    sight_m = SIGHT_M if window is None else max(SIGHT_M, window.cell_m * math.hypot(*window.occupied.shape))
    near = [zone for zone in zones.no_go if zone.is_near(here.x, here.y, sight_m)]
    points = [_points(zone, at, sight_m) for zone in near if float(zone.distances_m(at)) >= radius_m]
    if not points:
        return percept
    c, s = math.cos(frame.theta), math.sin(frame.theta)
    placed = np.concatenate(points) @ np.array([[c, s], [-s, c]]) + (frame.x, frame.y)
    seen = placed[np.hypot(placed[:, 0] - percept.pose.x, placed[:, 1] - percept.pose.y) <= SIGHT_M]
    return replace(
        percept,
        obstacles=np.concatenate([percept.obstacles.reshape(-1, 2), seen]),
        steady=None if percept.steady is None else np.concatenate([percept.steady.reshape(-1, 2), seen]),
        occupancy=None if window is None else _with_points(window, placed),
        no_go=len(seen),
    )


def _points(zone: Zone, at: Floats, reach_m: float) -> Floats:
    """Return points along the sides of a zone where they may be within a distance of a place, shape (n, 2)."""
    points = []
    for x1, y1, x2, y2 in zone.ends.tolist():
        dx, dy = x2 - x1, y2 - y1
        length = max(math.hypot(dx, dy), 1e-9)
        foot = ((at[0] - x1) * dx + (at[1] - y1) * dy) / length
        first, last = max(0.0, foot - reach_m), min(length, foot + reach_m)
        if first <= last:
            along = np.linspace(first, last, 2 + int((last - first) / SPACING_M)) / length
            points.append(np.stack([x1 + along * dx, y1 + along * dy], axis=1))
    return np.concatenate(points) if points else np.zeros((0, 2))


def _with_points(window: OccupancyWindow, points: Floats) -> OccupancyWindow:
    """Return a grid in which the cells of these points are occupied."""
    rows, columns = window.occupied.shape
    column = np.floor((points[:, 0] - window.x_m) / window.cell_m).astype(np.int64)
    row = np.floor((points[:, 1] - window.y_m) / window.cell_m).astype(np.int64)
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    if not inside.any():
        return window
    occupied = window.occupied.copy()
    occupied[row[inside], column[inside]] = 1.0
    return replace(window, occupied=occupied)
