"""An operator's edit of one method's map as that of another method's map, whose objects are numbered otherwise."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from perception.detected_object import DetectedObject
from perception.edits import (
    ClearMap,
    ConfirmObject,
    MapEdit,
    MoveObject,
    ObjectRow,
    PlaceModel,
    RemoveObject,
    RestoreObjects,
    WithdrawConfirmation,
    WithdrawPlacement,
)
from perception.method import Method

SAME_OBJECT_M: Final = 0.5
"""Objects of one model, one of each map, that are nearer to each other are the same: two drums are farther apart."""
MOVED_M: Final = 0.05
"""An object of the other map within this of a place is not moved there: its own readings place it better."""


def edit_equally(edit: MapEdit, of: Method, to: Method) -> None:
    """Apply an edit of the map of `of`, before it is applied there, to the map of `to`, if it has what is edited.

    Segments are numbered otherwise there, and their edits do not last.
    """
    if isinstance(edit, PlaceModel | ClearMap):
        to.edit(edit)
    elif isinstance(edit, RestoreObjects):
        for row in edit.rows:
            _restore_equally(row, of, to)
    elif isinstance(edit, MoveObject | WithdrawPlacement | RemoveObject | ConfirmObject | WithdrawConfirmation):
        same = _same(edit.object, of, to)
        if same is not None and same.number is not None:
            to.edit(replace(edit, object=same.number))


def _restore_equally(row: ObjectRow, of: Method, to: Method) -> None:
    """Move the same object back and confirm it as it was; the readings kept for it are those of its own map."""
    same = _same(row.number, of, to)
    if same is None or same.number is None:
        return
    if math.dist((same.x, same.y), (row.x, row.y)) > MOVED_M:
        to.edit(MoveObject(same.number, row.x, row.y, row.theta))
    if same.confirmed != row.confirmed:
        to.edit((ConfirmObject if row.confirmed else WithdrawConfirmation)(same.number))


def _same(number: int, of: Method, to: Method) -> DetectedObject | None:
    """Return the object of `to` that is the object of this number in `of`; None if there is none."""
    held = (*of.labelled_objects(), *of.archived_objects())
    seen = next((one for one in held if one.number == number), None)
    if seen is None:
        return None
    near = [
        (apart, one.number, one)
        for one in (*to.labelled_objects(), *to.archived_objects())
        if one.model == seen.model
        and one.number is not None
        and (apart := math.dist((one.x, one.y), (seen.x, seen.y))) < SAME_OBJECT_M
    ]
    return min(near)[2] if near else None
