"""The mounts of the ring's sensors as an array, as the kernels take them, and how far the ring reaches."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from config.robot import RingConfig
from perception.kernel import Floats


def mounts_array(mounts: Sequence[tuple[float, float, float]]) -> Floats:
    """Return the mounts of all sensors in the ring's frame, shape (n, 3): x, y (m), direction (rad)."""
    return np.array(mounts, dtype=np.float64).reshape(len(mounts), 3)


def reach_m(ring: RingConfig) -> float:
    """Return the distance from the ring's centre to which every sensor without an echo shows free space, m."""
    return ring.window_m + min(m.x_m * math.cos(m.angle_rad) + m.y_m * math.sin(m.angle_rad) for m in ring.mounts)
