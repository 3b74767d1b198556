"""Capacities of the memory that depend on one another."""

from __future__ import annotations

from perception.bayes.memory import elements
from perception.bayes.memory.settings_record import CIRCLES_MAX
from perception.bayes.memory.state import CircleTrack, PolygonTrack, State


def test_the_readings_of_any_track_fit_where_they_are_copied_to() -> None:
    circle, polygon, state = CircleTrack.DTYPE, PolygonTrack.DTYPE, State.DTYPE
    kept = [dtype["bins"].shape[0] * dtype["bins"].base["readings"].shape[0] for dtype in (circle, polygon)]
    assert kept[0] == elements.BEARING_BINS * elements.BIN_CAPACITY <= elements.COMPARED_MAX
    assert kept[1] <= elements.COMPARED_MAX
    assert kept[1] == state["job_readings"].shape[0]
    assert state["scratch"]["readings"].shape[0] == elements.COMPARED_MAX


def test_the_map_is_hashed_by_a_mask_so_its_buckets_are_a_power_of_two() -> None:
    assert elements.BUCKETS.bit_count() == 1


def test_every_radius_a_line_and_a_corner_have_a_place_among_the_alternatives() -> None:
    assert CircleTrack.DTYPE["leads"].shape[0] == elements.ALTERNATIVES_MAX == CIRCLES_MAX + 2
