"""Every topic has a payload type with a valid JSON schema, and payloads are decoded as they were encoded."""

from __future__ import annotations

import jsonschema
import orjson
import pytest
from pydantic import ValidationError

from runtime.recording.channels import BOOKMARK, CHANNELS, CYCLE, RUN_INFO, decode, encode, schema_of
from runtime.recording.schema import Bookmark, LogLine, MapChange, Payload, RunInfo

MARK = Bookmark(run_s=1.5, cycle=30, text="“here” <b>\n")


def test_the_order_of_topics_gives_the_channel_numbers() -> None:
    """New topics are appended, so the first ones never change."""
    assert list(CHANNELS)[:2] == [RUN_INFO, CYCLE]
    assert list(CHANNELS)[-1] == BOOKMARK


@pytest.mark.parametrize("payload", [
    MARK,
    LogLine(run_s=1e-300, level="info", event="start", fields={"why": None, "list": [1, {"a": True}]}),
    MapChange(run_s=-0.0, cycle=1, whole=True, first=0, added=[(1.0, 2.0, 3.0, 4.0, -0.0)], removed=[7]),
    RunInfo(format=2, settings={"a": 1}, versions={}, started="now", unix_minus_host_ns=-(2**62), part=1),
])  # fmt: skip
def test_a_payload_is_decoded_as_it_was_encoded(payload: Payload) -> None:
    data = encode(payload)
    assert encode(decode(type(payload), data)) == data
    assert b"\n" not in data
    jsonschema.validate(orjson.loads(data), orjson.loads(schema_of(type(payload))))


@pytest.mark.parametrize("kind", dict.fromkeys(CHANNELS.values()))
def test_every_schema_is_valid_and_refuses_another_payload(kind: type[Payload]) -> None:
    schema = orjson.loads(schema_of(kind))
    jsonschema.Draft202012Validator.check_schema(schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"strange": 1}, schema)


@pytest.mark.parametrize("data", [b"", b"{", b"[]", b'{"run_s":1.0,"cycle":2}', b'{"run_s":"x","cycle":2,"text":""}'])
def test_data_of_another_form_is_refused(data: bytes) -> None:
    with pytest.raises(ValidationError):
        decode(Bookmark, data)
