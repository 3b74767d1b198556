"""Edits of the map by the operator, and the evidence for an object that is shown to the operator.

An edit is an input of a cycle, like an echo: plain numbers and names, recorded with the other inputs so that a replay
repeats it. `kind` names the edit in a recording and on the wire.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, TypeAlias

from perception.kernel import Floats, Ints


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
class RejectObject:
    """Remove an object; readings taken so far do not bring it back."""

    object: int
    kind: Literal["reject_object"] = "reject_object"


@dataclass(frozen=True, slots=True)
class ConfirmObject:
    """Confirm an object; it is reported whatever the readings say."""

    object: int
    kind: Literal["confirm_object"] = "confirm_object"


@dataclass(frozen=True, slots=True)
class ClearMap:
    """Remove all segments and objects; fresh echoes, which the robot avoids, stay."""

    kind: Literal["clear_map"] = "clear_map"


@dataclass(frozen=True, slots=True)
class PlaceRobot:
    """Say where the robot is in a known room (m, rad, the map frame); readings confirm or refute it."""

    x: float
    y: float
    theta: float
    """Direction of travel."""
    kind: Literal["place_robot"] = "place_robot"


MapEdit: TypeAlias = DeleteSegments | PinSegments | PlaceModel | MoveObject | RejectObject | ConfirmObject | ClearMap
"""An edit of what was recognised."""

Edit: TypeAlias = MapEdit | PlaceRobot

NUMBER_MAX: Final = 2**53
"""Numbers of objects and segments are below this: a browser stores them as floats."""
COORDINATE_MAX_M: Final = 10_000.0
"""Largest coordinate accepted, m; a larger one is a mistake."""
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
    if abs(x) <= COORDINATE_MAX_M and abs(y) <= COORDINATE_MAX_M and abs(theta) <= COORDINATE_MAX_M:
        return None
    return (
        f"invalid pose ({x:g} m, {y:g} m, {theta:g} rad): expected metres and radians, "
        f"each finite and within ±{COORDINATE_MAX_M:g}"
    )


def invalid_number(edit: MapEdit) -> str | None:
    """Return why a number in an edit cannot belong to any segment or object, None if all can."""
    match edit:
        case DeleteSegments(numbers) | PinSegments(numbers):
            named: tuple[int, ...] = tuple(numbers)
        case MoveObject(number) | RejectObject(number) | ConfirmObject(number):
            named = (number,)
        case PlaceModel() | ClearMap():
            return None
    wrong = next((n for n in named if not 0 < n < NUMBER_MAX), None)
    return None if wrong is None else f"invalid number {wrong}: expected an integer above 0 and below 2^53"


def no_such_object(number: int) -> str:
    """Return the error for an edit of an object that does not exist."""
    return f"no object {number}: it may have left the map since; look at the list again"


def no_such_segments(numbers: set[int]) -> str:
    """Return the error for an edit of several segments of which these do not exist."""
    named = ", ".join(map(str, sorted(numbers)[:NAMED_MAX]))
    more = f" and {len(numbers) - NAMED_MAX} more" if len(numbers) > NAMED_MAX else ""
    return f"no longer in the map: segment {named}{more}; the other segments were edited"
