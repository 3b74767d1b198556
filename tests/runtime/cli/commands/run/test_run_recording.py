"""Tests of the recording of a run when the disk fails: nothing waits, memory is bounded, losses are reported."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import numpy as np
import pytest

from config.errors import FAILED, UserError
from config.load import load_settings
from drivers.messages import Firing, Pose
from runtime.cli.commands.run.run_recording import open_run_recording
from runtime.recording import ring_log_writer as ringlog_writer
from runtime.recording.ring_log import read_ring_log
from runtime.recording.ring_log_writer import RingLogWriter
from tests.recorded import until

SETTINGS = load_settings("hallway")


def firing(number: int) -> Firing:
    return Firing(0.05 * number, Pose(0.0, 0.0, 0.0), 0.0, np.full(24, 1.5))


def stuck(path: Path) -> int:
    """Make a file that blocks writers until it is read; return the descriptor to read it from."""
    os.mkfifo(path)
    return os.open(path, os.O_RDONLY | os.O_NONBLOCK)


def test_a_ring_log_on_a_blocked_disk_fills_no_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ringlog_writer, "QUEUE_MAX", 64)
    path, read = tmp_path / "log.csv", bytearray()
    out = stuck(path)
    count = 5000
    with RingLogWriter(path) as writer:
        for number in range(count):
            writer.put(firing(number))
        assert len(writer._thread._queue) <= 64
        assert writer.status.dropped > 0
        assert "faster than the disk takes them" in str(writer.status.last_error)
        assert writer.probe() is None, "a slow disk does not end a part"
        os.set_blocking(out, True)
        reader = threading.Thread(target=lambda: read.extend(b"".join(iter(lambda: os.read(out, 65536), b""))))
        reader.start()
    reader.join()
    os.close(out)
    written = read.count(b"\n") - 1
    assert (written, written + writer.status.dropped) == (writer.status.messages, count)


def test_a_full_disk_under_a_ring_log_is_reported_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.symlink_to("/dev/full")
    with open_run_recording(SETTINGS, str(path), no_record=False, emulated=True) as recording:
        put = recording.observers(None, None).on_firing  # type: ignore[arg-type]
        assert put is not None
        for number in range(2000):
            put(firing(number))
        until(lambda: recording.summary_row is not None and recording.summary_row["dropped"] > 0, "trouble")
        assert recording.probe() is None, "the drive continues"
    with pytest.raises(
        UserError, match=r"--record: the ring log is incomplete: .*log\.csv.* No space left"
    ) as caught:
        recording.raise_if_incomplete()
    assert caught.value.exit_code == FAILED


def test_a_complete_ring_log_raises_no_error(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    with open_run_recording(SETTINGS, str(path), no_record=False, emulated=True) as recording:
        put = recording.observers(None, None).on_firing  # type: ignore[arg-type]
        assert put is not None
        for number in range(100):
            put(firing(number))
    recording.raise_if_incomplete()
    assert len(list(read_ring_log(path))) == 100
    assert recording.summary_row == {
        "file": str(path), "files": 1, "bytes": path.stat().st_size, "dropped": 0, "last_error": None,
        "sync_max_s": 0.0,
    }  # fmt: skip
