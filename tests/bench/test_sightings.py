"""Tests of bench.sightings on a drive with known places, and of reading the recording's files."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bench.sightings import Recording, figures, read_mrclam, steps_between, track
from perception.kernel import Floats

POSTS = np.array([[6.0, -2.0, 1.0], [8.0, 3.0, 4.0], [9.0, 4.0, -2.0], [15.0, 0.0, -3.0]])
SPEED_M_S, TURN_RAD_S, STEP_S = 0.2, 0.1, 0.1
ODOMETER_SCALE = 1.03


def circles(noise_m: float, noise_rad: float) -> Recording:
    """Return three rounds on a circle, on which odometry reports too long a way, with a sighting every other step."""
    rng, x, y, heading = np.random.default_rng(3), 0.0, -1.5, 0.0
    odometry, sightings = list[list[float]](), list[list[float]]()
    for k in range(round(3 * 2.0 * math.pi / TURN_RAD_S / STEP_S)):
        t = STEP_S * k
        odometry.append([t, ODOMETER_SCALE * SPEED_M_S, TURN_RAD_S])
        if k % 2 == 0:
            number, px, py = POSTS[k // 2 % len(POSTS)]
            distance, bearing = math.hypot(px - x, py - y), math.atan2(py - y, px - x) - heading
            sightings.append([t, number, distance + rng.normal(0.0, noise_m), bearing + rng.normal(0.0, noise_rad)])
        middle = heading + 0.5 * TURN_RAD_S * STEP_S
        x, y = x + SPEED_M_S * STEP_S * math.cos(middle), y + SPEED_M_S * STEP_S * math.sin(middle)
        heading += TURN_RAD_S * STEP_S
    return Recording(np.array(odometry), np.array(sightings), POSTS)


def test_posts_are_located_and_the_scale_of_odometry_is_found() -> None:
    recording = circles(0.03, 0.01)
    found = figures(recording, track(recording))
    assert found["landmarks"] == 4
    assert found["rms_m"] < 0.015
    assert found["odometer_scale"] == pytest.approx(ODOMETER_SCALE, abs=0.005)
    assert found["ignored"] < 0.01


def test_a_wild_sighting_is_ignored() -> None:
    recording = circles(0.01, 0.005)
    wild = recording.sightings.copy()
    wild[300, 2] += 3.0
    found = figures(recording._replace(sightings=wild), track(recording._replace(sightings=wild)))
    assert found["ignored"] == pytest.approx(1.0 / (len(wild) - 4))
    assert found["rms_m"] < 0.01


def test_the_steps_between_sightings_are_those_of_odometry() -> None:
    recording = circles(0.0, 0.0)
    steps = list(steps_between(recording))
    assert len(steps) == len(recording.sightings)
    assert steps[0] == (0.0, 0.0, 0.0, 0.0, 0.0)
    way = 2.0 * ODOMETER_SCALE * SPEED_M_S * STEP_S
    assert steps[1] == pytest.approx((way, 0.0, 2.0 * TURN_RAD_S * STEP_S, way, 2.0 * TURN_RAD_S * STEP_S), abs=1e-5)


def write(path: Path, rows: Floats) -> None:
    path.write_text(
        "# Subject\n" + "\n".join(" \t".join(str(value) for value in row) for row in rows.tolist()) + "\n"
    )


def test_the_files_are_read_without_robots_and_unknown_barcodes(tmp_path: Path) -> None:
    write(tmp_path / "Barcodes.dat", np.array([[1.0, 5.0], [6.0, 72.0], [11.0, 63.0], [17.0, 9.0]]))
    write(tmp_path / "Landmark_Groundtruth.dat", np.array([[6, 1, 2, 0, 0], [11, 3, 4, 0, 0], [17, 5, 6, 0, 0.0]]))
    write(tmp_path / "Robot1_Odometry.dat", np.array([[0.0, 0.1, 0.2], [0.1, 0.1, 0.2]]))
    write(
        tmp_path / "Robot1_Measurement.dat",
        np.array([[0.0, 5, 1, 0], [0.0, 72, 2.5, 0.1], [0.1, 63, 3, 0], [0.1, 8, 1, 0.0]]),
    )
    recording = read_mrclam(tmp_path, 1)
    assert recording.sightings.tolist() == [[0.0, 6.0, 2.5, 0.1], [0.1, 11.0, 3.0, 0.0]]
    assert recording.landmarks.tolist() == [[6.0, 1.0, 2.0], [11.0, 5.0, 6.0], [17.0, 3.0, 4.0]]
    assert recording.odometry.shape == (2, 3)
