"""What a `sensor_msgs/Range` says, by REP 117 and by the habits of nodes that do not keep to it.

+inf is silence, -inf something too near to measure, NaN an error. Many nodes send the greatest range for silence, and
0 for silence or an error. A value below the least range says nothing of a distance, so it is no obstacle at any.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Final, NamedTuple

UNUSED: Final = math.nan


class Oddity(Enum):
    """Why a reading is not used, and what to do, for one line of the log."""

    ZERO = (
        "{frame} reports a range of 0 or below, which REP 117 has not; such readings are not used; if they mean that "
        "nothing was heard, set ros2.zero_is_silence = true in the robot file"
    )
    BELOW = (
        "{frame} reports ranges below its least one, {least_m:g} m; such readings are not used: correct "
        "ring.range_min_m or the sensor's min_range"
    )
    TOO_NEAR = (
        "{frame} reports -inf: something is too near to measure (REP 117); such readings are not used, for they have "
        "no distance"
    )


class Limits(NamedTuple):
    """The least and the greatest range of a sensor, m, as its messages say; any number."""

    least_m: float
    greatest_m: float

    @property
    def are_known(self) -> bool:
        """Whether ranges can lie between them; those of a ranger with a fixed distance are equal."""
        return math.isfinite(self.greatest_m) and 0.0 <= self.least_m < self.greatest_m


class Meaning(NamedTuple):
    """What a reading says."""

    range_m: float
    """inf = silence, NaN = nothing that can be used."""
    oddity: Oddity | None = None
    least_m: float = 0.0
    """The least range that can be measured, m."""


def range_meaning(value: float, ring: Limits, sensor: Limits, unit_m: float, *, zero_is_silence: bool) -> Meaning:
    """Return what the range of a message means.

    The limits are those of the robot file and `min_range` and `max_range` of the message, which count only if ranges
    can lie between them. Ranges that round to the same multiple of `unit_m` are the same. `zero_is_silence`: 0 and
    negative numbers stand for silence.
    """
    both = (ring, sensor) if sensor.are_known else (ring,)
    least_m, greatest_m = max(limits.least_m for limits in both), min(limits.greatest_m for limits in both)
    if math.isnan(value):
        return Meaning(UNUSED)
    if value == -math.inf:
        return Meaning(UNUSED, Oddity.TOO_NEAR)
    if value <= 0.0:
        return Meaning(math.inf) if zero_is_silence else Meaning(UNUSED, Oddity.ZERO)
    if value > greatest_m - 0.5 * unit_m:
        return Meaning(math.inf)
    if value < least_m - 0.5 * unit_m:
        return Meaning(UNUSED, Oddity.BELOW, least_m)
    return Meaning(value)
