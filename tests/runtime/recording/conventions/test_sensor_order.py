"""Columns that are mirrored, or that begin with another sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.load import load_settings
from runtime.recording.conventions.headings import Angles
from runtime.recording.conventions.sensor_order import check_shift, mirrored_columns
from runtime.recording.conventions.table import Table
from runtime.recording.ring_log import RingLogError
from tests.runtime.recording.conventions.tables import make_drive

RING = load_settings("hallway", robot="p3dx").ring


def test_a_mirrored_ring_takes_each_column_for_the_sensor_on_the_other_side() -> None:
    columns = mirrored_columns(RING)
    for sensor, mount in enumerate(RING.mounts):
        image = RING.mounts[columns[sensor]]
        assert (image.x_m, -image.y_m, -image.angle_rad) == pytest.approx(tuple(mount), abs=1e-6)
    np.testing.assert_array_equal(columns[columns], np.arange(len(columns)))


@pytest.mark.parametrize("robot", ["denning", "p3dx"])
@pytest.mark.parametrize("shift", [0, 1, 5])
def test_columns_that_begin_with_another_sensor_are_refused(robot: str, shift: int) -> None:
    drive = make_drive(11, robot, "room", "cone", 60.0)
    shifted = replace(drive, ranges=np.roll(drive.ranges, shift, axis=1))
    table = Table(shifted.t, shifted.pose, np.where(np.isinf(shifted.ranges), np.nan, shifted.ranges))
    if shift == 0:
        check_shift(table, drive.settings, Angles(), 1.0, 1.0)
        return
    with pytest.raises(RingLogError, match=f"r00 is sensor {drive.ranges.shape[1] - shift} of the robot file"):
        check_shift(table, drive.settings, Angles(), 1.0, 1.0)
