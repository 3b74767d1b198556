"""Edits of vacant areas, by their own rules; what hides objects is tested with `vacant_areas`."""

from __future__ import annotations

from perception.area_edits import edit_areas, rejected
from perception.detected_object import DetectedObject
from perception.edits import LiftArea, MarkVacant, RejectObject, RestoreArea
from perception.vacant_areas import VacantArea, VacantAreas

DRUM = DetectedObject("drum", 1.0, 2.0, 0.0, 0.01, 9, 1.0, number=7)


def test_an_area_that_was_lifted_comes_back_with_its_number_and_its_object() -> None:
    vacant = VacantAreas()
    assert edit_areas(vacant, RejectObject(7), lambda: (DRUM,), ()) is None
    assert edit_areas(vacant, MarkVacant(5.0, 5.0, 1.0), tuple, ()) is None
    before = vacant.listed()
    assert before[0].object == 7
    assert edit_areas(vacant, LiftArea(1), tuple, ()) is None
    assert rejected(vacant, 7, (DRUM,)) is None
    area = before[0]
    back = RestoreArea(area.number, area.x, area.y, area.radius, area.object)
    assert edit_areas(vacant, back, tuple, ()) is None
    assert vacant.listed() == before
    assert "was not lifted" in str(edit_areas(vacant, back, tuple, ()))
    assert "was rejected" in str(edit_areas(vacant, RejectObject(7), lambda: (DRUM,), ()))
    assert "no object 8" in str(edit_areas(vacant, RejectObject(8), lambda: (DRUM,), ()))
    assert isinstance(before[0], VacantArea)
