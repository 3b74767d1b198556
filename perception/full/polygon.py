"""Contact of a polygon of any form, open or closed: likelihood of raw ranges at a pose, and the search for the pose.

A side answers at the foot of the perpendicular from the sensor where that lies on the side and in the beam: it must,
which is strong. A corner, and the point where the edge of a cone's beam meets a side, may, which is weak: mirrors do
not answer from there, cones do. So a weak explanation costs something and is taken only where a strong one is worse.
"""

from __future__ import annotations

import math
from typing import Final

from perception.full.contact import DROP_PRICE, DROP_SHARE, HITS, LLR, NEAR, THROUGHS, level_of
from perception.full.likelihood import loglik
from perception.kernel import Floats, Ints, kernel

FOOT_M: Final = 0.3048

STRONG: Final = 0
MUST: Final = 1
MISS: Final = 2
WEAK: Final = 3
"""Columns of a prediction: range that a side answers at (m, `SILENT` where none does); 1 where that side must answer;
range less the range of the best explanation (m); 1 where that explanation is a weak one."""

SURE: Final = 4
"""Column of `stats`, after those of `contact`: hits that are strong."""

SILENT: Final = -1.0
NOTHING: Final = 1e18
"""A range and a miss (m) that anything is better than."""

WEAK_PRICE: Final = 0.7
"""An explanation that may answer or not costs this, nat: about log 2."""
MARGIN_M: Final = 0.12 * FOOT_M
"""A foot this near the end of its side need not answer: a pose is not known better."""
PREFERENCE_M: Final = 0.03 * FOOT_M
"""A weak explanation must be better than a strong one by this: else corners would steal what sides answer."""
AGAIN_M: Final = 1e-3 * FOOT_M
"""And better than another weak one by this, so that a corner is one corner from both its sides."""
EXPLAINED_M: Final = 0.05 * FOOT_M
"""A miss as small as this needs no beam's edge to explain it."""
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
def is_better_weak(miss: float, best: float, is_best_weak: bool) -> bool:
    """Tell whether a weak explanation with this `miss` (m) takes the place of the best so far."""
    return abs(miss) + (AGAIN_M if is_best_weak else PREFERENCE_M) < abs(best)


@kernel
def predict(
    sx: float, sy: float, ux: float, uy: float, r: float, vertices: Floats, count: int, closed: bool, cos_opt: float,
    cos_in: float, cos_half: float, sin_half: float, out: Floats,
) -> None:  # fmt: skip
    """Predict what a sensor hears of a polygon, and by how much its range misses the best explanation.

    A closed outline answers on its outer side only, which is right of each side; an open one on both.

    Parameters
    ----------
    sx, sy, ux, uy : float
        The sensor's place (m) and unit axis in the polygon's frame.
    r : float
        Its range, m.
    vertices : (≥ count, 2) float
        Vertices, counterclockwise where closed, m.
    count : int
        How many there are.
    closed : bool
        Whether a side leads from the last vertex to the first.
    cos_opt, cos_in : float
        Cosines of the angles off the axis at which an echo may, and must, be heard.
    cos_half, sin_half : float
        Of half the beam's opening: its two edges.
    out : (≥ 4,) float
        Out: columns `STRONG`, `MUST`, `MISS`, `WEAK`.
    """
    strong = NOTHING
    must = False
    best = NOTHING
    weak = False
    sides = count if closed else count - 1
    for k in range(sides):
        k2 = (k + 1) % count
        ax = vertices[k, 0]
        ay = vertices[k, 1]
        tx = vertices[k2, 0] - ax
        ty = vertices[k2, 1] - ay
        length = math.sqrt(tx * tx + ty * ty)
        tx /= length
        ty /= length
        px = sx - ax
        py = sy - ay
        nx = ty
        ny = -tx
        distance = px * ty - py * tx
        if distance < 0.0:
            if closed:
                continue
            distance = -distance
            nx = -nx
            ny = -ny
        foot = px * tx + py * ty
        facing = -(nx * ux + ny * uy)
        if facing >= cos_opt and 0.0 <= foot <= length:
            if distance < strong:
                strong = distance
                must = facing >= cos_in and MARGIN_M < foot < length - MARGIN_M
            if abs(r - distance) < abs(best):
                best = r - distance
                weak = False
        for end in (k, k2):
            dx = vertices[end, 0] - sx
            dy = vertices[end, 1] - sy
            d = math.sqrt(dx * dx + dy * dy)
            if dx * ux + dy * uy >= cos_opt * d and is_better_weak(r - d, best, weak):
                best = r - d
                weak = True
        if abs(best) > EXPLAINED_M:
            for edge in (-1.0, 1.0):
                ex = ux * cos_half - edge * uy * sin_half
                ey = uy * cos_half + edge * ux * sin_half
                towards = -(nx * ex + ny * ey)
                if towards > GRAZING_COS:
                    d = distance / towards
                    met = foot + d * (ex * tx + ey * ty)
                    if 0.0 <= met <= length and is_better_weak(r - d, best, weak):
                        best = r - d
                        weak = True
    out[STRONG] = strong if strong < NOTHING else SILENT
    out[MUST] = 1.0 if must else 0.0
    out[MISS] = best
    out[WEAK] = 1.0 if weak else 0.0


@kernel
def worth(v: float, is_weak: bool, must: bool, outlier: float) -> float:
    """Return what a match counts, nat.

    Parameters
    ----------
    v : float
        Log ratio of its miss.
    is_weak, must : bool
        Whether a weak explanation is meant; whether a side must have answered.
    outlier : float
        Log ratio of an outlier: what a side that must have answered was, if nothing explains the range.
    """
    if is_weak:
        v -= WEAK_PRICE
        if v < 0.0:
            return outlier if must else 0.0
    elif v < 0.0 and not must:
        return 0.0
    return v


@kernel
def score_poly(
    w: Floats, n: int, x: float, y: float, theta: float, vertices: Floats, count: int, closed: bool, cos_opt: float,
    cos_in: float, cos_half: float, sin_half: float, gate: float, miss: float, short: float, lev: Ints,
    per_metre: float, table: Floats, inv_step: Floats, out: Floats, stats: Floats,
) -> float:  # fmt: skip
    """Weigh what readings say of a polygon at a pose: a log ratio to the background.

    ==============================================  ==========================================================
    range less that of the best explanation, e      counts
    ==============================================  ==========================================================
    |e| < gate                                      the table's L(e), see `worth`
    else, a side must answer and r is beyond it     `miss`: a drop-out; dearer where there are too many of them
    else, a side must answer and r is before it     `short`: something unseen stands in front
    else                                            nothing
    ==============================================  ==========================================================

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
    out : (≥ 4,) float
        Scratch.
    stats : (≥ 5,) float
        Out: columns `LLR`, `HITS`, `THROUGHS`, `NEAR` of `contact`, and `SURE`.

    Returns
    -------
    float
        `stats[LLR]`, nat.
    """
    c = math.cos(theta)
    s = math.sin(theta)
    last = table.shape[1] - 1
    llr = 0.0
    hits = 0.0
    sure = 0.0
    throughs = 0.0
    near = 0.0
    for j in range(n):
        dx = w[j, 0] - x
        dy = w[j, 1] - y
        r = w[j, 4]
        predict(
            c * dx + s * dy, -s * dx + c * dy, c * w[j, 2] + s * w[j, 3], -s * w[j, 2] + c * w[j, 3], r, vertices,
            count, closed, cos_opt, cos_in, cos_half, sin_half, out,
        )  # fmt: skip
        must = out[MUST] > 0.0
        if abs(out[MISS]) < gate:
            near += 1.0
            is_weak = out[WEAK] > 0.0
            k = level_of(lev, r, per_metre)
            v = worth(loglik(table, inv_step, k, out[MISS]), is_weak, must, table[k, last])
            if v > 0.0:
                hits += 1.0
                if not is_weak:
                    sure += 1.0
            llr += v
        elif must:
            if r > out[STRONG]:
                llr += miss
                throughs += 1.0
            else:
                llr += short
    extra = throughs - DROP_SHARE * (hits + throughs)
    if extra > 1.0:
        llr -= DROP_PRICE * (extra - 1.0)
    stats[LLR] = llr
    stats[HITS] = hits
    stats[THROUGHS] = throughs
    stats[NEAR] = near
    stats[SURE] = sure
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
