"""Bearings of servos in ring logs: what is written is read again, and what cannot be is named with what to do."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from config.load import load_robot
from drivers.messages import Firing, Pose
from runtime.recording.ring_log import RingLogError, read_ring_log
from runtime.recording.ring_log_rows import write_ring_log
from runtime.recording.servo_columns import ServoColumns

RING = load_robot("servo1").ring
COLUMNS = ServoColumns(RING)
HEAD = "t,x,y,theta,r00,h00\n"


def firing(t_s: float, mount: int, range_m: float) -> Firing:
    ranges = np.full(60, math.nan)
    ranges[mount] = range_m
    return Firing(t_s, Pose(0.0, 0.0, 0.0), 0.0, ranges)


def read(path: Path, text: str) -> list[Firing]:
    path.write_text(HEAD + text)
    return list(read_ring_log(path, COLUMNS.sensor_count, servos=COLUMNS))


def test_a_log_has_a_range_and_a_bearing_for_the_one_sensor_and_is_read_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    firings = [firing(0.01 * k, k % 60, math.inf if k % 7 else 1.0 + 0.01 * k) for k in range(130)]
    write_ring_log(path, firings, (), COLUMNS)
    lines = path.read_text().splitlines()
    assert lines[0] == "t,x,y,theta,ring_yaw,r00,h00"
    assert lines[31].endswith(",0.0,inf,0.0")
    again = list(read_ring_log(path, COLUMNS.sensor_count, servos=COLUMNS))
    for one, other in zip(firings, again, strict=True):
        np.testing.assert_array_equal(one.ranges_m, other.ranges_m)


def test_a_sensor_turned_by_hand_is_at_the_nearest_bearing_of_the_file(tmp_path: Path) -> None:
    found = read(tmp_path / "log.csv", "0,0,0,0,1.5,1.6\n1,0,0,0,inf,-3.1\n2,0,0,0,,\n")
    assert [np.flatnonzero(~np.isnan(one.ranges_m)).tolist() for one in found] == [[45], [0], []]
    assert found[0].ranges_m[45] == 1.5
    assert found[1].ranges_m[0] == math.inf


def test_what_is_wrong_with_bearings_is_named(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    with pytest.raises(RingLogError, match=r"row 2 column 'h00' is nan; h00 is the bearing of sensor 0 on its servo"):
        read(path, "0,0,0,0,1.5,\n")
    with pytest.raises(RingLogError, match=r"column 'h00' is 'east'; allowed is a finite number"):
        read(path, "0,0,0,0,1.5,east\n")
    with pytest.raises(RingLogError, match=r"column 'r00' is 'near'"):
        read(path, "0,0,0,0,near,0.1\n")
    path.write_text("t,x,y,theta,r00\n0,0,0,0,1.0\n")
    with pytest.raises(RingLogError, match="lacks the columns h00; h00 is the bearing"):
        list(read_ring_log(path, servos=COLUMNS))
    path.write_text(f"{HEAD}0,0,0,0,1.0,0.0\n")
    with pytest.raises(RingLogError, match="has bearings of a servo, and the ring has none"):
        list(read_ring_log(path))


def test_two_bearings_of_one_sensor_at_once_are_no_row(tmp_path: Path) -> None:
    both = firing(0.0, 3, 1.0)
    both.ranges_m[9] = 1.0
    with pytest.raises(RingLogError, match="row 2 would have sensor 0 at two bearings at once"):
        write_ring_log(tmp_path / "log.csv", [both], (), COLUMNS)
