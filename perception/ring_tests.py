"""The kernels behind `perception.ring_monitor`: sequential tests of a ring's readings against its own motion.

Each test sums the logarithms of likelihood ratios, never below zero (CUSUM, Page 1954): how much better a reading is
explained by a ring that lies than by an honest one among things that stand still. The sum is compared with
`EVIDENCE_NAT`, the one threshold.
"""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import Floats, kernel
from perception.records import Records
from perception.ring_memory import HALVES, LOOK_KINDS, QUARTERS, SILENCE_M, EchoTrace, RingTrace, SensorPlace
from perception.sensor_wall import NOISE_SHARE

EVIDENCE_NAT: Final = math.log(1e7 / 0.01)
"""A sum of evidence that convicts the ring, nat: a day has some 10⁷ readings, and at most one day in a hundred is to
have a false alarm."""
LEAP_M: Final = 0.25
"""The memory starts again where the ring has moved farther than this between two firings, m."""
AHEAD_COS: Final = math.cos(math.radians(100.0))
"""Sensors within 100° of the direction of travel look ahead: what the robot may drive into, and both its sides."""

REPEAT_NAT: Final = math.log(100.0)
"""Evidence of a reading that repeats, to the bit, what it should have changed by `STEP_MIN_M` or three tolerances."""
STEP_MIN_M: Final = 0.06
"""See `REPEAT_NAT`, m: ten times the error of a short way's odometry and of a range in steps of a millimetre."""
REPEATS_MAX: Final = 3.0
"""Such changes of one sensor that count: a single sensor may be stuck, which says nothing about the ring."""

LEADS_M: Final = 0.5
"""A known echo leads to expect the next one within this way of the ring, m."""
REACH_SHARE: Final = 0.8
"""What is expected beyond this share of the ring's reach may be out of reach next time."""
MOVES: Final = 1.2
"""A reading changes by no more than this times the sensor's motion; rough walls that the beam grazes change more."""
NOISE_M: Final = 0.02
"""Noise of a range that is no share of it, m."""
MISSED: Final = 0.9
"""Share of looks that miss a known echo, if readings do not depend on what is there."""
MISS_MAX: Final = 0.6
"""An honest ring misses no more of its known echoes than this, in whatever surroundings."""
TURNING_SHARE: Final = 0.25
"""A sensor that has turned by more than this share of half its beam looks elsewhere: mirrors leave the beam."""
STEADY, TURNING, AGAIN, DOUBTED = range(LOOK_KINDS)
"""Kinds of looks: at an echo that agreed with the one before, from the same direction or another; the second look at
one that was missed; and at one that agreed with nothing. After that, silence is as honest: it was a stray."""
PRIOR_MISSES: Final = (2.0, 8.0, 8.0, 10.0)
PRIOR_LOOKS: Final = 20.0
"""Misses of each kind, and looks, that stand for what is known of rings before a run."""
MEMORY_LOOKS: Final = 500.0
"""Looks over which the rates of misses are learned; older ones count half."""

FOLLOWS: Final = 0.7
"""Share of an honest ring's changes that follow the motion; the others come from surfaces that change places."""

NOTHING, REPEATED, VANISHED, SCATTERED, TURNED = range(5)
"""What `check_motion` returns: nothing is wrong; the ring repeats old readings; most known echoes have gone
silent, or are elsewhere; `TURNED` plus 0 to 2: it is turned by a quarter, two or three."""


@kernel
def wrapped(angle: float) -> float:
    """Return an angle wrapped into [−π, π)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@kernel
def mark(place: SensorPlace, r: float, x: float, y: float, axis: float, path_m: float) -> None:
    """Enter a reading and where the sensor made it."""
    place.range_m, place.x, place.y, place.axis, place.path_m = r, x, y, axis, path_m


@kernel
def is_parallel_wall(
    i: int, dx: float, dy: float, yaw: float, mounts: Floats, half_angle: float, tolerance: float,
    echoes: Records[EchoTrace],
) -> bool:  # fmt: skip
    """Return whether a wall along the path explains that sensor `i` repeats its reading.

    A rough wall beside the path answers a sensor from the direction in its beam that is nearest to the wall's normal,
    as far as the wall goes on. The sensors that look square to the path hear how far away such a wall is.

    Parameters
    ----------
    i : int
        The sensor.
    dx, dy : float
        By how much it has moved, m.
    yaw : float
        Direction of the ring, rad.
    mounts, half_angle, tolerance, echoes
        As for `check_motion`.
    """
    path, moved = math.atan2(dy, dx), math.hypot(dx, dy)
    forward, left = math.sin(yaw - path), math.cos(yaw - path)
    r, axis = echoes[i].last_m, wrapped(yaw + mounts[i, 2] - path)
    for turn in range(2):
        side = 1.0 - 2.0 * turn
        wall = math.inf
        for k in range(len(echoes)):
            bearing = side * wrapped(yaw + mounts[k, 2] - path)
            if echoes[k].is_known and echoes[k].last_m >= 0.0 and abs(bearing - 0.5 * math.pi) <= half_angle:
                wall = min(wall, side * (mounts[k, 0] * forward + mounts[k, 1] * left) + echoes[k].last_m)
        nearest = min(max(0.5 * math.pi, side * axis - half_angle), side * axis + half_angle)
        if math.isinf(wall) or math.sin(nearest) < 1e-3:
            continue
        expected = (wall - side * (mounts[i, 0] * forward + mounts[i, 1] * left)) / math.sin(nearest)
        # A wall that is not quite parallel stays within the tolerance, too.
        slack = abs(r / math.tan(nearest)) * min(1.0, tolerance / moved)
        if abs(expected - r) <= tolerance + NOISE_SHARE * r + slack:
            return True
    return False


@kernel
def changes_due(
    i: int, x: float, y: float, axis: float, yaw: float, mounts: Floats, half_angle: float, tolerance: float,
    echoes: Records[EchoTrace],
) -> float:  # fmt: skip
    """Return how many times sensor `i` should have changed the reading that it repeats.

    A surface whose normal lies in the beam comes nearer by at least d·cos(ψ + β) when the sensor moves by d at an
    angle ψ to its axis, β being half the beam; after a turn by two beams it hears what another sensor heard before.

    Parameters
    ----------
    i : int
        The sensor.
    x, y, axis : float
        Its place (m) and the direction of its axis (rad).
    yaw, mounts, half_angle, tolerance, echoes
        As for `check_motion`.
    """
    c = echoes[i]
    dx, dy, turned = x - c.repeat.x, y - c.repeat.y, axis - c.repeat.axis
    if abs(turned) <= half_angle:
        beam = half_angle + abs(turned)
        along = abs(dx * math.cos(axis) + dy * math.sin(axis))
        across = abs(dy * math.cos(axis) - dx * math.sin(axis))
        due = math.floor(
            (along * math.cos(beam) - across * math.sin(beam)) / max(STEP_MIN_M, 3.0 * tolerance)
        )
        if due < 1 or is_parallel_wall(i, dx, dy, yaw, mounts, half_angle, tolerance, echoes):
            return 0.0
        return min(REPEATS_MAX, float(due))
    if abs(turned) <= 2.0 * half_angle:
        return 0.0
    nearest, off = -1, half_angle
    for k in range(len(echoes)):
        away = abs(wrapped(mounts[k, 2] - mounts[i, 2] - turned))
        if k != i and echoes[k].is_known and away < off:
            nearest, off = k, away
    if nearest < 0 or abs(echoes[nearest].last_m - c.last_m) <= tolerance + 0.1 * c.last_m:
        return 0.0
    return min(REPEATS_MAX, math.floor(abs(turned) / (2.0 * half_angle)))


@kernel
def weigh_repeat(
    i: int, r: float, x: float, y: float, axis: float, yaw: float, is_ahead: bool, mounts: Floats, half_angle: float,
    tolerance: float, echoes: Records[EchoTrace], ring: Records[RingTrace],
) -> None:  # fmt: skip
    """Test whether all readings of the ring repeat; a reading ahead that differs from the last one ends that.

    Parameters
    ----------
    i : int
        The sensor.
    r : float
        Its reading, m; `SILENCE_M` without an echo.
    x, y, axis : float
        Its place (m) and the direction of its axis (rad).
    yaw, mounts, half_angle, tolerance, echoes, ring
        As for `check_motion`.
    is_ahead : bool
        Whether it looks in the direction of travel.
    """
    c, all_of = echoes[i], ring[0]
    if not c.is_known or r != c.last_m:
        if c.is_known and is_ahead:
            all_of.standstill += 1
            all_of.repeated_nat = 0.0
        elif c.is_known and c.standstill == all_of.standstill:
            all_of.repeated_nat = max(0.0, all_of.repeated_nat - c.repeated_nat)
        c.standstill, c.repeated_nat = 0, 0.0
        c.is_known, c.last_m = 1, r
    elif c.standstill != all_of.standstill:
        c.standstill, c.repeated_nat = all_of.standstill, 0.0
        mark(c.repeat, r, x, y, axis, all_of.path_m)
    elif r >= 0.0 and c.repeated_nat < REPEATS_MAX * REPEAT_NAT:
        due = REPEAT_NAT * changes_due(i, x, y, axis, yaw, mounts, half_angle, tolerance, echoes)
        if due > c.repeated_nat:
            all_of.repeated_nat += due - c.repeated_nat
            c.repeated_nat = due


@kernel
def weigh_look(
    c: EchoTrace, r: float, x: float, y: float, axis: float, is_ahead: bool, half_angle: float, tolerance: float,
    reach: float, all_of: RingTrace,
) -> None:  # fmt: skip
    """Test whether a reading is where the sensor's last echo leads to expect it.

    How often an honest ring misses an echo is learned on the way, for each kind of look.

    Parameters
    ----------
    c : record
        What is remembered of the sensor. Updated.
    r : float
        Its reading, m; `SILENCE_M` without an echo.
    x, y, axis : float
        Its place (m) and the direction of its axis (rad).
    is_ahead : bool
        Whether it looks in the direction of travel.
    half_angle, tolerance, reach
        As for `check_motion`.
    all_of : record
        What is remembered of the ring. Updated.
    """
    heard = c.heard.range_m
    moved, turned = math.hypot(x - c.heard.x, y - c.heard.y), abs(axis - c.heard.axis)
    leads = heard > 0.0 and all_of.path_m - c.heard.path_m <= LEADS_M and turned < half_angle
    is_known = c.agreed > 0 and c.silences < 2
    is_stray = c.agreed == 0 and c.silences == 0
    expected = MOVES * moved + heard * turned + tolerance + NOISE_SHARE * heard + NOISE_M
    agrees = is_stray if r < 0.0 else abs(r - heard) <= expected
    if leads and heard + moved < REACH_SHARE * reach and (is_known or is_stray or r >= 0.0):
        kind = DOUBTED
        if is_known:
            kind = AGAIN if c.silences > 0 else TURNING if turned > TURNING_SHARE * half_angle else STEADY
        honest = (all_of.misses[kind] + PRIOR_MISSES[kind]) / (all_of.looks[kind] + PRIOR_LOOKS)
        if kind == TURNING:
            honest = max(honest, 0.25 * turned / half_angle)
        honest = min(honest, MISS_MAX)
        evidence = math.log((1.0 - MISSED) / (1.0 - honest)) if agrees else math.log(MISSED / honest)
        for part in range(HALVES):
            if part == 0 or is_ahead:
                all_of.missed_nat[part] = max(0.0, all_of.missed_nat[part] + evidence)
        if all_of.missed_nat[0] == 0.0:
            all_of.silent = all_of.elsewhere = 0
        elif not agrees:
            all_of.silent += r < 0.0
            all_of.elsewhere += r >= 0.0
        all_of.misses[kind] += 0.0 if agrees else 1.0
        all_of.looks[kind] += 1.0
        if all_of.looks[kind] > MEMORY_LOOKS:
            all_of.looks[kind] *= 0.5
            all_of.misses[kind] *= 0.5
    if r < 0.0:
        c.silences += 1
        c.is_anchored = 1 if c.is_anchored and c.silences < 2 else 0
    else:
        c.agreed = c.agreed + 1 if leads and agrees else 0
        c.is_anchored = 1 if c.is_anchored and c.agreed > 0 else 0
        c.silences = 0
        mark(c.heard, r, x, y, axis, all_of.path_m)


@kernel
def weigh_change(
    c: EchoTrace, r: float, x: float, y: float, axis: float, half_angle: float, tolerance: float, all_of: RingTrace
) -> None:
    """Test whether the change of an echo's range follows the motion, or that of a ring that is turned.

    A surface whose normal lies in the beam comes nearer by d·cos ψ, for an angle ψ from the motion to a direction in
    the beam. A rough one that the beam grazes may change otherwise, hence `FOLLOWS`.

    Parameters
    ----------
    c, r, x, y, axis, half_angle, tolerance, all_of
        As for `weigh_look`; `r` is an echo's range.
    """
    if not c.is_anchored or abs(axis - c.anchor.axis) > 0.5 * half_angle:
        c.is_anchored = 1
        mark(c.anchor, r, x, y, axis, all_of.path_m)
        return
    dx, dy = x - c.anchor.x, y - c.anchor.y
    moved = math.hypot(dx, dy)
    if moved < 2.0 * max(STEP_MIN_M, 3.0 * tolerance):
        return
    change, error, path = r - c.anchor.range_m, tolerance + 0.03 * r, math.atan2(dy, dx)
    elsewhere = (1.0 - FOLLOWS) / (2.0 * (MOVES * moved + error))
    mounted = 0.0
    for quarter in range(QUARTERS + 1):
        angle = abs(wrapped(axis + 0.5 * math.pi * quarter - path))
        most = -moved * math.cos(max(0.0, angle - half_angle)) - error
        least = -moved * math.cos(min(math.pi, angle + half_angle)) + error
        density = elsewhere + (FOLLOWS / (least - most) if most <= change <= least else 0.0)
        if quarter == 0:
            mounted = density
        else:
            evidence = all_of.turned_nat[quarter - 1] + math.log(density / mounted)
            all_of.turned_nat[quarter - 1] = max(0.0, evidence)
    mark(c.anchor, r, x, y, axis, all_of.path_m)


@kernel
def verdict(all_of: RingTrace) -> int:
    """Return what the evidence says of the ring: `NOTHING`, or what is wrong."""
    if all_of.repeated_nat >= EVIDENCE_NAT:
        return REPEATED
    for quarter in range(QUARTERS):
        if all_of.turned_nat[quarter] >= EVIDENCE_NAT:
            return TURNED + quarter
    for part in range(HALVES):
        if all_of.missed_nat[part] >= EVIDENCE_NAT:
            return VANISHED if all_of.silent >= all_of.elsewhere else SCATTERED
    return NOTHING


@kernel
def begin_evidence(all_of: RingTrace) -> None:
    """Drop all evidence; what is known of the ring's misses stays."""
    all_of.standstill += 1
    all_of.repeated_nat = 0.0
    all_of.missed_nat[:] = 0.0
    all_of.turned_nat[:] = 0.0
    all_of.silent = all_of.elsewhere = 0


@kernel
def check_motion(
    ranges: Floats, x: float, y: float, yaw: float, mounts: Floats, half_angle: float, tolerance: float, reach: float,
    echoes: Records[EchoTrace], ring: Records[RingTrace],
) -> int:  # fmt: skip
    """Test the readings of a firing; return what is wrong, `NOTHING` where nothing is.

    Parameters
    ----------
    ranges : (n,) float
        As in a `Firing`, m; NaN for sensors that are masked as well.
    x, y, yaw : float
        Place (m) and direction (rad) of the ring.
    mounts : (n, 3) float
        Place x, y (m) and direction (rad) of each sensor in the ring's frame.
    half_angle : float
        Half the beam's width, rad.
    tolerance : float
        Readings that differ by no more than this are equal, m.
    reach : float
        Range up to which the ring listens, m; a reading there is a silence.
    echoes : (n,) records
        What is remembered of each sensor. Updated.
    ring : (1,) record
        What is remembered of the ring. Updated. After a verdict the evidence is dropped.
    """
    if not math.isfinite(x + y + yaw):
        return NOTHING
    all_of = ring[0]
    moved = math.hypot(x - all_of.x, y - all_of.y)
    if not all_of.is_started or moved > LEAP_M:
        all_of.is_started = 1
        begin_evidence(all_of)
        for i in range(len(echoes)):
            echoes[i].is_known = echoes[i].is_anchored = echoes[i].agreed = 0
            echoes[i].heard.range_m = SILENCE_M
    elif moved > 0.0:
        all_of.travel_rad = math.atan2(y - all_of.y, x - all_of.x)
        all_of.path_m += moved
    all_of.x, all_of.y = x, y
    c, s = math.cos(yaw), math.sin(yaw)
    for i in range(ranges.shape[0]):
        if math.isnan(ranges[i]):
            continue
        r = ranges[i] if ranges[i] < reach - tolerance else SILENCE_M
        own_x = x + c * mounts[i, 0] - s * mounts[i, 1]
        own_y = y + s * mounts[i, 0] + c * mounts[i, 1]
        axis = yaw + mounts[i, 2]
        is_ahead = math.cos(axis - all_of.travel_rad) > AHEAD_COS
        weigh_repeat(
            i, r, own_x, own_y, axis, yaw, is_ahead, mounts, half_angle, tolerance, echoes, ring
        )
        weigh_look(echoes[i], r, own_x, own_y, axis, is_ahead, half_angle, tolerance, reach, all_of)
        if r >= 0.0:
            weigh_change(echoes[i], r, own_x, own_y, axis, half_angle, tolerance, all_of)
    found = verdict(all_of)
    if found != NOTHING:
        begin_evidence(all_of)
    return found
