"""What raw ranges say of a polygon of any form, open or closed, at a pose; and the search for the pose.

Smooth sides answer like mirrors, from the foot of the perpendicular and nowhere else; rough ones answer from their
nearest point in the beam, like a cone. Either rule says of each reading one range, which it should have or may have.
Nobody tells which rule a body keeps, so it is weighed under both and the two likelihoods are added: the choice is
paid for once. To choose reading by reading whichever explains it better would be paid for in false precision, for
there is always a pose at which a dozen accidents happen to help.
"""

from __future__ import annotations

import math
from typing import Final

from perception.full.contact import DROP_PRICE, DROP_SHARE, HITS, LLR, NEAR, THROUGHS, level_of
from perception.full.likelihood import loglik
from perception.kernel import Floats, Ints, kernel

FOOT_M: Final = 0.3048

MIRROR: Final = 0
MIRROR_MUST: Final = 1
CONE: Final = 2
CONE_MUST: Final = 3
MIRROR_PRICE: Final = 4
"""Columns of a prediction: range by either rule (m, `NOTHING` where none), and 1 where it must be heard; and what a
mirror's answer costs (nat)."""

CORNER_PRICE: Final = 0.7
"""What an answer costs that a mirror may give or not, nat: about log 2. At a side's end or the beam's edge it costs
nothing: it is all the readings of a sensor that may then be heard, or none, and a price for each would turn the body
until they must."""

SURE: Final = 4
"""Column of `stats`, after those of `contact`: hits that had to be."""

NOTHING: Final = 1e18
"""A range (m) of no answer."""
MARGIN_M: Final = 0.12 * FOOT_M
"""A foot this near the end of its side need not answer: a pose is not known better."""
GRAZING_COS: Final = 0.05
"""An edge of the beam that is more parallel to a side than this does not hear it."""

ALONG, ACROSS, TURN = range(3)
"""What a pose may do: move along the body's own axes, turn."""
TURN_PER_M: Final = 0.7 / FOOT_M
"""A search turns by this for each metre that it moves, rad/m: what moves the side of a body of 1.4 ft as far."""
GAIN_MIN: Final = 1e-6
"""A step that gains less than this is none, nat."""
FINEST_M: Final = 0.005 * FOOT_M
"""A search ends with steps shorter than this: a tenth of the resolution, and the plateau is wider."""


@kernel
def side_seen(
    vertices: Floats, k: int, count: int, closed: bool, sx: float, sy: float
) -> tuple[float, float, float, float, float]:
    """Return side `k` as a place sees it.

    Returns
    -------
    (float, float, float, float, float)
        Distance to its line (m), negative where a closed outline turns its inside; how far along the side the foot of
        the perpendicular lies (m), and the side's length (m); its direction as a unit vector.
    """
    ax = vertices[k, 0]
    ay = vertices[k, 1]
    after = (k + 1) % count
    tx = vertices[after, 0] - ax
    ty = vertices[after, 1] - ay
    length = math.sqrt(tx * tx + ty * ty)
    tx /= length
    ty /= length
    height = (sx - ax) * ty - (sy - ay) * tx
    along = (sx - ax) * tx + (sy - ay) * ty
    if height < 0.0 and not closed:
        height = -height
    return height, along, length, tx, ty


@kernel
def where_met(height: float, along: float, length: float, ahead: float, aside: float) -> float:
    """Return how far a ray goes to a side, `NOTHING` where it passes by.

    Parameters
    ----------
    height, along, length
        From `side_seen`.
    ahead, aside : float
        The ray's components towards the side's line and along the side.
    """
    if ahead <= GRAZING_COS:
        return NOTHING
    d = height / ahead
    return d if 0.0 <= along + d * aside <= length else NOTHING


@kernel
def feet(
    sx: float, sy: float, ux: float, uy: float, vertices: Floats, count: int, closed: bool, cos_opt: float,
    cos_in: float,
) -> tuple[float, bool]:  # fmt: skip
    """Return the nearest foot of a perpendicular in the beam (m), and whether it must be heard."""
    nearest = NOTHING
    must = False
    for k in range(count if closed else count - 1):
        height, along, length, tx, ty = side_seen(vertices, k, count, closed, sx, sy)
        if not 0.0 <= height < nearest or not 0.0 <= along <= length:
            continue
        # The way to the foot is along − (place − vertex), of length height.
        fx = vertices[k, 0] + along * tx - sx
        fy = vertices[k, 1] + along * ty - sy
        ahead = fx * ux + fy * uy
        if ahead >= cos_opt * height:
            nearest = height
            must = ahead >= cos_in * height and MARGIN_M < along < length - MARGIN_M
    return nearest, must


@kernel
def corners(
    sx: float, sy: float, ux: float, uy: float, vertices: Floats, count: int, closed: bool, least_cos: float,
    below: float,
) -> float:  # fmt: skip
    """Return the nearest corner of the sides one faces within an angle off the axis, `below` if none is nearer; m."""
    nearest = below
    for k in range(count if closed else count - 1):
        height, _, _, _, _ = side_seen(vertices, k, count, closed, sx, sy)
        if not 0.0 <= height < nearest:
            continue
        for end in range(2):
            dx = vertices[(k + end) % count, 0] - sx
            dy = vertices[(k + end) % count, 1] - sy
            d = math.sqrt(dx * dx + dy * dy)
            if d < nearest and dx * ux + dy * uy >= least_cos * d:
                nearest = d
    return nearest


@kernel
def edges(
    sx: float, sy: float, ux: float, uy: float, vertices: Floats, count: int, closed: bool, cos_half: float,
    sin_half: float, below: float,
) -> float:  # fmt: skip
    """Return where the beam's two edges meet a side first, `below` if no nearer; m."""
    nearest = below
    for k in range(count if closed else count - 1):
        height, along, length, tx, ty = side_seen(vertices, k, count, closed, sx, sy)
        if not 0.0 <= height < nearest:
            continue
        away = 1.0 if (sx - vertices[k, 0]) * ty - (sy - vertices[k, 1]) * tx >= 0.0 else -1.0
        for hand in (-1.0, 1.0):
            ex = ux * cos_half - hand * uy * sin_half
            ey = uy * cos_half + hand * ux * sin_half
            d = where_met(height, along, length, away * (ey * tx - ex * ty), ex * tx + ey * ty)
            nearest = min(nearest, d)
    return nearest


@kernel
def predict(
    sx: float, sy: float, ux: float, uy: float, vertices: Floats, count: int, closed: bool, cos_opt: float,
    cos_in: float, cos_half: float, sin_half: float, sin_in: float, out: Floats,
) -> None:  # fmt: skip
    """Predict what a polygon answers, as a mirror and as a cone.

    =======  ========================================================  ===========================================
    rule     range                                                     must be heard
    =======  ========================================================  ===========================================
    mirror   nearest foot of a perpendicular in the beam               the foot well in the beam and on its side
             else the nearest corner in the beam                       never
    cone     nearest point in the beam: foot, corner or beam's edge    something lies well in the beam
    =======  ========================================================  ===========================================

    Parameters
    ----------
    sx, sy, ux, uy : float
        A sensor's place (m) and axis (unit vector) in the polygon's frame.
    vertices : (≥ count, 2) float
        Vertices, m; of a closed outline counter-clockwise.
    count : int
        How many there are.
    closed : bool
        Whether the last one joins the first; a side of an open outline answers to both of its faces.
    cos_opt, cos_in, cos_half, sin_half, sin_in : float
        Cosines of the angles off the axis: may answer, must answer, nominal half opening; sines of the latter and of
        what must answer.
    out : (≥ 5,) float
        Out: columns above.
    """
    foot, must = feet(sx, sy, ux, uy, vertices, count, closed, cos_opt, cos_in)
    out[MIRROR_MUST] = 1.0 if must else 0.0
    out[MIRROR_PRICE] = 0.0
    nearest = corners(sx, sy, ux, uy, vertices, count, closed, cos_opt, foot)
    out[MIRROR] = foot
    if foot == NOTHING:
        out[MIRROR] = nearest
        out[MIRROR_PRICE] = CORNER_PRICE
    nearest = edges(sx, sy, ux, uy, vertices, count, closed, cos_half, sin_half, nearest)
    out[CONE] = nearest
    if nearest < NOTHING and not must:
        must = corners(sx, sy, ux, uy, vertices, count, closed, cos_in, NOTHING) < NOTHING
        must = must or edges(sx, sy, ux, uy, vertices, count, closed, cos_in, sin_in, NOTHING) < NOTHING
    out[CONE_MUST] = 1.0 if must else 0.0


@kernel
def least_miss(out: Floats, r: float) -> float:
    """Return by how much a range misses the nearer of the predicted ones, m."""
    return float(min(abs(r - out[MIRROR]), abs(r - out[CONE])))


@kernel
def worth(r: float, expected: float, must: bool, gate: float, miss: float, short: float, v: float) -> float:
    """Return what a reading counts, nat.

    ==========================  ===================================================
    r within the gate, must     v, the table's
    r within the gate, may      v where that is for it, else nothing
    r beyond, must              `miss`: a drop-out
    r before, must              `short`: something unseen stands in front
    else                        nothing
    ==========================  ===================================================
    """
    if abs(r - expected) < gate:
        return v if must else max(v, 0.0)
    if not must:
        return 0.0
    return miss if r > expected else short


@kernel
def score_poly(
    w: Floats, n: int, x: float, y: float, theta: float, vertices: Floats, count: int, closed: bool, cos_opt: float,
    cos_in: float, cos_half: float, sin_half: float, gate: float, miss: float, short: float, lev: Ints,
    per_metre: float, table: Floats, inv_step: Floats, out: Floats, stats: Floats,
) -> float:  # fmt: skip
    """Weigh what readings say of a polygon at a pose: a log ratio to the background.

    Each reading counts as `worth` says under either rule; of what must be heard, drop-outs beyond `DROP_SHARE` (and
    one) cost `DROP_PRICE` more each. The evidence is log((exp M + exp C) / 2) of the two sums.

    Parameters
    ----------
    w : (capacity, 5) float
        Readings: place x, y (m), unit axis, range (m).
    n : int
        Readings in use.
    x, y, theta : float
        The polygon's pose: m, rad.
    vertices, count, closed, cos_opt, cos_in, cos_half, sin_half
        As for `predict`.
    gate, miss, short, lev, per_metre, table, inv_step
        As for `contact.score_circle`.
    out : (≥ 8,) float
        Scratch.
    stats : (≥ 5,) float
        Out: columns `LLR`, `HITS`, `THROUGHS`, `NEAR` of `contact`, and `SURE`; the counts by the likelier rule.

    Returns
    -------
    float
        `stats[LLR]`, nat.
    """
    c = math.cos(theta)
    s = math.sin(theta)
    sin_in = math.sqrt(1.0 - cos_in * cos_in)
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
    for j in range(n):
        dx = w[j, 0] - x
        dy = w[j, 1] - y
        r = w[j, 4]
        predict(
            c * dx + s * dy, -s * dx + c * dy, c * w[j, 2] + s * w[j, 3], -s * w[j, 2] + c * w[j, 3], vertices,
            count, closed, cos_opt, cos_in, cos_half, sin_half, sin_in, out,
        )  # fmt: skip
        k = level_of(lev, r, per_metre)
        must = out[MIRROR_MUST] > 0.0
        v = loglik(table, inv_step, k, r - out[MIRROR]) - out[MIRROR_PRICE]
        v = worth(r, out[MIRROR], must, gate, miss, short, v)
        mirror += v
        if abs(r - out[MIRROR]) < gate:
            mirror_near += 1.0
            if v > 0.0:
                mirror_hits += 1.0
                mirror_sure += out[MIRROR_MUST]
        elif must and r > out[MIRROR]:
            mirror_throughs += 1.0
        must = out[CONE_MUST] > 0.0
        if out[CONE] != out[MIRROR] or out[CONE_MUST] != out[MIRROR_MUST] or out[MIRROR_PRICE] > 0.0:
            v = worth(r, out[CONE], must, gate, miss, short, loglik(table, inv_step, k, r - out[CONE]))
        cone += v
        if abs(r - out[CONE]) < gate:
            cone_near += 1.0
            if v > 0.0:
                cone_hits += 1.0
                cone_sure += out[CONE_MUST]
        elif must and r > out[CONE]:
            cone_throughs += 1.0
    extra = mirror_throughs - DROP_SHARE * (mirror_hits + mirror_throughs)
    if extra > 1.0:
        mirror -= DROP_PRICE * (extra - 1.0)
    extra = cone_throughs - DROP_SHARE * (cone_hits + cone_throughs)
    if extra > 1.0:
        cone -= DROP_PRICE * (extra - 1.0)
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


@kernel
def search(
    w: Floats, n: int, pose: Floats, step: float, shrink: float, rounds: int, vertices: Floats, count: int,
    closed: bool, cos_opt: float, cos_in: float, cos_half: float, sin_half: float, gate: float, miss: float,
    short: float, lev: Ints, per_metre: float, table: Floats, inv_step: Floats, out: Floats, stats: Floats,
) -> float:  # fmt: skip
    """Search for the pose of greatest likelihood, along the body's own axes.

    The likelihood has steps where sides begin and cease to answer, so nothing is differentiated: each axis is tried
    both ways, and where none gains the steps shrink.

    Parameters
    ----------
    w, n
        As for `score_poly`.
    pose : (3,) float
        x, y (m), theta (rad): from where, updated.
    step : float
        First step, m; turns go with it, by `TURN_PER_M`.
    shrink : float
        What a step is multiplied with where none of them gains.
    rounds : int
        Rounds at most: the bound on the work.
    vertices, count, closed, cos_opt, cos_in, cos_half, sin_half, gate, miss, short, lev, per_metre, table, inv_step
        As for `score_poly`.
    out, stats
        As for `score_poly`, scratch.

    Returns
    -------
    float
        The log ratio at the pose, nat; never less than where it began.
    """
    best = score_poly(
        w, n, pose[0], pose[1], pose[2], vertices, count, closed, cos_opt, cos_in, cos_half, sin_half, gate, miss,
        short, lev, per_metre, table, inv_step, out, stats,
    )  # fmt: skip
    turn = step * TURN_PER_M
    for _ in range(rounds):
        is_better = False
        for axis in range(3):
            for sign in (-1.0, 1.0):
                x, y, theta = moved(pose[0], pose[1], pose[2], axis, sign * (turn if axis == TURN else step))
                v = score_poly(
                    w, n, x, y, theta, vertices, count, closed, cos_opt, cos_in, cos_half, sin_half, gate, miss,
                    short, lev, per_metre, table, inv_step, out, stats,
                )  # fmt: skip
                if v > best + GAIN_MIN:
                    best = v
                    pose[0] = x
                    pose[1] = y
                    pose[2] = theta
                    is_better = True
                    break
        if not is_better:
            step *= shrink
            turn *= shrink
            if step < FINEST_M:
                break
    return best
