"""The shortest way of sound from one sensor over a surface to another, by exact geometry in compiled kernels.

The models of the beam are those of `drivers.emulator.acoustics`; a surface that hides the reflecting point from
either sensor silences it.

- `specular`: a circle or wall answers where it is a mirror between the two sensors. In a concave corner the sound
  bounces off both walls: unfolded, that is a straight line, and where the corner is too wide for it the corner itself
  scatters. A convex edge scatters weakly.
- `cone`, and `rays` as well: each surface answers from the point in both beams with the shortest way.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from drivers.emulator._jit import kernel
from drivers.emulator.acoustics import CONVEX_EDGE_REACH_M, SIGHT_SLACK_M, hidden
from drivers.emulator.scene import Scene
from drivers.emulator.surfaces import CONE, RAYS, SPECULAR, Records, answers_by

Ear: TypeAlias = "tuple[float, float, float, float]"
"""A sensor that emits or listens: place x, y (m), direction of its axis, and half the width of its beam, rad."""


@kernel
def first_cross_paths(
    pose: tuple[float, float, float],
    mounts: Records,
    heard: NDArray[np.bool_],
    half_angle: float,
    lobe: float,
    model: int,
    scene: Scene,
    out: NDArray[np.float64],
) -> None:
    """Find half the shortest way over a surface to each sensor, from any of the others that it can hear.

    Parameters
    ----------
    pose
        Place x, y and direction of the ring in the world, m and rad.
    mounts
        The sensors: `acoustics.MOUNT`, shape (sensors,).
    heard
        Whose pulse is heard by whom: [transmitter, listener], shape (sensors, sensors).
    half_angle, lobe
        How far off its axis a sensor emits, and how far it hears another one's pulse, rad; `half_angle` is below π/2.
    model
        How surfaces answer that do not say it themselves.
    scene
        The surfaces.
    out
        Half the shortest path to each listener, shape (sensors,), m, overwritten; +inf where there is none.
    """
    x, y, yaw = pose
    c, s = math.cos(yaw), math.sin(yaw)
    for i in range(mounts.shape[0]):
        shortest = math.inf
        listener = _placed(x, y, yaw, c, s, mounts[i], lobe)
        for j in range(mounts.shape[0]):
            if heard[j, i]:
                transmitter = _placed(x, y, yaw, c, s, mounts[j], half_angle)
                shortest = _over_mirrors(transmitter, listener, model, scene, shortest)
                shortest = _in_both_beams(transmitter, listener, model, scene, shortest)
        out[i] = 0.5 * shortest


@kernel
def _placed(x: float, y: float, yaw: float, c: float, s: float, mount: np.record, half_angle: float) -> Ear:
    """Return a sensor's place in the world, the direction of its axis, and half the width of its beam."""
    return x + c * mount.x - s * mount.y, y + s * mount.x + c * mount.y, yaw + mount.angle, min(half_angle, math.pi)


@kernel
def _is_in_beam(sensor: Ear, px: float, py: float, margin: float) -> bool:
    dx, dy = px - sensor[0], py - sensor[1]
    ahead = dx * math.cos(sensor[2]) + dy * math.sin(sensor[2])
    return ahead >= (math.cos(sensor[3]) - margin) * math.hypot(dx, dy)


@kernel
def _over_mirrors(transmitter: Ear, listener: Ear, model: int, scene: Scene, shortest: float) -> float:
    """Return the shortest way over what answers as a mirror, or `shortest` if that is shorter."""
    circles, segments, corners = scene
    tx, ty, lx, ly = transmitter[0], transmitter[1], listener[0], listener[1]
    for k in range(circles.shape[0]):
        least = _least_over_circle(tx, ty, lx, ly, circles[k])
        if least >= shortest or not answers_by(SPECULAR, circles[k].surface, model):
            continue
        if least <= 0.0:  # a sensor inside the circle always reports the shortest range
            return 0.0
        px, py, path = mirror_on_circle(tx, ty, lx, ly, circles[k].x, circles[k].y, circles[k].radius)
        if path < shortest and _answers(transmitter, px, py, listener, px, py, scene):
            shortest = path
    for k in range(segments.shape[0]):
        if not answers_by(SPECULAR, segments[k].surface, model):
            continue
        px, py, path = _mirror_on_side(tx, ty, lx, ly, segments[k])
        if path < shortest and _answers(transmitter, px, py, listener, px, py, scene):
            shortest = path
    for k in range(corners.shape[0]):
        if answers_by(SPECULAR, corners[k].surface, model) and answers_by(SPECULAR, corners[k].beside, model):
            shortest = _over_corner(transmitter, listener, corners[k], scene, shortest)
    return shortest


@kernel
def _over_corner(transmitter: Ear, listener: Ear, corner: np.record, scene: Scene, shortest: float) -> float:
    """Return the shortest way over a corner, or `shortest` if that is shorter: over both walls, or over its point."""
    tx, ty, lx, ly = transmitter[0], transmitter[1], listener[0], listener[1]
    vx, vy, start, opening = corner.x, corner.y, corner.start, corner.opening
    from_t, from_l = math.hypot(tx - vx, ty - vy), math.hypot(lx - vx, ly - vy)
    t_angle = (math.atan2(ty - vy, tx - vx) - start) % (2.0 * math.pi)
    l_angle = (math.atan2(ly - vy, lx - vx) - start) % (2.0 * math.pi)
    if t_angle >= opening or l_angle >= opening:
        return shortest
    # Unfolded, the sound goes straight through both walls; round the corner it turns by this angle, either way.
    one, other = 2.0 * opening + l_angle - t_angle, 2.0 * opening + t_angle - l_angle
    if opening < math.pi and min(one, other) < math.pi:
        for to_end in (True, False):
            turn = one if to_end else other
            if turn >= math.pi:
                continue
            path = math.sqrt(from_t**2 + from_l**2 - 2.0 * from_t * from_l * math.cos(turn))
            to_first = opening - t_angle if to_end else t_angle
            first = _on_chord(from_t, from_l, turn, to_first)
            second = _on_chord(from_t, from_l, turn, to_first + opening)
            first_wall = start + opening if to_end else start
            second_wall = start if to_end else start + opening
            px, py = vx + first * math.cos(first_wall), vy + first * math.sin(first_wall)
            qx, qy = vx + second * math.cos(second_wall), vy + second * math.sin(second_wall)
            if (
                path < shortest
                and _is_on_side(px, py, scene.segments)
                and _is_on_side(qx, qy, scene.segments)
                and _answers(transmitter, px, py, listener, qx, qy, scene)
                and not _is_parted(px, py, qx, qy, scene)
            ):
                shortest = path
        return shortest
    path = from_t + from_l
    if (
        path < shortest
        and (opening < math.pi or path <= 2.0 * CONVEX_EDGE_REACH_M)
        and _answers(transmitter, vx, vy, listener, vx, vy, scene)
    ):
        return path
    return shortest


@kernel
def _answers(transmitter: Ear, px: float, py: float, listener: Ear, qx: float, qy: float, scene: Scene) -> bool:
    """Return whether the first point lies in the transmitter's beam and sight, and the last in the listener's."""
    return (
        _is_in_beam(transmitter, px, py, 0.0)
        and _is_in_beam(listener, qx, qy, 0.0)
        and not _is_out_of_sight(transmitter, px, py, scene)
        and not _is_out_of_sight(listener, qx, qy, scene)
    )


@kernel
def _on_chord(from_t: float, from_l: float, turn: float, angle: float) -> float:
    """Return how far from the corner the unfolded way passes, in the direction that lies `angle` past its start."""
    return from_t * from_l * math.sin(turn) / (from_t * math.sin(angle) + from_l * math.sin(turn - angle))


@kernel
def _is_on_side(px: float, py: float, segments: Records) -> bool:
    """Return whether a point lies on one of these segments."""
    for k in range(segments.shape[0]):
        ax, ay = segments[k].x1 - px, segments[k].y1 - py
        dx, dy = segments[k].x2 - segments[k].x1, segments[k].y2 - segments[k].y1
        t = min(1.0, max(0.0, -(ax * dx + ay * dy) / (dx * dx + dy * dy)))
        if math.hypot(ax + t * dx, ay + t * dy) < SIGHT_SLACK_M:
            return True
    return False


@kernel
def _is_parted(px: float, py: float, qx: float, qy: float, scene: Scene) -> bool:
    """Return whether a surface lies between two points of surfaces."""
    apart = math.hypot(qx - px, qy - py)
    if apart <= 2.0 * SIGHT_SLACK_M:
        return False
    share = SIGHT_SLACK_M / apart
    from_x, from_y = px + share * (qx - px), py + share * (qy - py)
    return hidden(from_x, from_y, qx, qy, SIGHT_SLACK_M, scene.circles, scene.segments)


@kernel
def _least_over_circle(tx: float, ty: float, lx: float, ly: float, circle: np.record) -> float:
    """Return a length that no way over a circle is shorter than, m; 0 if a sensor lies inside."""
    from_t = math.hypot(tx - circle.x, ty - circle.y) - circle.radius
    from_l = math.hypot(lx - circle.x, ly - circle.y) - circle.radius
    return 0.0 if from_t <= 0.0 or from_l <= 0.0 else from_t + from_l


@kernel
def mirror_on_circle(
    tx: float, ty: float, lx: float, ly: float, cx: float, cy: float, radius: float
) -> tuple[float, float, float]:
    """Return the point of a circle that reflects from one point outside it to another (Alhazen's problem).

    There the angles of incidence and reflection are equal. Their difference grows along the arc that both points see,
    so Newton's method with bisection finds it.

    Parameters
    ----------
    tx, ty, lx, ly
        The two points, m.
    cx, cy, radius
        The circle, m.

    Returns
    -------
    tuple of float
        The reflecting point and the length of the way over it, m; NaN and +inf if the circle lies between the points.
    """
    ax, ay, bx, by = tx - cx, ty - cy, lx - cx, ly - cy
    a, b = math.hypot(ax, ay), math.hypot(bx, by)
    between = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
    way = -1.0 if between < 0.0 else 1.0
    between = abs(between)
    low = max(0.0, between - math.acos(radius / b))
    high = min(between, math.acos(radius / a))
    if low > high:
        return math.nan, math.nan, math.inf
    angle = min(high, max(low, between * (a - radius) / (a + b - 2.0 * radius)))
    for _ in range(64):
        sin_a, cos_a = math.sin(angle), math.cos(angle)
        sin_b, cos_b = math.sin(between - angle), math.cos(between - angle)
        difference = math.atan2(a * sin_a, a * cos_a - radius) - math.atan2(b * sin_b, b * cos_b - radius)
        if difference > 0.0:
            high = angle
        else:
            low = angle
        slope = a * (a - radius * cos_a) / (a * a + radius * radius - 2.0 * a * radius * cos_a)
        slope += b * (b - radius * cos_b) / (b * b + radius * radius - 2.0 * b * radius * cos_b)
        following = angle - difference / slope
        if not low <= following <= high:
            following = 0.5 * (low + high)
        if abs(following - angle) <= 1e-13:
            break
        angle = following
    outward = math.atan2(ay, ax) + way * angle
    px, py = cx + radius * math.cos(outward), cy + radius * math.sin(outward)
    return px, py, math.hypot(px - tx, py - ty) + math.hypot(px - lx, py - ly)


@kernel
def _mirror_on_side(tx: float, ty: float, lx: float, ly: float, side: np.record) -> tuple[float, float, float]:
    """Return the point of a side that reflects from one point to another, and the way's length; NaN, +inf if none."""
    t_along, t_off, l_along, l_off, length = _beside(tx, ty, lx, ly, side)
    if t_off * l_off <= 0.0:
        return math.nan, math.nan, math.inf
    share = (t_along * abs(l_off) + l_along * abs(t_off)) / (abs(t_off) + abs(l_off)) / length
    if not 0.0 <= share <= 1.0:
        return math.nan, math.nan, math.inf
    px, py = side.x1 + share * (side.x2 - side.x1), side.y1 + share * (side.y2 - side.y1)
    return px, py, math.hypot(t_along - l_along, t_off + l_off)


@kernel
def _beside(tx: float, ty: float, lx: float, ly: float, side: np.record) -> tuple[float, float, float, float, float]:
    """Return where two points lie along a side and off it, and its length, m."""
    dx, dy = side.x2 - side.x1, side.y2 - side.y1
    length = math.hypot(dx, dy)
    ux, uy = dx / length, dy / length
    ax, ay, bx, by = tx - side.x1, ty - side.y1, lx - side.x1, ly - side.y1
    return ax * ux + ay * uy, ux * ay - uy * ax, bx * ux + by * uy, ux * by - uy * bx, length


_ROUNDING = 1e-9
"""Slack for points on a beam's edge, as cosine."""


@kernel
def _answers_everywhere(surface: int, model: int) -> bool:
    """Return whether a surface answers from each of its points; to the sound of others, `rays` do as `cone` does."""
    return answers_by(CONE, surface, model) or answers_by(RAYS, surface, model)


@kernel
def _in_both_beams(transmitter: Ear, listener: Ear, model: int, scene: Scene, shortest: float) -> float:
    """Return the shortest way over what answers from each of its points, or `shortest` if that is shorter."""
    tx, ty, lx, ly = transmitter[0], transmitter[1], listener[0], listener[1]
    for k in range(scene.circles.shape[0]):
        circle = scene.circles[k]
        least = _least_over_circle(tx, ty, lx, ly, circle)
        if least >= shortest or not _answers_everywhere(circle.surface, model):
            continue
        if least <= 0.0:
            return 0.0
        px, py, path = _nearest_on_circle(transmitter, listener, circle)
        if path < shortest and _is_seen_by_both(transmitter, listener, px, py, scene):
            shortest = path
    for k in range(scene.segments.shape[0]):
        if not _answers_everywhere(scene.segments[k].surface, model):
            continue
        px, py, path = _nearest_on_side(transmitter, listener, scene.segments[k])
        if path < shortest and _is_seen_by_both(transmitter, listener, px, py, scene):
            shortest = path
    return shortest


@kernel
def _nearest_on_circle(transmitter: Ear, listener: Ear, circle: np.record) -> tuple[float, float, float]:
    """Return the point of a circle in both beams with the shortest way, and that way's length; +inf if none."""
    tx, ty, lx, ly = transmitter[0], transmitter[1], listener[0], listener[1]
    cx, cy, radius = circle.x, circle.y, circle.radius
    px, py, path = mirror_on_circle(tx, ty, lx, ly, cx, cy, radius)
    if math.isinf(path) or _are_in_beams(transmitter, listener, px, py):
        return px, py, path
    path = math.inf
    for edge in range(4):
        sensor = transmitter if edge < 2 else listener
        direction = sensor[2] + (sensor[3] if edge % 2 else -sensor[3])
        ex, ey = math.cos(direction), math.sin(direction)
        along = (cx - sensor[0]) * ex + (cy - sensor[1]) * ey
        off = (cx - sensor[0]) * ey - (cy - sensor[1]) * ex
        if along <= 0.0 or abs(off) > radius:
            continue
        reach = along - math.sqrt(radius * radius - off * off)
        qx, qy = sensor[0] + reach * ex, sensor[1] + reach * ey
        there = math.hypot(qx - tx, qy - ty) + math.hypot(qx - lx, qy - ly)
        # Both see the point if they lie on the outer side of the tangent there.
        t_side = (tx - qx) * (qx - cx) + (ty - qy) * (qy - cy)
        l_side = (lx - qx) * (qx - cx) + (ly - qy) * (qy - cy)
        is_seen = min(t_side, l_side) >= -_ROUNDING
        if there < path and is_seen and _are_in_beams(transmitter, listener, qx, qy):
            px, py, path = qx, qy, there
    return px, py, path


@kernel
def _nearest_on_side(transmitter: Ear, listener: Ear, side: np.record) -> tuple[float, float, float]:
    """Return the point of a side in both beams with the shortest way, and that way's length; +inf if none."""
    tx, ty, lx, ly = transmitter[0], transmitter[1], listener[0], listener[1]
    t_along, t_off, l_along, l_off, length = _beside(tx, ty, lx, ly, side)
    px, py, path = math.nan, math.nan, math.inf
    if t_off * l_off <= 0.0:
        return px, py, path
    x1, y1 = side.x1, side.y1
    dx, dy = side.x2 - x1, side.y2 - y1
    for candidate in range(7):  # the mirror point, both ends, and where the edges of both beams meet the side
        if candidate == 0:
            share = (t_along * abs(l_off) + l_along * abs(t_off)) / (abs(t_off) + abs(l_off)) / length
        elif candidate <= 2:
            share = candidate - 1.0
        else:
            sensor = transmitter if candidate <= 4 else listener
            direction = sensor[2] + (sensor[3] if candidate % 2 else -sensor[3])
            ex, ey = math.cos(direction), math.sin(direction)
            across = ex * dy - ey * dx
            if across == 0.0:
                continue
            share = (ey * (x1 - sensor[0]) - ex * (y1 - sensor[1])) / across
        if not 0.0 <= share <= 1.0:
            continue
        qx, qy = x1 + share * dx, y1 + share * dy
        there = math.hypot(qx - tx, qy - ty) + math.hypot(qx - lx, qy - ly)
        if there < path and _are_in_beams(transmitter, listener, qx, qy):
            px, py, path = qx, qy, there
    return px, py, path


@kernel
def _are_in_beams(transmitter: Ear, listener: Ear, px: float, py: float) -> bool:
    return _is_in_beam(transmitter, px, py, _ROUNDING) and _is_in_beam(listener, px, py, _ROUNDING)


@kernel
def _is_seen_by_both(transmitter: Ear, listener: Ear, px: float, py: float, scene: Scene) -> bool:
    return not _is_out_of_sight(transmitter, px, py, scene) and not _is_out_of_sight(listener, px, py, scene)


@kernel
def _is_out_of_sight(sensor: Ear, px: float, py: float, scene: Scene) -> bool:
    return hidden(sensor[0], sensor[1], px, py, SIGHT_SLACK_M, scene.circles, scene.segments)
