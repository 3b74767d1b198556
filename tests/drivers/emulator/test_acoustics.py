"""The first echo of each sensor against its oracles in tests/naive_acoustics.py, and cases to check by eye."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.world import BoxConfig, PolygonConfig, WallConfig, WorldConfig
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
from tests import naive_acoustics as naive
from tests.drivers.emulator.one_sensor import drum, hear, wall, world_of

# Against the oracles.

WORLDS = (60, pytest.param(1000, marks=pytest.mark.soak))
"""Random worlds."""

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


@pytest.mark.parametrize("worlds", WORLDS)
@pytest.mark.boundscheck
def test_cone_is_exactly_the_nearest_point_in_the_beam(worlds: int) -> None:
    heard = 0
    for world, shapes, sensors, half in random_cases(1, worlds):
        out = echoes(world, sensors, half, specular=False)
        expected = [naive.cone(shapes, s, axis, half) for s, axis in sensors]
        np.testing.assert_allclose(out["distance"], expected, rtol=0, atol=1e-8)
        heard += int(np.isfinite(out["distance"]).sum())
    assert heard > 3 * worlds


def test_cone_agrees_with_densely_sampled_surfaces() -> None:
    spacing = 0.002
    for world, shapes, sensors, half in random_cases(2, 25):
        out = echoes(world, sensors, half, specular=False)
        points = naive.surface_samples(shapes, spacing)
        for (sensor, axis), found in zip(sensors, out["distance"], strict=True):
            inside = np.abs(np.angle((points - sensor) * np.exp(-1j * axis))) <= half
            sampled = np.abs(points[inside] - sensor).min() if inside.any() else math.inf
            assert found <= sampled + 1e-9, "a sample in the beam is nearer than the nearest point"
            near = np.abs(points - sensor) < sampled - 20 * spacing
            strictly = np.abs(np.angle((points - sensor) * np.exp(-1j * axis))) <= half - 0.02
            assert not (near & strictly).any()


@pytest.mark.parametrize("worlds", WORLDS)
@pytest.mark.boundscheck
def test_specular_is_exactly_the_first_visible_mirror(worlds: int) -> None:
    heard = 0
    for world, shapes, sensors, half in random_cases(3, worlds):
        out = echoes(world, sensors, half, specular=True)
        expected = [naive.specular(shapes, s, axis, half, CONVEX_EDGE_REACH_M, SIGHT_SLACK_M) for s, axis in sensors]
        np.testing.assert_allclose(out["distance"], expected, rtol=0, atol=1e-8)
        heard += int(np.isfinite(out["distance"]).sum())
    assert heard > 1.5 * worlds


@pytest.mark.parametrize("specular", [False, True])
def test_reflecting_point_lies_at_the_reported_distance(specular: bool) -> None:
    for world, _, sensors, half in random_cases(4, 25):
        for (sensor, _axis), (distance, x, y) in zip(
            sensors, echoes(world, sensors, half, specular=specular), strict=True
        ):
            if math.isfinite(distance):
                assert abs(complex(x, y) - sensor) == pytest.approx(distance, abs=1e-9)
            else:
                assert math.isnan(x)
                assert math.isnan(y)


def test_clearance_agrees_with_densely_sampled_surfaces() -> None:
    for world, shapes, sensors, _ in random_cases(5, 25):
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
