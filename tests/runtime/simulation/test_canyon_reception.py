"""Where on its way a robot first hears the back of a canyon."""

from __future__ import annotations

import pytest

from config.load import load_settings
from runtime.simulation.canyon_reception import back_heard_m
from runtime.simulation.canyon_worlds import canyon_world


@pytest.mark.compiled
def test_the_back_between_mirrors_is_heard_from_the_ring_s_range_on() -> None:
    settings = load_settings("hallway")
    reach_m = settings.ring.range_max_m + settings.body.radius_m
    places = [canyon_world(seed) for seed in range(40)]
    assert any(place.depth_m > 7.0 for place in places)
    for place in places:
        heard_m = back_heard_m(settings, place)
        along, _ = place.local(place.start.x, place.start.y)
        if reach_m - place.depth_m > -along + 0.1:
            assert heard_m == pytest.approx(-along), "from the start on"
        elif heard_m is not None:
            assert heard_m < reach_m - place.depth_m + 0.05
