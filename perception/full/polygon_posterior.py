"""Where a polygon stands and which way it faces, and how well that is known: mean and covariance of the likelihood.

As for circles (`posterior`), in three dimensions: the evidence is added up as it is, corners, silences and all, on a
lattice of one expected standard deviation in the frame of the covariance's Cholesky root. A slope or a curvature at
the best pose would not do: the evidence is flat on top, and beyond a side's end it falls like a cliff.
"""

from __future__ import annotations

import math
from typing import Final

from perception.full.polygon_births import prestat
from perception.full.state import MODEL, PTH, PTT, PX, PXX, PY, Settings, State
from perception.kernel import Floats, kernel

REACH: Final = 3
"""The lattice is the ball of this radius, in standard deviations: 123 points."""
CUT: Final = 0.9293
"""Variance that such a lattice gives a normal distribution of unit variance, whose tails it cuts off."""
ATTEMPTS: Final = 2
"""How often a lattice is laid at most: the bound on the work."""
TOP: Final = 40.0
"""A point better than the middle by more than this, nat, weighs no more."""
OFF_CENTRE: Final = 0.8
"""A mean this many pitches off the middle asks for a new lattice."""
NARROW: Final = 0.5
WIDE: Final = 1.6
"""So do variances beyond these, in squared pitches."""
THINNEST: Final = 0.06
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
    """Write the lower root of a covariance, within the pitches' bounds; both as 00, 10, 11, 20, 21, 22."""
    root[0] = clip(math.sqrt(cov[0]), PITCH_M[0], PITCH_M[1])
    root[1] = clip(cov[1] / root[0], -PITCH_M[1], PITCH_M[1])
    root[2] = clip(math.sqrt(max(cov[2] - root[1] ** 2, 0.0)), PITCH_M[0], PITCH_M[1])
    root[3] = clip(cov[3] / root[0], -PITCH_RAD[1], PITCH_RAD[1])
    root[4] = clip((cov[4] - root[3] * root[1]) / root[2], -PITCH_RAD[1], PITCH_RAD[1])
    root[5] = clip(math.sqrt(max(cov[5] - root[3] ** 2 - root[4] ** 2, 0.0)), PITCH_RAD[0], PITCH_RAD[1])


@kernel
def weigh_lattice(s: State, p: Settings, model: int, n: int, pose: Floats, root: Floats, moments: Floats) -> None:
    """Add up the likelihood round a pose.

    Parameters
    ----------
    s, p, model, n
        As for `polygon_births.prestat`; `s.root` is scratch.
    pose : (3,) float
        The middle: x, y (m), heading (rad).
    root : (6,) float
        The frame: lower root, by rows.
    moments : (9,) float
        Out: mean along the frame's axes; second moments about it 00, 10, 11, 20, 21, 22; in pitches.
    """
    top = prestat(s, p, model, n, pose)
    mass = 0.0
    for z in range(9):
        moments[z] = 0.0
    for i in range(-REACH, REACH + 1):
        for j in range(-REACH, REACH + 1):
            for k in range(-REACH, REACH + 1):
                if i * i + j * j + k * k > REACH * REACH:
                    continue
                s.root[0] = pose[0] + root[0] * i
                s.root[1] = pose[1] + root[1] * i + root[2] * j
                s.root[2] = pose[2] + root[3] * i + root[4] * j + root[5] * k
                share = math.exp(min(prestat(s, p, model, n, s.root) - top, TOP))
                mass += share
                moments[0] += share * i
                moments[1] += share * j
                moments[2] += share * k
                moments[3] += share * i * i
                moments[4] += share * i * j
                moments[5] += share * j * j
                moments[6] += share * i * k
                moments[7] += share * j * k
                moments[8] += share * k * k
    for z in range(9):
        moments[z] /= mass
    a, b, c = moments[0], moments[1], moments[2]
    moments[3] -= a * a
    moments[4] -= a * b
    moments[5] -= b * b
    moments[6] -= a * c
    moments[7] -= b * c
    moments[8] -= c * c


@kernel
def leave_frame(pose: Floats, root: Floats, moments: Floats, cov: Floats) -> None:
    """Move a pose to the mean, and write the covariance that the moments are in the frame of `root`."""
    a, b, c = moments[0], moments[1], moments[2]
    pose[0] += root[0] * a
    pose[1] += root[1] * a + root[2] * b
    pose[2] += root[3] * a + root[4] * b + root[5] * c
    v00 = max(moments[3], THINNEST) / CUT
    v11 = max(moments[5], THINNEST) / CUT
    v22 = max(moments[8], THINNEST) / CUT
    v10 = CORRELATED * moments[4] / CUT
    v20 = CORRELATED * moments[6] / CUT
    v21 = CORRELATED * moments[7] / CUT
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
def posterior_polygon(s: State, p: Settings, model: int, n: int, pose: Floats, cov: Floats) -> int:
    """Find mean and covariance of a polygon's pose.

    Parameters
    ----------
    s, p, model, n
        As for `polygon_births.prestat`: the readings are the first `n` in `s.w`.
    pose : (3,) float
        x, y (m), heading (rad): near the best one. Updated to the mean.
    cov : (6,) float
        Covariance as expected: xx, xy, yy, x·heading, y·heading, heading² (m², m·rad, rad²); where xx is 0, nothing
        is. Updated.

    Returns
    -------
    int
        Lattices laid.
    """
    root = s.fit[0:6]
    moments = s.segs[0:2].reshape(-1)[0:9]
    if cov[0] <= 0.0:
        cov[:] = 0.0
        cov[0] = FIRST_M**2
        cov[2] = FIRST_M**2
        cov[5] = FIRST_RAD**2
    for laid in range(ATTEMPTS):
        lower_root(cov, root)
        weigh_lattice(s, p, model, n, pose, root, moments)
        leave_frame(pose, root, moments, cov)
        off = max(abs(moments[0]), abs(moments[1]), abs(moments[2]))
        narrowest = min(moments[3], moments[5], moments[8])
        widest = max(moments[3], moments[5], moments[8])
        if off < OFF_CENTRE and narrowest > NARROW and widest < WIDE:
            return laid + 1
    return ATTEMPTS


@kernel
def centre_polygon(s: State, p: Settings, t: int, n: int) -> None:
    """Move track `t` from `s.pose` to the mean of its likelihood and enter the covariance."""
    posterior_polygon(s, p, s.pi[t, MODEL], n, s.pose, s.pf[t, PXX : PTT + 1])
    s.pf[t, PX] = s.pose[0]
    s.pf[t, PY] = s.pose[1]
    s.pf[t, PTH] = s.pose[2]
