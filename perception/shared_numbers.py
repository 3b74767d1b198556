"""Numbers that several packages of perception share, each with one meaning everywhere."""

from __future__ import annotations

import math
from typing import Final

FAR: Final = 1e6
"""A range of this much or more (m) means no echo."""
PASSED_M: Final = 0.3
"""A range that is longer than to a surface by this (m) has passed it."""
SILENCE_M: Final = 2.5
"""Way that silence shows to be clear, m: mirrors are silent, too."""
SAME_ECHO_M: Final = 0.3
"""Echoes that differ by less than this come from the same place, m."""
READING_M: Final = 0.1
"""Readings of one sensor from places nearer than this have the same error, unless it has turned (`READING_RAD`)."""
READING_RAD: Final = math.radians(6.0)
"""Difference of headings in `READING_M`."""
SPACING_M: Final = 0.02
"""A sensor that has moved by less than this, and hardly turned, says the same again."""
ROUNDING: Final = 1e-9
"""Angles (rad) and lengths (m) that differ by less are the same but for the rounding of one computation."""
OUTLIER_SIGMAS: Final = 3.0
"""What is off by more standard deviations than this is of something else, and counts as that far in a mean."""
EVEN: Final = 0.5
"""Probability of what is as likely as everything else together, and of what nothing is known of."""
CERTAIN_PROBABILITY: Final = 0.95
"""Probability from which on an object, or the kind of a surface, is certain."""
OUTLIER: Final = 0.005
"""Weight of an echo from nowhere, beside the probabilities to answer of the places on its arc."""
LEAST_READINGS: Final = 0.5
"""Readings that every cell has without having been looked at."""
ODOMETER_SIGMA: Final = 0.03
"""Standard deviation of the odometer's scale at the start."""
BESIDE_MAX_RAD: Final = math.radians(60.0)
"""Greatest angle between a surface's normal and a beam's edge at which the edge may still hear it."""
NORMAL_DIRECTIONS: Final = 360
"""Directions of normals in which walls are looked for."""
NO_INDEX: Final = -1
"""In place of the index of something where there is none."""
NO_NUMBER: Final = 0
"""In place of the number of an object or a place; none has this one."""
