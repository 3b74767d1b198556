"""Angles in kernels; `drivers.messages.wrap_angle` is the same outside of them."""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import kernel

SAME_RAD: Final = 1e-6
"""Directions that differ by less are the same: poses and mounts are rounded."""


@kernel
def wrapped(angle: float) -> float:
    """Return an angle wrapped into [−π, π), rad."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
