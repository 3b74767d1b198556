"""Reservoirs of tracks and the sensors' histories against their oracles."""

from __future__ import annotations

import numpy as np

from perception.bayes.inference import reservoir
from perception.bayes.memory.elements import BEARING_BINS, BIN_CAPACITY, HISTORY
from perception.kernel import Floats
from tests import naive_tracks
from tests.naive_tracks import rows
from tests.perception.bayes.random_tracks import (
    RADII,
    SENSORS,
    TRACKS,
    P,
    S,
    around,
    examples,
    history,
    kept_by,
    new_memory,
    pair,
    readings_of,
    scratch_readings,
)


def test_a_reservoir_keeps_the_newest_of_each_direction() -> None:
    rng, memory = np.random.default_rng(1), new_memory()
    for t, count in zip(range(TRACKS), (0, 5, 600, 1500), strict=False):
        want, centre = naive_tracks.Reservoir(BEARING_BINS, BIN_CAPACITY), rng.uniform(-1, 1, 2)
        for q in around(rng, count, centre, 0.3):
            reservoir.keep_reading(memory.tracks[t], *pair(centre), readings_of(q[None])[0])
            want.put(centre, q)
        assert rows(kept_by(memory, t)) == rows(q for kept in want.kept for q in kept)


@examples(12, 300)
def test_readings_about_a_circle_are_gathered_from_all_sensors(examples: int) -> None:
    rng, memory, total = np.random.default_rng(2), new_memory(), 0
    for _ in range(examples):
        centre, rho = rng.uniform(-1, 1, 2), float(rng.choice(RADII))
        remembered: list[Floats] = []
        for i in range(SENSORS):
            count = int(rng.integers(0, 2 * HISTORY))
            memory.s[0].sensors[i].kept = count
            history(memory, i)[...] = around(rng, HISTORY, centre + rng.normal(0, 0.1, 2), rho)
            remembered += list(history(memory, i)[: min(count, HISTORY)].copy())
        n = reservoir.gather_history(memory.s, P, *pair(centre), rho)
        want = naive_tracks.gather(remembered, centre, rho, S.cos_may_answer, S.range_max_m)
        assert rows(scratch_readings(memory, n)) == want[:n]
        total += n
    assert total > 30 * examples
