"""Numbers that several methods of perception share: what means no range, what differs by rounding, what is likely."""

from __future__ import annotations

import math
from typing import Final

FAR: Final = 1e6
"""A range of this much or more (m) means no echo."""
NO_RANGE: Final = -1.0
"""In place of a range (m) that a sensor does not have: recordings hold numbers."""
ROUNDING: Final = 1e-9
"""Angles (rad), lengths (m) and shares that differ by less are the same but for the rounding of one computation."""
OUTLIER_SIGMAS: Final = 3.0
"""What differs by more standard deviations than this is of something else."""
EVEN: Final = 0.5
"""Probability of what is as likely as everything else together."""
LIKELY: Final = 0.9
"""Probability from which on something is acted on."""
CERTAIN_PROBABILITY: Final = 0.95
"""Probability from which on something is certain."""
SAME_ECHO_M: Final = 0.3
"""Echoes that differ by less than this come from the same place, m."""
TOLERANCE_MIN_M: Final = 0.005
"""Ranges that differ by less are equal, also of rings that do not quantise, m."""
BESIDE_MAX_RAD: Final = math.radians(60.0)
"""Greatest angle between a surface's normal and a beam's edge at which the edge may still hear it."""
NORMAL_DIRECTIONS: Final = 360
"""Directions of normals in which walls are looked for."""
READING_M: Final = 0.1
"""Readings of one sensor from poses nearer than this, in heading than `READING_RAD`, have the same error."""
READING_RAD: Final = math.radians(6.0)
"""Difference of headings in `READING_M`."""
