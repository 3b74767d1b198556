"""Which raw readings say anything for or against a polygon, and what the sensors remember of them."""

from __future__ import annotations

import math

from perception.bayes.state import HK
from perception.kernel import Floats, Ints, kernel


@kernel
def bears(
    qx: float, qy: float, ux: float, uy: float, r: float, cx: float, cy: float, bound: float, cos_half: float,
    sin_half: float, gate: float, reach: float,
) -> bool:  # fmt: skip
    """Tell whether a reading says anything for or against a body within a circle.

    Parameters
    ----------
    qx, qy, ux, uy, r : float
        The reading: place (m), unit axis, range (m).
    cx, cy, bound : float
        Centre and radius of the circle, m.
    cos_half, sin_half : float
        Of half the beam's opening.
    gate : float
        A range that ends farther than this before the circle says nothing, m.
    reach : float
        Nor does a sensor farther off than this, m.
    """
    dx = cx - qx
    dy = cy - qy
    dot = dx * ux + dy * uy
    if dot <= 0.0 or dot > reach:
        return False
    # by how much the centre lies outside the nearer edge of the beam
    if abs(dx * uy - dy * ux) * cos_half - dot * sin_half > bound:
        return False
    d = math.sqrt(dx * dx + dy * dy)
    return d <= reach and r >= d - bound - gate


@kernel
def collect(
    hist: Floats, hn: Ints, cx: float, cy: float, bound: float, cos_half: float, sin_half: float, gate: float,
    reach: float, w: Floats,
) -> int:  # fmt: skip
    """Copy to `w` what the sensors remember that `bears` on a circle; return how many."""
    n = 0
    for i in range(hist.shape[0]):
        for k in range(min(hn[i], HK)):
            h = hist[i, k]
            if bears(h[0], h[1], h[2], h[3], h[4], cx, cy, bound, cos_half, sin_half, gate, reach):
                if n >= w.shape[0]:
                    return n
                for z in range(5):
                    w[n, z] = h[z]
                n += 1
    return n
