"""How a beam answers: by the nearest point of a body, or by a few rays, as many simulators have it.

A real beam answers with the nearest point of a body. A simulator's may be a few rays, evenly from one edge of the
beam to the other; one ray is the axis. Then the range is longer than to the nearest point, by up to the body's
radius, and what stands between two rays is silent. By how many rays a place is heard, 0 for nearest points, is
estimated (`perception.bayes.circles.heard_rays`). Of several rays the one nearest to the body's middle answers first.

A body that a ray misses by an angle counts as that far outside the beam, so that what holds for a beam's edge (a
reading near it may be answered, one well inside must) holds for rays as well.

Where everything answers, a body past a beam is heard from where the beam's edge meets it. That is a second way for
all readings of a body, and counts where circles are compared with each other (`either_way`).
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.inference.cross_path import LENGTH_MIN_M, circle_error, is_crossed
from perception.bayes.inference.likelihood import level_of, log_likelihood
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.scratch import Predictions
from perception.bayes.memory.settings_record import Settings
from perception.bayes.memory.state import ESTABLISHED, RAYS_MAX, CircleTrack, State
from perception.kernel import kernel
from perception.records import Records

GRAZING_MIN: Final = 0.2
"""Least cosine of incidence by which a range is derived: beyond it the range's slope has no bound."""

EDGE_PRIOR_NAT: Final = -4.6
"""Log prior odds (a hundredth) that bodies past a beam answer from its edge as well. With a tenth, drums that are
heard as mirrors are named .1 to .2 ft later."""
EDGE_LEAD_MAX_NAT: Final = 10.0
"""Most that one circle says for or against it, so that no wrong one decides for all."""
EDGES: Final = 2
"""Rays that are the beam's two edges."""


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
def log_one_plus_exp(v: float) -> float:
    """Return log(1 + exp(v)) of any v."""
    return max(v, 0.0) + math.log1p(math.exp(-abs(v)))


@kernel
def either_way(lead: float, prior_nat: float) -> float:
    """Return the log ratio (nat) of both ways of answering to nearest points, by the edges' lead and log odds."""
    return log_one_plus_exp(lead + prior_nat) - log_one_plus_exp(prior_nat)


@kernel
def evidence_of_reading(q: Reading, e: float, d: float, ahead: float, p: Records[Settings], noise: int) -> float:
    """Return what a reading says of a circle, nat; see `range_fit.score_circle`.

    Parameters
    ----------
    q, p, noise
        As for `range_fit.score_circle`.
    e, d, ahead : float
        The reading's error, the centre's distance, and how far ahead it counts, m.
    """
    if abs(e) < p[0].gate_m:
        if ahead < p[0].cos_may_answer * d:
            return 0.0
        v = log_likelihood(p, level_of(p, noise, q.range_m), e)
        return max(v, 0.0) if ahead < p[0].cos_half_angle * d else v
    if ahead < p[0].cos_must_answer * d:
        return 0.0
    return float(p[0].missed_echo_nat if e > 0.0 else p[0].short_echo_nat)


@kernel
def edge_lead_of_circle(
    readings: Records[Reading], cx: float, cy: float, radius: float, p: Records[Settings], noise: int,
    predicted: Predictions,
) -> float:  # fmt: skip
    """Return how much likelier (nat) readings are if a circle past a beam answers from where its edge meets it.

    Parameters
    ----------
    readings, cx, cy, radius, p, noise
        As for `range_fit.score_circle`.
    predicted : Predictions
        What the circle predicts. Heard by rays it has no lead: the edges are rays then.
    """
    lead = 0.0
    if predicted.rays > 0:
        return lead
    for j in range(len(readings)):
        q = readings[j]
        d, ahead = predicted.distance[j], predicted.ahead[j]
        if ahead >= p[0].cos_half_angle * d or is_crossed(q):
            continue
        r, _, _, by_edge = ray_over_circle(q, cx - q.x, cy - q.y, d, radius, p[0].half_angle_rad, EDGES)
        if by_edge >= p[0].cos_may_answer * d:
            lead += evidence_of_reading(q, q.range_m - r, d, by_edge, p, noise)
            lead -= evidence_of_reading(q, predicted.error[j], d, ahead, p, noise)
    return lead


@kernel
def edge_nat_of(tracks: Records[CircleTrack], but: int) -> float:
    """Return the log odds that beams' edges answer here, by what is usual and what the circles, but for one, say."""
    nat = EDGE_PRIOR_NAT
    for t in range(len(tracks)):
        if t != but and tracks[t].status == ESTABLISHED:
            nat += min(EDGE_LEAD_MAX_NAT, max(-EDGE_LEAD_MAX_NAT, tracks[t].edge_lead))
    return nat


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
