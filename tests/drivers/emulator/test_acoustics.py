"""The first echo of each sensor against its oracles in tests/naive_acoustics.py, and cases to check by eye."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from config.world import BoxConfig, PolygonConfig, WallConfig, WorldConfig
from drivers.emulator.acoustics import (
    CONVEX_EDGE_REACH_M,
    ECHO,
    MOUNT,
    SIGHT_SLACK_M,
    clearance,
    first_echoes,
)
from drivers.emulator.scene import compile_scene
from drivers.emulator.surfaces import SURFACES, Records
from tests import naive_acoustics as naive
from tests.drivers.emulator.one_sensor import drum, hear, wall, world_of

# Against the oracles.

WORLDS = (15, pytest.param(1000, marks=pytest.mark.soak))
"""Random worlds."""

RAYS = 3

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


def echoes(world: WorldConfig, sensors: list[tuple[complex, float]], half_angle: float, model: str) -> Records:
    scene = compile_scene(world)
    mounts = np.array([(s.real, s.imag, axis) for s, axis in sensors], dtype=MOUNT)
    out = np.empty(len(sensors), dtype=ECHO)
    first_echoes(
        (0.0, 0.0, 0.0),
        mounts,
        np.ones(len(sensors), dtype=np.bool_),
        half_angle,
        SURFACES[model],
        RAYS,
        scene,
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
@pytest.mark.boundslong
def test_cone_is_exactly_the_nearest_point_in_the_beam(worlds: int) -> None:
    heard = 0
    for world, shapes, sensors, half in random_cases(1, worlds):
        out = echoes(world, sensors, half, "cone")
        expected = [naive.cone(shapes, s, axis, half) for s, axis in sensors]
        np.testing.assert_allclose(out["distance"], expected, rtol=0, atol=1e-8)
        heard += int(np.isfinite(out["distance"]).sum())
    assert heard > 3 * worlds


def test_cone_agrees_with_densely_sampled_surfaces() -> None:
    spacing = 0.002
    for world, shapes, sensors, half in random_cases(2, 25):
        out = echoes(world, sensors, half, "cone")
        points = naive.surface_samples(shapes, spacing)
        for (sensor, axis), found in zip(sensors, out["distance"], strict=True):
            inside = np.abs(np.angle((points - sensor) * np.exp(-1j * axis))) <= half
            sampled = np.abs(points[inside] - sensor).min() if inside.any() else math.inf
            assert found <= sampled + 1e-9, "a sample in the beam is nearer than the nearest point"
            near = np.abs(points - sensor) < sampled - 20 * spacing
            strictly = np.abs(np.angle((points - sensor) * np.exp(-1j * axis))) <= half - 0.02
            assert not (near & strictly).any()


@pytest.mark.parametrize("worlds", WORLDS)
@pytest.mark.boundslong
def test_specular_is_exactly_the_first_visible_mirror(worlds: int) -> None:
    heard = 0
    for world, shapes, sensors, half in random_cases(3, worlds):
        out = echoes(world, sensors, half, "specular")
        expected = [naive.specular(shapes, s, axis, half, CONVEX_EDGE_REACH_M, SIGHT_SLACK_M) for s, axis in sensors]
        np.testing.assert_allclose(out["distance"], expected, rtol=0, atol=1e-8)
        heard += int(np.isfinite(out["distance"]).sum())
    assert heard > 1.5 * worlds


@pytest.mark.parametrize("model", ["cone", "specular", "rays"])
def test_reflecting_point_lies_at_the_reported_distance(model: str) -> None:
    for world, _, sensors, half in random_cases(4, 25):
        for (sensor, _axis), (distance, x, y) in zip(sensors, echoes(world, sensors, half, model), strict=True):
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


def with_surfaces(world: WorldConfig, choose: Callable[[], str | None]) -> WorldConfig:
    """Return a world whose objects have these surfaces of their own."""
    return world.model_copy(
        update={
            kind: tuple(item.model_copy(update={"surface": choose()}) for item in getattr(world, kind))
            for kind in ("drum", "wall", "box", "polygon")
        }
    )


def one_of(rng: np.random.Generator, *names: str | None) -> Callable[[], str | None]:
    return lambda: names[int(rng.integers(len(names)))]


@pytest.mark.parametrize("model", ["specular", "rays"])
@pytest.mark.parametrize("worlds", WORLDS)
@pytest.mark.boundslong
def test_mixed_surfaces_answer_each_by_its_own_model(model: str, worlds: int) -> None:
    heard, rng = 0, np.random.default_rng(6)
    for world, _, sensors, half in random_cases(7, worlds):
        mixed = with_surfaces(world, one_of(rng, "specular", "rays", "silent", None))
        shapes = naive.shapes_of(mixed, model)
        out = echoes(mixed, sensors, half, model)
        expected = [
            min(
                naive.specular(shapes, s, axis, half, CONVEX_EDGE_REACH_M, SIGHT_SLACK_M),
                naive.rays(shapes, s, axis, half, RAYS),
            )
            for s, axis in sensors
        ]
        np.testing.assert_allclose(out["distance"], expected, rtol=0, atol=1e-8)
        heard += int(np.isfinite(out["distance"]).sum())
    assert heard > 1.5 * worlds


def test_a_cone_behind_cloth_is_heard_where_it_is_in_sight() -> None:
    """No ray of many finds a nearer point in sight, and the found one is in the beam and in sight."""
    found, rng = 0, np.random.default_rng(8)
    for world, _, sensors, half in random_cases(9, 9):
        bare = world.model_copy(update={"drum": ()})
        apart = [d for d in world.drum if clearance_of(bare, d.x_m, d.y_m) > d.radius_m][:1]  # no surfaces that cross
        mixed = with_surfaces(bare.model_copy(update={"drum": tuple(apart)}), one_of(rng, "silent", None))
        shapes = naive.shapes_of(mixed, "cone")
        dense = naive.shapes_of(mixed, "rays")
        for (sensor, axis), echo in zip(sensors, echoes(mixed, sensors, half, "cone"), strict=True):
            distance = float(echo["distance"])
            assert distance <= naive.rays(dense, sensor, axis, half, 67) + 1e-5
            if math.isfinite(distance):
                at = complex(echo["x"], echo["y"])
                assert naive.in_beam(at, sensor, axis, half, 1e-6)
                assert naive.in_sight(shapes, sensor, at, 1e-3)
                found += 1
    assert found > 12


def clearance_of(world: WorldConfig, x: float, y: float) -> float:
    scene = compile_scene(world)
    return clearance(x, y, scene.circles, scene.segments)


def test_a_world_of_one_surface_answers_alike_whether_the_world_or_each_object_says_it() -> None:
    for world, _, sensors, half in random_cases(10, 30):
        for model, other in (("cone", "specular"), ("specular", "cone"), ("rays", "cone")):
            each = with_surfaces(world, one_of(np.random.default_rng(0), model))
            mine, worlds = echoes(each, sensors, half, other), echoes(world, sensors, half, model)
            for name in ("distance", "x", "y"):
                np.testing.assert_array_equal(mine[name], worlds[name])


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


def test_one_ray_hears_only_what_is_on_the_axis_and_three_what_is_at_the_edges() -> None:
    for rays, off_deg, is_heard in (
        (1, 0.0, True),
        (1, 6.0, False),
        (3, 12.0, True),
        (3, 6.0, False),
        (10, 4.0, True),
    ):
        turn = math.radians(off_deg)
        post = drum(2 * math.cos(turn), 2 * math.sin(turn), 0.05)
        world = world_of("rays", drum=(post,))
        world = world.model_copy(update={"acoustics": world.acoustics.model_copy(update={"rays": rays})})
        assert math.isfinite(hear(world)) == is_heard, (rays, off_deg)


def test_a_slanted_wall_answers_a_ray_where_it_hits() -> None:
    slanted = wall(1.0, -1.0, 5.0, 3.0)  # at 45°, through (2, 0)
    world = world_of("rays", wall=(slanted,))
    axis = world.acoustics.model_copy(update={"rays": 1})
    assert hear(world.model_copy(update={"acoustics": axis})) == pytest.approx(2.0)
    edge = math.radians(12.0)
    assert hear(world) == pytest.approx(1.0 / (math.cos(edge) + math.sin(edge)) * 2.0, abs=0.5)
    mirror = slanted.model_copy(update={"surface": "specular"})
    assert hear(world.model_copy(update={"wall": (mirror,)})) == math.inf


def test_cloth_is_silent_and_hides_the_wall_behind_it() -> None:
    cloth = wall(2.0, -1.0, 2.0, 1.0).model_copy(update={"surface": "silent"})
    back = wall(3.0, -5.0, 3.0, 5.0)
    for model in ("cone", "specular", "rays"):
        assert hear(world_of(model, wall=(cloth, back))) == math.inf
        half = cloth.model_copy(update={"y1_m": 0.0})
        heard = hear(world_of(model, wall=(half, back)))
        assert heard == (
            math.inf
            if model == "specular"
            else pytest.approx(3.0 if model == "cone" else 3.0 / math.cos(math.radians(12.0)))
        )


def test_a_bent_mirror_answers_along_its_arc_on_both_sides() -> None:
    """Seen from a place, the nearest point of the whole arc is where its normal looks back."""
    for bend in (0.03, -0.03):
        bent = WallConfig(x1_m=2.0, y1_m=-1.5, x2_m=2.0, y2_m=1.5, bend_m=bend)
        radius = (1.5**2 + bend**2) / (2.0 * abs(bend))
        middle = 2.0 - bend + math.copysign(radius, bend)
        for y in np.linspace(-0.9, 0.9, 31).tolist():
            expected = abs(math.hypot(middle, y) - radius)
            assert hear(world_of("specular", wall=(bent,)), y=y) == pytest.approx(expected, abs=2e-4)
