"""Tracks against their oracles on random cases: rivals, probability, refinement; and the whole on garbage."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.messages import Firing, Pose
from perception.bayes import alternatives, noise_estimation, refine, reservoir, track_initiation
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.parameters import SWITCH_LEAD_NAT, SWITCH_UNSEEN
from perception.bayes.range_fit import FAR
from perception.bayes.state import CONFIRMED, ESTABLISHED, FREE, PLACED, TENTATIVE, CircleTrack, Memory
from perception.kernel import Floats
from perception.records import records, zeros
from tests import naive_bayes, naive_tracks
from tests.naive_tracks import FT
from tests.perception.tracks import (
    ALTERNATIVES,
    BOXES,
    COSINES,
    NOISES,
    RADII,
    SENSORS,
    SETTINGS,
    TRACKS,
    P,
    S,
    around,
    enter_readings,
    noises,
    numbers,
    pair,
    place_of,
    random_lines,
    random_track,
    readings_of,
    shared,
    sigma,
    unit,
)


def fitted(memory: Memory, name: str) -> Floats:
    """Return the fields of a fit in the scratch."""
    fields: Floats = numbers(memory.state["scratch"][name])[0]
    return fields


def places(memory: Memory) -> Floats:
    """Return the centres of all circles, shape (n, 2), m."""
    centres: Floats = np.column_stack([memory.circles["x"], memory.circles["y"]])
    return centres


def test_alternatives_are_fitted_and_scored_on_the_same_readings() -> None:
    """Scores are held at the kernel's own fit, to 1e-11; fits to what rounding leaves of them.

    A circle's agree to 1e-10 m. A line's may hang on one reading, and then only the 1e-9 that keeps the information
    from being singular holds it: 1e-16 / 1e-9 of rounding in each of the steps.
    """
    rng, memory, compared = np.random.default_rng(3), shared(), 0
    s, hopeless = memory.s, alternatives.HOPELESS_NAT
    for _ in range(1000):
        s[0].noise_level = h = int(rng.integers(len(NOISES)))
        rho, rho2 = (float(v) for v in rng.choice(RADII, 2))
        place, n = rng.uniform(-1, 1, 2), int(rng.integers(0, 60))
        w = around(rng, n, place, rho)
        enter_readings(memory, w)
        centre = place + rng.normal(0, 0.02, 2)
        absolute, relative = sigma(memory)
        var0, rel2 = absolute**2 + S.half_resolution_m**2 / 3 + 1e-6 * FT**2, relative**2
        assert noise_estimation.noise_variance(s, P) == pytest.approx((var0, rel2), rel=1e-13)
        aim = naive_tracks.towards(w, centre, rho, S.gate_m)
        bearing = alternatives.mean_bearing(readings_of(w), *pair(centre), rho, float(S.gate_m))
        assert bearing == pytest.approx(aim, abs=1e-12)
        v = alternatives.fit_other_circle(s, P, n, *pair(centre), rho, rho2, 4)
        if not aim.any():
            assert v == hopeless == alternatives.fit_other_line(s, P, n, *pair(centre), rho, 4)
            continue
        compared += 1
        if v != hopeless:
            found, _ = naive_bayes.fit_circle(
                w, centre + (rho2 - rho) * aim, rho2, S.cos_may_answer, S.gate_m, 9.0, var0, rel2, 4
            )  # fmt: skip
            fit = fitted(memory, "circle_fit")[:2]
            assert fit == pytest.approx(found, abs=1e-10)
            score = naive_bayes.score_circle(
                w, fit, rho2, COSINES, S.gate_m, S.missed_echo_nat, S.short_echo_nat, noises()[h]
            )
            assert v == pytest.approx(score["llr"], rel=1e-12, abs=1e-11)
        v = alternatives.fit_other_line(s, P, n, *pair(centre), rho, 4)
        normal, c = naive_bayes.fit_line(
            w, aim, centre, -rho, S.cos_may_answer, S.gate_m, 9.0, var0, rel2, 4
        )  # fmt: skip
        line = fitted(memory, "line_fit")
        assert line == pytest.approx([*normal, c], abs=1e-6)
        want = naive_bayes.score_line(
            w, line[:2], centre, float(line[2]), COSINES, S.gate_m, S.missed_echo_nat, noises()[h], FAR
        )  # fmt: skip
        assert v == pytest.approx(want[0], rel=1e-12, abs=1e-11)
    assert compared > 800


def test_of_two_tracks_in_one_place_the_one_with_more_evidence_stays_or_that_a_user_marked() -> None:
    rng, memory, merged = np.random.default_rng(11), shared(), 0
    circles = memory.circles
    for _ in range(3000):
        for k in range(TRACKS):
            random_track(rng, memory, k)
        circles["number"] = rng.permutation(TRACKS) + 1
        circles["marks"] = rng.choice([0, CONFIRMED, PLACED], TRACKS, p=[0.8, 0.1, 0.1])
        t = int(rng.integers(TRACKS))
        circles["status"][t] = TENTATIVE
        live = circles["status"] != FREE
        want, older = naive_tracks.after_merging(
            t, live, places(memory), circles["radius"], circles["log_likelihood_ratio"], S.merge_m, circles["marks"],
            circles["number"],
        )  # fmt: skip
        refine.merge_duplicates(memory.tracks, P, t)
        assert ((circles["status"] != FREE) == want).all()
        assert (circles["number"][want] == older[want]).all()
        merged += int((live != want).sum())
    assert merged > 500


def test_the_next_free_track() -> None:
    rng, memory = np.random.default_rng(12), shared()
    circles = memory.circles
    for _ in range(1000):
        for k in range(TRACKS):
            random_track(rng, memory, k, int(rng.choice([FREE, TENTATIVE, ESTABLISHED], p=[0.08, 0.32, 0.6])))
        circles["marks"] = rng.choice([0, PLACED], TRACKS, p=[0.7, 0.3])
        free = np.flatnonzero(circles["status"] == FREE)
        tentative = np.flatnonzero((circles["status"] == TENTATIVE) & (circles["marks"] == 0))
        evidence = circles["log_likelihood_ratio"][tentative]
        weakest = int(tentative[np.argmin(evidence)]) if len(tentative) else -1
        assert track_initiation.free_track(memory.tracks) == (free[0] if len(free) else weakest)


def test_a_reset_track_keeps_only_its_number_its_marks_and_readings_beyond_the_counts() -> None:
    array = zeros(CircleTrack, 2)
    array.view(np.int64)[...] = np.arange(1, 1 + array.nbytes // 8)
    before = array.copy()
    track_initiation.reset_circle(records(CircleTrack, array)[0])
    kept = {"number", "marks", "bins"}
    assert not any(array[0][name].any() for name in CircleTrack.DTYPE.names or () if name not in kept)
    assert all(array[0][name] == before[0][name] for name in ("number", "marks"))
    assert not array[0]["bins"]["count"].any()
    assert array[1] == before[1]


def test_a_segment_of_a_known_body_is_known() -> None:
    rng, memory, known = np.random.default_rng(13), shared(), 0
    circles = memory.circles
    for _ in range(3000):
        for k in range(TRACKS):
            random_track(rng, memory, k)
        normal, rho, surface = unit(rng.uniform(0, 7)), float(rng.choice(RADII)), rng.uniform(-1, 1, 2)
        live = circles["status"] != FREE
        place = surface + rho * normal
        behind = surface + circles["radius"][:, None] * normal
        want = (live & (np.hypot(*(behind - places(memory)).T) < S.merge_m)).any()
        assert track_initiation.is_known(memory.tracks, P, *pair(place), rho, *pair(normal)) == want
        here = (live & (np.hypot(*(place - places(memory)).T) < S.merge_m)).any()
        assert track_initiation.is_known(memory.tracks, P, *pair(place), -1.0, *pair(normal)) == here
        known += int(want)
    assert 300 < known < 2700


def test_probability_is_a_share_among_all_explanations() -> None:
    rng, memory, inside = np.random.default_rng(14), shared(), 0
    track = memory.tracks[0]
    for _ in range(2000):
        lines = random_lines(rng, memory, 5)
        random_track(rng, memory, 0)
        track.unknown_nat = rng.uniform(0, 30)
        track.leads[:ALTERNATIVES] = np.where(
            rng.random(ALTERNATIVES) < 0.3, 0.0, rng.normal(-10, 15, ALTERNATIVES)
        )  # fmt: skip
        prior, kind = rng.normal(2, 2), track.kind
        place, rho = place_of(memory, 0), float(track.radius)
        in_wall = naive_tracks.stands_in_wall(lines.values(), place, rho)
        assert refine.is_in_wall(memory.s, *pair(place), rho) == in_wall
        inside += in_wall
        leads = {k: float(v) for k, v in enumerate(track.leads) if k != kind and v != 0.0}
        want = naive_tracks.probability(
            float(track.log_likelihood_ratio), bool(kind < S.model_count), prior, S.model_prior_nat,
            float(track.unknown_nat), leads, S.model_count, len(RADII), in_wall,
        )  # fmt: skip
        assert refine.existence_probability(memory.s, P, track, prior) == pytest.approx(want, rel=1e-12, abs=1e-12)
    assert inside > 30


def test_a_refinement_counts_and_decides_by_what_it_found() -> None:
    rng, memory = np.random.default_rng(15), shared()
    track, state = memory.tracks[0], memory.state
    outcomes = {FREE: 0, TENTATIVE: 0, ESTABLISHED: 0}
    for turn in range(300):
        memory.circles.view(np.uint8)[...] = 0
        state["lines"].view(np.uint8)[...] = 0
        random_track(rng, memory, 0, int(rng.choice([TENTATIVE, ESTABLISHED])))
        track.root_xx = track.root_yy = 0.01
        track.refinements = count = int(rng.integers(9))
        w = around(rng, int(rng.choice([2, 10, 40, 120])), place_of(memory, 0), float(track.radius))
        for q in readings_of(w):
            reservoir.keep_reading(track, float(track.x), float(track.y), q)
        n = reservoir.copy_reservoir(track, memory.s[0].scratch.readings)
        before, is_idle = int(track.status), bool(turn % 2)
        track.unseen, track.idle_firings, track.final_refinements = 100, S.idle_firings + is_idle, 3
        track.probability = -1.0
        done = int(state["refinements"][0])
        refine.quantum(memory.s, memory.tracks, P, 0.08)
        assert state["refinements"][0] == done + 1
        assert track.final_refinements == 3 - is_idle
        assert track.reservoir == n
        assert track.refinements in (0, count + 1)  # restarted as another kind
        assert track.unseen == (SWITCH_UNSEEN if track.refinements == 0 else 0)
        assert 0 <= track.alternative < ALTERNATIVES
        after = int(track.status)
        if track.probability < 0.0:  # too few readings, or a line
            is_line = n >= 3 and track.leads[len(RADII)] > SWITCH_LEAD_NAT
            assert after == FREE
            assert n < 3 or is_line
        else:
            assert track.unknown_nat == S.unknown_nat * track.near
            assert after == naive_tracks.fate(
                before, track.log_likelihood_ratio, track.unknown_nat, track.probability, track.hits,
                track.dispersion, max(track.root_xx, track.root_yy), S.dispersion_min,
            )  # fmt: skip
        outcomes[after] += 1
    assert min(outcomes.values()) > 10


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


def leaves(array: NDArray[Any]) -> Iterator[NDArray[Any]]:
    """Yield the numbers of an array of records, field by field."""
    if array.dtype.names is None:
        yield array
    for name in array.dtype.names or ():
        yield from leaves(array[name])


@pytest.mark.parametrize("tracks", [1, 48])
def test_garbage_is_survived(tracks: int) -> None:
    config = SETTINGS.perception.bayes.model_copy(update={"tracks_max": tracks})
    for seed, settings in enumerate((SETTINGS, BOXES)):
        rng, perception = np.random.default_rng(seed), BayesPerception(SETTINGS.ring, settings.models, config)
        memory = perception.memory
        for _ in range(60):
            perception.observe(garbage(rng))
            while perception.can_refine:
                perception.refine()
            for seen in perception.labelled_objects():
                assert np.isfinite([seen.x, seen.y, seen.theta, seen.sigma, seen.score]).all()
                assert 0.0 <= (seen.probability or 0.0) <= 1.0
        state, circles, polygons = memory.state, memory.circles, memory.polygons
        for array in (circles, polygons, state["lines"], state["roughness_nat"], state["residuals_nat"]):
            assert all(np.isfinite(leaf).all() for leaf in leaves(array))
        for array in (state["sensors"]["history"], state["buckets"]["segments"]):
            assert all(np.isfinite(leaf).all() for leaf in leaves(array))
        assert set(np.unique(circles["status"])) | set(np.unique(polygons["status"])) <= {
            FREE,
            TENTATIVE,
            ESTABLISHED,
        }
        assert len(circles) == tracks
        assert ((circles["kind"] >= 0) & (circles["kind"] < perception.settings[0].circle_count)).all()
        assert 0 <= state["noise_level"][0] < len(NOISES)
