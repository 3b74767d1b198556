"""Impossible values in a recording are refused in one line before anything computes with them."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import orjson
import pytest
import zstandard
from pydantic import ValidationError

from config.errors import WRONG_CALL
from runtime.cli.app import run_command
from runtime.recording.channels import CHANNELS, CYCLE, KEYFRAME, LOG, MESSAGE_MAX, RawMessage, decode, encode
from runtime.recording.mcap_scanner import CONTENT_MAX
from runtime.recording.reader import RecordingError, cycle_head, open_recording
from runtime.recording.replayer import Replayer
from runtime.recording.schema import Cycle, Keyframe, MapChange, ObjectList, SerialBytes
from tests.recorded import entries_of, hall, record, rewrite, scanned

PAPER = "perception.method=paper"
POISON: tuple[object, ...] = ("NaN", "Infinity", "-Infinity", 1e308, -1e308, -1, 2**63 - 1, 10**30)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> list[RawMessage]:
    """Return the messages of a short run with keyframes."""
    path = tmp_path_factory.mktemp("small") / "small.mcap"
    record(hall(PAPER, "recording.keyframe_period_s=0.5"), path, 2.0)
    return entries_of(path)


def numbers_in(value: object, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the path of every number; of a list's items the first stands for all."""
    if isinstance(value, dict):
        for name, one in value.items():
            yield from numbers_in(one, (*path, name))
    elif isinstance(value, list) and value:
        yield from numbers_in(value[0], (*path, 0))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


def with_value(value: object, path: tuple[Any, ...], new: object) -> bytes:
    """Return JSON with another value at a path."""
    changed: Any = copy.deepcopy(value)
    at = changed
    for step in path[:-1]:
        at = at[step]
    at[path[-1]] = new
    return orjson.dumps(changed) if not isinstance(new, int) or new < 2**63 else _with_big(changed, at, path[-1], new)


def _with_big(changed: object, at: Any, key: object, new: int) -> bytes:
    at[key] = "BIG"
    return orjson.dumps(changed).replace(b'"BIG"', str(new).encode())


def replayed(entries: list[RawMessage], path: Path) -> str:
    """Return how the replay of these messages ends: an error's text, why a keyframe is refused, or nothing."""
    rewrite(entries, path)
    try:
        with open_recording(path) as recording:
            refused = [step.refused for step in Replayer(recording) if step.refused is not None]
            list(recording.cycle_records())
    except RecordingError as error:
        return str(error)
    return "; ".join(refused)


@pytest.mark.compiled
@pytest.mark.promise("P21")
def test_every_number_of_a_cycle(small: list[RawMessage], tmp_path: Path) -> None:
    where = [k for k, entry in enumerate(small) if entry.topic == CYCLE]
    chosen = next(k for k in where if b'"firings":[{' in small[k].data and b'"odometry":{' in small[k].data)
    tree = orjson.loads(small[chosen].data)
    refused = harmless = 0
    for path in numbers_in(tree):
        for poison in POISON:
            data = with_value(tree, path, poison)
            try:
                decode(Cycle, data)
            except ValidationError:
                refused += 1
                continue
            entries = [*small[:chosen], small[chosen]._replace(data=data), *small[chosen + 1 : chosen + 4]]
            problem = replayed(entries, tmp_path / "x.mcap")
            assert "\n" not in problem, (path, poison)
            harmless += 1
    assert refused > 5 * harmless > 0


@pytest.mark.promise("P21")
@pytest.mark.usefixtures("warm_kernels")  # to compile them is one more line
@pytest.mark.parametrize("command", [("replay",), ("report", "--force", "--out")], ids=["replay", "report"])
def test_commands_end_in_one_line(
    command: tuple[str, ...], small: list[RawMessage], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    chosen = next(k for k, e in enumerate(small) if e.topic == CYCLE and b'"firings":[{' in e.data)
    tree = orjson.loads(small[chosen].data)
    inputs = ("record", "inputs")
    ranges = (*inputs, "received", "firings", 0, "ranges_m")
    for path, new, word in (
        ((*inputs, "run_s"), "NaN", "run_s"), ((*inputs, "run_s"), 1e308, "run_s"),
        (ranges, [1.0] * 7, "7 ranges"), (ranges, [], "0 ranges"), (ranges, [-1.0] * 24, "range of -1"),
    ):  # fmt: skip
        file = tmp_path / "x.mcap"
        rewrite(
            [*small[:chosen], small[chosen]._replace(data=with_value(tree, path, new)), *small[chosen + 1 :]], file
        )
        out = [str(tmp_path / "out")] if command[1:] else []
        assert run_command([command[0], str(file), *command[1:], *out]) == WRONG_CALL
        err = capsys.readouterr().err
        assert (err.count("\n"), word in err) == (1, True), err


def test_the_head_of_a_cycle_is_bounded(small: list[RawMessage]) -> None:
    entry = next(entry for entry in small if entry.topic == CYCLE)
    assert cycle_head(entry)[0] == 1
    tree = orjson.loads(entry.data)
    for number in (b"1e308", b"-1e10", b"1e-e+"):
        head = with_value(tree, ("record", "inputs", "run_s"), "T").replace(b'"T"', number)
        with pytest.raises(ValidationError):
            cycle_head(entry._replace(data=head))


def poisoned_frame(frame: Keyframe, **changes: object) -> bytes:
    """Return a keyframe's JSON with other fields."""
    return encode(frame.model_copy(update=changes))


@pytest.mark.promise("P21")
def test_a_keyframe_is_compared_with_the_settings_before_it_is_decompressed(
    small: list[RawMessage], tmp_path: Path
) -> None:
    chosen = next(k for k, entry in enumerate(small) if entry.topic == KEYFRAME)
    frame = decode(Keyframe, small[chosen].data)
    first = frame.arrays[0]
    bomb = zstandard.compress(bytes(CONTENT_MAX))
    for changes, word in (
        ({"arrays": [first.model_copy(update={"shape": [-1]}), *frame.arrays[1:]]}, "differs"),
        ({"arrays": [first.model_copy(update={"shape": [2**62, 8]}), *frame.arrays[1:]]}, "differs"),
        ({"arrays": [first.model_copy(update={"dtype": "[" * 10_000}), *frame.arrays[1:]]}, "differs"),
        ({"arrays": frame.arrays[1:]}, "differs"),
        ({"data": bomb}, "do not expand to"),
        ({"data": b"no zstd"}, "damaged"),
        ({"data": frame.data[:-9]}, "damaged"),
    ):  # fmt: skip
        entry = small[chosen]._replace(data=poisoned_frame(frame, **changes))
        problem = replayed([small[0], entry], tmp_path / "x.mcap")
        assert word in problem, (changes.keys(), problem)
        assert "\n" not in problem


@pytest.mark.promise("P21")
def test_the_carried_state_of_a_keyframe(small: list[RawMessage]) -> None:
    frame = decode(Keyframe, next(entry.data for entry in small if entry.topic == KEYFRAME))
    tree = orjson.loads(encode(frame))
    paths = [
        path for path in numbers_in(tree) if path[0] in {"run_s", "cycle", "state"} and "drive_request" not in path
    ]
    assert len(paths) > 8
    for path in paths:
        for poison in ("NaN", "Infinity", 1e308, 10**30):
            with pytest.raises(ValidationError):
                decode(Keyframe, with_value(tree, path, poison))


@pytest.mark.promise("P21")
def test_a_chunk_that_expands_too_far_is_skipped(small: list[RawMessage], tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    rewrite([small[0], RawMessage(CYCLE, 7, bytes(CONTENT_MAX)), *small[1:20]], path)
    assert path.stat().st_size < 1 << 20
    chunks, scanner = scanned(path.read_bytes())
    assert len(scanner.corrupt_regions) >= 1
    assert all(len(message.data) < CONTENT_MAX for chunk in chunks for message in chunk)


@pytest.mark.promise("P21")
@pytest.mark.parametrize("more", [0, 1])
def test_a_chunk_of_too_many_messages_is_skipped(more: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A chunk begins with a schema and a channel for each topic that it is the first to have."""
    monkeypatch.setattr("runtime.recording.mcap_scanner.RECORDS_MAX", 1000)
    path, definitions = tmp_path / "x.mcap", 2 * len(CHANNELS)
    rewrite([RawMessage(LOG, 7, b"")] * (1000 - definitions + more), path)
    chunks, scanner = scanned(path.read_bytes())
    assert (len(chunks), len(scanner.corrupt_regions)) == (1 - more, more)


def test_a_message_that_is_too_large_is_not_parsed() -> None:
    with pytest.raises(ValidationError, match="a message of"):
        decode(Cycle, b"[" * (MESSAGE_MAX + 1))


def test_serial_data_objects_and_segments_belong_together() -> None:
    def serial(after_us: list[int], sizes: list[int], data: str) -> SerialBytes:
        return SerialBytes(run_s=1.0, after_us=after_us, sizes=sizes, data=data)

    serial([0, 5], [1, 1], "00ff")
    for times, sizes, data in (([0], [2], "00"), ([0], [-1], ""), ([10**17], [1], "00"), ([0], [1], "zz")):
        with pytest.raises(ValidationError):
            serial(times, sizes, data)
    good = {"model": "drum", "x": 1.0, "y": 2, "theta": 0.0, "sigma": 0.1, "support": 3, "score": 0.5, "number": None}
    assert ObjectList(run_s=1.0, cycle=1, objects=[good]).objects == [good]
    for name, value in (
        ("x", math.nan),
        ("x", "1"),
        ("model", 3),
        ("support", -1),
        ("covariance", [1.0]),
        ("extra", []),
    ):
        with pytest.raises(ValidationError, match=f"whose {name} is"):
            ObjectList(run_s=1.0, cycle=1, objects=[{**good, name: value}])
    with pytest.raises(ValidationError, match="without score"):
        ObjectList(run_s=1.0, cycle=1, objects=[{name: value for name, value in good.items() if name != "score"}])
    with pytest.raises(ValidationError):
        MapChange(run_s=1.0, cycle=1, whole=True, first=0, added=[(0.0, 0.0, 0.0, math.inf, 0.0)], removed=[])
