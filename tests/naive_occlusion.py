"""Which readings of a circle are hidden by others or explained elsewhere, slowly and plainly."""

from __future__ import annotations

import math
from collections.abc import Iterable

from tests.naive_tracks import Array, off_axis


def is_hidden(
    q: Array, centre: Array, rho: float, others: Iterable[tuple[Array, float, float, bool]], gate: float
) -> bool:  # fmt: skip
    """Return whether a reading passed a circle and another circle (centre, radius, σ, kind) stands between."""
    ray = complex(*(centre - q[:2]))
    if abs(ray) <= rho or q[4] - (abs(ray) - rho) <= gate:
        return False
    for place, radius, _, _ in others:
        seen = complex(*(place - q[:2])) / (ray / abs(ray))
        if 0 < seen.real < abs(ray) - rho and abs(seen.imag) < radius:
            return True
    return False


def is_elsewhere(apart: float, rho: float, other: float, is_model: bool, merge: float, gate: float) -> bool:
    """Return whether circles this far apart are two bodies: a rival all but touches what it is a part of."""
    return apart >= merge and (is_model or apart >= rho + other + gate)


def is_explained_elsewhere(
    q: Array, centre: Array, rho: float, others: Iterable[tuple[Array, float, float, bool]], surer: Iterable[bool],
    gate: float, merge: float, opt: float, half_box: float, variance: tuple[float, float],
) -> bool:  # fmt: skip
    """Return whether another body explains a reading with a smaller error, or a surer one at all.

    Each has a place, radius, σ and kind.
    """
    own = q[4] - (math.dist(centre, q[:2]) - rho)
    if own > gate:
        return False
    for (place, radius, sigma, is_model), is_surer in zip(others, surer, strict=True):
        d, ahead = off_axis(q, place)
        error = abs(q[4] - (d - radius))
        tight = half_box + 3.0 * math.sqrt(variance[0] + variance[1] * d**2) + 2.0 * sigma
        if (
            is_elsewhere(math.dist(place, centre), rho, radius, is_model, merge, gate)
            and ahead >= opt * d
            and error < (tight if is_surer else min(abs(own), tight))
        ):
            return True
    return False
