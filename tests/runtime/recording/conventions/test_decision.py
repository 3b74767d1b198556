"""One decision on all conventions of a log."""

from __future__ import annotations

import numpy as np
import pytest

from config.load import load_settings
from drivers.messages import Firing, Pose
from runtime.recording.conventions.decision import Conventions, mirrored_columns
from runtime.recording.conventions.headings import Angles
from runtime.recording.conventions.silence import Silence
from runtime.recording.conventions.units import Units

RING = load_settings("hallway", robot="p3dx").ring


def test_a_mirrored_ring_takes_each_column_for_the_sensor_on_the_other_side() -> None:
    columns = mirrored_columns(RING)
    for sensor, mount in enumerate(RING.mounts):
        image = RING.mounts[columns[sensor]]
        assert (image.x_m, -image.y_m, -image.angle_rad) == pytest.approx(tuple(mount), abs=1e-6)
    np.testing.assert_array_equal(columns[columns], np.arange(len(columns)))


def test_a_firing_is_converted() -> None:
    found = Conventions(Silence(0.0, 0.0), Units("ms", "cm", "ft"), Angles("north-cw", "deg"))
    assert not found.is_plain
    got = found.converted(Firing(1500.0, Pose(100.0, 200.0, 90.0), 0.0, np.array([0.0, 10.0, np.nan])))
    assert (got.robot_s, got.pose.x, got.pose.y) == pytest.approx((1.5, 1.0, 2.0))
    assert (got.pose.theta, got.ring_yaw) == pytest.approx((0.0, 0.5 * np.pi))
    np.testing.assert_allclose(got.ranges_m, [np.inf, 3.048, np.nan])


def test_the_forms_own_conventions_change_nothing() -> None:
    assert Conventions().is_plain
