"""Whether a ring reports its greatest range where it hears nothing, as modules do that wait for an echo in vain.

An honest ring seldom hears a surface just there, and hears nothing beyond. So each reading in the last step of the
range is evidence, unless the surface that gave another one may have given it, too, and so is that no silence is ever
reported.
"""

from __future__ import annotations

import math
from typing import Final

from perception.angles import wrapped
from perception.kernel import kernel
from perception.records import Records
from perception.sensor_faults.memory import FARTHEST_KEPT, RingMemory, RingSetup, SensorLook
from perception.shared_numbers import SAME_ECHO_M

LOOK_NAT: Final = math.log(400.0)
"""Evidence of such a reading, and of a silence against it, nat: one step of a centimetre in 4 m."""
NEARER_NAT: Final = 0.0075
"""Evidence of a nearer echo against it, nat: the ring would report a silence in at least one of a hundred looks."""
NOTHING_NAT: Final = 3.5 * LOOK_NAT
"""Evidence that suffices, nat: looks in four directions, none of which is silent."""


@kernel
def may_be_same(x: float, y: float, axis: float, look: SensorLook, half_angle: float) -> bool:
    """Return whether one wall may lie in both beams, at one distance from both places.

    Parameters
    ----------
    x, y, axis : float
        The sensor's place (m) and direction (rad).
    look : record
        The other one.
    half_angle : float
        Half the beam's width, rad: the wall's normal lies within it from either axis.
    """
    turned = wrapped(axis - look.axis)
    apart = half_angle - 0.5 * abs(turned)
    if apart <= 0.0:
        return False
    dx, dy = x - look.x, y - look.y
    off = abs(abs(wrapped(look.axis + 0.5 * turned - math.atan2(dy, dx))) - 0.5 * math.pi)
    return math.hypot(dx, dy) * math.sin(max(0.0, off - apart)) < SAME_ECHO_M


@kernel
def stands_for_nothing(
    r: float, x: float, y: float, axis: float, setup: RingSetup, ring: Records[RingMemory]
) -> bool:
    """Take a reading, and return whether it is the ring's greatest range and stands for a silence.

    Parameters
    ----------
    r : float
        The reading, m; infinite without an echo.
    x, y, axis : float
        The sensor's place (m) and direction (rad).
    setup : RingSetup
        What is known of the ring beforehand.
    ring : (1,) record
        What is remembered of the ring. Updated.
    """
    all_of = ring[0]
    least, most = setup.last_step
    if not least <= r <= most:
        against = LOOK_NAT if math.isinf(r) else NEARER_NAT
        all_of.maximum_nat = max(0.0, all_of.maximum_nat - against)
        if all_of.maximum_nat == 0.0:
            all_of.is_maximum_nothing = all_of.farthest_looks = 0
        return False
    for k in range(min(all_of.farthest_looks, FARTHEST_KEPT)):
        if may_be_same(x, y, axis, all_of.farthest[k], setup.half_angle):
            return bool(all_of.is_maximum_nothing)
    new = all_of.farthest[all_of.farthest_looks % FARTHEST_KEPT]
    new.x, new.y, new.axis, new.range_m = x, y, axis, r
    all_of.farthest_looks += 1
    all_of.maximum_nat = min(all_of.maximum_nat + LOOK_NAT, 2.0 * NOTHING_NAT)
    if all_of.maximum_nat >= NOTHING_NAT:
        all_of.is_maximum_nothing = 1
    return bool(all_of.is_maximum_nothing)
