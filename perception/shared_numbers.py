"""Numbers that several methods of perception share: what means no range, what differs by rounding, what is likely."""

from __future__ import annotations

import math
from typing import Final

FAR: Final = 1e6
"""A range of this much or more (m) means no echo; no robot drives so far."""
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
PASSED_M: Final = 0.3
"""A range that is longer than to a surface by this (m) has passed it."""
SILENCE_M: Final = 2.5
"""Way that silence shows to be clear, m: mirrors are silent, too."""
OUTLIER: Final = 0.005
"""Weight of an echo from nowhere, beside the probabilities to answer of the places on its arc."""
LEAST_READINGS: Final = 0.5
"""Readings that every cell has without having been looked at."""
ODOMETER_SIGMA: Final = 0.03
"""Standard deviation of the odometer's scale at the start."""
SPACING: Final = 0.02
"""A sensor that moved (m) and turned (rad) by less than this says the same again."""
BLOCK: Final = 16
"""Cells along the edge of a block of a grid."""
BEYOND_ALL: Final = 1e9
"""In place of a range (m), misfit, priority or evidence (nat) that is not known, as it is greater than all of
them."""
TINY: Final = 1e-200
"""Least divisor, and least number of which a logarithm is taken: an impossible value gives a number, not an error."""
NO_INDEX: Final = -1
"""In place of the index of something where there is none."""
NO_NUMBER: Final = 0
"""In place of the number of an object or a place; none has this one."""
