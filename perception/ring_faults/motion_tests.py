"""The kernels behind `perception.ring_faults.monitor`: sequential tests of a ring's readings against its own motion.

Each test sums the logarithms of likelihood ratios, never below zero (CUSUM, Page 1954): how much better a reading is
explained by a ring that lies than by an honest one among objects that stand still. The sum is compared with
`perception.ring_faults.memory.EVIDENCE_NAT`, the one threshold.
"""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import Floats, entry_kernel, kernel
from perception.records import Records
from perception.ring_faults.changes import (
    EXCHANGED,
    NO_CHANGE,
    NOISE_M,
    TURNING_SHARE,
    Expected,
    mirror_left,
    weigh_changes,
)
from perception.ring_faults.memory import (
    EVIDENCE_NAT,
    HALVES,
    LOOK_KINDS,
    MOVES,
    NO_ECHO_M,
    QUARTERS,
    EchoTrace,
    Look,
    Reception,
    RingTrace,
    mark,
)
from perception.ring_faults.mounting import weigh_change
from perception.ring_faults.repeats import (
    learn_noise,
    repeat_evidence,
    weigh_repeat,
)
from perception.ring_faults.replays import PAST_LOOKS, PastLooks, weigh_replay
from perception.ring_faults.servo_mounting import DirectionTrace, forget_directions, weigh_direction
from perception.sensor_faults.wall import NOISE_SHARE
from perception.sensor_mounts import RingPose, sensor_pose

CHANGE_NAT: Final = math.log(3e5 / 0.002)
"""`EVIDENCE_NAT` for changes from one round of the firing pattern to the next, of which a day has 3·10⁵, nat."""
REPLAY_NAT: Final = EVIDENCE_NAT + math.log(PAST_LOOKS)
"""The same for a replay, of which each lag is tested, nat."""
RESTART_M: Final = 0.25
"""The memory starts again where the ring has moved farther than this between two firings, m."""
AHEAD_COS: Final = math.cos(math.radians(100.0))
"""Sensors within 100° of the direction of travel look ahead: what the robot may drive into, and both its sides."""

LEADS_M: Final = 0.5
"""A known echo leads to expect the next one within this way of the ring, m."""
REACH_SHARE: Final = 0.8
"""What is expected beyond this share of the ring's reach may be out of reach next time."""
MISSED: Final = 0.9
"""Share of looks that miss a known echo, if readings do not depend on what is there."""
HONEST_MISS_MIN: Final = 0.04
"""An honest ring misses no less of its known echoes than this share: all surfaces end."""
HONEST_MISS_MAX: Final = 0.6
"""An honest ring misses no more of its known echoes than this share, but where a mirror has left: some are heard."""
MIRRORS_MISSED: Final = 0.4
"""Share of mirrors for each look that a sensor which turns misses more often. With .4 rings of 8 to 32 sensors that
fall silent among rough walls are named within 8 s in 89 of 160 drives, in 91 if mirrors leave one by one; with 2, in
75. An honest ring that turns between two mirrors keeps within 10 nat."""
STEADY, TURNING, AGAIN, DOUBTED = range(LOOK_KINDS)
"""Kinds of looks: at an echo that agreed with the one before, from the same direction or another; the second look at
one that was missed; and at one that agreed with nothing. After that, silence is as honest: it was a stray."""
HONEST_MISSES: Final = (2.0, 8.0, 8.0, 10.0)
"""Misses of each kind, among `HONEST_LOOKS`, that stand for what is known of rings before a run."""
HONEST_LOOKS: Final = 20.0
"""Looks that stand for what is known of rings before a run."""
MEMORY_LOOKS: Final = 500.0
"""Looks over which the rates of misses are learned; older ones count half."""

NOTHING, REPEATED, VANISHED, SCATTERED, TURNED = range(5)
"""What `check_motion` returns: nothing is wrong; the ring repeats old readings; most known echoes have gone
silent, or are elsewhere; `TURNED` plus 0 to 2: it is turned by a quarter, two or three."""
CHANGED: Final = TURNED + QUARTERS - 1
"""This plus one of the changes of `perception.ring_faults.changes`: the ring has changed so."""
STUCK_SENSOR: Final = CHANGED + EXCHANGED + 1
"""This plus the number of a sensor that repeats its reading while no other one hears anything new."""


@kernel
def honest_share(all_of: RingTrace, kind: int) -> float:
    """Return the share of an honest ring's looks of a kind that miss a known echo, as learned so far."""
    share: float = (all_of.misses[kind] + HONEST_MISSES[kind]) / (all_of.looks[kind] + HONEST_LOOKS)
    return min(max(share, HONEST_MISS_MIN), HONEST_MISS_MAX)


@kernel
def weigh_look(
    i: int,
    look: Look,
    is_ahead: bool,
    reception: Reception,
    echoes: Records[EchoTrace],
    all_of: RingTrace,
) -> None:
    """Test whether a reading is where the sensor's last echo leads to expect it.

    How often an honest ring misses an echo is learned on the way, for each kind of look; a mirror may besides have
    left the beam.

    Parameters
    ----------
    i : int
        The sensor.
    look : Look
        Its reading, place and direction.
    is_ahead : bool
        Whether it looks in the direction of travel.
    reception : Reception
        What the ring hears.
    echoes : (n,) records
        What is remembered of each sensor. Updated for this one.
    all_of : record
        What is remembered of the ring. Updated.
    """
    c = echoes[i]
    r, x, y, axis = look
    half_angle, tolerance, reach = reception
    heard = c.heard.range_m
    moved, turned = math.hypot(x - c.heard.x, y - c.heard.y), abs(axis - c.heard.axis)
    leads = heard > 0.0 and all_of.path_m - c.heard.path_m <= LEADS_M and turned < half_angle
    is_known = c.agreed > 0 and c.silences < 2
    is_stray = c.agreed == 0 and c.silences == 0
    expected = MOVES * moved + heard * turned + tolerance + NOISE_SHARE * heard + NOISE_M
    agrees = is_stray if r < 0.0 else abs(r - heard) <= expected
    if leads and heard + moved < REACH_SHARE * reach and (is_known or is_stray or r >= 0.0):
        kind = kind_of_look(c, turned > TURNING_SHARE * half_angle) if is_known else DOUBTED
        honest = honest_share(all_of, kind)
        if kind == TURNING:
            honest = min(max(honest, 0.25 * turned / half_angle), HONEST_MISS_MAX)
        if is_known:
            steady = honest_share(all_of, STEADY)
            mirrors = MIRRORS_MISSED * max(0.0, honest_share(all_of, TURNING) - steady)
            left = mirror_left(i, mirrors, steady, half_angle, echoes)
            honest = min(max(honest, left), MISSED)
        evidence = math.log((1.0 - MISSED) / (1.0 - honest)) if agrees else math.log(MISSED / honest)
        add_evidence(all_of, evidence, is_ahead)
        if all_of.missed_nat[0] == 0.0:
            all_of.silent = all_of.elsewhere = 0
        elif not agrees:
            all_of.silent += r < 0.0
            all_of.elsewhere += r >= 0.0
        learn_misses(all_of, kind, 0.0 if agrees else 1.0)
    keep_echo(c, look, leads and agrees, all_of.path_m)


@kernel
def kind_of_look(c: EchoTrace, is_turning: bool) -> int:
    """Return the kind of a look at an echo that was heard before."""
    if c.silences > 0:
        return AGAIN
    return TURNING if is_turning else STEADY


@kernel
def add_evidence(all_of: RingTrace, evidence: float, is_ahead: bool) -> None:
    """Add the evidence of a look that the ring misses echoes, for all of it and for what looks ahead."""
    for part in range(HALVES):
        if part == 0 or is_ahead:
            all_of.missed_nat[part] = max(0.0, all_of.missed_nat[part] + evidence)


@kernel
def learn_misses(all_of: RingTrace, kind: int, misses: float) -> None:
    """Count a look of a kind; old looks are forgotten."""
    all_of.misses[kind] += misses
    all_of.looks[kind] += 1.0
    if all_of.looks[kind] > MEMORY_LOOKS:
        all_of.looks[kind] *= 0.5
        all_of.misses[kind] *= 0.5


@kernel
def keep_echo(c: EchoTrace, look: Look, agrees: bool, path_m: float) -> None:
    """Keep a reading as the sensor's last echo if it is one; `agrees`: it is where that before leads to expect it."""
    r, x, y, axis = look
    if r < 0.0:
        c.silences += 1
        c.is_anchored = 1 if c.is_anchored and c.silences < 2 else 0
    else:
        c.agreed = c.agreed + 1 if agrees else 0
        if c.agreed > 0:
            c.agreed_m, c.agreed_path_m = r, path_m
        c.is_anchored = 1 if c.is_anchored and c.agreed > 0 else 0
        c.silences = 0
        mark(c.heard, r, x, y, axis, path_m)


@kernel
def conclusion(all_of: RingTrace) -> int:
    """Return what the evidence says of the ring: `NOTHING`, or what is wrong."""
    if repeat_evidence(all_of) >= EVIDENCE_NAT:
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
    all_of.repeated_nat = all_of.equal_nat = 0.0
    all_of.missed_nat[:] = 0.0
    for quarter in range(QUARTERS):
        all_of.turned_nat[quarter] = min(0.0, all_of.turned_nat[quarter])
    all_of.silent = all_of.elsewhere = 0


@kernel
def forget_echoes(echoes: Records[EchoTrace]) -> None:
    """Drop what each sensor heard."""
    for i in range(len(echoes)):
        echoes[i].is_known = echoes[i].is_compared = echoes[i].is_anchored = echoes[i].agreed = 0
        echoes[i].heard.range_m = echoes[i].agreed_m = NO_ECHO_M


@entry_kernel
def check_motion(
    ranges: Floats,
    pose: RingPose,
    mounts: Floats,
    reception: Reception,
    echoes: Records[EchoTrace],
    ring: Records[RingTrace],
    expected: Records[Expected],
    past: PastLooks,
    directions: Records[DirectionTrace],
) -> int:
    """Test the readings of a firing; return what is wrong, `NOTHING` where nothing is.

    Parameters
    ----------
    ranges : (n,) float
        As in a `Firing`, m; NaN for sensors that are masked as well.
    pose : RingPose
        Place (m) and direction (rad) of the ring.
    mounts : (n, 3) float
        Place x, y (m) and direction (rad) of each sensor in the ring's frame.
    reception : Reception
        What the ring hears; a reading at its reach is a silence.
    echoes : (n,) records
        What is remembered of each sensor. Updated.
    ring : (1,) record
        What is remembered of the ring. Updated. After a finding the evidence is dropped.
    expected : (n,) records
        Overwritten.
    past : PastLooks
        As for `replays.weigh_replay`. Updated.
    directions : (LOOK_DIRECTIONS,) records
        Of a ring with a servo, what was heard last from each direction; else none. Updated.
    """
    x, y, yaw = pose
    half_angle, tolerance, reach = reception
    if not math.isfinite(x + y + yaw):
        return NOTHING
    all_of = ring[0]
    moved = math.hypot(x - all_of.x, y - all_of.y)
    if not all_of.is_started or moved > RESTART_M:
        all_of.is_started = 1
        begin_evidence(all_of)
        past.replayed_nat[:] = 0.0
        past.counts[:] = 0
        forget_directions(directions)
        forget_echoes(echoes)
    elif moved > 0.0:
        all_of.travel_rad = math.atan2(y - all_of.y, x - all_of.x)
        all_of.path_m += moved
    all_of.x, all_of.y = x, y
    replayed = 0.0
    for i in range(ranges.shape[0]):
        if math.isnan(ranges[i]):
            continue
        r = ranges[i] if ranges[i] < reach - tolerance else NO_ECHO_M
        own_x, own_y, axis = sensor_pose(mounts, i, pose)
        is_ahead = math.cos(axis - all_of.travel_rad) > AHEAD_COS
        then = echoes[i].latest
        echoes[i].is_compared = echoes[i].is_known
        mark(echoes[i].before, then.range_m, then.x, then.y, then.axis, then.path_m)
        mark(then, r, x, y, axis, all_of.path_m)
        learn_noise(echoes[i], r, x, y, axis, tolerance, all_of)
        look = (r, own_x, own_y, axis)
        weigh_repeat(i, look, yaw, is_ahead, mounts, reception, echoes, ring)
        heard_before = echoes[i].before.range_m if echoes[i].is_compared else NO_ECHO_M
        nats = weigh_replay(i, look, heard_before, reception, past)
        replayed = max(replayed, nats)
        weigh_look(i, look, is_ahead, reception, echoes, all_of)
        if len(directions) > 0:
            weigh_direction(i, look, yaw, mounts, reception, echoes, directions, all_of)
        elif r >= 0.0:
            weigh_change(i, look, yaw, mounts, reception, echoes, all_of)
    found = REPEATED if replayed >= REPLAY_NAT else conclusion(all_of)
    if found == NOTHING:
        missed = (honest_share(all_of, STEADY), honest_share(all_of, TURNING))
        change, nats = weigh_changes(mounts, half_angle, tolerance, reach, missed, echoes, expected)
        if change != NO_CHANGE and nats >= CHANGE_NAT:
            found = CHANGED + change
    if found != NOTHING:
        begin_evidence(all_of)
        past.replayed_nat[:] = 0.0
        for i in range(len(echoes)):
            echoes[i].is_compared = 0
        return found
    other_nat = 0.0
    for quarter in range(QUARTERS):  # the sensors ahead on a turned ring hear the walls beside the path
        other_nat = max(other_nat, all_of.turned_nat[quarter])
    for i in range(len(echoes)):
        if echoes[i].stuck_nat >= EVIDENCE_NAT + other_nat:
            echoes[i].stuck_nat = 0.0
            return STUCK_SENSOR + i
    return NOTHING
