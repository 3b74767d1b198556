"""The avoid-static-obstacle schema (Arkin 1989): every echo repels the robot, more strongly if it is nearer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from behaviors.response import Response
from config.behaviors import AvoidStaticObstacleConfig
from perception.percept import Percept

SCHEMA: Final = "avoid_static_obstacle"

UNBOUNDED: Final = 1e6
"""Magnitude inside the safety margin for a gain of one. Arkin's equation gives infinity, but infinities from two
sides add up to NaN. This exceeds every other schema at its largest gain by 10⁴ and keeps its direction."""
CANCELLED: Final = 1e-9
"""A sum shorter than this share of its terms' lengths is what rounding leaves of pushes that cancel."""


@dataclass(frozen=True, slots=True)
class Zone:
    """Where obstacles push: nearer than `sphere_m` to the rim, and without bound nearer than `margin_m`, m."""

    sphere_m: float
    margin_m: float


def repulsion(gap_m: float, zone: Zone, gain: float) -> float:
    """Return the magnitude of the repulsion from an obstacle.

    Arkin, *Motor Schema-Based Mobile Robot Navigation*, IJRR 8(4), 1989: 0 for d > S, (S − d)/(S − R)·G for
    R < d ≤ S, and unbounded for d ≤ R.

    Parameters
    ----------
    gap_m
        d, from the robot's rim to the echo, negative for an echo from inside the rim.
    zone
        S is its `sphere_m`, R its `margin_m`.
    gain
        G.
    """
    sphere, margin = zone.sphere_m, zone.margin_m
    # Comparisons with NaN are false, so a NaN distance stays NaN and reaches the arbiter, which stops for it.
    if gap_m > sphere:
        return 0.0
    return gain * (UNBOUNDED if gap_m <= margin else (sphere - gap_m) / (sphere - margin))


def avoid_static_obstacle(
    percept: Percept, body_radius_m: float, config: AvoidStaticObstacleConfig, zone: Zone | None = None
) -> Response:
    """Return the sum of all repulsions, each directly away from its echo.

    With ``summing="largest"`` the sum keeps its direction, and its magnitude is limited to the largest single
    repulsion along that direction: ten echoes of one wall then repel like one wall, and opposite walls still cancel.

    Parameters
    ----------
    percept
        Pose and obstacles; without obstacles near it the vector is zero.
    body_radius_m
        Distances are measured from the rim, this far from the pose, m.
    config
        The schema's settings.
    zone
        In place of that of the settings, beside a schema that keeps another distance.
    """
    if zone is None:
        zone = Zone(config.avoid_obstacle_sphere_m, config.avoid_obstacle_safety_margin_m)
    pose, pushes = percept.pose, list[tuple[float, float]]()
    for x, y in percept.obstacles.tolist():  # two dozen: numpy's calls would take longer
        dx, dy = pose.x - x, pose.y - y
        distance = math.hypot(dx, dy)
        push = repulsion(distance - body_radius_m, zone, config.avoid_obstacle_gain)
        if push == 0.0 and distance < math.inf:  # one at infinity has none, and must not go unnoticed
            continue
        if distance == 0.0:
            # An echo at the centre has no direction; the robot has just come from behind, so that way is free.
            dx, dy, distance = -math.cos(pose.theta), -math.sin(pose.theta), 1.0
        pushes.append((push * dx / distance, push * dy / distance))
    x, y = sum(px for px, _ in pushes), sum(py for _, py in pushes)
    magnitude = math.hypot(x, y)
    # Not `== 0`: that would divide by what rounding leaves of repulsions that cancel.
    if config.summing == "largest" and magnitude > CANCELLED * sum(math.hypot(px, py) for px, py in pushes):
        largest = max(px * x + py * y for px, py in pushes) / magnitude
        shrink = min(1.0, largest / magnitude)
        x, y = x * shrink, y * shrink
    return Response(SCHEMA, x, y)
