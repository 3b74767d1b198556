"""Calibration of emulated robots whose mounts and scales are not what their files say."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from perception.calibration.calibrate import calibrate
from tests.calibration_drive import DRUM, CalibrationErrors, calibration_drive, calibration_errors


def errors(seed: int, model: str, drift: float, pace: float) -> CalibrationErrors:
    drive = calibration_drive(seed, "cone" if model == "cone" else "specular", drift, pace)
    found = calibrate(drive.firings, drive.nominal, [DRUM.radius_m], drive.way_m, synchro=False)
    assert found is not None
    assert (found.walls, found.drums, found.everything_echoes) == (1, 1, model == "cone")
    assert found.half_angle_rad == pytest.approx(math.radians(15.0), abs=math.radians(0.5))
    return calibration_errors(drive, found)


@pytest.mark.soak
@pytest.mark.parametrize("model", ["specular", "cone"])
def test_a_slow_drive_finds_them_to_a_third_of_a_degree_and_three_millimetres(
    model: str, record_property: Callable[[str, object], None]
) -> None:
    found = np.array([errors(seed, model, 0.0, 1.0) for seed in range(310, 318)])
    record_property("measured", ", ".join(f"{value:.2g}" for value in found.max(axis=0).tolist()))
    assert (found.max(axis=0) <= [0.3, 0.003, 0.002, 0.002, 0.002]).all()


@pytest.mark.covered
def test_without_a_surface_there_is_no_calibration() -> None:
    ring = calibration_drive(0, "cone", 0.0, 60.0).nominal
    silent = [Firing(0.1 * k, Pose(0.01 * k, 0.0, 0.0), 0.0, np.full(16, math.inf)) for k in range(50)]
    assert calibrate(silent, ring, [0.3], 1.0, synchro=False) is None
