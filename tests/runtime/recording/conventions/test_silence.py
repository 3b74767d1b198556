"""What stands for silence is found where it is said, and in tables that show it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.messages import Floats
from runtime.recording.conventions.beams import Beams
from runtime.recording.conventions.silence import find_silence
from runtime.recording.conventions.table import Table
from runtime.recording.ring_log import RingLogError

ROWS, SENSORS = 600, 4


def ahead(count: int = ROWS, bearings: tuple[float, ...] = (0.0, 0.7, 1.6, 2.5)) -> Beams:
    """Return beams at angles to the way, rad."""
    return Beams(np.tile(bearings, (count, 1)), np.full(len(bearings), 0.2), np.zeros(len(bearings)), 0.2, 5.0)


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
    got = find_silence(rows, wanted, 1, ahead()).applied(rows.ranges)
    assert (np.isposinf(got) == is_silent).mean() > 0.999
    np.testing.assert_array_equal(got[~is_silent], rows.ranges[~is_silent])


def test_of_few_ranges_the_greatest_is_silence_where_that_is_said() -> None:
    rows, _ = table(np.array([7.6]), 0.0)
    few = rows._replace(t=rows.t[:2], pose=rows.pose[:2], ranges=np.array([[1.0, np.nan], [np.nan, 2.0]]))
    assert find_silence(few, "max", 1, ahead(2)).applied(few.ranges)[1, 1] == np.inf


def test_a_number_is_exact_and_leaves_glitches_above_it() -> None:
    rows, _ = table(np.array([7.6]))
    rows.ranges[5, 0] = 34.0
    assert find_silence(rows, "7.6", 1, ahead()).applied(rows.ranges)[5, 0] == 34.0


@pytest.mark.parametrize(
    ("silent", "share"), [([0.0], 0.3), ([7.6], 0.3), (NOISY, 0.3), (NOISY, 0.04), ([1.2345], 0.04)]
)
def test_silence_is_found_in_ranges_without_inf(silent: Floats, share: float) -> None:
    rows, is_silent = table(np.array(silent), share)
    smooth = 2.0 + np.sin(0.01 * np.arange(ROWS))[:, None] + np.zeros(SENSORS)
    rows.ranges[~is_silent] = smooth[~is_silent]
    found = find_silence(rows, "auto", 1, ahead())
    assert found.words
    assert (np.isposinf(found.applied(rows.ranges)) == is_silent).mean() > 0.99


def test_no_silence_is_found_where_each_sensor_hears_something() -> None:
    rows, _ = table(np.array([1.0]), 0.0)
    assert not find_silence(rows, "auto", 1, ahead()).words


@pytest.mark.parametrize("wanted", ["auto", "max"])
def test_a_noisy_band_among_ranges_takes_few_of_them(wanted: str) -> None:
    """About as many values are taken wrongly as by the best interval about the true value."""
    rows, is_silent = table(NOISY, 0.4)
    rng = np.random.default_rng(3)
    rows.ranges[~is_silent] = rng.uniform(4.0, 7.75, int((~is_silent).sum()))
    got = np.isposinf(find_silence(rows, wanted, 1, ahead()).applied(rows.ranges))
    away = np.abs(rows.ranges - 7.6)
    least = min(int(((away <= half) != is_silent).sum()) for half in np.linspace(0.01, 0.3, 30))
    assert (got != is_silent).sum() < 1.15 * least


@pytest.mark.parametrize("spread", [0.003, 0.006, 0.15])
def test_a_ceiling_with_noise_and_glitches_above_it_is_found(spread: float) -> None:
    """With noise of one last digit most values are the same; a wide band, and one with glitches, were not found."""
    rng = np.random.default_rng(4)
    ceiling = np.round(7.6 + spread * rng.standard_normal(1000), 2)
    ceiling[:30] = np.round(rng.uniform(9.0, 30.0, 30), 2)
    rows, is_silent = table(rng.permutation(ceiling), 0.6)
    rows.ranges[:] = np.round(rows.ranges, 2)
    found = find_silence(rows, "auto", 1, ahead())
    got, is_glitch = np.isposinf(found.applied(rows.ranges)), rows.ranges > 9.0
    assert found.option == "max"
    assert got[is_silent & ~is_glitch].mean() > 0.995
    assert not got[~is_silent].any()


def test_glitches_of_zero_below_a_ceiling_are_refused_with_the_options_that_keep_both_apart() -> None:
    rows, _ = table(np.concatenate([NOISY, np.zeros(40)]), 0.6)
    with pytest.raises(RingLogError, match=r"are 0, and .*: say --silence max --not-fired 0 if 0 is no reading"):
        find_silence(rows, "auto", 1, ahead())
    assert find_silence(rows, "0", 1, ahead()).applied(rows.ranges).max() == np.inf
    few, _ = table(np.concatenate([NOISY[:300], np.zeros(700)]), 0.6)
    assert find_silence(few, "auto", 1, ahead()).option == "0", "more than those at the top"


def test_a_ceiling_with_more_noise_than_surfaces_have_is_refused_with_the_option() -> None:
    rows, is_silent = table(np.array([1.0]), 0.0)
    is_silent[: 4 * ROWS // 5] = True  # no leaps
    rows.ranges[is_silent] = 7.6 + 0.3 * np.random.default_rng(5).standard_normal(int(is_silent.sum()))
    with pytest.raises(
        RingLogError, match="say --silence max if that is no echo, or --silence inf if they are ranges"
    ):
        find_silence(rows, "auto", 1, ahead())
    assert (np.isposinf(find_silence(rows, "max", 1, ahead()).applied(rows.ranges)) == is_silent).mean() > 0.99


@pytest.mark.parametrize("sway_m", [0.0, 0.03, 0.05])
@pytest.mark.parametrize("repeated", [1, 4])
def test_a_wall_along_which_the_robot_sways_is_no_silence(sway_m: float, repeated: int) -> None:
    """The far wall of a corridor is at the top of all ranges, too, and was taken for silence or refused."""
    rng, rows = np.random.default_rng(6), table(np.array([1.0]), 0.0)[0]
    sways = sway_m * np.sin(rows.t[::repeated])
    sides = np.column_stack([2.15 + sways, 0.55 - sways, 2.15 + sways, 0.55 - sways])
    sides = np.repeat(sides + 0.01 * rng.standard_normal(sides.shape), repeated, axis=0)
    beams = ahead(bearings=(math.pi / 2, -math.pi / 2, math.pi / 2, -math.pi / 2))
    assert find_silence(rows._replace(ranges=np.round(sides, 3)), "auto", 1, beams).option == "inf"
