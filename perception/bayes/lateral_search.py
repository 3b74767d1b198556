"""Which of several places a young circle is at: where the raw readings count for most, not where a fit began.

Seen from one side only, a centre is known well along the beam and badly across it, and each place across has other
readings in its beam: a fit keeps the readings it began with, and so its mistakes. Which sensors hear a body and which
do not places it better across than all their ranges do; so a few places across are scored as they are.
"""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M
from perception.bayes.alternatives import score
from perception.bayes.state import TRHO, TX, TY, Settings, State
from perception.kernel import kernel

ACROSS: Final = 3
ACROSS_M: Final = 0.12 * FOOT_M
"""So many places on either side, so far apart: half a foot, a beam's edge at two and a half feet."""
LEAD: Final = 1.0
"""Another place must lead by this, nat: less is chance."""


@kernel
def seek(s: State, p: Settings, t: int, n: int) -> bool:
    """Move track `t`, whose `n` readings lie in `s.w`, across the beam to where they say most; tell whether it moved.

    The places lie on an arc about the mean of the sensors that hear it, so that its ranges change as little as
    possible.
    """
    track = s.tf[t]
    x = 0.0
    y = 0.0
    heard = 0
    for j in range(n):
        if abs(s.w[j, 4] - (math.hypot(track[TX] - s.w[j, 0], track[TY] - s.w[j, 1]) - track[TRHO])) < p.gate:
            x += s.w[j, 0]
            y += s.w[j, 1]
            heard += 1
    if heard == 0:
        return False
    x /= heard
    y /= heard
    dx = track[TX] - x
    dy = track[TY] - y
    d = math.hypot(dx, dy)
    if d <= track[TRHO]:
        return False
    best = score(s, p, n, track[TX], track[TY], track[TRHO]) + LEAD
    at = 0
    for k in range(-ACROSS, ACROSS + 1):
        if k != 0:
            c = math.cos(k * ACROSS_M / d)
            sn = math.sin(k * ACROSS_M / d)
            v = score(s, p, n, x + c * dx - sn * dy, y + sn * dx + c * dy, track[TRHO])
            if v > best:
                best = v
                at = k
    if at == 0:
        return False
    c = math.cos(at * ACROSS_M / d)
    sn = math.sin(at * ACROSS_M / d)
    track[TX] = x + c * dx - sn * dy
    track[TY] = y + sn * dx + c * dy
    return True
