"""How well one stand can tell an edge, a post and a drum apart: the bound that the times of flight set.

Two bodies of other radii differ by how far the half paths over one differ from those over the other at its
best place. With d the root of the sum of squares of these differences in their standard deviation, the likelihood
ratio errs with probability Φ(−d/2) (Neyman and Pearson), and no rule errs less. n rounds of the pattern make it d√n.
"""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import Final

import numpy as np

from config.robot import RingConfig
from drivers.firing_pattern import LISTENING_LOBE, pattern_pairs
from perception.echo_kind import half_paths_over_circle
from perception.kernel import Floats

SIGMA_M: Final = math.hypot(1e-3, 1e-3 / math.sqrt(12.0))
"""Noise of 1 mm and rounding to 1 mm."""
RANGES_M: Final = (0.5, 0.9, 1.5, 3.0)
"""From the ring to the surface."""
BODIES: Final = {
    "edge, post of 3 cm": (0.0, 0.03), "edge, post of 8 cm": (0.0, 0.08), "edge, drum of 30 cm": (0.0, 0.3),
    "post of 8 cm, drum of 30 cm": (0.08, 0.3),
}  # fmt: skip
RIGHT: Final = 0.98
_STEPS: Final = 12
_DELTA: Final = 1e-6


def audible_pairs(ring: RingConfig, pairs: list[tuple[int, int]], point: complex) -> tuple[np.ndarray, np.ndarray]:
    """Return places of transmitter and listener, complex, m, of the pairs in whose beams a point lies."""
    places = np.array([complex(m.x_m, m.y_m) for m in ring.mounts])
    off = np.abs(np.angle((point - places) * np.exp([-1j * m.angle_rad for m in ring.mounts])))
    half = math.radians(ring.beam_half_angle_deg)
    heard = [(j, i) for j, i in pairs if off[j] <= half and off[i] <= (half if i == j else LISTENING_LOBE * half)]
    rows = np.array(heard, np.int64).reshape(-1, 2)
    return places[rows[:, 0]], places[rows[:, 1]]


def apart(
    firing: np.ndarray, listening: np.ndarray, bearing: float, range_m: float, radius: float, other: float
) -> float:
    """Return d, how far two radii are apart for one look at each pair, the other one at its best place.

    Parameters
    ----------
    firing, listening
        Places of transmitter and listener, complex, m.
    bearing, range_m, radius
        The body: direction and distance of its nearest point from the ring's centre, rad and m, and radius, m.
    other
        The other radius, m.
    """

    def paths(place: Floats, rho: float) -> Floats:
        out = complex(math.cos(place[0]), math.sin(place[0]))
        return half_paths_over_circle(firing, listening, (place[1] + rho) * out, rho)

    truth, place = paths(np.array([bearing, range_m]), radius), np.array([bearing, range_m])
    for _ in range(_STEPS):
        slopes = [
            (paths(place + step, other) - paths(place - step, other)) / (2.0 * _DELTA) for step in _DELTA * np.eye(2)
        ]
        place = place + np.linalg.lstsq(np.stack(slopes, 1), truth - paths(place, other), rcond=None)[0]
    return float(np.linalg.norm(truth - paths(place, other))) / SIGMA_M


def bounds(ring: RingConfig, *, everyone: bool) -> dict[str, dict[str, float]]:
    """Return for pairs of bodies and ranges: looks in a round, least error (%), and rounds until 98 % are right.

    Parameters
    ----------
    ring
        The sensors and their pattern.
    everyone
        Whether all sensors listen to each pulse, in place of those of the pattern.
    """
    count = len(ring.mounts)
    pairs = [(j, i) for j in range(count) for i in range(count)]
    if not everyone:
        pairs = [(i, i) for i in range(count)] + list(pattern_pairs(ring))
    rows = {}
    bearings = np.radians(np.arange(0.0, 15.0, 3.0)) + 0.01
    for name, (radius, other) in BODIES.items():
        for gap in RANGES_M:
            range_m = (ring.radius_m or 0.0) + gap
            stands = [audible_pairs(ring, pairs, complex(range_m * np.exp(1j * b))) for b in bearings]
            d = [apart(*stand, b, range_m, radius, other) for b, stand in zip(bearings, stands, strict=True)]
            squares = float(np.mean(np.square(d)))
            rows[f"{name}, {gap:g} m"] = {
                "looks": float(np.mean([len(t) for t, _ in stands])),
                "d": math.sqrt(squares),
                "error %": 100.0 * float(np.mean([NormalDist().cdf(-0.5 * v) for v in d])),
                "rounds": math.ceil((2.0 * NormalDist().inv_cdf(RIGHT)) ** 2 / squares),
            }
    return rows
