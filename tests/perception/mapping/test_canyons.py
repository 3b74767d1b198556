"""Box canyons: recognised from walls, chains and posts; no false ones in halls, corridors and corners; remembered."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Pose
from perception.detected_object import DetectedObject
from perception.mapping.canyons import (
    BRIDGES_MAX,
    DOUBT,
    EVERY_FIRINGS,
    SURFACES_MAX,
    CanyonMap,
    canyon_round,
    places_before,
    surfaces_of,
)
from perception.percept import Canyon

SEALED_M = 0.93
RADII = {"drum": 0.3048}
Ends = tuple[float, float, float, float]
U: tuple[Ends, ...] = ((2, 1, 5, 1), (5, 1, 5, -1), (5, -1, 2, -1))


def wall(x1: float, y1: float, x2: float, y2: float, score: float = 1.0) -> DetectedObject:
    """Return a wall as perception reports it."""
    theta, twelfth = math.atan2(y2 - y1, x2 - x1), math.hypot(x2 - x1, y2 - y1) ** 2 / 12.0
    c, s = math.cos(theta), math.sin(theta)
    covariance = (twelfth * c * c, twelfth * c * s, twelfth * s * s)
    return DetectedObject("wall", 0.5 * (x1 + x2), 0.5 * (y1 + y2), theta, 0.1, 9, score, covariance=covariance)


def drum(x: float, y: float) -> DetectedObject:
    return DetectedObject("drum", x, y, 0.0, 0.01, 9, 1.0)


def found(seen: list[DetectedObject], x: float, y: float) -> Canyon | None:
    return canyon_round(x, y, surfaces_of(seen, RADII, SEALED_M), SEALED_M)


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.5, -1.9])
def test_three_walls_are_a_canyon_at_any_angle(turn: float) -> None:
    c, s = math.cos(turn), math.sin(turn)
    seen = [wall(c * a - s * b, s * a + c * b, c * d - s * e, s * d + c * e) for a, b, d, e in U]
    canyon = found(seen, 4.0 * c, 4.0 * s)
    assert canyon is not None
    assert canyon.depth_m == pytest.approx(3.0, abs=0.01)
    assert math.remainder(canyon.axis_rad - turn, math.tau) == pytest.approx(0.0, abs=0.01)
    middle = 0.5 * (np.array(canyon.mouth[:2]) + canyon.mouth[2:])
    assert middle == pytest.approx((2.0 * c, 2.0 * s), abs=0.01)
    assert canyon.probability > 0.95
    assert found(seen, 1.0 * c, 1.0 * s) is None


def test_where_one_side_is_known_farther_out_the_axis_still_leads_along_the_sides() -> None:
    canyon = found([wall(1.6, 0.5, 9, 0.5), wall(9, 0.5, 9, -0.5), wall(9, -0.5, 2, -0.5)], 6.0, 0.0)
    assert canyon is not None
    assert canyon.axis_rad == pytest.approx(0.0, abs=0.05)
    assert canyon.depth_m == pytest.approx(7.2, abs=0.1)


def test_a_gap_that_is_too_narrow_is_closed_and_one_of_a_doorway_is_open() -> None:
    for gap, closed in ((0.85, True), (1.1, False)):
        seen = [wall(2, 1, 3.5, 1), wall(3.5 + gap, 1, 7, 1), wall(7, 1, 7, -1), wall(7, -1, 2, -1)]
        canyon = found(seen, 3.0, 0.0)
        assert (canyon is not None) is closed, gap
    behind = found([wall(2, 1, 3.5, 1), wall(4.6, 1, 7, 1), wall(7, 1, 7, -1), wall(7, -1, 2, -1)], 6.0, 0.0)
    assert behind is not None
    assert behind.depth_m == pytest.approx(2.4, abs=0.3)


def test_edges_and_corners_of_walls_have_no_width() -> None:
    seen = [wall(2, 1, 3.5, 1), wall(4.6, 1, 7, 1), wall(7, 1, 7, -1), wall(7, -1, 2, -1)]
    points = [DetectedObject("edge", x, 1.005, 0.0, 0.01, 9, 1.0) for x in (3.5, 4.6)]
    points.append(DetectedObject("inside corner", 7.005, 1.0, 0.0, 0.01, 9, 1.0))
    assert found([*seen, *points], 3.0, 0.0) is None, "the robot passes a doorway of 1.1 m"
    closed = len(surfaces_of(seen, RADII, SEALED_M).pieces)
    assert len(surfaces_of([*seen, *points], RADII, SEALED_M).pieces) == closed, "no gap at the end of a wall"
    midway = DetectedObject("edge", 4.05, 1.0, 0.0, 0.01, 9, 1.0)
    assert found([*seen, midway], 3.0, 0.0) is not None, "beside it the robot passes on neither side"


def test_columns_of_drums_are_a_corridor_and_with_a_back_a_canyon() -> None:
    columns = [drum(0.3 + 0.914 * k, y) for k in range(3) for y in (1.2, -1.2)]
    assert found(columns, 1.2, 0.0) is None
    pen = found([*columns, drum(2.9, 0.5), drum(2.9, -0.5)], 1.2, 0.0)
    assert pen is not None
    assert pen.axis_rad == pytest.approx(0.0, abs=0.1)


def test_a_corridor_a_corner_a_niche_and_a_doubtful_wall_are_none() -> None:
    assert found([wall(0, 1, 8, 1), wall(0, -1, 8, -1)], 4.0, 0.0) is None
    assert found([wall(0, 0, 4, 0), wall(0, 0, 0, 4)], 0.8, 0.8) is None
    assert found([wall(2, 1, 2.5, 1), wall(2.5, 1, 2.5, -1), wall(2.5, -1, 2, -1)], 2.2, 0.0) is None
    assert found([wall(*ends, score=0.3) for ends in U], 4.0, 0.0) is None
    assert found([], 0.0, 0.0) is None


def test_one_side_may_go_on_beyond_the_mouth() -> None:
    canyon = found([wall(2, 1, 5, 1), wall(5, 1, 5, -1), wall(5, -1, -3, -1)], 4.0, 0.0)
    assert canyon is not None
    assert canyon.depth_m == pytest.approx(3.0, abs=0.2)


def test_a_canyon_keeps_its_number_is_remembered_and_forgotten_when_it_is_gone() -> None:
    seen, canyon_map = [wall(*ends) for ends in U], CanyonMap(SEALED_M)

    for _ in range(2 * EVERY_FIRINGS):
        canyon_map.observe(Pose(0.0, 0.0, 0.0))
    assert not canyon_map.is_due
    canyon_map.is_wanted = True

    def examine(pose: Pose, objects: list[DetectedObject]) -> None:
        for _ in range(EVERY_FIRINGS):
            assert not canyon_map.is_due
            canyon_map.observe(pose)
        assert canyon_map.is_due
        canyon_map.refine(objects, RADII)

    for _ in range(40):
        examine(Pose(0.0, 0.0, 0.0), seen)
    assert [canyon.number for canyon in canyon_map.canyons()] == [1]  # seen from outside: places before the walls
    for _ in range(25):
        examine(Pose(30.0, 0.0, 0.0), [])
    assert [canyon.number for canyon in canyon_map.canyons()] == [1]
    for _ in range(3):  # one of three times at the canyon itself
        examine(Pose(3.0, 0.0, 0.0), [])
    assert canyon_map.canyons()[0].probability == pytest.approx(DOUBT)
    for _ in range(9):
        examine(Pose(3.0, 0.0, 0.0), [])
    assert canyon_map.canyons() == ()
    canyon_map.clear()
    assert canyon_map.numbered == 0


def test_places_lie_before_both_faces() -> None:
    surfaces = surfaces_of([wall(0, 0, 4, 0)], RADII, SEALED_M)
    assert places_before(surfaces, 0.7).tolist() == [pytest.approx([2.0, 0.7]), pytest.approx([2.0, -0.7])]


def test_a_crowded_room_costs_no_more_and_hides_no_canyon_beside_the_robot() -> None:
    """What is far away is left out, and of the gaps the wide ones: the cost of a place has a bound."""
    rng = np.random.default_rng(1)
    places = rng.uniform(-8.0, -3.0, (60, 2)).tolist()
    crowd = [drum(x, y) for x, y in places] + [wall(x, y, x + 1.0, y + 0.5) for x, y in places]
    surfaces = surfaces_of(crowd, RADII, SEALED_M)
    assert len(surfaces.circle_weights) == SURFACES_MAX
    assert len(surfaces.piece_weights) == SURFACES_MAX + BRIDGES_MAX
    room = CanyonMap(SEALED_M)
    room.is_wanted = True
    for _ in range(EVERY_FIRINGS):
        room.observe(Pose(4.0, 0.0, 0.0))
    for _ in range(3):
        room.firings += EVERY_FIRINGS
        room.refine([*crowd, *(wall(*ends) for ends in U)], RADII)
    assert [canyon.depth_m for canyon in room.canyons()] == [pytest.approx(3.0, abs=0.01)]
