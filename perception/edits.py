"""Edits of the map by the operator, and the evidence for an object that is shown to the operator.

An edit is an input of a cycle, like an echo: plain numbers and names, recorded with the other inputs so that a replay
repeats it. `kind` names the edit in a recording and on the wire.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, TypeAlias

from config.bounded import COUNT_MAX, TIME_MAX_S
from perception.kernel import Floats, Ints


class ObjectRow(NamedTuple):
    """An object as it was before an edit."""

    number: int
    x: float
    """m, odometry's frame"""
    y: float
    theta: float
    """rad"""
    confirmed: bool
    kept: str
    """What the method keeps of it, as `perception.method.Method.kept` returns it."""


@dataclass(frozen=True, slots=True)
class DeleteSegments:
    """Delete outline segments from the map."""

    numbers: tuple[int, ...]
    kind: Literal["delete_segments"] = "delete_segments"


@dataclass(frozen=True, slots=True)
class PinSegments:
    """Pin outline segments, or unpin them. Pinned segments neither age nor leave by contradiction."""

    numbers: tuple[int, ...]
    pinned: bool
    kind: Literal["pin_segments"] = "pin_segments"


@dataclass(frozen=True, slots=True)
class RestoreSegments:
    """Put segments back that were deleted, with their numbers."""

    rows: tuple[tuple[float, float, float, float, float, float, float, float], ...]
    """Of each: number; ends x1, y1, x2, y2 (m, odometry's frame); direction of the normal (rad); time (s of the
    robot's clock); 1 if it was pinned, else 0."""
    kind: Literal["restore_segments"] = "restore_segments"


@dataclass(frozen=True, slots=True)
class PlaceModel:
    """Place a model (m, rad, odometry's frame) as a new object; refinement starts from there."""

    model: str
    x: float
    y: float
    theta: float
    kind: Literal["place_model"] = "place_model"


@dataclass(frozen=True, slots=True)
class MoveObject:
    """Move an object (m, rad, odometry's frame); refinement starts from there."""

    object: int
    x: float
    y: float
    theta: float
    kind: Literal["move_object"] = "move_object"


@dataclass(frozen=True, slots=True)
class WithdrawPlacement:
    """Take a placed object away as if it had never been placed; readings may find one in its place."""

    object: int
    kind: Literal["withdraw_placement"] = "withdraw_placement"


@dataclass(frozen=True, slots=True)
class RestoreObjects:
    """Put objects back as they were before an edit, with their numbers and the readings kept for them."""

    rows: tuple[ObjectRow, ...]
    walls: str = ""
    """What the method keeps of walls and corners, as `perception.method.Method.kept_walls` returns it: they are put
    in place of those that there are. Empty: those stay."""
    kind: Literal["restore_objects"] = "restore_objects"


@dataclass(frozen=True, slots=True)
class RemoveObject:
    """Remove an object; readings taken so far do not bring it back."""

    object: int
    kind: Literal["remove_object"] = "remove_object"


@dataclass(frozen=True, slots=True)
class RejectObject:
    """Say that nothing stands where an object is reported: its place becomes a vacant area."""

    object: int
    kind: Literal["reject_object"] = "reject_object"


@dataclass(frozen=True, slots=True)
class MarkVacant:
    """Say that nothing stands in a circle (m, odometry's frame); nothing in it is reported until it is lifted."""

    x: float
    y: float
    radius: float
    kind: Literal["mark_vacant"] = "mark_vacant"


@dataclass(frozen=True, slots=True)
class LiftArea:
    """Lift a vacant area: what is recognised there is reported again."""

    area: int
    kind: Literal["lift_area"] = "lift_area"


@dataclass(frozen=True, slots=True)
class RestoreArea:
    """Put a vacant area back that was lifted, with its number."""

    area: int
    x: float
    """m, odometry's frame."""
    y: float
    radius: float
    """m"""
    object: int
    """Number of the object that was rejected there, 0 if none was."""
    kind: Literal["restore_area"] = "restore_area"


@dataclass(frozen=True, slots=True)
class ConfirmObject:
    """Confirm an object; it is reported whatever the readings say."""

    object: int
    kind: Literal["confirm_object"] = "confirm_object"


@dataclass(frozen=True, slots=True)
class WithdrawConfirmation:
    """Let the readings decide again whether a confirmed object is reported."""

    object: int
    kind: Literal["withdraw_confirmation"] = "withdraw_confirmation"


@dataclass(frozen=True, slots=True)
class ClearMap:
    """Remove all segments and objects; vacant areas and fresh echoes, which the robot avoids, stay."""

    kind: Literal["clear_map"] = "clear_map"


@dataclass(frozen=True, slots=True)
class PlaceRobot:
    """Say where the robot is in a known room (m, rad, the map frame); readings confirm or refute it."""

    x: float
    y: float
    theta: float
    """Direction of travel."""
    kind: Literal["place_robot"] = "place_robot"


ObjectEdit: TypeAlias = WithdrawPlacement | MoveObject | RemoveObject | ConfirmObject | WithdrawConfirmation
"""An edit of one object that is known."""

MemoryEdit: TypeAlias = DeleteSegments | PinSegments | RestoreSegments | PlaceModel | ObjectEdit | ClearMap
"""An edit of what a method has recognised, by its plain numbers."""

MapEdit: TypeAlias = MemoryEdit | RestoreObjects
"""An edit of what a method has recognised."""

AreaEdit: TypeAlias = RejectObject | MarkVacant | LiftArea | RestoreArea
"""An edit of the vacant areas."""

Edit: TypeAlias = MapEdit | AreaEdit | PlaceRobot

EDIT_COORDINATE_MAX_M: Final = 10_000.0
"""Largest coordinate accepted, m; a larger one is a mistake."""
SEGMENT_ROW: Final = ("number", "x1", "y1", "x2", "y2", "normal", "time_s", "pinned")
"""The columns of `RestoreSegments.rows`."""
NAMED_MAX: Final = 5
"""Segments that a message lists by number; further ones are counted."""


class Segments(NamedTuple):
    """The outline segments in the map, one row each; copies."""

    numbers: Ints
    """(n,) each segment's number for as long as it exists; numbers are never reused."""
    geometry: Floats
    """(n, 5) end points x1, y1, x2, y2 (m) and direction of the normal (rad)."""
    times: Floats
    """(n,) when each was completed, s of the robot's clock; NaN if unknown."""
    pinned: Ints
    """(n,) 1 for a pinned segment."""


@dataclass(frozen=True, slots=True)
class Arc:
    """A raw reading and its evidence for or against an object."""

    x: float
    y: float
    """Place of the sensor, m."""
    direction: float
    """Direction of its axis, rad."""
    range_m: float | None
    """None if it heard no echo."""
    nats: float
    """Log likelihood ratio of the object against an echo of something else; negative: evidence against it."""
    listener: tuple[float, float] | None = None
    """Place of the sensor that heard it, m, where another one fired; `range_m` is half the way then."""


@dataclass(frozen=True, slots=True)
class Line:
    """An outline segment, and whether it lies on the object."""

    number: int
    x1: float
    y1: float
    x2: float
    y2: float
    supports: bool


@dataclass(frozen=True, slots=True)
class Evidence:
    """The evidence for and against an object."""

    object: int
    model: str
    """The label it was compared as: a model's name, or that of an alternative."""
    arcs: tuple[Arc, ...] = ()
    """The readings, from the Bayesian method."""
    lines: tuple[Line, ...] = ()
    """The segments, from the paper's method."""
    supporting: float = 0.0
    opposing: float = 0.0
    """Sums of the evidence for it and, negative, against it: nats (bayes) or segments (paper)."""
    rivals: tuple[tuple[str, float], ...] = ()
    """Label and lead of each alternative explanation when it was last compared, nat; negative: less likely."""


def invalid_pose(x: float, y: float, theta: float) -> str | None:
    """Return why a pose entered by the operator (m, rad) is invalid, None if it is valid.

    Parameters
    ----------
    x, y : float
        Position in the edit's frame, m; may be NaN or infinite, which is invalid.
    theta : float
        Heading, rad; it need not be wrapped.
    """
    if abs(x) <= EDIT_COORDINATE_MAX_M and abs(y) <= EDIT_COORDINATE_MAX_M and abs(theta) <= EDIT_COORDINATE_MAX_M:
        return None
    return (
        f"invalid pose ({x:g} m, {y:g} m, {theta:g} rad): expected metres and radians, "
        f"each finite and within ±{EDIT_COORDINATE_MAX_M:g}"
    )


def invalid_rows(edit: RestoreSegments) -> str | None:
    """Return why segments cannot be put back, None if each row is one that a map can have held."""
    for row in edit.rows:
        if len(row) != len(SEGMENT_ROW) or not all(abs(value) <= EDIT_COORDINATE_MAX_M for value in row[1:6]):
            return "invalid segment: expected a number, four coordinates in m, a direction, a time and a pin"
        if not (0 < row[0] < COUNT_MAX and row[0] == int(row[0]) and abs(row[6]) < TIME_MAX_S):
            return f"invalid segment {row[0]:g} of {row[6]:g} s"
    return None


def invalid_number(edit: MapEdit | RejectObject) -> str | None:
    """Return why a number in an edit cannot belong to any segment or object, None if all can."""
    match edit:
        case DeleteSegments(numbers) | PinSegments(numbers):
            named: tuple[int, ...] = tuple(numbers)
        case (
            MoveObject(number)
            | WithdrawPlacement(number)
            | RemoveObject(number)
            | RejectObject(number)
            | ConfirmObject(number)
            | WithdrawConfirmation(number)
        ):
            named = (number,)
        case RestoreObjects(rows):
            named = tuple(row.number for row in rows)
        case PlaceModel() | ClearMap() | RestoreSegments():
            return None
    wrong = next((n for n in named if not 0 < n < COUNT_MAX), None)
    return None if wrong is None else f"invalid number {wrong}: expected an integer above 0 and below 2^53"


def invalid_objects(edit: RestoreObjects) -> str | None:
    """Return why objects cannot be put back, None if each row has a valid number and pose."""
    poses = (invalid_pose(row.x, row.y, row.theta) for row in edit.rows)
    return invalid_number(edit) or next((refused for refused in poses if refused is not None), None)


def not_restorable(number: int) -> str:
    """Return the error for an object of which nothing valid was kept."""
    return f"object {number} cannot be put back: nothing valid was kept of it"


def no_such_object(number: int) -> str:
    """Return the error for an edit of an object that does not exist."""
    return f"no object {number}: it may have left the map since; look at the list again"


def no_such_segments(numbers: set[int]) -> str:
    """Return the error for an edit of several segments of which these do not exist."""
    named = ", ".join(map(str, sorted(numbers)[:NAMED_MAX]))
    more = f" and {len(numbers) - NAMED_MAX} more" if len(numbers) > NAMED_MAX else ""
    return f"no longer in the map: segment {named}{more}; the other segments were edited"


def invalid_edit(edit: MapEdit) -> str | None:
    """Return why a number, a place or the rows of an edit are impossible; None if they are not."""
    if isinstance(edit, RestoreSegments):
        return invalid_rows(edit)
    if isinstance(edit, RestoreObjects):
        return invalid_objects(edit)
    refused = invalid_number(edit)
    if isinstance(edit, PlaceModel | MoveObject):
        refused = refused or invalid_pose(edit.x, edit.y, edit.theta)
    return refused
