"""Readers that seek by the index read every message of our files: mcap's own, and npm's, which Foxglove uses."""

from __future__ import annotations

import json
import shutil
import struct
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.reader import NonSeekingReader, SeekingReader

from runtime.cli.app import run_command
from runtime.recording.recovery import recover
from tests.hil.machine import TIMEOUT_S

SCRIPT: Final = Path(__file__).with_name("indexed_reader.mjs")
PACKAGES: Final = Path(sys.prefix) / "npm"
RECORD: Final = struct.Struct("<BQ")


def recovered(run: Path, folder: Path) -> Path:
    """Return what `recover` makes of a recording that was cut off."""
    cut = folder / "cut.mcap"
    cut.write_bytes(run.read_bytes()[: int(0.7 * run.stat().st_size)])
    return recover(cut, folder / "whole.mcap").path


def exported(kind: str, name: str) -> Callable[[Path, Path], Path]:
    """Return the function that exports a recording."""

    def export(run: Path, folder: Path) -> Path:
        assert run_command(["export", str(run), "--to", kind, "--out", str(folder / name)]) == 0
        return folder / name / f"{name}.mcap" if kind == "rosbag2" else folder / name

    return export


FILES: Final[Mapping[str, Callable[[Path, Path], Path]]] = MappingProxyType(
    {
        "recording": lambda run, _folder: run,
        "recovered": recovered,
        "foxglove": exported("foxglove", "run.mcap"),
        "rosbag2": exported("rosbag2", "bag"),
    }
)


@pytest.fixture(scope="module", params=FILES)
def file(request: pytest.FixtureRequest, hall_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return FILES[request.param](hall_run, tmp_path_factory.mktemp(request.param))


def counts_of(file: Path) -> dict[str, int]:
    """Return the number of messages of each topic, by the file's statistics."""
    with file.open("rb") as stream:
        summary = SeekingReader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    found = summary.statistics.channel_message_counts
    return {summary.channels[number].topic: count for number, count in found.items() if count}


def test_each_chunk_has_an_index_of_each_channel_that_leads_to_its_messages(file: Path) -> None:
    data = file.read_bytes()
    with file.open("rb") as stream:
        summary = SeekingReader(stream, validate_crcs=True).get_summary()
    assert summary is not None
    counts = Counter[str]()
    for chunk in summary.chunk_indexes:
        head = chunk.chunk_start_offset + RECORD.size + 28
        (name_bytes,) = struct.unpack_from("<I", data, head)
        body = data[head + 4 + name_bytes + 8 : chunk.chunk_start_offset + chunk.chunk_length]
        content = zstandard.decompress(body, chunk.uncompressed_size) if chunk.compression == "zstd" else body
        in_chunk, end = Counter[int](), chunk.chunk_start_offset + chunk.chunk_length
        at = 0
        while at < len(content):
            code, length = RECORD.unpack_from(content, at)
            in_chunk[struct.unpack_from("<H", content, at + RECORD.size)[0]] += code == Opcode.MESSAGE
            at += RECORD.size + length
        assert set(chunk.message_index_offsets) == set(+in_chunk)
        for channel, index_at in chunk.message_index_offsets.items():
            assert end <= index_at < end + chunk.message_index_length
            code, length = RECORD.unpack_from(data, index_at)
            number, list_bytes = struct.unpack_from("<HI", data, index_at + RECORD.size)
            assert (code, number, length) == (Opcode.MESSAGE_INDEX, channel, 6 + list_bytes)
            assert list_bytes == 16 * in_chunk[channel], "the index lists each message"
            for log_ns, message_at in struct.iter_unpack("<QQ", data[index_at + 15 : index_at + 15 + list_bytes]):
                code, _, number, _, found_ns = struct.unpack_from("<BQHIQ", content, message_at)
                assert (code, number, found_ns) == (Opcode.MESSAGE, channel, log_ns)
            counts[summary.channels[channel].topic] += in_chunk[channel]
    assert counts == counts_of(file)


def later_half(file: Path, topic: str) -> int:
    """Return the number of a topic's messages in the later half of a file's time, read without its index."""
    with file.open("rb") as stream:
        read = [(c.topic, m.log_time) for _, c, m in NonSeekingReader(stream).iter_messages(log_time_order=False)]
    times = [at for _, at in read]
    middle = (min(times) + max(times)) // 2
    return sum(name == topic and at >= middle for name, at in read)


def test_a_message_index_costs_little(hall_run: Path) -> None:
    with hall_run.open("rb") as stream:
        summary = SeekingReader(stream).get_summary()
    assert summary is not None
    assert sum(chunk.message_index_length for chunk in summary.chunk_indexes) < 0.1 * hall_run.stat().st_size


def test_npms_indexed_reader_reads_every_message(file: Path) -> None:
    node = shutil.which("node")
    if node is None or not (PACKAGES / "node_modules/@mcap/core").is_dir():
        pytest.skip("npm's @mcap/core is not installed: `make test` installs it where there is npm")
    counts = counts_of(file)
    topic = max(counts, key=lambda name: counts[name])
    command = [node, str(SCRIPT), str(PACKAGES), str(file), topic]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["counts"] == counts
    assert found["ordered"]
    assert found["later"] == later_half(file, topic)
