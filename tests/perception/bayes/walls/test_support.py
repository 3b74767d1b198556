"""What many recent readings say of a line at a time, against one reading at a time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.scratch import NearReadings
from perception.bayes.memory.wall_records import IS_FREE, IS_KNOWN, RECENT_READINGS_MAX, RecentReading, Wall, WallMap
from perception.bayes.walls import support as wall_support
from perception.bayes.walls.contact import BEAM_EDGE, FOOT, NOWHERE, contact, range_sigma
from perception.records import Records, records, zeros
from perception.shared_numbers import FAR
from tests.perception.bayes.random_tracks import P, S, examples
from tests.perception.bayes.rooms import new_room, place_wall


def one_at_a_time(room: WallMap, wall: Wall, recent: Records[RecentReading], base: float, edges: bool) -> float:
    """Return the support of a line by readings, each by itself."""
    total = 1.0
    for one in recent:
        kind, expected, along, dot = contact(wall, one.reading, P)
        if kind == NOWHERE or abs(along) > 3.0 or (kind == BEAM_EDGE and not edges):
            continue
        e = one.reading.range_m - expected
        if abs(e) < 2.5 * range_sigma(room, expected) + 0.03 * min(abs(along), 1.5) / base:
            if one.is_free == IS_FREE:
                total += 1.0 if kind == FOOT else 0.6
        elif e > 0.3 and abs(along) < 0.5 and kind == FOOT and dot >= S.cos_must_answer:
            total -= 0.7
    return total


@examples(40, 400)
def test_many_readings_support_a_line_as_each_does_alone(examples: int) -> None:
    """Echoes of its foot and of the beam's edge, known ones, passes, silences: any number, as a processor takes 8."""
    rng, (_, room) = np.random.default_rng(83), new_room()
    near = records(NearReadings, zeros(NearReadings, 1))[0]
    wall, seen = room.walls[0], set()
    for _ in range(examples):
        n = int(rng.choice([0, 1, 7, 8, 9, 200, RECENT_READINGS_MAX]))
        normal, base = float(rng.uniform(-3, 3)), float(rng.uniform(0.3, 2.0))
        place_wall(wall, rng.uniform(-1, 1, 2), normal, float(rng.uniform(0.5, 2.0)))
        rows = zeros(RecentReading, max(n, 1))
        recent = records(RecentReading, rows)[:n]
        for k in range(n):
            q, axis = recent[k].reading, normal + rng.normal(0, 0.5)
            q.x, q.y = wall.origin_x + rng.uniform(-2, 2), wall.origin_y + rng.uniform(-2, 2)
            q.axis_x, q.axis_y = math.cos(axis), math.sin(axis)
            _, expected, _, _ = contact(wall, q, P)
            q.range_m = float(rng.choice([expected + rng.normal(0, 0.01), rng.uniform(0.3, 4), 2 * FAR]))
            recent[k].is_free = int(rng.choice([IS_FREE, IS_KNOWN]))
            wall_support.copy_near(recent[k], near, k)
        for edges in (False, True):
            room.edge_echoes = 100.0 if edges else 0.0
            expected = one_at_a_time(room, wall, recent, base, edges)
            assert wall_support.support(room, near, n, wall, base, P) == pytest.approx(expected, abs=1e-12)
            seen.add((edges, expected > 1.0))
    assert seen == {(False, False), (False, True), (True, False), (True, True)}
