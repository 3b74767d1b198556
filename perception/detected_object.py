"""What perception reports: an object, what it is, and how well that and its place are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class DetectedObject:
    """An object recognised and located, in the odometry's frame."""

    model: str
    """Its label: a model's name; from the Bayesian method also wall, inside corner, edge, post, barrel or unknown."""
    x: float
    """m"""
    y: float
    """m"""
    theta: float
    """rad"""
    sigma: float
    """Standard error of the position, m: along its worst axis, or as the paper's method's residuals have it."""
    support: int
    """The number of outline segments (paper) or raw readings (bayes) that support it."""
    score: float
    """From 0 to 1: the probability that it is what it is called, or the paper's method's goodness of fit."""
    probability: float | None = None
    """That it is what it is called; the paper's method does not know."""
    covariance: tuple[float, float, float] | None = None
    """xx, xy, yy of the position, m²; the paper's method does not know."""
    number: int | None = None
    """By which it is known as long as it is there; none is used twice. Walls have none."""
    confirmed: bool = False
    """A person said that it is there."""
    placed: bool = False
    """A person put it there, and the readings do not bear that out by themselves yet."""


class MapCounts(NamedTuple):
    """The numbers of segments and hypotheses that a method holds."""

    segments: int
    """Outline segments in the map now."""
    segments_total: int
    """Outline segments completed since the start."""
    hypotheses: int
    """Places where an object may be: clusters (paper), or tracks, tentative ones included (bayes)."""
