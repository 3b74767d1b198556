"""New walls from recent echoes: found among outliers; drums and noise give none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.wall_records import CANDIDATE, IS_FREE, IS_KNOWN
from perception.bayes.walls import initiation as wall_initiation
from perception.bayes.walls.contact import wall_normal, wall_point
from tests import naive_walls
from tests.perception.bayes.random_tracks import P, S, examples, pair
from tests.perception.bayes.rooms import SIGMA, facing, new_room, place_wall, reading, remember_free, spans


@examples(100, 1000)
def test_candidates_explain_both_echoes(examples: int) -> None:
    rng, seen = np.random.default_rng(47), set()
    for _ in range(examples):
        a, b = (
            reading(*pair(rng.uniform(-0.5, 0.5, 2)), rng.uniform(-0.3, 0.3), rng.uniform(1.5, 2.5)) for _ in range(2)
        )
        for choice in range(4):
            is_line, nx, ny, c = wall_initiation.candidate(a, b, choice, P)
            if not is_line:
                continue
            seen.add(choice)
            for q in (a, b):
                if choice < 2:
                    assert nx * q.x + ny * q.y + q.range_m == pytest.approx(c, abs=1e-9)
                else:
                    axis = math.atan2(q.axis_y, q.axis_x) + (5 - 2 * choice) * S.half_angle_rad
                    x, y = q.x + q.range_m * math.cos(axis), q.y + q.range_m * math.sin(axis)
                    assert nx * x + ny * y == pytest.approx(c, abs=1e-9)
    assert seen == {0, 1, 2, 3}


@examples(3, 40)
def test_a_wall_among_outliers_is_found_and_its_echoes_are_known(examples: int) -> None:
    rng = np.random.default_rng(48)
    for _ in range(examples):
        memory, room = new_room()
        normal = float(rng.uniform(-3, 3))
        n, t = np.array([math.cos(normal), math.sin(normal)]), np.array([-math.sin(normal), math.cos(normal)])
        rows = []
        for k in range(40):
            place = rng.uniform(-0.7, 0.7) * t - rng.uniform(0.6, 1.4) * n
            axis = facing(normal, rng)
            exact, _ = naive_walls.touch(place, axis, S.half_angle_rad, normal, 0.0)
            rows.append((*place, axis, exact + rng.normal(0, SIGMA) if k % 8 else rng.uniform(0.2, 4.0)))
        remember_free(room, np.array(rows))
        wall_initiation.try_wall(memory, P, 39)
        wall = room.walls[0]
        assert wall.weight > 20.0
        nx, ny = wall_normal(wall)
        assert abs(n[0] * ny - n[1] * nx) < 0.02
        assert abs(np.array(wall_point(wall, float(spans(wall).mean()))) @ n) < 0.01
        known = sum(room.recent[k].is_free == IS_KNOWN for k in range(40))
        assert 30 <= known <= 37


def test_what_lies_where_a_candidate_is_not_known_does_not_turn_it() -> None:
    memory, room = new_room()
    near = [(1.0, y, 0.0, 1.0) for y in np.linspace(-0.3, 0.3, 12)]
    far = [(1.0, y, 0.0, 1.25) for y in np.linspace(2.8, 3.0, 8)]
    remember_free(room, np.array(near + far))
    candidate = room.walls[CANDIDATE]
    place_wall(candidate, np.array([1.0, 0.0]), 0.0, 1.0)
    candidate.variance_offset, candidate.variance_slope = 0.03**2, 0.04**2
    assert wall_initiation.enter_recent(memory.s, P) == 20, "between mirrors little lies on a line by chance"
    room.edge_echoes = 100.0
    assert wall_initiation.enter_recent(memory.s, P) == 12
    wall_initiation.fit_candidate(memory, P)
    assert abs(candidate.slope) < 0.01


def test_a_drum_and_random_ranges_are_no_walls() -> None:
    rng = np.random.default_rng(49)
    angles = np.linspace(-0.6, 0.6, 40)
    drum = np.column_stack(
        [1.3 * np.cos(angles), 1.3 * np.sin(angles), angles + math.pi, 1.0 + rng.normal(0, SIGMA, 40)]
    )
    noise = np.column_stack([rng.uniform(-1, 1, (60, 2)), rng.uniform(-3, 3, 60), rng.uniform(0.3, 5.0, 60)])
    for rows in (drum, noise):
        memory, room = new_room()
        remember_free(room, rows)
        for newest in range(0, len(rows), 6):
            wall_initiation.try_wall(memory, P, newest)
        assert all(room.walls[k].weight == 0.0 for k in range(4))
        assert all(room.recent[k].is_free == IS_FREE for k in range(len(rows)))
