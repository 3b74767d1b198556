"""Search across the beam for the position of a young circle track.

Observed from one side only, a centre is well determined along the beam and badly across it, and at each position
across the beam other readings count. A fit keeps the readings it started with, and so its errors. Which sensors hear
a body and which do not locates it better across the beam than their ranges do; so a few positions are scored
directly.
"""

from __future__ import annotations

import math

from perception.bayes.circles.alternatives import score
from perception.bayes.memory.parameters import ELSEWHERE_LEAD_NAT, LATERAL_PLACES, LATERAL_STEP_M
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import CircleTrack, StateRecord
from perception.kernel import kernel


@kernel
def mean_hearer(s: StateRecord, p: SettingsRecord, n: int) -> tuple[float, float, int]:
    """Return the mean place of the sensors that hear the circle last predicted for, m, and their number.

    Parameters
    ----------
    s, p
        Memory, whose scratch holds the predictions, and settings.
    n : int
        Number of readings, the first of the scratch.
    """
    readings, predicted = s[0].scratch.readings, s[0].scratch.predicted
    x = 0.0
    y = 0.0
    heard = 0
    for j in range(n):
        if abs(predicted.error[j]) < p[0].gate_m:
            x += readings[j].x
            y += readings[j].y
            heard += 1
    return x / max(heard, 1), y / max(heard, 1), heard


@kernel
def turned(x: float, y: float, dx: float, dy: float, angle: float) -> tuple[float, float]:
    """Return (x, y) plus (dx, dy) turned by an angle, rad."""
    c = math.cos(angle)
    sn = math.sin(angle)
    return x + c * dx - sn * dy, y + sn * dx + c * dy


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
    best = score(s, p, n, track.x, track.y, track.radius) + ELSEWHERE_LEAD_NAT
    x, y, heard = mean_hearer(s, p, n)
    dx = track.x - x
    dy = track.y - y
    d = math.hypot(dx, dy)
    if heard == 0 or d <= track.radius:
        return False
    at = 0
    for k in range(-LATERAL_PLACES, LATERAL_PLACES + 1):
        if k != 0:
            there_x, there_y = turned(x, y, dx, dy, k * LATERAL_STEP_M / d)
            v = score(s, p, n, there_x, there_y, track.radius)
            if v > best:
                best = v
                at = k
    if at == 0:
        return False
    track.x, track.y = turned(x, y, dx, dy, at * LATERAL_STEP_M / d)
    return True
