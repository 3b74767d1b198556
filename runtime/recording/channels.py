"""The channels of a recording: the payload type of each topic, its JSON schema, and encoding and decoding."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TypeVar

import orjson
from pydantic import ValidationError
from pydantic_core import PydanticCustomError, SchemaValidator

from runtime.recording.schema import (
    Bookmark,
    BookmarkWithdrawn,
    Cycle,
    Keyframe,
    LogLine,
    MapChange,
    ModeChange,
    ObjectList,
    Payload,
    PayloadSchema,
    RunEnd,
    RunInfo,
    SerialBytes,
    SettingsChange,
)

RUN_INFO: Final = "/run_info"
CYCLE: Final = "/cycle"
MODE: Final = "/mode"
SEGMENTS: Final = "/segments"
OBJECTS: Final = "/objects"
SERIAL: Final = MappingProxyType({"in": "/serial/in", "out": "/serial/out"})
LOG: Final = "/log"
KEYFRAME: Final = "/keyframe"
SETTINGS: Final = "/settings"
SUMMARY: Final = "/summary"
BOOKMARK: Final = "/bookmark"
BOOKMARK_WITHDRAWN: Final = "/bookmark_withdrawn"

CHANNELS: Final[Mapping[str, type[Payload]]] = MappingProxyType(
    {
        RUN_INFO: RunInfo,
        CYCLE: Cycle,
        MODE: ModeChange,
        SEGMENTS: MapChange,
        OBJECTS: ObjectList,
        SERIAL["in"]: SerialBytes,
        SERIAL["out"]: SerialBytes,
        LOG: LogLine,
        KEYFRAME: Keyframe,
        SETTINGS: SettingsChange,
        SUMMARY: RunEnd,
        BOOKMARK: Bookmark,
        BOOKMARK_WITHDRAWN: BookmarkWithdrawn,
    }
)
"""Payload type by topic. The order gives the channel numbers in a file, from 1; append new topics at the end."""

SCHEMAS: Final = Path(__file__).with_name("schemas.json")
"""The schemas of all payload types; `python -m tests.recording_schemas` writes it."""

MESSAGE_MAX: Final = 8 << 20
"""Largest message other than a keyframe, bytes."""

P = TypeVar("P", bound=Payload)


class RawMessage(NamedTuple):
    """An undecoded message of a recording."""

    topic: str
    log_ns: int
    """Unix time at which it happened, ns."""
    data: bytes


def encode(payload: Payload) -> bytes:
    """Return a payload as JSON, without validation: its values come from the program itself."""
    return payload.__pydantic_serializer__.to_json(payload)


def decode(kind: type[P], data: bytes) -> P:
    """Return the payload of type `kind` in `data`.

    Raises
    ------
    pydantic.ValidationError
        `data` is no JSON of this type, or one of its values is impossible.
    """
    values = sum(data.count(begin) for begin in (b",", b"[", b"{"))
    if values > kind.VALUES_MAX or (len(data) > MESSAGE_MAX and kind is not Keyframe):
        about = {"size": len(data), "values": values}
        why = PydanticCustomError("too_large", "a message of {size} bytes and up to {values} values", about)
        raise ValidationError.from_exception_data(kind.__name__, [{"type": why, "input": None}])
    payload: P = _validator(kind).validate_json(data)
    return payload


@functools.cache
def _validator(kind: type[Payload]) -> SchemaValidator:
    """Return the validator of a payload type; the type's own one collects the errors of all items of a list.

    Pydantic takes that one in place of any schema of the same type, unless it is asked not to.
    """
    return SchemaValidator(_ending_at_first_error(kind.__pydantic_core_schema__), _use_prebuilt=False)


def _ending_at_first_error(schema: Any) -> Any:  # noqa: ANN401 - a tree of dictionaries, lists and leaves
    """Return a copy of a schema by which the validation of a list or tuple ends at its first wrong item."""
    match schema:
        case dict():
            parts = {name: _ending_at_first_error(part) for name, part in schema.items()}
            return {**parts, "fail_fast": True} if parts.get("type") in {"list", "tuple"} else parts
        case list() | tuple():
            return type(schema)(_ending_at_first_error(part) for part in schema)
    return schema


@functools.cache
def schemas() -> Mapping[str, Any]:
    """Return the JSON schema of what `encode` writes for each payload type, by the type's name.

    They are kept in a file: to make them takes 40 ms beside the start of each run.
    """
    kept: dict[str, Any] = orjson.loads(SCHEMAS.read_bytes())
    return kept


def schema_of(kind: type[Payload]) -> bytes:
    """Return the JSON schema of a payload type."""
    return orjson.dumps(schemas()[kind.__name__])


def made_schema(kind: type[Payload]) -> bytes:
    """Return the JSON schema of a payload type made anew: what the file keeps."""
    return orjson.dumps(kind.model_json_schema(mode="serialization", schema_generator=PayloadSchema))
