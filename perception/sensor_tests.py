"""What is held against a sensor, reading by reading: the kernels behind `perception.sensor_monitor`.

Each test asks what an honest sensor would have had to read by now, and needs more than one witness: the way the base
has come, what the neighbours read meanwhile, and the rest of the ring.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.kernel import Floats, Ints, kernel
from perception.sensor_report import CROSSTALK, FAILING, SILENT, STUCK

SETS: Final = 32
"""Sets of sensors told apart; a pattern has at most 24."""
TOWARDS_M: Final = 1.0
"""So far must the base have come towards whatever mirrors the beam, whichever way in it that is."""
PAST_M: Final = 2.0
"""Or so far in all, while the neighbours saw things come and go."""
SILENT_M: Final = 5.0
"""And so far for a silence: empty space is common."""
HEARD_SHARE: Final = 0.5
"""So many near echoes must either neighbour hear, for each silence."""
READINGS: Final = 20
"""Fewer equal readings are chance."""
PAST_READINGS: Final = 40
CHANGES: Final = 4
"""So often must the reading of either neighbour have changed meanwhile, or, where only passing by is held against a
sensor, have leapt: a rough wall along the way answers all that look at it with equal readings for ever."""
PAST_CHANGES: Final = 20
"""Or have changed so often: nothing that both of them see is a wall along the way."""
LEAP_M: Final = 0.3
SHORT_M: Final = 0.15
"""A reading is short where it is by this less than those before and after it,"""
SHORT_SHARE: Final = 0.05
"""and by this share of them."""
LATELY: Final = 0.05
"""The weight of the newest firing in how regular the sets are."""
REGULAR_MIN: Final = 0.8
"""Sets that do not come again and again are no pattern, and nothing is held against them."""
SHORTS: Final = 8.0
"""So many short readings, each other one counting two off, are crosstalk."""
RETURNS: Final = 5
"""So many readings off its old one bring a stuck sensor back."""
FAILURES: Final = 72
"""So many firings of the ring without a reading: three rounds of the longest pattern."""

# Columns of a sensor's memory. Readings so far, the last two and the sets they were fired in; changes of the reading,
# leaps, and near echoes; firings of the ring since the last reading.
EVER, R1, R2, S1, S2, STEPS, LEAPS, ECHOES, MISSED = range(9)
# The run of equal readings: of which, since which firing, where and which way it began, how many.
RUN, SINCE, X, Y, YAW, COUNT = range(9, 15)
# Of either neighbour, `STEPS`, `LEAPS` and `ECHOES` when it began.
THEN: Final = 15
# What the sensor is stuck at, and how many readings in a row were off that.
AT, OFF = 21, 22
# Where the ring was at the last reading.
X1, Y1 = 23, 24
COLUMNS: Final = 25
# Cells of the ring's own memory: firings, sets ever known, place of the last firing, and how regular the sets are:
# the share of firings, of late, whose set was known.
FIRINGS, KNOWN, LAST_X, LAST_Y, REGULAR = range(5)
RING: Final = 5
# What a firing may bring: another verdict on a sensor, ranges that are not believed, ranges that are masked.
CHANGED, LESS_BELIEVED, LESS_POSSIBLE = 1, 2, 4


@kernel
def set_of(ranges: Floats, sets: NDArray[np.uint8], shorts: Floats, crossed: NDArray[np.uint8], ring: Floats) -> int:
    """Return the number of the set of sensors that fired; a new one takes the oldest's place where all are taken."""
    known = int(ring[KNOWN])
    k: int
    for k in range(min(known, sets.shape[0])):
        same = True
        for i in range(ranges.shape[0]):
            if (sets[k, i] == 1) == math.isnan(ranges[i]):
                same = False
                break
        if same:
            ring[REGULAR] += LATELY * (1.0 - ring[REGULAR])
            return k
    ring[REGULAR] -= LATELY * ring[REGULAR]
    k = known % sets.shape[0]
    for i in range(ranges.shape[0]):
        sets[k, i] = 0 if math.isnan(ranges[i]) else 1
        shorts[i, k] = 0.0
        crossed[i, k] = 0
    ring[KNOWN] += 1.0
    return k


@kernel
def begin_run(i: int, r: float, x: float, y: float, yaw: float, sides: Ints, memory: Floats) -> None:
    """Let a run of equal readings begin here."""
    c = memory[i]
    c[RUN], c[X], c[Y], c[YAW], c[COUNT] = r, x, y, yaw, 1.0
    for side in range(2):
        for k in range(3):
            c[THEN + 3 * side + k] = memory[sides[i, side], STEPS + k]


@kernel
def since(i: int, what: int, sides: Ints, memory: Floats, deaf: bool) -> float:
    """Return how many `what` either neighbour has had since the run of equal readings began; none without both.

    Where `deaf`, one that hears nothing now is left out of it.
    """
    least = math.inf
    for side in range(2):
        k = sides[i, side]
        if k < 0:
            return 0.0
        if not (deaf and math.isinf(memory[k, R1])):
            least = min(least, memory[k, what] - memory[i, THEN + 3 * side + what - STEPS])
    return least if math.isfinite(least) else 0.0


@kernel
def others_changed(i: int, memory: Floats, faults: Ints) -> bool:
    """Tell whether most other sensors that hear something have read something new since this one's run began."""
    changed = 0
    all_of_them = 0
    for k in range(memory.shape[0]):
        if k != i and memory[k, EVER] > 0.0 and math.isfinite(memory[k, R1]) and faults[k] & STUCK == 0:
            all_of_them += 1
            if memory[k, SINCE] > memory[i, SINCE]:
                changed += 1
    return bool(changed >= 2 and 2 * changed >= all_of_them)


@kernel
def is_stuck(
    i: int, x: float, y: float, axis: float, half_angle: float, sides: Ints, memory: Floats, faults: Ints
) -> bool:
    """Tell whether a sensor should have read something else by now.

    A surface whose normal lies within ±β of the axis comes nearer by d·cos(ψ ∓ β) at least, if the base moves by d at
    ψ to the axis: by d·cos ψ·cos β − d·sin ψ·sin β.
    """
    c = memory[i]
    dx, dy = x - c[X], y - c[Y]
    along = abs(dx * math.cos(axis) + dy * math.sin(axis))
    across = abs(dy * math.cos(axis) - dx * math.sin(axis))
    towards = along * math.cos(half_angle) - across * math.sin(half_angle)
    came = towards >= TOWARDS_M and c[COUNT] >= READINGS and since(i, STEPS, sides, memory, deaf=True) >= CHANGES
    passed = (
        math.hypot(dx, dy) >= PAST_M
        and c[COUNT] >= PAST_READINGS
        and (
            since(i, LEAPS, sides, memory, deaf=False) >= CHANGES
            or since(i, STEPS, sides, memory, deaf=False) >= PAST_CHANGES
        )
    )
    return bool((came or passed) and others_changed(i, memory, faults))


@kernel
def is_silent(i: int, x: float, y: float, sides: Ints, memory: Floats) -> bool:
    """Tell whether a sensor should have heard something by now."""
    c = memory[i]
    far = math.hypot(x - c[X], y - c[Y]) >= SILENT_M and c[COUNT] >= PAST_READINGS
    return bool(far and since(i, ECHOES, sides, memory, deaf=False) >= HEARD_SHARE * c[COUNT])


@kernel
def weigh_crosstalk(
    i: int, r: float, s: int, memory: Floats, shorts: Floats, crossed: NDArray[np.uint8]
) -> None:  # fmt: skip
    """Hold the last reading against this one and the one before it, where those were fired in other sets."""
    c = memory[i]
    middle = int(c[S1])
    if c[EVER] < 2.0 or middle == s or middle == int(c[S2]):
        return
    if c[R1] < min(r, c[R2]) * (1.0 - SHORT_SHARE) - SHORT_M:
        shorts[i, middle] = min(shorts[i, middle] + 1.0, 2.0 * SHORTS)
    else:
        shorts[i, middle] = max(shorts[i, middle] - 2.0, 0.0)
    if shorts[i, middle] >= SHORTS:
        crossed[i, middle] = 1
    elif shorts[i, middle] == 0.0:
        crossed[i, middle] = 0


@kernel
def is_doubtful(i: int, r: float, x: float, y: float, s: int, memory: Floats) -> bool:
    """Tell whether a reading is shorter than the last one in another set, by more than the base has moved since."""
    c = memory[i]
    if c[EVER] < 1.0 or int(c[S1]) == s:
        return False
    moved = math.hypot(x - c[X1], y - c[Y1])
    return bool(r < c[R1] * (1.0 - SHORT_SHARE) - SHORT_M - moved)


@kernel
def judge(
    i: int, r: float, x: float, y: float, axis: float, half_angle: float, tolerance: float, sides: Ints,
    memory: Floats, faults: Ints,
) -> None:  # fmt: skip
    """Find a sensor stuck or silent by its run so far, or take that back."""
    c = memory[i]
    if faults[i] & STUCK:
        c[OFF] = 0.0 if abs(r - c[AT]) <= tolerance else c[OFF] + 1.0
        if c[OFF] >= RETURNS:
            faults[i] &= ~STUCK
    elif math.isfinite(r):
        faults[i] &= ~SILENT
        if is_stuck(i, x, y, axis, half_angle, sides, memory, faults):
            faults[i] |= STUCK
            c[AT], c[OFF] = c[RUN], 0.0
    elif is_silent(i, x, y, sides, memory):
        faults[i] |= SILENT


@kernel
def watch(
    ranges: Floats, x: float, y: float, yaw: float, axes: Floats, sides: Ints, expected: NDArray[np.bool_],
    half_angle: float, tolerance: float, near: float, memory: Floats, ring: Floats, sets: NDArray[np.uint8],
    shorts: Floats, crossed: NDArray[np.uint8], faults: Ints, believed: Floats, possible: Floats,
) -> int:  # fmt: skip
    """Take in a firing; return which of `CHANGED`, `LESS_BELIEVED` and `LESS_POSSIBLE` it brings.

    Parameters
    ----------
    ranges : (n,) float
        As in a `Firing`, m.
    x, y, yaw : float
        Place (m) and direction (rad) of the ring.
    axes : (n,) float
        Direction of each sensor in the ring, rad.
    sides : (n, 2) int
        Each sensor's neighbours, −1 where it has not two.
    expected : (n,) bool
        Who fires at all.
    half_angle, tolerance, near : float
        Of the beam (rad); readings this near to one another are equal, and echoes nearer than `near` are near (m).
    memory : (n, COLUMNS), ring : (RING,), sets : (SETS, n), shorts, crossed : (n, SETS), faults : (n,)
        What is remembered.
    believed, possible : (n,) float
        Overwritten: what is to be believed of the ranges, and that with what is in doubt.
    """
    fired = 0
    for i in range(ranges.shape[0]):
        believed[i] = possible[i] = ranges[i]
        fired += not math.isnan(ranges[i])
    if fired == 0 or not math.isfinite(x + y + yaw):
        return 0
    s = set_of(ranges, sets, shorts, crossed, ring)
    ring[FIRINGS] += 1.0
    leapt = math.hypot(x - ring[LAST_X], y - ring[LAST_Y]) >= TOWARDS_M
    ring[LAST_X], ring[LAST_Y] = x, y
    news = 0
    for i in range(ranges.shape[0]):
        c = memory[i]
        if leapt:
            c[COUNT] = 0.0
        before = faults[i]
        r = ranges[i]
        if math.isnan(r):
            c[MISSED] += 1.0
            if expected[i] and c[MISSED] >= FAILURES:
                faults[i] |= FAILING
            if faults[i] != before:
                news |= CHANGED
            continue
        c[MISSED] = 0.0
        faults[i] &= ~FAILING
        if c[EVER] > 0.0 and not (r == c[R1] or abs(r - c[R1]) <= LEAP_M):
            c[LEAPS] += 1.0
        if r < near:
            c[ECHOES] += 1.0
        if c[COUNT] == 0.0 or not (r == c[RUN] or abs(r - c[RUN]) <= tolerance):
            c[SINCE] = ring[FIRINGS]
            c[STEPS] += 1.0
            begin_run(i, r, x, y, yaw, sides, memory)
        elif abs(yaw - c[YAW]) > 0.5 * half_angle:
            begin_run(i, c[RUN], x, y, yaw, sides, memory)
        else:
            c[COUNT] += 1.0
        judge(i, r, x, y, yaw + axes[i], half_angle, tolerance, sides, memory, faults)
        if ring[REGULAR] >= REGULAR_MIN:
            weigh_crosstalk(i, r, s, memory, shorts, crossed)
        if ring[REGULAR] >= REGULAR_MIN and is_doubtful(i, r, x, y, s, memory):
            believed[i] = math.nan
            news |= LESS_BELIEVED
        c[R2], c[S2] = c[R1], c[S1]
        c[R1], c[S1] = r, float(s)
        c[X1], c[Y1] = x, y
        c[EVER] += 1.0
        faults[i] &= ~CROSSTALK
        for k in range(sets.shape[0]):
            if crossed[i, k]:
                faults[i] |= CROSSTALK
        if faults[i] & STUCK or crossed[i, s] or (faults[i] & SILENT and not math.isfinite(r)):
            believed[i] = possible[i] = math.nan
            news |= LESS_BELIEVED | LESS_POSSIBLE
        if faults[i] != before:
            news |= CHANGED
    return news
