"""The emulated ring hears what geometry says it must, and its electronics spoil it as configured."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from config.robot import RingConfig, SensorConfig
from config.world import AcousticsConfig, BoxConfig, DrumConfig, PolygonConfig, WallConfig, WorldConfig
from drivers.emulator.acoustics import (
    CONVEX_EDGE_REACH_M,
    ECHO,
    MOUNT,
    SIGHT_SLACK_M,
    Records,
    clearance,
    first_echoes,
)
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Floats, Pose
from tests import naive_acoustics as naive

BEAM_DEG = 12.0
TENTH_FT = 0.03048


def wall(x1: float, y1: float, x2: float, y2: float) -> WallConfig:
    return WallConfig(x1_m=x1, y1_m=y1, x2_m=x2, y2_m=y2)


def drum(x: float, y: float, radius: float) -> DrumConfig:
    return DrumConfig(x_m=x, y_m=y, radius_m=radius)


def ring(**changes: Any) -> RingConfig:
    """One sensor in the middle, looking forward, exact, with a long window."""
    settings: dict[str, Any] = {
        "sensors": (SensorConfig(x_m=0.0, y_m=0.0, angle_deg=0.0),),
        "beam_half_angle_deg": BEAM_DEG,
        "resolution_m": 0.0,
        "range_min_m": 0.0,
        "range_max_m": 50.0,
    }
    return RingConfig(**settings | changes)


def hear(world: WorldConfig, theta_deg: float = 0.0, x: float = 0.0, y: float = 0.0, seed: int = 0) -> float:
    sonar = Sonar(ring(), compile_scene(world), world.acoustics, np.random.default_rng(seed))
    theta = math.radians(theta_deg)
    return float(sonar.fire(Pose(x, y, theta), theta)[0])


def world_of(model: str, **surfaces: Any) -> WorldConfig:
    acoustics = AcousticsConfig.model_validate({"model": model})
    return WorldConfig(acoustics=acoustics, **surfaces)


# Against the oracles.

Case = tuple[WorldConfig, naive.Shapes, list[tuple[complex, float]], float]


def random_world(rng: np.random.Generator) -> WorldConfig:
    def place() -> tuple[float, float]:
        x, y = rng.uniform(-4, 4, 2)
        return float(x), float(y)

    walls = [wall(*place(), *place()) for _ in range(rng.integers(0, 4))]
    if walls:  # one that ends on another's interior
        share = float(rng.uniform(0.2, 0.8))
        first = walls[0]
        on = (first.x1_m + share * (first.x2_m - first.x1_m), first.y1_m + share * (first.y2_m - first.y1_m))
        walls.append(wall(*on, *place()))
    boxes = [
        BoxConfig(
            x_m=place()[0],
            y_m=place()[1],
            width_m=float(rng.uniform(0.1, 2)),
            depth_m=float(rng.uniform(0.1, 2)),
            angle_deg=float(rng.uniform(-180, 180)),
        )
        for _ in range(rng.integers(0, 3))
    ]
    return WorldConfig(
        drum=tuple(drum(*place(), float(rng.uniform(0.1, 1))) for _ in range(rng.integers(0, 4))),
        wall=tuple(walls),
        box=tuple(boxes),
        polygon=(PolygonConfig(vertices_m=(place(), place(), place())),) if rng.random() < 0.3 else (),
    )


def echoes(world: WorldConfig, sensors: list[tuple[complex, float]], half_angle: float, *, specular: bool) -> Records:
    scene = compile_scene(world)
    mounts = np.array([(s.real, s.imag, axis) for s, axis in sensors], dtype=MOUNT)
    out = np.empty(len(sensors), dtype=ECHO)
    first_echoes(
        0.0,
        0.0,
        0.0,
        mounts,
        np.ones(len(sensors), dtype=np.bool_),
        half_angle,
        specular,
        CONVEX_EDGE_REACH_M,
        SIGHT_SLACK_M,
        scene.circles,
        scene.segments,
        scene.corners,
        out,
    )
    return out


def random_cases(
    seed: int, worlds: int
) -> list[tuple[WorldConfig, naive.Shapes, list[tuple[complex, float]], float]]:
    rng = np.random.default_rng(seed)
    cases = []
    for _ in range(worlds):
        world = random_world(rng)
        shapes = naive.shapes_of(world)
        sensors = [(complex(*rng.uniform(-4, 4, 2)), float(rng.uniform(-math.pi, math.pi))) for _ in range(8)]
        free = [s for s in sensors if all(abs(s[0] - c) > r for c, r in shapes.circles)]
        if free:
            cases.append((world, shapes, free, float(rng.uniform(0.05, 1.4))))
    return cases


def test_cone_is_exactly_the_nearest_point_in_the_beam() -> None:
    heard = 0
    for world, shapes, sensors, half in random_cases(1, 300):
        out = echoes(world, sensors, half, specular=False)
        expected = [naive.cone(shapes, s, axis, half) for s, axis in sensors]
        np.testing.assert_allclose(out["distance"], expected, rtol=0, atol=1e-8)
        heard += int(np.isfinite(out["distance"]).sum())
    assert heard > 1000


def test_cone_agrees_with_densely_sampled_surfaces() -> None:
    spacing = 0.002
    for world, shapes, sensors, half in random_cases(2, 60):
        out = echoes(world, sensors, half, specular=False)
        points = naive.surface_samples(shapes, spacing)
        for (sensor, axis), found in zip(sensors, out["distance"], strict=True):
            inside = np.abs(np.angle((points - sensor) * np.exp(-1j * axis))) <= half
            sampled = np.abs(points[inside] - sensor).min() if inside.any() else math.inf
            assert found <= sampled + 1e-9, "a sample in the beam is nearer than the nearest point"
            near = np.abs(points - sensor) < sampled - 20 * spacing
            strictly = np.abs(np.angle((points - sensor) * np.exp(-1j * axis))) <= half - 0.02
            assert not (near & strictly).any()


def test_specular_is_exactly_the_first_visible_mirror() -> None:
    heard = 0
    for world, shapes, sensors, half in random_cases(3, 300):
        out = echoes(world, sensors, half, specular=True)
        expected = [naive.specular(shapes, s, axis, half, CONVEX_EDGE_REACH_M, SIGHT_SLACK_M) for s, axis in sensors]
        np.testing.assert_allclose(out["distance"], expected, rtol=0, atol=1e-8)
        heard += int(np.isfinite(out["distance"]).sum())
    assert heard > 500


@pytest.mark.parametrize("specular", [False, True])
def test_reflecting_point_lies_at_the_reported_distance(specular: bool) -> None:
    for world, _, sensors, half in random_cases(4, 50):
        for (sensor, _axis), (distance, x, y) in zip(
            sensors, echoes(world, sensors, half, specular=specular), strict=True
        ):
            if math.isfinite(distance):
                assert abs(complex(x, y) - sensor) == pytest.approx(distance, abs=1e-9)
            else:
                assert math.isnan(x)
                assert math.isnan(y)


def test_clearance_agrees_with_densely_sampled_surfaces() -> None:
    for world, shapes, sensors, _ in random_cases(5, 60):
        scene = compile_scene(world)
        points = naive.surface_samples(shapes, 0.002)
        for sensor, _axis in sensors:
            expected = np.abs(points - sensor).min() if len(points) else math.inf
            found = clearance(sensor.real, sensor.imag, scene.circles, scene.segments)
            assert found == pytest.approx(expected, abs=0.002) or found == expected


# Cases one can check by looking.


@pytest.mark.parametrize("model", ["cone", "specular"])
def test_drum_ahead_is_heard_at_its_skin(model: str) -> None:
    assert hear(world_of(model, drum=(drum(3, 0, 0.5),))) == pytest.approx(2.5)


def test_drum_beside_the_beam_is_touched_by_the_cone_only() -> None:
    surfaces = {"drum": (drum(3 * math.cos(math.radians(15)), 3 * math.sin(math.radians(15)), 0.5),)}
    assert 2.5 < hear(world_of("cone", **surfaces)) < 2.6
    assert hear(world_of("specular", **surfaces)) == math.inf


def test_slanted_wall_answers_only_inside_the_beam() -> None:
    def slanted(degrees: float) -> WallConfig:
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        return wall(2 * c + 5 * s, 2 * s - 5 * c, 2 * c - 5 * s, 2 * s + 5 * c)

    assert hear(world_of("specular", wall=(slanted(11.9),))) == pytest.approx(2.0)
    assert hear(world_of("specular", wall=(slanted(12.1),))) == math.inf
    assert hear(world_of("cone", wall=(slanted(40),))) == pytest.approx(2 / math.cos(math.radians(28)))


def test_nothing_behind_is_heard() -> None:
    for model in ("cone", "specular"):
        assert hear(world_of(model, drum=(drum(-3, 0, 0.5),), wall=(wall(-2, -5, -2, 5),))) == math.inf


def test_concave_corner_answers_where_its_walls_do_not() -> None:
    room = (wall(3, -5, 3, 3), wall(3, 3, -5, 3))
    assert hear(world_of("specular", wall=room), 45) == pytest.approx(3 * math.sqrt(2))


def test_wall_ending_on_another_makes_two_corners() -> None:
    tee = world_of("specular", wall=(wall(3, -9, 3, 9), wall(3, 1, 1, 1)))
    for y in (-2.0, 4.0):
        assert hear(tee, math.degrees(math.atan2(1 - y, 3)), y=y) == pytest.approx(math.hypot(3, 1 - y))


def test_convex_edge_is_heard_from_near_only() -> None:
    def box_edge_at(distance: float) -> float:
        box = BoxConfig(x_m=distance + math.sqrt(0.5), y_m=0, width_m=1, depth_m=1, angle_deg=45)
        return hear(world_of("specular", box=(box,)))

    assert box_edge_at(0.95) == pytest.approx(0.95)
    assert box_edge_at(1.05) == math.inf


def test_joint_of_two_walls_in_line_is_no_corner() -> None:
    scene = compile_scene(world_of("specular", wall=(wall(0, 0, 1, 0), wall(1, 0, 2, 0))))
    assert sorted(scene.corners["x"]) == [0.0, 2.0]


def test_nearer_object_hides_farther_one() -> None:
    far = wall(5, -5, 5, 5)
    slab = wall(2, -0.1, 2.4, 0.4)  # crosses the sight line and sends its own echo elsewhere
    assert hear(world_of("specular", wall=(far,))) == pytest.approx(5)
    assert hear(world_of("specular", wall=(far, slab))) == math.inf
    off_axis = drum(2.5, 0.7, 0.75)  # its centre is out of the beam, its side in the line of sight
    assert hear(world_of("specular", wall=(far,), drum=(off_axis,))) == math.inf
    assert hear(world_of("specular", wall=(far,), drum=(drum(2.5, 0.8, 0.75),))) == pytest.approx(5)


def test_hidden_corner_is_silent() -> None:
    room = (wall(3, -5, 3, 3), wall(3, 3, -5, 3))
    screen = wall(1.4, 1.9, 1.6, 1.1)
    assert hear(world_of("specular", wall=(*room, screen)), 45) == math.inf


@pytest.mark.parametrize("model", ["cone", "specular"])
def test_inside_a_drum_the_range_is_the_shortest(model: str) -> None:
    assert hear(world_of(model, drum=(drum(0.1, 0, 1),))) == 0.0


def test_no_surfaces_no_echo() -> None:
    for model in ("cone", "specular"):
        assert hear(world_of(model)) == math.inf


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


# The electronics.


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
    got = fire_many(wall_at(4.0, noise_relative=0.005, noise_m=0.015), 500, sensors=20)
    assert got.mean() == pytest.approx(4.0, abs=0.002)
    assert got.std() == pytest.approx(0.025, rel=0.05)


def test_dropouts_come_as_often_as_asked() -> None:
    got = fire_many(wall_at(4.0, dropout=0.2), 500, sensors=20)
    assert np.isinf(got).mean() == pytest.approx(0.2, abs=0.02)


def test_outliers_are_uniform_in_the_window() -> None:
    got = fire_many(wall_at(4.0, outliers=0.3), 500, sensors=20, range_max_m=10.0, range_min_m=1.0)
    wild = got[np.abs(got - 4.0) > 1e-9]
    assert wild.size / got.size == pytest.approx(0.3, abs=0.03)
    assert 1.0 <= wild.min() < 1.1
    assert 9.9 < wild.max() <= 10.0
    assert np.quantile(wild, 0.5) == pytest.approx(5.5, abs=0.3)


@pytest.mark.parametrize(("farthest_m", "reaches_m"), [(3.0, 3.0), (50.0, 10.0)])
def test_outliers_reach_no_farther_than_asked(farthest_m: float, reaches_m: float) -> None:
    world = wall_at(4.0, outliers=0.3, outlier_max_m=farthest_m)
    got = fire_many(world, 500, sensors=20, range_max_m=10.0, range_min_m=1.0)
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


def test_who_did_not_fire_says_so() -> None:
    world = wall_at(3.0, outliers=1.0)
    got = fire_many(world, 1, sensors=3)[0]
    assert np.isfinite(got).all()
    sonar = Sonar(
        ring(count=4, radius_m=0.1, sensors=None), compile_scene(world), world.acoustics, np.random.default_rng(0)
    )
    assert np.isnan(sonar.fire(Pose(0, 0, 0), 0.0, [2])).tolist() == [True, True, False, True]


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


def test_crosstalk_is_half_the_way_round() -> None:
    got = crosstalk_ranges(1.0, [0, 1], angle_deg=17.0)
    np.testing.assert_allclose(got[:, 0], 2.0)
    np.testing.assert_allclose(got[:, 1], 0.5 * (2.0 + math.hypot(2.0, 0.2)))


def test_crosstalk_comes_as_often_as_asked_and_only_between_those_that_fire_together() -> None:
    assert np.isfinite(crosstalk_ranges(0.25, [0, 1], 17.0)[:, 1]).mean() == pytest.approx(0.25, abs=0.06)
    assert np.isinf(crosstalk_ranges(0.0, [0, 1], 17.0)[:, 1]).all()
    assert np.isinf(crosstalk_ranges(1.0, [1], 17.0)[:, 1]).all()


def test_crosstalk_needs_the_listener_to_look_there() -> None:
    assert np.isinf(crosstalk_ranges(1.0, [0, 1], angle_deg=25.0)[:, 1]).all()


def test_crosstalk_that_comes_later_than_the_own_echo_changes_nothing() -> None:
    np.testing.assert_allclose(crosstalk_ranges(1.0, [0, 1], angle_deg=0.0)[:, 0], 2.0)
