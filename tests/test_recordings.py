"""The recordings come through their conversion as their owners describe them; the assertions on what is seen in
them are perception's."""

from __future__ import annotations

import csv
import math
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from config.robot import RobotConfig
from drivers.messages import Firing
from runtime.recording.ring_log import read_ring_log
from tests import recordings


def converted(tmp_path: Path, convert: Callable[[Path], None], robot: str) -> list[Firing]:
    """Convert, and read back as many sensors as the robot file says."""
    path = tmp_path / "log.csv"
    convert(path)
    return list(read_ring_log(path, len(RobotConfig.model_validate(tomllib.loads(robot)).ring.mounts)))


def test_udacity_corridor(tmp_path: Path) -> None:
    firings = converted(tmp_path, recordings.udacity_ring_log, recordings.udacity_robot())
    assert len(firings) == 413
    ranges = np.array([f.ranges_m for f in firings])
    fresh = ~np.isnan(ranges)
    assert not fresh[0].any()
    shares = fresh.mean(axis=0)
    assert shares[4] == pytest.approx(0.116, abs=0.001)
    others = np.delete(shares, 4)
    assert others.min() >= 0.30
    assert others.max() <= 0.41
    heard = ranges[np.isfinite(ranges)]
    assert heard.min() >= 0.17
    assert heard.max() <= 5.0
    assert np.allclose(heard * 100.0, np.round(heard * 100.0))
    assert np.isinf(ranges).sum() > 50

    assert firings[0].robot_s == 0.0
    assert firings[-1].robot_s == pytest.approx(92.837)
    places = np.array([(f.pose.x, f.pose.y) for f in firings])
    assert np.hypot(*np.diff(places, axis=0).T).sum() == pytest.approx(25.0, abs=1.0)
    turns = np.abs(np.diff([f.pose.theta for f in firings]))
    assert turns.max() < 0.5, "headings are unwrapped"
    assert all(f.ring_yaw == f.pose.theta for f in firings)


def test_udacity_moves_the_way_it_looks(tmp_path: Path) -> None:
    firings = converted(tmp_path, recordings.udacity_ring_log, recordings.udacity_robot())
    steps = np.diff([(f.pose.x, f.pose.y) for f in firings], axis=0)
    theta = np.array([f.pose.theta for f in firings[1:]])
    ahead = steps[:, 0] * np.cos(theta) + steps[:, 1] * np.sin(theta)
    assert ahead.sum() > 0.95 * np.hypot(*steps.T).sum()


def test_scitos_ring(tmp_path: Path) -> None:
    firings = converted(tmp_path, recordings.scitos_ring_log, recordings.scitos_robot())
    assert len(firings) == 5456
    ranges = np.array([f.ranges_m for f in firings])
    assert ranges.shape == (5456, 24)
    assert not np.isnan(ranges).any()
    assert np.isinf(ranges).mean() == pytest.approx(0.138, abs=0.001)
    heard = ranges[np.isfinite(ranges)]
    assert (heard.min(), heard.max()) == (0.34, 5.087)
    assert firings[9].robot_s == pytest.approx(1.0)
    assert {(f.pose.x, f.pose.y, f.pose.theta) for f in firings} == {(0.0, 0.0, 0.0)}


def test_scitos_front_and_left_are_where_they_belong(tmp_path: Path) -> None:
    firing = converted(tmp_path, recordings.scitos_ring_log, recordings.scitos_robot())[0]
    source = recordings.data_folder("uci_scitos24") / "sensor_readings_24.data"
    with source.open(encoding="ascii") as file:
        row = next(csv.DictReader(file))
    for sensor, name in ((0, "S13"), (6, "S19"), (12, "S1"), (18, "S7"), (23, "S12")):
        value = float(row[name])
        assert firing.ranges_m[sensor] == (math.inf if value == 5.0 else value)


def test_absent_data_is_skipped_with_a_word(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("ECHOLOCATE_DATA", str(tmp_path))
    with pytest.raises(pytest.skip.Exception, match=r"recorded data is absent.*ECHOLOCATE_DATA"):
        recordings.udacity_ring_log(tmp_path / "log.csv")
