"""Walls against their oracles on random cases: echoes correct a line, and ranges through it weaken it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.inference import lines as walls
from perception.bayes.memory.elements import MAX_LINES
from perception.bayes.memory.scratch import LineFit, LineScore
from perception.records import records, zeros
from perception.shared_numbers import FAR
from tests import naive_tracks
from tests.naive_tracks import FT
from tests.perception.bayes.random_tracks import (
    COSINES,
    NOISES,
    SENSORS,
    P,
    S,
    examples,
    line_rows,
    new_memory,
    numbers,
    pair,
    random_lines,
    sigma,
    unit,
)


@examples(200, 3000)
def test_a_line_is_corrected_by_an_echo_as_by_a_kalman_filter(examples: int) -> None:
    rng, memory = np.random.default_rng(4), new_memory()
    for _ in range(examples):
        ((k, line),) = random_lines(rng, memory, 1).items()
        place = line.origin + rng.uniform(-3, 3, 2)
        e, var = rng.normal(0, 0.05), rng.uniform(1e-6, 1e-3)
        walls.correct_line(memory.s[0].lines[k], *pair(place - line.origin), e, var)
        line.follow(place, e, var)
        assert line_rows(memory)[k] == pytest.approx(line.row(), rel=1e-12, abs=1e-12)


@examples(40, 400)
def test_lines_take_the_echoes_they_explain_and_end_when_ranges_pass_through(examples: int) -> None:
    rng, memory = np.random.default_rng(5), new_memory()
    taken = lost = grown = 0
    for _ in range(examples):
        memory.s[0].noise_level = int(rng.integers(len(NOISES)))
        lines = random_lines(rng, memory, 4)
        cur = np.zeros((SENSORS, 6))
        for i in range(SENSORS):
            line = lines[int(rng.choice(list(lines)))]
            d, foot = rng.uniform(0.1, 3), rng.uniform(line.low - 0.2, line.high + 0.2)
            alpha = rng.normal(0, 0.2)
            edge = max(0.0, abs(alpha) - S.half_angle_rad)
            place = line.origin + (line.c - d) * line.normal + foot * line.along
            r = rng.choice([d / math.cos(edge) + rng.normal(0, 0.01), 2 * FAR, rng.uniform(0, 4)])
            cur[i] = *place, *unit(math.atan2(line.normal[1], line.normal[0]) + alpha), max(r, 0.0), i
        scratch = memory.state["scratch"]
        numbers(scratch["fired"][0])[:SENSORS, :5] = cur[:, :5]
        scratch["explained_by"][0, :SENSORS] = np.where(rng.random(SENSORS) < 0.8, -1, 3)
        owner = scratch["explained_by"][0, :SENSORS].tolist()
        walls.update_lines(memory.s, P, SENSORS)
        for k, line in lines.items():
            length = line.high - line.low
            kept = naive_tracks.update_line(
                line, k, cur, owner, sigma(memory), S.half_resolution_m, S.half_angle_rad, COSINES, S.gate_m,
                S.associating_line_m,
            )  # fmt: skip
            if kept is None:
                assert memory.state["lines"]["echoes"][0, k] == 0.0
                lost += 1
            else:
                assert line_rows(memory)[k] == pytest.approx(kept.row(), rel=1e-11, abs=1e-11)
                grown += kept.high - kept.low > length
        assert scratch["explained_by"][0, :SENSORS].tolist() == owner
        taken += sum(o < -1 for o in owner)
    assert min(taken, lost, grown) > 0.07 * examples


@examples(80, 1500)
def test_a_new_line_is_known_or_replaces_the_least_credible(examples: int) -> None:
    rng, memory, known = np.random.default_rng(6), new_memory(), 0
    fit, score = zeros(LineFit, 1), zeros(LineScore, 1)
    for _ in range(examples):
        lines = random_lines(rng, memory, int(rng.choice([0, 10, MAX_LINES - 1, MAX_LINES])))
        ((_, new),) = random_lines(rng, new_memory(), 1).items()
        if lines and rng.random() < 0.5:
            like = lines[int(rng.choice(list(lines)))]
            turned = math.atan2(like.normal[1], like.normal[0]) + rng.normal(0, 0.15)
            new.normal, new.origin = unit(turned), like.origin + rng.normal(0, 0.1, 2)
            new.c = like.c + rng.normal(0, 0.1)
        before = line_rows(memory).copy()
        fit[0] = (*new.normal, new.c, 0, 0.0)
        score[0] = (0.0, new.echoes, 0.0, new.low, new.high)
        walls.enter_line(memory.s, records(LineFit, fit)[0], *pair(new.origin), records(LineScore, score)[0])
        if any(naive_tracks.same_line(line, new) for line in lines.values()):
            assert (line_rows(memory) == before).all()
            known += 1
            continue
        free = [k for k in range(MAX_LINES) if k not in lines]
        k = free[0] if free else min(lines, key=lambda k: lines[k].log)
        new.cov, new.log = np.diag([0.02, 0.01 * FT**2]), 3.0
        assert line_rows(memory)[k] == pytest.approx(new.row(), rel=1e-15)
        assert (np.delete(line_rows(memory), k, 0) == np.delete(before, k, 0)).all()
    assert known > 0.06 * examples
