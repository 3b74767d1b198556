"""Noise model given to the peers: one figure for all scenes, as the user of one robot would have."""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M

RANGE_SIGMA_M: Final = math.hypot(0.1 / math.sqrt(12.0), 0.03) * FOOT_M
"""Standard deviation of a range: rounding to 0.1 ft, and 0.03 ft of noise."""
INITIAL_SIGMA_M: Final = 0.5 * FOOT_M
"""Standard deviation of the first estimate of a drum's centre."""
