"""The ring's electronics: rounding, window, noise, dropouts, outliers and crosstalk, as often as configured."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from config.robot import RingConfig, SensorConfig
from config.world import AcousticsConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Floats, Pose
from tests.drivers.emulator.one_sensor import drum, ring, wall, world_of

TENTH_FT = 0.03048


def test_mounts_turn_with_the_ring() -> None:
    world = world_of("cone", drum=(drum(0, 3, 0.5),))
    config = RingConfig(
        count=4, radius_m=0.4, beam_half_angle_deg=12.0, resolution_m=0.0, range_min_m=0.0, range_max_m=10.0
    )
    sonar = Sonar(config, compile_scene(world), world.acoustics, np.random.default_rng(0))
    straight = sonar.fire(Pose(0, 0, 1.0), 0.0)  # the heading is not the ring's direction
    np.testing.assert_allclose(straight, [math.inf, 2.1, math.inf, math.inf])
    turned = sonar.fire(Pose(0, 0, 1.0), math.pi / 2)
    np.testing.assert_allclose(turned, [2.1, math.inf, math.inf, math.inf])


def fire_many(world: WorldConfig, times: int, *, sensors: int = 1, **changes: Any) -> Floats:
    mounts = tuple(SensorConfig(x_m=0.0, y_m=0.0, angle_deg=0.0) for _ in range(sensors))
    sonar = Sonar(ring(sensors=mounts, **changes), compile_scene(world), world.acoustics, np.random.default_rng(7))
    return np.array([sonar.fire(Pose(0, 0, 0), 0.0) for _ in range(times)])


def wall_at(distance: float, **acoustics: Any) -> WorldConfig:
    return WorldConfig(wall=(wall(distance, -9, distance, 9),), acoustics=AcousticsConfig(**acoustics))


def test_ranges_are_rounded_to_the_resolution() -> None:
    for tenths in (5.4, 5.6, 100.49, 100.51, 254.0):
        got = fire_many(wall_at(tenths * TENTH_FT), 1, resolution_m=TENTH_FT)[0, 0]
        assert got == pytest.approx(round(tenths) * TENTH_FT, abs=1e-12)


def test_nearer_than_the_least_range_reports_the_least() -> None:
    assert fire_many(wall_at(0.05), 1, resolution_m=TENTH_FT, range_min_m=0.1524)[0, 0] == pytest.approx(0.1524)


def test_beyond_the_window_nothing_is_heard() -> None:
    world = wall_at(3.0)
    sonar = Sonar(ring(), compile_scene(world), world.acoustics, np.random.default_rng(0))
    assert sonar.fire(Pose(0, 0, 0), 0.0, window_m=3.01)[0] == pytest.approx(3.0)
    assert sonar.fire(Pose(0, 0, 0), 0.0, window_m=2.99)[0] == math.inf


def test_faster_sound_shortens_ranges() -> None:
    assert fire_many(wall_at(2.2, sound_speed_scale=1.1), 1)[0, 0] == pytest.approx(2.0)


def test_noise_has_the_asked_spread() -> None:
    got = fire_many(wall_at(4.0, noise_relative=0.005, noise_m=0.015), 100, sensors=20)
    assert got.mean() == pytest.approx(4.0, abs=0.002)
    assert got.std() == pytest.approx(0.025, rel=0.05)


def test_dropouts_come_as_often_as_asked() -> None:
    got = fire_many(wall_at(4.0, dropout=0.2), 100, sensors=20)
    assert np.isinf(got).mean() == pytest.approx(0.2, abs=0.03)


def test_outliers_are_uniform_in_the_window() -> None:
    got = fire_many(wall_at(4.0, outliers=0.3), 100, sensors=20, range_max_m=10.0, range_min_m=1.0)
    wild = got[np.abs(got - 4.0) > 1e-9]
    assert wild.size / got.size == pytest.approx(0.3, abs=0.03)
    assert 1.0 <= wild.min() < 1.1
    assert 9.9 < wild.max() <= 10.0
    assert np.quantile(wild, 0.5) == pytest.approx(5.5, abs=0.3)


@pytest.mark.parametrize(("farthest_m", "reaches_m"), [(3.0, 3.0), (50.0, 10.0)])
def test_outliers_reach_no_farther_than_asked(farthest_m: float, reaches_m: float) -> None:
    world = wall_at(4.0, outliers=0.3, outlier_max_m=farthest_m)
    got = fire_many(world, 100, sensors=20, range_max_m=10.0, range_min_m=1.0)
    wild = got[np.abs(got - 4.0) > 1e-9]
    assert 1.0 <= wild.min() < 1.1
    assert reaches_m - 0.1 < wild.max() <= reaches_m


def test_same_seed_same_ranges_and_another_seed_others() -> None:
    acoustics = AcousticsConfig(noise_m=0.1, dropout=0.2, outliers=0.1, crosstalk=0.5)
    world = WorldConfig(drum=(drum(2, 0.3, 0.4), drum(0, 3, 0.4)), acoustics=acoustics)
    config = RingConfig(
        count=24, radius_m=0.381, beam_half_angle_deg=12.0, resolution_m=0.0, range_min_m=0.1, range_max_m=8.0
    )

    def run(seed: int) -> Floats:
        sonar = Sonar(config, compile_scene(world), acoustics, np.random.default_rng(seed))
        return np.array([sonar.fire(Pose(0, 0, 0), 0.0, range(k % 3, 24, 3)) for k in range(20)])

    np.testing.assert_array_equal(run(1), run(1))
    assert not np.array_equal(run(1), run(2), equal_nan=True)


def test_a_sensor_that_did_not_fire_reports_nan() -> None:
    world = wall_at(3.0, outliers=1.0)
    got = fire_many(world, 1, sensors=3)[0]
    assert np.isfinite(got).all()
    sonar = Sonar(
        ring(count=4, radius_m=0.1, sensors=None), compile_scene(world), world.acoustics, np.random.default_rng(0)
    )
    assert np.isnan(sonar.fire(Pose(0, 0, 0), 0.0, [2])).tolist() == [True, True, False, True]


def test_the_ring_jitters_about_the_place_that_odometry_has() -> None:
    got = fire_many(wall_at(4.0, jitter_m=0.03), 2000)[:, 0]
    assert got.mean() == pytest.approx(4.0, abs=0.003)
    assert got.std() == pytest.approx(0.03, rel=0.1)
    world = WorldConfig(drum=(drum(0, 4, 0.5),), acoustics=AcousticsConfig(model="specular", jitter_rad=0.01))
    sonar = Sonar(ring(), compile_scene(world), world.acoustics, np.random.default_rng(1))
    edge = math.radians(90.0 - 12.0)  # the drum's nearest point is on the beam's edge
    heard = [math.isfinite(sonar.fire(Pose(0, 0, edge + 0.01), edge + 0.01)[0]) for _ in range(2000)]
    assert np.mean(heard) == pytest.approx(0.841, abs=0.03)  # of a normal distribution, below one σ


def test_the_true_echoes_of_a_firing_are_of_where_it_truly_fired() -> None:
    world = wall_at(4.0, jitter_m=0.05)
    sonar = Sonar(ring(), compile_scene(world), world.acoustics, np.random.default_rng(1))
    for _ in range(10):
        assert sonar.fire(Pose(0, 0, 0), 0.0)[0] == pytest.approx(sonar.echoes["distance"][0], abs=1e-12)


def test_late_echoes_come_in_place_of_silence_and_from_beyond_the_first_surface() -> None:
    slanted = wall(
        1.0, -3.0, 5.0, 1.0
    )  # a mirror that sends sound elsewhere; its nearest point in the beam is on an edge
    nearest = 4.0 / (math.sqrt(2.0) * math.cos(math.radians(45.0 - 12.0)))
    world = WorldConfig(wall=(slanted,), acoustics=AcousticsConfig(model="specular", late=0.3))
    got = fire_many(world, 100, sensors=20)
    late = got[np.isfinite(got)]
    assert late.size / got.size == pytest.approx(0.3, abs=0.03)
    assert late.min() == pytest.approx(nearest + 0.3, abs=0.02)
    assert late.max() == pytest.approx(nearest + 2.0, abs=0.02)
    cloth = slanted.model_copy(update={"surface": "silent"})
    for silent in (world.model_copy(update={"wall": (cloth,)}), world.model_copy(update={"wall": ()})):
        assert np.isinf(fire_many(silent, 20)).all()


# Crosstalk.


def crosstalk_ranges(probability: float, sensors: list[int], angle_deg: float = 20.0) -> Floats:
    """Sensor 0 sees a drum 2 m ahead; sensor 1, turned away by `angle_deg`, sees nothing of its own."""
    world = WorldConfig(drum=(drum(2.5, 0, 0.5),), acoustics=AcousticsConfig(crosstalk=probability, model="specular"))
    mounts = (
        SensorConfig(x_m=0.0, y_m=0.0, angle_deg=0.0),
        SensorConfig(x_m=0.0, y_m=0.2, angle_deg=angle_deg),
    )
    sonar = Sonar(ring(sensors=mounts), compile_scene(world), world.acoustics, np.random.default_rng(3))
    return np.array([sonar.fire(Pose(0, 0, 0), 0.0, sensors) for _ in range(400)])


def test_crosstalk_measures_half_of_the_path_between_two_sensors() -> None:
    got = crosstalk_ranges(1.0, [0, 1], angle_deg=17.0)
    np.testing.assert_allclose(got[:, 0], 2.0)
    angles = np.linspace(0.9 * math.pi, 1.1 * math.pi, 100_001)
    points = 2.5 + 0.5 * np.exp(1j * angles)
    np.testing.assert_allclose(got[:, 1], 0.5 * (abs(points) + abs(points - 0.2j)).min(), atol=1e-9)


def test_crosstalk_comes_as_often_as_asked_and_only_between_those_that_fire_together() -> None:
    assert np.isfinite(crosstalk_ranges(0.25, [0, 1], 17.0)[:, 1]).mean() == pytest.approx(0.25, abs=0.06)
    assert np.isinf(crosstalk_ranges(0.0, [0, 1], 17.0)[:, 1]).all()
    assert np.isinf(crosstalk_ranges(1.0, [1], 17.0)[:, 1]).all()


def test_crosstalk_needs_the_listener_to_look_there() -> None:
    assert np.isinf(crosstalk_ranges(1.0, [0, 1], angle_deg=25.0)[:, 1]).all()


def test_crosstalk_that_comes_later_than_the_own_echo_changes_nothing() -> None:
    np.testing.assert_allclose(crosstalk_ranges(1.0, [0, 1], angle_deg=0.0)[:, 0], 2.0)
