"""Readings entered into particles: the place of each is fitted to them, and it is weighed by how likely they are."""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import Floats, kernel
from perception.localization.known_room.mirror_points import expect_specular
from perception.localization.known_room.mixed_reflection import Shares, mixed_ratio, range_variance
from perception.localization.known_room.pose_particles import HypothesesRecord, Particle
from perception.localization.known_room.surroundings import (
    Expected,
    Surroundings,
    expect_cone,
    look_around,
)
from perception.records import Records

FIT_STEPS: Final = 2
"""Linear solutions of an update."""
TEMPER: Final = 0.5
"""Weight of a reading, in the likelihood and in the fit of the place: errors of the map are common to readings of one
wall."""
PARTICLE_SPREAD_M: Final = 1.0
"""Greatest distance of a particle from its hypothesis's mean for which all surfaces in reach are found."""
COLUMNS: Final = 5
"""A reading is a row: place of the sensor in the ring's frame (m), cosine and sine of its axis, range (m)."""

Symmetric = tuple[float, float, float, float, float, float, float]
"""Elements xx, xy, xs, yy, ys, ss of a symmetric matrix, and the determinant of the one that it inverts."""


@kernel
def inverse(xx: float, xy: float, xs: float, yy: float, ys: float, ss: float) -> Symmetric:
    """Return the inverse of a symmetric matrix of three rows, and the determinant of the matrix."""
    a, b, c = yy * ss - ys * ys, xs * ys - xy * ss, xy * ys - xs * yy
    det = xx * a + xy * b + xs * c
    return (
        a / det,
        b / det,
        c / det,
        (xx * ss - xs * xs) / det,
        (xy * xs - xx * ys) / det,
        (xx * yy - xy * xy) / det,
        det,
    )


@kernel
def variance_along(xx: float, xy: float, yy: float, expected: Expected) -> float:
    """Return the variance (m²) of an expected range from that of the place."""
    return xx * expected[1] * expected[1] + 2.0 * xy * expected[1] * expected[2] + yy * expected[2] * expected[2]


@kernel
def update_particle(
    s: Surroundings, particles: Records[Particle], i: int, readings: Floats, count: int, shares: Records[Shares]
) -> None:
    """Fit the place of a particle to readings, and add to its log weight how likely they are.

    Parameters
    ----------
    s : Surroundings
        Of a place near the particle's.
    particles : (n,) Particle
        Updated.
    i : int
        Which.
    readings : (m, COLUMNS) float
        In the ring's frame; silence is inf.
    count : int
        How many of them.
    shares : (1,) Shares
        How often a reading has which cause.
    """
    p = particles[i]
    cos, sin = math.cos(p.heading), math.sin(p.heading)
    lxx, lxy, lxs, lyy, lys, lss, det_before = inverse(p.xx, p.xy, p.xs, p.yy, p.ys, p.ss)
    x, y, scale, xx, xy, yy = p.x, p.y, p.scale, p.xx, p.xy, p.yy
    xs = ys = ss = det_information = p.log_ratio = p.specular = 0.0
    for step in range(FIT_STEPS + 1):
        is_fitted = step == FIT_STEPS
        ax = ay = axy = bx = by = ratio = specular = turned_away = late = wild = beside = could_beside = 0.0
        for k in range(count):
            mx, my, c, sn, measured = readings[k]
            at_x, at_y = x + cos * mx - sin * my, y + sin * mx + cos * my
            ux, uy = cos * c - sin * sn, sin * c + cos * sn
            cone = expect_cone(s, at_x, at_y, ux, uy)
            mirrors = expect_specular(s, at_x, at_y, ux, uy, s.sensor[0].cos_fringe)
            expected = (cone, mirrors[0], mirrors[1])
            cone_var = specular_var = beside_var = 0.0
            if not is_fitted:
                cone_var = variance_along(xx, xy, yy, cone)
                specular_var = variance_along(xx, xy, yy, mirrors[0])
                beside_var = variance_along(xx, xy, yy, mirrors[1])
            log_ratio, causes = mixed_ratio(
                s.sensor, measured, cone[0], cone_var, mirrors[0][0], specular_var, mirrors[1][0], beside_var, shares
            )
            ratio += log_ratio
            specular += causes[3]
            turned_away += causes[4]
            late += causes[5]
            wild += causes[6]
            beside += causes[2]
            could_beside += causes[7]
            for cause in range(3):
                if measured < math.inf and causes[cause] > 0.0:
                    range_m, grad_x, grad_y = expected[cause]
                    weight = TEMPER * causes[cause] / range_variance(s.sensor, range_m)
                    error = weight * (measured - range_m)
                    ax += weight * grad_x * grad_x
                    axy += weight * grad_x * grad_y
                    ay += weight * grad_y * grad_y
                    bx += error * grad_x
                    by += error * grad_y
        if is_fitted:
            p.log_ratio, p.specular, p.turned_away, p.late, p.wild = ratio, specular, turned_away, late, wild
            p.beside, p.could_beside = beside, could_beside
        else:
            dx, dy, ds = p.x - x, p.y - y, p.scale - scale
            bx += lxx * dx + lxy * dy + lxs * ds
            by += lxy * dx + lyy * dy + lys * ds
            bs = lxs * dx + lys * dy + lss * ds
            xx, xy, xs, yy, ys, ss, det_information = inverse(lxx + ax, lxy + axy, lxs, lyy + ay, lys, lss)
            x += xx * bx + xy * by + xs * bs
            y += xy * bx + yy * by + ys * bs
            scale += xs * bx + ys * by + ss * bs
    dx, dy, ds = x - p.x, y - p.y, scale - p.scale
    p.log_weight += TEMPER * p.log_ratio - 0.5 * (
        lxx * dx * dx + lyy * dy * dy + lss * ds * ds + 2.0 * (lxy * dx * dy + lxs * dx * ds + lys * dy * ds)
    )
    p.log_weight -= 0.5 * math.log(det_information * det_before)
    p.x, p.y, p.scale = x, y, scale
    p.xx, p.xy, p.xs, p.yy, p.ys, p.ss = xx, xy, xs, yy, ys, ss


@kernel
def update_particles(
    s: Surroundings,
    of: HypothesesRecord,
    h: int,
    first: int,
    end: int,
    readings: Floats,
    count: int,
    shares: Records[Shares],
) -> None:
    """Enter readings into some particles of a hypothesis.

    Parameters
    ----------
    s : Surroundings
        `near` is overwritten.
    of : (1,) Hypotheses
        Updated.
    h, first, end : int
        The hypothesis, its first particle and the one after its last.
    readings, count, shares
        As of `update_particle`.
    """
    x = y = within_m = 0.0
    particles = of[0].hypotheses[h].particles
    for i in range(len(particles)):
        x += particles[i].x / len(particles)
        y += particles[i].y / len(particles)
    for k in range(count):
        within_m = max(within_m, math.hypot(readings[k, 0], readings[k, 1]))
    look_around(s, x, y, within_m + PARTICLE_SPREAD_M)
    for i in range(first, end):
        update_particle(s, particles, i, readings, count, shares)
