"""The path of a drive under other scales, against an integration step by step."""

from __future__ import annotations

import math

import numpy as np

from drivers.messages import Firing, Pose
from perception.calibration.drive import KNOT_M, Drive, Scales, drive_of


def curved(steps: int = 200) -> Drive:
    """Return a drive along arcs, forwards and backwards, whose odometry and ring start turned."""
    rng = np.random.default_rng(3)
    pose, firings = Pose(1.0, -2.0, 3.0), []
    for k in range(steps):
        v, w = (0.03 if k % 50 < 35 else -0.02), float(rng.uniform(-0.05, 0.05))
        half = pose.theta + 0.5 * w
        pose = Pose(pose.x + v * math.cos(half), pose.y + v * math.sin(half), pose.theta + w)
        wrapped = math.remainder(pose.theta, 2.0 * math.pi)
        firings.append(Firing(0.05 * k, Pose(pose.x, pose.y, wrapped), wrapped + 0.3, np.array([1.0, 0.1, math.inf])))
    return drive_of(firings, 0.1)


def test_without_errors_the_path_is_the_reported_one() -> None:
    drive = curved()
    for synchro in (False, True):
        path = drive.path(Scales(), np.zeros(drive.knots), synchro=synchro)
        np.testing.assert_allclose(path.xy, drive.poses[:, :2], atol=1e-12)
        np.testing.assert_allclose(path.yaw, drive.ring_yaw, atol=1e-12)


def test_scaled_arcs_agree_with_an_integration_step_by_step() -> None:
    drive, scales = curved(), Scales(1.03, 0.97, 1.0)
    bends = np.random.default_rng(1).normal(0.0, 0.01, drive.knots)
    path = drive.path(scales, bends, synchro=False)
    x, y, theta = drive.poses[0]
    for k in range(1, len(drive.poses)):
        dx, dy, turn = drive.poses[k] - drive.poses[k - 1]
        ahead = dx * math.cos(drive.poses[k - 1, 2] + 0.5 * turn) + dy * math.sin(drive.poses[k - 1, 2] + 0.5 * turn)
        bent = 0.0
        for j, bend in enumerate(bends):
            bent += bend * float(np.diff(np.clip((drive.way_m[k - 1 : k + 1] / KNOT_M - j), 0.0, 1.0))[0])
        turn = turn / scales.turn + bent
        x += ahead / scales.distance * math.cos(theta + 0.5 * turn)
        y += ahead / scales.distance * math.sin(theta + 0.5 * turn)
        theta += turn
        assert math.hypot(path.xy[k, 0] - x, path.xy[k, 1] - y) < 1e-9
        assert abs(path.yaw[k] - 0.3 - theta) < 1e-9


def test_the_ring_of_a_synchro_drive_keeps_its_direction() -> None:
    drive = curved()
    path = drive.path(Scales(1.0, 0.9, 1.0), np.zeros(drive.knots), synchro=True)
    np.testing.assert_array_equal(path.yaw, drive.ring_yaw)


def test_the_least_range_is_no_reading() -> None:
    drive = curved(3)
    assert np.isnan(drive.ranges[:, 1]).all(), "a surface may be nearer"
    assert np.isinf(drive.ranges[:, 2]).all()
    assert (drive.ranges[:, 0] == 1.0).all()
