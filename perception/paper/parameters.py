"""The numbers that tune the paper's method and are no settings; `config.settings` has the others, the paper's own."""

from __future__ import annotations

from typing import Final

SENSOR_READINGS_KEPT: Final = 16
"""Readings kept of each sensor. They are a fraction of a baseline apart, so that they span several baselines."""
READING_SPACING: Final = 0.25
"""A reading is kept once its sensor has moved by this share of the shortest baseline since the last one kept."""
PINNED_SHARE_MAX: Final = 0.5
"""Share of the map's capacity that may be pinned: the rest keeps following what the robot hears."""
PLACEMENTS_MAX: Final = 32
"""Greatest number of placements, and of rejections, at a time: each placement is relaxed, which takes effort."""
