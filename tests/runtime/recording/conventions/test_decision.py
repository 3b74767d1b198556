"""One decision on all conventions of a log."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from runtime.recording.conventions.decision import Conventions
from runtime.recording.conventions.headings import Angles
from runtime.recording.conventions.silence import Silence
from runtime.recording.conventions.units import Units


def test_a_firing_is_converted() -> None:
    found = Conventions(Silence(0.0, 0.0), -1.0, Units("ms", "cm", "ft"), Angles("north-cw", "deg"))
    assert not found.is_plain
    got = found.converted(Firing(1500.0, Pose(100.0, 200.0, 90.0), 0.0, np.array([0.0, 10.0, -1.0])))
    assert (got.robot_s, got.pose.x, got.pose.y) == pytest.approx((1.5, 1.0, 2.0))
    assert (got.pose.theta, got.ring_yaw) == pytest.approx((0.0, 0.5 * np.pi))
    np.testing.assert_allclose(got.ranges_m, [np.inf, 3.048, np.nan])


def test_the_forms_own_conventions_change_nothing() -> None:
    assert Conventions().is_plain
