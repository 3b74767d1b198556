"""Recordings that were cut off or damaged anywhere: nothing raises, little is lost, and what is lost is reported."""

from __future__ import annotations

import io
import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.stream_reader import StreamReader

from config.errors import DONE
from runtime.cli.app import run_command
from runtime.recording.channels import CYCLE, RawMessage, decode
from runtime.recording.mcap_scanner import McapScanner
from runtime.recording.reader import open_recording
from runtime.recording.recovery import recover
from runtime.recording.schema import Cycle
from runtime.recording.verification import verify_recording
from tests.recorded import entries_of, hall, record, rewrite


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of ten seconds in chunks of ten cycles, with five keyframes."""
    folder = tmp_path_factory.mktemp("recorded")
    record(hall(), folder / "as_it_came.mcap", 10.0)
    rewrite(entries_of(folder / "as_it_came.mcap"), folder / "hall.mcap")
    return folder / "hall.mcap"


@pytest.fixture(scope="module")
def small_file(run: Path) -> Path:
    """The first seconds without keyframes, short enough for every byte of it."""
    path = run.with_name("small.mcap")
    rewrite([e for e in entries_of(run) if e.topic == CYCLE][:20], path)
    return path


@pytest.fixture(scope="module")
def small(small_file: Path) -> bytes:
    """Its bytes."""
    return small_file.read_bytes()


def scanned(data: bytes) -> tuple[list[list[RawMessage]], McapScanner]:
    scanner = McapScanner(memoryview(data))
    return list(scanner.chunks()), scanner


def chunks_at(data: bytes) -> list[tuple[int, int]]:
    """Return where each chunk begins and ends, by the stock reader's account."""
    file, found, begin = io.BytesIO(data), [], 0
    for entry in StreamReader(file, emit_chunks=True).records:
        if isinstance(entry, Chunk):
            end = file.tell()
            begin = end - len(entry.data) - 44 - 9
            found.append((begin, end))
    return found


def test_the_account_of_chunks_is_right(small: bytes) -> None:
    found = chunks_at(small)
    assert len(found) == 2
    assert all(small[begin] == Opcode.CHUNK for begin, _ in found)
    chunks, scanner = scanned(small)
    assert [len(chunk) for chunk in chunks] == [10] * 2
    assert (scanner.corrupt_regions, scanner.finished) == ([], True)


def test_cut_off_anywhere_every_complete_chunk_is_read(small: bytes) -> None:
    ends = [end for _, end in chunks_at(small)]
    for cut in [*range(ends[-1] + 50), *range(ends[-1] + 50, len(small), 37)]:  # beyond is the index
        chunks, scanner = scanned(small[:cut])
        assert len(chunks) == sum(end <= cut for end in ends), cut
        assert not scanner.finished
        if cut >= 8:
            found = [damage for damage in scanner.corrupt_regions if "end of the file" not in damage.description]
            assert found == [], (cut, found)


def test_one_flipped_bit_costs_a_chunk_at_most_and_is_reported(small: bytes) -> None:
    whole, _ = scanned(small)
    rng = random.Random(0)
    heads = {at + k for begin, end in chunks_at(small) for at in (begin, end) for k in range(-8, 60)}
    index = chunks_at(small)[-1][1] + 60
    for at in sorted(heads | {*range(60), *range(60, index, 3), *range(index, len(small), 23)}):
        data = bytearray(small)
        data[at] ^= 1 << rng.randrange(8)
        chunks, scanner = scanned(bytes(data))
        lost = [chunk for chunk in whole if chunk not in chunks]
        assert len(lost) <= 1, (at, len(lost))
        assert all(chunk in whole for chunk in chunks), (at, "what was not written is read")
        # Zstandard has bits that no reader looks at: what costs nothing need not be found.
        assert scanner.corrupt_regions or not lost, (at, "nothing is reported")


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=300), st.integers(0, 1 << 16), st.integers(0, 300))
def test_any_bytes_anywhere_raise_nothing(small_file: Path, junk: bytes, at: int, over: int) -> None:
    small = small_file.read_bytes()
    at %= len(small)
    chunks, scanner = scanned(small[:at] + junk + small[at + over :])
    whole, _ = scanned(small)
    assert all(chunk in whole for chunk in chunks)
    if not chunks:
        assert scanner.corrupt_regions


@pytest.mark.parametrize("data", [b"", b"\x89", b"\x89MCAP0\r\n", bytes(5000), bytes(range(256)) * 40])
def test_what_is_no_recording_at_all_raises_nothing(data: bytes) -> None:
    chunks, scanner = scanned(data)
    assert chunks == []
    assert not scanner.finished


def test_a_lost_chunk_is_got_over_at_the_next_keyframe(run: Path, tmp_path: Path) -> None:
    data = bytearray(run.read_bytes())
    begin, end = chunks_at(bytes(data))[6]
    data[(begin + end) // 2] ^= 0xFF
    path = tmp_path / "x.mcap"
    path.write_bytes(data)
    with open_recording(path) as recording:
        result = verify_recording(recording)
        assert [region.offset for region in recording.corrupt_regions] == [begin]
    assert result.first_difference is None, str(result.first_difference)
    assert result.missing == [(61, 70)]
    assert 10 <= result.skipped <= 20
    assert result.cycles + result.skipped == 190


def test_recovered_it_is_whole_again(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = run.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: int(0.7 * len(data))])
    assert run_command(["recover", str(cut)]) == DONE
    assert "was not closed" in capsys.readouterr().out
    restored = tmp_path / "cut-recovered.mcap"
    before, after = entries_of(cut), entries_of(restored)
    assert before == after
    assert scanned(restored.read_bytes())[1].finished
    assert run_command(["replay", str(restored), "--verify"]) == DONE
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cut-recovered.mcap", "cut.mcap"]
    with restored.open("rb") as file:
        assert sum(1 for _ in StreamReader(file, validate_crcs=True, emit_chunks=True).records) > 10


def test_recovering_twice_changes_nothing(run: Path, tmp_path: Path) -> None:
    first = recover(run, tmp_path / "1.mcap")
    second = recover(tmp_path / "1.mcap", tmp_path / "2.mcap")
    assert (first.finished, first.corrupt_regions) == (True, ())
    assert (first.messages, first.cycles, first.chunks) == (second.messages, 200, second.chunks)
    assert (tmp_path / "1.mcap").read_bytes() == (tmp_path / "2.mcap").read_bytes()


def test_without_its_first_chunk_a_recording_is_still_known(run: Path, tmp_path: Path) -> None:
    """Schemas and channels were there; settings come again with each keyframe."""
    data = bytearray(run.read_bytes())
    begin, end = chunks_at(bytes(data))[0]
    data[end - 3] ^= 0xFF
    (tmp_path / "x.mcap").write_bytes(data)
    got = recover(tmp_path / "x.mcap", tmp_path / "y.mcap")
    assert [region.offset for region in got.corrupt_regions] == [begin]
    cycles = [decode(Cycle, e.data).record.cycle for e in entries_of(tmp_path / "y.mcap") if e.topic == CYCLE]
    assert cycles == list(range(11, 201))
    with open_recording(tmp_path / "y.mcap") as recording:
        result = verify_recording(recording)
    assert result.first_difference is None
    assert result.missing == [(1, 10)]
    assert result.cycles >= 150
