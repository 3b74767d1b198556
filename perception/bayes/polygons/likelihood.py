"""Evidence of raw ranges for a polygon, open or closed, at a pose; and the search for the pose.

Smooth sides reflect like mirrors, only from the foot of the perpendicular; rough ones answer from their nearest point
in the beam (cone rule). Either rule predicts one range for each reading, and whether the echo must be heard. Which
rule a body obeys is unknown, so it is scored under both and the two likelihoods are added: the choice is paid for
once. Choosing the better rule for each reading would give false precision, because some pose always gains from a
dozen chance agreements.
"""

from __future__ import annotations

import math

from perception.bayes.inference.cross_path import is_crossed
from perception.bayes.inference.likelihood import level_of, log_likelihood
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.job_records import ACROSS, ALONG, AXES, TURN, PoseSearch
from perception.bayes.memory.parameters import DROP_OUT_NAT, DROP_OUT_SHARE
from perception.bayes.memory.polygon_parameters import (
    GRAZING_COS,
    SEARCH_FINEST_M,
    SEARCH_GAIN_MIN_NAT,
    SEARCH_SHRINK,
    SEARCH_TURN_RAD_PER_M,
    SIDE_END_MARGIN_M,
)
from perception.bayes.memory.scratch import Score
from perception.bayes.memory.settings_record import PolygonSide, SettingsRecord
from perception.bayes.polygons.cross_path import NO_ANSWER_M, corner_nat, score_crosses
from perception.kernel import kernel
from perception.records import Records


@kernel
def is_met(towards: float, sideways: float, along: float, height: float, length: float) -> bool:
    """Return whether a direction of a beam meets a side.

    Parameters
    ----------
    towards, sideways : float
        The direction, a unit vector: towards the side's line, and along it.
    along, height : float
        Where the sensor is along the side, and how far from its line, m.
    length : float
        Of the side, m.
    """
    return towards > GRAZING_COS and 0.0 <= along * towards + height * sideways <= length * towards


@kernel
def predict(
    sx: float, sy: float, ux: float, uy: float, sides: Records[PolygonSide], is_closed: bool, p: SettingsRecord
) -> tuple[float, bool, float, float, bool]:
    """Return a polygon's predicted ranges, as a mirror and as a cone, and whether each must be heard.

    =======  ========================================================  ===========================================
    rule     range                                                     must be heard
    =======  ========================================================  ===========================================
    mirror   nearest foot of a perpendicular in the beam               the foot well in the beam and on its side
             else the nearest corner in the beam                       never
    cone     nearest point in the beam: foot, corner or beam's edge    something lies well in the beam
    =======  ========================================================  ===========================================

    Sides of a closed outline answer only on their outside; a side of an open outline answers on both faces.

    Parameters
    ----------
    sx, sy, ux, uy : float
        A sensor's place (m) and axis (unit vector) in the polygon's frame.
    sides : (n,) PolygonSide
        Counter-clockwise.
    is_closed : bool
        Whether the last side joins the first.
    p : (1,) Settings
        The beam.

    Returns
    -------
    (float, bool, float, float, bool)
        Range of a mirror (m, `NO_ANSWER_M` where none), whether it must be heard, what its answer costs (nat); range
        of a cone, whether it must be heard.
    """
    foot = NO_ANSWER_M
    foot_must = False
    corner2 = NO_ANSWER_M * NO_ANSWER_M
    before = 0
    after = 0
    edge = NO_ANSWER_M
    must = False
    cos_may, cos_must, sin_must = p[0].cos_may_answer, p[0].cos_must_answer, p[0].sin_must_answer
    cos_half, sin_half = p[0].cos_half_angle, p[0].sin_half_angle
    for k in range(len(sides)):
        side = sides[k]
        tx = side.tangent_x
        ty = side.tangent_y
        length = side.length
        px = sx - side.x
        py = sy - side.y
        height = px * ty - py * tx
        ahead = uy * tx - ux * ty
        if height < 0.0:
            if is_closed:
                continue
            height = -height
            ahead = -ahead
        along = px * tx + py * ty
        lateral = ux * tx + uy * ty
        if 0.0 <= along <= length and height < foot and ahead >= cos_may:
            foot = height
            foot_must = ahead >= cos_must and SIDE_END_MARGIN_M < along < length - SIDE_END_MARGIN_M
        for end in range(2):
            across = end * length - along
            dot = height * ahead + across * lateral
            if dot > 0.0:
                d2 = height * height + across * across
                if d2 < corner2 and dot * dot >= cos_may * cos_may * d2:
                    corner2 = d2
                    before = k - 1 + end
                    after = k + end
                must = must or dot * dot >= cos_must * cos_must * d2
        for hand in (-1.0, 1.0):
            towards = ahead * cos_half - hand * lateral * sin_half
            sideways = lateral * cos_half + hand * ahead * sin_half
            if is_met(towards, sideways, along, height, length):
                edge = min(edge, height / towards)
            if not must:
                towards = ahead * cos_must - hand * lateral * sin_must
                must = is_met(towards, lateral * cos_must + hand * ahead * sin_must, along, height, length)
    corner = math.sqrt(corner2)
    nearest = min(foot, corner, edge)
    must = foot_must or (must and nearest < NO_ANSWER_M)
    if foot < NO_ANSWER_M:
        return foot, foot_must, 0.0, nearest, must
    return corner, False, corner_nat(sides, before, after, is_closed, corner), nearest, must


@kernel
def surplus_nat(throughs: float, hits: float) -> float:
    """Return the price (nat) of drop-outs beyond `DROP_OUT_SHARE` (and one)."""
    return max(0.0, DROP_OUT_NAT * (throughs - DROP_OUT_SHARE * (hits + throughs) - 1.0))


@kernel
def range_nat(r: float, at: float, must: bool, price: float, p: SettingsRecord, level: int) -> float:
    """Return what a range says for a polygon by one of both rules, nat; see `score_polygon`.

    Parameters
    ----------
    r, at : float
        The range, and the predicted one, m.
    must : bool
        Whether it must be heard.
    price : float
        What the answer costs, nat.
    p : (1,) Settings
        Gate and likelihood.
    level : int
        Of the range, as of `level_of`.
    """
    if abs(r - at) < p[0].gate_m:
        v = log_likelihood(p, level, r - at) - price
        return v if must else max(v, 0.0)
    if must:
        return p[0].missed_echo_nat if r > at else p[0].short_echo_nat
    return 0.0


@kernel
def counts_of(v: float, r: float, at: float, must: bool, gate: float) -> tuple[float, float, float, float]:
    """Return whether a range is near the predicted one, a hit, a sure hit, and a drop-out, 1 or 0 each.

    Parameters
    ----------
    v : float
        What the range says, as of `range_nat`, nat.
    r, at, must
        As for `range_nat`.
    gate : float
        How far off a near range may be, m.
    """
    if abs(r - at) < gate:
        hit = 1.0 if v > 0.0 else 0.0
        return 1.0, hit, hit if must else 0.0, 0.0
    return 0.0, 0.0, 0.0, 1.0 if must and r > at else 0.0


@kernel
def score_polygon(
    readings: Records[Reading],
    every: int,
    pose: tuple[float, float, float],
    sides: Records[PolygonSide],
    is_closed: bool,
    p: SettingsRecord,
    noise: int,
    score: Score,
) -> float:
    """Return the log ratio (nat) of readings for a polygon at a pose to the background.

    ==========================  ===================================================
    range within the gate       the table's evidence; where it need not be heard never less than nothing
    beyond, must be heard       `missed_echo_nat`: a drop-out
    before, must be heard       `short_echo_nat`: something unseen stands in front
    else                        nothing
    ==========================  ===================================================

    So each reading counts under either rule; of what must be heard, drop-outs beyond `DROP_OUT_SHARE` (and
    one) cost `DROP_OUT_NAT` more each. The evidence is log((exp M + exp C) / 2) of the two sums.

    Parameters
    ----------
    readings : (n,) Reading
        Raw ranges.
    every : int
        Step from one scored reading to the next.
    pose : (float, float, float)
        The polygon's place x, y (m) and heading (rad).
    sides, is_closed, p
        As for `predict`.
    noise : int
        Index of the assumed noise.
    score : Score
        Out: `log_likelihood_ratio`, `hits`, `misses`, `near` and `sure_hits`; the counts by the likelier rule.

    Returns
    -------
    float
        The log ratio, nat.
    """
    x, y, heading = pose
    gate = p[0].gate_m
    c = math.cos(heading)
    s = math.sin(heading)
    mirror = mirror_near = mirror_hits = mirror_sure = mirror_throughs = 0.0
    cone = cone_near = cone_hits = cone_sure = cone_throughs = 0.0
    has_crosses = False
    for j in range(0, len(readings), every):
        q = readings[j]
        if is_crossed(q):
            has_crosses = True
            continue
        dx = q.x - x
        dy = q.y - y
        r = q.range_m
        at, must, price, at_cone, must_cone = predict(
            c * dx + s * dy,
            -s * dx + c * dy,
            c * q.axis_x + s * q.axis_y,
            -s * q.axis_x + c * q.axis_y,
            sides,
            is_closed,
            p,
        )
        k = level_of(p, noise, r)
        v = range_nat(r, at, must, price, p, k)
        near, hit, sure, through = counts_of(v, r, at, must, gate)
        mirror += v
        mirror_near += near
        mirror_hits += hit
        mirror_sure += sure
        mirror_throughs += through
        if at_cone != at or must_cone != must or price > 0.0:
            v = range_nat(r, at_cone, must_cone, 0.0, p, k)
            near, hit, sure, through = counts_of(v, r, at_cone, must_cone, gate)
        cone += v
        cone_near += near
        cone_hits += hit
        cone_sure += sure
        cone_throughs += through
    if has_crosses:  # in a loop of their own: the one above is the innermost of all
        over_mirror, near, hits, over_cone, near_cone, hits_cone = score_crosses(
            readings, every, (x, y, c, s), sides, is_closed, p, noise
        )
        mirror += over_mirror
        mirror_near += near
        mirror_hits += hits
        cone += over_cone
        cone_near += near_cone
        cone_hits += hits_cone
    mirror -= surplus_nat(mirror_throughs, mirror_hits)
    cone -= surplus_nat(cone_throughs, cone_hits)
    llr = max(mirror, cone) + math.log(0.5 + 0.5 * math.exp(-abs(mirror - cone)))
    score.log_likelihood_ratio = llr
    score.hits = mirror_hits if mirror >= cone else cone_hits
    score.misses = mirror_throughs if mirror >= cone else cone_throughs
    score.near = mirror_near if mirror >= cone else cone_near
    score.sure_hits = mirror_sure if mirror >= cone else cone_sure
    return llr


@kernel
def moved(x: float, y: float, heading: float, axis: int, step: float) -> tuple[float, float, float]:
    """Return a pose moved along or across the body, or turned.

    Parameters
    ----------
    x, y, heading : float
        The pose, m, rad.
    axis, step
        `ALONG`, `ACROSS` or `TURN`, and by how much, m or rad.
    """
    if axis == ALONG:
        return x + step * math.cos(heading), y + step * math.sin(heading), heading
    if axis == ACROSS:
        return x - step * math.sin(heading), y + step * math.cos(heading), heading
    return x, y, heading + step


@kernel
def begin_search(search: PoseSearch, x: float, y: float, heading: float, step_m: float, rounds: int) -> None:
    """Initialise a pose search.

    Parameters
    ----------
    search : PoseSearch
        Out.
    x, y, heading : float
        Where it starts, m, rad.
    step_m : float
        First step, m; turns go with it, by `SEARCH_TURN_RAD_PER_M`.
    rounds : int
        Rounds at most: the bound on the work.
    """
    search.x = x
    search.y = y
    search.heading = heading
    search.log_likelihood_ratio = 0.0
    search.step_m = step_m
    search.trial = -1
    search.rounds_left = rounds
    search.has_gained = 0


@kernel
def continue_search(
    search: PoseSearch,
    allowed: int,
    readings: Records[Reading],
    every: int,
    sides: Records[PolygonSide],
    is_closed: bool,
    p: SettingsRecord,
    noise: int,
    score: Score,
) -> int:
    """Continue a search for the pose of greatest likelihood; return the number of poses scored.

    The likelihood has steps where sides begin and cease to answer, so no derivative is used: a coordinate search
    tries each of the body's axes both ways, and shrinks the steps when none gains. A search stops when its budget is
    spent and continues from there; it is over when no round is left.

    Parameters
    ----------
    search : PoseSearch
        From `begin_search`; updated.
    allowed : int
        Poses to score at most.
    readings, every, sides, is_closed, p, noise, score
        As for `score_polygon`; `score` is scratch.
    """
    scored = 0
    while scored < allowed and search.rounds_left > 0:
        scored += 1
        if search.trial < 0:
            search.log_likelihood_ratio = score_polygon(
                readings, every, (search.x, search.y, search.heading), sides, is_closed, p, noise, score
            )
            search.trial = 0
            continue
        axis = search.trial // 2
        step = (
            search.step_m
            * (SEARCH_TURN_RAD_PER_M if axis == TURN else 1.0)
            * (1.0 if search.trial % 2 == 1 else -1.0)
        )
        x, y, heading = moved(search.x, search.y, search.heading, axis, step)
        v = score_polygon(readings, every, (x, y, heading), sides, is_closed, p, noise, score)
        search.trial += 1
        if v > search.log_likelihood_ratio + SEARCH_GAIN_MIN_NAT:
            search.x = x
            search.y = y
            search.heading = heading
            search.log_likelihood_ratio = v
            search.has_gained = 1
            search.trial = 2 * (axis + 1)
        if search.trial == 2 * AXES:
            search.trial = 0
            search.rounds_left -= 1
            if search.has_gained == 0:
                search.step_m *= SEARCH_SHRINK
                if search.step_m < SEARCH_FINEST_M:
                    search.rounds_left = 0
            search.has_gained = 0
    return scored
