"""Edits of one map as edits of another: the same object there, and nothing where there is none."""

from __future__ import annotations

import pytest

from config.load import load_settings
from perception.edits import DeleteSegments, MoveObject, PlaceModel
from perception.localization.equal_edit import edit_equally
from perception.method import Method, make_method

SETTINGS = load_settings("room")


def method_with(*places: tuple[float, float]) -> Method:
    """Return a method in whose map an operator has placed drums."""
    method = make_method(SETTINGS.ring, SETTINGS.models, SETTINGS.perception)
    for x, y in places:
        assert method.edit(PlaceModel("drum", x, y, 0.0)) is None
    return method


def places(method: Method) -> list[tuple[float, float]]:
    """Return where its objects are."""
    return [(round(seen.x, 2), round(seen.y, 2)) for seen in method.objects()]


@pytest.mark.compiled
def test_an_object_of_another_number_moves_and_one_elsewhere_stays() -> None:
    mine, other = method_with((1.0, 1.0)), method_with((4.0, 0.0), (1.1, 1.0))
    number = mine.objects()[0].number
    assert number is not None
    edit_equally(MoveObject(number, 2.0, 2.0, 0.0), mine, other)
    assert sorted(places(other)) == [(2.0, 2.0), (4.0, 0.0)]


@pytest.mark.compiled
def test_nothing_is_edited_where_there_is_no_such_object() -> None:
    mine, other = method_with((1.0, 1.0)), method_with((4.0, 0.0))
    number = mine.objects()[0].number
    assert number is not None
    for edit in (MoveObject(number, 2.0, 2.0, 0.0), MoveObject(99, 2.0, 2.0, 0.0), DeleteSegments((1,))):
        edit_equally(edit, mine, other)
    assert places(other) == [(4.0, 0.0)]
    edit_equally(PlaceModel("drum", 1.0, 1.0, 0.0), mine, other)
    assert len(places(other)) == 2
