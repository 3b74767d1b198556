"""The first echo of each sensor, computed by exact geometry in compiled kernels, without sampling.

Each surface answers by one of these models of the beam; the first echo of all counts.

- `cone`: from the nearest of its points inside the beam's sector.
- `specular`: at a wavelength of 7 mm smooth surfaces are mirrors. A surface then answers only from the point whose
  normal looks back at the sensor, a concave corner reflects sound back to where it came from, and a convex edge
  answers weakly.
- `rays`: where one of a few rays in the beam hits it, as other simulators have it.
- `silent`: not at all.

A surface that a nearer one hides does not answer.

Surfaces, sensors and echoes are structured arrays: one record each, with named fields.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.emulator._jit import kernel
from drivers.emulator.scene import Scene
from drivers.emulator.surfaces import CONE, RAYS, SPECULAR, Records, answers_by, first_hit, models_present

MOUNT: Final = np.dtype((np.record, [("x", "f8"), ("y", "f8"), ("angle", "f8")]))
"""A sensor's place and direction in the ring's frame, m and rad."""
ECHO: Final = np.dtype((np.record, [("distance", "f8"), ("x", "f8"), ("y", "f8")]))
"""Distance from a sensor to the reflecting point, m, and that point in the world; +inf and NaN if there is none."""

CONVEX_EDGE_REACH_M = 1.0
"""Farthest distance at which a convex edge is detected. An edge scatters only what diffracts round it, some 20 to
30 dB below a mirror's echo, and that spreads again on its way back; a rangefinder tuned for walls at ten metres
detects it within about a metre."""
SIGHT_SLACK_M = 3e-4
"""A surface nearer than this to a reflecting point does not hide it: it is the reflecting surface itself, or one that
joins it. Above `scene.JOIN_M`, so that rounding in a corner's own walls does not hide the corner."""
BESIDE_RAD = 1e-7
"""What is looked for right beside a surface's end is looked for at this angle from it, to either side."""


@kernel
def first_echoes(
    pose: tuple[float, float, float],
    mounts: Records,
    fired: NDArray[np.bool_],
    half_angle: float,
    model: int,
    rays: int,
    scene: Scene,
    out: Records,
) -> None:
    """Find the first echo of every sensor that fires.

    Parameters
    ----------
    pose
        Place x, y and direction of the ring in the world, m and rad.
    mounts
        The sensors: `MOUNT`, shape (sensors,).
    fired
        Which sensors emit, shape (sensors,).
    half_angle
        Half of the beam's opening, rad, below π/2.
    model
        How surfaces answer that do not say it themselves: `CONE`, `SPECULAR` or `RAYS`.
    rays
        Number of rays in the beam.
    scene
        The surfaces.
    out
        The echoes: `ECHO`, shape (sensors,), overwritten; none for a sensor that did not fire.
    """
    x, y, yaw = pose
    circles, segments, _ = scene
    c, s = math.cos(yaw), math.sin(yaw)
    present = models_present(model, circles, segments)
    for i in range(mounts.shape[0]):
        out[i].distance = math.inf
        out[i].x = math.nan
        out[i].y = math.nan
        if not fired[i]:
            continue
        sx = x + c * mounts[i].x - s * mounts[i].y
        sy = y + s * mounts[i].x + c * mounts[i].y
        axis = yaw + mounts[i].angle
        if present & (1 << SPECULAR):
            _first_mirror(sx, sy, axis, half_angle, model, scene, out[i])
        if present == 1 << CONE:
            _nearest_in_cone(sx, sy, axis, half_angle, circles, segments, out[i])
        elif present & (1 << CONE):
            _nearest_in_sight(sx, sy, axis, half_angle, model, scene, out[i])
        if present & (1 << RAYS):
            for k in range(rays):
                share = 0.5 if rays == 1 else k / (rays - 1)
                _keep_hit(sx, sy, axis + (2.0 * share - 1.0) * half_angle, RAYS, model, circles, segments, out[i])


@kernel
def _nearest_in_sight(
    sx: float,
    sy: float,
    axis: float,
    half_angle: float,
    model: int,
    scene: Scene,
    best: np.record,
) -> None:
    """Keep the nearest point in the beam of the surfaces that answer from each of their points, and that is in sight.

    That is the nearest point of one, or one on the beam's edge, or one right beside the end of what hides the rest.
    """
    circles, segments, corners = scene
    ux, uy = math.cos(axis), math.sin(axis)
    cos_half = math.cos(half_angle)
    for side in (-1.0, 1.0):
        _keep_hit(sx, sy, axis + side * half_angle, CONE, model, circles, segments, best)
    for k in range(circles.shape[0]):
        cx, cy, radius = circles[k].x - sx, circles[k].y - sy, circles[k].radius
        centre = math.hypot(cx, cy)
        if centre <= radius:
            _keep_nearer(0.0, sx, sy, best)
            return
        gap = centre - radius
        if (
            gap < best.distance
            and answers_by(CONE, circles[k].surface, model)
            and cx * ux + cy * uy >= centre * cos_half
        ):
            px, py = sx + cx / centre * gap, sy + cy / centre * gap
            if not hidden(sx, sy, px, py, SIGHT_SLACK_M, circles, segments):
                _keep_nearer(gap, px, py, best)
        to_edge, edge = math.asin(radius / centre), math.sqrt(centre * centre - radius * radius)
        for side in (-1.0, 1.0):
            _look_beside(sx, sy, math.atan2(cy, cx) + side * to_edge, edge, axis, half_angle, model, scene, best)
    for k in range(segments.shape[0]):
        ax, ay = segments[k].x1 - sx, segments[k].y1 - sy
        dx, dy = segments[k].x2 - segments[k].x1, segments[k].y2 - segments[k].y1
        t = -(ax * dx + ay * dy) / (dx * dx + dy * dy)
        px, py = ax + t * dx, ay + t * dy
        foot = math.hypot(px, py)
        if (
            0.0 <= t <= 1.0
            and foot < best.distance
            and answers_by(CONE, segments[k].surface, model)
            and px * ux + py * uy >= foot * cos_half
            and not hidden(sx, sy, sx + px, sy + py, SIGHT_SLACK_M, circles, segments)
        ):
            _keep_nearer(foot, sx + px, sy + py, best)
        for end in (0.0, 1.0):
            ex, ey = ax + end * dx, ay + end * dy
            _look_beside(sx, sy, math.atan2(ey, ex), math.hypot(ex, ey), axis, half_angle, model, scene, best)
    for k in range(corners.shape[0]):
        ex, ey = corners[k].x - sx, corners[k].y - sy
        _look_beside(sx, sy, math.atan2(ey, ex), math.hypot(ex, ey), axis, half_angle, model, scene, best)


@kernel
def _look_beside(
    sx: float,
    sy: float,
    direction: float,
    reach: float,
    axis: float,
    half_angle: float,
    model: int,
    scene: Scene,
    best: np.record,
) -> None:
    """Keep what a ray hits on either side of the end of a surface, if the end is in the beam and not too far."""
    off = (direction - axis + math.pi) % (2.0 * math.pi) - math.pi
    if reach < best.distance and abs(off) <= half_angle:
        for side in (-1.0, 1.0):
            if abs(off + side * BESIDE_RAD) <= half_angle:
                _keep_hit(sx, sy, direction + side * BESIDE_RAD, CONE, model, scene.circles, scene.segments, best)


@kernel
def _keep_nearer(distance: float, px: float, py: float, best: np.record) -> None:
    """Write a point (m) and its distance from the sensor to `best` if it is nearer."""
    if distance < best.distance:
        best.distance = distance
        best.x = px
        best.y = py


@kernel
def _keep_hit(
    sx: float,
    sy: float,
    direction: float,
    wanted: int,
    model: int,
    circles: Records,
    segments: Records,
    best: np.record,
) -> None:
    """Keep the first point that a ray hits if its surface answers by the wanted model."""
    reach, surface = first_hit(sx, sy, direction, circles, segments)
    if reach < math.inf and answers_by(wanted, surface, model):
        _keep_nearer(reach, sx + reach * math.cos(direction), sy + reach * math.sin(direction), best)


@kernel
def _nearest_in_cone(
    sx: float, sy: float, axis: float, half_angle: float, circles: Records, segments: Records, best: np.record
) -> None:
    """Keep the nearest point of all surfaces in the beam, if it is nearer than `best`.

    Only for a scene in which every surface answers as a cone: then nothing in the beam can hide that point, and it is
    not asked what is in sight, as by `_nearest_in_sight`.
    """
    rx, ry = math.cos(axis - half_angle), math.sin(axis - half_angle)
    lx, ly = math.cos(axis + half_angle), math.sin(axis + half_angle)
    for k in range(circles.shape[0]):
        cx, cy, radius = circles[k].x - sx, circles[k].y - sy, circles[k].radius
        centre = math.hypot(cx, cy)
        if centre <= radius:  # a sensor inside the circle always reports the shortest range
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
        ax, ay = segments[k].x1 - sx, segments[k].y1 - sy
        bx, by = segments[k].x2 - sx, segments[k].y2 - sy
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
    model: int,
    scene: Scene,
    best: np.record,
) -> None:
    """Keep the nearest corner, or point whose surface's normal looks back at the sensor, in the beam and in sight."""
    circles, segments, corners = scene
    ux, uy = math.cos(axis), math.sin(axis)
    cos_half = math.cos(half_angle)
    for k in range(circles.shape[0]):
        cx, cy, radius = circles[k].x - sx, circles[k].y - sy, circles[k].radius
        centre = math.hypot(cx, cy)
        if centre <= radius:
            _keep_nearer(0.0, sx, sy, best)
        elif answers_by(SPECULAR, circles[k].surface, model) and cx * ux + cy * uy >= centre * cos_half:
            gap = centre - radius
            px, py = sx + cx / centre * gap, sy + cy / centre * gap
            if gap < best.distance and not hidden(sx, sy, px, py, SIGHT_SLACK_M, circles, segments):
                _keep_nearer(gap, px, py, best)
    for k in range(segments.shape[0]):
        ax, ay = segments[k].x1 - sx, segments[k].y1 - sy
        dx, dy = segments[k].x2 - segments[k].x1, segments[k].y2 - segments[k].y1
        t = -(ax * dx + ay * dy) / (dx * dx + dy * dy)
        if 0.0 <= t <= 1.0:
            px, py = ax + t * dx, ay + t * dy
            foot = math.hypot(px, py)
            if (
                foot < best.distance
                and answers_by(SPECULAR, segments[k].surface, model)
                and px * ux + py * uy >= foot * cos_half
                and not hidden(sx, sy, sx + px, sy + py, SIGHT_SLACK_M, circles, segments)
            ):
                _keep_nearer(foot, sx + px, sy + py, best)
    for k in range(corners.shape[0]):
        px, py = corners[k].x - sx, corners[k].y - sy
        reach = math.hypot(px, py)
        if (
            reach < best.distance
            and _corner_answers(corners[k], px, py, reach, model)
            and px * ux + py * uy >= reach * cos_half
            and not hidden(sx, sy, corners[k].x, corners[k].y, SIGHT_SLACK_M, circles, segments)
        ):
            _keep_nearer(reach, corners[k].x, corners[k].y, best)


@kernel
def _corner_answers(corner: np.record, px: float, py: float, reach: float, model: int) -> bool:
    """Return whether a corner, at a place and a distance from a sensor, scatters into the sector the sensor is in."""
    side = (math.atan2(-py, -px) - corner.start) % (2.0 * math.pi)
    return (
        side < corner.opening
        and (corner.opening < math.pi or reach <= CONVEX_EDGE_REACH_M)
        and answers_by(SPECULAR, corner.surface, model)
        and answers_by(SPECULAR, corner.beside, model)
    )


@kernel
def hidden(sx: float, sy: float, px: float, py: float, slack: float, circles: Records, segments: Records) -> bool:
    """Return whether any surface crosses the line of sight from a sensor to a reflecting point.

    Parameters
    ----------
    sx, sy
        The sensor, m.
    px, py
        The reflecting point, m.
    slack
        Surfaces nearer than this to the reflecting point do not count, m.
    circles, segments
        The surfaces: `CIRCLE` and `SEGMENT`, shape (n,) each.
    """
    dx, dy = px - sx, py - sy
    distance = math.hypot(dx, dy)
    reach = distance - slack
    if reach <= 0.0:
        return False
    dx /= distance
    dy /= distance
    for k in range(circles.shape[0]):
        cx, cy = circles[k].x - sx, circles[k].y - sy
        t = min(reach, max(0.0, cx * dx + cy * dy))
        if math.hypot(cx - t * dx, cy - t * dy) < circles[k].radius:
            return True
    for k in range(segments.shape[0]):
        ax, ay = segments[k].x1 - sx, segments[k].y1 - sy
        vx, vy = segments[k].x2 - segments[k].x1, segments[k].y2 - segments[k].y1
        side_a = dx * ay - dy * ax
        side_b = side_a + dx * vy - dy * vx
        if side_a * side_b > 0.0 or side_a == side_b:
            continue
        t = (ax * vy - ay * vx) / (side_b - side_a)
        if 0.0 < t < reach:
            return True
    return False


@kernel
def clearance(x: float, y: float, circles: Records, segments: Records) -> float:
    """Return the distance from a point to the nearest surface, m; negative inside a circle, +inf without surfaces.

    Parameters
    ----------
    x, y
        The point, m.
    circles, segments
        The surfaces: `CIRCLE` and `SEGMENT`, shape (n,) each.
    """
    nearest = math.inf
    for k in range(circles.shape[0]):
        nearest = min(nearest, math.hypot(circles[k].x - x, circles[k].y - y) - circles[k].radius)
    for k in range(segments.shape[0]):
        ax, ay = segments[k].x1 - x, segments[k].y1 - y
        dx, dy = segments[k].x2 - segments[k].x1, segments[k].y2 - segments[k].y1
        t = min(1.0, max(0.0, -(ax * dx + ay * dy) / (dx * dx + dy * dy)))
        nearest = min(nearest, math.hypot(ax + t * dx, ay + t * dy))
    return nearest
