"""Where readings touch walls, against a search over the beam; and what explains an echo."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.state import ESTABLISHED, TENTATIVE
from perception.bayes.walls import contact as wall_contact
from perception.bayes.walls import report as wall_report
from perception.bayes.walls.contact import BEAM_EDGE, FOOT, NOWHERE
from tests import naive_walls
from tests.perception.bayes.random_tracks import P, S, examples, pair
from tests.perception.bayes.rooms import facing, fill, new_room, place_wall, reading


@examples(60, 600)
def test_a_reading_touches_the_nearest_point_in_its_beam(examples: int) -> None:
    rng = np.random.default_rng(40)
    _, room = new_room()
    wall, kinds = room.walls[0], set()
    for _ in range(examples):
        normal, distance = rng.uniform(-math.pi, math.pi), rng.uniform(0.5, 4.0)
        turn = rng.uniform(-0.3, 0.3)
        place_wall(wall, np.zeros(2), normal + turn, distance / math.cos(turn))
        wall.slope = math.tan(turn)
        sensor, axis = rng.uniform(-1.0, 1.0, 2), normal + rng.normal(0.0, 0.4)
        kind, reach, along, dot = wall_contact.contact(wall, reading(*pair(sensor), axis, 1.0), P)
        kinds.add(kind)
        ahead = distance - sensor @ (math.cos(normal), math.sin(normal))
        if ahead <= 0.0 or math.cos(axis - normal) < 0.25:
            assert kind == NOWHERE
            continue
        expected, place = naive_walls.touch(sensor, axis, S.half_angle_rad, normal, distance)
        assert kind == (FOOT if abs(axis - normal) <= S.half_angle_rad else BEAM_EDGE)
        place = place * math.cos(turn) + distance * math.sin(-turn)
        assert (reach, along) == pytest.approx((expected, place), abs=2e-3)
        assert dot == pytest.approx(math.cos(axis - normal), abs=1e-9)
    assert kinds == {NOWHERE, FOOT, BEAM_EDGE}


def test_the_wall_of_least_error_explains_an_echo_where_it_has_a_span() -> None:
    rng = np.random.default_rng(41)
    memory, room = new_room()
    for k, (offset, low, high) in enumerate(((2.0, -1.0, 1.0), (2.02, -1.0, 1.0), (2.0, 3.0, 4.0))):
        place_wall(room.walls[k], np.zeros(2), 0.0, offset)
        fill(memory, room.walls[k], low, high)
    for y, margin, expected in ((0.0, 0.09, 1), (1.3, 0.09, -1), (1.3, 0.5, 1), (3.5, 0.09, 2), (5.0, 0.5, -1)):
        q = reading(0.0, y, facing(0.0, rng), 2.018 if expected == 1 else 2.0)
        owner, kind, error = wall_contact.explaining_wall(room, q, P, margin)
        assert (owner, kind) == (expected, FOOT if expected >= 0 else NOWHERE)
        assert (error < 1.0) == (expected >= 0)
    assert wall_contact.explaining_wall(room, reading(0.0, 0.0, 0.0, 2.1), P, 0.0)[0] == -1


def test_echoes_from_a_beams_edge_count_where_slanting_walls_answer() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -2.0, 2.0)
    q = reading(0.0, 0.0, 2.0 * S.half_angle_rad, 2.0 / math.cos(S.half_angle_rad))
    assert wall_contact.explaining_wall(room, q, P, 0.0) == (-1, NOWHERE, 1.0)
    room.edge_echoes, room.edge_silences = 9.0, 2.0
    assert wall_contact.explaining_wall(room, q, P, 0.0)[:2] == (0, BEAM_EDGE)


def test_where_hardly_a_beam_is_silent_echoes_of_edges_count_until_silences_lead() -> None:
    memory, room = new_room()
    for is_loud, silences, expected in ((0, 0.0, False), (1, 0.0, True), (1, 15.0, True), (1, 17.0, False)):
        room.is_loud, room.edge_silences = is_loud, silences
        assert wall_contact.edges_answer(room) is expected
        assert wall_report.edges_answer(memory) is expected


def test_ends_and_corners_explain_echoes() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    fill(memory, wall, -1.0, 1.0)
    x, y = wall_contact.wall_point(wall, wall.spans[0].high)
    for error, from_end in ((0.0, True), (0.2, False)):
        q = reading(0.5, 1.5, math.atan2(y - 1.5, x - 0.5), math.hypot(x - 0.5, y - 1.5) + error)
        assert wall_contact.is_from_end(room, wall, q, P) is from_end
    corner = room.corners[3]
    corner.is_used, corner.x, corner.y = 1, 0.0, 3.0
    assert wall_contact.corner_of(room, reading(0.0, 1.0, math.pi / 2, 2.0), P) == 3
    assert wall_contact.corner_of(room, reading(0.0, 1.0, 0.0, 2.0), P) == -1


@examples(100, 1000)
def test_a_certain_round_object_hides_what_lies_behind_it(examples: int) -> None:
    rng = np.random.default_rng(44)
    memory, _ = new_room()
    drum, hidden = memory.tracks[0], 0
    drum.status, drum.is_named, drum.radius = ESTABLISHED, 1, 0.3
    for _ in range(examples):
        sensor, point, centre = rng.uniform(-1.0, 1.0, (3, 2))
        drum.x, drum.y = pair(centre)
        way = sensor + np.linspace(0.0, 1.0, 2001)[:, None] * (point - sensor)
        nearest = np.hypot(*(way - centre).T)
        is_between = 0 < nearest.argmin() < 2000
        if abs(nearest.min() - 0.3) < 1e-3:
            continue
        q = reading(*pair(sensor), 0.0, 1.0)
        found = wall_contact.is_hidden(memory.tracks, q, *pair(point))
        assert found == (is_between and nearest.min() < 0.3)
        hidden += found
        drum.is_named, drum.probability = 0, 0.5
        assert not wall_contact.is_hidden(memory.tracks, q, *pair(point)), "it may be something else"
        drum.status, drum.probability = TENTATIVE, 1.0
        assert not wall_contact.is_hidden(memory.tracks, q, *pair(point))
        drum.status, drum.is_named = ESTABLISHED, 1
    assert 0.05 * examples < hidden < 0.95 * examples
