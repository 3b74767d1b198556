"""Cross paths: the way of sound from a sensor over a body to another sensor that listens, and half its length.

Half a path is a range like any other: its noise and its rounding are those of an echo. Only what a body predicts
differs. With the transmitter at distance a and the listener at distance b of the surface, L apart, half the path is

    over an edge      (a + b) / 2
    over a line       √(ab + L² / 4), a and b along its normal
    over a circle     between the two: at the reflecting point both ways make the same angle with the surface

so that an echo and a cross path together show how a surface curves, and where it lies (Kleeman and Kuc 1995). A
reading's place and axis are those of its transmitter, so that one beam counts, and its listener's. How far off its
axis a listener hears depends on the echo's strength; so a cross path that was not heard, or came from elsewhere, is
no evidence.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.memory.elements import Reading
from perception.kernel import kernel, loop_kernel

LENGTH_MIN_M: Final = 1e-6
"""Lengths by which something is divided count as at least this, and a sensor as at least this far from a surface, so
that none is inside a body."""
LENGTH2_MIN: Final = 1e-200
"""Least divisor: a place without a direction gives numbers, not an error."""


@kernel
def is_crossed(q: Reading) -> bool:
    """Return whether a reading is a cross path."""
    return bool(q.listener_x != 0.0 or q.listener_y != 0.0)


@loop_kernel
def over_circle(q: Reading, dx: float, dy: float, radius: float) -> tuple[float, float, float]:
    """Return half the shortest way over a circle to the listener, and its gradient by the circle's centre.

    Alhazen's problem: the way is stationary along the arc at the reflecting point. From the arc's point between the
    two directions, weighted by distance, a step of Newton's method goes to within microradians of it; what is left
    of the way is of second order and taken off. The error is below .1 µm from 10 cm on.

    Parameters
    ----------
    q : Reading
        A cross path.
    dx, dy : float
        The circle's centre from the transmitter, m.
    radius : float
        m; 0 is an edge.

    Returns
    -------
    (float, float, float)
        Half the way, m, and its derivatives.
    """
    ax, ay = -dx, -dy
    bx, by = q.listener_x - dx, q.listener_y - dy
    a = max(math.sqrt(ax * ax + ay * ay), radius + LENGTH_MIN_M)
    b = max(math.sqrt(bx * bx + by * by), radius + LENGTH_MIN_M)
    # (b − ρ) / a and (a − ρ) / b, both times ab: only the direction counts
    share_a, share_b = b * (b - radius), a * (a - radius)
    wx, wy = share_a * ax + share_b * bx, share_a * ay + share_b * by
    length2 = wx * wx + wy * wy
    between = radius if length2 == 0.0 else 0.0  # the circle lies between the sensors
    per_bend = half = gx = gy = 0.0
    for turn in range(2):
        scale = 1.0 / math.sqrt(max(length2, LENGTH2_MIN))
        wx *= scale
        wy *= scale
        px, py = ax - radius * wx, ay - radius * wy
        qx, qy = bx - radius * wx, by - radius * wy
        to_a = max(math.sqrt(px * px + py * py), LENGTH_MIN_M)
        to_b = max(math.sqrt(qx * qx + qy * qy), LENGTH_MIN_M)
        per_a, per_b = 1.0 / to_a, 1.0 / to_b
        slope_a = radius * (ax * wy - ay * wx) * per_a
        slope_b = radius * (bx * wy - by * wx) * per_b
        slope = slope_a + slope_b
        if turn == 0:
            bend = (radius * (ax * wx + ay * wy) - slope_a * slope_a) * per_a
            bend += (radius * (bx * wx + by * wy) - slope_b * slope_b) * per_b
            per_bend = 1.0 / max(bend, LENGTH2_MIN) if bend > 0.0 else 0.0
            step = slope * per_bend
            wx, wy = wx + step * wy, wy - step * wx
            length2 = 1.0 + step * step
        else:
            half = 0.5 * (to_a + to_b - 0.5 * slope * slope * per_bend) - between
            gx = -0.5 * (px * per_a + qx * per_b)
            gy = -0.5 * (py * per_a + qy * per_b)
    return half, gx, gy


@kernel
def is_near_circle(q: Reading, d: float, radius: float, gate: float) -> bool:
    """Return whether half a cross path may be within `gate` (m) of what a circle predicts.

    The way to the listener is longer or shorter than the way back by the distance of the two at most.

    Parameters
    ----------
    q : Reading
        A reading.
    d, radius : float
        Distance of the circle's centre from the sensor that fired, and its radius, m.
    gate : float
        m
    """
    slack = gate + 0.5 * (abs(q.listener_x) + abs(q.listener_y))
    return abs(q.range_m + radius - d) <= slack


@kernel
def circle_error(q: Reading, dx: float, dy: float, d: float, radius: float) -> float:
    """Return a range, or half a cross path, less what a circle predicts, m.

    Parameters
    ----------
    q : Reading
        The reading.
    dx, dy, d : float
        The circle's centre from the sensor that fired, and its distance, m.
    radius : float
        m
    """
    if is_crossed(q):
        half, _, _ = over_circle(q, dx, dy, radius)
        return q.range_m - half
    return q.range_m - (d - radius)


@kernel
def over_line(q: Reading, nx: float, ny: float, away: float) -> tuple[float, float, float]:
    """Return half the way over a line to the listener, and its derivatives by both sensors' distances from it.

    Parameters
    ----------
    q : Reading
        A reading; of an echo this is the distance itself, by which the derivative is 1, and 0.
    nx, ny : float
        The line's unit normal, away from the sensors.
    away : float
        The transmitter's distance before the line, m.
    """
    if not is_crossed(q):
        return away, 1.0, 0.0
    beyond = away - nx * q.listener_x - ny * q.listener_y
    if away <= 0.0 or beyond <= 0.0:
        return away, 1.0, 0.0
    apart2 = q.listener_x * q.listener_x + q.listener_y * q.listener_y
    half = math.sqrt(away * beyond + 0.25 * apart2)
    return half, 0.5 * beyond / half, 0.5 * away / half
