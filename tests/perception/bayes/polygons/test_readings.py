"""Readings that bear on a polygon against their oracle, and their collection from the sensors' histories."""

from __future__ import annotations

import cmath
import math

import numpy as np

from perception.bayes.memory.elements import HISTORY
from perception.bayes.polygons.readings import bears_on_polygon, gather_polygon_history
from tests.naive_tracks import rows
from tests.perception.bayes.box_readings import P, S
from tests.perception.bayes.random_tracks import (
    SENSORS,
    around,
    examples,
    history,
    new_memory,
    readings_of,
    scratch_readings,
)

BOUND = float(S.polygons[0].outer_radius_m)


def bears(q: np.ndarray, centre: np.ndarray, bound: float) -> bool:
    """Oracle: the beam meets the circle about the centre, which is in reach, and the range does not end before it."""
    to, axis = complex(*(centre - q[:2])), complex(q[2], q[3])
    off = abs(cmath.phase(to / axis))
    is_ahead = abs(to) * math.cos(off) > 0.0 and abs(to) <= S.pair_range_max_m
    beyond_edge = abs(to) * math.sin(max(0.0, off - S.half_angle_rad))
    return is_ahead and beyond_edge <= bound and q[4] >= abs(to) - bound - S.gate_m


@examples(600, 10_000)
def test_readings_bear_on_a_polygon_as_their_oracle_says(examples: int) -> None:
    rng, counts = np.random.default_rng(23), [0, 0]
    for _ in range(examples):
        bound, bearing = float(rng.uniform(0.1, 0.6)), rng.uniform(-math.pi, math.pi)
        axis = bearing + rng.normal(0, 0.5)
        far = rng.uniform(0.1, 5.0)
        place = -far * np.array([math.cos(bearing), math.sin(bearing)])
        q = np.array([*place, math.cos(axis), math.sin(axis), rng.uniform(0.0, 5.0)])
        want = bears(q, np.zeros(2), bound)
        assert bears_on_polygon(readings_of(q[None])[0], 0.0, 0.0, bound, P) == want
        counts[int(want)] += 1
    assert min(counts) > 0.2 * examples


def test_the_readings_of_all_sensors_are_gathered() -> None:
    rng, memory = np.random.default_rng(24), new_memory()
    centre, want = np.array([0.4, -0.1]), []
    for i in range(SENSORS):
        memory.s[0].sensors[i].kept = count = int(rng.integers(0, 2 * HISTORY))
        history(memory, i)[...] = around(rng, HISTORY, centre, 0.3)
        want += [q for q in history(memory, i)[: min(count, HISTORY)] if bears(q, centre, BOUND)]
    n = gather_polygon_history(memory.s, P, 0, *centre.tolist())
    assert n > 100
    assert rows(scratch_readings(memory, n)) == rows(want)
