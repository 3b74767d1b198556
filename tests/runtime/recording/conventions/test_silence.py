"""What stands for silence is found where it is said, and in tables that show it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.messages import Floats
from runtime.recording.conventions.silence import find_silence
from runtime.recording.conventions.table import Table

ROWS, SENSORS = 600, 4


def table(silent: Floats, share: float = 0.3) -> tuple[Table, NDArray[np.bool_]]:
    """Return a moving robot's table with values for silence in it, and where they are."""
    rng = np.random.default_rng(1)
    t: Floats = 0.1 * np.arange(ROWS, dtype=np.float64)
    pose: Floats = np.column_stack([0.02 * t, 0.0 * t, 0.0 * t, 0.0 * t])
    ranges: Floats = np.round(rng.uniform(0.3, 4.0, (ROWS, SENSORS)), 3)
    is_silent = rng.random(ranges.shape) < share
    ranges[is_silent] = np.resize(silent, int(is_silent.sum()))
    return Table(t, pose, ranges), is_silent


NOISY = np.round(7.6 + 0.05 * np.random.default_rng(2).standard_normal(1000), 3)


@pytest.mark.parametrize(
    ("wanted", "silent"),
    [
        ("0", [0.0]),
        ("-1", [-1.0]),
        ("7.6", [7.6]),
        ("max", [7.6]),
        ("max", NOISY),
        ("nan", [-np.inf]),
        ("inf", [np.inf]),
    ],
)
def test_what_is_said_is_silence(wanted: str, silent: Floats) -> None:
    rows, is_silent = table(np.array(silent))
    got = find_silence(rows, wanted, 1).applied(rows.ranges)
    assert (np.isposinf(got) == is_silent).mean() > 0.999
    np.testing.assert_array_equal(got[~is_silent], rows.ranges[~is_silent])


def test_of_few_ranges_the_greatest_is_silence_where_that_is_said() -> None:
    rows, _ = table(np.array([7.6]), 0.0)
    few = rows._replace(t=rows.t[:2], pose=rows.pose[:2], ranges=np.array([[1.0, np.nan], [np.nan, 2.0]]))
    assert find_silence(few, "max", 1).applied(few.ranges)[1, 1] == np.inf


def test_a_number_is_exact_and_leaves_glitches_above_it() -> None:
    rows, _ = table(np.array([7.6]))
    rows.ranges[5, 0] = 34.0
    assert find_silence(rows, "7.6", 1).applied(rows.ranges)[5, 0] == 34.0


@pytest.mark.parametrize(
    ("silent", "share"), [([0.0], 0.3), ([7.6], 0.3), (NOISY, 0.3), (NOISY, 0.04), ([1.2345], 0.04)]
)
def test_silence_is_found_in_ranges_without_inf(silent: Floats, share: float) -> None:
    rows, is_silent = table(np.array(silent), share)
    smooth = 2.0 + np.sin(0.01 * np.arange(ROWS))[:, None] + np.zeros(SENSORS)
    rows.ranges[~is_silent] = smooth[~is_silent]
    found = find_silence(rows, "auto", 1)
    assert found.words
    assert (np.isposinf(found.applied(rows.ranges)) == is_silent).mean() > 0.99


def test_no_silence_is_found_where_each_sensor_hears_something() -> None:
    rows, _ = table(np.array([1.0]), 0.0)
    assert not find_silence(rows, "auto", 1).words


@pytest.mark.parametrize("wanted", ["auto", "max"])
def test_a_noisy_band_among_ranges_takes_few_of_them(wanted: str) -> None:
    """About as many values are taken wrongly as by the best interval about the true value."""
    rows, is_silent = table(NOISY, 0.4)
    rng = np.random.default_rng(3)
    rows.ranges[~is_silent] = rng.uniform(4.0, 7.75, int((~is_silent).sum()))
    got = np.isposinf(find_silence(rows, wanted, 1).applied(rows.ranges))
    away = np.abs(rows.ranges - 7.6)
    least = min(int(((away <= half) != is_silent).sum()) for half in np.linspace(0.01, 0.3, 30))
    assert (got != is_silent).sum() < 1.15 * least
