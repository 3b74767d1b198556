"""The mounts of the ring's sensors as an array, as the kernels take them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from perception.kernel import Floats


def mounts_array(mounts: Sequence[tuple[float, float, float]]) -> Floats:
    """Return the mounts of all sensors in the ring's frame, shape (n, 3): x, y (m), direction (rad)."""
    return np.array(mounts, dtype=np.float64).reshape(len(mounts), 3)
