"""Which readings bear on an object at all, seeing what else is known to stand there.

Two things that a body cannot help are left out before it is judged. What hides it: a known body between a sensor and
it swallows the way there and back, though its own surface may look elsewhere and answer nothing, so that silence from
behind it says nothing. And what another object explains better: a row of drums has one tangent, and a drum is hidden
by the one before it, so with the echoes of that one in the sum a wall along all of them wins.
"""

from __future__ import annotations

import math

from perception.bayes.noise_estimation import noise_variance, reach_of
from perception.bayes.state import ESTABLISHED, KIND, R00, ST, TRHO, TX, TY, Settings, State
from perception.kernel import Floats, kernel


@kernel
def is_hidden(s: State, x: float, y: float, cx: float, cy: float, d: float, rho: float, own: int) -> bool:
    """Tell whether an established circle, `own` apart, lies on the way from (x, y) to a circle about (cx, cy)."""
    ux = (cx - x) / d
    uy = (cy - y) / d
    for t in range(s.ti.shape[0]):
        if s.ti[t, ST] != ESTABLISHED or t == own:
            continue
        dx = s.tf[t, TX] - x
        dy = s.tf[t, TY] - y
        if 0.0 < dx * ux + dy * uy < d - rho and abs(dx * uy - dy * ux) < s.tf[t, TRHO]:
            return True
    return False


@kernel
def is_anothers(
    s: State, p: Settings, q: Floats, cx: float, cy: float, off: float, own: int, var0: float, rel2: float
) -> bool:
    """Tell whether an established circle elsewhere explains reading `q`, and better than by `off`."""
    for t in range(s.ti.shape[0]):
        if s.ti[t, ST] != ESTABLISHED or t == own or (p.polys > 0 and s.ti[t, KIND] >= p.models):
            continue
        if math.hypot(s.tf[t, TX] - cx, s.tf[t, TY] - cy) < p.merge:
            continue
        dx = s.tf[t, TX] - q[0]
        dy = s.tf[t, TY] - q[1]
        d = math.sqrt(dx * dx + dy * dy)
        e = abs(q[4] - (d - s.tf[t, TRHO]))
        tight = reach_of(p.half_box, var0 + rel2 * d * d) + 2.0 * s.tf[t, R00]
        if dx * q[2] + dy * q[3] >= p.cos_opt * d and e < min(off, tight):
            return True
    return False


@kernel
def speaks(
    s: State, p: Settings, q: Floats, cx: float, cy: float, rho: float, own: int, var0: float, rel2: float
) -> bool:  # fmt: skip
    """Tell whether reading `q` can speak of a circle: nothing hides it, and nobody explains the reading better."""
    d = math.hypot(cx - q[0], cy - q[1])
    e = q[4] - (d - rho)
    if e > p.gate:
        return not (d > rho and is_hidden(s, q[0], q[1], cx, cy, d, rho, own))
    return not is_anothers(s, p, q, cx, cy, abs(e), own, var0, rel2)


@kernel
def audible(s: State, p: Settings, n: int, cx: float, cy: float, rho: float, own: int) -> int:
    """Leave out of the `n` readings in `s.w` what cannot speak of a circle; return how many remain.

    Parameters
    ----------
    s, p
        Memory, of which `s.w` is packed anew, and settings.
    n : int
        Readings.
    cx, cy, rho : float
        Centre and radius, m.
    own : int
        The circle's track; −1 where it is none yet.
    """
    var0, rel2 = noise_variance(s, p)
    kept = 0
    for j in range(n):
        q = s.w[j]
        if speaks(s, p, q, cx, cy, rho, own, var0, rel2):
            if kept != j:
                for z in range(5):
                    s.w[kept, z] = q[z]
            kept += 1
    return kept
