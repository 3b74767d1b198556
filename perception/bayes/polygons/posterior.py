"""Posterior of a polygon's pose: mean and covariance of the exact likelihood.

As for circles (`circles.posterior`), in three dimensions: the likelihood, corners and silences included, is summed on
a lattice in the frame of the expected covariance's Cholesky root. Derivatives at the best pose would not do: the
evidence is flat on top, and drops abruptly beyond a side's end.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.bayes.memory.elements import LowerTriangle, Pose
from perception.bayes.memory.job_records import LatticeMoments
from perception.bayes.memory.polygon_parameters import (
    FIRST_SIGMA_M,
    FIRST_SIGMA_RAD,
    LATTICE_ATTEMPTS,
    LATTICE_CORRELATION_SHARE,
    LATTICE_LEAD_MAX_NAT,
    LATTICE_NARROW,
    LATTICE_OFF_CENTRE,
    LATTICE_PITCH,
    LATTICE_PITCHES_M,
    LATTICE_PITCHES_RAD,
    LATTICE_RADIUS2,
    LATTICE_THINNEST,
    LATTICE_WIDE,
)
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import StateRecord
from perception.bayes.polygons.job import copy_pose, cost, score_pose
from perception.bayes.polygons.likelihood import score_polygon
from perception.kernel import kernel

_CELLS: Final = np.stack(np.meshgrid(*3 * [np.arange(-3, 4)], indexing="ij"), axis=-1).reshape(-1, 3)
LATTICE: Final = np.ascontiguousarray(_CELLS[(_CELLS**2).sum(axis=1) <= LATTICE_RADIUS2]).astype(np.int64)
_NORMAL: Final = np.exp(-0.5 * LATTICE_PITCH**2 * (LATTICE**2).sum(axis=1))
CUT: Final = float((_NORMAL * LATTICE[:, 0] ** 2).sum() / _NORMAL.sum())
"""Variance of a normal distribution of the expected width, summed on the lattice, in squared pitches."""
CUT_OFF: Final = LATTICE_PITCH**2 * CUT
"""The same in squared standard deviations: one, but for the tails that are cut off."""
NARROW: Final = LATTICE_NARROW * CUT
WIDE: Final = LATTICE_WIDE * CUT
"""The lattice is laid again when a variance lies outside these, in squared pitches."""
THINNEST: Final = LATTICE_THINNEST * CUT
"""Least variance, in squared pitches, that the next lattice assumes: a narrower peak falls between the points."""


@kernel
def clip(v: float, low: float, high: float) -> float:
    """Return a value limited to an interval.

    Parameters
    ----------
    v : float
        The value.
    low, high : float
        The interval's bounds.
    """
    return min(max(v, low), high)


@kernel
def copy_triangle(source: LowerTriangle, target: LowerTriangle) -> None:
    """Copy a lower triangle."""
    target.xx = source.xx
    target.yx = source.yx
    target.yy = source.yy
    target.hx = source.hx
    target.hy = source.hy
    target.hh = source.hh


@kernel
def write_pitch(cov: LowerTriangle, root: LowerTriangle) -> None:
    """Write one pitch of the lattice to `root`: `LATTICE_PITCH` Cholesky roots of a covariance, within bounds."""
    root.xx = clip(LATTICE_PITCH * math.sqrt(cov.xx), LATTICE_PITCHES_M[0], LATTICE_PITCHES_M[1])
    root.yx = clip(LATTICE_PITCH**2 * cov.yx / root.xx, -LATTICE_PITCHES_M[1], LATTICE_PITCHES_M[1])
    root.yy = clip(
        math.sqrt(max(LATTICE_PITCH**2 * cov.yy - root.yx**2, 0.0)), LATTICE_PITCHES_M[0], LATTICE_PITCHES_M[1]
    )
    root.hx = clip(LATTICE_PITCH**2 * cov.hx / root.xx, -LATTICE_PITCHES_RAD[1], LATTICE_PITCHES_RAD[1])
    root.hy = clip(
        (LATTICE_PITCH**2 * cov.hy - root.hx * root.yx) / root.yy, -LATTICE_PITCHES_RAD[1], LATTICE_PITCHES_RAD[1]
    )
    root.hh = clip(
        math.sqrt(max(LATTICE_PITCH**2 * cov.hh - root.hx**2 - root.hy**2, 0.0)),
        LATTICE_PITCHES_RAD[0],
        LATTICE_PITCHES_RAD[1],
    )


@kernel
def clear_moments(moments: LatticeMoments) -> None:
    """Set the sums of a lattice to zero."""
    moments.mass = 0.0
    moments.a = 0.0
    moments.b = 0.0
    moments.c = 0.0
    moments.aa = 0.0
    moments.ab = 0.0
    moments.bb = 0.0
    moments.ac = 0.0
    moments.bc = 0.0
    moments.cc = 0.0


@kernel
def score_lattice(s: StateRecord, p: SettingsRecord, model: int, begin: int, end: int) -> None:
    """Add the likelihood at some of the lattice's points to the job's moments.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    model : int
        Which polygon.
    begin, end : int
        First point and end of the points: rows of `LATTICE`.
    """
    job = s[0].job
    middle, root, moments = job.middle, job.root, job.moments
    outline = p[0].polygons[model]
    sides = outline.sides[: outline.side_count]
    readings = s[0].job_readings[: job.reading_count]
    for point in range(begin, end):
        i, j, k = LATTICE[point]
        x = middle.x + root.xx * i
        y = middle.y + root.yx * i + root.yy * j
        heading = middle.heading + root.hx * i + root.hy * j + root.hh * k
        v = score_polygon(
            readings, 1, (x, y, heading), sides, outline.is_closed > 0, p, job.noise_level, s[0].scratch.score
        )
        share = math.exp(min(v - job.middle_nat, LATTICE_LEAD_MAX_NAT))
        moments.mass += share
        moments.a += share * i
        moments.b += share * j
        moments.c += share * k
        moments.aa += share * i * i
        moments.ab += share * i * j
        moments.bb += share * j * j
        moments.ac += share * i * k
        moments.bc += share * j * k
        moments.cc += share * k * k


@kernel
def centre_moments(moments: LatticeMoments) -> None:
    """Divide the sums by their mass, and convert second moments to those about the mean."""
    mass = moments.mass
    moments.a /= mass
    moments.b /= mass
    moments.c /= mass
    moments.aa /= mass
    moments.ab /= mass
    moments.bb /= mass
    moments.ac /= mass
    moments.bc /= mass
    moments.cc /= mass
    a, b, c = moments.a, moments.b, moments.c
    moments.aa -= a * a
    moments.ab -= a * b
    moments.bb -= b * b
    moments.ac -= a * c
    moments.bc -= b * c
    moments.cc -= c * c


@kernel
def leave_frame(pose: Pose, root: LowerTriangle, moments: LatticeMoments, cov: LowerTriangle) -> None:
    """Move a pose to the lattice's mean, and write the covariance of the moments in the odometry frame.

    Parameters
    ----------
    pose : Pose
        The lattice's middle; updated.
    root : LowerTriangle
        One pitch.
    moments : LatticeMoments
        About the mean.
    cov : LowerTriangle
        Out.
    """
    a, b, c = moments.a, moments.b, moments.c
    pose.x += root.xx * a
    pose.y += root.yx * a + root.yy * b
    pose.heading += root.hx * a + root.hy * b + root.hh * c
    v00 = max(moments.aa, THINNEST) / CUT_OFF
    v11 = max(moments.bb, THINNEST) / CUT_OFF
    v22 = max(moments.cc, THINNEST) / CUT_OFF
    v10 = LATTICE_CORRELATION_SHARE * moments.ab / CUT_OFF
    v20 = LATTICE_CORRELATION_SHARE * moments.ac / CUT_OFF
    v21 = LATTICE_CORRELATION_SHARE * moments.bc / CUT_OFF
    # root · v, whose rows times those of root are the covariance's entries
    l00, l10, l11, l20, l21, l22 = root.xx, root.yx, root.yy, root.hx, root.hy, root.hh
    m10 = l10 * v00 + l11 * v10
    m11 = l10 * v10 + l11 * v11
    m20 = l20 * v00 + l21 * v10 + l22 * v20
    m21 = l20 * v10 + l21 * v11 + l22 * v21
    m22 = l20 * v20 + l21 * v21 + l22 * v22
    cov.xx = l00 * v00 * l00
    cov.yx = m10 * l00
    cov.yy = m10 * l10 + m11 * l11
    cov.hx = m20 * l00
    cov.hy = m20 * l10 + m21 * l11
    cov.hh = m20 * l20 + m21 * l21 + m22 * l22


@kernel
def lay_lattice(s: StateRecord, p: SettingsRecord, model: int) -> None:
    """Lay the job's lattice round its middle, with the pitch of its expected covariance.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    model : int
        Index of the polygon.
    """
    job = s[0].job
    write_pitch(job.covariance, job.root)
    job.middle_nat = score_pose(s, p, model, job.middle.x, job.middle.y, job.middle.heading)
    clear_moments(job.moments)
    job.next_step = 0


@kernel
def begin_lattice(s: StateRecord, p: SettingsRecord, model: int, t: int) -> None:
    """Begin the computation of mean and covariance of a polygon's pose.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    model : int
        Which polygon.
    t : int
        Its track, near the job's best pose, the first middle; where its covariance is zero, the first lattice uses
        default deviations.
    """
    job = s[0].job
    track = s[0].polygons[t]
    copy_pose(job.best, job.middle)
    copy_triangle(track.covariance, job.covariance)
    if track.covariance.xx <= 0.0:
        job.covariance.xx = FIRST_SIGMA_M**2
        job.covariance.yx = 0.0
        job.covariance.yy = FIRST_SIGMA_M**2
        job.covariance.hx = 0.0
        job.covariance.hy = 0.0
        job.covariance.hh = FIRST_SIGMA_RAD**2
    job.lattices = 0
    lay_lattice(s, p, model)


@kernel
def advance_lattice(s: StateRecord, p: SettingsRecord, model: int, left: int) -> int:
    """Score points of the lattice for the rest of a quantum, at least one; return the cost.

    Where the mass of a scored lattice is off the middle, or not about as wide as expected, the frame moves to it
    and the lattice is laid again, `LATTICE_ATTEMPTS` times at most. The job's `lattices` is `LATTICE_ATTEMPTS` when
    all is done; mean and covariance are then its `middle` and `covariance`.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    model : int
        Which polygon.
    left : int
        What is left of the quantum.
    """
    job = s[0].job
    moments = job.moments
    each = max(1, cost(job.reading_count, 1, p[0].polygons[model].side_count))
    begin = job.next_step
    end = min(LATTICE.shape[0], begin + max(1, left // each))
    score_lattice(s, p, model, begin, end)
    job.next_step = end
    if end == LATTICE.shape[0]:
        centre_moments(moments)
        leave_frame(job.middle, job.root, moments, job.covariance)
        off = max(abs(moments.a), abs(moments.b), abs(moments.c))
        narrowest = min(moments.aa, moments.bb, moments.cc)
        widest = max(moments.aa, moments.bb, moments.cc)
        job.lattices += 1
        if off < LATTICE_OFF_CENTRE and narrowest > NARROW and widest < WIDE:
            job.lattices = LATTICE_ATTEMPTS
        if job.lattices < LATTICE_ATTEMPTS:
            lay_lattice(s, p, model)
    spent: int = (end - begin) * each
    return spent
