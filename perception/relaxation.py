"""Relaxation: the paper's fourth step (§3.4). Segments attract the sides of the model until it is at rest.

Every outline segment of a cluster attracts every side of the model: it shifts and turns it, more strongly if it is
nearer and more parallel. The model moves by the weighted sum repeatedly until the increment is negligible. It starts
from where it came to rest last time, so a few new segments cost a few iterations.
"""

from __future__ import annotations

import math

from perception.kernel import Floats, Ints, kernel


@kernel
def increment(
    sides: Floats, segments: Floats, members: Ints, gamma: float, x: float, y: float, theta: float
) -> tuple[float, float, float]:
    """Return the total increment of a model's pose: F and τ of the paper (Santamaría & Arkin 1995, §3.4).

    For side i and segment j, with ΔN the perpendicular vector from the side's centre of mass to the line of the
    segment, Δα the angle from side to segment between undirected lines in (−π/2, π/2], sphere = γ · length of i:

    ==========================  =======================================================================
    G_t                         (sphere − ‖ΔN‖) / sphere
    G_r                         (π/2 − ‖Δα‖) / (π/2)
    F_ij, τ_ij                  G_t G_r ΔN and G_t Δα where ‖ΔN‖ < sphere, else zero
    λ_ij                        (sphere − ‖ΔN‖) over its sum over the segments inside the sphere
    F_i, τ_i                    Σ_j λ_ij F_ij and Σ_j λ_ij τ_ij
    μ_i                         segments inside sphere i over the sum of that over all sides
    F, τ                        Σ_i μ_i F_i and Σ_i μ_i τ_i
    ==========================  =======================================================================

    Empty sums are zero.

    Parameters
    ----------
    sides : (m, 4) float
        Middle x, y (m), direction (rad), length (m) of each side in the model's frame.
    segments : (capacity, 5) float
        Outline segments: end points x1, y1, x2, y2 (m), direction of the normal (rad).
    members : (k,) int
        Rows of the segments that attract.
    gamma : float
        γ: radius of a side's sphere of influence over its length.
    x, y, theta : float
        Pose of the model: m, rad.

    Returns
    -------
    (float, float, float)
        Increment in x and y (m) and theta (rad).
    """
    c = math.cos(theta)
    s = math.sin(theta)
    half_pi = 0.5 * math.pi
    total_x = 0.0
    total_y = 0.0
    total_turn = 0.0
    total_near = 0
    for i in range(sides.shape[0]):
        middle_x, middle_y, side_direction, length = sides[i, 0], sides[i, 1], sides[i, 2], sides[i, 3]
        cx = x + c * middle_x - s * middle_y
        cy = y + s * middle_x + c * middle_y
        direction = side_direction + theta
        sphere = gamma * length
        weight = 0.0
        fx = 0.0
        fy = 0.0
        turn = 0.0
        near = 0
        for k in range(members.shape[0]):
            j = members[k]
            start_x, start_y, normal = segments[j, 0], segments[j, 1], segments[j, 4]
            nx = math.cos(normal)
            ny = math.sin(normal)
            offset = nx * (start_x - cx) + ny * (start_y - cy)
            distance = abs(offset)
            if distance >= sphere:
                continue
            da = (normal + half_pi - direction) % math.pi
            if da > half_pi:
                da -= math.pi
            pull = sphere - distance
            g_t = pull / sphere
            g_r = (half_pi - abs(da)) / half_pi
            weight += pull
            fx += pull * g_t * g_r * offset * nx
            fy += pull * g_t * g_r * offset * ny
            turn += pull * g_t * da
            near += 1
        if near > 0:
            total_x += near * fx / weight
            total_y += near * fy / weight
            total_turn += near * turn / weight
            total_near += near
    if total_near == 0:
        return 0.0, 0.0, 0.0
    return total_x / total_near, total_y / total_near, total_turn / total_near


@kernel
def relax(
    sides: Floats,
    segments: Floats,
    members: Ints,
    gamma: float,
    negligible_m: float,
    negligible_rad: float,
    iterations: int,
    pose: Floats,
) -> tuple[int, bool]:
    """Move a model by its total increments until they are negligible; return the iterations and whether it rests.

    Parameters
    ----------
    sides, segments, members, gamma
        As for `increment`.
    negligible_m, negligible_rad : float
        The model is at rest once an increment is below both.
    iterations : int
        Largest number of increments: the bound on the work.
    pose : (3,) float
        x, y (m), theta (rad). Updated.

    Returns
    -------
    (int, bool)
        Increments applied, and whether the model is at rest.
    """
    for n in range(iterations):
        dx, dy, turn = increment(sides, segments, members, gamma, pose[0], pose[1], pose[2])
        pose[0] += dx
        pose[1] += dy
        pose[2] += turn
        if math.hypot(dx, dy) < negligible_m and abs(turn) < negligible_rad:
            return n + 1, True
    return iterations, False
