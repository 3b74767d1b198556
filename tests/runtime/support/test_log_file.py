"""The log file keeps its size, several runs share it, and nothing but logs is appended to or replaced."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from runtime.support.log_file import LogFile, may_be_log


def line(k: int) -> bytes:
    return b'{"event":"line %d"}\n' % k


def events(*paths: Path) -> list[str]:
    return [json.loads(text)["event"] for path in paths for text in path.read_text("ascii").splitlines()]


@pytest.mark.promise("P22")
def test_a_full_file_becomes_the_old_one(tmp_path: Path) -> None:
    path, old = tmp_path / "run.jsonl", tmp_path / "run.jsonl.1"
    file = LogFile(path, 1000)
    for k in range(500):
        file.write(line(k))
        assert path.stat().st_size <= 1000
    file.close()
    assert old.stat().st_size <= 1000
    kept = events(old, path)
    assert kept == [f"line {k}" for k in range(500 - len(kept), 500)], "the newest, in order"
    assert len(kept) > 50
    assert sorted(found.name for found in tmp_path.iterdir()) == ["run.jsonl", "run.jsonl.1"]


def test_two_runs_share_a_file(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    files = [LogFile(path, 1000), LogFile(path, 1000)]
    for k in range(300):
        files[k % 7 % 2].write(line(k))
        assert path.stat().st_size <= 1000
    for file in files:
        file.close()
    kept = events(tmp_path / "run.jsonl.1", path)
    assert sorted(kept) == sorted(f"line {k}" for k in range(300 - len(kept), 300))


def test_a_line_longer_than_a_file_is_written(tmp_path: Path) -> None:
    file = LogFile(tmp_path / "run.jsonl", 10)
    for k in range(3):
        file.write(line(k))
    file.close()
    assert events(tmp_path / "run.jsonl.1", tmp_path / "run.jsonl") == ["line 1", "line 2"]


@pytest.mark.promise("P26")
@pytest.mark.parametrize("content", [b"robot = 'denning'\n", b"[1, 2]\n", b'{"drums": 6}\n', b"\x89MCAP0\r\n"])
def test_what_is_no_log_is_neither_appended_to_nor_replaced(tmp_path: Path, content: bytes) -> None:
    path, old = tmp_path / "mine", tmp_path / "run.jsonl.1"
    path.write_bytes(content)
    old.write_bytes(content)
    with pytest.raises(ValueError, match="it is not a log"):
        LogFile(path, 1000)
    file = LogFile(tmp_path / "run.jsonl", 100)
    for k in range(5):
        file.write(line(k))
    with pytest.raises(OSError, match=r"run\.jsonl\.1 is not a log"):
        file.write(line(5))
    file.close()
    assert (path.read_bytes(), old.read_bytes()) == (content, content)
    assert events(tmp_path / "run.jsonl") == [f"line {k}" for k in range(5)]


def test_a_log_that_begins_with_a_line_cut_off_is_one(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    for content in (b"", b"\n", b'{"eve', b'{"event":"li\n' + line(1)):
        path.write_bytes(content)
        assert may_be_log(path) == (content != b"\n")
    LogFile(path, 1000).close()


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "run.jsonl")
    file = LogFile(tmp_path / "link", 30)
    for k in range(3):
        file.write(line(k))
    file.close()
    assert events(tmp_path / "run.jsonl.1", tmp_path / "link") == ["line 1", "line 2"]


def test_devices_and_pipes_are_written_to(tmp_path: Path) -> None:
    assert may_be_log(Path("/dev/null"))
    os.mkfifo(tmp_path / "pipe")
    assert may_be_log(tmp_path / "pipe")
    assert not may_be_log(tmp_path)
    file = LogFile(Path("/dev/null"), 10)
    for k in range(3):
        file.write(line(k))
    file.close()
