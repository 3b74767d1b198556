"""Which raw readings an object keeps, a circle or a polygon: the newest from each direction.

Hits and silences share the bins, so that the readings that found an object are pushed out by those that find it
gone, from wherever one looks again; nothing is dropped for its age. What one direction has to say never crowds out
another, which is what a position needs most.
"""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M
from perception.bayes.state import HK, Settings, State
from perception.kernel import Floats, Ints, kernel

TWO_PI: Final = 2.0 * math.pi
ASIDE_M: Final = 0.02 * FOOT_M
"""A centre this far outside a beam may still move into it while a hypothesis is fitted."""


@kernel
def put(bins: Floats, bn: Ints, t: int, cx: float, cy: float, q: Floats) -> None:
    """Keep reading `q` (x, y, axis, range) of track `t`, whose centre is (cx, cy); its direction's oldest makes room.

    `bins` and `bn` are the circles' or the polygons' of `State`: two arrays and not the whole memory: this is an
    inner loop, and handing over a named tuple of arrays costs more than the work.
    """
    b = int((math.atan2(q[1] - cy, q[0] - cx) / TWO_PI + 0.5) * bins.shape[1]) % bins.shape[1]
    k = bn[t, b] % bins.shape[2]
    bn[t, b] += 1
    for z in range(5):
        bins[t, b, k, z] = q[z]


@kernel
def flatten(bins: Floats, bn: Ints, t: int, w: Floats) -> int:
    """Copy all readings of track `t` to `w`, shape (n, 5), and return how many."""
    n = 0
    for b in range(bins.shape[1]):
        for k in range(min(bn[t, b], bins.shape[2])):
            for q in range(5):
                w[n, q] = bins[t, b, k, q]
            n += 1
    return n


@kernel
def gather(s: State, p: Settings, cx: float, cy: float, rho: float, w: Floats) -> int:
    """Copy to `w` what the sensors remember that bears on a circle, hits and silences; return how many."""
    n = 0
    for i in range(s.hist.shape[0]):
        for k in range(min(s.hn[i], HK)):
            dx = cx - s.hist[i, k, 0]
            dy = cy - s.hist[i, k, 1]
            dot = dx * s.hist[i, k, 2] + dy * s.hist[i, k, 3]
            if dot <= 0.0:
                continue
            d = math.sqrt(dx * dx + dy * dy)
            if dot < p.cos_opt * d - ASIDE_M or d - rho > p.range_max:
                continue
            if n >= w.shape[0] - 64:
                return n
            for q in range(5):
                w[n, q] = s.hist[i, k, q]
            n += 1
    return n
