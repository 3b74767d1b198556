"""Two faces and the edge they meet in: what a box's corner looks like, and a drum's closest rival.

Seen over a corner a box answers from one face, then from its edge, then from the other face, and the ranges of the
three together bend like an arc's. Only fitted as what they are do they tell which of the two they came from, so a
drum has to beat this explanation too.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.alternatives import SOFT, mean_bearing
from perception.bayes.likelihood import loglik
from perception.bayes.range_fit import fit_line, level_of
from perception.kernel import Floats, Ints, kernel

IMPOSSIBLE: Final = -1e9
"""Evidence (nat) of what cannot be fitted."""

FEWEST: Final = 8
"""Readings that two faces need at least …"""

FEWEST_OF_A_FACE: Final = 3
"""… and that one does: two to fix it and one to ask."""

TURNS: Final = 3
"""How often readings are dealt out to the faces and both fitted anew."""

STEPS: Final = 3
"""Steps of a face's fit."""

LEEWAY: Final = 0.02
"""Cosine by which a face's fit may look past the beam's edge, lest a face started askew lose its readings."""

STRANGER: Final = 2.0
"""A face out of the beam is a reading's this many gates worse."""

EDGE_LEAD: Final = 0.04
"""A reading is the edge's only if that explains it this many gates better than a face."""

OPENING: Final = 0.2
"""|sin| of the angle between the faces from which on they have an edge."""

HIT_PRICE: Final = 0.4
"""Price of each hit, nat: three surfaces to choose from explain chance readings too."""

PRICE: Final = 8.0
"""Price of the two parameters more than a circle has, nat."""


@kernel
def face_error(w: Floats, j: int, cx: float, cy: float, faces: Floats, side: int) -> float:
    """Return range heard less perpendicular distance to a face, m. `faces`: nx, ny, c of either, c about (cx, cy)."""
    nx = faces[3 * side]
    ny = faces[3 * side + 1]
    return float(w[j, 4] - faces[3 * side + 2] + nx * (w[j, 0] - cx) + ny * (w[j, 1] - cy))


@kernel
def chosen(
    w: Floats, j: int, cx: float, cy: float, faces: Floats, side: int, edge: bool, cos_opt: float, gate: float
) -> bool:
    """Say whether this face explains a reading: better than the other does, hardly worse than the edge."""
    e0 = abs(face_error(w, j, cx, cy, faces, 0))
    e1 = abs(face_error(w, j, cx, cy, faces, 1))
    if faces[0] * w[j, 2] + faces[1] * w[j, 3] < cos_opt:
        e0 += STRANGER * gate
    if faces[3] * w[j, 2] + faces[4] * w[j, 3] < cos_opt:
        e1 += STRANGER * gate
    if (e0 <= e1) != (side == 0):
        return False
    if not edge:
        return True
    at_edge = abs(w[j, 4] - math.hypot(faces[6] - w[j, 0], faces[7] - w[j, 1]))
    return bool(min(e0, e1) <= at_edge + EDGE_LEAD * gate)


@kernel
def meet(cx: float, cy: float, faces: Floats) -> bool:
    """Write where the faces meet to `faces[6:8]`. False where they are too nearly parallel to meet anywhere."""
    det = faces[0] * faces[4] - faces[1] * faces[3]
    if abs(det) <= OPENING:
        return False
    faces[6] = cx + (faces[2] * faces[4] - faces[5] * faces[1]) / det
    faces[7] = cy + (faces[0] * faces[5] - faces[3] * faces[2]) / det
    return True


@kernel
def fit_faces(
    w: Floats,
    w2: Floats,
    n: int,
    cx: float,
    cy: float,
    rho: float,
    cos_opt: float,
    gate: float,
    var0: float,
    rel2: float,
    fit: Floats,
    faces: Floats,
) -> tuple[bool, bool]:
    """Fit two faces and their edge: to readings left and right of the mean bearing, then to those each fits best.

    Parameters
    ----------
    w, w2, n, cx, cy, rho, cos_opt, gate, var0, rel2, fit
        As for `wedge`.
    faces : (≥ 8,) float
        Out: normal x, y and distance from the centre (m) of either face; edge x, y (m), if they have one.

    Returns
    -------
    (bool, bool)
        Whether there are two faces, and whether they have an edge.
    """
    m, sx, sy = mean_bearing(w, n, cx, cy, rho, gate)
    if m < FEWEST:
        return False, False
    edge = False
    for turn in range(TURNS):
        for side in range(2):
            k = 0
            ax = 0.0
            ay = 0.0
            for j in range(n):
                dx = cx - w[j, 0]
                dy = cy - w[j, 1]
                d = math.sqrt(dx * dx + dy * dy)
                if abs(w[j, 4] - (d - rho)) >= gate or d == 0.0:
                    continue
                if turn == 0:
                    mine = (sx * dy - sy * dx > 0.0) == (side == 0)
                else:
                    mine = chosen(w, j, cx, cy, faces, side, edge, cos_opt, gate)
                if mine:
                    for q in range(5):
                        w2[k, q] = w[j, q]
                    ax += dx / d
                    ay += dy / d
                    k += 1
            f = 3 * side
            if turn == 0:
                length = math.hypot(ax, ay)
                if k < FEWEST_OF_A_FACE or length == 0.0:
                    return False, False
                faces[f] = ax / length
                faces[f + 1] = ay / length
                faces[f + 2] = -rho
            if k >= FEWEST_OF_A_FACE:
                fit_line(w2, k, faces[f], faces[f + 1], cx, cy, faces[f + 2], cos_opt - LEEWAY, gate, SOFT, var0,
                         rel2, STEPS, fit)  # fmt: skip
                for q in range(3):
                    faces[f + q] = fit[q]
        edge = meet(cx, cy, faces)
    return True, edge


@kernel
def wedge(
    w: Floats,
    w2: Floats,
    n: int,
    cx: float,
    cy: float,
    rho: float,
    cos_opt: float,
    gate: float,
    var0: float,
    rel2: float,
    lev: Ints,
    per_metre: float,
    table: Floats,
    inv_step: Floats,
    fit: Floats,
    stats: Floats,
) -> float:
    """Fit two faces and their edge to a circle's near readings, and weigh what those say of them.

    Each reading counts as the best of what may answer it, and nothing is held against silence: a face may end
    anywhere. It is more flexible than a circle, and pays for that by the hit and once for all.

    Parameters
    ----------
    w : (capacity, 5) float
        Readings: place x, y (m), unit axis, range (m).
    w2 : (≥ n, 5) float
        Scratch.
    n : int
        Readings in use.
    cx, cy, rho : float
        The circle, m.
    cos_opt : float
        Cosine of the angle off the axis within which a reading may be answered.
    gate : float
        How far off the circle's a range may be to take part, m.
    var0, rel2 : float
        Variance of a range r: var0 (m²) + rel2 · r².
    lev, per_metre, table, inv_step
        As for `contact.score_circle`.
    fit : (≥ 3,) float
        Scratch.
    stats : (≥ 8,) float
        Out, where there are two faces: those, as `fit_faces` writes them.

    Returns
    -------
    float
        Log ratio to the background, nat, less the price; `IMPOSSIBLE` where there are not two faces.
    """
    found, edge = fit_faces(w, w2, n, cx, cy, rho, cos_opt, gate, var0, rel2, fit, stats)
    if not found:
        return IMPOSSIBLE
    total = 0.0
    for j in range(n):
        dx = cx - w[j, 0]
        dy = cy - w[j, 1]
        if abs(w[j, 4] - (math.sqrt(dx * dx + dy * dy) - rho)) >= gate:
            continue
        k = level_of(lev, w[j, 4], per_metre)
        v = 0.0
        for side in range(2):
            if stats[3 * side] * w[j, 2] + stats[3 * side + 1] * w[j, 3] >= cos_opt:
                v = max(v, loglik(table, inv_step, k, face_error(w, j, cx, cy, stats, side)))
        if edge:
            ex = stats[6] - w[j, 0]
            ey = stats[7] - w[j, 1]
            d = math.sqrt(ex * ex + ey * ey)
            if ex * w[j, 2] + ey * w[j, 3] >= cos_opt * d:
                v = max(v, loglik(table, inv_step, k, w[j, 4] - d))
        total += v - HIT_PRICE if v > 0.0 else table[k, table.shape[1] - 1]
    return total - PRICE
