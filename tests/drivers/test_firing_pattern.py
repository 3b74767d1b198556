"""The firing schedule: presets, sets of one's own, and what sound has no time for."""

from __future__ import annotations

import re
from typing import Any

import pytest

from config.robot import FiringConfig, Preset, RingConfig
from drivers.denning.wire_units import wire_pattern
from drivers.firing_pattern import (
    FiringError,
    cross_pairs,
    firing_pattern,
    pattern_pairs,
    sensors,
    time_of_flight_s,
)
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
    with pytest.raises(
        FiringError, match=r"ring\.firing\.sets names sensor 24, 30, and this ring has sensors 0 to 23"
    ):
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


# Listeners.


def listening(listen: object, **firing: Any) -> RingConfig:
    key = "listen_preset" if isinstance(listen, str) else "listen"
    return ring(FiringConfig.model_validate(firing | {key: listen}))


def test_presets_listen_beside_those_that_fire() -> None:
    pattern = firing_pattern(listening("neighbours", preset="octets"))
    assert pattern.masks == OCTETS
    assert all(fired ^ heard == (1 << 24) - 1 for fired, heard in zip(pattern.masks, pattern.listeners, strict=True))
    beside = firing_pattern(listening("neighbours", preset="quadrants"))
    assert sensors(beside.listeners[0]) == (1, 5, 7, 11, 13, 17, 19, 23)
    second = firing_pattern(listening("second", preset="quadrants"))
    assert sensors(second.listeners[0]) == (2, 4, 8, 10, 14, 16, 20, 22)
    assert firing_pattern(ring(FiringConfig(preset="octets"))).listeners == ()


def test_own_listeners_rotate_with_their_sets() -> None:
    pattern = firing_pattern(listening([[1, 23], []], sets=[[0], [12]], rotations=2))
    assert pattern.masks == (1, 1 << 12, 2, 1 << 13)
    assert [sensors(mask) for mask in pattern.listeners] == [(1, 23), (), (0, 2), ()]
    assert firing_pattern(listening([[], []], sets=[[0], [12]])).listeners == ()


def test_each_listener_hears_the_sensor_that_looks_most_nearly_its_way() -> None:
    assert pattern_pairs(listening([[1, 23, 11]], sets=[[0, 12]])) == ((0, 1), (0, 23), (12, 11))
    assert pattern_pairs(listening("second", preset="octets"))[:3] == ((0, 1), (0, 23), (1, 0))
    assert pattern_pairs(ring(FiringConfig(preset="octets"))) == ()
    axes = tuple(mount.angle_rad for mount in ring(FiringConfig(preset="octets")).mounts)
    assert cross_pairs(axes, 0b1, 0b10 | 1 << 30) == ((0, 1),), "a bit beyond the ring"
    assert cross_pairs(axes, 1 << 24, 0b10) == ()
    assert cross_pairs(axes, 0b1, 1 << 24) == ()
    assert cross_pairs(axes, 0b101, 0b10) == ((0, 1),), "of two that are equally near, the lower one"


@pytest.mark.parametrize(
    ("listen", "firing", "said"),
    [
        ([[24]], {"sets": [[0]]}, r"ring\.firing\.listen names sensor 24.*0 to 23"),
        ([[1]], {"preset": "octets"}, r"listen has 1 sets, and the pattern 3 steps"),
        ([[0], [0], [0]], {"preset": "octets"}, r"sensor 0 would listen in step 0, in which it fires"),
        ([[1]], {"sets": [[0, 2]]}, r"sensor 1 would listen midway between 0 and 2, which both fire in step 0"),
    ],
)
def test_listeners_that_the_ring_cannot_have_are_refused(listen: object, firing: dict[str, Any], said: str) -> None:
    with pytest.raises(FiringError, match=said):
        firing_pattern(listening(listen, **firing))
