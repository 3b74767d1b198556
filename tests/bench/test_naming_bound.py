"""The bound of what any rule names in time, against cases to work out by hand."""

from __future__ import annotations

from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest

from bench.ear_halls import rings
from bench.naming_bound import NAMED, drive, heard_of, named_too
from runtime.simulation.first_fix import EARLY_FIX_M
from runtime.simulation.scenes import halls


def test_with_one_place_the_share_is_that_of_two_normal_distributions() -> None:
    normal = NormalDist()
    for d in (0.1, 0.7, 2.0, 5.0):
        assert named_too([d, d]) == pytest.approx(normal.cdf(normal.inv_cdf(NAMED) - d), abs=1e-9)


def test_rivals_that_look_like_a_drum_are_named_as_often_and_others_never() -> None:
    assert named_too([1e-3]) == pytest.approx(NAMED, abs=1e-3)
    assert named_too([9.0]) < 1e-9
    mixed = named_too([0.5, 3.0])
    assert named_too([3.0]) < mixed < named_too([0.5])


def test_only_what_was_heard_in_time_over_the_drum_counts() -> None:
    hall, ring = halls("moved", 3)[0], rings()["ears"]
    drum, paths = hall.world.drum[0], drive(ring, hall)
    t, l = heard_of(paths, drum, ring.resolution_m)  # noqa: E741
    assert len(t) == len(l) > 50
    assert t.real.max() < drum.x_m - EARLY_FIX_M + (ring.radius_m or 0.0)
    assert np.count_nonzero(t == l) > 10
    assert abs(t - l).max() < 2.0 * (ring.radius_m or 0.0)


def test_a_nearer_drum_keeps_a_farther_one_from_being_heard() -> None:
    hall, ring = halls("moved", 3)[0], rings()["ears"]
    far = max(hall.world.drum, key=lambda drum: drum.x_m)
    alone = replace(hall, world=hall.world.model_copy(update={"drum": (far,)}))
    among, by_itself = (len(heard_of(drive(ring, one), far, ring.resolution_m)[0]) for one in (hall, alone))
    assert among < 0.5 * by_itself
