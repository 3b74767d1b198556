"""The firing schedule: presets, sets of one's own, and what sound has no time for."""

from __future__ import annotations

import re

import pytest

from config.robot import FiringConfig, Preset, RingConfig
from drivers.denning.wire_units import wire_pattern
from drivers.firing_pattern import FiringError, firing_pattern, sensors, time_of_flight_s
from tests.drivers.vectors import OCTETS, THIRDS


def ring(firing: FiringConfig, count: int = 24, range_max_m: float = 7.7724) -> RingConfig:
    return RingConfig(
        count=count,
        radius_m=0.381,
        beam_half_angle_deg=12.0,
        resolution_m=0.03048,
        range_min_m=0.1524,
        range_max_m=range_max_m,
        firing=firing,
    )


@pytest.mark.parametrize(
    ("preset", "steps", "together"),
    [("single", 24, 1), ("opposite_pairs", 12, 2), ("thirds", 8, 3), ("quadrants", 6, 4), ("octets", 3, 8)],
)
def test_presets_fire_every_sensor_once_equally_spaced(preset: Preset, steps: int, together: int) -> None:
    pattern = firing_pattern(ring(FiringConfig(preset=preset)))
    assert len(pattern.masks) == steps
    assert sorted(i for mask in pattern.masks for i in sensors(mask)) == list(range(24))
    for step, mask in enumerate(pattern.masks):
        assert sensors(mask) == tuple(step + k * 24 // together for k in range(together))
    assert (pattern.step_period_s, pattern.window_m) == (0.05, 7.7724)


def test_alternating_gives_every_sensor_other_partners() -> None:
    masks = [set(sensors(mask)) for mask in firing_pattern(ring(FiringConfig(preset="alternating"))).masks]
    for i in range(24):
        (first, second) = (mask - {i} for mask in masks if i in mask)
        assert first
        assert second
        assert not first & second
    with pytest.raises(
        FiringError, match="fires 8 or 3 sensors at a time, equally spaced, and 16 sensors do not divide"
    ):
        firing_pattern(ring(FiringConfig(preset="alternating"), count=16))


def test_presets_are_those_of_the_protocol() -> None:
    assert firing_pattern(ring(FiringConfig(preset="octets"))).masks == OCTETS
    assert firing_pattern(ring(FiringConfig(preset="thirds"))).masks == THIRDS
    assert wire_pattern(ring(FiringConfig(preset="octets"))) == (50, 255, OCTETS)


def test_a_preset_that_does_not_divide_the_ring_names_those_that_do() -> None:
    with pytest.raises(FiringError, match="12 sensors do not divide by 8") as caught:
        firing_pattern(ring(FiringConfig(preset="octets"), count=12))
    text = str(caught.value)
    assert "possible for this ring: single, opposite_pairs, thirds, quadrants, or sets of your own" in text


def test_sets_are_fired_in_turn_and_rotated_round_the_ring() -> None:
    firing = FiringConfig(sets=((0, 12), (23,)), rotations=3)
    masks = firing_pattern(ring(firing)).masks
    assert [sensors(m) for m in masks] == [(0, 12), (23,), (1, 13), (0,), (2, 14), (1,)]


def test_an_unknown_sensor_is_named() -> None:
    with pytest.raises(FiringError, match="names sensor 24, 30, and this ring has sensors 0 to 23"):
        firing_pattern(ring(FiringConfig(sets=((30, 1), (24,)))))


def test_time_of_flight_is_there_and_back() -> None:
    assert time_of_flight_s(3.43) == pytest.approx(0.02)


@pytest.mark.parametrize(("step_s", "range_max_m"), [(0.02, 7.7724), (0.0203, 100.0)])
def test_a_step_shorter_than_its_window_is_refused_with_the_limits_that_would_fit(
    step_s: float, range_max_m: float
) -> None:
    def with_step(step_period_s: float, window_m: float | None = None) -> RingConfig:
        firing = FiringConfig(preset="octets", step_period_s=step_period_s, window_m=window_m)
        return ring(firing, 24, range_max_m)

    with pytest.raises(FiringError, match="shorter than sound takes") as caught:
        firing_pattern(with_step(step_s))
    text = str(caught.value)
    shortest = float(re.findall(r"step_period_s at least ([0-9.]+)", text)[0])
    longest = float(re.findall(r"window_m at most ([0-9.]+)", text)[0])
    assert time_of_flight_s(range_max_m) <= shortest < time_of_flight_s(range_max_m) + 1e-4 + 1e-9
    assert time_of_flight_s(longest) <= step_s + 1e-9 < time_of_flight_s(longest + 1e-3) + 1e-9
    firing_pattern(with_step(shortest))
    firing_pattern(with_step(step_s, longest))
    with pytest.raises(FiringError):
        firing_pattern(with_step(shortest - 2e-4))
    with pytest.raises(FiringError):
        firing_pattern(with_step(step_s, longest + 2e-3))


def test_a_step_exactly_as_long_as_its_window_is_accepted() -> None:
    firing = FiringConfig(preset="single", step_period_s=time_of_flight_s(2.0), window_m=2.0)
    assert firing_pattern(ring(firing)).window_m == 2.0
    wire = wire_pattern(ring(firing))
    assert wire.step_period_ms * 1e-3 >= time_of_flight_s(wire.window * 0.03048)
