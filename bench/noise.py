"""What the peers are told of the readings' noise: one figure for all scenes, as a user of one robot would have."""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M

RANGE_SIGMA_M: Final = math.hypot(0.1 / math.sqrt(12.0), 0.03) * FOOT_M
"""Rounding to a tenth of a foot, and some."""
GUESS_SIGMA_M: Final = 0.5 * FOOT_M
"""Of the first guess of a drum's centre."""
