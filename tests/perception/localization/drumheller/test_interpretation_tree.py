"""The interpretation tree against an enumeration of all assignments."""

from __future__ import annotations

import cmath
import itertools
import math

import numpy as np
import pytest

from bench.trials.random_rooms import random_room
from config.world import AcousticsConfig
from drivers.messages import Pose
from perception.localization.drumheller import interpretation_tree
from perception.localization.drumheller.contour import ContourSegment, contour_segments
from perception.localization.drumheller.interpretation_tree import (
    ANGLE_SLACK_RAD,
    DISTANCE_SLACK_M,
    LENGTH_SLACK_M,
    SLIDE_M,
    Interpretation,
    interpretations,
    poses_along_walls,
)
from perception.localization.room.range_likelihood import RangeModel
from perception.localization.room.room import Room, make_room
from tests import naive
from tests.perception.localization.rooms import HALF_ANGLE, RING, panorama_of, stand

SQUARE = np.array([(0, 0, 4, 0), (4, 0, 4, 4), (4, 4, 0, 4), (0, 4, 0, 0)], dtype=float)
SLACK = math.radians(3.0)

Wall = tuple[complex, complex]


def seen(direction_deg: float, offset: float, length: float = 0.0) -> ContourSegment:
    """A segment whose echo came from the foot of the perpendicular."""
    foot = cmath.rect(offset, math.radians(direction_deg))
    return ContourSegment(2, math.radians(direction_deg), SLACK, offset, 0.02, foot.real, foot.imag, length)


def pair_agrees(
    first: ContourSegment, a: complex, side: complex, second: ContourSegment, ends: Wall, other: complex
) -> bool:
    """Whether the second segment may be the wall between `ends`, if the first is the wall through `a`.

    `side` and `other` are the walls' unit normals away from the robot.
    """
    turn_seen, turn_map = cmath.rect(1.0, second.alpha - first.alpha), other / side
    if abs(cmath.phase(turn_map / turn_seen)) > first.alpha_slack + second.alpha_slack + ANGLE_SLACK_RAD:
        return False
    point = complex(second.x, second.y) * cmath.rect(1.0, -first.alpha)
    foot = complex(first.x, first.y) * cmath.rect(1.0, -first.alpha)
    slack = DISTANCE_SLACK_M + first.offset_slack + second.offset_slack + second.length / 2
    slack += abs(point.imag - foot.imag) * math.sin(first.alpha_slack)
    distances = [((end - a) * side.conjugate()).real for end in ends]
    return min(distances) - slack <= point.real - first.offset <= max(distances) + slack


def enumerated(segments: list[ContourSegment], room: Room) -> list[int]:
    """The number of segments with a wall in each assignment that breaks no constraint and fixes a place."""
    walls = [(complex(x1, y1), complex(x2, y2)) for x1, y1, x2, y2 in room.walls.tolist()]
    sides = [(wall, sign * 1j * (wall[1] - wall[0]) / abs(wall[1] - wall[0])) for sign in (1, -1) for wall in walls]
    counts = []
    for assignment in itertools.product([None, *sides], repeat=len(segments)):
        chosen = [(s, *side) for s, side in zip(segments, assignment, strict=True) if side is not None]
        if all(s.length <= abs(ends[1] - ends[0]) + LENGTH_SLACK_M for s, ends, _ in chosen) and all(
            pair_agrees(s, ends[0], n, t, other_ends, m)
            for (s, ends, n), (t, other_ends, m) in itertools.permutations(chosen, 2)
        ):
            normals = np.array([(n.real, n.imag) for _, _, n in chosen]).reshape(-1, 2)
            if len(chosen) > 1 and np.linalg.det(normals.T @ normals) > math.sin(math.radians(20.0)) ** 2:
                counts.append(len(chosen))
    return sorted(counts, reverse=True)


def test_leaves_equal_an_enumeration_of_all_assignments() -> None:
    leaves = 0
    for seed in range(4):
        world, truth = random_room(seed, AcousticsConfig(model="specular"))
        room, firing = stand(world, truth)
        segments = list(contour_segments(panorama_of(firing), HALF_ANGLE, "specular", RangeModel.of_ring(RING))[:3])
        found = [leaf.assigned for leaf in interpretations(segments, room)]
        assert found == enumerated(segments, room)
        leaves += len(found)
    assert leaves > 20


def is_near(leaf: Interpretation, pose: Pose) -> bool:
    """Whether a leaf has this pose."""
    return math.hypot(leaf.x - pose.x, leaf.y - pose.y) < 1e-6 and naive.angle_between(leaf.theta, pose.theta) < 1e-6


def test_a_square_gives_its_four_symmetric_poses_first() -> None:
    segments = [seen(angle, offset) for angle, offset in ((0.0, 3.0), (90.0, 2.5), (180.0, 1.0), (270.0, 1.5))]
    leaves = [leaf for leaf in interpretations(segments, make_room(SQUARE)) if leaf.assigned == 4]
    poses = [Pose(1.0, 1.5, 0.0), Pose(2.5, 1.0, math.pi / 2), Pose(3.0, 2.5, math.pi), Pose(1.5, 3.0, -math.pi / 2)]
    assert len(leaves) == 4
    assert all(any(is_near(leaf, pose) for leaf in leaves) for pose in poses)


def test_a_segment_is_not_on_a_shorter_wall() -> None:
    room = make_room(np.array([(0, 0, 4, 0), (4, 0, 4, 1), (4, 1, 0, 1), (0, 1, 0, 0)], dtype=float))
    segments = [seen(0.0, 3.0), seen(90.0, 0.5, length=2.0)]
    leaves = interpretations(segments, room)
    assert any(is_near(leaf, Pose(1.0, 0.5, 0.0)) for leaf in leaves)
    assert all(abs(math.sin(leaf.theta)) < 0.5 for leaf in leaves), "the long segment is on a long wall"


def test_parallel_walls_fix_no_place() -> None:
    assert interpretations([seen(0.0, 3.0), seen(180.0, 1.0)], make_room(SQUARE)) == ()


def test_one_wall_gives_a_row_of_poses_that_see_it() -> None:
    room = make_room(SQUARE)
    segment = seen(30.0, 1.5)
    poses = poses_along_walls([segment], room)
    row = poses[(np.abs(poses[:, 0] - 2.5) < 1e-9) & (np.abs(np.sin(poses[:, 2] + segment.alpha)) < 1e-9)]
    row = row[np.cos(row[:, 2] + segment.alpha) > 0]
    assert np.diff(np.sort(row[:, 1])) == pytest.approx(SLIDE_M)
    assert 0.0 < row[:, 1].min() < SLIDE_M
    assert 4.0 - SLIDE_M < row[:, 1].max() < 4.0
    assert len(poses) == 8 * len(row), "as much on either side of each wall"
    assert len(poses_along_walls([seen(30.0, 1.5, length=4.5)], room)) == 0


def test_the_number_of_nodes_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    segments = [seen(angle, 2.0) for angle in (0.0, 90.0, 180.0, 270.0)]
    whole = interpretations(segments, make_room(SQUARE))
    monkeypatch.setattr(interpretation_tree, "TREE_NODES_MAX", 50)
    cut = interpretations(segments, make_room(SQUARE))
    assert 0 < len(cut) < len(whole)
    assert set(cut) <= set(whole)
