"""The channels of a recording: what the messages of each topic are, their schemas, and to bytes and back."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple, TypeVar

import orjson

from runtime.recording.schema import (
    Bookmark,
    Cycle,
    Keyframe,
    LogLine,
    MapChange,
    ModeChange,
    ObjectsSeen,
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

CHANNELS: Final[Mapping[str, type[Payload]]] = MappingProxyType(
    {
        RUN_INFO: RunInfo,
        CYCLE: Cycle,
        MODE: ModeChange,
        SEGMENTS: MapChange,
        OBJECTS: ObjectsSeen,
        SERIAL["in"]: SerialBytes,
        SERIAL["out"]: SerialBytes,
        LOG: LogLine,
        KEYFRAME: Keyframe,
        SETTINGS: SettingsChange,
        SUMMARY: RunEnd,
        BOOKMARK: Bookmark,
    }
)
"""In the order in which they are numbered in a file, from 1; new ones go to the end."""

F = TypeVar("F", bound=Payload)


class RawMessage(NamedTuple):
    """A message as it lies in a recording."""

    topic: str
    log_ns: int
    """Unix time, ns."""
    data: bytes


def encode(form: Payload) -> bytes:
    """Return a message's JSON; its values are trusted, for they come from the program itself."""
    return form.__pydantic_serializer__.to_json(form)


def decode(kind: type[F], data: bytes) -> F:
    """Return the message in `data`.

    Raises
    ------
    pydantic.ValidationError
        It is no such message.
    """
    return kind.model_validate_json(data)


def schema_of(form: type[Payload]) -> bytes:
    """Return the JSON schema of what `encode` writes."""
    return orjson.dumps(form.model_json_schema(mode="serialization", schema_generator=PayloadSchema))
