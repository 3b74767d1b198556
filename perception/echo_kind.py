"""What kind of surface one stand of the ring hears, and where: by the times of flight over it alone.

A sensor's own echo gives a range; the path of its pulse to a second sensor gives the bearing, and its length differs
by the kind of surface. With own ranges a and b of two sensors L apart, the path X between them is (after Barshan and
Kuc 1990, Kleeman and Kuc 1995)

    plane                 X² = 4ab + L²
    right-angled corner   X² = 2(a² + b²) − L²
    edge                  X = a + b
    cylinder              between edge and plane, by its radius

Each kind is fitted to all readings at once by its bearing and range from the ring's centre. Its evidence is the
likelihood at the best fit times the width of the posterior there (Laplace). A cylinder's radius is summed over a
grid. Kinds that the readings do not tell apart stay undecided: `EchoKind.kind` then says so.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np

from perception.kernel import Floats
from perception.shared_numbers import CERTAIN_PROBABILITY

Kind: TypeAlias = Literal["plane", "corner", "edge", "cylinder"]
KINDS: Final[tuple[Kind, ...]] = ("plane", "corner", "edge", "cylinder")
RADII_M: Final = (0.03, 0.06, 0.12, 0.2, 0.3, 0.45)
"""Radii of a cylinder, equally probable."""
_STARTS: Final = np.radians(np.arange(-24.0, 24.1, 6.0))
"""Bearings beside that of the nearest reading from which a fit may start."""
_STEPS_MAX: Final = 12
"""Steps of a fit, at most."""
_DELTA: Final = 1e-5
"""Step of the derivatives, m and rad."""


class EchoKind(NamedTuple):
    """A surface as one stand hears it."""

    bearing: float
    range_m: float
    """Direction and distance of its nearest point from the ring's centre in the ring's frame, rad and m, of the most
    probable kind; a corner's are those of its vertex."""
    sigma_bearing: float
    sigma_range_m: float
    """Their standard deviations under that kind."""
    probabilities: tuple[float, float, float, float]
    """Of `KINDS`, in their order."""
    radius_m: float
    """A cylinder's expected radius, m."""
    misfit: float
    """Mean square of the residuals under the best kind, in their variance: about 1 if it is one surface of a kind
    known here."""

    @property
    def kind(self) -> Kind | Literal["convex", "unknown"]:
        """The kind, if the readings tell it; `convex` if it is an edge or a cylinder but not which; or `unknown`."""
        for kind, probability in zip(KINDS, self.probabilities, strict=True):
            if probability >= CERTAIN_PROBABILITY:
                return kind
        return "convex" if self.probabilities[2] + self.probabilities[3] >= CERTAIN_PROBABILITY else "unknown"


def echo_kind(
    emitters: Floats, listeners: Floats, half_paths_m: Floats, noise_m: float, resolution_m: float = 0.0
) -> EchoKind | None:
    """Return kind and place of the surface that all these readings come from; None with fewer than three paths.

    Readings of one path are averaged: their noise is independent, their rounding is not.

    Parameters
    ----------
    emitters, listeners
        Places of the sensors in the ring's frame, shape (n, 2), m; of an own echo both are the same.
    half_paths_m
        Half of each path, shape (n,), m, finite; a range is that of an own echo.
    noise_m
        Standard deviation of a half path's noise, m.
    resolution_m
        Step to which half paths are rounded, m.

    Raises
    ------
    ValueError
        The arrays do not belong together, or there is neither noise nor rounding.
    """
    n = len(half_paths_m)
    if emitters.shape != (n, 2) or listeners.shape != (n, 2) or not np.isfinite(half_paths_m).all():
        raise ValueError(f"places of shape {emitters.shape} and {listeners.shape} for {n} finite half paths")
    if not math.hypot(noise_m, resolution_m) > 0.0:
        raise ValueError(f"noise_m is {noise_m!r} and resolution_m {resolution_m!r}, expected a positive length")
    pairs, path, times = np.unique(np.hstack((emitters, listeners)), axis=0, return_inverse=True, return_counts=True)
    n = len(pairs)
    if n < 3:  # bearing and range take two
        return None
    half_paths_m = np.bincount(path.ravel(), half_paths_m) / times
    sigma_m = np.sqrt(noise_m**2 / times + resolution_m**2 / 12.0)
    t, listener = pairs[:, :2] @ [1.0, 1j], pairs[:, 2:] @ [1.0, 1j]
    hypotheses: list[tuple[Kind, float]] = [("plane", math.inf), ("corner", 0.0), ("edge", 0.0)]
    hypotheses += [("cylinder", radius_m) for radius_m in RADII_M]
    fits = [
        _fit(_path_function(kind, radius_m, t, listener), t, half_paths_m, sigma_m) for kind, radius_m in hypotheses
    ]
    evidence = np.array([fit.evidence for fit in fits])
    evidence[3:] -= math.log(len(RADII_M))
    weights = np.exp(evidence - evidence.max())
    weights /= weights.sum()
    best = fits[int(np.argmax(weights))]
    round_share = float(weights[3:].sum())
    radius_m = float(weights[3:] @ RADII_M) / round_share if round_share > 0.0 else math.nan
    probabilities = (float(weights[0]), float(weights[1]), float(weights[2]), round_share)
    return EchoKind(
        best.bearing, best.range_m, best.sigma_bearing, best.sigma_range_m, probabilities, radius_m, best.cost / n
    )


Paths: TypeAlias = Callable[[float, float], Floats]
"""Half paths for a bearing and a range, shape (n,)."""


def _path_function(kind: Kind, radius_m: float, t: np.ndarray, listener: np.ndarray) -> Paths:
    """Return the half paths of a kind as a function of its bearing and range; places are complex numbers."""

    def paths(bearing: float, range_m: float) -> Floats:
        """Return the half paths, m, over a surface whose nearest point is there; see the module's formulas."""
        out = complex(math.cos(bearing), math.sin(bearing))
        if kind == "plane":
            beyond = 2.0 * range_m - 2.0 * (listener * out.conjugate()).real
            return np.asarray(0.5 * abs(listener + beyond * out - t))
        if kind == "corner":
            return np.asarray(abs(range_m * out - 0.5 * (t + listener)))
        if kind == "edge":
            return np.asarray(0.5 * (abs(range_m * out - t) + abs(range_m * out - listener)))
        return half_paths_over_circle(t, listener, (range_m + radius_m) * out, radius_m)

    return paths


def half_paths_over_circle(t: np.ndarray, listener: np.ndarray, centre: complex, radius_m: float) -> Floats:
    """Return half the shortest way over a circle between pairs of points outside it (Alhazen's problem).

    Parameters
    ----------
    t, listener
        The points as complex numbers, shape (n,), m.
    centre, radius_m
        The circle, m.

    Returns
    -------
    (n,) float
        Where the circle parts the points, the way over the point that is least wrong.
    """
    a, b = t - centre, listener - centre
    from_t, from_l = np.maximum(abs(a), radius_m), np.maximum(abs(b), radius_m)
    between = np.abs(np.angle(b * a.conj()))
    turned = np.where(np.angle(b * a.conj()) < 0.0, -1.0, 1.0)
    angle = between * (from_t - radius_m + 1e-12) / (from_t + from_l - 2.0 * radius_m + 2e-12)
    for _ in range(6):  # the angles of incidence and reflection become equal; the way is stationary there
        rest = between - angle
        difference = np.arctan2(from_t * np.sin(angle), from_t * np.cos(angle) - radius_m)
        difference -= np.arctan2(from_l * np.sin(rest), from_l * np.cos(rest) - radius_m)
        slope = np.zeros(len(angle))
        for away, at in ((from_t, angle), (from_l, rest)):
            squared = away**2 + radius_m**2 - 2.0 * away * radius_m * np.cos(at)
            slope = slope + away * (away - radius_m * np.cos(at)) / np.maximum(squared, 1e-12)
        angle = np.clip(angle - difference / np.maximum(slope, 1e-12), 0.0, between)
    point = radius_m * a / np.maximum(abs(a), 1e-12) * np.exp(1j * turned * angle)
    return np.asarray(0.5 * (abs(a - point) + abs(b - point)))


class _Fit(NamedTuple):
    bearing: float
    range_m: float
    sigma_bearing: float
    sigma_range_m: float
    cost: float
    evidence: float


def _fit(paths: Paths, t: np.ndarray, half_paths_m: Floats, sigma_m: Floats) -> _Fit:
    """Return the best bearing and range of a kind, and the logarithm of its evidence but for what all kinds share."""

    def residuals(place: Floats) -> Floats:
        return (half_paths_m - paths(float(place[0]), float(place[1]))) / sigma_m

    nearest = int(np.argmin(half_paths_m))
    place, cost = np.zeros(2), math.inf
    for start in float(np.angle(t[nearest])) + _STARTS:
        trial = np.array([start, abs(t[nearest]) + half_paths_m[nearest]])
        trial[1] += float((sigma_m * residuals(trial)).mean())  # a longer range lengthens every path about as much
        if (tried := float(residuals(trial) @ residuals(trial))) < cost:
            place, cost = trial, tried
    damping = 1e-3
    for _ in range(_STEPS_MAX):
        jacobian = np.stack(
            [(residuals(place - step) - residuals(place + step)) / (2.0 * _DELTA) for step in _DELTA * np.eye(2)], 1
        )
        hessian = jacobian.T @ jacobian
        step = np.linalg.solve(hessian + damping * np.diag(np.diag(hessian)), jacobian.T @ residuals(place))
        trial = place + step
        tried = float(residuals(trial) @ residuals(trial))
        if tried < cost:
            gained, place, cost, damping = cost - tried, trial, tried, 0.1 * damping
            if gained < 1e-9 * (1.0 + cost):
                break
        else:
            damping *= 10.0
    covariance = np.linalg.inv(hessian + 1e-12 * np.eye(2))
    width = 0.5 * math.log(max(float(np.linalg.det(covariance)), 1e-300))
    return _Fit(
        math.remainder(float(place[0]), 2.0 * math.pi),
        float(place[1]),
        math.sqrt(covariance[0, 0]),
        math.sqrt(covariance[1, 1]),
        cost,
        -0.5 * cost + width,
    )
