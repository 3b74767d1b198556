"""Whose reading is it: what established polygons claim, and what a polygon leaves to its neighbours."""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.noise_estimation import noise_variance, reach_of
from perception.bayes.polygon_initiation import WHOLE
from perception.bayes.polygon_job import HEARD, NEXT, cost, ear_of, sides_of
from perception.bayes.polygon_likelihood import Ear, predict
from perception.bayes.polygon_readings import bears
from perception.bayes.reservoir import put
from perception.bayes.state import (
    DIRTY,
    ESTABLISHED,
    FREE,
    KIND,
    MODEL,
    PHITS,
    PNEAR,
    POLISH,
    PTH,
    PX,
    PY,
    QUIET,
    ST,
    Settings,
    State,
)
from perception.kernel import Floats, kernel

POLYGON: Final = 1000
"""What polygon t explains belongs to this plus t in `State.owner`."""
OVERLAP: Final = 1.8
"""Two bodies whose centres are nearer than this, in inner radii, cannot both be there."""


@kernel
def miss_of(q: Floats, track: Floats, faces: Floats, closed: bool, ear: Ear) -> float:
    """Return by how much a reading misses the nearer of what a body would answer by either rule, m.

    Parameters
    ----------
    q : (≥ 5,) float
        The reading: place (m), unit axis, range (m).
    track : (≥ 3,) float
        A row of `State.pf`: pose, m, rad.
    faces, closed, ear
        As for `polygon.predict`.
    """
    dx = q[0] - track[PX]
    dy = q[1] - track[PY]
    c = math.cos(track[PTH])
    sn = math.sin(track[PTH])
    mirror, _, _, cone, _ = predict(
        c * dx + sn * dy, -sn * dx + c * dy, c * q[2] + sn * q[3], -sn * q[2] + c * q[3], faces, closed, ear
    )
    return float(min(abs(q[4] - mirror), abs(q[4] - cone)))


@kernel
def poly_claims(s: State, p: Settings, m: int, tight: float) -> None:
    """Let established polygons claim what they explain, and all keep what bears on them.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    m : int
        Readings in `s.cur`.
    tight : float
        How far off an explained range is at most, m.
    """
    ear = ear_of(p)
    for t in range(s.pi.shape[0]):
        if s.pi[t, ST] == FREE:
            continue
        s.pi[t, QUIET] += 1
        model = s.pi[t, MODEL]
        x = s.pf[t, PX]
        y = s.pf[t, PY]
        bound = p.bound[model]
        faces = p.faces[model, : sides_of(p, model)]
        may_claim = s.pi[t, ST] == ESTABLISHED and s.pf[t, PHITS] > WHOLE * s.pf[t, PNEAR]
        for i in range(m):
            q = s.cur[i]
            if not bears(q[0], q[1], q[2], q[3], q[4], x, y, bound, ear.cos_half, ear.sin_half, p.gate, p.pair_max):
                continue
            owner = s.owner[i]
            if 0 <= owner < POLYGON and s.ti[owner, KIND] < p.models:
                continue
            put(s.pbins, s.pbn, t, x, y, q)
            s.pi[t, DIRTY] += 1
            s.pi[t, QUIET] = 0
            s.pi[t, POLISH] = p.polish
            if may_claim and miss_of(q, s.pf[t], faces, p.closed[model] > 0, ear) < tight:
                s.owner[i] = POLYGON + t


@kernel
def hides(q: Floats, x: float, y: float, inner: float, ux: float, uy: float, u_inner: float) -> bool:
    """Tell whether a body at (ux, uy) stands between the place of a reading and one at (x, y)."""
    dx = x - q[0]
    dy = y - q[1]
    ex = ux - q[0]
    ey = uy - q[1]
    d = math.hypot(dx, dy)
    if d == 0.0:
        return False
    ahead = (dx * ex + dy * ey) / d
    aside = abs(dx * ey - dy * ex) / d
    return 0.0 < ahead < d and bool(aside < u_inner + 0.5 * inner)


@kernel
def leave_to_next_neighbour(s: State, p: Settings, t: int) -> int:
    """Drop from the job's readings what the next established neighbour explains better; return what that cost.

    Where bodies all but touch, the echo of one's corner is an outlier to the other, and a dozen are a force; so
    is the silence of what stands in the shade.
    """
    u = s.job[NEXT]
    s.job[NEXT] += 1
    n = s.job[HEARD]
    if u == t or s.pi[u, ST] != ESTABLISHED:
        return 1
    own = s.pf[t]
    other = s.pf[u]
    model = s.pi[t, MODEL]
    u_model = s.pi[u, MODEL]
    apart = math.hypot(other[PX] - own[PX], other[PY] - own[PY])
    if apart > p.bound[model] + p.gate + p.bound[u_model] or apart < OVERLAP * p.inner[model]:
        return 1
    var0, _ = noise_variance(s, p)
    tight = reach_of(p.half_box, var0)
    ear = ear_of(p)
    faces = p.faces[model, : sides_of(p, model)]
    u_faces = p.faces[u_model, : sides_of(p, u_model)]
    kept = 0
    for j in range(n):
        q = s.pw[j]
        ours = miss_of(q, own, faces, p.closed[model] > 0, ear)
        theirs = miss_of(q, other, u_faces, p.closed[u_model] > 0, ear)
        if theirs < tight and theirs < ours:
            continue
        if ours > p.gate and hides(q, own[PX], own[PY], p.inner[model], other[PX], other[PY], p.inner[u_model]):
            continue
        for z in range(5):
            s.pw[kept, z] = q[z]
        kept += 1
    s.job[HEARD] = kept
    return cost(n, 1, faces.shape[0] + u_faces.shape[0])
