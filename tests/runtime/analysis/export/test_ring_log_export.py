"""Tests of the firings of a recording as a ring log: bit for bit, and only those after the last restart."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from config.load import load_settings
from drivers.driver import Received
from drivers.messages import CrossPaths, Firing, Pose
from runtime.analysis.export.ring_log_export import write_log
from runtime.recording.reader import RecordingError, open_recording
from runtime.recording.ring_log import read_ring_log


class StubRecording:
    """A recording, reduced to what its cycles received."""

    path = Path("stub.mcap")
    settings = SimpleNamespace(ring=load_settings("hallway").ring)

    def __init__(self, *received: Received) -> None:
        self._received = received

    def cycle_records(self) -> Iterator[Any]:
        return (SimpleNamespace(inputs=SimpleNamespace(received=received)) for received in self._received)


def firing(robot_s: float) -> Firing:
    return Firing(robot_s, Pose(0.0, 0.0, 0.0), 0.0, np.array([1.0, np.nan, np.inf]))


@pytest.mark.compiled
def test_every_bit_of_every_firing_is_kept(hall_run: Path, tmp_path: Path) -> None:
    with open_recording(hall_run) as recording:
        heard = [f for record in recording.cycle_records() for f in record.inputs.received.firings]
        assert write_log(recording, tmp_path / "log.csv") == len(heard) > 100
    for one, other in zip(heard, read_ring_log(tmp_path / "log.csv"), strict=True):
        assert (one.robot_s, one.pose, one.ring_yaw) == (other.robot_s, other.pose, other.ring_yaw)
        assert one.ranges_m.tobytes() == other.ranges_m.tobytes()


def test_only_firings_after_the_last_restart_are_written(tmp_path: Path) -> None:
    recording: Any = StubRecording(
        Received((firing(8.0),), None, rebooted=False),
        Received((firing(0.1),), None, rebooted=True),
        Received((firing(0.2),), None, rebooted=False),
    )
    assert write_log(recording, tmp_path / "log.csv") == 2
    assert [f.robot_s for f in read_ring_log(tmp_path / "log.csv")] == [0.1, 0.2]


def test_cross_paths_get_the_columns_that_they_need(tmp_path: Path) -> None:
    paths = CrossPaths(np.array([0, 0]), np.array([2, 1]), np.array([1.5, np.inf]))
    recording: Any = StubRecording(Received((replace(firing(0.1), cross_paths=paths),), None, rebooted=False))
    write_log(recording, tmp_path / "log.csv")
    assert (tmp_path / "log.csv").read_text("utf-8").splitlines()[0].endswith("r02,x00_01,x00_02")


def test_a_recording_without_a_firing_is_refused(tmp_path: Path) -> None:
    recording: Any = StubRecording(Received((), None, rebooted=False))
    with pytest.raises(RecordingError, match=r"stub\.mcap: holds no firing"):
        write_log(recording, tmp_path / "log.csv")
    assert list(tmp_path.iterdir()) == []
