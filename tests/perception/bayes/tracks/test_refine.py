"""Refinement of circle tracks against oracles on random cases: merging, probability, status and moves."""

from __future__ import annotations

import numpy as np
import pytest

from perception.bayes.inference import reservoir, track_labels
from perception.bayes.memory.parameters import SWITCH_LEAD_NAT, SWITCH_UNSEEN
from perception.bayes.memory.state import CONFIRMED, ESTABLISHED, FREE, PLACED, TENTATIVE
from perception.bayes.tracks import refine
from tests import naive_tracks
from tests.perception.bayes.random_tracks import (
    ALTERNATIVES,
    RADII,
    TRACKS,
    P,
    S,
    around,
    examples,
    new_memory,
    place_of,
    places,
    random_track,
    readings_of,
)


@examples(300, 3000)
def test_of_two_tracks_in_one_place_the_marked_one_stays_else_the_one_with_more_evidence(examples: int) -> None:
    rng, memory, merged = np.random.default_rng(11), new_memory(), 0
    circles = memory.circles
    for _ in range(examples):
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
        track_labels.merge_duplicates(memory.tracks, P, t)
        assert ((circles["status"] != FREE) == want).all()
        assert (circles["number"][want] == older[want]).all()
        merged += int((live != want).sum())
    assert merged > 0.16 * examples


@examples(150, 2000)
def test_probability_is_a_share_among_all_explanations(examples: int) -> None:
    rng, memory = np.random.default_rng(14), new_memory()
    track = memory.tracks[0]
    for _ in range(examples):
        random_track(rng, memory, 0)
        track.unknown_nat = rng.uniform(0, 30)
        track.leads[:ALTERNATIVES] = np.where(
            rng.random(ALTERNATIVES) < 0.3, 0.0, rng.normal(-10, 15, ALTERNATIVES)
        )  # fmt: skip
        prior, kind = rng.normal(2, 2), track.kind
        track.outline_lead, track.round_lead = rng.normal(0, 5, 2) * (rng.random(2) < 0.5)
        leads = {k: float(v) for k, v in enumerate(track.leads) if k != kind and v != 0.0}
        want = naive_tracks.probability(
            float(track.log_likelihood_ratio), bool(kind < S.model_count), prior, S.model_prior_nat,
            float(track.unknown_nat), leads, float(track.outline_lead), float(track.round_lead), S.model_count,
            len(RADII),
        )  # fmt: skip
        assert refine.existence_probability(P, track, prior) == pytest.approx(want, rel=1e-12, abs=1e-12)


@examples(24, 300)
def test_a_refinement_is_counted_and_its_result_determines_the_status(examples: int) -> None:
    rng, memory = np.random.default_rng(15), new_memory()
    track, state = memory.tracks[0], memory.state
    outcomes = {FREE: 0, TENTATIVE: 0, ESTABLISHED: 0}
    for turn in range(examples):
        memory.circles.view(np.uint8)[...] = 0
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
    assert min(outcomes.values()) > 0.03 * examples
