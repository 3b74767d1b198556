"""The interpretation tree: which segment of the contour is which wall (Grimson and Lozano-Pérez, as in Drumheller).

Level k of the tree assigns segment k to a side of a wall or to none. A branch is pruned where the segment is longer
than the wall (unary), or where two segments and their walls differ in the angle between them, or in the distance of
one from the line of the other (binary). Two walls that are not parallel fix a pose.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from perception.kernel import Floats
from perception.localization.drumheller.contour import ContourSegment
from perception.localization.room.room import Room

TREE_NODES_MAX: Final = 20_000
"""Nodes of the tree that are visited at most; what lies behind is left out."""
ANGLE_SLACK_RAD: Final = math.radians(2.0)
"""Tolerance of angles beyond the segments' own, rad."""
LENGTH_SLACK_M: Final = 0.3
"""A segment may be longer than its wall by this, m."""
DISTANCE_SLACK_M: Final = 0.1
"""Tolerance of distances beyond the segments' own, m."""
SLIDE_M: Final = 0.15
"""Distance of the places that are tried along a wall, m."""
CROSSING_MIN: Final = math.sin(math.radians(20.0))
"""Sine of the least angle between two walls that fix a pose."""


class Interpretation(NamedTuple):
    """A leaf of the tree."""

    assigned: int
    """Segments that have a wall."""
    x: float
    """Pose of the ring, m and rad."""
    y: float
    theta: float


class _Sides(NamedTuple):
    """Both sides of all walls: normals away from the robot's side."""

    normals: Floats
    offsets: Floats
    ends: Floats
    """Shape (sides, 2, 2)."""
    length: Floats


def interpretations(segments: Sequence[ContourSegment], room: Room) -> tuple[Interpretation, ...]:
    """Return the poses that the leaves of the tree give: most assigned segments first.

    Parameters
    ----------
    segments : sequence of ContourSegment
        Those that enter the tree; each is a level.
    room : Room
        The walls.
    """
    sides = _sides(room)
    allowed = _binary_masks(segments, sides)
    whole = [
        sum(1 << i for i, length in enumerate(sides.length) if s.length <= length + LENGTH_SLACK_M) for s in segments
    ]
    leaves: list[Interpretation] = []
    nodes = 0
    stack: list[tuple[int, tuple[tuple[int, int], ...], tuple[int, ...]]] = [(0, (), tuple(whole))]
    while stack and nodes < TREE_NODES_MAX:
        level, chosen, masks = stack.pop()
        nodes += 1
        if level == len(segments):
            leaf = _pose([(segments[k], i) for k, i in chosen], sides)
            if leaf is not None:
                leaves.append(leaf)
            continue
        stack.append((level + 1, chosen, masks))  # to none; visited last
        mask, side = masks[level], 0
        while mask:
            if mask & 1:
                pruned = tuple(m & a for m, a in zip(masks, allowed[level][side], strict=True))
                stack.append((level + 1, (*chosen, (level, side)), pruned))
            mask >>= 1
            side += 1
    return tuple(sorted(leaves, key=lambda leaf: -leaf.assigned))


def _binary_masks(segments: Sequence[ContourSegment], sides: _Sides) -> list[list[list[int]]]:
    """Return for segment k on side i and segment l the sides that l may have, as bits: masks[k][i][l]."""
    towards = np.arctan2(sides.normals[:, 1], sides.normals[:, 0])
    turn = towards[None, :] - towards[:, None]  # from side i to side j
    # Least and greatest distance of side j's ends from the line of side i.
    beyond = np.einsum("ic,jec->ije", sides.normals, sides.ends) - sides.offsets[:, None, None]
    least, most = beyond.min(axis=2), beyond.max(axis=2)
    fits = np.empty((len(segments), len(segments), *turn.shape), dtype=np.bool_)
    for k, first in enumerate(segments):
        cos, sin = math.cos(first.alpha), math.sin(first.alpha)
        for m, second in enumerate(segments):
            wrong = np.abs((turn - (second.alpha - first.alpha) + math.pi) % (2.0 * math.pi) - math.pi)
            distance = cos * second.x + sin * second.y - first.offset
            lever = abs(cos * (second.y - first.y) - sin * (second.x - first.x))
            slack = DISTANCE_SLACK_M + first.offset_slack + second.offset_slack + 0.5 * second.length
            slack += lever * math.sin(first.alpha_slack)
            fits[k, m] = wrong <= first.alpha_slack + second.alpha_slack + ANGLE_SLACK_RAD
            fits[k, m] &= (distance >= least - slack) & (distance <= most + slack)
    fits &= fits.transpose(1, 0, 3, 2)
    bits = [1 << j for j in range(len(towards))]
    return [
        [[sum(bit for bit, fit in zip(bits, row, strict=True) if fit) for row in of_side] for of_side in of_segment]
        for of_segment in fits.transpose(0, 2, 1, 3).tolist()
    ]


def _pose(chosen: Sequence[tuple[ContourSegment, int]], sides: _Sides) -> Interpretation | None:
    """Return the pose of a leaf: heading from directions, place by least squares over the walls' normals."""
    if len(chosen) < 2:  # it takes two walls that are not parallel
        return None
    index = [i for _, i in chosen]
    normals, weight = sides.normals[index], np.array([1.0 / s.alpha_slack**2 for s, _ in chosen])
    turn = np.arctan2(normals[:, 1], normals[:, 0]) - [s.alpha for s, _ in chosen]
    theta = math.atan2(float(weight @ np.sin(turn)), float(weight @ np.cos(turn)))
    distance = sides.offsets[index] - [s.offset for s, _ in chosen]
    information = normals.T @ normals
    if np.linalg.det(information) < CROSSING_MIN**2:
        return None
    x, y = np.linalg.solve(information, normals.T @ distance).tolist()
    return Interpretation(len(chosen), x, y, theta)


def poses_along_walls(segments: Sequence[ContourSegment], room: Room) -> Floats:
    """Return poses from which one segment is on one wall: what remains where the tree finds no two walls.

    Parameters
    ----------
    segments : sequence of ContourSegment
        Each is put on each side of each wall that is long enough.
    room : Room
        The walls.

    Returns
    -------
    (n, 3) float
        x, y (m), heading (rad): the middle of the segment is at each `SLIDE_M` of the wall.
    """
    sides = _sides(room)
    rows = [np.empty((0, 3))]
    for (nx, ny), ends, length in zip(sides.normals.tolist(), sides.ends, sides.length.tolist(), strict=True):
        steps = np.arange(0.5 * SLIDE_M, length, SLIDE_M)[:, None] / length
        points = ends[0] + steps * (ends[1] - ends[0])
        for segment in segments:
            if segment.length <= length + LENGTH_SLACK_M:
                theta = math.atan2(ny, nx) - segment.alpha
                cos, sin = math.cos(theta), math.sin(theta)
                middle = (cos * segment.x - sin * segment.y, sin * segment.x + cos * segment.y)
                rows.append(np.column_stack([points - middle, np.full(len(points), theta)]))
    return np.concatenate(rows)


def _sides(room: Room) -> _Sides:
    ends = np.concatenate([room.walls.reshape(-1, 2, 2)] * 2)
    normals, offsets = np.concatenate([room.normals, -room.normals]), np.concatenate([room.offsets, -room.offsets])
    return _Sides(normals, offsets, ends, np.hypot(*(ends[:, 1] - ends[:, 0]).T))
