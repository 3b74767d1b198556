"""Undo of map edits: for each edit that a cycle has carried out, the edits that take it back.

They are ordinary edits, so that a recording holds them like all others and a replay needs no history.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Final, TypeAlias

from perception.edits import (
    COORDINATE_MAX_M,
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    Edit,
    LiftArea,
    MarkVacant,
    MoveObject,
    PinSegments,
    PlaceModel,
    RejectObject,
    RemoveObject,
    RestoreSegments,
    Segments,
    WithdrawConfirmation,
)
from perception.pipeline import DetectedObject, Perception

KEPT: Final = 50
"""Edits that can be undone, the newest ones."""
RESTORED_MAX: Final = 4096
"""Segments that one undo puts back; the newest ones, of more than a map of a hundred metres has."""

Undo: TypeAlias = tuple[Edit, ...]
"""Edits that take another one back, in this order; none where nothing had changed."""


class EditHistory:
    """The edits that can be undone."""

    def __init__(self) -> None:
        self._undos: deque[tuple[Edit, Undo]] = deque(maxlen=KEPT)

    def add(self, edit: Edit, undo: Undo) -> None:
        """Take in an edit that was carried out."""
        if undo:
            self._undos.append((edit, undo))

    def take(self) -> tuple[Edit, Undo] | None:
        """Return the newest edit and what takes it back, and forget it; None if there is none."""
        return self._undos.pop() if self._undos else None

    def clear(self) -> None:
        """Forget all, as after a reset of the odometry: places mean something else then."""
        self._undos.clear()


def prepare_undo(edit: Edit, seen: Perception) -> Callable[[], Undo]:
    """Return a function that returns, once an edit is done, what takes it back.

    Parameters
    ----------
    edit : Edit
        Not carried out yet.
    seen : Perception
        The map before and, when the function is called, after it.
    """
    match edit:
        case DeleteSegments(numbers):
            return _always(_restored(seen.segments(), set(numbers)))
        case ClearMap():
            return _always(_restored(seen.segments(), None))
        case PinSegments(numbers, pinned):
            return _always(_unpinned(seen.segments(), set(numbers), pinned=pinned))
        case MoveObject(number):
            before = _found(seen, number)
            return _always(() if before is None else (MoveObject(number, before.x, before.y, before.theta),))
        case ConfirmObject(number):
            before = _found(seen, number)
            return _always((WithdrawConfirmation(number),) if before is not None and not before.confirmed else ())
        case PlaceModel(_, x, y):
            lifted = [area for area in seen.vacant_areas() if math.hypot(area.x - x, area.y - y) <= area.radius]
            marks = tuple(MarkVacant(area.x, area.y, area.radius) for area in lifted)
            return lambda: (*(RemoveObject(n) for n in _newest_placed(seen)), *marks)
        case RejectObject() | MarkVacant():
            return lambda: tuple(LiftArea(area.number) for area in seen.vacant_areas()[-1:])
        case LiftArea(number):
            areas = (area for area in seen.vacant_areas() if area.number == number)
            return _always(tuple(MarkVacant(area.x, area.y, area.radius) for area in areas))
    return _always(())


def _always(undo: Undo) -> Callable[[], Undo]:
    return lambda: undo


def _found(seen: Perception, number: int) -> DetectedObject | None:
    known = (*seen.labelled_objects(), *seen.archived_objects())
    return next((one for one in known if one.number == number), None)


def _newest_placed(seen: Perception) -> list[int]:
    """Return the number of the object that was placed last; none if there is no such object."""
    return sorted(one.number for one in seen.labelled_objects() if one.placed and one.number is not None)[-1:]


def _restored(held: Segments, numbers: set[int] | None) -> Undo:
    """Return the edit that puts segments back: those of these numbers, or all."""
    rows = []
    for number, ends, time_s, pinned in zip(
        held.numbers.tolist(), held.geometry.tolist(), held.times.tolist(), held.pinned.tolist(), strict=True
    ):
        if (numbers is None or number in numbers) and all(abs(value) <= COORDINATE_MAX_M for value in ends):
            x1, y1, x2, y2, normal = ends
            known_s = time_s if math.isfinite(time_s) else 0.0
            rows.append((float(number), x1, y1, x2, y2, normal, known_s, float(pinned)))
    newest = tuple(sorted(rows)[-RESTORED_MAX:])
    return (RestoreSegments(newest),) if newest else ()


def _unpinned(held: Segments, numbers: set[int], *, pinned: bool) -> Undo:
    """Return the edit that pins or unpins again what a pinning will change."""
    changed = [
        number
        for number, was in zip(held.numbers.tolist(), held.pinned.tolist(), strict=True)
        if number in numbers and bool(was) != pinned
    ]
    return (PinSegments(tuple(changed), pinned=not pinned),) if changed else ()
