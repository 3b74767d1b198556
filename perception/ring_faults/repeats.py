"""The test of whether a ring repeats old readings; see `perception.ring_faults.motion_tests`."""

from __future__ import annotations

import math
from typing import Final

from perception.angles import wrapped
from perception.kernel import Floats, kernel
from perception.records import Records
from perception.ring_faults.changes import TURNING_SHARE
from perception.ring_faults.memory import EchoTrace, Look, Reception, RingTrace, SensorPlace, mark
from perception.sensor_faults.monitor import TOLERANCE_MIN_M
from perception.sensor_faults.wall import NOISE_SHARE, towards_wall

REPEAT_M: Final = TOLERANCE_MIN_M
"""Readings that differ by no more repeat each other, m: what is old may come with noise of a few millimetres."""
REPEAT_NAT: Final = math.log(100.0)
"""Evidence of a reading that repeats what it should have changed by `STEP_MIN_M` or three tolerances."""
STEP_MIN_M: Final = 0.06
"""See `REPEAT_NAT`, m: ten times the error of a short way's odometry and of a range in steps of a millimetre."""
REPEATS_MAX: Final = 3.0
"""Such changes of one sensor that count for the ring: a single sensor may be stuck, and needs more to be named."""
CHATTER_SHARE: Final = 0.002
"""A range varies by at least this share of it from look to look, also where a wall along the path answers."""
EQUAL_PRIOR: Final = 2e-8
"""Odds that an honest ring is without such noise, as that of an emulator between walls may be: equal readings alone
fall short of `memory.EVIDENCE_NAT` by one change that was due. They suffice once its noise is known."""
NOISY_NAT: Final = math.log(0.5 / 0.02)
"""Evidence for noise of a reading that changed by more than its resolution although the sensor hardly moved, nat:
half do so with noise, and two of a hundred without, as what is there may move."""
EQUAL_NAT: Final = math.log(0.5 / 0.98)
"""Evidence for noise of a reading that did not change so, nat."""
SENSOR_NAT: Final = REPEATS_MAX * REPEAT_NAT
"""Greatest evidence of a sensor, nat."""
WINDING_NAT: Final = math.log(1.0 / 0.05)
"""Evidence of a reading that is equal to the bit although the robot winds, nat. Of 9,321 such looks in 36 honest
drives of a minute, with noise and without, among mirrors and rough walls, 24 were equal, at most two in succession:
the course of a robot that winds through a corridor is along its walls for a moment."""


@kernel
def is_parallel_wall(
    i: int,
    r: float,
    way: tuple[float, float],
    yaw: float,
    mounts: Floats,
    reception: Reception,
    lean: float,
    echoes: Records[EchoTrace],
    path_m: float,
) -> bool:
    """Return whether a wall along the path explains the reading of sensor `i`.

    A rough wall beside the path answers a sensor from the direction in its beam that is nearest to the wall's normal,
    as far as the wall goes on. The sensors that look square to the path hear how far away such a wall is, until the
    robot has passed it; those that look back hear it for longer.

    Parameters
    ----------
    i : int
        The sensor.
    r : float
        Its echo's range, m.
    way : (float, float)
        By how much it has moved, m.
    yaw : float
        Direction of the ring, rad.
    mounts, reception, echoes
        As for `changes_due`.
    lean : float
        Angle between wall and path, rad, up to which the wall counts as along the path.
    path_m : float
        The ring's way so far, m.
    """
    half_angle, tolerance, reach = reception
    slack, path = tolerance + NOISE_SHARE * r, math.atan2(way[1], way[0])
    forward, left = math.sin(yaw - path), math.cos(yaw - path)
    axis = wrapped(yaw + mounts[i, 2] - path)
    for turn in range(2):
        side = 1.0 - 2.0 * turn
        nearest = towards_wall(side * axis, half_angle)
        if math.sin(nearest) < 1e-3:
            continue
        beside = side * (mounts[i, 0] * forward + mounts[i, 1] * left)
        ahead = mounts[i, 0] * left - mounts[i, 1] * forward
        steep, shallow = max(1e-3, math.sin(nearest + lean)), max(1e-3, math.sin(nearest - lean))
        for k in range(len(echoes)):
            c = echoes[k]
            bearing = side * wrapped(yaw + mounts[k, 2] - path)
            is_fresh = c.agreed_m > 0.0 and path_m - c.agreed_path_m <= reach
            if is_fresh and abs(bearing - 0.5 * math.pi) <= half_angle:
                wall = side * (mounts[k, 0] * forward + mounts[k, 1] * left) + c.agreed_m
                apart = (ahead - mounts[k, 0] * left + mounts[k, 1] * forward) * math.sin(lean)
                nears, recedes = (wall - beside - apart) / steep, (wall - beside + apart) / shallow
                if min(nears, recedes) - slack <= r <= max(nears, recedes) + slack:
                    return True
    return False


@kernel
def turns_beside_wall(r: float, bearing: float, turned: float, reception: Reception) -> bool:
    """Return whether a sensor that has turned may hear a rough wall along the path in one range before and after.

    Parameters
    ----------
    r : float
        The range, m.
    bearing : float
        Angle from the path to the sensor's axis now, rad.
    turned : float
        By how much it has turned, rad.
    reception : Reception
        What the ring hears.
    """
    half_angle, tolerance, _ = reception
    for turn in range(2):
        side = 1.0 - 2.0 * turn
        now, then = side * wrapped(bearing), side * wrapped(bearing - turned)
        now = math.sin(towards_wall(now, half_angle))
        then = math.sin(towards_wall(then, half_angle))
        if min(now, then) >= 1e-3 and r * abs(now / then - 1.0) <= tolerance + NOISE_SHARE * r:
            return True
    return False


@kernel
def changes_due(
    i: int,
    look: Look,
    then: SensorPlace,
    yaw: float,
    mounts: Floats,
    reception: Reception,
    echoes: Records[EchoTrace],
    path_m: float,
) -> float:
    """Return how many times sensor `i` should have changed the reading that it repeats since it was at a place.

    A surface whose normal lies in the beam comes nearer by at least d·cos(ψ + β) when the sensor moves by d at an
    angle ψ to its axis, β being half the beam. After a turn by a beam's width nothing is in the beam that was in it.

    Parameters
    ----------
    i : int
        The sensor.
    look : Look
        Its reading, place and direction.
    then : record
        Where it made that reading before.
    yaw, mounts, echoes
        As for `check_motion`.
    reception : Reception
        What the ring hears.
    path_m : float
        The ring's way so far, m.
    """
    half_angle, tolerance, _ = reception
    _, x, y, axis = look
    r = echoes[i].latest.range_m
    dx, dy, turned = x - then.x, y - then.y, axis - then.axis
    if abs(turned) <= 2.0 * half_angle:  # it may still hear the same surface
        both, middle = half_angle - 0.5 * abs(turned), axis - 0.5 * turned  # what lies in the beam of either look
        along = abs(dx * math.cos(middle) + dy * math.sin(middle))
        across = abs(dy * math.cos(middle) - dx * math.sin(middle))
        due = math.floor((along * math.cos(both) - across * math.sin(both)) / max(STEP_MIN_M, 3.0 * tolerance))
        if due < 1:
            return 0.0
        lean = min(1.0, tolerance / math.hypot(dx, dy))  # the range stays within the tolerance for so long
        is_along = turns_beside_wall(r, axis - math.atan2(dy, dx), turned, reception)
        if is_along and is_parallel_wall(i, r, (dx, dy), yaw, mounts, reception, lean, echoes, path_m):
            return 0.0
        return float(due)
    return math.floor(abs(turned) / (2.0 * half_angle))


@kernel
def repeats(r: float, before: float) -> bool:
    """Return whether a reading repeats one before, m; both are below zero for a silence."""
    return r == before or (r >= 0.0 and before >= 0.0 and abs(r - before) <= REPEAT_M)


@kernel
def repeat_evidence(all_of: RingTrace) -> float:
    """Return all evidence that the ring repeats old readings, nat; equal ones alone convict it if it has noise."""
    without_noise = EQUAL_PRIOR * math.exp(-all_of.noise_nat)
    return all_of.repeated_nat - math.log(without_noise + (1.0 - without_noise) * math.exp(-all_of.equal_nat))


@kernel
def learn_noise(c: EchoTrace, r: float, x: float, y: float, axis: float, tolerance: float, all_of: RingTrace) -> None:
    """Learn whether the ring's ranges have noise, from a reading before which the sensor has hardly moved.

    No ring loses its noise, so once it is known it stays known.

    Parameters
    ----------
    c : record
        What is remembered of the sensor; this reading has been entered.
    r, x, y, axis : float
        The reading (m; below zero without an echo), the ring's place (m) and the sensor's direction (rad).
    tolerance : float
        As for `check_motion`.
    all_of : record
        What is remembered of the ring. Updated.
    """
    then = c.before
    if not c.is_compared or r < 0.0 or then.range_m < 0.0 or all_of.noise_nat >= SENSOR_NAT:
        return
    expected, change = math.hypot(x - then.x, y - then.y) + r * abs(axis - then.axis), abs(r - then.range_m)
    if expected <= tolerance and change <= tolerance + NOISE_SHARE * r:
        nats = NOISY_NAT if change > tolerance + expected else EQUAL_NAT
        all_of.noise_nat = min(max(0.0, all_of.noise_nat + nats), SENSOR_NAT)


@kernel
def noise_evidence(c: EchoTrace, reception: Reception) -> float:
    """Return the evidence of a reading that equals the one before, if the ranges have noise, nat; `c` has both.

    Noise is new where the sensor has moved by `STEP_MIN_M`, or turned so far that it looks elsewhere, to and fro as
    well; the evidence of a shorter motion is a share of that. A turn between two looks gives one new reading at most.
    """
    half_angle, tolerance, _ = reception
    now, then = c.latest, c.before
    moved = math.hypot(now.x - then.x, now.y - then.y) / max(STEP_MIN_M, 3.0 * tolerance)
    turned = min(abs(now.axis - then.axis) / (TURNING_SHARE * half_angle), 1.0)
    return (moved + turned) * math.log(1.0 + CHATTER_SHARE * now.range_m / tolerance)


@kernel
def winds(c: EchoTrace, tolerance: float) -> bool:
    """Return whether the robot turned and drove between the last two looks of a sensor, so that no range stays equal.

    A robot that turns as it drives keeps its course along no wall: a turn by φ on a way d moves it across by some d·φ
    more than on the way before. Ranges in coarse steps may be equal nevertheless.

    Parameters
    ----------
    c : record
        What is remembered of the sensor; its last look has been entered.
    tolerance : float
        As for `check_motion`.
    """
    now, then = c.latest, c.before
    shift = math.hypot(now.x - then.x, now.y - then.y) * abs(wrapped(now.axis - then.axis))
    return shift > tolerance and tolerance <= REPEAT_M


@kernel
def may_be_wall(
    i: int,
    r: float,
    way: tuple[float, float],
    yaw: float,
    mounts: Floats,
    reception: Reception,
    echoes: Records[EchoTrace],
    path_m: float,
) -> bool:
    """Return whether a rough wall along the path may answer sensor `i`.

    It may where no sensor looks nearer to the wall's normal, or one that does hears the wall.

    Parameters
    ----------
    i, r, way, yaw, mounts, reception, echoes, path_m
        As for `is_parallel_wall`.
    """
    half_angle, tolerance, reach = reception
    path = math.atan2(way[1], way[0])
    forward, left = math.sin(yaw - path), math.cos(yaw - path)
    for turn in range(2):
        side = 1.0 - 2.0 * turn
        own = side * wrapped(yaw + mounts[i, 2] - path)
        nearest = towards_wall(own, half_angle)
        if math.sin(nearest) < 1e-3:
            continue
        wall = side * (mounts[i, 0] * forward + mounts[i, 1] * left) + r * math.sin(nearest)
        is_outermost = True
        for k in range(len(echoes)):
            bearing = side * wrapped(yaw + mounts[k, 2] - path)
            best = towards_wall(bearing, half_angle)
            if k == i or math.sin(best) <= math.sin(nearest):
                continue
            is_outermost = False
            heard, is_fresh = echoes[k].agreed_m, path_m - echoes[k].agreed_path_m <= reach
            here = side * (mounts[k, 0] * forward + mounts[k, 1] * left)
            off = abs(wall - here - heard * math.sin(best)) / math.sin(best)
            if heard > 0.0 and is_fresh and off <= tolerance + NOISE_SHARE * heard:
                return True
        if is_outermost:
            return True
    return False


@kernel
def weigh_own_repeat(
    i: int,
    look: Look,
    yaw: float,
    mounts: Floats,
    reception: Reception,
    echoes: Records[EchoTrace],
    all_of: RingTrace,
) -> None:
    """Update the evidence that a sensor repeats its own reading, whatever the others hear: `own`, `stuck_nat`.

    Parameters
    ----------
    i, look, yaw, mounts, reception, echoes
        As for `changes_due`.
    all_of : record
        What is remembered of the ring.
    """
    c, path_m = echoes[i], all_of.path_m
    r, x, y, axis = look
    if not c.is_known or r < 0.0 or not repeats(r, c.own.range_m):
        mark(c.own, r, x, y, axis, path_m)
        c.stuck_nat = 0.0
        return
    way = (x - c.own.x, y - c.own.y)
    is_turned = abs(axis - c.own.axis) > 2.0 * reception[0]
    has_moved = path_m - c.own.path_m > reception[1]  # on the spot there is no path that a wall may go along
    is_wall = has_moved and not is_turned and may_be_wall(i, r, way, yaw, mounts, reception, echoes, path_m)
    if is_wall:
        mark(c.own, c.own.range_m, x, y, axis, path_m)
    due = REPEAT_NAT * changes_due(i, look, c.own, yaw, mounts, reception, echoes, path_m)
    more = 0.0
    if r == c.own.range_m and winds(c, reception[1]):
        more = WINDING_NAT
    elif r == c.own.range_m and not is_wall and all_of.noise_nat >= SENSOR_NAT:
        more = noise_evidence(c, reception)
    c.stuck_nat = max(due, c.stuck_nat + more)


@kernel
def weigh_repeat(
    i: int,
    look: Look,
    yaw: float,
    is_ahead: bool,
    mounts: Floats,
    reception: Reception,
    echoes: Records[EchoTrace],
    ring: Records[RingTrace],
) -> None:
    """Update the evidence that the ring repeats old readings by a sensor's reading: `echoes[i]` and `ring[0]`.

    A *standstill* is a time in which no reading ahead changes, not one of the robot. A reading ahead that has
    changed begins a new one, which clears the ring's evidence; one elsewhere takes its sensor's share back. Called
    once for each reading, after it was entered in `echoes` as the latest, and before `weigh_look`.

    Parameters
    ----------
    i : int
        The sensor.
    look : Look
        Its reading, its place and direction.
    yaw : float
        The ring's direction, rad.
    is_ahead : bool
        Whether the sensor looks in the direction of travel.
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame.
    reception : Reception
        What the ring hears.
    echoes : (n,) record of `EchoTrace`
        What each sensor has heard.
    ring : (1,) record of `RingTrace`
        What the ring has heard.
    """
    c, all_of = echoes[i], ring[0]
    r, x, y, axis = look
    tolerance = reception[1]
    weigh_own_repeat(i, look, yaw, mounts, reception, echoes, all_of)
    is_repeating = c.standstill == all_of.standstill
    if not c.is_known or not repeats(r, c.repeated.range_m if is_repeating else c.before.range_m):
        if c.is_known and is_ahead:
            all_of.standstill += 1
            all_of.repeated_nat = all_of.equal_nat = 0.0
        elif c.is_known and is_repeating:
            all_of.repeated_nat = max(0.0, all_of.repeated_nat - c.repeated_nat)
            all_of.equal_nat = max(0.0, all_of.equal_nat - c.equal_nat)
        c.standstill, c.repeated_nat, c.equal_nat = 0, 0.0, 0.0
        c.is_known = 1
    elif not is_repeating:
        c.standstill, c.repeated_nat, c.equal_nat = all_of.standstill, 0.0, 0.0
        mark(c.repeated, r, x, y, axis, all_of.path_m)
    elif r >= 0.0:
        due = REPEAT_NAT * changes_due(i, look, c.repeated, yaw, mounts, reception, echoes, all_of.path_m)
        is_equal = r == c.repeated.range_m and winds(c, tolerance)
        c.stuck_nat = max(c.stuck_nat, due)  # nothing else ahead has changed either
        due = min(max(due, c.repeated_nat + (WINDING_NAT if is_equal else 0.0)), SENSOR_NAT)
        if due > c.repeated_nat:
            all_of.repeated_nat += due - c.repeated_nat
            c.repeated_nat = due
        equal = min(c.equal_nat + noise_evidence(c, reception), SENSOR_NAT - c.repeated_nat)
        all_of.equal_nat = max(0.0, all_of.equal_nat + equal - c.equal_nat)
        c.equal_nat = equal
