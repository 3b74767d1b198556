"""Vacant areas: what is in them is not reported, and is back at once when they are lifted."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.messages import Firing
from perception.detected_object import DetectedObject
from perception.edits import LiftArea, MarkVacant, MoveObject, PlaceModel, RejectObject
from perception.map_moves import MapMoves
from perception.pipeline import Perception
from perception.vacant_areas import AREAS_MAX, RADIUS_MIN_M, VacantAreas, invalid_area, radius_of
from tests.perception.edited import DRUM, again, at, hear, number_of, there
from tests.polylines import BEND


def drum(number: int | None, x: float, y: float) -> DetectedObject:
    return DetectedObject("drum", x, y, 0.0, 0.01, 9, 0.9, number=number)


def test_objects_are_hidden_by_place_and_by_number_and_corners_never() -> None:
    areas = VacantAreas()
    seen = (drum(1, 0.0, 0.0), drum(2, 0.5, 0.0), drum(3, 5.0, 0.0), drum(None, 0.0, 0.0))
    assert areas.outside(seen) is seen
    assert areas.mark(0.2, 0.0, 0.3, 3) is None
    assert [one.number for one in areas.outside(seen)] == [None], "number 3 has moved away, and stays rejected"
    assert areas.archived_outside(seen) is areas.archived_outside(seen), "the same tuple until it changes"
    assert areas.mark(9.0, 9.0, 1.0) is None
    assert [area.number for area in areas.listed()] == [1, 2]
    assert areas.lift(1)
    assert not areas.lift(1)
    assert areas.archived_outside(seen) == seen
    areas.lift_at(9.5, 9.5)
    assert areas.listed() == ()
    assert areas.mark(0.0, 0.0, 1.0) is None
    assert areas.listed()[0].number == 3, "no number is given twice"


def test_a_wall_is_hidden_by_number_and_where_an_area_contains_all_of_it() -> None:
    areas = VacantAreas()
    wall = DetectedObject("wall", 0.0, 0.0, 0.0, 0.6, 9, 0.9, covariance=(4.0 / 12.0, 0.0, 0.0), number=7)
    assert wall.ends == pytest.approx((-1.0, 0.0, 1.0, 0.0))
    areas.mark(0.0, 0.0, 0.9)
    assert not areas.hides(wall), "an area on a wall is not all of it"
    areas.mark(0.0, 0.1, 1.1)
    assert areas.hides(wall)
    areas.clear()
    areas.mark(5.0, 5.0, 0.3, 7)
    assert areas.hides(wall)


def test_areas_are_bounded() -> None:
    areas = VacantAreas()
    for k in range(AREAS_MAX):
        assert areas.mark(float(k), 0.0, 0.5) is None
    assert "lift one first" in str(areas.mark(0.0, 0.0, 0.5))
    areas.clear()
    assert (areas.count, areas.last, areas.rows.tobytes().strip(b"\0")) == (0, AREAS_MAX, b"")
    assert invalid_area(0.0, 0.0, 0.1, 1e4) is None
    for bad in ((math.nan, 0.0, 1.0), (0.0, 1e5, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, math.inf), (0.0, 0.0, math.nan)):
        assert "invalid area" in str(invalid_area(*bad, 1e4))
    assert radius_of(0.1) == RADIUS_MIN_M
    assert radius_of(0.8) == 0.8


@pytest.mark.promise("P31")
@pytest.mark.compiled
def test_a_rejected_object_does_not_return_until_its_area_is_lifted(seen: Perception, firings: list[Firing]) -> None:
    """The issue's case: it was back after 4 s under another number."""
    number = number_of(there(seen))
    others = {o.number for o in seen.objects()} - {number}
    assert seen.edit(RejectObject(number)) is None
    assert seen.edit(RejectObject(number)) is not None, "it is not in the list any more"
    for firing in again(firings):
        hear(seen, firing)
        assert at(seen, DRUM, 0.3) is None
    assert all(math.dist((o.x, o.y), DRUM) > 0.3 for o in seen.labelled_objects() if o.number is not None)
    assert {o.number for o in seen.objects()} & others
    (area,) = seen.vacant_areas()
    taken = seen.snapshot()
    assert seen.edit(LiftArea(area.number)) is None
    assert number_of(there(seen)) == number, "it is back at once, with its number"
    assert "no vacant area" in str(seen.edit(LiftArea(area.number)))
    seen.restore(taken)
    assert at(seen, DRUM, 0.3) is None
    assert seen.vacant_areas() == (area,)
    model = there_model(seen)
    assert seen.edit(PlaceModel(model, area.x, area.y, 0.0)) is None
    assert seen.vacant_areas() == (), "the operator has put something there"


@pytest.mark.compiled
def test_an_area_is_marked_by_hand_and_left_by_what_is_moved_into_it(seen: Perception) -> None:
    number = number_of(there(seen))
    x, y = DRUM
    assert seen.edit(MarkVacant(x, y, 0.4)) is None
    assert at(seen, DRUM, 0.3) is None
    assert "invalid area" in str(seen.edit(MarkVacant(x, y, -1.0)))
    assert seen.edit(MoveObject(number, x, y, 0.0)) is None
    assert seen.vacant_areas() == ()
    assert seen.edit(MarkVacant(x, y, 0.4)) is None
    seen.reset()
    assert seen.vacant_areas() == ()
    assert np.count_nonzero(seen.vacant.rows["number"]) == 0


def there_model(seen: Perception) -> str:
    return seen._models[0].name


def test_a_polyline_is_hidden_where_an_area_contains_all_of_it() -> None:
    areas, polylines = VacantAreas(), (BEND, replace(BEND, number=4, points=BEND.points + 5.0))
    assert areas.polylines_outside(polylines) is polylines
    areas.mark(1.0, 0.0, 1.2)
    areas.mark(2.0, 1.0, 0.5)
    shown = areas.polylines_outside(polylines)
    assert shown == polylines, "each area contains a part of it only"
    assert areas.polylines_outside(polylines) is shown, "the same tuple until it changes"
    areas.mark(1.5, 0.5, 0.8)
    assert areas.polylines_outside(polylines) == polylines[1:]
    areas.lift(3)
    assert areas.polylines_outside(polylines) == polylines


def test_areas_move_with_the_nearest_map_of_the_way() -> None:
    areas = VacantAreas()
    moves = MapMoves(np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]), np.array([[0.0, 0.0], [9.0, 0.0]]))
    areas.follow_maps(2, moves)
    for x in (1.0, 8.0):
        assert areas.mark(x, 1.0, 0.5) is None
    seen = (drum(1, 7.8, 1.0), drum(2, 1.0, 1.0))
    areas.follow_maps(2, None)
    assert areas.archived_outside(seen) == ()
    areas.follow_maps(2, moves)
    assert [(area.x, area.y) for area in areas.listed()] == [(1.0, 1.0), (8.5, 1.0)]
    assert areas.archived_outside(seen) == seen[:1]
