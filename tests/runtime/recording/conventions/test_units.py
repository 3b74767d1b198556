"""Units are found by what the robot can do and its ring can hear."""

from __future__ import annotations

import numpy as np
import pytest

from runtime.recording.conventions.table import LENGTHS, TIMES, Table
from runtime.recording.conventions.units import Units, way_ratios
from tests.runtime.recording.conventions.tables import Drive, make_drive


@pytest.fixture(scope="module")
def drive() -> Drive:
    return make_drive(3, "p3dx", "room", "specular")


def in_units(drive: Drive, units: Units) -> Table:
    length, reach = LENGTHS[units.length], LENGTHS[units.range_]
    pose = drive.pose / [length, length, 1.0, 1.0]
    return Table(drive.t / TIMES[units.time], pose, drive.ranges / reach)


@pytest.mark.parametrize("length", ["m", "cm", "ft"])
def test_ranges_change_with_the_way_by_the_ratio_of_the_units(drive: Drive, length: str) -> None:
    table = in_units(drive, Units("s", length, "m"))
    ratios = way_ratios(table, drive.settings, table.pose[:, 3], 1)
    assert float(np.median(ratios)) == pytest.approx(LENGTHS[length], rel=0.05)


def test_options_say_what_units_are() -> None:
    assert Units("ms", "cm", "in").options == "--time-unit ms --length-unit cm --range-unit in"
