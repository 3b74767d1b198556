"""Which cross path a polygon predicts, by the rules of `perception.bayes.polygons.likelihood`."""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.inference.cross_path import is_crossed
from perception.bayes.inference.likelihood import level_of, log_likelihood
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.polygon_parameters import DOUBTFUL_ANSWER_NAT, EDGE_NAT_PER_M, EDGE_REACH_M, GRAZING_COS
from perception.bayes.memory.settings_record import PolygonSide, SettingsRecord
from perception.kernel import kernel
from perception.records import Records

NO_ANSWER_M: Final = 1e18
"""A range that stands for no answer."""


@kernel
def half_over_point(x: float, y: float, px: float, py: float, qx: float, qy: float) -> float:
    """Return half the way from (px, py) over (x, y) to (qx, qy), m."""
    return 0.5 * (math.hypot(x - px, y - py) + math.hypot(x - qx, y - qy))


@kernel
def height(side: PolygonSide, x: float, y: float) -> float:
    """Return how far a point lies outside a side's line, m."""
    return (x - side.x) * side.tangent_y - (y - side.y) * side.tangent_x


@kernel
def corner_nat(sides: Records[PolygonSide], before: int, after: int, is_closed: bool, range_m: float) -> float:
    """Return what the answer of the corner between two sides costs, nat: more beyond the reach of a convex edge."""
    price = DOUBTFUL_ANSWER_NAT
    if is_closed and EDGE_REACH_M < range_m < NO_ANSWER_M:
        first = sides[before]
        second = sides[after % len(sides)]
        if first.tangent_x * second.tangent_y - first.tangent_y * second.tangent_x > 0.0:
            price += EDGE_NAT_PER_M * (range_m - EDGE_REACH_M)
    return price


@kernel
def predict_cross(
    q: Reading,
    x: float,
    y: float,
    c: float,
    s: float,
    sides: Records[PolygonSide],
    is_closed: bool,
    p: SettingsRecord,
) -> tuple[float, float, float]:
    """Return half the way over a polygon to the listener, as a mirror and as a cone, and what a mirror's costs.

    A side is a mirror between two points on the same face of it, where the way meets the side; else the corner with
    the shortest way scatters. As a cone each side also answers where the transmitter's beam ends on it.

    Parameters
    ----------
    q : Reading
        A cross path.
    x, y, c, s : float
        The polygon's place (m), and cosine and sine of its heading.
    sides, is_closed, p
        As for `likelihood.predict`.

    Returns
    -------
    (float, float, float)
        Half the way over a mirror (m, `NO_ANSWER_M` where none), its price (nat), and that over a cone (m).
    """
    dx, dy = q.x - x, q.y - y
    tx, ty = c * dx + s * dy, c * dy - s * dx
    lx, ly = tx + c * q.listener_x + s * q.listener_y, ty + c * q.listener_y - s * q.listener_x
    ux, uy = c * q.axis_x + s * q.axis_y, c * q.axis_y - s * q.axis_x
    foot = corner = edge = NO_ANSWER_M
    before = after = 0
    for k in range(len(sides)):
        side = sides[k]
        ex, ey = side.tangent_x, side.tangent_y
        t_high, l_high = height(side, tx, ty), height(side, lx, ly)
        if t_high == 0.0 or (t_high < 0.0 and is_closed):
            continue
        t_along = (tx - side.x) * ex + (ty - side.y) * ey
        l_along = (lx - side.x) * ex + (ly - side.y) * ey
        for place in range(5):
            # The next side may show the listener the corner that they share.
            beside = l_high
            if is_closed and 1 <= place < 3:
                beside = max(l_high, height(sides[(k + 2 * place - 3) % len(sides)], lx, ly))
            if t_high * beside <= 0.0:
                continue
            if place == 0:
                along = (t_along * l_high + l_along * t_high) / (t_high + l_high)
            elif place < 3:
                along = (place - 1) * side.length
            else:
                hand = p[0].sin_half_angle if place == 3 else -p[0].sin_half_angle
                rx, ry = ux * p[0].cos_half_angle - uy * hand, uy * p[0].cos_half_angle + ux * hand
                towards = (ry * ex - rx * ey) * math.copysign(1.0, t_high)
                if towards <= GRAZING_COS:
                    continue
                along = t_along + (rx * ex + ry * ey) * abs(t_high) / towards
            if not 0.0 <= along <= side.length:
                continue
            px, py = side.x + along * ex, side.y + along * ey
            d = math.hypot(px - tx, py - ty)
            if place < 3 and (px - tx) * ux + (py - ty) * uy < p[0].cos_may_answer * d:
                continue
            half = half_over_point(px, py, tx, ty, lx, ly)
            if place == 0:
                foot = min(foot, half)
            elif place < 3:
                if half < corner:
                    corner = half
                    before = k - 2 + place
                    after = k - 1 + place
            else:
                edge = min(edge, half)
    nearest = min(foot, corner, edge)
    if foot < NO_ANSWER_M:
        return foot, 0.0, nearest
    return corner, corner_nat(sides, before, after, is_closed, corner), nearest


@kernel
def score_crosses(
    readings: Records[Reading],
    every: int,
    frame: tuple[float, float, float, float],
    sides: Records[PolygonSide],
    is_closed: bool,
    p: SettingsRecord,
    noise: int,
) -> tuple[float, float, float, float, float, float]:
    """Return evidence (nat), near readings and hits of the cross paths, as a mirror, and then as a cone.

    A cross path is never bound to be heard; so it counts only for a body.

    Parameters
    ----------
    readings, every, sides, is_closed, p, noise
        As for `likelihood.score_polygon`.
    frame : (float, float, float, float)
        x, y, c, s, as for `predict_cross`.
    """
    x, y, c, s = frame
    gate = p[0].gate_m
    mirror = mirror_near = mirror_hits = 0.0
    cone = cone_near = cone_hits = 0.0
    for j in range(0, len(readings), every):
        q = readings[j]
        if not is_crossed(q):
            continue
        at, price, at_cone = predict_cross(q, x, y, c, s, sides, is_closed, p)
        level = level_of(p, noise, q.range_m)
        if abs(q.range_m - at) < gate:
            v = max(0.0, log_likelihood(p, level, q.range_m - at) - price)
            mirror += v
            mirror_near += 1.0
            mirror_hits += 1.0 if v > 0.0 else 0.0
        if abs(q.range_m - at_cone) < gate:
            v = max(0.0, log_likelihood(p, level, q.range_m - at_cone))
            cone += v
            cone_near += 1.0
            cone_hits += 1.0 if v > 0.0 else 0.0
    return mirror, mirror_near, mirror_hits, cone, cone_near, cone_hits
