"""The results of perception: detected objects with their uncertainty, and counts of what a method holds.

The process that draws the live view imports this module, so it imports nothing that takes long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from drivers.messages import Pose


@dataclass(frozen=True, slots=True)
class DetectedObject:
    """An object that was recognised and located, in the odometry's frame."""

    model: str
    """Label: a model's name; from the Bayesian method also wall, inside corner, edge, post, barrel or unknown."""
    x: float
    """m"""
    y: float
    """m"""
    theta: float
    """rad"""
    sigma: float
    """Standard error of the position along its worst axis, m; from the paper's method, that of the residuals."""
    support: int
    """The number of outline segments (paper) or raw readings (bayes) that support it."""
    score: float
    """From 0 to 1: the label's probability (bayes) or the goodness of fit (paper)."""
    probability: float | None = None
    """Probability of the label; None from the paper's method."""
    covariance: tuple[float, float, float] | None = None
    """xx, xy, yy of the position, m²; None from the paper's method. Along a wall it is that of an even distribution
    over its length, a twelfth of the length squared."""
    number: int | None = None
    """The object's number for as long as it exists; numbers are never reused. Each piece of a wall between openings
    has one, which it keeps as it grows; where two pieces become one, it is the older. None for corners of a room."""
    confirmed: bool = False
    """A user confirmed it."""
    placed: bool = False
    """A user placed it, and the readings alone do not support it yet."""
    sigma_theta: float | None = None
    """Standard error of `theta`, rad; None for what has no heading, and where only a user gave it."""

    @property
    def ends(self) -> tuple[float, float, float, float] | None:
        """Ends x, y, x, y of a wall, m; None for all others."""
        if self.model != "wall" or self.covariance is None:
            return None
        xx, xy, yy = self.covariance
        tx, ty = math.cos(self.theta), math.sin(self.theta)
        half = 0.5 * math.sqrt(12.0 * (tx * tx * xx + 2.0 * tx * ty * xy + ty * ty * yy))
        return self.x - half * tx, self.y - half * ty, self.x + half * tx, self.y + half * ty


def worst_sigma(xx: float, xy: float, yy: float) -> float:
    """Return the standard deviation along a covariance's longest axis, m: the root of the greatest eigenvalue.

    Parameters
    ----------
    xx, xy, yy : float
        The covariance, m².
    """
    middle = 0.5 * (xx + yy)
    return math.sqrt(max(0.0, middle + math.hypot(0.5 * (xx - yy), xy)))


def wall_between(
    ends: tuple[float, float, float, float],
    variance_across: float,
    variance_turn: float,
    echoes: int,
    log_odds: float,
    number: int | None = None,
) -> DetectedObject:
    """Return a wall as a detected object: its middle and direction; its length is in the covariance.

    Parameters
    ----------
    ends : tuple of float
        x, y, x, y, m.
    variance_across, variance_turn : float
        Of its middle across the wall, m², and of its direction, rad².
    echoes : int
        Echoes that support it.
    log_odds : float
        That it is a wall, nat.
    number : int, optional
        The object's.
    """
    x1, y1, x2, y2 = ends
    length = math.hypot(x2 - x1, y2 - y1) or 1.0  # 0 in a damaged recording
    tx, ty = (x2 - x1) / length, (y2 - y1) / length
    along = length * length / 12.0
    across = variance_across + along * variance_turn
    xx, yy, xy = tx * tx * along + ty * ty * across, ty * ty * along + tx * tx * across, tx * ty * (along - across)
    probability = 1.0 / (1.0 + math.exp(-log_odds))
    return DetectedObject(
        "wall",
        0.5 * (x1 + x2),
        0.5 * (y1 + y2),
        math.atan2(ty, tx),
        worst_sigma(xx, xy, yy),
        echoes,
        probability,
        probability,
        (xx, xy, yy),
        number,
        sigma_theta=math.sqrt(variance_turn),
    )


class MapCounts(NamedTuple):
    """The numbers of segments and hypotheses that a method holds."""

    segments: int
    """Outline segments in the map now."""
    segments_total: int
    """Outline segments completed since the start."""
    hypotheses: int
    """Places where an object may be: clusters (paper), or tracks near the robot, tentative ones included (bayes)."""
    archived: int = 0
    """Objects that the robot has left behind."""
    waiting: int = 0
    """Of these, objects near the robot for which the arrays have no room."""


def turned_object(to: Pose, seen: DetectedObject) -> DetectedObject:
    """Return an object in another frame, in which the present origin lies at `to`."""
    if (to.x, to.y, to.theta) == (0.0, 0.0, 0.0):
        return seen
    place = to.compose(replace(to, x=seen.x, y=seen.y, theta=seen.theta))
    if seen.covariance is None:
        return replace(seen, x=place.x, y=place.y, theta=place.theta)
    xx, xy, yy = seen.covariance
    c, s = math.cos(to.theta), math.sin(to.theta)
    both = 2.0 * c * s * xy
    covariance = (
        c * c * xx - both + s * s * yy,
        c * s * (xx - yy) + (c * c - s * s) * xy,
        s * s * xx + both + c * c * yy,
    )
    return replace(seen, x=place.x, y=place.y, theta=place.theta, covariance=covariance)
