"""An operator's edits of the vacant areas: places of which the operator said that nothing stands there."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from config.model import ModelConfig
from perception.detected_object import DetectedObject
from perception.edits import (
    EDIT_COORDINATE_MAX_M,
    AreaEdit,
    LiftArea,
    MarkVacant,
    RestoreArea,
    invalid_number,
    no_such_object,
)
from perception.vacant_areas import VacantArea, VacantAreas, invalid_area, radius_of


def edit_areas(
    vacant: VacantAreas,
    edit: AreaEdit,
    known: Callable[[], tuple[DetectedObject, ...]],
    models: Sequence[ModelConfig],
) -> str | None:
    """Apply an edit in the frame of the areas; return None, or why it cannot be applied.

    Parameters
    ----------
    vacant : VacantAreas
        The areas, updated.
    edit : AreaEdit
        The edit.
    known : callable
        Returns all objects, hidden ones included.
    models : sequence of ModelConfig
        The models that are recognised, for the size of a rejected object.
    """
    if isinstance(edit, LiftArea):
        return None if vacant.lift(edit.area) else f"no vacant area {edit.area}: look at the list again"
    if isinstance(edit, RestoreArea):
        refused = invalid_area(edit.x, edit.y, edit.radius, EDIT_COORDINATE_MAX_M)
        return refused or vacant.restore(VacantArea(edit.area, edit.x, edit.y, edit.radius, edit.object))
    if isinstance(edit, MarkVacant):
        refused = invalid_area(edit.x, edit.y, edit.radius, EDIT_COORDINATE_MAX_M)
        return refused or vacant.mark(edit.x, edit.y, edit.radius)
    found = next((o for o in known() if o.number == edit.object and not vacant.hides(o)), None)
    if found is None:
        return invalid_number(edit) or rejected(vacant, edit.object, known()) or no_such_object(edit.object)
    model = next((m for m in models if m.name == found.model), None)
    reach_m = 0.0 if model is None else max(math.hypot(x, y) for x, y in model.vertices_m)
    return vacant.mark(found.x, found.y, radius_of(reach_m), edit.object)


def rejected(vacant: VacantAreas, number: int, known: Sequence[DetectedObject]) -> str | None:
    """Return why an object cannot be edited that a vacant area hides; None if none does."""
    is_hidden = any(one.number == number and vacant.hides(one) for one in known)
    return f"object {number} was rejected: lift the area in which nothing stands first" if is_hidden else None
