"""Echoes paired with landmarks that all look alike, after the robot may have slipped: joint compatibility.

Each echo alone fits many landmarks once the pose is uncertain by as much as they are apart. All echoes of one cycle
share the same unknown displacement of the robot, so a pairing of them all is judged at once: branch and bound over
the pairings, with the joint squared innovation as the test (J. Neira and J. D. Tardós, "Data association in
stochastic mapping using the joint compatibility test", 2001). The displacement has three numbers, so the joint test
is a small filter along each branch: its squared innovations add up to the joint one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from drivers.messages import IDENTITY, Pose, wrap_angle
from perception.kernel import Floats

PLACE_SIGMA_M: Final = 0.4
"""Standard deviation of a slip's shift before the echoes."""
SLIP_TURN_SIGMA: Final = math.radians(15.0)
"""Standard deviation of a slip's turn before the echoes, rad."""
BEARING_SHARE: Final = 0.6
"""Standard deviation of a heard landmark's bearing from the sensor's axis, as a share of half the beam."""
RANGE_SHARE: Final = 0.015
"""Standard deviation of a range with the landmark's place, as a share of it."""
RANGE_M: Final = 0.02
"""Part of that standard deviation that does not depend on the range."""
PAIR_GATE: Final = 9.2
"""χ² of two degrees of freedom that a true pair exceeds in one of a hundred cases."""
JOINT_GATE: Final = (0.0, 9.2, 13.3, 16.8, 20.1, 23.2, 26.2, 29.1, 32.0, 34.8, 37.6, 40.3, 43.0)
"""The same of two degrees of freedom for each pair; the index is the number of pairs."""
PAIRED_ECHOES_MAX: Final = len(JOINT_GATE) - 1
"""Echoes that are paired at most: `JOINT_GATE` has no more values."""
PAIRS_MIN: Final = 4
"""A pairing of fewer echoes than this is none."""
PAIRED_SHARE: Final = 0.6
"""A pairing of a smaller share of the echoes is none."""
BRANCHES_MAX: Final = 80
"""Branches that are followed at most: bounds the work."""
ALIKE_M: Final = 0.15
"""Two displacements are the same answer if their shifts differ by less than this and their turns by less than
`ALIKE_RAD`."""
ALIKE_RAD: Final = math.radians(6.0)
"""Difference of turns in `ALIKE_M`."""

GAIN_MIN: Final = 5.0
"""A landmark's squared innovations must fall by so much to be clearly better."""

Covariance: TypeAlias = tuple[float, float, float, float, float, float]
"""Of a displacement: xx, xy, xt, yy, yt, tt."""

STILL: Final[Covariance] = (1e-12, 0.0, 0.0, 1e-12, 0.0, 1e-12)
"""Of a displacement that is known."""


class Echo(NamedTuple):
    """An echo as seen from the ring's believed pose: the sensor's place (m) and direction (rad), and a range."""

    x: float
    y: float
    axis: float
    range_m: float


class Disc(NamedTuple):
    """A landmark's place as seen from the ring's believed pose, and its radius, m."""

    x: float
    y: float
    radius: float


class Displacement(NamedTuple):
    """Where the ring is as seen from its believed pose, with the covariance, and the pairs that say so."""

    pose: Pose
    covariance: Covariance
    pairs: tuple[tuple[int, int], ...]
    """Numbers of the echo, the nearest first, and of the landmark."""

    def covariance_matrix(self) -> Floats:
        """Return the covariance of x, y (m) and turn (rad), shape (3, 3)."""
        xx, xy, xt, yy, yt, tt = self.covariance
        return np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])


class _Branch(NamedTuple):
    pose: Pose
    covariance: Covariance
    squared: float
    pairs: tuple[tuple[int, int], ...]


def find_displacement(echoes: Sequence[Echo], discs: Sequence[Disc], half_angle: float) -> Displacement | None:
    """Return the displacement by which most echoes fit landmarks jointly; None if none fits enough, or two differ.

    Parameters
    ----------
    echoes : sequence of Echo
        Of one cycle of the ring; the nearest `PAIRED_ECHOES_MAX` are used.
    discs : sequence of Disc
        The landmarks.
    half_angle : float
        Half the beam's width, rad.
    """
    nearest = _nearest(echoes)
    least = max(PAIRS_MIN, math.ceil(PAIRED_SHARE * len(nearest)))
    prior = (PLACE_SIGMA_M**2, 0.0, 0.0, PLACE_SIGMA_M**2, 0.0, SLIP_TURN_SIGMA**2)
    stack = [(0, _Branch(IDENTITY, prior, 0.0, ()))]
    best: _Branch | None = None
    is_ambiguous = False
    for _ in range(BRANCHES_MAX):
        if not stack:
            break
        k, branch = stack.pop()
        most = len(branch.pairs) + len(nearest) - k
        if most < least or (best is not None and most < len(best.pairs)):
            continue
        if k < len(nearest):
            stack.append((k + 1, branch))
            paired = sorted(_paired(branch, k, nearest[k], discs, half_angle), key=lambda one: -one.squared)
            stack.extend((k + 1, one) for one in paired)
        elif best is None or len(branch.pairs) > len(best.pairs):
            best, is_ambiguous = branch, False
        elif not _is_alike(branch.pose, best.pose):
            is_ambiguous = True
        elif branch.squared < best.squared:
            best = branch
    if best is None or stack or is_ambiguous:
        return None
    return Displacement(best.pose, best.covariance, best.pairs)


def share_improved(found: Displacement, echoes: Sequence[Echo], discs: Sequence[Disc], half_angle: float) -> float:
    """Return of how many of the paired landmarks the echoes fit clearly better with the displacement than without.

    After a slip that is most of them; where only some landmarks have moved, a displacement may fit these a little
    better, and the others no better.

    Parameters
    ----------
    found : Displacement
        Of these echoes and landmarks.
    echoes, discs, half_angle
        As for `find_displacement`.

    Returns
    -------
    float
        As a share of the paired landmarks.
    """
    nearest = _nearest(echoes)
    gains: dict[int, float] = {}
    for k, i in found.pairs:
        before, after = (_squared(pose, nearest[k], discs[i], half_angle) for pose in (IDENTITY, found.pose))
        gains[i] = gains.get(i, 0.0) + before - after
    return sum(gain > GAIN_MIN for gain in gains.values()) / len(gains)


def _nearest(echoes: Sequence[Echo]) -> list[Echo]:
    return sorted(echoes, key=lambda echo: echo.range_m)[:PAIRED_ECHOES_MAX]


def _squared(pose: Pose, echo: Echo, disc: Disc, half_angle: float) -> float:
    """Return the squared innovation of a pair at a known pose of the ring, at most `PAIR_GATE`."""
    pairs = _paired(_Branch(pose, STILL, 0.0, ()), 0, echo, [disc], half_angle)
    return min((one.squared for one in pairs), default=PAIR_GATE)


def _is_alike(one: Pose, other: Pose) -> bool:
    return (
        math.hypot(one.x - other.x, one.y - other.y) < ALIKE_M
        and abs(wrap_angle(one.theta - other.theta)) < ALIKE_RAD
    )


def _paired(branch: _Branch, k: int, echo: Echo, discs: Sequence[Disc], half_angle: float) -> Iterator[_Branch]:
    """Yield the branches in which the k-th echo is from each of the landmarks that it fits, alone and jointly."""
    pose = branch.pose
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    mx, my = c * echo.x - s * echo.y, s * echo.x + c * echo.y
    xx, _, _, yy, _, tt = branch.covariance
    noise = RANGE_SHARE * echo.range_m + RANGE_M
    widest = math.sqrt(PAIR_GATE) * (math.sqrt(xx) + math.sqrt(yy) + math.hypot(mx, my) * math.sqrt(tt) + noise)
    for i, disc in enumerate(discs):
        dx, dy = disc.x - pose.x - mx, disc.y - pose.y - my
        d = math.hypot(dx, dy)
        if d <= disc.radius or abs(echo.range_m - (d - disc.radius)) > widest:
            continue
        off = wrap_angle(math.atan2(dy, dx) - pose.theta - echo.axis)
        # The range falls along (dx, dy), and by the mount's lever as the ring turns.
        range_row = (-dx / d, -dy / d, (dx * my - dy * mx) / d)
        short = echo.range_m - (d - disc.radius)
        squared, near, covariance = _corrected(pose, branch.covariance, range_row, short, noise * noise)
        if squared > PAIR_GATE:
            continue
        bearing_row = (dy / (d * d), -dx / (d * d), -1.0 - (dx * mx + dy * my) / (d * d))
        moved = near.x - pose.x, near.y - pose.y, near.theta - pose.theta
        expected = off + sum(row * by for row, by in zip(bearing_row, moved, strict=True))
        sigma = BEARING_SHARE * half_angle
        second, near, covariance = _corrected(near, covariance, bearing_row, -expected, sigma * sigma)
        joint = branch.squared + squared + second
        if squared + second <= PAIR_GATE and joint <= JOINT_GATE[len(branch.pairs) + 1]:
            yield _Branch(near, covariance, joint, (*branch.pairs, (k, i)))


def _corrected(
    pose: Pose, covariance: Covariance, row: tuple[float, float, float], innovation: float, noise: float
) -> tuple[float, Pose, Covariance]:
    """Return the squared innovation of a scalar measurement over its variance, and the displacement after it."""
    xx, xy, xt, yy, yt, tt = covariance
    a, b, c = row
    gx, gy, gt = xx * a + xy * b + xt * c, xy * a + yy * b + yt * c, xt * a + yt * b + tt * c
    variance = a * gx + b * gy + c * gt + noise
    share = innovation / variance
    after = Pose(pose.x + gx * share, pose.y + gy * share, pose.theta + gt * share)
    left = (
        xx - gx * gx / variance,
        xy - gx * gy / variance,
        xt - gx * gt / variance,
        yy - gy * gy / variance,
        yt - gy * gt / variance,
        tt - gt * gt / variance,
    )
    return innovation * share, after, left
