"""Segments of a firing's readings against their oracle: each with its own sensor's past and with its neighbours."""

from __future__ import annotations

import numpy as np
import pytest

from perception.bayes.inference import noise_estimation, placement
from perception.bayes.memory.elements import HISTORY
from perception.bayes.memory.parameters import MAPPED_LENGTH_MIN_M
from perception.bayes.memory.scratch import PairSegment
from perception.bayes.segments import pairing
from perception.bayes.segments.segment_list import mapped_segments
from perception.bayes.segments.segment_pairs import tangent
from perception.bayes.tracks import observe
from perception.records import records, zeros
from perception.shared_numbers import FAR
from tests import naive_tracks
from tests.perception.bayes.random_tracks import (
    MOUNTS,
    NOISES,
    SENSORS,
    P,
    S,
    examples,
    new_memory,
    numbers,
    random_drive,
    readings_of,
)


@examples(60, 500)
def test_segments_equal_their_oracle(examples: int) -> None:
    rng, memory = np.random.default_rng(9), new_memory()
    scratch = memory.state["scratch"]
    memories: list[list[np.ndarray]] = [[] for _ in range(SENSORS)]
    segments, segment = 0, zeros(PairSegment, 1)
    for pose, time_s, ranges in random_drive(rng, examples):
        m = placement.place_readings(memory.s, P, MOUNTS, *pose, ranges)
        fired = np.column_stack([numbers(scratch["fired"][0])[:m, :5], scratch["fired_sensors"][0, :m]])
        memory.s[0].noise_level = int(rng.integers(len(NOISES)))
        var0, rel2 = noise_estimation.noise_variance(memory.s, P)
        numbered = int(memory.state["segments_numbered"][0])
        made = pairing.make_segments(memory.s, P, m, time_s)
        expected = []
        for i in range(m):
            if fired[i, 4] < FAR:
                for old in naive_tracks.partners(i, fired, memories, time_s, S.pair_gap_s):
                    var = var0 + rel2 * float(fired[i, 4]) ** 2
                    a, b = readings_of(np.array([old[:5], fired[i, :5]]))
                    if tangent(a, b, float(S.cos_half_angle), var, records(PairSegment, segment)[0]):
                        expected.append((*segment[0].item()[:6], i))
        assert made == len(expected)
        got = scratch["segments"][0, :made]
        actual = np.array([row[:6] for row in got.tolist()]).reshape(made, 6)
        assert actual == pytest.approx(np.array([e[:6] for e in expected]).reshape(made, 6), rel=1e-12, abs=1e-12)
        assert got["reading"].tolist() == [e[6] for e in expected]
        long = [e for e in expected if e[4] > MAPPED_LENGTH_MIN_M]
        assert memory.state["segments_numbered"][0] == numbered + len(long)
        segments += made
        assert memory.state["segments_made"][0] == segments
        observe.update_history(memory.s, P, m, time_s)
        for q in fired:
            sensor = int(q[5])
            memories[sensor] = naive_tracks.remembered(
                memories[sensor], q, time_s, S.history_spacing_m, S.pair_gap_s, HISTORY
            )
    assert segments > 0.6 * examples


def test_a_mapped_segment_gets_the_next_number_and_the_time_of_the_firing() -> None:
    memory = new_memory()
    array = zeros(PairSegment, 1)
    array[0] = (0.1, 0.2, 0.6, 0.8, 0.3, 0.02, 4)
    for number, time_s in ((1, 7.5), (2, 8.5)):
        pairing.map_segment(memory.s, records(PairSegment, array)[0], time_s)
        assert mapped_segments(memory)[-1].item() == (0.1, 0.2, 0.6, 0.8, number, time_s)
