"""Where the first echo of each sensor comes from: geometry only, exact, compiled.

Two models of the beam. `cone`: the nearest surface point inside the beam's sector. `specular`: smooth surfaces are
mirrors to a wavelength of 7 mm, so a surface answers only from the point whose normal looks back at the sensor, a
concave corner sends everything back where it came from, a convex edge answers weakly, and what a nearer thing hides
is not heard. Every distance is exact; nothing is sampled.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.emulator._jit import kernel
from drivers.messages import Floats

CONVEX_EDGE_REACH_M = 1.0
"""A convex edge only scatters what diffracts round it, some 20 to 30 dB below a mirror's echo, and that spreads
again on its way back; a rangefinder tuned for walls ten metres off hears it within about a metre."""
SIGHT_SLACK_M = 3e-4
"""A surface nearer than this to a reflecting point does not hide it: that is the surface itself, or one that joins
it. It is above `scene.JOIN_M`, so that a corner is not hidden by the rounding of its own walls."""


@kernel
def first_echoes(
    x: float,
    y: float,
    yaw: float,
    mounts: Floats,
    fired: NDArray[np.bool_],
    half_angle: float,
    specular: bool,
    edge_reach: float,
    slack: float,
    circles: Floats,
    segments: Floats,
    corners: Floats,
    out: Floats,
) -> None:
    """Find the first echo of every sensor that fires.

    Parameters
    ----------
    x, y, yaw
        Place and direction of the ring, metres and radians.
    mounts
        Shape (sensors, 3): x, y and direction of each sensor in the ring's frame.
    fired
        Shape (sensors,): who emits.
    half_angle
        Half the beam's opening, below π/2.
    specular
        The model: mirrors, or the nearest point in the beam.
    edge_reach, slack
        `CONVEX_EDGE_REACH_M` and `SIGHT_SLACK_M`.
    circles, segments, corners
        The `Scene`.
    out
        Shape (sensors, 3), overwritten: distance to the reflecting point and its x, y in the world; the distance is
        +inf where nothing answers or the sensor did not fire.
    """
    c, s = math.cos(yaw), math.sin(yaw)
    for i in range(mounts.shape[0]):
        out[i, 0] = math.inf
        out[i, 1] = math.nan
        out[i, 2] = math.nan
        if not fired[i]:
            continue
        sx = x + c * mounts[i, 0] - s * mounts[i, 1]
        sy = y + s * mounts[i, 0] + c * mounts[i, 1]
        axis = yaw + mounts[i, 2]
        if specular:
            _first_mirror(sx, sy, axis, half_angle, edge_reach, slack, circles, segments, corners, out[i])
        else:
            _nearest_in_cone(sx, sy, axis, half_angle, circles, segments, out[i])


@kernel
def _keep_nearer(distance: float, px: float, py: float, best: Floats) -> None:
    if distance < best[0]:
        best[0] = distance
        best[1] = px
        best[2] = py


@kernel
def _nearest_in_cone(
    sx: float, sy: float, axis: float, half_angle: float, circles: Floats, segments: Floats, best: Floats
) -> None:
    rx, ry = math.cos(axis - half_angle), math.sin(axis - half_angle)
    lx, ly = math.cos(axis + half_angle), math.sin(axis + half_angle)
    for k in range(circles.shape[0]):
        cx, cy, radius = circles[k, 0] - sx, circles[k, 1] - sy, circles[k, 2]
        centre = math.hypot(cx, cy)
        if centre <= radius:  # inside the circle there is no range but the shortest
            _keep_nearer(0.0, sx, sy, best)
        elif rx * cy - ry * cx >= 0.0 and cx * ly - cy * lx >= 0.0:
            gap = centre - radius
            _keep_nearer(gap, sx + cx / centre * gap, sy + cy / centre * gap, best)
        else:
            for ex, ey in ((rx, ry), (lx, ly)):
                along = cx * ex + cy * ey
                off = cx * ey - cy * ex
                if along > 0.0 and abs(off) <= radius:
                    reach = along - math.sqrt(radius * radius - off * off)
                    _keep_nearer(reach, sx + reach * ex, sy + reach * ey, best)
    for k in range(segments.shape[0]):
        ax, ay = segments[k, 0] - sx, segments[k, 1] - sy
        bx, by = segments[k, 2] - sx, segments[k, 3] - sy
        # The part of the segment left of the right edge and right of the left one: both are linear along it.
        right_a, right_b = rx * ay - ry * ax, rx * by - ry * bx
        left_a, left_b = ax * ly - ay * lx, bx * ly - by * lx
        low, high = 0.0, 1.0
        if (right_a < 0.0 and right_b < 0.0) or (left_a < 0.0 and left_b < 0.0):
            continue
        if right_a < 0.0:
            low = max(low, right_a / (right_a - right_b))
        elif right_b < 0.0:
            high = min(high, right_a / (right_a - right_b))
        if left_a < 0.0:
            low = max(low, left_a / (left_a - left_b))
        elif left_b < 0.0:
            high = min(high, left_a / (left_a - left_b))
        if low > high:
            continue
        dx, dy = bx - ax, by - ay
        t = min(high, max(low, -(ax * dx + ay * dy) / (dx * dx + dy * dy)))
        px, py = ax + t * dx, ay + t * dy
        _keep_nearer(math.hypot(px, py), sx + px, sy + py, best)


@kernel
def _first_mirror(
    sx: float,
    sy: float,
    axis: float,
    half_angle: float,
    edge_reach: float,
    slack: float,
    circles: Floats,
    segments: Floats,
    corners: Floats,
    best: Floats,
) -> None:
    ux, uy = math.cos(axis), math.sin(axis)
    cos_half = math.cos(half_angle)
    for k in range(circles.shape[0]):
        cx, cy, radius = circles[k, 0] - sx, circles[k, 1] - sy, circles[k, 2]
        centre = math.hypot(cx, cy)
        if centre <= radius:
            _keep_nearer(0.0, sx, sy, best)
        elif cx * ux + cy * uy >= centre * cos_half:
            gap = centre - radius
            px, py = sx + cx / centre * gap, sy + cy / centre * gap
            if gap < best[0] and not hidden(sx, sy, px, py, slack, circles, segments):
                _keep_nearer(gap, px, py, best)
    for k in range(segments.shape[0]):
        ax, ay = segments[k, 0] - sx, segments[k, 1] - sy
        dx, dy = segments[k, 2] - segments[k, 0], segments[k, 3] - segments[k, 1]
        t = -(ax * dx + ay * dy) / (dx * dx + dy * dy)
        if 0.0 <= t <= 1.0:
            px, py = ax + t * dx, ay + t * dy
            foot = math.hypot(px, py)
            if (
                foot < best[0]
                and px * ux + py * uy >= foot * cos_half
                and not hidden(sx, sy, sx + px, sy + py, slack, circles, segments)
            ):
                _keep_nearer(foot, sx + px, sy + py, best)
    for k in range(corners.shape[0]):
        px, py = corners[k, 0] - sx, corners[k, 1] - sy
        reach = math.hypot(px, py)
        side = (math.atan2(-py, -px) - corners[k, 2]) % (2.0 * math.pi)
        if (
            side < corners[k, 3]
            and (corners[k, 3] < math.pi or reach <= edge_reach)
            and reach < best[0]
            and px * ux + py * uy >= reach * cos_half
            and not hidden(sx, sy, corners[k, 0], corners[k, 1], slack, circles, segments)
        ):
            _keep_nearer(reach, corners[k, 0], corners[k, 1], best)


@kernel
def hidden(sx: float, sy: float, px: float, py: float, slack: float, circles: Floats, segments: Floats) -> bool:
    """Tell whether any surface crosses the line of sight from (sx, sy) to within `slack` of (px, py)."""
    dx, dy = px - sx, py - sy
    distance = math.hypot(dx, dy)
    reach = distance - slack
    if reach <= 0.0:
        return False
    dx /= distance
    dy /= distance
    for k in range(circles.shape[0]):
        cx, cy = circles[k, 0] - sx, circles[k, 1] - sy
        t = min(reach, max(0.0, cx * dx + cy * dy))
        if math.hypot(cx - t * dx, cy - t * dy) < circles[k, 2]:
            return True
    for k in range(segments.shape[0]):
        ax, ay = segments[k, 0] - sx, segments[k, 1] - sy
        vx, vy = segments[k, 2] - segments[k, 0], segments[k, 3] - segments[k, 1]
        side_a = dx * ay - dy * ax
        side_b = side_a + dx * vy - dy * vx
        if side_a * side_b > 0.0 or side_a == side_b:
            continue
        t = (ax * vy - ay * vx) / (side_b - side_a)
        if 0.0 < t < reach:
            return True
    return False


@kernel
def clearance(x: float, y: float, circles: Floats, segments: Floats) -> float:
    """Return the distance from (x, y) to the nearest surface, metres; negative inside a circle, +inf in the open."""
    nearest = math.inf
    for k in range(circles.shape[0]):
        nearest = min(nearest, math.hypot(circles[k, 0] - x, circles[k, 1] - y) - circles[k, 2])
    for k in range(segments.shape[0]):
        ax, ay = segments[k, 0] - x, segments[k, 1] - y
        dx, dy = segments[k, 2] - segments[k, 0], segments[k, 3] - segments[k, 1]
        t = min(1.0, max(0.0, -(ax * dx + ay * dy) / (dx * dx + dy * dy)))
        nearest = min(nearest, math.hypot(ax + t * dx, ay + t * dy))
    return nearest
