"""The content of a recording, as pydantic models around the runtime's own dataclasses.

The fields of the dataclasses are read from their type hints: a field added to a cycle's record or its inputs is
recorded, described in the file's own schema and read back without a change here.
"""

from __future__ import annotations

import math
from dataclasses import fields
from itertools import accumulate
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Final, NotRequired, Self, TypeAlias, get_origin, get_type_hints

import numpy as np
import zstandard
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, create_model, model_validator
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema, to_jsonable_python

from config.bounded import COUNT_MAX, Coordinate, Count, Seconds
from perception.snapshot import Snapshot, fixed_shape
from runtime.cycle.clock_monitor import ClockMonitor
from runtime.cycle.echo_watch import EchoWatch
from runtime.cycle.modes import ModeState
from runtime.cycle.motion_monitor import MotionMonitor
from runtime.cycle.stalled_drives import DriveMemory
from runtime.cycle.start_turn import StartTurn
from runtime.cycle.step import CycleRecord, State
from runtime.cycle.summary import ObjectRow

FORMAT: Final = 2
"""Version of the file format. Increase it with every change after which a recording cannot be read as before."""
GROWN_MAX: Final = 100_000
"""Greatest length of a keyframe's array, which bounds the memory that a hostile file can take."""
PIECE_DELAY_MAX_US: Final = 10**15
COVARIANCE: Final = 3
"""Numbers of an object's covariance."""


class Payload(BaseModel):
    """The content of one message. Reading validates every value; writing does not, as the values are our own."""

    model_config = ConfigDict(
        frozen=True, ser_json_inf_nan="strings", ser_json_bytes="base64", val_json_bytes="base64"
    )

    VALUES_MAX: ClassVar[int] = 300_000
    """Most values in a message; one of more is not parsed, as each may take a kilobyte until the message is refused.
    The largest cycle has 1,000 firings of 255 sensors."""


class RunInfo(Payload):
    """The first message of a file: everything that a replay needs besides the other messages."""

    format: int
    settings: dict[str, Any]
    """The settings in force, object models included, as `Settings` dumps them."""
    versions: dict[str, str]
    """Versions of program and libraries, the kernels' key, the processor: the last bits may depend on them."""
    started: str
    """Date and time of the start, UTC."""
    unix_minus_host_ns: Annotated[int, Field(ge=-(2**63), lt=2**63)]
    """A log time (Unix time) minus the host's monotonic clock at the same moment."""
    part: Count
    """Number of this file: a long run, or one whose disk was full for a while, has several, numbered from 1."""
    emulated: bool = False
    """Whether the settings' world is the true one; a real robot's world is unknown."""


class TimedPayload(Payload):
    """Content with a time of the run."""

    run_s: Seconds
    """Time by the run's clock, s. It stops while a run is paused; log times do not."""


class SettingsChange(TimedPayload):
    """New settings, in force from a cycle on. A replay needs them as much as the echoes."""

    cycle: Count
    settings: dict[str, Any]
    """All settings, as in `RunInfo`, which repeats them from then on."""


class RunEnd(TimedPayload):
    """The summary of a run that ended normally: cycle times, link counts and stop reasons."""

    summary: dict[str, Any]


class Cycle(Payload):
    """One cycle. Its time is `record.inputs.run_s`."""

    record: CycleRecord
    """Drive requests and edits in it may hold any number: the cycle itself validates and refuses them."""


class ModeChange(TimedPayload):
    """A new mode, or a new reason for the mode."""

    cycle: Count
    mode: ModeState


class SerialBytes(TimedPayload):
    """Pieces of data received or sent over the serial line; `run_s` is the time of the first piece."""

    after_us: list[Annotated[int, Field(ge=-PIECE_DELAY_MAX_US, le=PIECE_DELAY_MAX_US)]]
    """Delay of each piece after the first one, µs."""
    sizes: list[Count]
    """Number of bytes in each piece."""
    data: str
    """All pieces in hexadecimal, in which repetition stays visible to compression, unlike in base64."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Check that pieces, times and data fit each other.

        Raises
        ------
        ValueError
            They do not.
        """
        if len(self.after_us) != len(self.sizes):
            raise ValueError(f"{len(self.sizes)} pieces of data with {len(self.after_us)} times")
        if 2 * sum(self.sizes) != len(self.data):
            found = f"{len(self.data)} hexadecimal digits of data"
            raise ValueError(f"pieces of {sum(self.sizes)} bytes together, and {found}")
        bytes.fromhex(self.data)
        return self

    def pieces(self) -> list[tuple[float, bytes]]:
        """Return the time (run's clock, s) and the bytes of each piece."""
        raw, ends = bytes.fromhex(self.data), list(accumulate(self.sizes))
        return [
            (self.run_s + 1e-6 * after, raw[end - size : end])
            for after, size, end in zip(self.after_us, self.sizes, ends, strict=True)
        ]


class LogLine(TimedPayload):
    """A line of the log."""

    level: str
    event: str
    fields: dict[str, Any]


class Bookmark(TimedPayload):
    """An operator's note at a moment of the run. It has no effect on the run."""

    cycle: Count
    """The last cycle before it."""
    text: str


class BookmarkWithdrawn(TimedPayload):
    """The last bookmark of this file that was not withdrawn is withdrawn."""

    cycle: Count
    """The last cycle before it."""


class MapChange(TimedPayload):
    """Changes of the outline map since the previous message of this type."""

    VALUES_MAX: ClassVar[int] = 800_000
    """Of a map of 130,000 segments."""

    cycle: Count
    whole: bool
    """Whether `added` is the whole map, and all messages before do not count."""
    first: Count
    """Number of the first segment in `added`; the others are numbered consecutively."""
    added: list[tuple[Coordinate, Coordinate, Coordinate, Coordinate, Coordinate]]
    """Ends x, y, x, y (m) and normal (rad) of each new segment, rounded to the millimetre."""
    removed: list[Count]
    """Numbers of the segments that are gone."""


_OBJECT: Final = MappingProxyType(get_type_hints(ObjectRow, include_extras=True))
_REQUIRED: Final = frozenset(name for name, hint in _OBJECT.items() if get_origin(hint) is not NotRequired)


def _checked_object(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row with all fields of `ObjectRow`, finite; fields beyond those are numbers, flags or texts.

    Raises
    ------
    ValueError
        A field is missing or invalid.
    """
    if missing := sorted(_REQUIRED - row.keys()):
        raise ValueError(f"an object without {missing[0]}")
    for name, value in row.items():
        if name == "model":
            is_valid = isinstance(value, str)
        elif name in {"support", "number"}:
            is_count = type(value) is int and 0 <= value <= COUNT_MAX
            is_valid = is_count or (value is None and name == "number")
        elif name == "covariance":
            is_valid = isinstance(value, list) and len(value) == COVARIANCE and all(map(_is_finite, value))
        elif name in _OBJECT:
            is_valid = _is_finite(value)
        else:
            is_valid = value is None or isinstance(value, str | bool) or _is_finite(value)
        if not is_valid:
            raise ValueError(f"an object whose {name:.40} is {value!r:.40}")
    return row


def _is_finite(value: object) -> bool:
    return isinstance(value, int | float) and abs(value) <= COUNT_MAX


class ObjectList(TimedPayload):
    """The models recognised near the robot at this moment, as in the run's summary; beside a keyframe all of them."""

    cycle: Count
    objects: list[Annotated[dict[str, Any], AfterValidator(_checked_object)]]


_HINTS: Final = get_type_hints(State, include_extras=True)
_MADE_ANEW: Final = frozenset({"perception", "percept", "preparing", "step_settings", "undos", "zones"})
"""What a replay makes of the other fields, the settings and perception's own state."""
_CARRIED: Final = tuple(f.name for f in fields(State) if f.name not in _MADE_ANEW)
_ADDED: Final = MappingProxyType(
    {
        "drive_memory": DriveMemory(),
        "motion_monitor": MotionMonitor(),
        "clock_monitor": ClockMonitor(),
        "echo_watch": EchoWatch(is_over=True),
        "start_turn": StartTurn(is_over=True),
        "goal_place": None,
        "goal_drive": None,
        "trail": (),
        "void_places": None,
        "ring_problem": None,
    }
)
"""Fields that older recordings of this format lack, with the value that they had then."""
CarriedState: Any = create_model(  # type: ignore[call-overload]  # mypy sees no field definitions here
    "CarriedState",
    __base__=Payload,
    __doc__="What a cycle carries over to the next one, apart from perception's state.",
    **{name: (_HINTS[name], _ADDED.get(name, ...)) for name in _CARRIED},
)


class ArrayInfo(Payload):
    """Name and layout of one array of perception's state; the arrays lie one after the other."""

    name: str
    dtype: str
    shape: list[int]


class Keyframe(TimedPayload):
    """The whole state after a cycle, from which a replay can start."""

    VALUES_MAX: ClassVar[int] = 50_000
    """It has about 1,000, as the arrays are one text."""

    cycle: Count
    state: CarriedState  # of the fields of `State`
    arrays: list[ArrayInfo]
    data: bytes
    """The arrays' bytes, little-endian, compressed by zstd."""


StateFields: TypeAlias = dict[str, Any]
"""The fields of `State` without perception, by name."""


def carried_state(state: State) -> StateFields:
    """Return the fields of a state without perception; all of them are immutable."""
    return {name: getattr(state, name) for name in _CARRIED}


def keyframe(cycle: int, run_s: float, state: StateFields, snapshot: Snapshot) -> Keyframe:
    """Return the message of the whole state that a cycle has left: from `carried_state`, and perception's arrays."""
    arrays = [ArrayInfo(name=name, dtype=_dtype_text(a.dtype), shape=list(a.shape)) for name, a in snapshot.items()]
    data = zstandard.compress(b"".join(a.tobytes() for a in snapshot.values()))
    return Keyframe.model_construct(
        run_s=run_s,
        cycle=cycle,
        state=CarriedState.model_construct(**state),  # type: ignore[arg-type]  # as for its fields above
        arrays=arrays,
        data=data,
    )


def _dtype_text(dtype: np.dtype[Any]) -> str:
    """Return a dtype as text; that of records lists their fields."""
    return dtype.str if dtype.names is None else str(dtype.descr)


def layout_difference(frame: Keyframe, layout: Snapshot) -> str | None:
    """Return the first array that a keyframe holds and a layout does not, or the reverse; None if they agree."""
    mine = {name: (_dtype_text(array.dtype), fixed_shape(name, array.shape)) for name, array in layout.items()}
    if [array.name for array in frame.arrays] != list(mine):
        names = {array.name for array in frame.arrays}
        return next(iter(sorted(names ^ mine.keys())), "the order of the arrays")
    has_room = all(0 <= length <= GROWN_MAX for a in frame.arrays for length in a.shape)
    named = ((a.name, (a.dtype, fixed_shape(a.name, a.shape))) for a in frame.arrays)
    return next((name for name, found in named if mine[name] != found or not has_room), None)


def perception_snapshot(frame: Keyframe, layout: Snapshot) -> Snapshot:
    """Return perception's arrays of a keyframe, by name.

    Parameters
    ----------
    frame : Keyframe
        From a recording.
    layout : Snapshot
        Of perception with the settings in force; its arrays' dtypes and shapes must be those of the keyframe, but for
        the length of what is archived. Nothing is decompressed before they are compared.

    Raises
    ------
    ValueError
        The keyframe has another layout, another size, or is damaged.
    """
    if (different := layout_difference(frame, layout)) is not None:
        raise ValueError(f"the keyframe is of other settings or of another version: {different:.100} differs")
    shapes = {array.name: tuple(array.shape) for array in frame.arrays}
    size = sum(array.dtype.itemsize * math.prod(shapes[name]) for name, array in layout.items())
    try:
        if zstandard.frame_content_size(frame.data) != size:
            raise ValueError(f"the keyframe's data do not expand to the {size} bytes of its arrays")
        raw = zstandard.decompress(frame.data)
    except zstandard.ZstdError as error:
        raise ValueError(f"the keyframe's data are damaged: {error}") from error
    arrays, at = {}, 0
    for name, array in layout.items():
        arrays[name] = np.frombuffer(raw, array.dtype, math.prod(shapes[name]), at).reshape(shapes[name])
        at += arrays[name].nbytes
    return arrays


def state_fields(frame: Keyframe) -> StateFields:
    """Return the fields of a keyframe's state without perception, by name."""
    return {name: getattr(frame.state, name) for name in _CARRIED}


class PayloadSchema(GenerateJsonSchema):
    """JSON schemas of what is really written: non-finite numbers are strings, flags are integers."""

    def encode_default(self, dft: object) -> object:
        """Return a default as JSON has it; pydantic's own makes a serializer for each."""
        return to_jsonable_python(dft)

    def float_schema(self, schema: core_schema.FloatSchema) -> JsonSchemaValue:
        """Return the schema of a number that may be infinite or NaN."""
        return {"anyOf": [super().float_schema(schema), {"enum": ["NaN", "Infinity", "-Infinity"]}]}

    def enum_schema(self, schema: core_schema.EnumSchema) -> JsonSchemaValue:
        """Return the schema of one of several names, or of a sum of flags."""
        one_of = super().enum_schema(schema)
        if schema.get("sub_type") == "int":
            del one_of["enum"]
        return one_of
