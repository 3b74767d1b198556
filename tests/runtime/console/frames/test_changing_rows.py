"""Lists that frames show when they have changed."""

from __future__ import annotations

from dataclasses import replace

import orjson

from perception.polyline import Polyline
from runtime.console.frames.changing_rows import ChangingRows
from tests.polylines import BEND


def test_a_list_changes_when_an_item_comes_or_goes_and_each_is_encoded_once() -> None:
    encoded = []

    def row(item: str) -> dict[str, str]:
        encoded.append(item)
        return {"name": item}

    rows = ChangingRows(row)
    assert (rows.json, rows.update(())) == (b"[]", False)
    items = ("a", "b")
    assert [rows.update(items), rows.update(items), rows.update(("b", "a"))] == [True, False, False]
    assert rows.update(("b", "c"))
    assert orjson.loads(rows.json) == [{"name": "b"}, {"name": "c"}]
    assert encoded == ["a", "b", "c"]
    assert rows.update(())
    assert rows.json == b"[]"


def test_a_polyline_that_has_been_made_anew_differs() -> None:
    rows = ChangingRows[Polyline](lambda one: one.number)
    assert [rows.update((BEND,)), rows.update((BEND,)), rows.update((replace(BEND),))] == [True, False, True]
