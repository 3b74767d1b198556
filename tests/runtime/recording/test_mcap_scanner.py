"""A recording that is cut off or damaged anywhere raises nothing, loses a chunk at most, and reports it."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.opcode import Opcode

from runtime.recording.channels import CYCLE
from tests.examples import examples
from tests.recorded import chunks_at, entries_of, rewrite, scanned


@pytest.fixture(scope="module")
def small_file(chunked_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of the first second without keyframes, so short that every byte can be damaged in turn."""
    path = tmp_path_factory.mktemp("small") / "small.mcap"
    rewrite([e for e in entries_of(chunked_run) if e.topic == CYCLE][:20], path)
    return path


@pytest.fixture(scope="module")
def small(small_file: Path) -> bytes:
    return small_file.read_bytes()


def test_the_chunks_are_those_of_the_stock_reader(small: bytes) -> None:
    found = chunks_at(small)
    assert len(found) == 2
    assert all(small[begin] == Opcode.CHUNK for begin, _ in found)
    chunks, scanner = scanned(small)
    assert [len(chunk) for chunk in chunks] == [10] * 2
    assert (scanner.corrupt_regions, scanner.finished) == ([], True)


@pytest.mark.compiled
def test_a_file_cut_off_anywhere_gives_every_complete_chunk(small: bytes) -> None:
    ends = [end for _, end in chunks_at(small)]
    for cut in [*range(0, ends[-1] + 50, 3), *range(ends[-1] + 50, len(small), 101)]:  # beyond is the index
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
    for at in sorted(heads | {*range(60), *range(60, index, 7), *range(index, len(small), 61)}):
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
