"""What a firing leaves in the memory, against its oracle on random cases: placed, paired, claimed, kept."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from perception.bayes import noise_estimation as noise_choice
from perception.bayes import observe, reservoir
from perception.bayes.range_fit import FAR
from perception.bayes.segment_pairs import tangent
from perception.bayes.state import (
    CAP,
    DIRTY,
    ESTABLISHED,
    FREE,
    HK,
    NB,
    NOISE,
    POLISH,
    QUIET,
    R00,
    ST,
    TRHO,
    TX,
    TY,
)  # fmt: skip
from tests import naive_tracks
from tests.naive_tracks import rows
from tests.perception.tracks import (
    MOUNTS,
    SENSORS,
    TRACKS,
    P,
    around,
    pair,
    quintuple,
    random_track,
    shared,
    sigma,
    unit,
)


def test_a_reservoir_keeps_the_newest_of_each_direction() -> None:
    rng, s = np.random.default_rng(1), shared()
    for t in range(TRACKS):
        want, centre = naive_tracks.Reservoir(NB, CAP), rng.uniform(-1, 1, 2)
        for q in around(rng, int(rng.choice([0, 5, 600, 1500])), centre, 0.3):
            reservoir.put(s.bins, s.bn, t, *pair(centre), q)
            want.put(centre, q)
        n = reservoir.flatten(s.bins, s.bn, t, s.w)
        assert rows(s.w[:n]) == rows(q for kept in want.kept for q in kept)


def test_what_sensors_remember_of_a_circle_is_gathered() -> None:
    rng, s, total = np.random.default_rng(2), shared(), 0
    for _ in range(300):
        centre, rho = rng.uniform(-1, 1, 2), float(rng.choice(P.radii))
        memory = []
        for i in range(SENSORS):
            s.hn[i] = int(rng.integers(0, 2 * HK))
            s.hist[i, :, :5] = around(rng, HK, centre + rng.normal(0, 0.1, 2), rho)
            memory += list(s.hist[i, : min(s.hn[i], HK)])
        n = reservoir.gather(s, P, *pair(centre), rho, s.w)
        want = naive_tracks.gather(memory, centre, rho, P.cos_opt, P.range_max)
        assert rows(s.w[:n]) == want[:n]
        total += n
    assert total > 10_000


def drive(rng: np.random.Generator, firings: int) -> Iterator[tuple[tuple[float, float, float], float, np.ndarray]]:
    """A ring that goes, stops and turns, and what it hears: pose, time, ranges."""
    place, yaw, now, truth = np.zeros(2), 0.0, 0.0, rng.uniform(0.3, 2, SENSORS)
    for _ in range(firings):
        go = rng.choice([0.0, 0.01, 0.1])
        yaw += rng.choice([0.0, 0.01, 0.1]) * rng.normal()
        place = place + go * unit(yaw)
        now += rng.choice([0.2, 0.2, 0.2, 40.0], p=[0.33, 0.33, 0.33, 0.01])
        truth = np.abs(truth + rng.normal(0, 0.02, SENSORS) * (rng.random(SENSORS) < 0.5))
        chance = rng.random(SENSORS)
        ranges = np.where(chance < 0.4, np.nan, np.where(chance < 0.5, np.inf, truth))
        ranges[rng.random(SENSORS) < 0.01] = -1.0
        yield (float(place[0]), float(place[1]), yaw), now, ranges


def test_readings_are_placed_paired_and_remembered() -> None:
    rng, s = np.random.default_rng(9), shared()
    last: dict[int, np.ndarray] = {}
    memories: list[list[np.ndarray]] = [[] for _ in range(SENSORS)]
    entered = segments = 0
    for pose, now, ranges in drive(rng, 500):
        m = observe.place_readings(s, P, MOUNTS, *pose, ranges)
        want = naive_tracks.place_readings(last, MOUNTS, pose, ranges, P.range_max, P.half_box)
        assert m == len(want)
        cur = s.cur[:m].copy()
        assert cur == pytest.approx(np.array(want).reshape(m, 6), rel=1e-12, abs=1e-12)
        assert (s.owner[:m] == -1).all()
        entered += m
        s.g[NOISE] = rng.integers(len(P.noises))
        var0, rel2 = noise_choice.noise_variance(s, P)
        made = observe.make_segments(s, P, m, now)
        expected, out = [], np.zeros(7)
        for i in range(m):
            if cur[i, 4] < FAR:
                for old in naive_tracks.partners(i, cur, memories, now, P.gap):
                    var = var0 + rel2 * float(cur[i, 4]) ** 2
                    if tangent(*quintuple(old), *quintuple(cur[i]), P.cos_half, var, out):
                        expected.append([*out, i])
        assert made == len(expected)
        assert s.segs[:made] == pytest.approx(np.array(expected).reshape(made, 8), rel=1e-12, abs=1e-12)
        segments += made
        observe.remember(s, P, m, now)
        for q in cur:
            sensor = int(q[5])
            memories[sensor] = naive_tracks.remembered(memories[sensor], q, now, P.spacing, P.gap, HK)
        for i in range(SENSORS):
            assert rows(s.hist[i, : min(s.hn[i], HK)]) == rows(memories[i])
    assert entered > 1500
    assert segments > 300


def test_readings_are_claimed_by_the_best_and_kept_by_all_they_bear_on() -> None:
    rng, s = np.random.default_rng(10), shared()
    claimed = kept = 0
    for _ in range(400):
        s.ti[...], s.tf[...], s.bn[...] = 0, 0.0, 0
        s.g[NOISE] = rng.integers(len(P.noises))
        for t in range(TRACKS):
            random_track(rng, s, t)
            s.ti[t, [QUIET, DIRTY]] = 7, 2
        t = int(rng.integers(TRACKS))
        s.cur[:, :5] = around(rng, SENSORS, s.tf[t, [TX, TY]], float(s.tf[t, TRHO]))
        s.cur[:, 5] = np.arange(SENSORS)
        s.owner[...] = -1
        observe.claim(s, P, SENSORS)
        sure = [
            (k, s.tf[k, [TX, TY]], float(s.tf[k, TRHO]), float(s.tf[k, R00]))
            for k in np.flatnonzero(s.ti[:, ST] == ESTABLISHED).tolist()
        ]
        owner = [naive_tracks.claimed_by(q, sure, P.cos_opt, P.half_box, sigma(s)) for q in s.cur]
        assert s.owner.tolist() == owner
        claimed += sum(o >= 0 for o in owner)
        s.owner[rng.random(SENSORS) < 0.2] = -5  # a wall's
        observe.keep(s, P, SENSORS)
        for k in range(TRACKS):
            state = s.ti[k, ST]
            want = [
                q[:5] for q, o in zip(s.cur, s.owner.tolist(), strict=True)
                if state != FREE and naive_tracks.bears_on(
                    q, s.tf[k, [TX, TY]], float(s.tf[k, TRHO]), o == -1,
                    o in (-1, k) or (o < 0 and state == ESTABLISHED), P.cos_opt, P.cos_in, P.gate, P.pair_max,
                )
            ]  # fmt: skip
            bins, n = naive_tracks.Reservoir(NB, CAP), len(want)
            for q in want:
                bins.put(s.tf[k, [TX, TY]], q)
            count = reservoir.flatten(s.bins, s.bn, k, s.w)
            assert rows(s.w[:count]) == rows(q for room in bins.kept for q in room)
            assert s.ti[k, DIRTY] == 2 + n
            assert s.ti[k, QUIET] == (0 if n else 7 + (state != FREE))
            assert s.ti[k, POLISH] == (P.polish if n else 0)
            s.ti[k, POLISH] = 0
            kept += n
    assert claimed > 1000
    assert kept > 3000
