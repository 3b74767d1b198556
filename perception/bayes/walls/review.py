"""Review of a wall by the readings that are remembered, once the other walls and objects are known.

As echoes come, a wall takes only those near its spans: what lies beyond may be another one's. Later the remembered
readings decide together how far a wall goes on: echoes on its line that nothing else explains are evidence for each
place along it, ranges that went on are evidence against. The likeliest sequence of covered and open places is found
by dynamic programming. Its line is fitted to them again, each echo of a beam's edge by what it says of the line:
the more the wall slants, the less its distance depends on the range.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.inference.reservoir import copy_reading
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import CircleTracks, StateRecord
from perception.bayes.memory.wall_records import MAX_WALLS, REMEMBERED_MAX, WALL_BINS, Wall, WallMap
from perception.bayes.walls.bins import EDGE_WEIGHT, bin_of, is_covered
from perception.bayes.walls.contact import (
    BEAM_EDGE,
    EXPLAINED_SIGMAS,
    FIRM_WEIGHT,
    FOOT,
    HIDING_PROBABILITY,
    NOWHERE,
    SPAN_MARGIN_M,
    are_mirrors,
    contact,
    edge_direction,
    edges_answer,
    is_from_circle,
    is_hidden,
    is_on_span,
    range_sigma,
    tolerance,
    touch,
    wall_normal,
    wall_point,
)
from perception.bayes.walls.evidence import SURE_SPAN_WEIGHT
from perception.bayes.walls.fit import OFFSET_INFORMATION, SLOPE_SIGMA
from perception.kernel import Floats, kernel
from perception.shared_numbers import FAR

RECENT_SPACING_M: Final = 0.08
"""Least distance between the recent readings of a sensor that nothing explains, and between the remembered ones."""
REMEMBERED_FIRST: Final = 1024
"""So many are remembered, those of some 3 m, before a wall is known and whether slanting walls answer, or are
mirrors: then readings show corners and edges. Where no wall stands, more of them would only fill recordings."""
REVIEWED_CHI2_MIN: Final = 14.0
"""A wall of less evidence than this, or of less weight than `FIRM_WEIGHT`, is not reviewed."""
ECHO_NAT: Final = 4.0
"""Evidence of an echo without error for the place where it touches the wall: its density against that of any range.
It is no more than against an end of a span: those echo in the mouth of a doorway."""
EDGE_SHARE: Final = 0.75
"""This share of it is believed where it comes from a beam's edge."""
PASS_NAT: Final = 2.5
"""Evidence of a range that went on against the place."""
SILENCE_NAT: Final = 2.0
"""Evidence of a silence against the place."""
PLACE_NAT: Final = 10.0
"""Greatest evidence of one place: the errors of its readings are not independent."""
GRAZING_MIN_COS: Final = 0.05
"""Least cosine between a sensor's axis and the normal of the wall under review: its line is known well."""
AS_WELL: Final = 0.3
"""Another wall explains an echo as well if its error, as a share of the greatest explained, is not larger by this."""
FORGOTTEN_NAT: Final = 2.0
"""Evidence for a place that was covered when its readings were still remembered."""
SURE_PASSES: Final = 0.1
"""A place on a span of `SURE_SPAN_WEIGHT`, and of so small a share of passes, is its wall's."""
UNHEARD_NAT: Final = 0.35
"""Evidence against a place without readings."""
SWITCH_NAT: Final = 4.0
"""Prior cost of each change between covered and open."""
KNOWN_SHARE: Final = 0.7
"""A fit replaces an earlier one of no more information than this: later the readings of both may be forgotten."""


@kernel
def is_reviewed(wall: Wall) -> bool:
    """Return whether enough is known of a wall to review it."""
    return bool(wall.span_count > 0 and wall.weight >= FIRM_WEIGHT and wall.chi2 >= REVIEWED_CHI2_MIN)


@kernel
def next_wall(room: WallMap, turn: int) -> int:
    """Return the wall that is reviewed in a turn, −1 if there is none."""
    known = 0
    for k in range(MAX_WALLS):
        known += is_reviewed(room.walls[k])
    if known == 0:
        return -1
    left = turn % known
    for k in range(MAX_WALLS):
        if is_reviewed(room.walls[k]):
            if left == 0:
                return k
            left -= 1
    return -1


@kernel
def remember(room: WallMap, sensor: int, q: Reading) -> None:
    """Remember a reading, if its sensor has moved far enough and it is of use, or may be."""
    if room.remembered_count >= REMEMBERED_FIRST and not edges_answer(room) and not are_mirrors(room):
        return
    is_first = room.remembered_of[sensor] == 0.0
    moved = math.hypot(q.x - room.remembered_x[sensor], q.y - room.remembered_y[sensor])
    if (is_first or moved > RECENT_SPACING_M) and (
        room.remembered_count < REMEMBERED_FIRST or next_wall(room, 0) >= 0
    ):
        room.remembered_of[sensor] = 1.0
        room.remembered_x[sensor] = q.x
        room.remembered_y[sensor] = q.y
        copy_reading(q, room.remembered[room.remembered_count % REMEMBERED_MAX])
        room.remembered_count += 1


@kernel
def review(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, turn: int) -> None:
    """Review one wall, where slanting walls answer: fit its line, and find how far it goes.

    Parameters
    ----------
    s, tracks, p
        Memory, updated, circles and settings.
    turn : int
        Counts the calls: each reviews the next wall.
    """
    k = next_wall(s[0].room, turn) if edges_answer(s[0].room) else -1
    if k >= 0:
        weigh(s, tracks, p, k)
        find_covered(s, k)


@kernel
def weigh(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, k: int) -> None:
    """Fit the line of wall `k` to the remembered echoes on its spans, and sum the evidence for each place beyond."""
    room = s[0].room
    wall = room.walls[k]
    evidence = s[0].scratch.wall_evidence
    for b in range(WALL_BINS):
        evidence[b] = 0.0
    nx, ny = wall_normal(wall)
    s0 = OFFSET_INFORMATION
    s1 = t0 = t1 = 0.0
    s2 = 1.0 / SLOPE_SIGMA**2
    for j in range(min(room.remembered_count, REMEMBERED_MAX)):
        q = room.remembered[j]
        kind, expected, along, cosine = touch(wall, q, p, GRAZING_MIN_COS)
        b = bin_of(along)
        if kind == NOWHERE or not 0 <= b < WALL_BINS:
            continue
        e = q.range_m - expected
        ex, ey = nx, ny
        if kind == BEAM_EDGE:
            ex, ey = edge_direction(q, nx, ny, p)
            cosine = nx * ex + ny * ey
        slack = tolerance(room, wall, along, expected, cosine)
        of = wall.bins[b]
        is_sure = (
            of.weight >= SURE_SPAN_WEIGHT and of.passes < SURE_PASSES * of.weight and is_on_span(wall, along, 0.0)
        )
        if e > slack:
            x, y = wall_point(wall, along)
            if not is_hidden(tracks, q, x, y):
                evidence[b] -= PASS_NAT if q.range_m < FAR else SILENCE_NAT
        elif abs(e) < slack and (is_sure or not is_of_another(room, tracks, q, p, k, abs(e) / slack)):
            z = EXPLAINED_SIGMAS * e / slack
            gain = min(ECHO_NAT, end_nat(room, wall, q, along, p)) - 0.5 * z * z
            evidence[b] += gain if kind == FOOT else EDGE_SHARE * gain
            if of.is_held == 1 or is_on_span(wall, along, 0.0):
                w = (1.0 if kind == FOOT else EDGE_WEIGHT) / ((nx * ex + ny * ey) * range_sigma(room, expected)) ** 2
                dx = q.x + q.range_m * ex - wall.origin_x
                dy = q.y + q.range_m * ey - wall.origin_y
                u = wall.normal_x * dy - wall.normal_y * dx
                v = wall.normal_x * dx + wall.normal_y * dy
                s0 += w
                s1 += w * u
                s2 += w * u * u
                t0 += w * v
                t1 += w * u * v
    det = s0 * s2 - s1 * s1
    if det > KNOWN_SHARE * wall.reviewed.information:
        line = wall.reviewed
        line.information = det
        line.offset = (s2 * t0 - s1 * t1) / det
        line.slope = (s0 * t1 - s1 * t0) / det
        line.variance_offset = s2 / det
        line.covariance = -s1 / det
        line.variance_slope = s0 / det
    stand_by_what_is_forgotten(wall, evidence)


@kernel
def stand_by_what_is_forgotten(wall: Wall, evidence: Floats) -> None:
    """Let the bins speak where no reading is remembered."""
    for b in range(WALL_BINS):
        if evidence[b] == 0.0 and wall.bins[b].is_held == 1 and is_covered(wall.bins[b]):
            evidence[b] = FORGOTTEN_NAT


@kernel
def end_nat(room: WallMap, wall: Wall, q: Reading, along: float, p: SettingsRecord) -> float:
    """Return half the least χ² of an echo from the ends of a wall's spans in its beam, +inf if it touches a span.

    Parameters
    ----------
    room, wall, q, p
        The noise, the wall, the reading and the settings.
    along : float
        Where it touches the wall's line, m.
    """
    least = math.inf
    if is_on_span(wall, along, 0.0):
        return least
    for i in range(2 * wall.span_count):
        span = wall.spans[i // 2]
        x, y = wall_point(wall, span.low if i % 2 == 0 else span.high)
        dx = x - q.x
        dy = y - q.y
        d = math.sqrt(dx * dx + dy * dy)
        if dx * q.axis_x + dy * q.axis_y >= p[0].cos_half_angle * d:
            least = min(least, 0.5 * ((q.range_m - d) / range_sigma(room, d)) ** 2)
    return least


@kernel
def is_of_another(room: WallMap, tracks: CircleTracks, q: Reading, p: SettingsRecord, own: int, error: float) -> bool:
    """Return whether another wall or a round object explains an echo as well as wall `own` does.

    Parameters
    ----------
    room, tracks, q, p
        The walls, the circles, the echo and the settings.
    own : int
        The wall.
    error : float
        Its error, as a share of the greatest explained.
    """
    for k in range(MAX_WALLS):
        wall = room.walls[k]
        if k == own or not is_reviewed(wall):
            continue
        kind, expected, along, dot = contact(wall, q, p)
        if kind != NOWHERE and is_on_span(wall, along, SPAN_MARGIN_M):
            other = abs(q.range_m - expected) / tolerance(room, wall, along, expected, dot)
            if other < min(1.0, error + AS_WELL):
                return True
    return is_from_circle(room, tracks, q, p, HIDING_PROBABILITY)


@kernel
def find_covered(s: StateRecord, k: int) -> None:
    """Mark the covered bins of wall `k`: the likeliest sequence of covered and open places, by its evidence."""
    bins = s[0].room.walls[k].bins
    evidence = s[0].scratch.wall_evidence
    covered = s[0].scratch.wall_covered
    best_open = 0.0
    best_covered = -SWITCH_NAT
    for b in range(WALL_BINS):
        gain = -UNHEARD_NAT if evidence[b] == 0.0 else max(-PLACE_NAT, min(PLACE_NAT, evidence[b]))
        # Whether the place before was covered, if this one is open (1), and if this one is covered (2).
        before = 0
        if best_covered - SWITCH_NAT > best_open:
            before += 1
        if best_covered >= best_open - SWITCH_NAT:
            before += 2
        covered[b] = before
        now_open = max(best_open, best_covered - SWITCH_NAT)
        best_covered = max(best_covered, best_open - SWITCH_NAT) + gain
        best_open = now_open
    is_on = best_covered - SWITCH_NAT > best_open
    for i in range(WALL_BINS):
        b = WALL_BINS - 1 - i
        before = covered[b]
        bins[b].is_held = 1 if is_on and evidence[b] > 0.0 else 0
        bins[b].is_open = 0 if is_on else 1
        is_on = before >= 2 if is_on else before % 2 == 1
