"""Repeats are found in sources that give last values, and in no honest one; what repeats did not fire."""

from __future__ import annotations

import numpy as np
import pytest

from config.robot import FiringConfig, RingConfig
from drivers.driver import Received
from drivers.latched_ranges import NOTE, FreshDriver, RepeatDetector, RepeatFilter
from drivers.messages import Firing, Floats, Pose

SENSORS = 8


def fresh_rows(count: int, step_m: float, noise_m: float, seed: int) -> Floats:
    """Return rows of a ring of which every sensor fires: slow waves, quantised."""
    rng = np.random.default_rng(seed)
    t = np.arange(count)[:, None]
    waves = 2.0 + np.sin(0.002 * t * (1.0 + np.arange(SENSORS)) + np.arange(SENSORS))
    rows: Floats = np.round((waves + noise_m * rng.standard_normal(waves.shape)) / step_m) * step_m
    return rows


def held(rows: Floats, every: int) -> Floats:
    """Return rows in which sensor j takes a new value where (row + j) is divisible by `every`."""
    out = rows.copy()
    for k in range(1, len(rows)):
        fires = (k + np.arange(SENSORS)) % every == 0
        out[k] = np.where(fires, rows[k], out[k - 1])
    return out


def period(rows: Floats) -> int:
    detector = RepeatDetector(SENSORS)
    for row in rows:
        detector.add(row)
    return detector.period


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.soak) for k in (1, 2))])
@pytest.mark.parametrize("step_m", [0.001, 0.01, 0.03048])
@pytest.mark.parametrize("noise_m", [0.0, 0.005, 0.03])
def test_no_honest_ring_is_taken_for_latched(step_m: float, noise_m: float, seed: int) -> None:
    rows = fresh_rows(2000, step_m, noise_m, seed)
    assert period(rows) == 1
    assert period(np.repeat(rows[:1], 500, axis=0)) == 1, "a robot at rest, or a frozen ring"
    in_turn = np.where((np.arange(2000)[:, None] + np.arange(SENSORS)) % 4 == 0, rows, np.nan)
    assert period(in_turn) == 1


@pytest.mark.parametrize("every", [2, 3, 7, 20])
def test_last_values_are_found(every: int) -> None:
    assert period(held(fresh_rows(4000, 0.001, 0.01, 1), every)) == every


def at(t: float, ranges: Floats) -> Firing:
    return Firing(t, Pose(0.0, 0.0, 0.0), 0.0, ranges)


def test_only_changes_remain() -> None:
    changes, nan, inf = RepeatFilter(2, 0.3), np.nan, np.inf
    rows = ([1.0, inf], [1.0, 2.0], [nan, 2.0], [1.5, 2.0])
    got = [changes.fresh(at(0.1 * k, np.array(row))).ranges_m for k, row in enumerate(rows)]
    np.testing.assert_array_equal(got, [[nan, nan], [nan, 2.0], [nan, nan], [1.5, nan]])


def test_silence_counts_once_a_cycle() -> None:
    changes = RepeatFilter(1, 0.3)
    got = [changes.fresh(at(0.1 * k, np.array([1.0 if k == 0 else np.inf]))).ranges_m[0] for k in range(9)]
    assert np.flatnonzero(np.isposinf(got)).tolist() == [1, 4, 7]


class Scripted:
    """A driver that has one firing at a time."""

    def __init__(self, rows: Floats) -> None:
        self._rows = iter(rows)
        self.at_s, self.rebooted = 0.0, False

    def set_firing(self, _ring: RingConfig) -> None:
        """Take it."""

    def take_received(self) -> Received:
        return Received((at(self.at_s, next(self._rows)),), None, rebooted=self.rebooted)


def test_a_live_source_of_last_values_is_said_once_and_a_frozen_one_has_not_fired() -> None:
    rows = held(fresh_rows(2000, 0.001, 0.01, 2), 3)
    frozen = np.repeat(rows[-1:], 50, axis=0)
    driver = FreshDriver(Scripted(np.concatenate([rows, frozen])), SENSORS, 2, 0.0)  # type: ignore[arg-type]  # only what is used
    received = [driver.take_received() for _ in range(2050)]
    assert [note for one in received for note in one.notes] == [NOTE]
    late = np.array([one.firings[0].ranges_m for one in received])
    assert np.isfinite(late[1000:2000]).mean() == pytest.approx(1 / 3, abs=0.02)
    assert np.isnan(late[2000:]).all(), "nothing usable: the robot must not drive on"


def test_silence_of_a_live_source_is_passed_on() -> None:
    rows = held(fresh_rows(2000, 0.001, 0.01, 2), 3)
    silent = np.full((50, SENSORS), np.inf)
    driver = FreshDriver(Scripted(np.concatenate([rows, silent])), SENSORS, 2, 0.0)  # type: ignore[arg-type]  # only what is used
    got = np.array([driver.take_received().firings[0].ranges_m for _ in range(2050)])
    assert np.isposinf(got[2000:]).all()


def test_silence_after_a_restart_of_the_source_is_passed_on() -> None:
    """Its times begin at zero again: silence must not wait until they pass those from before."""
    changes = held(fresh_rows(2000, 0.001, 0.01, 2), 3)
    silent = np.full((50, SENSORS), np.inf)
    source = Scripted(np.concatenate([changes, silent, silent]))
    driver = FreshDriver(source, SENSORS, 2, 0.3)  # type: ignore[arg-type]  # only what is used
    for k in range(2050):
        source.at_s = 0.1 * k
        driver.take_received()
    source.rebooted = True
    got = []
    for k in range(50):
        source.at_s = 0.1 * k
        got.append(driver.take_received().firings[0].ranges_m)
        source.rebooted = False
    assert np.isnan(got[0]).all(), "of a first firing nothing is known to be new"
    assert np.isposinf(got).any(axis=0).all()


def test_silence_counts_once_in_the_cycle_of_a_changed_pattern() -> None:
    changes = held(fresh_rows(2000, 0.001, 0.01, 2), 3)
    source = Scripted(np.concatenate([changes, np.full((50, SENSORS), np.inf)]))
    driver = FreshDriver(source, SENSORS, 2, 0.1)  # type: ignore[arg-type]  # only what is used
    firing = FiringConfig(sets=((0,),), rotations=SENSORS, step_period_s=1.0 / SENSORS)
    ring = RingConfig(count=SENSORS, radius_m=0.2, beam_half_angle_deg=10.0, resolution_m=0.0, range_min_m=0.1,
                      range_max_m=9.0, firing=firing)  # fmt: skip
    heard = []
    for k in range(2050):
        source.at_s = 0.1 * k
        if k == 2000:
            driver.set_firing(ring)
        heard.append(driver.take_received().firings[0].ranges_m)
    assert np.isposinf(heard[2000:]).sum(axis=0).tolist() == [5] * SENSORS, "5 s of silence, one cycle a second"


def test_a_frozen_ring_that_was_fresh_is_passed_on_for_the_monitor() -> None:
    rows = fresh_rows(1000, 0.001, 0.01, 3)
    frozen = np.repeat(rows[-1:], 500, axis=0)
    driver = FreshDriver(Scripted(np.concatenate([rows, frozen])), SENSORS, 2, 0.0)  # type: ignore[arg-type]  # only what is used
    got = np.array([driver.take_received().firings[0].ranges_m for _ in range(1500)])
    np.testing.assert_array_equal(got, np.concatenate([rows, frozen]))


def test_firings_of_no_more_sensors_than_fire_at_once_are_passed_on() -> None:
    """A source that gives what fired, with a value that stands: nothing is old."""
    rows = held(fresh_rows(2000, 0.001, 0.01, 2), 3)
    driver = FreshDriver(Scripted(rows), SENSORS, SENSORS, 0.0)  # type: ignore[arg-type]  # only what is used
    received = [driver.take_received() for _ in range(2000)]
    np.testing.assert_array_equal(np.array([one.firings[0].ranges_m for one in received]), rows)
    assert not any(one.notes for one in received)
