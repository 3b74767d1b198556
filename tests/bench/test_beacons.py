"""Tests of bench.beacons on a drive with known places, and of reading the recording's file."""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from bench.beacons import Recording, figures, first_places, read_plaza, track
from perception.kernel import Floats

BEACONS = np.array([[3.0, -20.0, 5.0], [5.0, 25.0, 30.0], [9.0, 8.0, -25.0]])
SCALE = 1.07
SIDE_M, STEP_M = 30.0, 0.5
TURN_ERROR = 0.005


@pytest.fixture(autouse=True)
def _small_search(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.beacons.REACH_M", 40.0)
    monkeypatch.setattr("bench.beacons.SCALES", (1.0, 1.05, 1.1))


def lawn(noise_m: float) -> Recording:
    """Return a drive round a square three times, whose odometry turns too far, with a range after each step."""
    rng, x, y, heading, t = np.random.default_rng(4), 0.0, 0.0, 0.0, 0.0
    odometry, truth, ranges = list[list[float]](), list[list[float]](), list[list[float]]()
    corner = round(SIDE_M / STEP_M)
    for k in range(12 * corner):
        turn = math.pi / 2.0 if k % corner == corner - 1 else 0.0
        x, y, t = x + STEP_M * math.cos(heading), y + STEP_M * math.sin(heading), t + 0.5
        heading += turn
        odometry.append([t, STEP_M, turn * (1.0 + TURN_ERROR)])
        truth.append([t, x, y])
        number, bx, by = BEACONS[k % 3]
        ranges.append([t + 0.1, number, SCALE * math.hypot(bx - x, by - y) + rng.normal(0.0, noise_m)])
    return Recording(np.array(odometry), np.array(ranges), np.array(truth), BEACONS)


def test_beacons_are_placed_and_the_scale_of_ranges_is_found() -> None:
    recording = lawn(0.1)
    found = figures(recording, track(recording))
    assert (found["beacons"], found["ranges"]) == (3, len(recording.ranges) - 1)
    assert found["rms_m"] < 0.15
    assert found["beacons_m"] < 0.15
    assert found["range_scale"] == pytest.approx(SCALE, abs=0.003)
    assert found["odometry_rms_m"] > 5.0 * found["rms_m"]
    assert found["ignored"] == 0.0


def test_the_first_places_are_near_the_beacons() -> None:
    recording = lawn(0.0)
    scale, places = first_places(recording)
    assert scale == pytest.approx(SCALE, abs=0.03)
    assert sorted(places) == [3, 5, 9]
    for number, x, y in BEACONS.tolist():
        assert np.hypot(*(places[int(number)] - (x, y))) < 2.0


def matrix(name: str, values: Floats) -> bytes:
    """Return a compressed matrix of a MATLAB 5 file."""
    rows, columns = values.shape
    data = values.T.astype("<f8").tobytes()
    head = struct.pack("<IIIIIIii", 6, 8, 6, 0, 5, 8, rows, columns)
    label = struct.pack("<HH4s", 1, len(name), name.encode())
    body = head + label + struct.pack("<II", 9, len(data)) + data
    packed = zlib.compress(struct.pack("<II", 14, len(body)) + body)
    return struct.pack("<II", 15, len(packed)) + packed


def test_the_file_is_read_and_its_ranges_are_put_in_order(tmp_path: Path) -> None:
    ranges = np.array([[2.0, 0.0, 5.0, 20.5], [1.0, 0.0, 6.0, 10.5]])
    tables = {"DR": np.ones((4, 3)), "TD": ranges, "GT": np.full((3, 4), 2.0), "TL": BEACONS}
    path = tmp_path / "drive.mat"
    path.write_bytes(bytes(128) + b"".join(matrix(name, values) for name, values in tables.items()))
    recording = read_plaza(path)
    assert recording.ranges.tolist() == [[1.0, 6.0, 10.5], [2.0, 5.0, 20.5]]
    assert recording.odometry.shape == (4, 3)
    assert recording.truth.shape == (3, 3)
    assert recording.beacons.tolist() == BEACONS.tolist()
