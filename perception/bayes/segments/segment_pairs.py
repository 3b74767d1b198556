"""Construction of outline segments from pairs of readings.

A pair may be two readings of one sensor or of neighbours in one firing, at any baseline. A short baseline gives a
segment early and a poor direction, a long one late and a good one; so each carries its uncertainty, and hypotheses
start from the surest.
"""

from __future__ import annotations

import math

from perception.bayes.inference.cross_path import LENGTH_MIN_M
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.scratch import PairSegment
from perception.kernel import kernel


@kernel
def tangent(first: Reading, second: Reading, cos_half: float, var_r: float, out: PairSegment) -> bool:
    """Write the common tangent of two ranges' arcs inside both beams, with its uncertainty; return whether it exists.

    McKerrow's construction (1993; paper §3.2, Figure 2): the tangent's normal makes the angle acos((r1 − r2)/L) with
    the baseline of length L. Both ends carry an independent error of variance `var_r` along the normal, so that the
    direction has the standard deviation √(2 var_r) / (length of the segment).

    Parameters
    ----------
    first, second : Reading
        The readings.
    cos_half : float
        Cosine of half the beam's opening.
    var_r : float
        Variance of a range, m².
    out : PairSegment
        Out: the segment, where there is one, but for `reading`.

    Returns
    -------
    bool
        Whether there is a tangent. Where there are two, the one nearer to both axes is taken.
    """
    x1, y1, r1 = first.x, first.y, first.range_m
    x2, y2, r2 = second.x, second.y, second.range_m
    base = math.sqrt((x2 - x1) * (x2 - x1) + (y2 - y1) * (y2 - y1))
    if base == 0.0 or abs(r1 - r2) > base:
        return False
    cos_open = (r1 - r2) / base
    sin_open = math.sqrt(1.0 - cos_open * cos_open)
    ex = (x2 - x1) / base
    ey = (y2 - y1) / base
    best = -2.0
    nx = 0.0
    ny = 0.0
    for side in (-1.0, 1.0):
        ax = ex * cos_open - side * ey * sin_open
        ay = ey * cos_open + side * ex * sin_open
        off1 = ax * first.axis_x + ay * first.axis_y
        off2 = ax * second.axis_x + ay * second.axis_y
        if off1 >= cos_half and off2 >= cos_half and off1 + off2 > best:
            best = off1 + off2
            nx = ax
            ny = ay
    if best == -2.0:
        return False
    length = base * sin_open
    out.x = 0.5 * (x1 + r1 * nx + x2 + r2 * nx)
    out.y = 0.5 * (y1 + r1 * ny + y2 + r2 * ny)
    out.normal_x = nx
    out.normal_y = ny
    out.length = length
    out.sigma_direction = math.sqrt(2.0 * var_r) / max(length, LENGTH_MIN_M)
    return True
