"""The mounts of a ring as an array."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from config.load import load_settings
from perception.sensor_mounts import mounts_array, reach_m, turn_mounts, turned_mounts

DATA = Path(__file__).parents[1] / "data"


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


def test_a_silence_shows_free_space_up_to_the_nearest_end_of_a_window() -> None:
    ring = load_settings("hallway", ["ring.firing.window_m=3"]).ring
    assert reach_m(ring) == pytest.approx(3.381)
    sensors = "[{x_m=0.2, y_m=0.1, angle_deg=90}, {x_m=0.2, y_m=0.0, angle_deg=0}]"
    irregular = load_settings(DATA / "corridor.toml", [f"ring.sensors={sensors}", "ring.firing.sets=[[0, 1]]"]).ring
    assert reach_m(irregular) == pytest.approx(5.1)


def test_the_mounts_that_turn_are_the_same_in_place_and_in_a_new_array() -> None:
    mounts = mounts_array(load_settings("hallway").ring.mounts)
    turned, turning = np.zeros_like(mounts), (0, 5, 7)
    turn_mounts(mounts, np.isin(np.arange(24), turning), 0.7, turned)
    np.testing.assert_allclose(turned, turned_mounts(mounts, turning, 0.7), atol=1e-12)
