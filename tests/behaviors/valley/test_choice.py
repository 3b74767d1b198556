"""Valleys, their candidate directions, and the costs by which one is chosen."""

from __future__ import annotations

import numpy as np
import pytest

from behaviors.valley.choice import apart, candidates, cheapest, gaps, valleys
from behaviors.valley.polar_histogram import SECTORS
from config.behaviors import FollowValleyConfig

ALL_FREE = bytes(SECTORS)
CONFIG = FollowValleyConfig()


def blocked(*free: range) -> bytes:
    flags = np.ones(SECTORS, dtype=np.bool_)
    for run in free:
        flags[np.array(run) % SECTORS] = False
    return flags.tobytes()


def test_the_angle_between_directions_goes_the_short_way() -> None:
    assert apart(1.0, 71.0) == 2.0
    assert apart(-3.0, 72.0) == 3.0
    assert apart(10.0, 46.0) == 36.0


@pytest.mark.parametrize("seed", range(10))
def test_valleys_are_the_runs_of_free_sectors(seed: int) -> None:
    flags = np.random.default_rng(seed).random(SECTORS) < 0.5
    found = valleys(flags.tobytes())
    assert (
        sorted((first + k) % SECTORS for first, count in found for k in range(count))
        == np.flatnonzero(~flags).tolist()
    )
    for first, count in found:
        assert flags[first - 1]
        assert flags[(first + count) % SECTORS]


def test_all_free_and_none_free() -> None:
    assert valleys(ALL_FREE) == [(0, SECTORS)]
    assert candidates(ALL_FREE, 12.3, 8.0) == [12.3]
    assert valleys(blocked()) == []
    assert candidates(blocked(), 12.3, 8.0) == []
    assert cheapest([], 1.0, 1.0, None, ALL_FREE, CONFIG) is None


def test_a_narrow_valley_is_driven_in_the_middle_and_a_wide_one_beside_its_borders() -> None:
    assert candidates(blocked(range(10, 15)), 40.0, 8.0) == [12.0]
    assert candidates(blocked(range(70, 75)), 40.0, 8.0) == [0.0]
    assert candidates(blocked(range(10, 30)), 40.0, 8.0) == [13.5, 25.5]
    assert candidates(blocked(range(10, 30)), 20.25, 8.0) == [13.5, 25.5, 20.25]
    assert candidates(blocked(range(65, 85)), 1.0, 8.0) == [68.5, 8.5, 1.0]


def test_a_gap_is_a_valley_that_is_nowhere_as_wide_as_wanted() -> None:
    assert gaps(blocked(range(10, 15)), blocked()) == [12.0]
    assert gaps(blocked(range(70, 75)), blocked()) == [0.0]
    assert gaps(blocked(range(10, 15), range(30, 50)), blocked(range(40, 45))) == [12.0], "the other has a wide part"
    assert gaps(ALL_FREE, blocked()) == []
    assert gaps(blocked(), blocked()) == []


def test_the_target_outweighs_heading_and_last_choice_but_does_not_flip_between_equal_ways() -> None:
    assert cheapest([5.0, 15.0], 6.0, 20.0, 20.0, ALL_FREE, CONFIG) == 5.0
    assert cheapest([10.0, 62.0], 0.0, 0.0, 10.0, ALL_FREE, CONFIG) == 10.0
    assert cheapest([10.0, 62.0], 0.0, 0.0, 62.0, ALL_FREE, CONFIG) == 62.0


def test_a_near_pass_costs() -> None:
    near = blocked(range(3))
    assert cheapest([4.0, 2.0], 4.0, 4.0, None, near, CONFIG.model_copy(update={"near_cost": 100.0})) == 2.0
    assert cheapest([4.0, 2.0], 4.0, 4.0, None, near, CONFIG.model_copy(update={"near_cost": 0.0})) == 4.0
