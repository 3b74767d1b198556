"""An operator's edit of one method's map as that of another method's map, whose objects are numbered otherwise."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from perception.edits import (
    ClearMap,
    ConfirmObject,
    MapEdit,
    MoveObject,
    PlaceModel,
    RemoveObject,
    WithdrawConfirmation,
)
from perception.method import Method

SAME_M: Final = 0.5
"""Objects of one model, one of each map, that are nearer to each other are the same: two drums are farther apart."""


def edit_equally(edit: MapEdit, of: Method, to: Method) -> None:
    """Apply an edit of the map of `of`, before it is applied there, to the map of `to`, if it has what is edited.

    Segments are numbered otherwise there, and their edits do not last.
    """
    if isinstance(edit, PlaceModel | ClearMap):
        to.edit(edit)
    if not isinstance(edit, MoveObject | RemoveObject | ConfirmObject | WithdrawConfirmation):
        return
    held = (*of.labelled_objects(), *of.archived_objects())
    others = (*to.labelled_objects(), *to.archived_objects())
    seen = next((one for one in held if one.number == edit.object), None)
    if seen is None:
        return
    near = [
        (apart, one.number)
        for one in others
        if one.model == seen.model
        and one.number is not None
        and (apart := math.dist((one.x, one.y), (seen.x, seen.y))) < SAME_M
    ]
    if near:
        to.edit(replace(edit, object=min(near)[1]))
