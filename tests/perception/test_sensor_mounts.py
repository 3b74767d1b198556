"""The mounts of a ring as an array."""

from __future__ import annotations

import numpy as np
import pytest

from config.load import load_settings
from perception.sensor_mounts import mounts_array


def test_a_row_is_place_and_direction() -> None:
    array = mounts_array([(0.1, 0.2, 0.3), (1.0, 2.0, 3.0)])
    assert array.dtype == np.float64
    assert array.tolist() == [[0.1, 0.2, 0.3], [1.0, 2.0, 3.0]]
    assert mounts_array([]).shape == (0, 3)


def test_the_shipped_ring_looks_outward() -> None:
    ring = load_settings("hallway").ring
    array = mounts_array(ring.mounts)
    assert array.shape == (24, 3)
    assert ring.radius_m is not None
    np.testing.assert_allclose(np.hypot(array[:, 0], array[:, 1]), ring.radius_m)
    outward = np.cos(np.arctan2(array[:, 1], array[:, 0]) - array[:, 2])
    assert outward == pytest.approx(np.ones(24))
