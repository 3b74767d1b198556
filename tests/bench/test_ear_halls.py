"""The drives of the comparison with and without listening sensors."""

from __future__ import annotations

import math
from itertools import islice

import numpy as np
import pytest

from bench.ear_halls import early_percent, firings, is_drum, is_placed, octets, poses, rings, settings_of
from perception.detected_object import DetectedObject
from runtime.simulation.scenes import SPEED_M_S, halls

HALL = halls("moved", 3)[0]


def test_the_ring_drives_on_while_it_fires_step_by_step() -> None:
    times, places, _ = zip(*poses(HALL, 0.03), strict=True)
    assert np.diff(times) == pytest.approx(0.03)
    assert np.diff([place.x for place in places]) == pytest.approx(0.03 * SPEED_M_S)
    random = halls("halls", 5)[0]
    *_, (_, last, yaw) = poses(random, 0.03)
    assert math.dist((last.x, last.y), random.path[-1][:2]) < 0.02
    assert yaw == pytest.approx(random.path[-1][2], abs=0.2)


def test_each_firing_has_what_its_sensors_and_listeners_heard() -> None:
    first = next(firings(rings()["ears"], HALL, 1))
    assert np.flatnonzero(~np.isnan(first.ranges_m)).tolist() == [0, 12]
    assert first.cross_paths is not None
    assert len(first.cross_paths.half_paths_m) == 16
    assert set(first.cross_paths.transmitters.tolist()) == {0, 12}
    deaf, eared = (list(islice(firings(rings()[name], HALL, 1), 40)) for name in ("ears, no listeners", "ears"))
    assert all(firing.cross_paths is None for firing in deaf)
    assert all(np.array_equal(a.ranges_m, b.ranges_m, equal_nan=True) for a, b in zip(deaf, eared, strict=True)), (
        "the same seed, the same noise"
    )


def test_octets_are_heard_by_the_other_sixteen_or_by_none() -> None:
    with_listeners, alone = (next(firings(ring, HALL, 1)) for ring in octets().values())
    assert np.flatnonzero(~np.isnan(with_listeners.ranges_m)).tolist() == list(range(0, 24, 3))
    assert with_listeners.cross_paths is not None
    assert len(set(with_listeners.cross_paths.listeners.tolist())) == 16
    assert alone.cross_paths is None
    assert np.array_equal(with_listeners.ranges_m, alone.ranges_m, equal_nan=True)


def test_a_post_is_no_drum() -> None:
    drum = HALL.world.drum[0]
    seen = DetectedObject("drum", drum.x_m + 0.1, drum.y_m, 0.0, 0.01, 9, 1.0)
    assert is_drum(seen, HALL.world.drum, (drum.radius_m,))
    assert not is_drum(seen, HALL.world.drum, (drum.radius_m + 0.1,))


def test_a_place_may_be_sure_before_the_kind_is_and_walls_have_none() -> None:
    assert is_placed(DetectedObject("unknown", 0.0, 0.0, 0.0, 0.05, 9, 0.5))
    assert not is_placed(DetectedObject("unknown", 0.0, 0.0, 0.0, 0.06, 9, 0.5))
    assert not is_placed(DetectedObject("wall", 0.0, 0.0, 0.0, 0.01, 9, 1.0))


def test_a_fix_four_feet_ahead_is_early_and_none_is_late() -> None:
    assert early_percent([1.3, 1.2192, 1.1, None]) == 50.0
    assert math.isnan(early_percent([]))


def test_a_drum_may_have_to_be_surer_than_by_the_settings() -> None:
    ring = rings()["ears"]
    assert settings_of(ring).perception.bayes.report_probability == 0.95
    bayes = settings_of(ring, 0.99).perception.bayes
    assert (bayes.report_probability, bayes.report_probability_near) == (0.99, 0.99)
