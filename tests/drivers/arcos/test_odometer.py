"""Raw odometry to SI: counters that wrap at 15 bits, headings signed or not, the factors of models."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from config.families.arcos import ArcosConfig
from config.load import load_robot
from drivers.arcos.odometer import Odometer
from drivers.messages import Flags, Odometry
from tests.drivers.arcos.vectors import TAIL


def read(odometer: Odometer, **fields: int) -> Odometry:
    sip = replace(TAIL, **fields)  # type: ignore[arg-type]
    return odometer.read(sip, 1.0, Flags.NONE)


@pytest.mark.parametrize("bits", [15, 16])
def test_a_counter_of_15_or_16_bits_is_continued(bits: int) -> None:
    odometer = Odometer(ArcosConfig())
    for way in (*range(0, 100_000, 90), *range(100_000, -100_000, -90)):
        low = way & ((1 << bits) - 1)
        signed = low - 0x10000 if low >= 0x8000 else low
        sample = read(odometer, x=signed, y=-signed if signed > -0x8000 else 0)
        assert sample.pose.x == pytest.approx(way * 1e-3)


def test_a_heading_is_continued_whether_it_is_reported_signed_or_not() -> None:
    for offset in (0, 2048):
        odometer = Odometer(ArcosConfig())
        for units in (*range(0, 10_000, 100), *range(10_000, -10_000, -100)):
            sample = read(odometer, heading=(units + offset) % 4096 - offset)
            assert sample.pose.theta == sample.ring_yaw == pytest.approx(units * 2.0 * math.pi / 4096)


def test_the_first_sip_starts_where_its_counters_stand() -> None:
    odometer = Odometer(load_robot("p3dx").arcos)
    sample = read(odometer, x=-1000, y=2000, heading=1024)
    assert (sample.pose.x, sample.pose.y, sample.pose.theta) == pytest.approx((-0.485, 0.97, math.pi / 2))
    odometer.restart()
    assert read(odometer, x=1000).pose.x == pytest.approx(0.485)


@pytest.mark.parametrize(("x", "is_at_zero"), [(0, True), (21, False), (-20, True), (0x7FFF, True), (4000, False)])
def test_an_odometry_of_about_zero_is_known(x: int, is_at_zero: bool) -> None:
    odometer = Odometer(ArcosConfig())
    read(odometer, x=x)
    assert odometer.is_at_zero == is_at_zero


def test_200_mm_per_s_are_41_counts_in_a_tenth_of_a_second() -> None:
    odometer = Odometer(load_robot("p3dx").arcos)
    before = read(odometer, x=32_740)
    after = read(odometer, x=32_740 + 41 - 0x10000)
    assert after.pose.x - before.pose.x == pytest.approx(0.02, abs=2e-4)


@pytest.mark.parametrize(
    ("name", "left", "right", "v", "w"),
    [
        ("p3dx", 150, 150, 0.15, 0.0),
        ("p3dx", -93, 93, 0.0, math.radians(30.0)),
        ("p3at", 100, 300, 0.2, 0.34),
        ("amigo", 325, 325, 0.2, 0.0),
    ],
)
def test_wheel_speeds_give_the_velocity(name: str, left: int, right: int, v: float, w: float) -> None:
    twist = read(Odometer(load_robot(name).arcos), left=left, right=right).twist
    assert (twist.v, twist.w) == pytest.approx((v, w), abs=3e-3)


def test_only_a_small_odometry_is_near_zero() -> None:
    assert Odometer.is_near_zero(replace(TAIL, x=-3, y=0x7FFF, heading=4095))
    assert not Odometer.is_near_zero(replace(TAIL, x=21))
    assert not Odometer.is_near_zero(replace(TAIL, heading=-500))
