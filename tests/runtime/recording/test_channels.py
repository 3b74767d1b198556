"""Every topic has a payload type with a valid JSON schema, and payloads are decoded as they were encoded."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable

import jsonschema
import orjson
import pytest
from pydantic import ValidationError

from runtime.recording.channels import (
    BOOKMARK,
    BOOKMARK_WITHDRAWN,
    CHANNELS,
    CYCLE,
    RUN_INFO,
    SCHEMAS,
    decode,
    encode,
    schema_of,
)
from runtime.recording.schema import Bookmark, LogLine, MapChange, Payload, RunInfo
from tests import recording_schemas

MARK = Bookmark(run_s=1.5, cycle=30, text="“here” <b>\n")


def test_the_order_of_topics_gives_the_channel_numbers() -> None:
    """New topics are appended, so the first ones never change."""
    assert list(CHANNELS)[:2] == [RUN_INFO, CYCLE]
    assert list(CHANNELS)[-2:] == [BOOKMARK, BOOKMARK_WITHDRAWN]


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


def test_the_schemas_that_are_kept_are_those_of_the_models() -> None:
    """Renew them with `python -m tests.recording_schemas`."""
    assert recording_schemas.file() == SCHEMAS.read_bytes()


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


MEMORY_MAX_MB = 500
"""As for other files (P14)."""
HOSTILE = [
    ("Cycle", '{"record":{"inputs":{"received":{"firings":[', "{}", "]}}}}"),
    ("Cycle", '{"record":{"inputs":{"edits":[', "{}", "]}}}"),
    ("Keyframe", '{"run_s":0,"cycle":1,"state":{"vectors":[', "{}", "]}}"),
    ("MapChange", '{"removed":[', "-1", "]}"),
    ("Keyframe", '{"run_s":0,"cycle":1,"data":"', "", '"}'),
]
"""Messages of as many values as are allowed, each of them wrong; and a keyframe with 60 MiB of text in its arrays."""
MEASURE = """
import sys
import orjson
from pydantic import ValidationError
from runtime.recording import schema
from runtime.recording.channels import decode

def most_mb():
    # Not getrusage's, which counts from the size of the process that started this one.
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmHWM")) / 1024

before = most_mb()
for name, begin, item, end in orjson.loads(sys.argv[1]):
    kind = getattr(schema, name)
    each = sum(item.count(mark) for mark in ",[{") + 1
    many = ((item + ",") * ((kind.VALUES_MAX - 20) // each))[:-1].encode() if item else b"A" * (60 << 20)
    data = b"".join([begin.encode(), many, end.encode()])
    del many
    try:
        decode(kind, data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        assert first["type"] not in {"too_large", "json_invalid"}, first
    else:
        raise AssertionError(begin)
print(round(most_mb() - before))
"""


@pytest.mark.promise("P21")
def test_the_memory_of_a_message_is_bounded(measured: Callable[[str], None]) -> None:
    found = subprocess.run(
        [sys.executable, "-c", MEASURE, orjson.dumps(HOSTILE).decode()], capture_output=True, check=True, text=True
    )
    assert int(found.stdout) < MEMORY_MAX_MB
    measured(f"messages of as many values as are allowed, each of them wrong: {int(found.stdout)} MB at most")


def test_a_list_is_read_to_its_first_wrong_item() -> None:
    for kind in set(CHANNELS.values()):
        for field in (name for name, each in kind.model_fields.items() if str(each.annotation).startswith("list")):
            with pytest.raises(ValidationError) as caught:
                decode(kind, f'{{"{field}":[null,null,null]}}'.encode())
            assert sum(error["loc"][0] == field for error in caught.value.errors(include_url=False)) == 1, (
                kind,
                field,
            )


def test_a_message_of_too_many_values_is_not_parsed() -> None:
    data = b'{"run_s":0,"cycle":1,"state":{},"arrays":[' + b"{}," * MapChange.VALUES_MAX + b"{}]}"
    for kind in set(CHANNELS.values()):
        with pytest.raises(ValidationError, match=r"up to \d+ values") as caught:
            decode(kind, data)
        assert caught.value.error_count() == 1
