"""From what a page says about the map to the edits of `perception.edits`, which the next cycle's record holds."""

from __future__ import annotations

from typing import TypeAlias

from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    Edit,
    MoveObject,
    PinSegments,
    PlaceModel,
    RejectObject,
)
from runtime.console.commands import messages as forms

EditForm: TypeAlias = (
    forms.ClearMap | forms.DeleteSegments | forms.PinSegments | forms.PlaceModel | forms.MoveObject
    | forms.RejectObject | forms.ConfirmObject
)  # fmt: skip


def edit_in(message: EditForm) -> Edit:
    """Return the edit that a message asks for."""
    match message:
        case forms.ClearMap():
            return ClearMap()
        case forms.DeleteSegments(numbers=numbers):
            return DeleteSegments(numbers)
        case forms.PinSegments(numbers=numbers, pinned=pinned):
            return PinSegments(numbers, pinned)
        case forms.PlaceModel(model=model, x=x, y=y, theta=theta):
            return PlaceModel(model, x, y, theta)
        case forms.MoveObject(object=number, x=x, y=y, theta=theta):
            return MoveObject(number, x, y, theta)
        case forms.RejectObject(object=number):
            return RejectObject(number)
        case forms.ConfirmObject(object=number):
            return ConfirmObject(number)
