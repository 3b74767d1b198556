"""The test of whether a ring replays a sequence of old readings: each changes, but as another one did before.

Noise and motion leave no two parts of a drive with the same ranges to the bit. For each lag, in looks of a
sensor, the readings of all sensors are compared with those of that lag before: a sequential test as those of
`perception.ring_faults.motion_tests`. Only what changed since the look before counts, where the sensor has moved or
turned since the older look: a robot at a standstill, and a wall along the path, repeat readings honestly.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from perception.kernel import Floats, Ints, kernel
from perception.ring_faults.memory import Look, Reception
from perception.ring_faults.repeats import STEP_MIN_M

PAST_LOOKS: Final = 64
"""Looks of each sensor that are kept: 10 to 25 s of the shipped rings."""
PAST_FIELDS: Final = 4
"""Range (m; below zero without an echo), place x, y (m) and direction (rad) of a look."""
DIFFERS: Final = 0.05
"""Share of a replay's readings that differ from those of the lag before, as where it begins anew."""


class PastLooks(NamedTuple):
    """The last looks of each sensor, and how far the ring repeats them."""

    looks: Floats
    """(n, PAST_LOOKS, PAST_FIELDS): the looks, the oldest overwritten first."""
    counts: Ints
    """(n,): looks of each sensor so far."""
    replayed_nat: Floats
    """(PAST_LOOKS,): evidence that the ring replays what it heard so many looks before."""


@kernel
def weigh_replay(i: int, look: Look, before: float, reception: Reception, past: PastLooks) -> float:
    """Compare a reading with those of each lag before, and keep it; return the greatest evidence of a lag, nat.

    Two readings of a range that varies by Δ from look to look are equal to within the tolerance with a probability
    of some tolerance/(tolerance + Δ).

    Parameters
    ----------
    i : int
        The sensor.
    look : Look
        Its reading, place and direction.
    before : float
        The reading before, m; below zero without an echo.
    reception : Reception
        What the ring hears.
    past : PastLooks
        The last looks of each sensor, and the evidence of each lag. Updated.
    """
    kept, counts, replayed_nat = past
    r, x, y, axis = look
    half_angle, tolerance, _ = reception
    size = kept.shape[1]
    is_new = r >= 0.0 and before >= 0.0 and r != before
    chance = tolerance / (tolerance + abs(r - before)) if is_new else 0.0
    differs = math.log(DIFFERS / max(1.0 - chance, DIFFERS))
    most = 0.0
    for lag in range(2, min(counts[i] + 1, size)):
        k = (counts[i] - lag) % size
        if r != kept[i, k, 0]:
            replayed_nat[lag] = max(0.0, replayed_nat[lag] + differs)
        elif is_new:
            moved = math.hypot(x - kept[i, k, 1], y - kept[i, k, 2])
            if moved > max(STEP_MIN_M, 3.0 * tolerance) or abs(axis - kept[i, k, 3]) > half_angle:
                replayed_nat[lag] -= math.log(chance)
        most = max(most, replayed_nat[lag])
    k = counts[i] % size
    kept[i, k, 0], kept[i, k, 1], kept[i, k, 2], kept[i, k, 3] = r, x, y, axis
    counts[i] += 1
    return most
