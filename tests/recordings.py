"""Recordings of real robots, turned into ring logs and robot files so that tests can replay them.

The recordings are not part of this project: they lie in the folder that ECHOLOCATE_DATA names, or else in
`shared/data` beside the repository, and tests that need them skip, saying so, where they are absent.
"""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from runtime.recording.ring_log import write_ring_log

UDACITY_ANGLES_DEG = (-90.0, -37.5, -22.5, -7.5, 7.5, 22.5, 37.5, 90.0)
UDACITY_RANGE_MAX_MM = 5000
SCITOS_SENSORS = 24
SCITOS_NO_ECHO_M = 5.0
SCITOS_ROWS_A_SECOND = 9.0


def data_folder(name: str) -> Path:
    """Return the folder of one data set, or skip the test that asks for it."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("ECHOLOCATE_DATA") or beside) / name
    if not folder.is_dir():
        pytest.skip(
            f"recorded data is absent: no folder {folder}; set ECHOLOCATE_DATA to the folder that holds {name}"
        )
    return folder


def udacity_ring_log(path: Path) -> None:
    """Write the corridor recording of udacity/RoboND-OccupancyGridMappingAlgorithm, 8 sonars, as a ring log.

    The readings are latched: a sensor's value stands in every row until it next fires, so a value counts as fired
    only where it differs from the row before, and nothing counts in the first row. Millimetres and tenths of a
    degree become metres and radians, headings unwrapped, time from zero; beyond the valid 5 m nothing was heard.
    """
    folder = data_folder("udacity_ogm")
    poses = np.loadtxt(folder / "poses.txt")
    readings = np.loadtxt(folder / "measurement.txt")
    if not np.array_equal(poses[:, 0], readings[:, 0]):
        raise ValueError(f"{folder}: poses and measurements differ in their time stamps")
    ranges = np.where(readings[:, 1:] > UDACITY_RANGE_MAX_MM, math.inf, readings[:, 1:] / 1000.0)
    fresh = np.diff(readings[:, 1:], axis=0, prepend=readings[:1, 1:]) != 0.0
    ranges[~fresh] = math.nan
    times = (poses[:, 0] - poses[0, 0]) / 1000.0
    headings = np.unwrap(np.radians(poses[:, 3] / 10.0))
    rows = zip(times.tolist(), (poses[:, 1:3] / 1000.0).tolist(), headings.tolist(), ranges, strict=True)
    write_ring_log(path, (Firing(t, Pose(x, y, theta), theta, heard) for t, (x, y), theta, heard in rows))


def udacity_robot() -> str:
    """Return that robot's file; how its sensors are mounted is unknown, its ranges count from its centre."""
    sensors = ",\n".join(f"  {{x_m = 0.0, y_m = 0.0, angle_deg = {angle}}}" for angle in UDACITY_ANGLES_DEG)
    return f"""\
[ring]
sensors = [
{sensors},
]
beam_half_angle_deg = 20.0
resolution_m = 0.01
range_min_m = 0.17
range_max_m = {UDACITY_RANGE_MAX_MM / 1000.0}
[ring.firing]
sets = [[0, 1, 2, 3, 4, 5, 6, 7]]
step_period_s = 0.21
[body]
radius_m = 0.17
speed_max_m_s = 1.0
turn_max_rad_s = 2.0
"""


def scitos_ring_log(path: Path) -> None:
    """Write the wall-following recording of UCI data set 194, a ring of 24 sonars without poses, as a ring log.

    US1 looks backwards and the numbers go counter-clockwise, so US13 is our sensor 0. The pose is zero throughout
    and time goes in steps of a ninth of a second; 5.000 stands for no echo.
    """
    write_ring_log(path, _scitos_firings(data_folder("uci_scitos24") / "sensor_readings_24.data"))


def _scitos_firings(source: Path) -> Iterator[Firing]:
    with source.open(encoding="ascii", newline="") as file:
        rows = csv.reader(file)
        next(rows)
        for i, cells in enumerate(rows):
            from_behind = np.array(cells[:SCITOS_SENSORS], dtype=np.float64)
            ranges = np.roll(from_behind, -SCITOS_SENSORS // 2)
            ranges[ranges == SCITOS_NO_ECHO_M] = math.inf
            yield Firing(i / SCITOS_ROWS_A_SECOND, Pose(0.0, 0.0, 0.0), 0.0, ranges)


def scitos_robot(radius_m: float = 0.25) -> str:
    """Return that robot's file; the radius of its ring is unknown, a quarter of a metre fits such a body."""
    everyone = ", ".join(map(str, range(SCITOS_SENSORS)))
    return f"""\
[ring]
count = {SCITOS_SENSORS}
radius_m = {radius_m}
beam_half_angle_deg = 12.0
resolution_m = 0.001
range_min_m = 0.3
range_max_m = 5.1
[ring.firing]
sets = [[{everyone}]]
step_period_s = 0.111
[body]
radius_m = 0.3
speed_max_m_s = 1.0
turn_max_rad_s = 2.0
"""
