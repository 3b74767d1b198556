"""The test of whether the readings of a whole ring have changed at once, as no motion changes them.

The newest reading of each sensor is compared with the one before it, a round of the firing pattern earlier. An honest
ring hears what stood there then, moved as the odometry says. Two other explanations shift what is expected by one
change that all sensors have in common:

- all ranges have become longer or shorter by the same length;
- each sensor hears what another one heard, as if the ring had been turned.

All use the density of an honest reading around what is expected, so what no change explains better counts for none. A
change that agrees with the motion from then on can be found only in this one round.

Silences that come together need not be a fault: `mirror_left` weighs whether one turn explains them.
"""

from __future__ import annotations

import math
from typing import Annotated, Final

from perception.angles import SAME_RAD, wrapped
from perception.bounds import FINITE, Bound, Flag, Place
from perception.kernel import Floats, kernel
from perception.records import Record, Records
from perception.ring_faults.memory import EchoTrace
from perception.sensor_faults.wall import NOISE_SHARE

NO_CHANGE, LENGTHENED, EXCHANGED = range(3)
"""The changes; see the module."""
NOISE_M: Final = 0.02
"""Noise of a range that is no share of it, m."""
ROUND_M: Final = 0.5
"""A sensor that moved farther since its reading before is not compared, m."""
WINDOW_MIN_M: Final = 1e-3
"""A window of ranges is at least as wide, m."""
TURNING_SHARE: Final = 0.25
"""A sensor that has turned by more than this share of half its beam looks elsewhere: mirrors leave the beam."""
TURNS: Final = 8
"""Turns by a part of the circle that are tried; one by half as much looks as if the robot had turned."""


class Expected(Record):
    """What is expected of one sensor's newest reading."""

    source: Annotated[int, Bound(-1.0, 255.0)]
    """The sensor that looked there before; −1 for none, which says nothing."""
    is_off: Flag
    """Whether it hears an echo elsewhere than where one is expected."""
    low: Place
    """Between what ranges an echo is expected, m; below zero where silence is."""
    high: Place
    missed: Annotated[float, Bound(0.0, 1.0)]
    """The share of an honest sensor's readings that are not as expected."""
    honest_nat: Annotated[float, FINITE]
    """The logarithm of the density of what an honest sensor reads."""
    honest: Annotated[float, FINITE]
    """That density where misses are near by, too; see `density_if_turned`."""


@kernel
def density(r: float, low: float, high: float, reach: float, missed: float) -> float:
    """Return the density of a reading where an echo is expected, 1/m; of a silence the probability.

    Parameters
    ----------
    r : float
        The reading, m; below zero without an echo.
    low, high : float
        Where it is expected, m; `high` is below zero where silence is.
    reach : float
        Range up to which the ring listens, m.
    missed : float
        Share of readings that are not as expected: half of them are silent.
    """
    if high < 0.0 or low > reach:
        return 1.0 - missed if r < 0.0 else missed / reach
    if r < 0.0:
        return 0.5 * missed
    return 0.5 * missed / reach + ((1.0 - missed) / (high - low) if low <= r <= high else 0.0)


@kernel
def source(i: int, turn: float, half_angle: float, echoes: Records[EchoTrace]) -> int:
    """Return the sensor that looked before where sensor `i` looks now, or at an angle `turn` from it; −1 for none.

    Of those that looked there the sensor itself comes first.

    Parameters
    ----------
    i : int
        The sensor.
    turn : float
        The angle, rad.
    half_angle, echoes
        As for `weigh_changes`.
    """
    axis = echoes[i].latest.axis + turn
    found, off = -1, half_angle
    for step in range(len(echoes)):
        k = (i + step) % len(echoes)
        if echoes[k].is_compared:
            away = abs(wrapped(echoes[k].before.axis - axis))
            if away < off:
                found, off = k, away - SAME_RAD
                if off <= 0.0:  # none looked there more exactly, which is the rule while the ring does not turn
                    break
    return found


@kernel
def expect(
    k: int,
    i: int,
    turn: float,
    half_angle: float,
    tolerance: float,
    mounts: Floats,
    echoes: Records[EchoTrace],
) -> tuple[float, float]:
    """Return between what ranges sensor `i` should hear what `k` heard before, m; (−1, −1) for a silence.

    A surface whose normal lies in the beam comes nearer by d·cos ψ, for an angle ψ from the motion to a direction in
    the beam; a rough one along the path comes no nearer. `k` may be −1, which heard nothing.

    Parameters
    ----------
    k, i : int
        The sensors.
    turn : float
        Angle by which sensor `i` looks elsewhere than the robot file says, rad.
    half_angle, tolerance, mounts, echoes
        As for `weigh_changes`.
    """
    if k < 0 or echoes[k].before.range_m < 0.0:
        return -1.0, -1.0
    then, now = echoes[k].before, echoes[i].latest
    axis = now.axis + turn
    error = tolerance + NOISE_M + (NOISE_SHARE + abs(wrapped(axis - then.axis))) * then.range_m
    r = then.range_m
    r += mounts[k, 0] * math.cos(mounts[k, 2]) + mounts[k, 1] * math.sin(mounts[k, 2])
    r -= mounts[i, 0] * math.cos(mounts[i, 2]) + mounts[i, 1] * math.sin(mounts[i, 2])
    dx, dy = now.x - then.x, now.y - then.y
    moved = math.hypot(dx, dy)
    if moved > 0.0:
        angle = abs(wrapped(axis - math.atan2(dy, dx)))
        most = max(0.0, moved * math.cos(max(0.0, angle - half_angle)))
        least = min(0.0, moved * math.cos(min(math.pi, angle + half_angle)))
        return max(0.0, r - most - error), max(0.0, r - least) + error
    return max(0.0, r - error), max(0.0, r) + error


@kernel
def compare(
    half_angle: float,
    tolerance: float,
    reach: float,
    missed: tuple[float, float],
    mounts: Floats,
    echoes: Records[EchoTrace],
    expected: Records[Expected],
) -> bool:
    """Compare the newest readings with what an honest ring is expected to hear; return whether most echoes differ.

    A change explains the echoes that differ, and misses the others: otherwise little speaks for one.

    Parameters
    ----------
    half_angle, tolerance, reach, missed, mounts, echoes, expected
        As for `weigh_changes`.
    """
    misses, known = 0, 0
    for i in range(len(echoes)):
        one = expected[i]
        one.source = source(i, 0.0, half_angle, echoes) if echoes[i].is_compared else -1
        if one.source < 0:
            continue
        r, then = echoes[i].latest.range_m, echoes[one.source].before
        if math.hypot(echoes[i].latest.x - then.x, echoes[i].latest.y - then.y) > ROUND_M:
            one.source = -1
            continue
        one.low, one.high = expect(one.source, i, 0.0, half_angle, tolerance, mounts, echoes)
        turned = abs(wrapped(echoes[i].latest.axis - then.axis))
        # Mirrors leave a beam as it turns. The learned share is of turns beyond the limit; below it, up to half of it
        # counts: all of it hid rings that are turned.
        part = 1.0 if turned > TURNING_SHARE * half_angle else 0.5 * turned / (TURNING_SHARE * half_angle)
        one.missed = (1.0 - part) * missed[0] + part * missed[1]
        one.honest_nat = math.log(density(r, one.low, one.high, reach, one.missed))
        is_known = one.high >= 0.0 and one.low <= reach
        one.is_off = 1 if is_known and r >= 0.0 and not one.low <= r <= one.high else 0
        misses += one.is_off or (is_known and r < 0.0)
        known += is_known
    return 2 * misses > known


@kernel
def density_if_turned(
    i: int,
    turn: float,
    missed: float,
    half_angle: float,
    tolerance: float,
    reach: float,
    mounts: Floats,
    echoes: Records[EchoTrace],
) -> float:
    """Return the density of sensor `i`'s newest reading if the ring has been turned; below 0 if none looked there.

    Half of the echoes that are not as expected are near to what the sensor, or one whose beam overlaps with its own,
    would hear: a wall that the beam grazes changes its range faster, and a stray before led to expect nothing true.

    Parameters
    ----------
    i : int
        The sensor.
    turn : float
        The angle, rad; 0 for an honest ring.
    missed : float
        The share of an honest sensor's readings that are not as expected.
    half_angle, tolerance, reach, mounts, echoes
        As for `weigh_changes`.
    """
    r, k = echoes[i].latest.range_m, source(i, turn, half_angle, echoes)
    if k < 0:
        return -1.0
    low, high = expect(k, i, turn, half_angle, tolerance, mounts, echoes)
    likely = density(r, low, high, reach, missed)
    if r < 0.0 or (high >= 0.0 and low <= r <= high):
        return likely
    near = 0.0
    for other in range(len(echoes)):
        if echoes[other].is_compared:
            off = abs(wrapped(echoes[other].before.axis - echoes[i].latest.axis - turn))
            low, high = expect(other, i, turn, half_angle, tolerance, mounts, echoes)
            if off < 2.0 * half_angle and high >= 0.0 and 2.0 * low - high <= r <= 2.0 * high - low:
                near = max(near, 1.0 / (3.0 * (high - low)))
    return 0.5 * likely * (1.0 + near * reach)


@kernel
def weigh_exchange(
    turn: float,
    half_angle: float,
    tolerance: float,
    reach: float,
    mounts: Floats,
    echoes: Records[EchoTrace],
    expected: Records[Expected],
) -> float:
    """Return the evidence that each sensor hears what was at an angle `turn` from it before, nat.

    A sensor of which that is not known speaks only against it: it should hardly hear what an honest one would.

    Parameters
    ----------
    turn : float
        The angle, rad.
    half_angle, tolerance, reach, mounts, echoes, expected
        As for `weigh_changes`.
    """
    evidence = 0.0
    for i in range(len(echoes)):
        if expected[i].source < 0:
            continue
        honest = expected[i].honest
        likely = density_if_turned(i, turn, expected[i].missed, half_angle, tolerance, reach, mounts, echoes)
        if likely < 0.0:
            likely = min(honest, 0.5 if echoes[i].latest.range_m < 0.0 else 0.5 / reach)
        evidence += math.log(likely / honest)
    return evidence


@kernel
def weigh_length(k: int, reach: float, echoes: Records[EchoTrace], expected: Records[Expected]) -> float:
    """Return the evidence that all ranges are longer or shorter by as much as that of sensor `k`, nat.

    Parameters
    ----------
    k : int
        The sensor, of which an echo was expected elsewhere.
    reach, echoes, expected
        As for `weigh_changes`.
    """
    longer = echoes[k].latest.range_m - 0.5 * (expected[k].low + expected[k].high)
    # Any length is as likely.
    evidence = math.log((1.0 - expected[k].missed) / (2.0 * reach)) - expected[k].honest_nat
    for i in range(len(echoes)):
        one = expected[i]
        if i != k and one.source >= 0 and one.high >= 0.0:
            low, high = max(0.0, one.low + longer), max(0.0, one.high + longer) + WINDOW_MIN_M
            evidence += math.log(density(echoes[i].latest.range_m, low, high, reach, one.missed)) - one.honest_nat
    return evidence


@kernel
def weigh_changes(
    mounts: Floats,
    half_angle: float,
    tolerance: float,
    reach: float,
    missed: tuple[float, float],
    echoes: Records[EchoTrace],
    expected: Records[Expected],
) -> tuple[int, float]:
    """Return the common change that explains the newest readings best, and the evidence for it, nat.

    Parameters
    ----------
    mounts, half_angle, tolerance, reach
        As for `motion_tests.check_motion`.
    missed : (float, float)
        Share of an honest ring's readings that are not as expected, where a sensor looks on in the same direction and
        where it has turned.
    echoes : (n,) records
        What is remembered of each sensor.
    expected : (n,) records
        Overwritten.

    Returns
    -------
    (int, float)
        One of the changes, and the logarithm of its likelihood over that of an honest ring. Sensors whose beams
        overlap hear the same surface, and together count as one.
    """
    found, most = NO_CHANGE, 0.0
    if not compare(half_angle, tolerance, reach, missed, mounts, echoes, expected):
        return found, most
    for k in range(len(echoes)):
        one = expected[k]
        if one.source >= 0:
            one.honest = density_if_turned(k, 0.0, one.missed, half_angle, tolerance, reach, mounts, echoes)
        if one.source >= 0 and one.is_off:
            nats = weigh_length(k, reach, echoes, expected)
            if nats > most:
                found, most = LENGTHENED, nats
    for part in range(1, TURNS):
        turn = math.tau * part / TURNS
        nats = weigh_exchange(turn, half_angle, tolerance, reach, mounts, echoes, expected)
        if nats > most:
            found, most = EXCHANGED, nats
    return found, most / max(1.0, len(echoes) * half_angle / math.pi)


@kernel
def turned_past(c: EchoTrace, half_angle: float) -> tuple[float, float]:
    """Return the directions, their middle and width in rad, that a sensor's beam has left since its last echo."""
    turned = c.latest.axis - c.heard.axis
    width = min(abs(turned), 2.0 * half_angle)
    return c.heard.axis - math.copysign(half_angle - 0.5 * width, turned), width


@kernel
def mirror_left(i: int, mirrors: float, missed: float, half_angle: float, echoes: Records[EchoTrace]) -> float:
    """Return how likely it is that the mirror which sensor `i` heard last has left its beam as the robot turned.

    A mirror is heard while its normal lies in the beam. Walls that face each other are parallel: all sensors that
    lose their normal in the same turn fall silent together, which is one event and not many. Each other sensor that
    has just fallen silent in a turn past the same directions makes it more likely.

    Parameters
    ----------
    i : int
        The sensor; its newest look has been entered.
    mirrors : float
        Share of what the ring hears that are mirrors.
    missed : float
        Share of looks that an honest ring misses for other reasons.
    half_angle, echoes
        As for `motion_tests.check_motion`.
    """
    middle, width = turned_past(echoes[i], half_angle)
    likely = min(mirrors * width / (2.0 * half_angle), 0.5)
    if likely <= 0.0:
        return 0.0
    odds = likely / (1.0 - likely)
    for k in range(len(echoes)):
        other = echoes[k]
        if k != i and other.agreed > 0 and 1 <= other.silences <= 2:
            its_middle, its_width = turned_past(other, half_angle)
            off = abs(wrapped(2.0 * (its_middle - middle))) / 2.0
            common = min(max(0.5 * (width + its_width) - off, 0.0), min(width, its_width)) / width
            odds *= 1.0 - common + common / missed
    return odds / (1.0 + odds)
