"""The readings of a firing against their oracle: they are placed, and what repeats itself is left out."""

from __future__ import annotations

import numpy as np
import pytest

from perception.bayes.inference import placement
from perception.bayes.memory.elements import HISTORY
from perception.bayes.memory.scratch import UNEXPLAINED
from perception.bayes.tracks import observe
from tests import naive_tracks
from tests.naive_tracks import rows
from tests.perception.bayes.random_tracks import (
    MOUNTS,
    NOISES,
    SENSORS,
    P,
    S,
    examples,
    history,
    new_memory,
    numbers,
    pair,
    random_drive,
)


@examples(40, 500)
def test_readings_are_placed_and_remembered(examples: int) -> None:
    rng, memory = np.random.default_rng(9), new_memory()
    scratch, sensors = memory.state["scratch"], memory.state["sensors"][0]
    last: dict[int, np.ndarray] = {}
    stands: dict[int, tuple[int, int]] = {}
    memories: list[list[np.ndarray]] = [[] for _ in range(SENSORS)]
    entered = 0
    for pose, time_s, ranges in random_drive(rng, examples):
        m = placement.place_readings(memory.s, P, MOUNTS, *pose, ranges)
        want = naive_tracks.place_readings(
            last, stands, MOUNTS, pose, ranges, (S.range_min_m, S.range_max_m), S.half_resolution_m, pair(NOISES[0])
        )
        assert m == len(want)
        fired = np.column_stack([numbers(scratch["fired"][0])[:m, :5], scratch["fired_sensors"][0, :m]])
        assert fired == pytest.approx(np.array(want).reshape(m, 6), rel=1e-12, abs=1e-12)
        assert (scratch["explained_by"][0, :m] == UNEXPLAINED).all()
        entered += m
        observe.update_history(memory.s, P, m, time_s)
        for q in fired:
            sensor = int(q[5])
            memories[sensor] = naive_tracks.remembered(
                memories[sensor], q, time_s, S.history_spacing_m, S.pair_gap_s, HISTORY
            )
        for i in range(SENSORS):
            held = min(int(sensors["kept"][i]), HISTORY)
            mine = np.column_stack([history(memory, i)[:held], sensors["times_s"][i, :held]])
            assert rows(mine) == rows(memories[i])
    assert entered > 3 * examples


def test_the_least_range_of_the_ring_is_no_reading() -> None:
    memory = new_memory()
    ranges = np.full(SENSORS, S.range_min_m)
    for _ in range(2):
        assert placement.place_readings(memory.s, P, MOUNTS, 0.0, 0.0, 0.0, ranges) == 0
    ranges[1] += S.half_resolution_m + 0.001
    assert placement.place_readings(memory.s, P, MOUNTS, 0.0, 0.0, 0.0, ranges) == 0, "the third look from here"
    memory = new_memory()
    assert placement.place_readings(memory.s, P, MOUNTS, 0.0, 0.0, 0.0, ranges) == 1
