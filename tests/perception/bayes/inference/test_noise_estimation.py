"""The estimated range noise against its oracle, on random readings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.inference import noise_estimation
from perception.bayes.memory.state import ESTABLISHED
from perception.shared_numbers import FAR
from tests import naive_tracks
from tests.perception.bayes.random_tracks import (
    NOISES,
    TRACKS,
    P,
    S,
    around,
    enter_readings,
    examples,
    new_memory,
    noises,
    place_of,
    predict_own,
    random_track,
    readings_of,
    scratch_readings,
)


@examples(250, 3000)
def test_evidence_from_roughness_equals_its_oracle(examples: int) -> None:
    rng, counted = np.random.default_rng(7), 0
    for _ in range(examples):
        q = np.zeros((3, 6))
        q[:, :2] = np.cumsum(rng.uniform(-0.15, 0.15, (3, 2)), axis=0) * (rng.random() > 0.02)
        q[:, 4] = np.where(rng.random(3) < 0.05, 2 * FAR, rng.uniform(0.2, 3) + rng.normal(0, 0.05, 3))
        q[:, 5] = rng.uniform(0, 40, 3)
        heard = rng.normal(0, 10, len(NOISES))
        q[0, 4] = min(q[0, 4], 5.0)  # the caller passes only echoes
        axis, is_moved = rng.uniform(-math.pi, math.pi), bool(rng.random() < 0.5)
        q[:, 2:4] = math.cos(axis), math.sin(axis)
        ends = q.copy()
        ends[:, 4] += is_moved * ((q[:, :2] - q[1, :2]) * q[1, 2:4]).sum(axis=1)
        half_box = S.half_resolution_m
        want = naive_tracks.roughness(ends[0], ends[1], ends[2], 40.0, S.pair_gap_s, half_box, NOISES, heard)
        counted += want is not heard
        a, b, c = readings_of(q[:, :5])
        noise_estimation.add_roughness(a, b, c, float(40.0 - q[2, 5]), P, heard, is_moved)
        assert heard == pytest.approx(want, rel=1e-12, abs=1e-12)
    assert counted > 0.33 * examples


@examples(200, 1500)
def test_evidence_from_residuals_and_the_chosen_noise_equal_their_oracles(examples: int) -> None:
    rng, memory, chosen = np.random.default_rng(8), new_memory(), set()
    state, circles = memory.state, memory.circles
    rough, residual = state["roughness_nat"][0], state["residuals_nat"][0]
    for turn in range(examples):
        rough[...] = rng.normal(0, 15, len(rough))
        residual[...] = rng.normal(0, 40, len(rough))
        noise_estimation.choose_noise(memory.s, P)
        level = int(state["noise_level"][0])
        assert level == naive_tracks.likeliest_noise(rough, residual, S.roughness_gate_nat)
        chosen.add(level)
        if turn % 10:
            continue
        circles["noise_nat"] = rng.normal(0, 9, circles["noise_nat"].shape)
        for t in range(TRACKS):
            random_track(rng, memory, t)
        t, n = int(rng.integers(TRACKS)), 30
        circles["status"][t], circles["kind"][t], circles["refinements"][t] = ESTABLISHED, 0, rng.integers(6)
        circles["probability"][t], circles["hits"][t] = rng.choice([0.9, 0.99]), rng.choice([20.0, 26.0])
        is_named, careful = bool(rng.random() < 0.5), bool(rng.random() < 0.5)
        circles["is_named"][t] = is_named
        enter_readings(memory, around(rng, n, place_of(memory, t), float(circles["radius"][t])))
        want, total = circles["noise_nat"].copy(), residual.copy()
        if circles["refinements"][t] % 3 == 0:
            is_sure = circles["probability"][t] >= 0.95 and circles["hits"][t] >= 25 and (is_named or not careful)
            want[t] = 0.0
            if is_sure:
                want[t] = naive_tracks.residual_evidence(
                    scratch_readings(memory, n), place_of(memory, t), float(circles["radius"][t]), S.cos_half_angle,
                    S.gate_m, noises(),
                )  # fmt: skip
                total = want[circles["status"] == ESTABLISHED].sum(0)
        predict_own(memory, n, place_of(memory, t), float(circles["radius"][t]))
        noise_estimation.add_residuals(memory.s, memory.tracks, P, t, n, careful)
        assert circles["noise_nat"] == pytest.approx(want, rel=1e-12, abs=1e-11)
        assert residual == pytest.approx(total, rel=1e-12, abs=1e-11)
    assert len(chosen) == len(NOISES)
