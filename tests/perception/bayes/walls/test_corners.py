"""Corners of walls, against the solution of two equations, and the places of points by their echoes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.state import ESTABLISHED, Memory
from perception.bayes.memory.wall_records import CORNERS_MAX, EDGES_MAX, WallMap
from perception.bayes.walls import corners as wall_corners
from perception.bayes.walls.crossing import position_along
from perception.shared_numbers import FAR
from tests.perception.bayes.random_tracks import P, S, examples, pair
from tests.perception.bayes.rooms import SIGMA, fill, new_room, place_wall, reading


def corner_room() -> tuple[Memory, WallMap]:
    """Return a room whose two walls end near their crossing at (2, 2)."""
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    place_wall(room.walls[1], np.zeros(2), math.pi / 2, 2.0)
    fill(memory, room.walls[0], 0.0, 1.5)
    fill(memory, room.walls[1], -1.5, 0.0)
    wall_corners.find_corners(memory.s)
    return memory, room


def test_an_edge_beyond_a_doorway_stays_that_of_the_next_span() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -1.2, -0.42)
    fill(memory, room.walls[0], 0.42, 1.2)
    wall_corners.find_corners(memory.s)
    ends = [-1.2, -0.42, 0.42, 1.2]
    edges = [room.edges[k] for k in range(EDGES_MAX) if room.edges[k].is_used == 1]
    assert sorted(it.y for it in edges) == pytest.approx(ends, abs=0.07)
    edges[1].is_used = 0  # as if it had not been found before
    last = max(edges, key=lambda it: it.y)
    last.echoes = 9.0
    wall_corners.find_corners(memory.s)
    edges = [room.edges[k] for k in range(EDGES_MAX) if room.edges[k].is_used == 1]
    assert sorted(it.y for it in edges) == pytest.approx(ends, abs=0.07)
    assert max(edges, key=lambda it: it.echoes).y == pytest.approx(1.2, abs=0.07)


def test_a_corner_keeps_its_echoes_while_its_walls_last() -> None:
    memory, room = corner_room()
    corner = room.corners[0]
    assert (corner.x, corner.y, corner.echoes, corner.is_edge) == pytest.approx((2.0, 2.0, 0.0, 0))
    for _ in range(3):
        wall_corners.enter_echo(room, corner, reading(0.5, 0.5, math.pi / 4, math.hypot(1.5, 1.5)))
        for axis, range_m in ((math.pi / 4, 4.0), (math.pi / 4, 1.0), (0.0, 4.0)):
            q = reading(0.0, 0.0, axis, range_m)
            wall_corners.enter_looks(room, memory.tracks, room.corners, CORNERS_MAX, q, P)
    wall_corners.find_corners(memory.s)
    assert (corner.is_used, corner.echoes, corner.passes, corner.ended) == (1, 3.0, 3.0, 3.0)
    assert (corner.far_echoes, corner.far_passes) == (3.0, 3.0)
    drum = memory.tracks[0]
    drum.status, drum.is_named, drum.x, drum.y, drum.radius = ESTABLISHED, 1, 1.0, 1.0, 0.3
    wall_corners.enter_looks(room, memory.tracks, room.corners, CORNERS_MAX, reading(0.0, 0.0, math.pi / 4, 4.0), P)
    assert (corner.passes, corner.far_passes) == (3.0, 3.0), "what stands behind a drum cannot be seen to be missing"
    room.walls[1].weight = 0.0
    wall_corners.find_corners(memory.s)
    assert corner.is_used == 0


@examples(10, 100)
def test_the_place_of_a_corner_is_the_weighted_mean_of_its_lines_and_echoes(examples: int) -> None:
    rng = np.random.default_rng(47)
    for _ in range(examples):
        memory, room = corner_room()
        corner, point = room.corners[0], np.array([2.0, 2.0])
        rows: list[tuple[float, float]] = []
        levels: list[float] = []
        weights: list[float] = []
        for wall, normal in ((room.walls[0], (1.0, 0.0)), (room.walls[1], (0.0, 1.0))):
            u = position_along(wall, 2.0, 2.0)
            rows.append(normal)
            levels.append(2.0)
            variance = wall.variance_offset + 2.0 * u * wall.covariance + u * u * wall.variance_slope
            weights.append(1.0 / (variance + 0.002**2))
        for _ in range(int(rng.integers(1, 9))):
            sensor = rng.uniform(-1.0, 1.0, 2)
            away = math.dist(sensor, point)
            range_m = away + float(rng.normal(0.0, SIGMA))
            wall_corners.enter_echo(room, corner, reading(*pair(sensor), 0.8, range_m))
            rows.append(pair((point - sensor) / away))
            levels.append(float(np.array(rows[-1]) @ sensor) + range_m)
            weights.append(1.0 / SIGMA**2)
        a, w = np.array(rows), np.array(weights)
        covariance = np.linalg.inv(a.T @ (w[:, None] * a))
        wall_corners.find_corners(memory.s)
        assert (corner.x, corner.y) == pytest.approx(covariance @ (a.T @ (w * levels)), abs=1e-6)
        found = [corner.covariance_xx, corner.covariance_xy, corner.covariance_yy]
        assert found == pytest.approx([covariance[0, 0], covariance[0, 1], covariance[1, 1]], rel=1e-6, abs=1e-12)


def test_the_end_of_a_wall_moves_to_the_edge_that_is_heard() -> None:
    memory, room = new_room()
    room.edge_echoes = 100.0
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -2.0, 1.0)
    wall_corners.find_corners(memory.s)
    edges = [edge for edge in room.edges if edge.is_used == 1]
    edges.sort(key=lambda edge: edge.y)
    assert [edge.y for edge in edges] == pytest.approx([-1.98, 1.02], abs=0.06)
    assert [edge.second for edge in edges] == [0, 1]
    post, rng = np.array([2.0, 1.13]), np.random.default_rng(48)
    for _ in range(2):
        for y in np.linspace(1.3, 2.6, 12):
            sensor = np.array([0.7, y])
            off = post - sensor
            range_m = float(np.hypot(*off) + rng.normal(0.0, SIGMA))
            q = reading(*pair(sensor), math.atan2(off[1], off[0]), range_m)
            at, error = wall_corners.point_of(room, room.edges, EDGES_MAX, q, P)
            assert error < 1.0
            wall_corners.enter_echo(room, room.edges[at], q)
        wall_corners.find_corners(memory.s)
    (edge,) = (edge for edge in room.edges if edge.is_used == 1 and edge.second == 1)
    assert (edge.x, edge.y) == pytest.approx(post, abs=0.01)
    assert (edge.echoes, edge.is_edge) == (24.0, 1)


def test_a_point_that_mirrors_answer_from_afar_is_an_inside_corner() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -2.0, 1.0)
    for is_edge, far_passes in ((0, 3.0), (1, 30.0)):
        wall_corners.find_corners(memory.s)
        (edge,) = (edge for edge in room.edges if edge.is_used == 1 and edge.second == 1)
        edge.far_echoes, edge.far_passes = 20.0, far_passes
        wall_corners.find_corners(memory.s)
        assert edge.is_edge == is_edge


def test_an_edge_between_mirrors_explains_no_echo_from_afar_once_it_was_passed_from_there() -> None:
    _, room = corner_room()
    corner = room.corners[0]
    near, far = (reading(2.0 - a, 2.0 - a, math.pi / 4, math.hypot(a, a)) for a in (0.4, 1.5))
    corner.is_edge, room.edge_silences = 1, 50.0
    for passes, echoes, expected in ((0.0, 0.0, 0), (9.0, 0.0, -1), (9.0, 10.0, 0)):
        corner.far_passes, corner.far_echoes = passes, echoes
        assert wall_corners.point_of(room, room.corners, CORNERS_MAX, far, P)[0] == expected
        assert wall_corners.point_of(room, room.corners, CORNERS_MAX, near, P)[0] == 0
    corner.far_echoes, room.edge_echoes = 0.0, 100.0
    assert wall_corners.point_of(room, room.corners, CORNERS_MAX, far, P)[0] == 0, "rough edges answer from afar"


def test_no_echo_says_nothing_of_a_point_that_is_too_far_away_to_answer() -> None:
    memory, room = corner_room()
    corner = room.corners[0]
    for beyond, expected in ((0.0, 0.0), (-0.5, 1.0)):
        away = (P[0].range_max_m + beyond) / math.sqrt(2.0)
        q = reading(corner.x - away, corner.y - away, math.pi / 4, 2.0 * FAR)
        wall_corners.enter_looks(room, memory.tracks, room.corners, CORNERS_MAX, q, P)
        assert corner.passes == corner.far_passes == expected


def test_a_point_explains_only_echoes_of_beams_that_hold_it() -> None:
    _, room = corner_room()
    away, half = math.hypot(2.0, 2.0), S.half_angle_rad
    for turn, error, expected in ((0.0, 0.0, 0), (0.9 * half, 0.02, 0), (1.1 * half, 0.0, -1), (0.0, 0.2, -1)):
        q = reading(0.0, 0.0, math.pi / 4 + turn, away + error)
        assert wall_corners.point_of(room, room.corners, CORNERS_MAX, q, P)[0] == expected
