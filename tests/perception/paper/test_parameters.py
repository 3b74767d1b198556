"""The numbers that tune the paper's method fit the shipped settings and leave room for what they bound."""

from __future__ import annotations

from config.load import load_settings
from perception.paper.parameters import PINNED_SHARE_MAX, READING_SPACING, SENSOR_READINGS_KEPT

PERCEPTION = load_settings("hallway").perception


def test_the_readings_kept_of_a_sensor_span_its_longest_baseline() -> None:
    """Otherwise no pair of readings would be far enough apart."""
    segments = PERCEPTION.segments
    assert (SENSOR_READINGS_KEPT - 1) * READING_SPACING * segments.baseline_min_m >= segments.baseline_max_m


def test_a_map_full_of_pins_still_has_room_for_a_cluster() -> None:
    free = (1.0 - PINNED_SHARE_MAX) * PERCEPTION.map.capacity
    assert free >= PERCEPTION.clusters.segments_min
