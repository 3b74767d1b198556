"""Recognition: how well a relaxed model explains a cluster, and so whether an object is detected (paper §3.4).

The paper requires a goodness of fit and does not define it. Here it consists of two numbers: how near the segments
lie to the model's outline, and how much of the outline has segments on it.
"""

from __future__ import annotations

import math

from perception.kernel import Floats, Ints, kernel


@kernel
def goodness_of_fit(
    sides: Floats,
    segments: Floats,
    members: Ints,
    x: float,
    y: float,
    theta: float,
    tolerance_m: float,
    tolerance_rad: float,
    hit: Ints,
) -> tuple[int, float, float]:
    """Return how many of a cluster's segments support a model at a pose, how near they lie, and the coverage.

    A segment supports the model if its middle lies within `tolerance_m` of the nearest side and its direction
    within `tolerance_rad` of that side's.

    Parameters
    ----------
    sides, segments, members, x, y, theta
        As for `perception.relaxation.increment`.
    tolerance_m, tolerance_rad : float
        Largest distance (m) and angle (rad) of a supporting segment from its side.
    hit : (m,) int
        Out: supporting segments of each side.

    Returns
    -------
    (int, float, float)
        Supporting segments, their root mean square distance from the outline (m, inf if there are none), and the
        share of the outline's length whose sides have support.
    """
    c = math.cos(theta)
    s = math.sin(theta)
    half_pi = 0.5 * math.pi
    for i in range(sides.shape[0]):
        hit[i] = 0
    support = 0
    squares = 0.0
    for k in range(members.shape[0]):
        j = members[k]
        x1, y1, x2, y2, normal = segments[j, 0], segments[j, 1], segments[j, 2], segments[j, 3], segments[j, 4]
        mx = 0.5 * (x1 + x2) - x
        my = 0.5 * (y1 + y2) - y
        px = c * mx + s * my
        py = -s * mx + c * my
        best = math.inf
        nearest = 0
        for i in range(sides.shape[0]):
            middle_x, middle_y, direction, side_length = sides[i, 0], sides[i, 1], sides[i, 2], sides[i, 3]
            ux = math.cos(direction)
            uy = math.sin(direction)
            along = (px - middle_x) * ux + (py - middle_y) * uy
            half = 0.5 * side_length
            along = min(max(along, -half), half)
            distance = math.hypot(px - middle_x - along * ux, py - middle_y - along * uy)
            if distance < best:
                best = distance
                nearest = i
        da = (normal + half_pi - theta - sides[nearest, 2]) % math.pi
        if da > half_pi:
            da -= math.pi
        if best <= tolerance_m and abs(da) <= tolerance_rad:
            support += 1
            squares += best * best
            hit[nearest] += 1
    if support == 0:
        return 0, math.inf, 0.0
    covered = 0.0
    length = 0.0
    for i in range(sides.shape[0]):
        length += sides[i, 3]
        if hit[i] > 0:
            covered += sides[i, 3]
    return support, math.sqrt(squares / support), covered / length
