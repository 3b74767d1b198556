"""Slow, readable oracles of when the Bayesian method calls an object by a model's name: plain Python, in metres.

They share no code with the product; constants are repeated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tests.naive_tracks import FT, SILENT, Array


def model_check(own: Array, room: Array, bearings: Array, misses: int) -> tuple[float, int]:
    """Return the lead of the room (nat) over a model, and from how many sides that was heard.

    Each array has a value for each reading in its beam and gate: log ratios of model and room (nat), and direction
    to the centre (rad). One in ten of the others that should have hit is a miss.
    """
    sides = {int(v) % 36 for v in np.floor((bearings[own > 0] / (2.0 * math.pi) + 0.5) * 36)}
    return float((room - own).sum()) - misses * math.log(0.1), len(sides)


def outline_lead(bearings: Array, errors: Array, variances: Array) -> float:
    """Return the lead (nat) of a smooth outline about a circle over the circle, from 36 bearings' mean errors.

    Parameters
    ----------
    bearings, errors, variances
        Direction to the centre (rad), error (m) and its variance (m²) of each reading.
    """
    bins, mean, own = np.floor((bearings / (2.0 * math.pi) + 0.5) * 36).astype(int) % 36, [], []
    used = [b for b in range(36) if (bins == b).sum() >= 3]
    for b in used:
        here, variance = errors[bins == b][:20], variances[bins == b][:20].mean()
        middle, most = np.median(here), 3.0 * math.sqrt(variance)
        mean.append(np.clip(here, middle - most, middle + most).mean())
        own.append(variance / len(here) + 0.005**2)
    if len(used) < 4:
        return 0.0
    turn = np.subtract.outer(used, used) * math.radians(10.0)
    circle, outline = np.diag(own), 0.05**2 * np.exp((np.cos(turn) - 1.0) / 0.45**2) + np.diag(own)
    m, determinants = np.array(mean), [np.linalg.slogdet(v).logabsdet for v in (circle, outline)]
    chi2 = [m @ np.linalg.solve(v, m) for v in (circle, outline)]
    return float(0.5 * (chi2[0] - chi2[1] + determinants[0] - determinants[1]))


def round_lead(w: Array, centre: Array, rho: float, variances: Array) -> float:
    """Return the lead (nat) of a circle of unknown radius over a circle, from readings in its beam and gate.

    Parameters
    ----------
    w, centre, rho, variances
        Readings (n, 5), the circle, and the variance of each range (m²).
    """
    towards = centre - w[:, :2]
    d = np.hypot(*towards.T)
    sigma = np.sqrt(variances)
    error = np.clip(w[:, 4] - (d - rho), -3.0 * sigma, 3.0 * sigma) / sigma
    columns = np.column_stack([towards / d[:, None], -np.ones(len(w))]) / sigma[:, None]
    covariance = np.linalg.inv(columns.T @ columns)
    change, own = float((covariance @ columns.T @ error)[2]), float(covariance[2, 2]) + 0.015**2
    if not 0.015**2 < own <= 0.04**2:
        return 0.0
    return 0.5 * (change**2 / own - change**2 / (own + 0.04) + math.log(own / (own + 0.04)))


def is_doubtful(careful: bool, room_lead: float, outline_lead: float, rivals: Sequence[float], sure: float) -> bool:
    """Return whether a model's checks speak against its name: with a prior of −3 nat it must be `sure`.

    What the mapped room explains is no body, unless the body leads by the prior of one in a known wall, 8 nat.
    """
    best = max(outline_lead, *(rival for rival in rivals if rival != 0.0))
    return room_lead > -8.0 or (careful and 1.0 / (1.0 + math.exp(best + 3.0)) < sure)


def is_called(
    called: bool, established: bool, known: bool, probability: float, sure: float, near: float,
    rivals: Sequence[float], wall: float, dispersion: float, llr: float, unknown: float, variances: Sequence[float],
    compared: bool, standing: bool,
) -> bool:  # fmt: skip
    """Return whether a circle has a model's name, unless it is doubtful: given when sure, kept while likely.

    It is not given before each rival was `compared`. A robot that is `standing` keeps it as long as that is probable.
    """
    share = 1.1 if max(rivals) < -20 else 1.25
    seen_round = dispersion >= 0.008
    possible = established and known and seen_round and llr > share * unknown and max(variances) < (0.17 * FT) ** 2
    needed = near if wall != 0 and wall <= -4 else sure
    if standing and called:
        return established and known and probability >= min(needed, 0.5)
    return possible and ((compared and probability >= needed) or (called and probability >= min(needed, 0.5)))


def without_overlaps(
    t: int, named: Sequence[bool], places: Array, radii: Sequence[float], llr: Sequence[float]
) -> list[bool]:
    """Return which circles are still named: of each two that overlap, one of them `t`, the one of more evidence."""
    left = list(named)
    for k in range(len(left)):
        apart = float(np.hypot(*(places[k] - places[t])))
        if k != t and left[k] and left[t] and apart < radii[k] + radii[t] - 0.1 * FT:
            left[t if llr[k] > llr[t] else k] = False
    return left


def is_sure_polygon(
    established: bool, probability: float, least: float, hits: float, variances: Sequence[float], kept: Array
) -> bool:  # fmt: skip
    """Return whether a polygon is reported by its name: heard from near, and from more than one direction."""
    heard = kept[kept[:, 4] < SILENT]
    if not len(heard) or heard[:, 4].min() > 6.5 * FT:
        return False
    spread = 1 - float(np.hypot(*heard[:, 2:4].mean(0)))
    is_heard = hits >= (12 if len(kept) >= 80 else 20)
    placed = max(variances) <= (0.2 * FT) ** 2
    return established and probability >= least and is_heard and placed and spread > 0.02
