"""The Denning's ring, as the tests of the drivers have it."""

from __future__ import annotations

from config.robot import FiringConfig, RingConfig

RING = RingConfig(
    count=24,
    radius_m=0.381,
    beam_half_angle_deg=12.0,
    resolution_m=0.03048,
    range_min_m=0.1524,
    range_max_m=7.7724,
    firing=FiringConfig(preset="octets"),
)
