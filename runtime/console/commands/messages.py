"""What a page may say, as strict and bounded forms: a message that fits none of them is answered, and does nothing.

The names are the wire's. What is checked here is the form only; whether it may be done now, and by whom, is decided
by `runtime.console.commands.dispatcher`.
"""

from __future__ import annotations

from enum import Enum
from typing import Annotated, ClassVar, Final, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from pydantic_core import from_json

from config.errors import UserError

MESSAGE_MAX: Final = 64 * 1024
"""Bytes."""
TEXT_MAX: Final = 500
TOML_MAX: Final = 32 * 1024
PICKED_MAX: Final = 8192
ID_MAX: Final = 2**53
FIELD_MAX: Final = 120

Place: TypeAlias = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]
Angle: TypeAlias = Annotated[float, Field(ge=-1e6, le=1e6)]
Number: TypeAlias = Annotated[int, Field(ge=0, le=ID_MAX)]
Numbers: TypeAlias = Annotated[tuple[Number, ...], Field(min_length=1, max_length=PICKED_MAX)]
Name: TypeAlias = Annotated[str, Field(min_length=1, max_length=100)]
Scalar: TypeAlias = bool | int | float | Annotated[str, Field(max_length=TEXT_MAX)] | None


class Right(Enum):
    """What it takes to ask for something."""

    TOKEN = "token"  # noqa: S105 - a right, no secret
    """Any client with the token."""
    CONTROL = "control"
    """The one client that has the control."""


class Form(BaseModel):
    """A message; its `id` comes back with the answer."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)

    right: ClassVar[Right] = Right.CONTROL
    id: Number


class Halt(Form):
    """Stop at once and latch."""

    right: ClassVar[Right] = Right.TOKEN
    type: Literal["halt"]


class Arm(Form):
    """Arm, and drive."""

    type: Literal["arm"]


class Disarm(Form):
    """Stop driving, and stand until armed again."""

    type: Literal["disarm"]


class TakeControl(Form):
    """Take the control, or ask whoever has it."""

    right: ClassVar[Right] = Right.TOKEN
    type: Literal["take_control"]


class GiveControl(Form):
    """Give the control up."""

    type: Literal["release_control"]


class Grant(Form):
    """Hand the control over to who asked for it."""

    type: Literal["grant_control"]
    client: Number


class ClearMap(Form):
    """Forget all segments and objects."""

    type: Literal["clear_map"]


class DeleteSegments(Form):
    """Take outline segments out of the map."""

    type: Literal["delete_segments"]
    numbers: Numbers


class PinSegments(Form):
    """Keep outline segments whatever their age, or no longer."""

    type: Literal["pin_segments"]
    numbers: Numbers
    pinned: bool


class PlaceModel(Form):
    """Put a model somewhere by hand."""

    type: Literal["place_model"]
    model: Name
    x: Place
    y: Place
    theta: Angle


class MoveObject(Form):
    """Put an object somewhere else."""

    type: Literal["move_object"]
    object: Number
    x: Place
    y: Place
    theta: Angle


class RejectObject(Form):
    """Say that an object is none."""

    type: Literal["reject_object"]
    object: Number


class ConfirmObject(Form):
    """Say that an object is what it is called."""

    type: Literal["confirm_object"]
    object: Number


class Evidence(Form):
    """Ask what speaks for and against an object."""

    right: ClassVar[Right] = Right.TOKEN
    type: Literal["evidence"]
    object: Number


class LoadModel(Form):
    """Look for a further model from now on."""

    type: Literal["load_model"]
    toml: Annotated[str, Field(max_length=TOML_MAX)]


class Set(Form):
    """Change one parameter."""

    type: Literal["set_parameter"]
    path: Annotated[str, Field(min_length=1, max_length=200)]
    value: Scalar


class Undo(Form):
    """Take the last change of parameters or models back."""

    type: Literal["undo_parameter"]


class SaveToml(Form):
    """Ask for all settings as a file."""

    right: ClassVar[Right] = Right.TOKEN
    type: Literal["save_toml"]


class RequestLegs(Form):
    """Move ahead as configured."""

    type: Literal["legs"]


class RequestGoal(Form):
    """Move to a place."""

    type: Literal["goal"]
    x: Place
    y: Place


class Teleoperate(Form):
    """Drive by hand; said again and again for as long as it is meant."""

    type: Literal["teleoperate"]
    v: Annotated[float, Field(ge=-10.0, le=10.0)]
    w: Annotated[float, Field(ge=-20.0, le=20.0)]


class Pause(Form):
    """Let the emulated world stand still."""

    type: Literal["pause"]


class Resume(Form):
    """Let it go on."""

    type: Literal["resume"]


class SingleStep(Form):
    """Let it go on for one cycle."""

    type: Literal["single_step"]


class Speed(Form):
    """Let it go so many times as fast."""

    type: Literal["set_speed"]
    factor: Annotated[float, Field(ge=0.01, le=100.0)]


class Record(Form):
    """Begin or end a recording."""

    type: Literal["record"]
    on: bool


class Bookmark(Form):
    """Put a mark with a text into the recording."""

    type: Literal["bookmark"]
    text: Annotated[str, Field(max_length=TEXT_MAX)]


class Recordings(Form):
    """Ask which recordings there are."""

    right: ClassVar[Right] = Right.TOKEN
    type: Literal["list_recordings"]


class Open(Form):
    """Show a recording in place of the live run, to this client."""

    right: ClassVar[Right] = Right.TOKEN
    type: Literal["open_recording"]
    file: Annotated[str, Field(min_length=1, max_length=300)]


class Scrub(Form):
    """Go to a time in it, seconds from its beginning."""

    right: ClassVar[Right] = Right.TOKEN
    type: Literal["seek_recording"]
    s: Annotated[float, Field(ge=0.0, le=1e9)]


class Play(Form):
    """Play it so many times as fast; 0 stands still."""

    right: ClassVar[Right] = Right.TOKEN
    type: Literal["play_recording"]
    speed: Annotated[float, Field(ge=0.0, le=100.0)]


class Step(Form):
    """Go so many cycles on, or back."""

    right: ClassVar[Right] = Right.TOKEN
    type: Literal["step_recording"]
    cycles: Annotated[int, Field(ge=-10_000, le=10_000)]


class Live(Form):
    """Go back to the live run."""

    right: ClassVar[Right] = Right.TOKEN
    type: Literal["close_recording"]


OfEmulator: TypeAlias = Pause | Resume | SingleStep | Speed
OfRecorder: TypeAlias = Record | Bookmark
OfPlayer: TypeAlias = Recordings | Open | Scrub | Play | Step | Live
OfTime: TypeAlias = OfEmulator | OfRecorder | OfPlayer
Message: TypeAlias = (
    Halt | Arm | Disarm | TakeControl | GiveControl | Grant | ClearMap | DeleteSegments | PinSegments | PlaceModel
    | MoveObject | RejectObject | ConfirmObject | Evidence | LoadModel | Set | Undo | SaveToml
    | RequestLegs | RequestGoal | Teleoperate | OfTime
)  # fmt: skip

_READER: Final[TypeAdapter[Message]] = TypeAdapter(Annotated[Message, Field(discriminator="type")])


class MalformedMessage(UserError):  # noqa: N818 - told to a client
    """A message that is none.

    Parameters
    ----------
    text : str
        What is wrong with it.
    number : int, optional
        Its id, where it has one.
    field : str, optional
        Where in it.
    """

    def __init__(self, text: str, number: int | None, field: str | None = None) -> None:
        super().__init__(text)
        self.number = number
        self.field = field


def read_message(text: str | bytes) -> Message:
    """Return what a message says.

    Raises
    ------
    MalformedMessage
        It has none of the forms above.
    """
    try:
        return _READER.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        if first["type"] in {"union_tag_invalid", "union_tag_not_found"}:
            raise MalformedMessage("there is no such message", _id_of(text), "type") from None
        place = [str(key) for key in first["loc"][1:]]
        if place[:1] == ["value"]:
            raise MalformedMessage("must be a number, a text, true, false or null", _id_of(text), "value") from None
        words = first["msg"][:TEXT_MAX]
        raise MalformedMessage(
            words[:1].lower() + words[1:], _id_of(text), ".".join(place)[:FIELD_MAX] or None
        ) from None


def _id_of(text: str | bytes) -> int | None:
    try:
        found = from_json(text)
    except ValueError:
        return None
    number = found.get("id") if isinstance(found, dict) else None
    return number if type(number) is int and 0 <= number <= ID_MAX else None
