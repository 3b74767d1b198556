"""The fit of places and scales, without noise: it returns to the truth."""

from __future__ import annotations

import numpy as np
import pytest

from perception.calibration.drive import Scales, drive_of
from perception.calibration.geometry_fit import Geometry, Priors, RangeNoise, fit_geometry
from perception.calibration.surfaces import Echoes, Surfaces
from tests.calibration_drive import DRUM, WALL, calibration_drive


def test_the_fit_returns_from_the_nominal_robot_to_the_true_one() -> None:
    made = calibration_drive(5, "specular", 0.0, 6.0)
    drive = drive_of(made.firings, 0.101)
    firing, sensor = np.nonzero(np.isfinite(drive.ranges))
    echoes = Echoes(firing, sensor, drive.ranges[firing, sensor])
    angle = np.arctan2(WALL.y2_m - WALL.y1_m, WALL.x2_m - WALL.x1_m) + 0.5 * np.pi
    offset = np.cos(angle) * WALL.x1_m + np.sin(angle) * WALL.y1_m
    surfaces = Surfaces(np.array([[angle, offset]]), np.array([[DRUM.x_m, DRUM.y_m, DRUM.radius_m]]))
    true, nominal = np.array(made.true.mounts), np.array(made.nominal.mounts)
    start = Geometry(made.scales._replace(distance=1.0, range=1.0), surfaces, nominal[:, :2], np.zeros(drive.knots))
    fit = fit_geometry(drive, echoes, true[:, 2], 0.25, start, Priors(), made.way_m, synchro=False)
    for name, limit in (("distance", 0.0005), ("turn", 0.004), ("range", 0.004)):
        found, truth = getattr(fit.geometry.scales, name), getattr(made.scales, name)
        assert found / truth == pytest.approx(1.0, abs=limit)
    off_m = np.hypot(*(fit.geometry.mounts - true[:, :2]).T)
    assert (off_m < 4.0 * fit.mount_sigmas_m).all(), "it knows how well it knows"
    assert fit.mount_sigmas_m.max() < 0.01
    assert fit.readings.sum() > 0.8 * len(firing)


@pytest.mark.covered
def test_without_a_measured_way_the_distance_is_as_uncertain_as_what_is_round_leaves_it() -> None:
    made = calibration_drive(5, "specular", 0.0, 12.0)
    drive = drive_of(made.firings, 0.101)
    firing, sensor = np.nonzero(np.isfinite(drive.ranges))
    surfaces = Surfaces(np.array([[1.59, 1.16]]), np.array([[DRUM.x_m, DRUM.y_m, DRUM.radius_m]]))
    nominal = np.array(made.nominal.mounts)
    start = Geometry(Scales(turn=made.scales.turn), surfaces, nominal[:, :2], np.zeros(drive.knots))
    echoes = Echoes(firing, sensor, drive.ranges[firing, sensor])
    fit = fit_geometry(drive, echoes, nominal[:, 2], 0.2, start, Priors(), None, synchro=False)
    assert 0.001 < fit.scale_sigmas.distance <= Priors().scale
    assert abs(fit.geometry.scales.distance - made.scales.distance) < 4.0 * fit.scale_sigmas.distance


def test_the_noise_of_a_range_is_a_constant_and_a_share() -> None:
    assert RangeNoise(0.003, 0.004).sigmas(np.array([0.0, 1.0])) == pytest.approx([0.003, 0.005])
