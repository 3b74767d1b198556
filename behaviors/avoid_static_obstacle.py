"""The avoid-static-obstacle schema (Arkin 1989): every echo repels the robot, more strongly if it is nearer."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from behaviors.response import Response
from config.behaviors import AvoidStaticObstacleConfig
from perception.percept import Floats, Percept

SCHEMA: Final = "avoid_static_obstacle"

UNBOUNDED: Final = 1e6
"""Magnitude inside the safety margin for a gain of one. Arkin's equation gives infinity, but infinities from two
sides add up to NaN. This exceeds every other schema at its largest gain by 10⁴ and keeps its direction."""
CANCELLED: Final = 1e-9
"""A sum shorter than this share of its terms' lengths is what rounding leaves of pushes that cancel."""


def repulsions(gaps_m: Floats, config: AvoidStaticObstacleConfig) -> Floats:
    """Return the magnitude of the repulsion from each obstacle, shape (n,).

    Arkin, *Motor Schema-Based Mobile Robot Navigation*, IJRR 8(4), 1989: 0 for d > S, (S − d)/(S − R)·G for
    R < d ≤ S, and unbounded for d ≤ R.

    Parameters
    ----------
    gaps_m
        d, shape (n,): from the robot's rim to each echo, negative for an echo from inside the rim.
    config
        S is `avoid_obstacle_sphere_m`, R `avoid_obstacle_safety_margin_m`, G `avoid_obstacle_gain`.
    """
    sphere, margin = config.avoid_obstacle_sphere_m, config.avoid_obstacle_safety_margin_m
    # Comparisons with NaN are false, so a NaN distance stays NaN and reaches the arbiter, which stops for it.
    magnitudes = (sphere - gaps_m) / (sphere - margin)
    magnitudes[gaps_m > sphere] = 0.0
    magnitudes[gaps_m <= margin] = UNBOUNDED
    pushes: Floats = config.avoid_obstacle_gain * magnitudes
    return pushes


def avoid_static_obstacle(percept: Percept, body_radius_m: float, config: AvoidStaticObstacleConfig) -> Response:
    """Return the sum of all repulsions, each directly away from its echo.

    With ``summing="largest"`` the sum keeps its direction, and its magnitude is limited to the largest single
    repulsion along that direction: ten echoes of one wall then repel like one wall, and opposite walls still cancel.

    Parameters
    ----------
    percept
        Pose and obstacles; without obstacles the vector is zero.
    body_radius_m
        Distances are measured from the rim, this far from the pose, m.
    config
        The schema's settings.
    """
    if len(percept.obstacles) == 0:
        return Response(SCHEMA, 0.0, 0.0)
    dx = percept.pose.x - percept.obstacles[:, 0]
    dy = percept.pose.y - percept.obstacles[:, 1]
    distances = np.hypot(dx, dy)
    gaps_m, lengths = distances - body_radius_m, distances
    if not distances.all():
        # An echo at the robot's centre has no direction; the robot has just come from behind, so that way is free.
        centred = distances == 0.0
        dx[centred], dy[centred], lengths[centred] = -math.cos(percept.pose.theta), -math.sin(percept.pose.theta), 1.0
    pushes = repulsions(gaps_m, config) / lengths
    px, py = pushes * dx, pushes * dy
    x, y = float(px.sum()), float(py.sum())
    magnitude = math.hypot(x, y)
    # Not `== 0`: that would divide by what rounding leaves of repulsions that cancel.
    if config.summing == "largest" and magnitude > CANCELLED * float(np.hypot(px, py).sum()):
        largest = float((px * (x / magnitude) + py * (y / magnitude)).max())
        shrink = min(1.0, largest / magnitude)
        x, y = x * shrink, y * shrink
    return Response(SCHEMA, x, y)
