"""Where a polygon stands and which way it faces, and how well that is known: mean and covariance of the likelihood.

As for circles (`posterior`), in three dimensions: the evidence is added up as it is, corners, silences and all, on a
lattice in the frame of the expected covariance's Cholesky root. A slope or a curvature at the best pose would not
do: the evidence is flat on top, and beyond a side's end it falls like a cliff.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.bayes.polygon_job import (
    COV,
    HEARD,
    HISS,
    LAID,
    MIDDLE,
    MOMENTS,
    NEXT,
    ROOT,
    TOP,
    cost,
    ear_of,
    sides_of,
    weigh_pose,
)
from perception.bayes.polygon_likelihood import Ear, score_poly
from perception.bayes.state import Settings, State
from perception.kernel import Floats, Ints, copy_span, kernel

PITCH: Final = 1.3
"""The lattice's pitch, in expected standard deviations, …"""
REACH2: Final = 6
"""… and its squared radius, in pitches: 81 points."""
_CELLS: Final = np.stack(np.meshgrid(*3 * [np.arange(-3, 4)], indexing="ij"), axis=-1).reshape(-1, 3)
LATTICE: Final = np.ascontiguousarray(_CELLS[(_CELLS**2).sum(axis=1) <= REACH2]).astype(np.int64)
_NORMAL: Final = np.exp(-0.5 * PITCH**2 * (LATTICE**2).sum(axis=1))
CUT: Final = float((_NORMAL * LATTICE[:, 0] ** 2).sum() / _NORMAL.sum())
"""Variance that such a lattice gives a normal distribution as wide as expected, in squared pitches."""
CUT_OFF: Final = PITCH**2 * CUT
"""The same in squared standard deviations: one, but for the tails that are cut off."""
ATTEMPTS: Final = 5
"""How often a lattice is laid at most: the bound on the work."""
TOP_LEAD: Final = 40.0
"""A point better than the middle by more than this, nat, weighs no more."""
OFF_CENTRE: Final = 0.7
"""A mean this many pitches off the middle asks for a new lattice."""
NARROW: Final = 0.7 * CUT
WIDE: Final = 1.4 * CUT
"""So do variances beyond these, in squared pitches."""
THINNEST: Final = 0.1 * CUT
"""Least variance, in squared pitches, that the next lattice believes: less falls between the points."""
CORRELATED: Final = 0.95
"""Share of a correlation that the next lattice believes, so that it never collapses."""
PITCH_M: Final = (1e-4, 0.15)
PITCH_RAD: Final = (1e-4, 0.4)
"""Least and greatest pitch."""
FIRST_M: Final = 0.01
FIRST_RAD: Final = 0.02
"""What a track's first lattice expects."""


@kernel
def clip(v: float, low: float, high: float) -> float:
    """Return `v`, or the bound it is beyond."""
    return min(max(v, low), high)


@kernel
def lower_root(cov: Floats, root: Floats) -> None:
    """Write one pitch: `PITCH` lower roots of a covariance, within bounds; both as 00, 10, 11, 20, 21, 22."""
    root[0] = clip(PITCH * math.sqrt(cov[0]), PITCH_M[0], PITCH_M[1])
    root[1] = clip(PITCH**2 * cov[1] / root[0], -PITCH_M[1], PITCH_M[1])
    root[2] = clip(math.sqrt(max(PITCH**2 * cov[2] - root[1] ** 2, 0.0)), PITCH_M[0], PITCH_M[1])
    root[3] = clip(PITCH**2 * cov[3] / root[0], -PITCH_RAD[1], PITCH_RAD[1])
    root[4] = clip((PITCH**2 * cov[4] - root[3] * root[1]) / root[2], -PITCH_RAD[1], PITCH_RAD[1])
    root[5] = clip(math.sqrt(max(PITCH**2 * cov[5] - root[3] ** 2 - root[4] ** 2, 0.0)), PITCH_RAD[0], PITCH_RAD[1])


@kernel
def weigh_lattice(
    w: Floats, n: int, faces: Floats, closed: bool, ear: Ear, lev: Ints, table: Floats, inv_step: Floats,
    stats: Floats, middle: Floats, root: Floats, top: float, begin: int, end: int, moments: Floats,
) -> None:  # fmt: skip
    """Add up the likelihood round a pose, over some of the lattice's points.

    Parameters
    ----------
    w, n, faces, closed, ear, lev, table, inv_step, stats
        As for `polygon.score_poly`; `stats` is scratch.
    middle : (3,) float
        The middle: x, y (m), heading (rad).
    root : (6,) float
        The frame: lower root, by rows, of one pitch.
    top : float
        The log ratio at the middle, nat.
    begin, end : int
        Which points: rows of `LATTICE`.
    moments : (10,) float
        Updated: mass, sums along the frame's axes, and sums of products 00, 10, 11, 20, 21, 22; in pitches.
    """
    for point in range(begin, end):
        i, j, k = LATTICE[point]
        x = middle[0] + root[0] * i
        y = middle[1] + root[1] * i + root[2] * j
        theta = middle[2] + root[3] * i + root[4] * j + root[5] * k
        v = score_poly(w, n, 1, x, y, theta, faces, closed, ear, lev, table, inv_step, stats)
        share = math.exp(min(v - top, TOP_LEAD))
        moments[0] += share
        moments[1] += share * i
        moments[2] += share * j
        moments[3] += share * k
        moments[4] += share * i * i
        moments[5] += share * i * j
        moments[6] += share * j * j
        moments[7] += share * i * k
        moments[8] += share * j * k
        moments[9] += share * k * k


@kernel
def centre_moments(moments: Floats) -> None:
    """Divide sums by their mass, and take second moments about the mean."""
    for z in range(1, 10):
        moments[z] /= moments[0]
    a, b, c = moments[1], moments[2], moments[3]
    moments[4] -= a * a
    moments[5] -= a * b
    moments[6] -= b * b
    moments[7] -= a * c
    moments[8] -= b * c
    moments[9] -= c * c


@kernel
def leave_frame(pose: Floats, root: Floats, moments: Floats, cov: Floats) -> None:
    """Move a pose to the mean, and write the covariance that the moments are in the frame of `root`."""
    a, b, c = moments[0], moments[1], moments[2]
    pose[0] += root[0] * a
    pose[1] += root[1] * a + root[2] * b
    pose[2] += root[3] * a + root[4] * b + root[5] * c
    v00 = max(moments[3], THINNEST) / CUT_OFF
    v11 = max(moments[5], THINNEST) / CUT_OFF
    v22 = max(moments[8], THINNEST) / CUT_OFF
    v10 = CORRELATED * moments[4] / CUT_OFF
    v20 = CORRELATED * moments[6] / CUT_OFF
    v21 = CORRELATED * moments[7] / CUT_OFF
    # root · v, whose rows times those of root are the covariance's entries
    l00, l10, l11, l20, l21, l22 = root[0], root[1], root[2], root[3], root[4], root[5]
    m10 = l10 * v00 + l11 * v10
    m11 = l10 * v10 + l11 * v11
    m20 = l20 * v00 + l21 * v10 + l22 * v20
    m21 = l20 * v10 + l21 * v11 + l22 * v21
    m22 = l20 * v20 + l21 * v21 + l22 * v22
    cov[0] = l00 * v00 * l00
    cov[1] = m10 * l00
    cov[2] = m10 * l10 + m11 * l11
    cov[3] = m20 * l00
    cov[4] = m20 * l10 + m21 * l11
    cov[5] = m20 * l20 + m21 * l21 + m22 * l22


@kernel
def lay_lattice(s: State, p: Settings, model: int) -> None:
    """Lay the job's lattice round its middle, as its covariance expects."""
    middle = s.work[MIDDLE : MIDDLE + 3]
    lower_root(s.work[COV : COV + 6], s.work[ROOT : ROOT + 6])
    s.work[TOP] = weigh_pose(s, p, model, middle[0], middle[1], middle[2])
    s.work[MOMENTS : MOMENTS + 10] = 0.0
    s.job[NEXT] = 0


@kernel
def begin_lattice(s: State, p: Settings, model: int, pose: Floats, cov: Floats) -> None:
    """Set out for mean and covariance of a polygon's pose.

    Parameters
    ----------
    s, p, model
        As for `polygon_job.weigh_pose`.
    pose : (3,) float
        x, y (m), heading (rad): near the best one.
    cov : (6,) float
        Covariance as expected: xx, xy, yy, x·heading, y·heading, heading² (m², m·rad, rad²); where xx is 0, nothing
        is.
    """
    copy_span(pose, 0, 3, s.work, MIDDLE)
    copy_span(cov, 0, 6, s.work, COV)
    if cov[0] <= 0.0:
        s.work[COV : COV + 6] = 0.0
        s.work[COV] = FIRST_M**2
        s.work[COV + 2] = FIRST_M**2
        s.work[COV + 5] = FIRST_RAD**2
    s.job[LAID] = 0
    lay_lattice(s, p, model)


@kernel
def lattice_on(s: State, p: Settings, model: int, left: int) -> int:
    """Weigh for what is left of a quantum, one point at least; return what that cost.

    Where a lattice is weighed and its mass is off the middle, or not about as wide as expected, the frame follows it
    and the lattice is laid again, `ATTEMPTS` times at most. The job's `LAID` is `ATTEMPTS` when all is done; mean and
    covariance are then at `MIDDLE` and `COV`.
    """
    faces = p.faces[model, : sides_of(p, model)]
    each = max(1, cost(s.job[HEARD], 1, faces.shape[0]))
    begin = s.job[NEXT]
    end = min(LATTICE.shape[0], begin + max(1, left // each))
    middle = s.work[MIDDLE : MIDDLE + 3]
    root = s.work[ROOT : ROOT + 6]
    moments = s.work[MOMENTS : MOMENTS + 10]
    weigh_lattice(
        s.pw, s.job[HEARD], faces, p.closed[model] > 0, ear_of(p), p.levels[s.job[HISS]], p.table, p.inv_step,
        s.stats, middle, root, s.work[TOP], begin, end, moments,
    )  # fmt: skip
    s.job[NEXT] = end
    if end == LATTICE.shape[0]:
        centre_moments(moments)
        leave_frame(middle, root, moments[1:], s.work[COV : COV + 6])
        off = max(abs(moments[1]), abs(moments[2]), abs(moments[3]))
        narrowest = min(moments[4], moments[6], moments[9])
        widest = max(moments[4], moments[6], moments[9])
        s.job[LAID] += 1
        if off < OFF_CENTRE and narrowest > NARROW and widest < WIDE:
            s.job[LAID] = ATTEMPTS
        if s.job[LAID] < ATTEMPTS:
            lay_lattice(s, p, model)
    return int((end - begin) * each)
