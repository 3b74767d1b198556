"""Refuse firing patterns, valid by schema, that the ring or the wire protocol cannot carry out."""

from __future__ import annotations

from config.robot import RingConfig
from drivers.denning.wire_units import wire_pattern


def refuse_impossible_firing(ring: RingConfig) -> None:
    """Raise `drivers.firing_pattern.FiringError` if the ring cannot carry out its firing pattern."""
    wire_pattern(ring)
