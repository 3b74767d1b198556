"""A recording that is cut off or damaged anywhere raises nothing, loses a chunk at most, and reports it."""

from __future__ import annotations

import random
import struct
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from runtime.recording.channels import CYCLE
from runtime.recording.mcap_scanner import SCHEMAS_MAX, McapScanner
from runtime.recording.reader import map_file
from tests.examples import examples
from tests.recorded import chunks_at, entries_of, rewrite, scanned


@pytest.fixture(scope="module")
def small_file(chunked_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of the first 1.5 s without keyframes, so short that every byte can be damaged in turn."""
    path = tmp_path_factory.mktemp("small") / "small.mcap"
    rewrite([e for e in entries_of(chunked_run) if e.topic == CYCLE][:30], path)
    return path


@pytest.fixture(scope="module")
def small(small_file: Path) -> bytes:
    return small_file.read_bytes()


def test_the_chunks_are_those_of_the_stock_reader(small: bytes) -> None:
    found = chunks_at(small)
    assert len(found) == 3
    assert all(small[begin] == Opcode.CHUNK for begin, _ in found)
    chunks, scanner = scanned(small)
    assert [len(chunk) for chunk in chunks] == [10] * 3
    assert (scanner.corrupt_regions, scanner.finished) == ([], True)


@pytest.mark.compiled
def test_a_file_cut_off_anywhere_gives_every_complete_chunk(small: bytes) -> None:
    ends = [end for _, end in chunks_at(small)]
    for cut in [*range(0, ends[-1] + 50, 11), *range(ends[-1] + 50, len(small), 101)]:  # beyond is the index
        chunks, scanner = scanned(small[:cut])
        assert len(chunks) == sum(end <= cut for end in ends), cut
        assert not scanner.finished
        if cut >= 8:
            found = [region for region in scanner.corrupt_regions if "end of the file" not in region.description]
            assert found == [], (cut, found)


@pytest.mark.compiled
def test_one_flipped_bit_costs_a_chunk_at_most_and_is_reported(small: bytes) -> None:
    whole, _ = scanned(small)
    rng = random.Random(0)
    heads = {at + k for begin, end in chunks_at(small) for at in (begin, end) for k in range(-8, 60)}
    index = chunks_at(small)[-1][1] + 60
    for at in sorted(heads | {*range(60), *range(60, index, 29), *range(index, len(small), 199)}):
        data = bytearray(small)
        data[at] ^= 1 << rng.randrange(8)
        chunks, scanner = scanned(bytes(data))
        lost = [chunk for chunk in whole if chunk not in chunks]
        assert len(lost) <= 1, (at, len(lost))
        assert all(chunk in whole for chunk in chunks), (at, "a chunk that was never written")
        # A flipped bit that Zstandard ignores changes nothing and need not be found.
        assert scanner.corrupt_regions or not lost, (at, "an unreported loss")


@examples(0.5)
@given(st.binary(max_size=300), st.integers(0, 1 << 16), st.integers(0, 300))
def test_any_bytes_anywhere_raise_nothing(small: bytes, junk: bytes, at: int, over: int) -> None:
    at %= len(small)
    chunks, scanner = scanned(small[:at] + junk + small[at + over :])
    whole, _ = scanned(small)
    assert all(chunk in whole for chunk in chunks)
    if not chunks:
        assert scanner.corrupt_regions


@pytest.mark.parametrize("data", [b"", b"\x89", b"\x89MCAP0\r\n", bytes(5000), bytes(range(256)) * 40])
def test_a_file_that_is_not_a_recording_raises_nothing(data: bytes) -> None:
    chunks, scanner = scanned(data)
    assert chunks == []
    assert not scanner.finished


def record(code: Opcode, content: bytes) -> bytes:
    return struct.pack("<BQ", code, len(content)) + content


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


def schema(number: int, size: int) -> bytes:
    return record(Opcode.SCHEMA, struct.pack("<H", number) + text(b"name") + text(b"jsonschema") + text(bytes(size)))


def channel(number: int, topic: bytes, of: int) -> bytes:
    return record(Opcode.CHANNEL, struct.pack("<HH", number, of) + text(topic) + text(b"json") + text(b""))


def chunk(content: bytes) -> bytes:
    data = zstandard.compress(content)
    head = struct.pack("<QQQI", 0, 0, len(content), zlib.crc32(content)) + text(b"zstd")
    return record(Opcode.CHUNK, head + struct.pack("<Q", len(data)) + data)


@pytest.mark.promise("P21")
def test_a_small_file_that_expands_to_much_takes_bounded_memory(measured: Callable[[str], None]) -> None:
    """Each chunk is within its limits, but what is kept of all of them must be, too."""
    large = 4 << 20
    for name, contents in {
        "schemas": [schema(k, large) for k in range(16)],
        "topics": [channel(k, bytes(large), 1) for k in range(16)],
    }.items():
        data = MCAP0_MAGIC + b"".join(map(chunk, contents))
        tracemalloc.start()
        _, scanner = scanned(data)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert scanner.schemas == {}
        assert peak < 6 * large, name
        measured(f"a file of {len(data) / 1e3:.0f} kB with {name} of {16 * large / 1e6:.0f} MB: {peak / 1e6:.0f} MB")


@pytest.mark.promise("P21")
def test_only_as_many_schemas_are_kept_as_a_recording_can_have() -> None:
    chunks = (chunk(schema(k, 10) + channel(k, b"/%d" % k, k)) for k in range(3 * SCHEMAS_MAX))
    _, scanner = scanned(MCAP0_MAGIC + b"".join(chunks))
    assert len(scanner.schemas) == SCHEMAS_MAX
    assert scanner.corrupt_regions == []


@pytest.mark.promise("P21")
@pytest.mark.parametrize("kind", [Opcode.SCHEMA, Opcode.CHANNEL])
def test_no_record_hides_others(kind: Opcode, monkeypatch: pytest.MonkeyPatch) -> None:
    """A record that spans the rest of its chunk is one record."""
    message = record(Opcode.MESSAGE, bytes(22))
    own = schema(1, 10) if kind is Opcode.SCHEMA else channel(1, b"/log", 1)
    monkeypatch.setattr("runtime.recording.mcap_scanner.RECORDS_MAX", 50)
    hiding = record(kind, own[9:] + 100 * message)
    chunks, scanner = scanned(MCAP0_MAGIC + chunk(hiding) + chunk(hiding + channel(0, b"/log", 1) + message))
    assert [len(one) for one in chunks] == [0, 1]
    assert scanner.corrupt_regions == []
    for bad in (own[:-1], record(Opcode.MESSAGE, bytes(21)), 51 * message):
        _, scanner = scanned(MCAP0_MAGIC + chunk(bad))
        assert len(scanner.corrupt_regions) == 1


@pytest.mark.parametrize("search_bytes", [1, 7, 100])
def test_the_next_chunk_is_found_block_by_block(
    small: bytes, search_bytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin = chunks_at(small)[0][0]
    damaged = small[: begin + 2] + b"\xff" * 3 + small[begin + 5 :]
    expected, before = scanned(damaged)
    monkeypatch.setattr("runtime.recording.mcap_scanner.SEARCH_BYTES", search_bytes)
    found, scanner = scanned(damaged)
    assert (found, scanner.corrupt_regions) == (expected, before.corrupt_regions)


@pytest.mark.promise("P21")
def test_a_hole_in_a_file_takes_no_memory(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with path.open("wb") as file:
        file.write(MCAP0_MAGIC)
        file.seek(200 << 20)
        file.write(chunk(channel(1, b"/log", 1) + record(Opcode.MESSAGE, struct.pack("<HIQQ", 1, 0, 0, 0))))
    tracemalloc.start()
    with map_file(path) as data:
        scanner = McapScanner(data)
        assert [len(one) for one in scanner.chunks()] == [1]
        del scanner
    assert tracemalloc.get_traced_memory()[1] < 20 << 20
    tracemalloc.stop()
