"""Tracks, walls and noise against their oracles on random cases, and the whole on garbage."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from config.load import load_settings
from drivers.messages import Firing, Pose
from perception.full import births, noise_choice, observe, refine, report, reservoir, rivals, walls
from perception.full.contact import FAR
from perception.full.method import FullPerception
from perception.full.pairs import tangent
from perception.full.settings import make_settings
from perception.full.state import (
    BORN,
    C00,
    C11,
    CALLED,
    CAP,
    CONFIRMED,
    CYC,
    DIRTY,
    ESTABLISHED,
    FREE,
    HITS,
    HK,
    KIND,
    LLR,
    LN,
    MARK,
    NB,
    NEAR,
    NL,
    NOISE,
    NRES,
    NUMBER,
    PCAP,
    PHITS,
    PLACED,
    POLISH,
    PPROB,
    PROB,
    PT,
    PXX,
    PYY,
    QUIET,
    R00,
    R11,
    REFINEMENTS,
    REFS,
    SPAN,
    ST,
    TENTATIVE,
    TRHO,
    TX,
    TY,
    UNK,
    State,
    make_state,
)  # fmt: skip
from perception.segments import mounts_array
from tests import naive_full, naive_tracks
from tests.naive_tracks import FT, Line, rows

SETTINGS = load_settings("hallway", ["perception.method=full"])
BOXES = load_settings("hallway", ["perception.method=full"], models=("semicircle", "box"))
MOUNTS = mounts_array(SETTINGS.ring.mounts)
SENSORS = len(MOUNTS)
P = make_settings(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.full)
COSINES = (P.cos_opt, P.cos_half, P.cos_in)
TRACKS = 8
RIVALS = len(P.radii) + 2


def noises() -> list[naive_full.Noise]:
    return [naive_full.Noise(P.table, P.inv_step, levels, P.per_metre) for levels in P.levels]


def sigma(s: State) -> tuple[float, float]:
    absolute, relative = P.noises[int(s.g[NOISE])]
    return float(absolute), float(relative)


def pair(v: np.ndarray) -> tuple[float, float]:
    return float(v[0]), float(v[1])


def quintuple(q: np.ndarray) -> tuple[float, float, float, float, float]:
    return float(q[0]), float(q[1]), float(q[2]), float(q[3]), float(q[4])


def unit(angle: Any) -> np.ndarray:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def around(rng: np.random.Generator, n: int, centre: np.ndarray, rho: float) -> np.ndarray:
    """Readings x, y, axis, range of a circle: good ones, wild ones and silences."""
    bearing = rng.uniform(0, 2 * math.pi) + rng.uniform(0, 2 * math.pi, n) * rng.random()
    d = rho + rng.uniform(0.1, 3.0, n)
    r = np.maximum(0.0, d - rho + rng.normal(0, 0.01, n))
    chance = rng.random(n)
    r = np.where(chance < 0.15, rng.uniform(0, 4, n), np.where(chance < 0.25, 2 * FAR, r))
    axis = bearing + rng.uniform(-0.25, 0.25, n)
    return np.column_stack([centre - d[:, None] * unit(bearing), unit(axis), r])


def shared() -> State:
    return make_state(SENSORS, P, TRACKS, 64)


def random_track(rng: np.random.Generator, s: State, t: int, state: int | None = None) -> None:
    s.ti[t, ST] = rng.integers(3) if state is None else state
    s.ti[t, KIND] = k = int(rng.integers(len(P.radii)))
    s.tf[t, [TX, TY]] = rng.uniform(-0.8, 0.8, 2)
    s.tf[t, TRHO] = P.radii[k]
    s.tf[t, [R00, R11]] = rng.uniform(0, 0.02, 2)
    s.tf[t, LLR] = rng.normal(20, 20)


def random_lines(rng: np.random.Generator, s: State, many: int) -> dict[int, Line]:
    """Lines in some of the rows of the memory, as tall as they may be wrong."""
    s.lines[...] = 0.0
    lines = {}
    for k in sorted(rng.choice(NL, many, replace=False).tolist()):
        root = np.array([[rng.uniform(0.001, 0.1), 0.0], [rng.normal(0, 0.01), rng.uniform(0.001, 0.05)]])
        lines[k] = Line(
            unit(rng.uniform(-math.pi, math.pi)), rng.uniform(-0.2, 2), rng.uniform(-1, 1, 2), root @ root.T,
            -rng.uniform(0, 2), rng.uniform(0, 2), rng.uniform(0, 6), float(rng.integers(1, 30)),
        )  # fmt: skip
        s.lines[k] = lines[k].row()
    return lines


def test_a_reservoir_keeps_the_newest_of_each_direction() -> None:
    rng, s = np.random.default_rng(1), shared()
    for t in range(TRACKS):
        want, centre = naive_tracks.Reservoir(NB, CAP), rng.uniform(-1, 1, 2)
        for q in around(rng, int(rng.choice([0, 5, 600, 1500])), centre, 0.3):
            reservoir.put(s.bins, s.bn, t, *pair(centre), q)
            want.put(centre, q)
        n = reservoir.flatten(s, t, s.w)
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


def test_rivals_are_fitted_and_scored_on_the_same_readings() -> None:
    """Scores are held at the kernel's own fit, to 1e-11; fits to what rounding leaves of them.

    A circle's agree to 1e-10 m. A line's may hang on one reading, and then only the 1e-9 that keeps the information
    from being singular holds it: 1e-16 / 1e-9 of rounding in each of the steps.
    """
    rng, s, asked = np.random.default_rng(3), shared(), 0
    for _ in range(1000):
        s.g[NOISE] = h = int(rng.integers(len(P.noises)))
        rho, rho2 = (float(v) for v in rng.choice(P.radii, 2))
        place, n = rng.uniform(-1, 1, 2), int(rng.integers(0, 60))
        w = around(rng, n, place, rho)
        s.w[:n] = w
        centre = place + rng.normal(0, 0.02, 2)
        absolute, relative = sigma(s)
        var0, rel2 = absolute**2 + P.half_box**2 / 3 + 1e-6 * FT**2, relative**2
        assert noise_choice.noise_variance(s, P) == pytest.approx((var0, rel2), rel=1e-13)
        aim = naive_tracks.towards(w, centre, rho, P.gate)
        assert rivals.towards(s, P, n, *pair(centre), rho) == pytest.approx(aim, abs=1e-12)
        v = rivals.compete_circle(s, P, n, *pair(centre), rho, rho2, 4)
        if not aim.any():
            assert v == rivals.HOPELESS == rivals.compete_line(s, P, n, *pair(centre), rho, 4)
            continue
        asked += 1
        if v != rivals.HOPELESS:
            found, _ = naive_full.fit_circle(
                w, centre + (rho2 - rho) * aim, rho2, P.cos_opt, P.gate, 9.0, var0, rel2, 4
            )  # fmt: skip
            assert s.fit[:2] == pytest.approx(found, abs=1e-10)
            score = naive_full.score_circle(w, s.fit[:2], rho2, COSINES, P.gate, P.miss, P.short, noises()[h])
            assert v == pytest.approx(score["llr"], rel=1e-12, abs=1e-11)
        v = rivals.compete_line(s, P, n, *pair(centre), rho, 4)
        normal, c = naive_full.fit_line(w, aim, centre, -rho, P.cos_opt, P.gate, 9.0, var0, rel2, 4)
        assert s.fit[:3] == pytest.approx([*normal, c], abs=1e-6)
        want = naive_full.score_line(
            w, s.fit[:2], centre, float(s.fit[2]), COSINES, P.gate, P.miss, noises()[h], FAR
        )  # fmt: skip
        assert v == pytest.approx(want[0], rel=1e-12, abs=1e-11)
    assert asked > 800


def test_a_line_follows_an_echo_as_a_kalman_filter() -> None:
    rng, s = np.random.default_rng(4), shared()
    for _ in range(3000):
        ((k, line),) = random_lines(rng, s, 1).items()
        place = line.origin + rng.uniform(-3, 3, 2)
        e, var = rng.normal(0, 0.05), rng.uniform(1e-6, 1e-3)
        walls.follow(s.lines[k], *pair(place - line.origin), e, var)
        line.follow(place, e, var)
        assert s.lines[k] == pytest.approx(line.row(), rel=1e-12, abs=1e-12)


def test_lines_claim_what_they_explain_and_give_way() -> None:
    rng, s = np.random.default_rng(5), shared()
    claimed = lost = grown = 0
    for _ in range(400):
        s.g[NOISE] = int(rng.integers(len(P.noises)))
        lines = random_lines(rng, s, 4)
        cur = np.zeros((SENSORS, 6))
        for i in range(SENSORS):
            line = lines[int(rng.choice(list(lines)))]
            d, foot = rng.uniform(0.1, 3), rng.uniform(line.low - 0.2, line.high + 0.2)
            alpha = rng.normal(0, 0.2)
            edge = max(0.0, abs(alpha) - P.half_angle)
            place = line.origin + (line.c - d) * line.normal + foot * line.along
            r = rng.choice([d / math.cos(edge) + rng.normal(0, 0.01), 2 * FAR, rng.uniform(0, 4)])
            cur[i] = *place, *unit(math.atan2(line.normal[1], line.normal[0]) + alpha), max(r, 0.0), i
        s.cur[...] = cur
        s.owner[...] = np.where(rng.random(SENSORS) < 0.8, -1, 3)
        owner = s.owner.tolist()
        walls.update_lines(s, P, SENSORS)
        for k, line in lines.items():
            length = line.high - line.low
            kept = naive_tracks.update_line(
                line, k, cur, owner, sigma(s), P.half_box, P.half_angle, COSINES, P.gate, P.claim
            )  # fmt: skip
            if kept is None:
                assert s.lines[k, LN] == 0.0
                lost += 1
            else:
                assert s.lines[k] == pytest.approx(kept.row(), rel=1e-11, abs=1e-11)
                grown += kept.high - kept.low > length
        assert s.owner.tolist() == owner
        claimed += sum(o < -1 for o in owner)
    assert min(claimed, lost, grown) > 30


def test_a_new_line_is_known_or_takes_the_least_credible_place() -> None:
    rng, s, known = np.random.default_rng(6), shared(), 0
    for _ in range(1500):
        lines = random_lines(rng, s, int(rng.choice([0, 10, NL - 1, NL])))
        ((_, new),) = random_lines(rng, shared(), 1).items()
        if lines and rng.random() < 0.5:
            like = lines[int(rng.choice(list(lines)))]
            turned = math.atan2(like.normal[1], like.normal[0]) + rng.normal(0, 0.15)
            new.normal, new.origin = unit(turned), like.origin + rng.normal(0, 0.1, 2)
            new.c = like.c + rng.normal(0, 0.1)
        before = s.lines.copy()
        walls.new_line(s, *pair(new.normal), new.c, *pair(new.origin), new.low, new.high, new.echoes)
        if any(naive_tracks.same_line(line, new) for line in lines.values()):
            assert (s.lines == before).all()
            known += 1
            continue
        free = [k for k in range(NL) if k not in lines]
        k = free[0] if free else min(lines, key=lambda k: lines[k].log)
        new.cov, new.log = np.diag([0.02, 0.01 * FT**2]), 3.0
        assert s.lines[k] == pytest.approx(new.row(), rel=1e-15)
        assert (np.delete(s.lines, k, 0) == np.delete(before, k, 0)).all()
    assert known > 100


def test_roughness_is_heard_as_its_oracle_says() -> None:
    rng, heard_some = np.random.default_rng(7), 0
    for _ in range(3000):
        q = np.zeros((3, 6))
        q[:, :2] = np.cumsum(rng.uniform(-0.15, 0.15, (3, 2)), axis=0) * (rng.random() > 0.02)
        q[:, 4] = np.where(rng.random(3) < 0.05, 2 * FAR, rng.uniform(0.2, 3) + rng.normal(0, 0.05, 3))
        q[:, 5] = rng.uniform(0, 40, 3)
        heard = rng.normal(0, 10, len(P.noises))
        q[0, 4] = min(q[0, 4], 5.0)  # whoever calls has heard the newest
        want = naive_tracks.roughness(q[0], q[1], q[2], 40.0, P.gap, P.half_box, P.noises, heard)
        heard_some += want is not heard
        noise_choice.roughness(q[0], q[1], q[2], 40.0, P.gap, P.half_box, P.noises, heard)
        assert heard == pytest.approx(want, rel=1e-12, abs=1e-12)
    assert heard_some > 1000


def test_residuals_are_heard_and_the_noise_is_chosen_within_the_gate() -> None:
    rng, s, chosen = np.random.default_rng(8), shared(), set()
    for turn in range(1500):
        s.ddl[...] = rng.normal(0, 15, len(s.ddl))
        s.ntot[...] = rng.normal(0, 40, len(s.ddl))
        noise_choice.choose_noise(s, P)
        assert s.g[NOISE] == naive_tracks.likeliest_noise(s.ddl, s.ntot, P.rough_gate)
        chosen.add(int(s.g[NOISE]))
        if turn % 10:
            continue
        s.nll[...] = rng.normal(0, 9, s.nll.shape)
        for t in range(TRACKS):
            random_track(rng, s, t)
        t, n = int(rng.integers(TRACKS)), 30
        s.ti[t, [ST, KIND, REFS]] = ESTABLISHED, 0, rng.integers(6)
        s.tf[t, PROB], s.tf[t, HITS] = rng.choice([0.9, 0.99]), rng.choice([20.0, 26.0])
        s.w[:n] = around(rng, n, s.tf[t, [TX, TY]], float(s.tf[t, TRHO]))
        want, total = s.nll.copy(), s.ntot.copy()
        if s.ti[t, REFS] % 3 == 0:
            sure = s.tf[t, PROB] >= 0.95 and s.tf[t, HITS] >= 25
            want[t] = 0.0
            if sure:
                want[t] = naive_tracks.residual_evidence(
                    s.w[:n], s.tf[t, [TX, TY]], float(s.tf[t, TRHO]), P.cos_half, P.gate, noises()
                )  # fmt: skip
                total = want[s.ti[:, ST] == ESTABLISHED].sum(0)
        noise_choice.hear_residuals(s, P, t, n)
        assert s.nll == pytest.approx(want, rel=1e-12, abs=1e-11)
        assert s.ntot == pytest.approx(total, rel=1e-12, abs=1e-11)
    assert len(chosen) == len(P.noises)


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
            count = reservoir.flatten(s, k, s.w)
            assert rows(s.w[:count]) == rows(q for room in bins.kept for q in room)
            assert s.ti[k, DIRTY] == 2 + n
            assert s.ti[k, QUIET] == (0 if n else 7 + (state != FREE))
            assert s.ti[k, POLISH] == (P.polish if n else 0)
            s.ti[k, POLISH] = 0
            kept += n
    assert claimed > 1000
    assert kept > 3000


def test_of_two_tracks_in_one_place_the_one_with_more_evidence_stays_or_that_a_person_spoke_of() -> None:
    rng, s, merged = np.random.default_rng(11), shared(), 0
    names = s.names[:TRACKS]
    for _ in range(3000):
        for k in range(TRACKS):
            random_track(rng, s, k)
        names[:, NUMBER] = rng.permutation(TRACKS) + 1
        names[:, MARK] = rng.choice([0, CONFIRMED, PLACED], TRACKS, p=[0.8, 0.1, 0.1])
        t = int(rng.integers(TRACKS))
        s.ti[t, ST] = TENTATIVE
        live = s.ti[:, ST] != FREE
        want, numbers = naive_tracks.after_merging(
            t, live, s.tf[:, [TX, TY]], s.tf[:, TRHO], s.tf[:, LLR], P.merge, names[:, MARK], names[:, NUMBER]
        )
        refine.merge_duplicates(s, P, t)
        assert ((s.ti[:, ST] != FREE) == want).all()
        assert (names[want, NUMBER] == numbers[want]).all()
        merged += int((live != want).sum())
    assert merged > 500


def test_the_next_free_track() -> None:
    rng, s = np.random.default_rng(12), shared()
    for _ in range(1000):
        for k in range(TRACKS):
            random_track(rng, s, k, int(rng.choice([FREE, TENTATIVE, ESTABLISHED], p=[0.08, 0.32, 0.6])))
        i, f = s.ti, s.tf
        s.names[:TRACKS, MARK] = rng.choice([0, PLACED], TRACKS, p=[0.7, 0.3])
        free = np.flatnonzero(i[:, ST] == FREE)
        tentative = np.flatnonzero((i[:, ST] == TENTATIVE) & (s.names[:TRACKS, MARK] == 0))
        weakest = int(tentative[np.argmin(f[tentative, LLR])]) if len(tentative) else -1
        assert births.free_track(s) == (free[0] if len(free) else weakest)


def test_a_segment_of_a_known_body_is_known() -> None:
    rng, s, known = np.random.default_rng(13), shared(), 0
    for _ in range(3000):
        for k in range(TRACKS):
            random_track(rng, s, k)
        normal, rho, surface = unit(rng.uniform(0, 7)), float(rng.choice(P.radii)), rng.uniform(-1, 1, 2)
        live = s.ti[:, ST] != FREE
        place = surface + rho * normal
        behind = surface + s.tf[:, TRHO, None] * normal
        want = (live & (np.hypot(*(behind - s.tf[:, [TX, TY]]).T) < P.merge)).any()
        assert births.is_known(s, P, *pair(place), rho, *pair(normal)) == want
        here = (live & (np.hypot(*(place - s.tf[:, [TX, TY]]).T) < P.merge)).any()
        assert births.is_known(s, P, *pair(place), -1.0, *pair(normal)) == here
        known += int(want)
    assert 300 < known < 2700


def test_probability_is_a_share_among_all_explanations() -> None:
    rng, s, inside = np.random.default_rng(14), shared(), 0
    for _ in range(2000):
        lines = random_lines(rng, s, 5)
        random_track(rng, s, 0)
        s.tf[0, UNK] = rng.uniform(0, 30)
        s.comp[0] = np.where(rng.random(RIVALS) < 0.3, 0.0, rng.normal(-10, 15, RIVALS))
        prior, kind = rng.normal(2, 2), int(s.ti[0, KIND])
        place, rho = s.tf[0, [TX, TY]], float(s.tf[0, TRHO])
        in_wall = naive_tracks.stands_in_wall(lines.values(), place, rho)
        assert refine.stands_in_wall(s, *pair(place), rho) == in_wall
        inside += in_wall
        leads = {k: float(v) for k, v in enumerate(s.comp[0]) if k != kind and v != 0.0}
        want = naive_tracks.probability(
            float(s.tf[0, LLR]), kind < P.models, prior, P.prior, float(s.tf[0, UNK]), leads, P.models, len(P.radii),
            in_wall,
        )  # fmt: skip
        assert refine.probability(s, P, 0, prior) == pytest.approx(want, rel=1e-12, abs=1e-12)
    assert inside > 30


def test_a_refinement_keeps_its_books_and_decides_by_what_it_found() -> None:
    rng, s = np.random.default_rng(15), shared()
    fates = {FREE: 0, TENTATIVE: 0, ESTABLISHED: 0}
    for turn in range(300):
        s.ti[...], s.tf[...], s.bn[...], s.comp[...], s.lines[...] = 0, 0.0, 0, 0.0, 0.0
        random_track(rng, s, 0, int(rng.choice([TENTATIVE, ESTABLISHED])))
        s.tf[0, [R00, R11]] = 0.01
        s.ti[0, REFS] = refs = int(rng.integers(9))
        readings = around(rng, int(rng.choice([2, 10, 40, 120])), s.tf[0, [TX, TY]], float(s.tf[0, TRHO]))
        for q in readings:
            reservoir.put(s.bins, s.bn, 0, float(s.tf[0, TX]), float(s.tf[0, TY]), q)
        n, before, quiet = reservoir.flatten(s, 0, s.w), int(s.ti[0, ST]), bool(turn % 2)
        s.ti[0, [DIRTY, QUIET, POLISH]] = 100, P.quiet + quiet, 3
        s.tf[0, PROB] = -1.0
        count = s.g[REFINEMENTS]
        refine.quantum(s, P, 0.08)
        assert s.g[REFINEMENTS] == count + 1
        assert s.ti[0, POLISH] == 3 - quiet
        assert s.ti[0, NRES] == n
        assert s.ti[0, REFS] in (0, refs + 1)  # begun anew as another kind
        assert s.ti[0, DIRTY] == (refine.SWITCH_DIRTY if s.ti[0, REFS] == 0 else 0)
        assert 0 <= s.ti[0, CYC] < RIVALS
        after = int(s.ti[0, ST])
        if s.tf[0, PROB] < 0.0:  # too few readings, or a line
            line = n >= 3 and s.comp[0, len(P.radii)] > births.SWITCH
            assert after == FREE
            assert n < 3 or line
        else:
            f = s.tf[0]
            assert f[UNK] == P.unknown * f[NEAR]
            assert after == naive_tracks.fate(
                before, f[LLR], f[UNK], f[PROB], f[HITS], f[SPAN], max(f[R00], f[R11]), P.spread
            )  # fmt: skip
        fates[after] += 1
    assert min(fates.values()) > 10


def test_what_is_sure_is_reported() -> None:
    rng, s, out, sure = np.random.default_rng(16), shared(), np.zeros(max(PT, TRACKS), np.int64), 0
    for _ in range(2000):
        for t in range(TRACKS):
            random_track(rng, s, t)
        s.ti[:, KIND] = rng.integers(0, 2, TRACKS)
        s.tf[:, PROB] = rng.uniform(0.4, 1, TRACKS)
        s.tf[:, UNK] = s.tf[:, LLR] / rng.uniform(1, 1.4, TRACKS)
        s.tf[:, [C00, C11]] = rng.uniform(0, 0.07, (TRACKS, 2)) ** 2
        s.comp[...] = rng.uniform(-60, -15, s.comp.shape)
        s.comp[:, -2] = rng.choice([0.0, -3.9, -4.1, -30.0], TRACKS)
        s.tf[:, SPAN] = rng.uniform(0.004, 0.03, TRACKS)
        s.ti[:, CALLED] = rng.integers(0, 2, TRACKS)
        want = [
            t for t in range(TRACKS)
            if naive_tracks.is_called(
                s.ti[t, CALLED] == 1, s.ti[t, ST] == ESTABLISHED, s.ti[t, KIND] < P.models, s.tf[t, PROB], 0.92, 0.7,
                np.delete(s.comp[t], s.ti[t, KIND]).tolist(), s.comp[t, -2], s.tf[t, SPAN], s.tf[t, LLR],
                s.tf[t, UNK],
                s.tf[t, [C00, C11]].tolist(),
            )
        ]  # fmt: skip
        for t in range(TRACKS):
            report.call_or_not(s.ti, s.tf, s.comp, P.models, 0.92, 0.7, t)
        s.names[:TRACKS, MARK] = 0
        n = report.sure_circles(s.ti, s.names, out)
        assert out[:n].tolist() == want
        sure += n
        s.names[:TRACKS, MARK] = rng.choice([0, CONFIRMED, PLACED], TRACKS)
        said = [t for t in range(TRACKS) if s.ti[t, ST] != FREE and s.names[t, MARK] > 0]
        assert out[: report.sure_circles(s.ti, s.names, out)].tolist() == sorted({*want, *said})
    assert sure > 200


def test_polygons_are_sure_when_seen_from_near_and_from_two_sides() -> None:
    rng, s, out, sure = np.random.default_rng(17), shared(), np.zeros(PT, np.int64), 0
    for _ in range(200):
        s.pbn[...] = 0
        kept = []
        for t in range(PT):
            s.pi[t, ST] = rng.choice([TENTATIVE, ESTABLISHED])
            s.pf[t, PPROB], s.pf[t, PHITS] = rng.uniform(0.85, 1), rng.uniform(10, 40)
            s.pf[t, PXX], s.pf[t, PYY] = rng.uniform(0, 0.005, 2)
            w = around(rng, int(rng.integers(0, 120)), np.zeros(2), 0.2)
            w[:, 4] += rng.choice([0.0, 1.8])
            w[:, 2:4] = unit(rng.uniform(0, 7) + rng.normal(0, rng.uniform(0, 0.5), len(w)))
            for i, q in enumerate(w):
                s.pbins[t, i % 10, s.pbn[t, i % 10] % PCAP] = q
                s.pbn[t, i % 10] += 1
            kept.append(w)
        want = [
            t for t in range(PT)
            if naive_tracks.is_sure_polygon(
                s.pi[t, ST] == ESTABLISHED, s.pf[t, PPROB], 0.9, s.pf[t, PHITS], s.pf[t, [PXX, PYY]].tolist(), kept[t]
            )
        ]  # fmt: skip
        s.names[:] = 0
        n = report.sure_polygons(s.pi, s.pf, s.pbn, s.pbins, s.names, TRACKS, 0.9, out)
        assert out[:n].tolist() == want
        sure += n
        s.names[TRACKS + 5, MARK] = CONFIRMED
        n = report.sure_polygons(s.pi, s.pf, s.pbn, s.pbins, s.names, TRACKS, 0.9, out)
        assert out[:n].tolist() == sorted({*want, 5})
    assert sure > 200


def test_a_covariances_worst_axis_and_the_names_of_rivals() -> None:
    rng, s, corners = np.random.default_rng(18), shared(), 0
    for _ in range(1000):
        root = rng.normal(0, 1, (2, 2))
        cov = root @ root.T
        worst = math.sqrt(float(np.linalg.eigvalsh(cov)[1]))
        assert report.worst_sigma(cov[0, 0], cov[0, 1], cov[1, 1]) == pytest.approx(worst, rel=1e-12)
        lines = random_lines(rng, s, 4)
        for k, line in lines.items():
            seen, length = report.wall(s.lines[k]), line.high - line.low
            middle = line.origin + line.c * line.normal + 0.5 * (line.low + line.high) * line.along
            assert (seen.x, seen.y) == pytest.approx(middle, abs=1e-12)
            assert unit(seen.theta) == pytest.approx(line.along, abs=1e-12)
            lever = np.array([0.5 * (line.low + line.high), 1.0])
            across = float(line.cov[1, 1] + lever[0] ** 2 * line.cov[0, 0])
            assert seen.sigma == pytest.approx(math.sqrt(max(across, length**2 / 12)), rel=1e-9)
            assert report.is_wall(s.lines[k]) == (line.echoes > 10 and length > 2 * FT)
        random_track(rng, s, 0)
        s.tf[0, TRHO] = rng.choice([0.0, 0.1, 0.6])
        by_wall = any(
            line.echoes > 10 and line.high - line.low > 2 * FT and abs(line.off(s.tf[0, [TX, TY]])) < FT
            and line.low - FT < line.foot(s.tf[0, [TX, TY]]) < line.high + FT
            for line in lines.values()
        )  # fmt: skip
        corner = "inside corner" if by_wall else "edge"
        assert report.rival_label(s, 0) == {0.0: corner, 0.1: "post", 0.6: "barrel"}[float(s.tf[0, TRHO])]
        corners += by_wall
    assert corners > 50


def garbage(rng: np.random.Generator) -> Firing:
    """Anything at all: poses that are none or far away, ranges that are none, nought, negative or beyond measure."""
    wild = [math.nan, math.inf, -math.inf, 0.0, -1.0, 1e-300, 1e300, 1e5, 2 * FAR]
    ranges = rng.uniform(0, 5, SENSORS)
    chance = rng.random(SENSORS)
    ranges = np.where(chance < 0.3, rng.choice(wild, SENSORS), np.where(chance < 0.5, np.round(ranges, 1), ranges))
    x, y, heading, now = rng.normal(0, 0.4, 4).tolist()
    if rng.random() < 0.2:
        x, y, heading, now = (float(rng.choice([v, *wild])) for v in (x, y, heading, now))
    return Firing(now * 10.0, Pose(x, y, heading), heading, ranges)


@pytest.mark.parametrize("tracks", [1, 48])
def test_garbage_is_survived(tracks: int) -> None:
    config = SETTINGS.perception.full.model_copy(update={"tracks_max": tracks})
    for seed, settings in enumerate((SETTINGS, BOXES)):
        rng, perception = np.random.default_rng(seed), FullPerception(SETTINGS.ring, settings.models, config)
        s = perception.memory
        for _ in range(60):
            perception.observe(garbage(rng))
            while perception.pending:
                perception.refine()
            for seen in perception.things():
                assert np.isfinite([seen.x, seen.y, seen.theta, seen.sigma, seen.score]).all()
                assert 0.0 <= (seen.probability or 0.0) <= 1.0
        for name in ("ti", "tf", "comp", "lines", "g", "ddl", "ntot", "nll", "bins", "hist", "pf", "pbins", "store"):
            assert np.isfinite(getattr(s, name)).all(), name
        assert set(np.unique(s.ti[:, ST])) | set(np.unique(s.pi[:, ST])) <= {FREE, TENTATIVE, ESTABLISHED}
        assert s.ti.shape[0] == tracks
        assert ((s.ti[:, KIND] >= 0) & (s.ti[:, KIND] < len(perception.settings.radii))).all()
        assert 0 <= s.g[NOISE] < len(P.noises)
        assert (s.tf[:, BORN] < math.inf).all()
