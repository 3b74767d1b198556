"""The search across the beam against its oracle: seven positions on an arc, scored one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.circles import lateral_search
from perception.shared_numbers import FAR
from tests import naive_bayes
from tests.naive_tracks import FT
from tests.perception.bayes.random_tracks import (
    COSINES,
    P,
    S,
    around,
    enter_readings,
    examples,
    new_memory,
    noises,
    place_of,
    random_track,
    unit,
)


@examples(25, 600)
def test_the_best_of_seven_positions_is_taken_if_it_leads_by_enough(examples: int) -> None:
    rng, memory, moved = np.random.default_rng(21), new_memory(), 0
    track = memory.tracks[0]
    for _ in range(examples):
        random_track(rng, memory, 0)
        place, rho = place_of(memory, 0), float(track.radius)
        towards = unit(rng.uniform(-math.pi, math.pi))
        true = place + rng.uniform(-0.12, 0.12) * np.array([-towards[1], towards[0]])
        w = around(rng, 30, true, rho)
        sensors = true - (rho + rng.uniform(0.5, 1.0, 30))[:, None] * towards
        w[:, :2] = sensors + rng.normal(0, 0.1, (30, 2))
        to = true - w[:, :2]
        w[:, 2:4] = unit(np.arctan2(to[:, 1], to[:, 0]) + rng.uniform(-0.3, 0.3, 30))
        off = np.abs((to * np.column_stack([-w[:, 3], w[:, 2]])).sum(1) / np.hypot(*to.T))
        w[:, 4] = np.where(off < math.sin(S.half_angle_rad), np.hypot(*to.T) - rho, 2 * FAR)
        enter_readings(memory, w)
        near = np.abs(w[:, 4] - (naive_bayes.look(w, place).d - rho)) < S.gate_m
        if not near.any():
            assert not lateral_search.search_across(memory.s, P, track, 30)
            continue
        middle = w[near, :2].mean(0)
        arm = complex(*(place - middle))
        turns = [k * 0.12 * FT / abs(arm) for k in range(-3, 4)]
        places = [arm * complex(math.cos(turn), math.sin(turn)) for turn in turns]
        noise = noises()[int(memory.s[0].noise_level)]
        scores = [
            naive_bayes.score_circle(
                w, middle + np.array([at.real, at.imag]), rho, COSINES, S.gate_m, S.missed_echo_nat,
                S.short_echo_nat, noise,
            )["llr"]
            for at in places
        ]  # fmt: skip
        scores[3] += 1.0
        best = int(np.argmax(scores)) if abs(arm) > rho else 3
        assert lateral_search.search_across(memory.s, P, track, 30) == (best != 3)
        at = places[best]
        assert place_of(memory, 0) == pytest.approx(middle + np.array([at.real, at.imag]), abs=1e-12)
        moved += best != 3
    assert moved > 0.2 * examples
