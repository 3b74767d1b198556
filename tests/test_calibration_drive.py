"""The drive for calibration is what it says: its errors are those of the robot."""

from __future__ import annotations

import math

import pytest

from tests.calibration_drive import SENSORS, WAY_M, CalibrationErrors, calibration_drive


def test_a_drive_reports_wrong_distances_turns_and_ranges() -> None:
    drive = calibration_drive(1, "specular", 0.0, 3.0)
    last = drive.firings[-1].pose
    assert drive.way_m == pytest.approx(WAY_M, rel=0.05)
    assert math.hypot(last.x, last.y) / drive.way_m == pytest.approx(drive.scales.distance, abs=1e-3)
    assert all(abs(scale - 1.0) > 0.01 for scale in drive.scales)
    assert len(drive.true.mounts) == len(drive.nominal.mounts) == SENSORS
    for true, nominal in zip(drive.true.mounts, drive.nominal.mounts, strict=True):
        assert 0.0 < math.hypot(true.x_m - nominal.x_m, true.y_m - nominal.y_m) < 0.0425
        assert abs(true.angle_rad - nominal.angle_rad) < math.radians(3.0)


def test_errors_are_named() -> None:
    assert CalibrationErrors._fields == ("angle_deg", "place_m", "distance", "turn", "range")
