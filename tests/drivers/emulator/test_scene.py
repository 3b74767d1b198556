"""A world file as circles, straight surfaces, and the corners where surfaces meet."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from config.world import BoxConfig, PolygonConfig, WorldConfig
from drivers.emulator.scene import JOIN_M, compile_scene
from drivers.emulator.surfaces import AS_WORLD
from tests.drivers.emulator.one_sensor import drum, wall, world_of


def test_joint_of_two_walls_in_line_is_no_corner() -> None:
    scene = compile_scene(world_of("specular", wall=(wall(0, 0, 1, 0), wall(1, 0, 2, 0))))
    assert sorted(scene.corners["x"]) == [0.0, 2.0]


def test_a_box_has_four_sides_and_at_each_corner_an_inside_and_an_outside() -> None:
    box = BoxConfig(x_m=1.0, y_m=2.0, width_m=2.0, depth_m=1.0, angle_deg=90.0)
    scene = compile_scene(WorldConfig(box=(box,)))
    assert len(scene.segments) == 4
    assert len(scene.circles) == 0
    corners = scene.corners
    assert len(corners) == 8
    places = {(round(float(x), 9), round(float(y), 9)) for x, y in zip(corners["x"], corners["y"], strict=True)}
    assert places == {(0.5, 1.0), (0.5, 3.0), (1.5, 1.0), (1.5, 3.0)}
    assert sorted(np.degrees(corners["opening"]).round(6).tolist()) == [90.0] * 4 + [270.0] * 4


def test_a_wall_that_ends_on_another_makes_two_concave_corners() -> None:
    scene = compile_scene(world_of("specular", wall=(wall(3, -9, 3, 9), wall(3, 1, 1, 1))))
    at = (scene.corners["x"] == 3.0) & (scene.corners["y"] == 1.0)
    assert np.degrees(scene.corners["opening"][at]).tolist() == pytest.approx([90.0, 90.0])


def test_walls_that_cross_make_four_corners() -> None:
    scene = compile_scene(world_of("specular", wall=(wall(-1, 0, 1, 0), wall(0, -1, 0, 1))))
    at = np.hypot(scene.corners["x"], scene.corners["y"]) < JOIN_M
    assert np.degrees(scene.corners["opening"][at]).tolist() == pytest.approx([90.0] * 4)


def test_a_free_end_is_open_all_round() -> None:
    scene = compile_scene(world_of("specular", wall=(wall(0, 0, 1, 0),)))
    assert scene.corners["opening"].tolist() == [2.0 * math.pi] * 2


def test_ends_that_nearly_meet_are_one_corner_and_tiny_surfaces_are_left_out() -> None:
    near = wall(1.0 + 0.5 * JOIN_M, 0.0, 1.0, 1.0)
    scene = compile_scene(world_of("specular", wall=(wall(0, 0, 1, 0), near, wall(5, 5, 5, 5 + 0.5 * JOIN_M))))
    assert len(scene.segments) == 2
    corner = np.abs(scene.corners["x"] - 1.0) + np.abs(scene.corners["y"]) < 2 * JOIN_M
    assert sorted(np.degrees(scene.corners["opening"][corner]).round(1).tolist()) == [90.0, 270.0]


def test_drums_are_circles_and_polygons_are_closed() -> None:
    triangle = PolygonConfig(vertices_m=((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))
    scene = compile_scene(WorldConfig(drum=(drum(1, 2, 0.5),), polygon=(triangle,)))
    assert scene.circles.tolist() == [(1.0, 2.0, 0.5, AS_WORLD)]
    assert scene.segments[-1].tolist() == (0.0, 1.0, 0.0, 0.0, AS_WORLD)


def test_of_many_sides_every_end_and_every_crossing_is_found_once() -> None:
    """As found by comparing each side with each, which a building's hundreds are not."""
    ends = np.random.default_rng(5).integers(-6, 7, (40, 4)).astype(float)
    ends = ends[(ends[:, :2] != ends[:, 2:]).any(axis=1)]
    scene = compile_scene(world_of("specular", wall=tuple(wall(*side) for side in ends.tolist())))
    places = {(x, y) for side in ends.tolist() for x, y in (side[:2], side[2:])}
    for (ax, ay, bx, by), (cx, cy, dx, dy) in itertools.combinations(ends.tolist(), 2):
        matrix = np.array([[bx - ax, cx - dx], [by - ay, cy - dy]])
        if abs(np.linalg.det(matrix)) > 0.5:
            t, s = np.linalg.solve(matrix, [cx - ax, cy - ay]).tolist()
            if min(t, s) >= -1e-9 and max(t, s) <= 1.0 + 1e-9:
                places.add((ax + t * (bx - ax), ay + t * (by - ay)))
    expected = {(round(x, 6) + 0.0, round(y, 6) + 0.0) for x, y in places}
    opening: dict[tuple[float, float], float] = {}
    for x, y, _, angle, *_ in scene.corners.tolist():
        at = (round(x, 6) + 0.0, round(y, 6) + 0.0)
        opening[at] = opening.get(at, 0.0) + angle
    straight = expected - opening.keys()
    assert opening.keys() <= expected
    assert all(abs(remainder) < 1e-6 for remainder in (math.remainder(a, math.pi) for a in opening.values()))
    assert len(straight) <= 2, "only points in the middle of straight surfaces are no corners"
