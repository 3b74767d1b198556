"""Readings that bear on a circle against their oracle: not hidden by, nor better explained by, another circle."""

from __future__ import annotations

import math

import numpy as np

from perception.bayes.inference import noise_estimation, occlusion
from perception.bayes.memory.state import ESTABLISHED
from tests import naive_occlusion
from tests.naive_tracks import rows
from tests.perception.bayes.random_tracks import (
    NOISES,
    TRACKS,
    P,
    S,
    around,
    enter_readings,
    examples,
    new_memory,
    pair,
    place_of,
    random_track,
    scratch_readings,
)


@examples(50, 600)
def test_the_relevant_readings_equal_their_oracle_and_keep_their_order(examples: int) -> None:
    rng, names, memory = np.random.default_rng(22), np.random.default_rng(84), new_memory()
    circles, hidden, dropped = memory.circles, 0, 0
    for _ in range(examples):
        memory.s[0].noise_level = int(rng.integers(len(NOISES)))
        for t in range(TRACKS):
            random_track(rng, memory, t)
            circles["is_named"][t] = names.integers(2)
        own = int(rng.integers(-1, TRACKS))
        place = place_of(memory, own) if own >= 0 else rng.uniform(-1, 1, 2)
        radius = float(circles["radius"][own]) if own >= 0 else 0.3
        w = around(rng, 30, place, radius)
        enter_readings(memory, w)
        here = [t for t in range(TRACKS) if circles["status"][t] == ESTABLISHED and t != own]
        others = [
            (place_of(memory, t), float(circles["radius"][t]), float(circles["root_xx"][t]),
             circles["kind"][t] < S.model_count)
            for t in here
        ]  # fmt: skip
        surer = [circles["is_named"][t] == 1 and (own < 0 or circles["is_named"][own] == 0) for t in here]
        variance = noise_estimation.noise_variance(memory.s, P)
        want = []
        for q in w:
            is_hidden = naive_occlusion.is_hidden(q, place, radius, others, S.gate_m)
            taken = naive_occlusion.is_explained_elsewhere(
                q, place, radius, others, surer, S.gate_m, S.merge_m, S.cos_may_answer, S.half_resolution_m, variance
            )
            if not is_hidden and not taken:
                want.append(q)
            hidden += is_hidden
            dropped += taken
        kept = occlusion.keep_relevant(memory.s, memory.tracks, P, 30, *pair(place), radius, own)
        assert scratch_readings(memory, kept).tolist() == [q.tolist() for q in want]
        assert rows(scratch_readings(memory, kept)) == rows(want)
    assert hidden > 0.5 * examples
    assert dropped > 0.1 * examples


def test_a_named_circle_takes_what_it_explains_from_one_without_a_name_that_fits_better() -> None:
    memory = new_memory()
    memory.circles.view(np.uint8)[...] = 0
    named, other = memory.tracks[0], memory.tracks[1]
    for track, x, y in ((named, 1.0, 0.0), (other, 1.01, 0.5)):
        track.status, track.radius, track.x, track.y = ESTABLISHED, 0.3, x, y
    own = abs(complex(1.01, 0.5)) - 0.3
    enter_readings(memory, np.array([[0.0, 0.0, math.cos(0.2), math.sin(0.2), 0.5 * (own + 0.7) + 0.01]]))
    for is_named, is_other_named, kept in ((0, 0, 1), (1, 1, 1), (1, 0, 0), (0, 1, 1)):
        named.is_named, other.is_named, named.root_xx = is_named, is_other_named, 0.05
        assert occlusion.keep_relevant(memory.s, memory.tracks, P, 1, 1.01, 0.5, 0.3, 1) == kept
    named.is_named = 1
    assert occlusion.keep_relevant(memory.s, memory.tracks, P, 1, 1.01, 0.5, 0.3, -1) == 0  # not yet a track either
