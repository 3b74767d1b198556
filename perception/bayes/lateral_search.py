"""Search across the beam for the position of a young circle track.

Observed from one side only, a centre is well determined along the beam and badly across it, and at each position
across the beam other readings count. A fit keeps the readings it started with, and so its errors. Which sensors hear
a body and which do not locates it better across the beam than their ranges do; so a few positions are scored
directly.
"""

from __future__ import annotations

import math

from perception.bayes.alternatives import score
from perception.bayes.cross_path import circle_error
from perception.bayes.parameters import LATERAL_LEAD_NAT, LATERAL_PLACES, LATERAL_STEP_M
from perception.bayes.settings_record import SettingsRecord
from perception.bayes.state import CircleTrack, StateRecord
from perception.kernel import kernel


@kernel
def search_across(s: StateRecord, p: SettingsRecord, track: CircleTrack, n: int) -> bool:
    """Move a track across the beam to the position of greatest likelihood; return whether it moved.

    The positions lie on an arc about the mean of the sensors that hear the track, so that its ranges change as little
    as possible.

    Parameters
    ----------
    s, p
        Memory and settings.
    track : CircleTrack
        Updated.
    n : int
        Number of its readings, the first of the scratch.
    """
    readings = s[0].scratch.readings
    x = 0.0
    y = 0.0
    heard = 0
    for j in range(n):
        q = readings[j]
        dx = track.x - q.x
        dy = track.y - q.y
        if abs(circle_error(q, dx, dy, math.hypot(dx, dy), track.radius)) < p[0].gate_m:
            x += q.x
            y += q.y
            heard += 1
    if heard == 0:
        return False
    x /= heard
    y /= heard
    dx = track.x - x
    dy = track.y - y
    d = math.hypot(dx, dy)
    if d <= track.radius:
        return False
    best = score(s, p, n, track.x, track.y, track.radius) + LATERAL_LEAD_NAT
    at = 0
    for k in range(-LATERAL_PLACES, LATERAL_PLACES + 1):
        if k != 0:
            c = math.cos(k * LATERAL_STEP_M / d)
            sn = math.sin(k * LATERAL_STEP_M / d)
            v = score(s, p, n, x + c * dx - sn * dy, y + sn * dx + c * dy, track.radius)
            if v > best:
                best = v
                at = k
    if at == 0:
        return False
    c = math.cos(at * LATERAL_STEP_M / d)
    sn = math.sin(at * LATERAL_STEP_M / d)
    track.x = x + c * dx - sn * dy
    track.y = y + sn * dx + c * dy
    return True
