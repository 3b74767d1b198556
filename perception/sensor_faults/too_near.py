"""Whether a sensor reads below its least range: something touches it, or the reading stands for nothing."""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import kernel
from perception.records import Records
from perception.sensor_faults.memory import TOO_NEAR_READINGS, RingMemory, SensorMemory
from perception.sensor_faults.report import TOO_NEAR

TOO_NEAR_NAT: Final = math.log(0.2 / 0.05)
"""Evidence of a reading below the least range that the ring gives them for nothing, nat: then one in five is so; by
strays, fewer than one in twenty."""
POSSIBLE_NAT: Final = math.log(0.95 / 0.8)
"""Evidence of any other reading against it, nat."""
ALL_TOO_NEAR_NAT: Final = math.log(1e9)
"""Such evidence that suffices, nat."""


@kernel
def count_too_near(c: SensorMemory, is_too_near: bool, ring: Records[RingMemory]) -> None:
    """Set or clear a sensor's fault `TOO_NEAR`, given whether its reading is below the least that it can measure.

    An object so near that the sensor rings on looks the same, and must not be driven at either. Where other sensors
    also give such readings now and then, less of them suffice: they stand for nothing that is there.
    """
    if is_too_near and c.faults & TOO_NEAR == 0:
        ring[0].too_near_nat = min(ring[0].too_near_nat + TOO_NEAR_NAT, 2.0 * ALL_TOO_NEAR_NAT)
        if ring[0].too_near_nat >= ALL_TOO_NEAR_NAT:
            c.too_near = TOO_NEAR_READINGS
    elif not is_too_near:
        ring[0].too_near_nat = max(0.0, ring[0].too_near_nat - POSSIBLE_NAT)
    c.too_near = min(TOO_NEAR_READINGS, c.too_near + 1) if is_too_near else max(0, c.too_near - 1)
    if c.too_near == TOO_NEAR_READINGS:
        c.faults |= TOO_NEAR
    elif c.too_near == 0:
        c.faults &= ~TOO_NEAR
