"""Checks of models against oracles on random cases, and when they are careful."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.parameters import CONFIRMED_SIDES, TRUSTED_M
from perception.bayes.memory.state import ESTABLISHED, FREE, Memory
from perception.bayes.memory.wall_records import Wall
from perception.bayes.tracks import model_check
from perception.shared_numbers import FAR
from tests import naive_bayes, naive_naming, naive_walls
from tests.naive_walls import Array
from tests.perception.bayes import box_readings
from tests.perception.bayes.random_tracks import (
    COSINES,
    P,
    S,
    around,
    enter_readings,
    examples,
    new_memory,
    noises,
    pair,
    place_of,
    predict_own,
    random_track,
)
from tests.perception.bayes.rooms import fill, new_room, place_wall

SPAN = (-1.2, 1.5)
"""Ends of the only span of each wall, m."""
LEAST = math.log(0.03)
"""Log ratio of an outlier, nat."""


def room_evidence(w: Array, walls: list[tuple[float, float]], points: Array, edges: bool, level: int) -> Array:
    """Return the best log ratio of each reading under walls (normal, distance) with one span, and points."""
    noise, best = noises()[level], np.full(len(w), LEAST)
    for j, q in enumerate(w):
        axis, found = math.atan2(q[3], q[2]), []
        for normal, distance in walls:
            off = abs((axis - normal + math.pi) % (2.0 * math.pi) - math.pi)
            ahead = distance - q[:2] @ (math.cos(normal), math.sin(normal))
            if ahead <= 0.0 or math.cos(off) < 0.25 or (off > S.half_angle_rad and not edges):
                continue
            reach, along = naive_walls.answer(q[:2], axis, S.half_angle_rad, normal, distance)
            if SPAN[0] - 0.2 <= along <= SPAN[1] + 0.2:
                found.append(reach)
        for point in points:
            seen = naive_bayes.look(w[j : j + 1], point)
            if seen.cos[0] >= COSINES[0]:
                found.append(float(seen.d[0]))
        for reach in found:
            best[j] = max(best[j], naive_bayes.evidence(noise, q[None, 4], q[None, 4] - reach)[0])
    return best


def is_in_wall(wall: Wall, normal: float, distance: float, centre: Array, rho: float) -> bool:
    """Return whether a wall's only span passes a circle within 0.7 of its radius, if it is straight beyond doubt."""
    n, span = np.array([math.cos(normal), math.sin(normal)]), wall.spans[0]
    along = float(centre @ (-n[1], n[0]))
    is_straight = wall.span_count > 0 and span.chi2 > 60.0 and span.weight > 20.0
    return bool(is_straight and abs(distance - centre @ n) < 0.7 * rho and span.low <= along <= span.high)


@examples(40, 400)
def test_room_and_sides_are_those_of_the_hits(examples: int) -> None:
    rng, wide, explained, cut = np.random.default_rng(60), 0, 0, 0
    for _ in range(examples):
        memory, room = new_room()
        memory.state["noise_level"] = level = int(rng.integers(4, 20))
        walls = [(float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(0.2, 1.0))) for _ in range(2)]
        for k, (normal, distance) in enumerate(walls):
            place_wall(room.walls[k], np.zeros(2), normal, distance)
            fill(memory, room.walls[k], *SPAN)
        points = rng.uniform(-1.0, 1.0, (2, 2))
        for point, at in zip((room.corners[0], room.edges[3]), points, strict=True):
            point.is_used, (point.x, point.y) = 1, pair(at)
        edges = bool(rng.random() < 0.5)
        room.edge_echoes = 9.0 * edges
        random_track(rng, memory, 0, ESTABLISHED)
        track, centre, rho = memory.tracks[0], place_of(memory, 0), float(memory.tracks[0].radius)
        w = around(rng, 60, centre, rho)
        enter_readings(memory, w)
        predict_own(memory, len(w), centre, rho)
        model_check.check_model(memory.s, P, track, len(w))
        seen = naive_bayes.look(w, centre)
        e = w[:, 4] - (seen.d - rho)
        misses = int(((e > S.gate_m) & (seen.cos >= COSINES[2])).sum())
        w, e, seen_u = (a[(np.abs(e) <= S.gate_m) & (seen.cos >= COSINES[1])] for a in (w, e, seen.u))
        by_room = room_evidence(w, walls, points, edges, level)
        want = naive_naming.model_check(
            naive_bayes.evidence(noises()[level], w[:, 4], e), by_room, np.arctan2(seen_u[:, 1], seen_u[:, 0]), misses
        )  # fmt: skip
        is_cut = any(is_in_wall(room.walls[k], *walls[k], centre, rho) for k in range(2))
        cut += is_cut
        assert track.room_lead == pytest.approx(max(want[0], 0.0) if is_cut else want[0], rel=1e-6, abs=1e-6)
        assert track.sides == want[1]
        wide += want[1] >= CONFIRMED_SIDES
        explained += int((by_room > 0.0).sum())
    assert 0.1 * examples < wide < examples
    assert explained > 0.5 * examples
    assert 0.1 * examples < cut < 0.9 * examples


def hear(memory: Memory, ranges: list[float], moved_m: float = 0.0) -> None:
    """Count a firing's ranges, after the ring has moved."""
    for i, range_m in enumerate(ranges):
        memory.s[0].scratch.fired[i].range_m = range_m
    model_check.count_surroundings(memory.s, len(ranges), moved_m)


def test_everything_echoes_where_hardly_a_beam_is_silent() -> None:
    memory = new_memory()
    assert not model_check.everything_echoes(memory.s, P), "nothing is known yet"
    for _ in range(50):
        hear(memory, [1.0] * 7 + [2.0 * FAR])
    assert memory.s[0].silent / (memory.s[0].heard + memory.s[0].silent) == pytest.approx(0.125, abs=0.01)
    assert model_check.everything_echoes(memory.s, P)
    for _ in range(500):
        hear(memory, [1.0] * 6 + [2.0 * FAR] * 2)
    assert not model_check.everything_echoes(memory.s, P), "mirrors leave a quarter of the beams silent"
    memory.state["room"]["edge_echoes"] = 9.0
    assert model_check.everything_echoes(memory.s, P), "walls answer from the beam's edge"


def test_a_withdrawn_name_makes_careful_until_a_model_is_confirmed() -> None:
    memory = new_memory()
    hear(memory, [1.0, 2.0 * FAR], TRUSTED_M + 1.0)
    assert not model_check.is_careful(memory.s, memory.tracks, P)
    track = memory.tracks[0]
    track.status, track.radius = FREE, 0.3
    model_check.count_names(memory.s, memory.tracks, P, 0, 5.0, 5.0)
    assert memory.s[0].names_withdrawn == 1
    assert model_check.is_careful(memory.s, memory.tracks, P)
    other = memory.tracks[1]
    other.status, other.is_named, other.x, other.y = ESTABLISHED, 1, 5.0, 5.1
    model_check.count_names(memory.s, memory.tracks, P, 0, 5.0, 5.0)
    assert memory.s[0].names_withdrawn == 1, "another track took over"
    other.sides = CONFIRMED_SIDES - 1
    model_check.count_names(memory.s, memory.tracks, P, 1, 5.0, 5.1)
    assert other.is_confirmed == 0
    other.sides = CONFIRMED_SIDES
    other.outline_lead, other.leads[1] = -9.0, -2.0
    model_check.count_names(memory.s, memory.tracks, P, 1, 5.0, 5.1)
    assert other.is_confirmed == 0, "only its prior makes it likelier than the first alternative"
    other.leads[1] = -4.0
    model_check.count_names(memory.s, memory.tracks, P, 1, 5.0, 5.1)
    assert (other.is_confirmed, memory.s[0].names_withdrawn, memory.s[0].unconfirmed_m) == (1, 0, 0.0)
    assert not model_check.is_careful(memory.s, memory.tracks, P)


def test_where_most_bodies_are_something_else_the_prior_is_against_a_model() -> None:
    memory, model, rival = new_memory(), 0, S.model_count
    for t, kind in enumerate((model, rival, rival)):
        track = memory.tracks[t]
        track.status, track.kind, track.probability = ESTABLISHED, kind, 0.99
    memory.tracks[0].is_named, memory.tracks[2].probability = 1, 0.9
    hear(memory, [1.0, 2.0 * FAR])
    assert not model_check.is_careful(memory.s, memory.tracks, P), "the second rival is not sure"
    memory.tracks[2].probability = 0.96
    assert model_check.is_careful(memory.s, memory.tracks, P)
    memory.tracks[2].status = FREE
    assert not model_check.is_careful(memory.s, memory.tracks, P)


def test_no_model_stands_in_a_wall() -> None:
    """A wall that is straight beyond doubt passes a body at a third of its radius."""
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.array([2.0, 0.0]), 0.0)
    wall.span_count, span = 1, wall.spans[0]
    span.low, span.high, span.weight = -1.0, 1.0, 30.0
    track = memory.tracks[0]
    track.kind, track.radius, track.x, track.y = 0, 0.3, 1.9, 0.0
    enter_readings(memory, np.array([[0.5, y, 1.0, 0.0, 1.1] for y in (-0.2, 0.0, 0.2)]))
    predict_own(memory, 3, np.array([1.9, 0.0]), 0.3)
    for chi2, is_cut in ((50.0, False), (70.0, True)):
        span.chi2 = chi2
        model_check.check_model(memory.s, P, track, 3)
        assert (track.room_lead >= 0.0) == is_cut


@pytest.mark.parametrize(
    ("ends", "short_m", "lead", "is_wall"),
    [
        ((-1.9, 1.9), 0.0, 7.0, True),
        ((-1.9, 1.9), 0.0, 9.0, False),
        ((-0.4, 0.4), 0.0, 0.0, False),
        ((-1.9, 1.9), 0.1, 0.0, False),
    ],
    ids=["the wall explains them as well", "the box is far better", "its own side", "the box stands before it"],
)
def test_a_long_wall_that_explains_a_polygons_readings_as_well_is_in_its_place(
    ends: tuple[float, float], short_m: float, lead: float, is_wall: bool
) -> None:
    """Also the readings that a beam's edge gets from it: a box has corners that would answer there."""
    memory, room = new_room()
    memory.state["noise_level"] = box_readings.LEVEL
    room.edge_echoes = 100.0
    place_wall(room.walls[0], np.zeros(2), 0.5 * math.pi, 1.0)
    fill(memory, room.walls[0], *ends)
    half, slant = float(S.half_angle_rad), math.radians(40.0)
    w = [(0.04 * j - 0.2, 0.0, 0.0, 1.0, 1.0 - short_m) for j in range(10)]
    reach = 1.0 / math.cos(slant - half)
    w += [(0.04 * j - 0.8, 0.0, math.sin(slant), math.cos(slant), reach - short_m) for j in range(10)]
    box_readings.enter_job(memory, np.array(w), box_readings.LEVEL)
    track = memory.s[0].polygons[0]
    track.status = ESTABLISHED
    most = naive_bayes.evidence(noises()[box_readings.LEVEL], np.ones(1), np.zeros(1))[0]
    track.log_likelihood_ratio = 20.0 * most + lead
    assert model_check.is_on_long_walls(memory.s, box_readings.P, track) == is_wall
