"""Paths from one sensor over a surface to another, against their oracles in tests/naive_acoustics.py."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from config.world import BoxConfig, WorldConfig
from drivers.emulator.acoustics import CONVEX_EDGE_REACH_M, MOUNT, SIGHT_SLACK_M
from drivers.emulator.cross_paths import first_cross_paths, mirror_on_circle
from drivers.emulator.scene import compile_scene
from drivers.emulator.surfaces import CONE, SPECULAR
from drivers.messages import Floats
from tests import naive_acoustics as naive
from tests.drivers.emulator.one_sensor import drum, wall
from tests.drivers.emulator.test_acoustics import random_cases

MICROMETRE = 1e-6
WORLDS = (10, pytest.param(400, marks=pytest.mark.soak))
"""Random worlds."""
LOBE = 2.0


def half_paths(
    world: WorldConfig, sensors: list[tuple[complex, float]], half_angle: float, *, specular: bool,
    heard: Any = None,
) -> Floats:  # fmt: skip
    """Return half the path to each sensor; by default from any other one."""
    scene = compile_scene(world)
    mounts = np.array([(s.real, s.imag, axis) for s, axis in sensors], dtype=MOUNT)
    out = np.empty(len(sensors))
    first_cross_paths(
        (0.0, 0.0, 0.0),
        mounts,
        ~np.eye(len(sensors), dtype=np.bool_) if heard is None else heard,
        half_angle,
        LOBE * half_angle,
        SPECULAR if specular else CONE,
        scene,
        out,
    )
    return out


def pair(world: WorldConfig, apart_m: float = 0.2, *, specular: bool = True, turn_deg: float = 0.0) -> float:
    """Return half the path from a sensor at the origin to one beside it, which both look along x."""
    axis = math.radians(turn_deg)
    sensors = [(0j, axis), (apart_m * 1j, axis)]
    heard = np.array([[False, True], [False, False]])
    return float(half_paths(world, sensors, math.radians(12.0), specular=specular, heard=heard)[1])


@pytest.mark.parametrize("worlds", WORLDS)
@pytest.mark.parametrize("specular", [True, False])
@pytest.mark.boundslong
def test_paths_are_the_least_to_a_micrometre(worlds: int, specular: bool) -> None:
    heard, rng = 0, np.random.default_rng(10)
    for world, shapes, sensors, half in random_cases(11 + specular, worlds):
        ring = [
            (sensors[0][0] + complex(*rng.uniform(-0.4, 0.4, 2)), sensors[0][1] + rng.uniform(-1, 1))
            for _ in range(2)
        ]
        ring = [s for s in ring if all(abs(s[0] - c) > r for c, r in shapes.circles)] + sensors[:1]
        found = half_paths(world, ring, half, specular=specular)
        for i, (place, axis) in enumerate(ring):
            ear = (place, axis, min(LOBE * half, math.pi))
            emitters = [(p, a, half) for j, (p, a) in enumerate(ring) if j != i]
            if specular:
                paths = [naive.cross_specular(shapes, e, ear, CONVEX_EDGE_REACH_M, SIGHT_SLACK_M) for e in emitters]
            else:
                paths = [naive.cross_cone(shapes, e, ear, SIGHT_SLACK_M) for e in emitters]
            expected = min(paths, default=math.inf)
            assert found[i] == expected or abs(found[i] - expected) <= MICROMETRE, (world, ring, half, i)
            heard += math.isfinite(expected)
    assert heard > worlds


def test_alhazens_point_is_the_least_for_any_circle() -> None:
    rng = np.random.default_rng(12)
    solved = 0
    for _ in range(40):
        radius = float(10.0 ** rng.uniform(-3, 1))
        t, l = (complex(*rng.uniform(-4, 4, 2)) for _ in range(2))  # noqa: E741
        if min(abs(t), abs(l)) <= radius:
            continue
        px, py, path = mirror_on_circle(t.real, t.imag, l.real, l.imag, 0.0, 0.0, radius)
        _, least = naive.least_over_circle(radius, t, l)
        assert path == least or abs(path - least) <= 1e-9
        if math.isfinite(path):
            assert math.hypot(px, py) == pytest.approx(radius)
            solved += 1
    assert solved > 10


# Cases one can check by looking: the closed forms of a plane, a corner, an edge.


def test_a_wall_answers_from_the_mirror_image() -> None:
    assert pair(WorldConfig(wall=(wall(2, -9, 2, 9),))) == pytest.approx(0.5 * math.hypot(4.0, 0.2), abs=1e-12)


@pytest.mark.parametrize("opening_deg", [90.0, 80.0])
def test_a_corner_answers_over_both_walls(opening_deg: float) -> None:
    half = math.radians(0.5 * opening_deg)
    vertex, reach = complex(1.5, 0.1), 2.0
    ends = [vertex + reach * np.exp(1j * (math.pi + turn)) for turn in (-half, half)]
    world = WorldConfig(wall=tuple(wall(vertex.real, vertex.imag, end.real, end.imag) for end in ends))
    own = abs(vertex)
    # Twice the corner's angle round it: half a turn for a right angle, so X² = 2 (a² + b²) − L².
    expected = min(
        math.sqrt(2 * own**2 - 2 * own**2 * math.cos(2 * math.radians(opening_deg) + way * 2 * math.atan2(0.1, 1.5)))
        for way in (-1, 1)
        if 2 * math.radians(opening_deg) + way * 2 * math.atan2(0.1, 1.5) < math.pi
    )
    assert pair(world) == pytest.approx(0.5 * expected, abs=1e-12)
    if opening_deg == 90.0:
        assert expected == pytest.approx(math.sqrt(4 * own**2 - 0.2**2), abs=1e-12)


def test_a_wide_corner_scatters_from_the_corner_itself() -> None:
    half = math.radians(60.0)
    ends = [1.5 + 2.0 * np.exp(1j * (math.pi + turn)) for turn in (-half, half)]
    world = WorldConfig(wall=tuple(wall(1.5, 0.0, end.real, end.imag) for end in ends))
    assert pair(world) == pytest.approx(0.5 * (1.5 + math.hypot(1.5, 0.2)), abs=1e-12)


def test_an_edge_is_heard_from_near_only() -> None:
    def edge_at(distance: float) -> WorldConfig:
        return WorldConfig(
            box=(BoxConfig(x_m=distance + math.sqrt(0.5), y_m=0.1, width_m=1, depth_m=1, angle_deg=45),)
        )

    assert pair(edge_at(0.9)) == pytest.approx(math.hypot(0.9, 0.1), abs=1e-12)
    assert pair(edge_at(1.1)) == math.inf


def test_either_leg_can_be_hidden() -> None:
    far = wall(4, -5, 4, 5)
    assert pair(WorldConfig(wall=(far,))) == pytest.approx(0.5 * math.hypot(8.0, 0.2))
    for y in (-0.02, 0.12):  # slabs that send their own echoes elsewhere
        slab = wall(1.0, y, 1.3, y + 0.08)
        assert pair(WorldConfig(wall=(far, slab))) == math.inf


def test_the_first_of_several_pulses_is_heard() -> None:
    world = WorldConfig(drum=(drum(2.0, 0.0, 0.3),))
    sensors = [(0j, 0.0), (0.3j, -0.1), (0.15j, 0.0)]
    one, other = (half_paths(world, sensors, 0.5, specular=True, heard=heard)[2] for heard in (
        np.array([[False, False, k == 0], [False, False, k == 1], [False] * 3]) for k in range(2)
    ))  # fmt: skip
    both = half_paths(world, sensors, 0.5, specular=True)[2]
    assert both == min(one, other)
    assert one != other


@pytest.mark.parametrize("specular", [True, False])
def test_a_sensor_inside_a_drum_hears_at_once(specular: bool) -> None:
    assert pair(WorldConfig(drum=(drum(0.1, 0, 1),)), specular=specular) == 0.0
    assert pair(WorldConfig(drum=(drum(9, 0, 1),)), specular=specular, turn_deg=90.0) == math.inf
