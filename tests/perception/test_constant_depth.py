"""Regions of constant depth: a surface's place from neighbouring bearings that hear the same range."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_robot
from config.robot import RingConfig
from drivers.messages import Firing, Pose
from perception.constant_depth import constant_depths
from perception.stand import surfaces_of_stand

RING = load_robot("servo1").ring
STEP = math.radians(6.0)


def stand(ranges: dict[int, float], ring: RingConfig = RING, rounds: int = 3) -> list[Firing]:
    """Return a stand in which these bearings hear these ranges, and the others nothing."""
    count = len(ring.mounts)
    firings = []
    for k in range(rounds * count):
        row = np.full(count, math.nan)
        row[k % count] = ranges.get(k % count, math.inf)
        firings.append(Firing(0.01 * k, Pose(0.0, 0.0, 0.0), 0.0, row))
    return firings


def test_a_surface_lies_in_the_middle_of_the_bearings_that_hear_the_same_range() -> None:
    (surface,) = surfaces_of_stand(RING, stand({28: 1.0, 29: 1.0, 30: 1.003, 31: 1.0, 32: 1.0}))
    assert surface.paths == 5
    assert surface.kind == "unknown"
    assert surface.echo.bearing == pytest.approx(0.0, abs=1e-9)
    assert surface.echo.range_m == pytest.approx(1.0206), "from the servo's axis"
    assert surface.place(Pose(0.0, 0.0, 0.0)) == pytest.approx((1.0206, 0.0))


def test_a_region_may_lie_over_the_end_of_a_turn_without_end() -> None:
    ((echo, paths),) = constant_depths(RING, stand({58: 1.2, 59: 1.2, 0: 1.2, 1: 1.2}))
    assert paths == 4
    assert math.remainder(echo.bearing - (RING.mounts[0].angle_rad - 0.5 * STEP), math.tau) == pytest.approx(0.0)


def test_strays_and_what_is_hidden_by_something_nearer_are_no_surfaces() -> None:
    assert constant_depths(RING, stand({10: 1.0, 20: 0.7, 21: 1.4})) == []
    drum = dict.fromkeys(range(26, 31), 0.8)
    beside = dict.fromkeys(range(31, 34), 1.3)
    ((echo, _),) = constant_depths(RING, stand(drum | beside))
    assert echo.range_m == pytest.approx(0.82)


def test_a_servo_that_goes_there_and_back_ends_at_its_ends() -> None:
    sensor = {"x_m": 0.1, "y_m": 0.0, "angle_deg": 0.0, "servo": True, "bearings": 31}
    half = RING.model_copy(
        update={"sensors": RingConfig.model_validate(RING.model_dump() | {"sensors": [sensor]}).sensors}
    )
    ((echo, paths),) = constant_depths(half, stand({13: 1.0, 14: 1.0, 15: 1.0, 16: 1.0, 17: 1.0}, half))
    assert paths == 5
    assert echo.bearing == pytest.approx(0.0, abs=1e-9)
    assert echo.range_m == pytest.approx(1.1)
