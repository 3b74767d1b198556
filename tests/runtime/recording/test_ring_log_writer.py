"""The ring log of a running robot: every firing is written, and a disk error is reported once and counted."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import orjson
import pytest

from drivers.messages import CrossPaths, Firing, Pose
from runtime.recording.ring_log import read_ring_log
from runtime.recording.ring_log_writer import RingLogWriter

RANGES_M = [1.5, np.inf, np.nan]


def firing(k: int, ranges_m: list[float] | None = None) -> Firing:
    return Firing(0.05 * k, Pose(0.01 * k, 0.0, 0.0), 0.0, np.array(ranges_m or RANGES_M))


def test_every_firing_is_written(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    with RingLogWriter(path) as log:
        for k in range(200):
            log.put(firing(k))
        assert log.probe() is None
    status = log.status
    assert (status.messages, status.dropped, status.last_error) == (200, 0, None)
    assert status.bytes == path.stat().st_size
    found = list(read_ring_log(path, sensors=3))
    assert [one.robot_s for one in found] == [0.05 * k for k in range(200)]
    assert found[7].pose == Pose(0.07, 0.0, 0.0)
    np.testing.assert_array_equal(found[7].ranges_m, RANGES_M)


@pytest.mark.parametrize(("path", "reason"), [("none/log.csv", "No such file"), ("/dev/full", "No space left")])
def test_a_disk_error_is_reported_and_every_lost_firing_counted(tmp_path: Path, path: str, reason: str) -> None:
    with RingLogWriter(tmp_path / path) as log:
        for k in range(2000):
            log.put(firing(k))
    status = log.status
    assert status.last_error is not None
    assert reason in status.last_error
    assert str(tmp_path / path) in status.last_error
    assert status.dropped > 1000


def test_a_firing_of_another_ring_ends_the_file_after_the_valid_rows(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    with RingLogWriter(path) as log:
        for ranges_m in (RANGES_M, [1.0], RANGES_M):
            log.put(firing(1, ranges_m))
    assert "row 3 would have 1 sensors" in str(log.status.last_error)
    assert log.status.dropped == 2
    assert len(list(read_ring_log(path, sensors=3))) == 1


def test_a_log_without_firings_is_reported(tmp_path: Path) -> None:
    with RingLogWriter(tmp_path / "log.csv") as log:
        pass
    assert "no firing" in str(log.status.last_error)


def test_a_name_that_is_no_text_can_be_in_the_summary(tmp_path: Path) -> None:
    with RingLogWriter(tmp_path / os.fsdecode(b"\xff.csv")) as log:
        pass
    assert b"no firing" in orjson.dumps(log.status)


def test_a_full_queue_drops_firings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is written before the thread starts."""
    monkeypatch.setattr("runtime.recording.ring_log_writer.QUEUE_MAX", 10)
    log = RingLogWriter(tmp_path / "log.csv")
    for k in range(15):
        log.put(firing(k))
    with log:
        pass
    assert (log.status.messages, log.status.dropped) == (10, 5)
    assert "faster than the disk takes them" in str(log.status.last_error)


def test_cross_paths_of_the_pattern_have_columns_and_others_are_noted(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    paths = CrossPaths(np.array([0, 1]), np.array([1, 2]), np.array([1.0, 2.0]))
    with RingLogWriter(path, [(0, 1)]) as log:
        log.put(replace(firing(0), cross_paths=paths))
    (found,) = read_ring_log(path, sensors=3)
    assert found.cross_paths is not None
    assert found.cross_paths.half_paths_m.tolist() == [1.0]
    assert "cross paths without a column" in (log.status.last_error or "")
