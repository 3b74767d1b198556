"""Undo of an operator's edits: for each edit, the edits that take it back, worked out as it is carried out.

They are edits like all others, so that a recording holds them and a replay needs no history. What an edit changed is
found by comparing the map before and after it: an edit that was refused in part is taken back as far as it was done.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final, TypeAlias

from perception.detected_object import DetectedObject
from perception.edits import (
    EDIT_COORDINATE_MAX_M,
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    Edit,
    LiftArea,
    MoveObject,
    ObjectRow,
    PinSegments,
    PlaceModel,
    RestoreArea,
    RestoreObjects,
    RestoreSegments,
    Segments,
    WithdrawPlacement,
)
from perception.pipeline import Perception
from perception.vacant_areas import VacantArea

RESTORED_MAX: Final = 4096
"""Segments that one undo puts back; the newest ones, of more than a map of a hundred metres has."""
OBJECTS_MAX: Final = 64
"""Objects that the undo of a cleared map puts back, those near the robot first; each takes 0.1 ms."""

Undo: TypeAlias = tuple[Edit, ...]
"""Edits that take another one back, in this order; empty where nothing had changed."""


def edit_with_undo(edit: Edit, seen: Perception) -> tuple[str | None, Undo]:
    """Apply an operator's edit; return why it was refused, None if it was not, and what takes it back.

    Parameters
    ----------
    edit : Edit
        The edit, which may be refused in part.
    seen : Perception
        The map, updated.
    """
    areas, objects = seen.vacant_areas(), _rows(seen, edit)
    walls = seen.method.kept_walls() if isinstance(edit, ClearMap) else ""
    held = seen.segments() if isinstance(edit, DeleteSegments | PinSegments | ClearMap) else None
    refused = seen.edit(edit)
    undo: list[Edit] = []
    match edit:
        case DeleteSegments(numbers) if held is not None:
            undo += _restored(held, set(numbers) - set(seen.segments().numbers.tolist()))
        case PinSegments(numbers) if held is not None:
            undo += _pins(held, seen.segments(), set(numbers))
        case ClearMap() if held is not None and refused is None:
            undo += _restored(held, set(held.numbers.tolist()))
        case PlaceModel() if refused is None:
            undo += [WithdrawPlacement(number) for number in _newest_placed(seen)]
    if (objects or walls) and refused is None:
        undo.append(RestoreObjects(objects, walls))
    return refused, (*undo, *_areas(areas, seen.vacant_areas()))


def _rows(seen: Perception, edit: Edit) -> tuple[ObjectRow, ...]:
    """Return the objects that an edit may change."""
    match edit:
        case MoveObject(number):
            changed: Iterable[DetectedObject] = (one for one in seen.known_objects() if one.number == number)
        case ConfirmObject(number):
            changed = (one for one in seen.known_objects() if one.number == number and not one.confirmed)
        case ClearMap():
            changed = seen.known_objects()[:OBJECTS_MAX]
        case _:
            return ()
    rows = ((one, seen.method.kept(one.number)) for one in changed if one.number is not None)
    return tuple(
        ObjectRow(one.number or 0, one.x, one.y, one.theta, one.confirmed, kept)
        for one, kept in rows
        if kept is not None
    )


def _newest_placed(seen: Perception) -> list[int]:
    """Return the number of the object that was placed last; none if there is no such object."""
    return sorted(one.number for one in seen.labelled_objects() if one.placed and one.number is not None)[-1:]


def _areas(before: tuple[VacantArea, ...], after: tuple[VacantArea, ...]) -> list[Edit]:
    """Return the edits that lift the areas which came and put back those which went."""
    had, has = {area.number for area in before}, {area.number for area in after}
    lifted: list[Edit] = [LiftArea(area.number) for area in after if area.number not in had]
    back = (area for area in before if area.number not in has)
    return [*lifted, *(RestoreArea(area.number, area.x, area.y, area.radius, area.object) for area in back)]


def _restored(held: Segments, numbers: set[int]) -> list[Edit]:
    """Return the edit that puts the segments of these numbers back."""
    rows = []
    for number, ends, time_s, pinned in zip(
        held.numbers.tolist(), held.geometry.tolist(), held.times.tolist(), held.pinned.tolist(), strict=True
    ):
        if number in numbers and all(abs(value) <= EDIT_COORDINATE_MAX_M for value in ends):
            x1, y1, x2, y2, normal = ends
            known_s = time_s if math.isfinite(time_s) else 0.0
            rows.append((float(number), x1, y1, x2, y2, normal, known_s, float(pinned)))
    newest = tuple(sorted(rows)[-RESTORED_MAX:])
    return [RestoreSegments(newest)] if newest else []


def _pins(before: Segments, after: Segments, numbers: set[int]) -> list[Edit]:
    """Return the edits that pin or unpin again those of some segments that are not as before."""
    was, now = (dict(zip(held.numbers.tolist(), held.pinned.tolist(), strict=True)) for held in (before, after))
    changed = sorted(number for number in numbers & was.keys() & now.keys() if was[number] != now[number])
    sides = ((pinned, tuple(number for number in changed if bool(was[number]) == pinned)) for pinned in (False, True))
    return [PinSegments(some, pinned=pinned) for pinned, some in sides if some]
