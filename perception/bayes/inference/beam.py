"""How a beam answers: by the nearest point of a body, or by a few rays, as many simulators have it.

A real beam answers with the nearest point of a body. A simulator's may be a few rays, evenly from one edge of the
beam to the other; one ray is the axis. Then the range is longer than to the nearest point, by up to the body's
radius, and what stands between two rays is silent. By how many rays a place is heard, 0 for nearest points, is
estimated (`perception.bayes.circles.heard_rays`). Of several rays the one nearest to the body's middle answers first.

A body that a ray misses by an angle counts as that far outside the beam, so that what holds for a beam's edge (a
reading near it may be answered, one well inside must) holds for rays as well.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.inference.cross_path import LENGTH_MIN_M, circle_error, is_crossed
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.settings_record import Settings
from perception.bayes.memory.state import RAYS_MAX, State
from perception.kernel import kernel
from perception.records import Records

GRAZING_MIN: Final = 0.2
"""Least cosine of incidence by which a range is derived: beyond it the range's slope has no bound."""


@kernel
def nearest_ray(q: Reading, dx: float, dy: float, half_angle: float, rays: int) -> tuple[float, float]:
    """Return the unit vector of the ray that is nearest to a direction.

    Parameters
    ----------
    q : Reading
        An echo.
    dx, dy : float
        The direction, of any length.
    half_angle : float
        Half the beam's opening, rad.
    rays : int
        Rays in the beam, ≥ 1.
    """
    if rays == 1:
        return q.axis_x, q.axis_y
    off = math.atan2(q.axis_x * dy - q.axis_y * dx, q.axis_x * dx + q.axis_y * dy)
    step = 2.0 * half_angle / (rays - 1)
    at = math.floor((min(max(off, -half_angle), half_angle) + half_angle) / step + 0.5) * step - half_angle
    c = math.cos(at)
    sn = math.sin(at)
    return c * q.axis_x - sn * q.axis_y, c * q.axis_y + sn * q.axis_x


@kernel
def ray_over_circle(
    q: Reading, dx: float, dy: float, d: float, radius: float, half_angle: float, rays: int
) -> tuple[float, float, float, float]:
    """Return the range of the first ray to meet a circle, its derivatives, and how far ahead the circle counts.

    A circle that lies past the ray by an angle π, of which its own half width takes ω, counts as φ + π − ω off the
    axis, with φ half the beam's opening.

    Parameters
    ----------
    q, half_angle, rays
        As for `nearest_ray`.
    dx, dy, d : float
        The circle's centre from the sensor, and its distance, m.
    radius : float
        m

    Returns
    -------
    (float, float, float, float)
        Range, m; its derivatives by the centre; d times the cosine of the angle off the axis.
    """
    ux, uy = nearest_ray(q, dx, dy, half_angle, rays)
    along = ux * dx + uy * dy
    beside = abs(ux * dy - uy * dx)
    deep = math.sqrt(max(radius * radius - beside * beside, 0.0))
    r = along - deep
    per_deep = 1.0 / max(deep, GRAZING_MIN * radius, LENGTH_MIN_M)
    per_d = 1.0 / max(d, LENGTH_MIN_M)
    limb = math.sqrt(max(d * d - radius * radius, 0.0))
    cos_past = (along * limb + beside * radius) * per_d  # of π − ω, times d
    sin_past = (beside * limb - along * radius) * per_d
    c, sn = math.cos(half_angle), math.sin(half_angle)
    ahead = c * cos_past - sn * sin_past if sn * cos_past + c * sin_past > 0.0 else d
    return r, (dx - r * ux) * per_deep, (dy - r * uy) * per_deep, ahead


@kernel
def answer(
    q: Reading, dx: float, dy: float, d: float, radius: float, half_angle: float, rays: int
) -> tuple[float, float]:
    """Return a reading's error for a circle, m, and how far ahead the circle counts, m; as for `ray_over_circle`."""
    if rays == 0 or is_crossed(q):
        return circle_error(q, dx, dy, d, radius), dx * q.axis_x + dy * q.axis_y
    r, _, _, ahead = ray_over_circle(q, dx, dy, d, radius, half_angle, rays)
    return q.range_m - r, ahead


@kernel
def ray_over_line(q: Reading, nx: float, ny: float, away: float, half_angle: float, rays: int) -> tuple[float, float]:
    """Return the range of the first ray to meet a line, m, and the tangent of the angle of its normal past the ray.

    Parameters
    ----------
    q : Reading
        An echo.
    nx, ny : float
        The line's unit normal, away from the sensors.
    away : float
        The sensor's distance before the line, m.
    half_angle, rays
        As for `nearest_ray`.
    """
    ux, uy = nearest_ray(q, nx, ny, half_angle, rays)
    along = max(ux * nx + uy * ny, GRAZING_MIN)
    return away / along, (ux * ny - uy * nx) / along


@kernel
def assume_rays(s: Records[State], p: Records[Settings], rays: int) -> None:
    """Let what is predicted in the scratch from now on be heard by so many rays; 0: by the nearest point."""
    scratch = s[0].scratch
    half_angle = p[0].half_angle_rad
    scratch.predicted.rays = scratch.own.rays = rays
    scratch.predicted.half_angle = scratch.own.half_angle = half_angle
    scratch.line_fit.rays = rays
    scratch.line_fit.half_angle = half_angle
    for side in range(2):
        face = scratch.corner_fit.faces[side]
        face.rays = rays
        face.half_angle = half_angle


@kernel
def next_rays(rays: int, but: int) -> int:
    """Return the number of rays that is compared after another, leaving out one."""
    following = (rays + 1) % (RAYS_MAX + 1)
    return (following + 1) % (RAYS_MAX + 1) if following == but else following
