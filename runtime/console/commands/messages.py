"""The wire form of the console's commands: the type of each argument with its bounds, and the strict JSON reader.

A command's arguments are a frozen dataclass. Edits and drive requests are those of `perception.edits`,
`behaviors.move_to_goal` and `behaviors.teleoperation`; the dataclasses below are the console's own. A message is a
JSON object of `id`, `type` (the command's name) and the arguments, and of `challenge` where it can begin a motion.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeAlias, Union, get_origin, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, create_model
from pydantic_core import from_json

from config.errors import UserError
from config.mission_step import STEPS_MAX
from config.robot import SENSORS_MAX
from perception.edits import EDIT_COORDINATE_MAX_M

MESSAGE_MAX_BYTES: Final = 64 * 1024
TEXT_MAX: Final = 500
"""Characters of a text value, of a bookmark and of an error message."""
TOML_MAX: Final = 32 * 1024
"""Characters of an object model's file; the shipped ones have a tenth of that."""
SELECTION_MAX: Final = 8192
"""Segments that one edit may name; the map holds fewer."""
ID_MAX: Final = 2**53
"""A page keeps numbers as 64-bit floats, which hold whole numbers up to this one."""
FIELD_MAX: Final = 120
"""Characters of a field's path in an error message."""

Coordinate: TypeAlias = Annotated[float, Field(ge=-EDIT_COORDINATE_MAX_M, le=EDIT_COORDINATE_MAX_M)]
Angle: TypeAlias = Annotated[float, Field(ge=-1e6, le=1e6)]
Size: TypeAlias = Annotated[float, Field(ge=-1e6, le=1e6)]
Number: TypeAlias = Annotated[int, Field(ge=0, le=ID_MAX)]
Text: TypeAlias = Annotated[str, Field(max_length=TEXT_MAX)]
Scalar: TypeAlias = Annotated[bool | int | float | Text | None, Field()]

Degrees: TypeAlias = Annotated[float, Field(ge=-360.0, le=360.0)]
Waypoint: TypeAlias = tuple[Coordinate, Coordinate, Degrees | None]
"""A place x, y, m, and the final heading there in degrees, None for any."""
Waypoints: TypeAlias = Annotated[tuple[Waypoint, ...], Field(min_length=1, max_length=STEPS_MAX)]
FrameName: TypeAlias = Annotated[Literal["odom", "map"], Field()]
"""The frame of places."""
FileName: TypeAlias = Annotated[str, Field(min_length=1, max_length=300)]
"""Of a recording, as listed."""

BOUNDS: Final[Mapping[str, Any]] = MappingProxyType(
    {
        "x": Coordinate,
        "y": Coordinate,
        "theta": Angle,
        "object": Number,
        "area": Number,
        "numbers": Annotated[tuple[Number, ...], Field(min_length=1, max_length=SELECTION_MAX)],
        "model": Annotated[str, Field(min_length=1, max_length=100)],
        "v": Annotated[float, Field(ge=-10.0, le=10.0)],
        "w": Annotated[float, Field(ge=-20.0, le=20.0)],
    }
)
"""Bounds of the arguments of edits and drive requests, by field name: m, rad, m/s, rad/s."""


@dataclass(frozen=True, slots=True)
class NoArguments:
    """The arguments of a command that has none."""


@dataclass(frozen=True, slots=True)
class GrantControl:
    """Hand control over to the client that requested it."""

    client: Number


@dataclass(frozen=True, slots=True)
class GetEvidence:
    """Ask for the readings that support and oppose an object."""

    object: Number


@dataclass(frozen=True, slots=True)
class LoadModel:
    """Recognise a further object model, given as the text of its TOML file."""

    toml: Annotated[str, Field(max_length=TOML_MAX)]


@dataclass(frozen=True, slots=True)
class DescribeRobot:
    """Ask for a robot's file; lengths are m, angles degrees. What the file allows is checked with its text."""

    name: Annotated[str, Field(max_length=64)]
    driver: Annotated[str, Field(min_length=1, max_length=64)]
    count: Annotated[int | None, Field(ge=0, le=1000)]
    radius_m: Annotated[float | None, Field(ge=-1e6, le=1e6)]
    sensors: Annotated[tuple[tuple[Size, Size, Size], ...] | None, Field(max_length=SENSORS_MAX)]
    """x, y and direction of each, in place of count and radius."""
    beam_half_angle_deg: Size
    resolution_m: Size
    range_min_m: Size
    range_max_m: Size
    preset: Annotated[str, Field(max_length=64)]
    step_period_s: Size
    body_radius_m: Size
    speed_max_m_s: Size
    turn_max_rad_s: Size
    synchro: bool


@dataclass(frozen=True, slots=True)
class LoadMap:
    """Find the robot in a known room, given as the text of its world file; null forgets the room that is known."""

    toml: Annotated[str | None, Field(max_length=MESSAGE_MAX_BYTES)]


@dataclass(frozen=True, slots=True)
class SetParameter:
    """Change one setting; `path` is its dotted name."""

    path: Annotated[str, Field(min_length=1, max_length=200)]
    value: Scalar


@dataclass(frozen=True, slots=True)
class SetSpeed:
    """Run the emulator `factor` times as fast as real time."""

    factor: Annotated[float, Field(ge=0.01, le=100.0)]


@dataclass(frozen=True, slots=True)
class Record:
    """Start or stop recording."""

    on: bool


@dataclass(frozen=True, slots=True)
class AddBookmark:
    """Add a bookmark with a text to the recording."""

    text: Text


@dataclass(frozen=True, slots=True)
class OpenRecording:
    """Show this client a recording in place of the live run."""

    file: FileName


@dataclass(frozen=True, slots=True)
class RenameRecording:
    """Give a recording another name."""

    file: FileName
    to: FileName


@dataclass(frozen=True, slots=True)
class PinRecording:
    """Keep a recording when the folder is full, or no longer."""

    file: FileName
    pinned: bool


@dataclass(frozen=True, slots=True)
class DeleteRecording:
    """Delete a recording for good."""

    file: FileName


@dataclass(frozen=True, slots=True)
class MakeFiles:
    """Make a report or a map of a recording."""

    kind: Annotated[Literal["report", "map"], Field()]
    file: FileName


@dataclass(frozen=True, slots=True)
class CancelJob:
    """End what is being made."""

    job: Number


@dataclass(frozen=True, slots=True)
class SeekRecording:
    """Go to a time in the recording, s after its first cycle."""

    s: Annotated[float, Field(ge=0.0, le=1e9)]


@dataclass(frozen=True, slots=True)
class PlayRecording:
    """Play the recording `speed` times as fast as it was made; 0 pauses it."""

    speed: Annotated[float, Field(ge=0.0, le=100.0)]


@dataclass(frozen=True, slots=True)
class StepRecording:
    """Go forward by this many cycles; backward where negative."""

    cycles: Annotated[int, Field(ge=-10_000, le=10_000)]


@dataclass(frozen=True, slots=True)
class StartMission:
    """Start a shipped mission, or the run's own, by its name."""

    name: Annotated[str, Field(min_length=1, max_length=40)]


@dataclass(frozen=True, slots=True)
class SetGoal:
    """Drive to a place, m; `heading` is the final one there, rad, None for any."""

    x: Coordinate
    y: Coordinate
    heading: Annotated[float | None, Field(ge=-1e6, le=1e6)] = None
    frame: FrameName = "odom"


@dataclass(frozen=True, slots=True)
class SaveRoute:
    """Ask for a route as a mission file."""

    name: Annotated[str, Field(min_length=1, max_length=40)]
    waypoints: Waypoints
    frame: FrameName


@dataclass(frozen=True, slots=True)
class ReadMission:
    """Ask for what a mission file holds, given as its text."""

    toml: Annotated[str, Field(max_length=TOML_MAX)]


@dataclass(frozen=True, slots=True)
class RunMission:
    """Start a mission, given as the text of its file."""

    toml: Annotated[str, Field(max_length=TOML_MAX)]


@dataclass(frozen=True, slots=True)
class SetRoute:
    """Drive to these places in turn; the drive goes on where the route is the same as far as it has come."""

    waypoints: Waypoints
    frame: FrameName


class Message(NamedTuple):
    """A well-formed message of a client."""

    id: int
    """Comes back with the answer."""
    name: str
    """Of the command."""
    arguments: Any
    """An instance of the command's type."""
    challenge: int | None = None
    """The newest one that the page had received."""


class MalformedMessage(UserError):  # noqa: N818 - names the message, which the caller answers
    """A message that is not a command of the console.

    It has its id if that is valid, and the path of the argument that is wrong.
    """

    def __init__(self, text: str, id: int | None, field: str | None = None) -> None:  # noqa: A002 - the wire's name
        super().__init__(text)
        self.id = id
        self.field = field


class _Envelope(BaseModel):
    """What every message has, and how strictly it is read."""

    # Only the union of all is built.
    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False, defer_build=True)

    id: Number
    challenge: Number | None = None


class MessageReader:
    """Reads and validates messages.

    Parameters
    ----------
    types : mapping of str to type
        The dataclass of each command's arguments, by the command's name. Its fields without a default are the
        arguments, and so are those with bounds of their own, which a message may leave out if they have a default.

    Raises
    ------
    TypeError
        An argument has no bounds.
    """

    def __init__(self, types: Mapping[str, type]) -> None:
        self._types = dict(types)
        models = tuple(wire_model(name, of) for name, of in types.items())
        union = Union[models]  # type: ignore[valid-type]  # noqa: UP007 - made of a tuple
        self._adapter: TypeAdapter[Any] = TypeAdapter(Annotated[union, Field(discriminator="type")])

    def read(self, text: str | bytes) -> Message:
        """Return a message after checking it.

        Raises
        ------
        MalformedMessage
            It is not JSON, names no command, or its arguments are missing, unknown, of another type or out of bounds.
        """
        try:
            wire = self._adapter.validate_json(text)
        except ValidationError as error:
            raise _malformed(error, text) from None
        of = self._types[wire.type]
        arguments = of(**{name: getattr(wire, name) for name in _arguments(of)})
        return Message(wire.id, wire.type, arguments, wire.challenge)


@functools.cache
def _arguments(of: type) -> Mapping[str, Any]:
    """Return the default of each field that a message gives; `...` where it must be given."""
    hints = get_type_hints(of, include_extras=True)
    required = {f.name: ... for f in fields(of) if f.default is MISSING and f.default_factory is MISSING}
    optional = {f.name: f.default for f in fields(of) if f.name not in required and _has_bounds(hints[f.name])}
    return MappingProxyType({**required, **optional})


def _has_bounds(hint: Any) -> bool:  # noqa: ANN401 - any type hint
    return get_origin(hint) is Annotated


def wire_model(name: str, of: type) -> type[BaseModel]:
    """Return the model of a command's messages.

    Raises
    ------
    TypeError
        An argument has no bounds.
    """
    hints = get_type_hints(of, include_extras=True)
    defaults = _arguments(of)
    arguments = {key: BOUNDS.get(key, hints[key]) for key in defaults}
    for key, hint in arguments.items():
        if hint is not bool and not _has_bounds(hint):
            raise TypeError(f"the argument {key} of {name} has no bounds: add it to BOUNDS")
    definitions: dict[str, Any] = {"type": (Literal[name], ...)}
    definitions |= {key: (hint, defaults[key]) for key, hint in arguments.items()}
    return create_model(name, __base__=_Envelope, **definitions)


def _malformed(error: ValidationError, text: str | bytes) -> MalformedMessage:
    """Return the first problem in the page's words."""
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    if first["type"] in {"union_tag_invalid", "union_tag_not_found"}:
        return MalformedMessage("unknown command", _id_of(text), "type")
    path = [str(key) for key in first["loc"][1:]]  # the first key is the command's name
    if path[:1] == ["value"]:
        return MalformedMessage("must be a number, a text, true, false or null", _id_of(text), "value")
    field = ".".join(path)[:FIELD_MAX] or None
    problem = first["msg"][:TEXT_MAX].removeprefix("Value error, ")
    what, should, rest = problem.partition(" should ")
    if field is not None and should and " " not in what:  # as in "Input should be a valid number"
        problem = f"{field}{should}{rest}"
    return MalformedMessage(problem[:1].lower() + problem[1:], _id_of(text), field)


def _id_of(text: str | bytes) -> int | None:
    """Return the id of a malformed message, None if it has no valid one."""
    try:
        found = from_json(text)
    except ValueError:
        return None
    number = found.get("id") if isinstance(found, dict) else None
    return number if type(number) is int and 0 <= number <= ID_MAX else None
