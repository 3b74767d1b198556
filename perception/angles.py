"""Angles in kernels; `drivers.messages.wrap_angle` is the same outside of them."""

from __future__ import annotations

import math

from perception.kernel import kernel


@kernel
def wrapped(angle: float) -> float:
    """Return an angle wrapped into [−π, π), rad."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
