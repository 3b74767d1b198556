"""An MCAP file under construction: what was flushed can be read at once, and a finished file has an index."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.reader import make_reader

from runtime.recording.channels import CHANNELS, CYCLE, LOG, RUN_INFO, RawMessage
from runtime.recording.mcap_file import PROFILE, McapFile
from runtime.recording.schema import FORMAT
from tests.recorded import scanned

INFO = b'{"format":2}'


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run.mcap"


def read(path: Path) -> list[RawMessage]:
    chunks, scanner = scanned(path.read_bytes())
    assert scanner.profile == f"{PROFILE}/{FORMAT}"
    return [message for chunk in chunks for message in chunk]


def test_the_first_message_is_on_disk_at_once(path: Path) -> None:
    file = McapFile(path, INFO, 5)
    assert read(path) == [RawMessage(RUN_INFO, 5, INFO)]
    assert file.bytes == path.stat().st_size
    file.abandon()


def test_flushed_messages_survive_the_end_of_the_process(path: Path) -> None:
    file = McapFile(path, INFO, 5)
    file.add(CYCLE, b'{"record":1}', 6, sequence=1)
    file.flush()
    file.add(CYCLE, b'{"record":2}', 7, sequence=2)
    file.sync()
    assert [message.log_ns for message in read(path)] == [5, 6], "the second cycle was not flushed"
    file.abandon()
    file.abandon()
    chunks, scanner = scanned(path.read_bytes())
    assert (len(chunks), scanner.finished) == (2, False)


def test_a_finished_file_has_an_index_of_all_channels(path: Path) -> None:
    file = McapFile(path, INFO, 5)
    file.add(LOG, b"{}", 9, sequence=3)
    file.finish()
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        found = [
            (channel.topic, message.log_time, message.sequence) for _, channel, message in reader.iter_messages()
        ]
    assert found == [(RUN_INFO, 5, 0), (LOG, 9, 3)]
    assert [channel.topic for channel in summary.channels.values()] == list(CHANNELS)
    assert summary.statistics.chunk_count == 2


def test_a_disk_error_is_raised_and_closes_the_file(path: Path) -> None:
    with pytest.raises(OSError, match="No space left"):
        McapFile(Path("/dev/full"), INFO, 5)
    with pytest.raises(FileNotFoundError):
        McapFile(path / "none", INFO, 5)
