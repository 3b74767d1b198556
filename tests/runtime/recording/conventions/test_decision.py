"""One decision on all conventions of a log."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from runtime.recording.conventions.decision import Conventions, decide
from runtime.recording.conventions.headings import Angles
from runtime.recording.conventions.options import AUTO
from runtime.recording.conventions.silence import Silence
from runtime.recording.conventions.table import Table
from runtime.recording.conventions.units import Units
from tests.runtime.recording.conventions.tables import make_drive


def test_a_firing_is_converted() -> None:
    found = Conventions(Silence(0.0, 0.0), -1.0, Units("ms", "cm", "ft"), Angles("north-cw", "deg"))
    assert not found.is_plain
    got = found.converted(Firing(1500.0, Pose(100.0, 200.0, 90.0), 0.0, np.array([0.0, 10.0, -1.0])))
    assert (got.robot_s, got.pose.x, got.pose.y) == pytest.approx((1.5, 1.0, 2.0))
    assert (got.pose.theta, got.ring_yaw) == pytest.approx((0.0, 0.5 * np.pi))
    np.testing.assert_allclose(got.ranges_m, [np.inf, 3.048, np.nan])


def test_a_robot_that_drives_as_far_backward_as_forward_leaves_its_headings_to_the_ranges() -> None:
    """Its way fits two opposite headings alike."""
    drive = make_drive(3, "p3dx", "room", "specular")
    rows = [*range(300), *range(299, -1, -1)]
    table = Table(drive.t[:600], drive.pose[rows], drive.ranges[rows])
    assert decide(table, drive.settings, AUTO).is_plain


def test_noise_on_what_is_repeated_is_another_convention_and_its_width_is_not() -> None:
    one = Conventions(cycle_s=0.4, same_m=1e-4)
    assert one.is_same(Conventions(cycle_s=0.5, same_m=2e-4))
    assert not one.is_same(Conventions(cycle_s=0.4))


def test_the_forms_own_conventions_change_nothing() -> None:
    assert Conventions().is_plain
