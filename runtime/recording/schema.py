"""What a recording is made of, as pydantic models around the runtime's own dataclasses.

Fields of the dataclasses are read off their types, so whatever is added to a cycle's record or to its inputs is
recorded, described in the file's own schema and read back, with no change here.
"""

from __future__ import annotations

from dataclasses import MISSING, Field, fields
from itertools import accumulate
from typing import Any, Final, TypeAlias, get_type_hints

import numpy as np
import zstandard
from pydantic import BaseModel, ConfigDict, create_model
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from perception.snapshot import Snapshot
from runtime.cycle.modes import ModeState
from runtime.cycle.step import CycleRecord, State

FORMAT: Final = 1
"""Counted up when older programs can no longer read what is written."""


class Payload(BaseModel):
    """A message of a recording; what a newer program has added to one is not read."""

    model_config = ConfigDict(frozen=True, ser_json_inf_nan="strings", ser_json_bytes="base64",
                              val_json_bytes="base64", use_attribute_docstrings=True)  # fmt: skip


class RunInfo(Payload):
    """What a run was: everything that a replay needs besides the messages."""

    format: int
    settings: dict[str, Any]
    """The run's settings, object models among them, as `Settings` dumps them."""
    versions: dict[str, str]
    """Versions of program and libraries, the kernels' key, the processor: what the last bits may depend on."""
    started: str
    """Date and time, UTC."""
    unix_minus_host_ns: int
    """Log times are Unix times: the host's clock plus this."""
    part: int
    """A long run, or one whose disk was full for a while, is kept in several files, numbered from 1."""
    emulated: bool = False
    """The settings' world is what stood there; a real robot knows of none."""


class SettingsChange(Payload):
    """Other settings, in force from a cycle on: an input of it as much as an echo is."""

    cycle: int
    settings: dict[str, Any]
    """Whole, as in `RunInfo`, which repeats them from then on."""


class RunEnd(Payload):
    """What a run that came to its own end says of itself: its stats, line counts and stop reasons."""

    summary: dict[str, Any]


class Cycle(Payload):
    """One cycle of the step."""

    record: CycleRecord


class ModeChange(Payload):
    """A mode that was entered, or a reason that changed."""

    cycle: int
    mode: ModeState


class SerialBytes(Payload):
    """Bytes of the line as they came or went for a while, in whatever pieces."""

    host_s: float
    """When the first piece came or went, by the host's clock."""
    after_us: list[int]
    """How much later each piece came or went."""
    sizes: list[int]
    """How many bytes each piece has."""
    data: str
    """The pieces one after the other, in hexadecimal: what repeats itself still does, unlike in base64."""

    def pieces(self) -> list[tuple[float, bytes]]:
        """Return each piece and when it came or went by the host's clock, s."""
        raw, ends = bytes.fromhex(self.data), list(accumulate(self.sizes))
        return [
            (self.host_s + 1e-6 * after, raw[end - size : end])
            for after, size, end in zip(self.after_us, self.sizes, ends, strict=True)
        ]


class LogLine(Payload):
    """A line of the log."""

    level: str
    event: str
    fields: dict[str, Any]


class Bookmark(Payload):
    """A mark that an operator put here, to be found again; nothing in the run hangs on it."""

    cycle: int
    """The last one before it."""
    text: str


class MapChange(Payload):
    """What has happened to the outline map since the message before."""

    cycle: int
    whole: bool
    """Nothing before this counts: `added` is the whole map."""
    first: int
    """Number of the first of `added`; the others follow."""
    added: list[tuple[float, float, float, float, float]]
    """Ends x, y, x, y (m) and normal (rad) of each new segment, to the millimetre."""
    removed: list[int]
    """Numbers."""


class ObjectsSeen(Payload):
    """What is recognised now, as in the run's summary."""

    cycle: int
    objects: list[dict[str, Any]]


def _default(of: Field[Any]) -> Any:  # noqa: ANN401 - a field's default is whatever its type allows
    """Return what stands for a field of the state in a recording that does not know it; … where there must be one."""
    if of.default_factory is not MISSING:
        return of.default_factory()
    return ... if of.default is MISSING else of.default


_HINTS: Final = get_type_hints(State)
CarriedState: Any = create_model(  # type: ignore[call-overload]  # mypy sees no field definitions here
    "CarriedState",
    __base__=Payload,
    __doc__="What a cycle leaves to the next one besides perception's memory.",
    **{f.name: (_HINTS[f.name], _default(f)) for f in fields(State) if f.name != "perception"},
)


class ArrayInfo(Payload):
    """Where an array of the memory is: the arrays lie one after the other."""

    name: str
    dtype: str
    shape: list[int]


class Keyframe(Payload):
    """The whole state after a cycle: a replay can begin here."""

    cycle: int
    left: CarriedState  # of the fields of `State`
    arrays: list[ArrayInfo]
    memory: bytes
    """The arrays' bytes, little-endian, compressed by zstd."""


StateFields: TypeAlias = dict[str, Any]


def carried_state(state: State) -> StateFields:
    """Return the state's fields but for perception; all are immutable."""
    return {f.name: getattr(state, f.name) for f in fields(State) if f.name != "perception"}


def keyframe(cycle: int, left: StateFields, snapshot: Snapshot) -> Keyframe:
    """Return the message that holds a state."""
    arrays = [ArrayInfo(name=name, dtype=a.dtype.str, shape=list(a.shape)) for name, a in snapshot.items()]
    memory = zstandard.compress(b"".join(a.tobytes() for a in snapshot.values()))
    return Keyframe.model_construct(
        cycle=cycle,
        left=CarriedState.model_construct(**left),  # type: ignore[arg-type]
        arrays=arrays,
        memory=memory,
    )


def perception_snapshot(frame: Keyframe) -> Snapshot:
    """Return the memory that a keyframe holds."""
    raw, taken, at = zstandard.decompress(frame.memory), {}, 0
    for array in frame.arrays:
        dtype = np.dtype(array.dtype)
        count = int(np.prod(array.shape, dtype=np.int64))
        taken[array.name] = np.frombuffer(raw, dtype, count, at).reshape(array.shape)
        at += count * dtype.itemsize
    return taken


def restore_state(state: State, frame: Keyframe) -> None:
    """Make `state` what it was when the keyframe was taken.

    Raises
    ------
    ValueError
        The keyframe was taken with other settings.
    """
    state.perception.restore(perception_snapshot(frame))
    for f in fields(State):
        if f.name != "perception":
            setattr(state, f.name, getattr(frame.left, f.name))


class PayloadSchema(GenerateJsonSchema):
    """JSON schemas of what is really written: numbers JSON cannot name go as strings, flags as their sum."""

    def float_schema(self, schema: core_schema.FloatSchema) -> JsonSchemaValue:
        """Return the schema of a number that may be none."""
        return {"anyOf": [super().float_schema(schema), {"enum": ["NaN", "Infinity", "-Infinity"]}]}

    def enum_schema(self, schema: core_schema.EnumSchema) -> JsonSchemaValue:
        """Return the schema of one of several names, or of a sum of flags."""
        one_of = super().enum_schema(schema)
        if schema.get("sub_type") == "int":
            del one_of["enum"]
        return one_of
