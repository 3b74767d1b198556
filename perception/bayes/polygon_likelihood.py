"""What raw ranges say of a polygon of any form, open or closed, at a pose; and the search for the pose.

Smooth sides answer like mirrors, from the foot of the perpendicular and nowhere else; rough ones answer from their
nearest point in the beam, like a cone. Either rule says of each reading one range, which it should have or may have.
Nobody tells which rule a body keeps, so it is weighed under both and the two likelihoods are added: the choice is
paid for once. To choose reading by reading whichever explains it better would be paid for in false precision, for
there is always a pose at which a dozen accidents happen to help.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from config.units import FOOT_M
from perception.bayes.likelihood import loglik
from perception.bayes.range_fit import DROP_PRICE, DROP_SHARE, HITS, LLR, NEAR, THROUGHS, level_of
from perception.kernel import Floats, Ints, kernel

CORNER_PRICE: Final = 0.7
"""What an answer costs that a mirror may give or not, nat: about log 2. At a side's end or the beam's edge it costs
nothing: it is all the readings of a sensor that may then be heard, or none, and a price for each would turn the body
until they must."""

EDGE_REACH_M: Final = 1.0
EDGE_PRICE_PER_M: Final = 3.0 / FOOT_M
"""A convex edge only scatters, 20 to 30 dB below a mirror's echo: an answer from beyond this costs that much more."""

SURE: Final = 4
"""Column of `stats`, after those of `contact`: hits that had to be."""

NOTHING: Final = 1e18
"""A range (m) of no answer."""
MARGIN_M: Final = 0.12 * FOOT_M
"""A foot this near the end of its side need not answer: a pose is not known better."""
GRAZING_COS: Final = 0.05
"""An edge of the beam that is more parallel to a side than this does not hear it."""


class Ear(NamedTuple):
    """How a sensor hears: its beam, and what its readings are held against."""

    cos_opt: float
    """Cosines of the angles off the axis up to which a thing may answer, …"""
    cos_in: float
    """… must answer, …"""
    cos_half: float
    """… and nominally does; and the sines of the last two."""
    sin_half: float
    sin_in: float
    gate: float
    """As in `Settings`, as are the next three."""
    miss: float
    short: float
    per_metre: float


ALONG, ACROSS, TURN = range(3)
"""What a pose may do: move along the body's own axes, turn."""
TURN_PER_M: Final = 0.7 / FOOT_M
"""A search turns by this for each metre that it moves, rad/m: what moves the side of a body of 1.4 ft as far."""
AXES: Final = 3
SHRINK: Final = 0.5
"""What a step is multiplied with where no way gains."""
GAIN_MIN: Final = 1e-6
"""A step that gains less than this is none, nat."""
FINEST_M: Final = 0.005 * FOOT_M
"""A search ends with steps shorter than this: a tenth of the resolution, and the plateau is wider."""


@kernel
def predict(
    sx: float, sy: float, ux: float, uy: float, faces: Floats, closed: bool, ear: Ear
) -> tuple[float, bool, float, float, bool]:  # fmt: skip
    """Predict what a polygon answers, as a mirror and as a cone.

    =======  ========================================================  ===========================================
    rule     range                                                     must be heard
    =======  ========================================================  ===========================================
    mirror   nearest foot of a perpendicular in the beam               the foot well in the beam and on its side
             else the nearest corner in the beam                       never
    cone     nearest point in the beam: foot, corner or beam's edge    something lies well in the beam
    =======  ========================================================  ===========================================

    Sides that a closed outline turns its inside to do not answer; a side of an open one answers to both its faces.

    Parameters
    ----------
    sx, sy, ux, uy : float
        A sensor's place (m) and axis (unit vector) in the polygon's frame.
    faces : (sides, 5) float
        From `Settings.faces`: where a side begins x, y (m), its unit direction, its length (m); counter-clockwise.
    closed : bool
        Whether the last side joins the first.
    ear : Ear
        The beam.

    Returns
    -------
    (float, bool, float, float, bool)
        Range of a mirror (m, `NOTHING` where none), whether it must be heard, what its answer costs (nat); range of a
        cone, whether it must be heard.
    """
    foot = NOTHING
    foot_must = False
    corner2 = NOTHING * NOTHING
    before = 0
    after = 0
    edge = NOTHING
    must = False
    for k in range(faces.shape[0]):
        tx = faces[k, 2]
        ty = faces[k, 3]
        length = faces[k, 4]
        px = sx - faces[k, 0]
        py = sy - faces[k, 1]
        height = px * ty - py * tx
        ahead = uy * tx - ux * ty
        if height < 0.0:
            if closed:
                continue
            height = -height
            ahead = -ahead
        along = px * tx + py * ty
        aside = ux * tx + uy * ty
        if 0.0 <= along <= length and height < foot and ahead >= ear.cos_opt:
            foot = height
            foot_must = ahead >= ear.cos_in and MARGIN_M < along < length - MARGIN_M
        for end in range(2):
            across = end * length - along
            dot = height * ahead + across * aside
            if dot > 0.0:
                d2 = height * height + across * across
                if d2 < corner2 and dot * dot >= ear.cos_opt * ear.cos_opt * d2:
                    corner2 = d2
                    before = k - 1 + end
                    after = k + end
                must = must or dot * dot >= ear.cos_in * ear.cos_in * d2
        for hand in (-1.0, 1.0):
            towards = ahead * ear.cos_half - hand * aside * ear.sin_half
            if towards > GRAZING_COS:
                sideways = aside * ear.cos_half + hand * ahead * ear.sin_half
                if 0.0 <= along * towards + height * sideways <= length * towards:
                    edge = min(edge, height / towards)
            if not must:
                towards = ahead * ear.cos_in - hand * aside * ear.sin_in
                if towards > GRAZING_COS:
                    sideways = aside * ear.cos_in + hand * ahead * ear.sin_in
                    must = 0.0 <= along * towards + height * sideways <= length * towards
    corner = math.sqrt(corner2)
    nearest = min(foot, corner, edge)
    must = foot_must or (must and nearest < NOTHING)
    if foot < NOTHING:
        return foot, foot_must, 0.0, nearest, must
    price = CORNER_PRICE
    if closed and EDGE_REACH_M < corner < NOTHING:
        after %= faces.shape[0]
        if faces[before, 2] * faces[after, 3] - faces[before, 3] * faces[after, 2] > 0.0:
            price += EDGE_PRICE_PER_M * (corner - EDGE_REACH_M)
    return corner, False, price, nearest, must


@kernel
def surplus(throughs: float, hits: float) -> float:
    """Return what drop-outs beyond `DROP_SHARE` (and one) cost, nat."""
    return max(0.0, DROP_PRICE * (throughs - DROP_SHARE * (hits + throughs) - 1.0))


@kernel
def score_poly(
    w: Floats, n: int, every: int, x: float, y: float, theta: float, faces: Floats, closed: bool, ear: Ear,
    lev: Ints, table: Floats, inv_step: Floats, stats: Floats,
) -> float:  # fmt: skip
    """Weigh what readings say of a polygon at a pose: a log ratio to the background.

    ==========================  ===================================================
    range within the gate       the table's evidence; where it need not be heard never less than nothing
    beyond, must be heard       `miss`: a drop-out
    before, must be heard       `short`: something unseen stands in front
    else                        nothing
    ==========================  ===================================================

    So each reading counts under either rule; of what must be heard, drop-outs beyond `DROP_SHARE` (and
    one) cost `DROP_PRICE` more each. The evidence is log((exp M + exp C) / 2) of the two sums.

    Parameters
    ----------
    w : (capacity, 5) float
        Readings: place x, y (m), unit axis, range (m).
    n, every : int
        Readings in use, and the step from one that is weighed to the next.
    x, y, theta : float
        The polygon's pose: m, rad.
    faces, closed, ear
        As for `predict`.
    lev, table, inv_step
        As for `contact.score_circle`.
    stats : (≥ 5,) float
        Out: columns `LLR`, `HITS`, `THROUGHS`, `NEAR` of `contact`, and `SURE`; the counts by the likelier rule.

    Returns
    -------
    float
        `stats[LLR]`, nat.
    """
    c = math.cos(theta)
    s = math.sin(theta)
    mirror = 0.0
    cone = 0.0
    mirror_hits = 0.0
    mirror_throughs = 0.0
    mirror_near = 0.0
    mirror_sure = 0.0
    cone_hits = 0.0
    cone_throughs = 0.0
    cone_near = 0.0
    cone_sure = 0.0
    for j in range(0, n, every):
        dx = w[j, 0] - x
        dy = w[j, 1] - y
        r = w[j, 4]
        at, must, price, at_cone, must_cone = predict(
            c * dx + s * dy, -s * dx + c * dy, c * w[j, 2] + s * w[j, 3], -s * w[j, 2] + c * w[j, 3], faces, closed,
            ear,
        )  # fmt: skip
        k = level_of(lev, r, ear.per_metre)
        v = 0.0
        if abs(r - at) < ear.gate:
            v = loglik(table, inv_step, k, r - at) - price
            v = v if must else max(v, 0.0)
            mirror_near += 1.0
            if v > 0.0:
                mirror_hits += 1.0
                if must:
                    mirror_sure += 1.0
        elif must:
            v = ear.short
            if r > at:
                v = ear.miss
                mirror_throughs += 1.0
        mirror += v
        if at_cone != at or must_cone != must or price > 0.0:
            v = 0.0
            if abs(r - at_cone) < ear.gate:
                v = loglik(table, inv_step, k, r - at_cone)
                v = v if must_cone else max(v, 0.0)
            elif must_cone:
                v = ear.miss if r > at_cone else ear.short
        cone += v
        if abs(r - at_cone) < ear.gate:
            cone_near += 1.0
            if v > 0.0:
                cone_hits += 1.0
                if must_cone:
                    cone_sure += 1.0
        elif must_cone and r > at_cone:
            cone_throughs += 1.0
    mirror -= surplus(mirror_throughs, mirror_hits)
    cone -= surplus(cone_throughs, cone_hits)
    llr = max(mirror, cone) + math.log(0.5 + 0.5 * math.exp(-abs(mirror - cone)))
    stats[LLR] = llr
    stats[HITS] = mirror_hits if mirror >= cone else cone_hits
    stats[THROUGHS] = mirror_throughs if mirror >= cone else cone_throughs
    stats[NEAR] = mirror_near if mirror >= cone else cone_near
    stats[SURE] = mirror_sure if mirror >= cone else cone_sure
    return llr


@kernel
def moved(x: float, y: float, theta: float, axis: int, step: float) -> tuple[float, float, float]:
    """Return a pose moved `ALONG` or `ACROSS` the body by `step` (m), or turned by it (rad)."""
    if axis == ALONG:
        return x + step * math.cos(theta), y + step * math.sin(theta), theta
    if axis == ACROSS:
        return x - step * math.sin(theta), y + step * math.cos(theta), theta
    return x, y, theta + step


X, Y, THETA, BEST, STEP = range(5)
"""Cells of a search's numbers: where it is, what the readings say there (nat), how far it steps (m)."""
AT, LEFT, GAINED = range(3)
"""Cells of its counts: what it tries next (−1: nothing has been weighed yet), rounds it may still make, whether this
round gained."""


@kernel
def begin_search(f: Floats, z: Ints, x: float, y: float, theta: float, step: float, rounds: int) -> None:
    """Set out for a search.

    Parameters
    ----------
    f, z : (≥ 5,) float, (≥ 3,) int
        Out: the search, as above.
    x, y, theta : float
        From where, m, rad.
    step : float
        First step, m; turns go with it, by `TURN_PER_M`.
    rounds : int
        Rounds at most: the bound on the work.
    """
    f[X] = x
    f[Y] = y
    f[THETA] = theta
    f[BEST] = 0.0
    f[STEP] = step
    z[AT] = -1
    z[LEFT] = rounds
    z[GAINED] = 0


@kernel
def search(
    w: Floats, n: int, every: int, f: Floats, z: Ints, allowed: int, faces: Floats, closed: bool, ear: Ear,
    lev: Ints, table: Floats, inv_step: Floats, stats: Floats,
) -> int:  # fmt: skip
    """Go on searching for the pose of greatest likelihood, along the body's own axes.

    The likelihood has steps where sides begin and cease to answer, so nothing is differentiated: each axis is tried
    both ways, and where none gains the steps shrink. A search stops where it stands when its allowance is spent, and
    goes on from there; it is over when no round is left.

    Parameters
    ----------
    w, n, every
        As for `score_poly`.
    f, z
        The search, from `begin_search`; updated.
    allowed : int
        Poses to weigh at most.
    faces, closed, ear, lev, table, inv_step, stats
        As for `score_poly`; `stats` is scratch.

    Returns
    -------
    int
        Poses weighed.
    """
    weighed = 0
    while weighed < allowed and z[LEFT] > 0:
        weighed += 1
        if z[AT] < 0:
            f[BEST] = score_poly(w, n, every, f[X], f[Y], f[THETA], faces, closed, ear, lev, table, inv_step, stats)
            z[AT] = 0
            continue
        axis = z[AT] // 2
        step = f[STEP] * (TURN_PER_M if axis == TURN else 1.0) * (1.0 if z[AT] % 2 == 1 else -1.0)
        x, y, theta = moved(f[X], f[Y], f[THETA], axis, step)
        v = score_poly(w, n, every, x, y, theta, faces, closed, ear, lev, table, inv_step, stats)
        z[AT] += 1
        if v > f[BEST] + GAIN_MIN:
            f[X] = x
            f[Y] = y
            f[THETA] = theta
            f[BEST] = v
            z[GAINED] = 1
            z[AT] = 2 * (axis + 1)
        if z[AT] == 2 * AXES:
            z[AT] = 0
            z[LEFT] -= 1
            if z[GAINED] == 0:
                f[STEP] *= SHRINK
                if f[STEP] < FINEST_M:
                    z[LEFT] = 0
            z[GAINED] = 0
    return weighed
