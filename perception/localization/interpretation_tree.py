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
from perception.localization.contour import ContourSegment
from perception.localization.room import Room

NODES_MAX: Final = 20_000
"""Nodes of the tree that are visited at most; what lies behind is left out."""
ANGLE_SLACK_RAD: Final = math.radians(2.0)
"""Tolerance of angles beyond the segments' own, rad."""
LENGTH_SLACK_M: Final = 0.3
"""A segment may be longer than its wall by this, m."""
DISTANCE_SLACK_M: Final = 0.1
"""Tolerance of distances beyond the segments' own, m."""
SLIDE_M: Final = 0.15
"""Distance of the places that are tried along parallel walls, m."""
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


def interpretations(segments: Sequence[ContourSegment], room: Room, walls_min: int) -> tuple[Interpretation, ...]:
    """Return the poses that the leaves of the tree give: most assigned segments first.

    Parameters
    ----------
    segments : sequence of ContourSegment
        Those that enter the tree; each is a level.
    room : Room
        The walls.
    walls_min : int
        Least number of segments with a wall. With 2, only leaves whose walls fix a place count; with 1, a wall alone
        or parallel walls give a row of places along them.
    """
    ends = np.concatenate([room.walls.reshape(-1, 2, 2)] * 2)
    sides = _Sides(
        np.concatenate([room.normals, -room.normals]), np.concatenate([room.offsets, -room.offsets]), ends,
        np.hypot(*(ends[:, 1] - ends[:, 0]).T),
    )  # fmt: skip
    allowed = _binary_masks(segments, sides)
    whole = [
        sum(1 << i for i, length in enumerate(sides.length) if s.length <= length + LENGTH_SLACK_M) for s in segments
    ]
    leaves: list[Interpretation] = []
    nodes = 0
    stack: list[tuple[int, tuple[tuple[int, int], ...], tuple[int, ...]]] = [(0, (), tuple(whole))]
    while stack and nodes < NODES_MAX:
        level, chosen, masks = stack.pop()
        nodes += 1
        if level == len(segments):
            if len(chosen) >= walls_min:
                leaves += _poses([(segments[k], i) for k, i in chosen], sides, walls_min)
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


def _poses(chosen: Sequence[tuple[ContourSegment, int]], sides: _Sides, walls_min: int) -> list[Interpretation]:
    """Return the poses of a leaf: heading from directions, place by least squares over the walls' normals.

    Where all walls are parallel, the place along them is free: places at every `SLIDE_M` are returned.
    """
    index = [i for _, i in chosen]
    normals, weight = sides.normals[index], np.array([1.0 / s.alpha_slack**2 for s, _ in chosen])
    turn = np.arctan2(normals[:, 1], normals[:, 0]) - [s.alpha for s, _ in chosen]
    theta = math.atan2(float(weight @ np.sin(turn)), float(weight @ np.cos(turn)))
    distance = sides.offsets[index] - [s.offset for s, _ in chosen]
    information = normals.T @ normals
    if np.linalg.det(information) >= CROSSING_MIN**2:
        places = np.linalg.solve(information, normals.T @ distance)[None, :]
    elif walls_min > 1:
        return []
    else:
        nx, ny = normals[0]
        along = np.array([-ny, nx])
        reach = sides.ends.reshape(-1, 2) @ along
        steps = np.arange(reach.min(), reach.max(), SLIDE_M)
        places = normals[0] * float((normals @ normals[0]) @ distance / len(chosen)) + steps[:, None] * along
    return [Interpretation(len(chosen), x, y, theta) for x, y in places.tolist()]
