"""What a person may do to what was perceived, and what a person is told of why something is believed.

An edit is an input of a cycle as an echo is: plain numbers and names, recorded with the rest, so that a replay does
the same to the same things. `kind` tells one from the other in a recording.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, TypeAlias

from perception.kernel import Floats, Ints


@dataclass(frozen=True, slots=True)
class DeleteSegments:
    """Take outline segments out of the map."""

    numbers: tuple[int, ...]
    kind: Literal["delete_segments"] = "delete_segments"


@dataclass(frozen=True, slots=True)
class PinSegments:
    """Keep outline segments whatever comes: they do not age, and nothing contradicts them; or let them go again."""

    numbers: tuple[int, ...]
    pinned: bool
    kind: Literal["pin_segments"] = "pin_segments"


@dataclass(frozen=True, slots=True)
class PlaceModel:
    """Say that a model stands about here (m, rad, the odometry's frame): refinement goes on from there."""

    model: str
    x: float
    y: float
    theta: float
    kind: Literal["place_model"] = "place_model"


@dataclass(frozen=True, slots=True)
class MoveObject:
    """Say that an object stands rather here: refinement goes on from there."""

    object: int
    x: float
    y: float
    theta: float
    kind: Literal["move_object"] = "move_object"


@dataclass(frozen=True, slots=True)
class RejectObject:
    """Say that there is no such object: it goes, and what was heard so far does not bring it back."""

    object: int
    kind: Literal["reject_object"] = "reject_object"


@dataclass(frozen=True, slots=True)
class ConfirmObject:
    """Say that there is such an object: it is reported however little the readings say for it."""

    object: int
    kind: Literal["confirm_object"] = "confirm_object"


@dataclass(frozen=True, slots=True)
class ClearMap:
    """Forget segments and objects; what the robot has to keep clear of stays."""

    kind: Literal["clear_map"] = "clear_map"


Edit: TypeAlias = DeleteSegments | PinSegments | PlaceModel | MoveObject | RejectObject | ConfirmObject | ClearMap

NUMBER_MAX: Final = 2**53
"""Numbers stay below this: a page keeps them as floats."""
COORDINATE_MAX_M: Final = 10_000.0
"""Nothing stands farther off than this along an axis; a number beyond it is a slip."""


class Segments(NamedTuple):
    """The outline segments in the map, a row each, copies."""

    numbers: Ints
    """(n,) by which a segment is known as long as it is there; none is used twice."""
    geometry: Floats
    """(n, 5) end points x1, y1, x2, y2 (m) and direction of the normal (rad)."""
    times: Floats
    """(n,) when each was completed, s of the robot's clock; NaN where a recording's beginning does not tell."""
    pinned: Ints
    """(n,) 1 where it was pinned."""


@dataclass(frozen=True, slots=True)
class Arc:
    """A raw reading, and what it says of an object."""

    x: float
    y: float
    """Place of the sensor, m."""
    direction: float
    """Of its axis, rad."""
    range_m: float | None
    """None: nothing was heard."""
    nats: float
    """For the object where positive, against it where negative: log likelihood over that of something else's echo."""


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
    """Why an object is believed, and how far."""

    object: int
    model: str
    """What it is compared as: a model's name, or what a rival of the models is called."""
    arcs: tuple[Arc, ...] = ()
    """The Bayesian method's readings."""
    lines: tuple[Line, ...] = ()
    """The paper's method's segments."""
    supporting: float = 0.0
    opposing: float = 0.0
    """Sums of what speaks for it and, negative, against it: nats, or segments by the paper's method."""
    rivals: tuple[tuple[str, float], ...] = ()
    """By how much other explanations of the readings led when they were last asked, nat; negative: were behind."""


def invalid_pose(x: float, y: float, theta: float) -> str | None:
    """Return why a pose given by hand is none, None where it is good."""
    if abs(x) <= COORDINATE_MAX_M and abs(y) <= COORDINATE_MAX_M and abs(theta) <= COORDINATE_MAX_M:
        return None
    return f"({x:g} m, {y:g} m, {theta:g} rad) is no place: give metres and radians in the odometry's frame"


def invalid_number(edit: Edit) -> str | None:
    """Return why the numbers that an edit names are none that anything has, None where they may be."""
    match edit:
        case DeleteSegments(numbers) | PinSegments(numbers):
            named: tuple[int, ...] = tuple(numbers)
        case MoveObject(number) | RejectObject(number) | ConfirmObject(number):
            named = (number,)
        case PlaceModel() | ClearMap():
            return None
    wrong = next((n for n in named if not 0 < n < NUMBER_MAX), None)
    return None if wrong is None else f"nothing has the number {wrong}"


def no_such_object(number: int) -> str:
    """Return why an edit of an object fails that is not there."""
    return f"there is no object {number} any more: look at the list again"


def no_such_segments(numbers: set[int]) -> str:
    """Return why an edit of segments fails of which some are not there."""
    named = ", ".join(map(str, sorted(numbers)[:5]))
    more = f" and {len(numbers) - 5} more" if len(numbers) > 5 else ""
    return f"not in the map any more: segment {named}{more}; the others are done"
