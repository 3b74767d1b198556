"""Tracks against their oracles on random cases: rivals, probability, refinement; and the whole on garbage."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from perception.bayes import alternatives as rivals
from perception.bayes import noise_estimation as noise_choice
from perception.bayes import refine, reservoir
from perception.bayes import track_initiation as births
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.range_fit import FAR
from perception.bayes.state import (
    BORN,
    CONFIRMED,
    CYC,
    DIRTY,
    ESTABLISHED,
    FREE,
    HITS,
    KIND,
    LLR,
    MARK,
    NEAR,
    NOISE,
    NRES,
    NUMBER,
    PLACED,
    POLISH,
    PROB,
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
)  # fmt: skip
from tests import naive_bayes as naive_full
from tests import naive_tracks
from tests.naive_tracks import FT
from tests.perception.tracks import (
    BOXES,
    COSINES,
    RIVALS,
    SENSORS,
    SETTINGS,
    TRACKS,
    P,
    around,
    noises,
    pair,
    random_lines,
    random_track,
    shared,
    sigma,
    unit,
)


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
        assert births.free_track(s.ti, s.tf[:, LLR], s.names) == (free[0] if len(free) else weakest)


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
        n, before, quiet = reservoir.flatten(s.bins, s.bn, 0, s.w), int(s.ti[0, ST]), bool(turn % 2)
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
    config = SETTINGS.perception.bayes.model_copy(update={"tracks_max": tracks})
    for seed, settings in enumerate((SETTINGS, BOXES)):
        rng, perception = np.random.default_rng(seed), BayesPerception(SETTINGS.ring, settings.models, config)
        s = perception.memory
        for _ in range(60):
            perception.observe(garbage(rng))
            while perception.can_refine:
                perception.refine()
            for seen in perception.labelled_objects():
                assert np.isfinite([seen.x, seen.y, seen.theta, seen.sigma, seen.score]).all()
                assert 0.0 <= (seen.probability or 0.0) <= 1.0
        for name in ("ti", "tf", "comp", "lines", "g", "ddl", "ntot", "nll", "bins", "hist", "pf", "pbins", "store"):
            assert np.isfinite(getattr(s, name)).all(), name
        assert set(np.unique(s.ti[:, ST])) | set(np.unique(s.pi[:, ST])) <= {FREE, TENTATIVE, ESTABLISHED}
        assert s.ti.shape[0] == tracks
        assert ((s.ti[:, KIND] >= 0) & (s.ti[:, KIND] < len(perception.settings.radii))).all()
        assert 0 <= s.g[NOISE] < len(P.noises)
        assert (s.tf[:, BORN] < math.inf).all()
