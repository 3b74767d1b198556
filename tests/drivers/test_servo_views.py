"""Sensors and bearings of rings with servos, and the mounts that they are taken for."""

from __future__ import annotations

import math
from typing import Any

import pytest

from config.robot import RingConfig
from drivers.firing_pattern import FiringError, firing_pattern, sensor_masks, sensors
from drivers.servo_views import ServoViews
from tests.drivers.ring import RING

SERVO: dict[str, Any] = {"x_m": 0.1, "y_m": 0.0, "angle_deg": 0.0, "servo": True}
FIXED: dict[str, Any] = {"x_m": -0.1, "y_m": 0.0, "angle_deg": 180.0}


def ring(*listed: dict[str, Any], **firing: Any) -> RingConfig:
    return RingConfig.model_validate({
        "sensors": listed, "beam_half_angle_deg": 15.0, "resolution_m": 0.003, "range_min_m": 0.02,
        "range_max_m": 1.7, "firing": firing or {"preset": "single", "step_period_s": 0.01},
    })  # fmt: skip


def test_a_sensor_on_a_servo_is_one_mount_for_each_bearing() -> None:
    views = ServoViews(ring(FIXED, {**SERVO, "bearings": 5, "arm_m": 0.02}))
    assert (views.count, views.sensor_of, views.on_servo) == (6, (0, 1, 1, 1, 1, 1), (False, True))
    assert [math.degrees(views.bearing(k)) for k in range(1, 6)] == pytest.approx([-90.0, -45.0, 0.0, 45.0, 90.0])
    mounts = ring({**SERVO, "bearings": 5, "arm_m": 0.02}).mounts
    assert mounts[0][:2] == pytest.approx((0.1, -0.02))
    assert mounts[2][:2] == pytest.approx((0.12, 0.0))
    assert (views.begin(0), views.begin(1)) == (0, 1)


def test_a_turn_without_end_has_its_first_bearing_once() -> None:
    endless = ring({**SERVO, "bearings": 60, "sweep_deg": 360.0})
    assert len({round(math.remainder(m.angle_rad, math.tau), 9) for m in endless.mounts}) == 60
    assert min(abs(m.angle_rad) for m in endless.mounts) == pytest.approx(0.0, abs=1e-12)


def test_a_bearing_belongs_to_the_nearest_mount_of_its_sensor() -> None:
    views = ServoViews(ring(FIXED, {**SERVO, "bearings": 5}))
    assert views.mount(0) == 0
    assert views.mount(1, math.radians(46.0)) == 4
    assert views.mount(1, math.radians(-90.0) - math.tau) == 1
    assert views.mount(1, math.radians(180.0)) is None, "the servo does not go there"
    assert views.mount(1) is None, "without a bearing"


def test_the_scan_of_a_servo_is_the_firing_pattern() -> None:
    there_and_back = firing_pattern(ring(SERVO | {"bearings": 4})).masks
    assert [sensors(mask) for mask in there_and_back] == [(0,), (1,), (2,), (3,), (2,), (1,)]
    endless = firing_pattern(ring(SERVO | {"bearings": 4, "sweep_deg": 360.0})).masks
    assert [sensors(mask) for mask in endless] == [(0,), (1,), (2,), (3,)]
    mixed = ring(SERVO | {"bearings": 3}, FIXED, sets=[[0, 1], [0]], step_period_s=0.01)
    assert [sensors(mask) for mask in firing_pattern(mixed).masks] == [(0, 3), (1,), (2, 3), (1,)]
    assert sensor_masks(mixed) == (0b11, 0b01), "as the wire has it"


def test_scans_that_hardly_ever_come_back_together_are_refused() -> None:
    odd = [SERVO | {"bearings": bearings} for bearings in (60, 62, 54)]
    with pytest.raises(FiringError, match="give them equal bearings"):
        firing_pattern(ring(*odd))


def test_a_ring_without_servos_has_one_mount_a_sensor() -> None:
    views = ServoViews(RING)
    assert not views.has_servo
    assert views.sensor_of == tuple(range(24)) == tuple(views.mount(i) for i in range(24))


@pytest.mark.parametrize(
    ("listed", "firing", "text"),
    [
        ([SERVO | {"bearings": 200}] * 2, {"preset": "single"}, "are 400, at most 255"),
        ([SERVO, FIXED], {"sets": [[0]], "listen": [[1]]}, "a ring with a servo cannot listen"),
    ],
)
def test_a_ring_with_servos_that_cannot_be_is_refused(
    listed: list[dict[str, Any]], firing: dict[str, Any], text: str
) -> None:
    with pytest.raises(ValueError, match=text):
        ring(*listed, **firing)
