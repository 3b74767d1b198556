"""Which object a quantum goes to: the most valuable one, what is unfinished next cycle, and everybody some day."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.load import load_settings
from perception.bayes import track_selection as selection
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.kernel_settings import make_settings
from perception.bayes.state import (
    DIRTY,
    ESTABLISHED,
    FREE,
    HERE_X,
    HERE_Y,
    NRES,
    PASSED,
    POLISH,
    PROB,
    QUIET,
    R00,
    R11,
    REFINEMENTS,
    ST,
    TENTATIVE,
    TX,
    TY,
    State,
    make_state,
)  # fmt: skip
from runtime.simulation.scenes import halls, readings
from tests import naive_tracks

SETTINGS = load_settings("hallway", models=("semicircle", "box"))
P = make_settings(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes)
TRACKS = 8
THRESHOLD = 0.08
WAIT_MAX = selection.PATIENCE + TRACKS + 1


def shared() -> State:
    return make_state(4, P, TRACKS, 64)


def alike(s: State, evidence: int = 10) -> State:
    """Make all tracks worth the same: at one place, with one covariance and as much evidence."""
    s.ti[:, ST], s.ti[:, NRES], s.ti[:, DIRTY] = ESTABLISHED, 100, evidence
    s.tf[:, [R00, R11]], s.tf[:, PROB] = 0.001, 1.0
    return s


def test_the_rule_against_its_oracle() -> None:
    rng, s, none, overdue = np.random.default_rng(12), shared(), 0, 0
    for _ in range(3000):
        s.ti[:, ST] = rng.choice([FREE, TENTATIVE, ESTABLISHED], TRACKS, p=[0.08, 0.32, 0.6])
        s.ti[:, [DIRTY, NRES, QUIET, POLISH]] = rng.integers([12, 300, 30, 3], size=(TRACKS, 4))
        s.ti[:, [DIRTY, POLISH]] *= rng.integers(2)
        s.ti[:, PASSED] = rng.integers(selection.PATIENCE + 4, size=TRACKS) * rng.integers(2)
        s.tf[:, [TX, TY]], s.tf[:, [R00, R11]] = rng.normal(0, 4, (TRACKS, 2)), rng.uniform(0, 0.02, (TRACKS, 2))
        s.tf[:, PROB] = rng.uniform(0.9, 1.0, TRACKS)
        s.g[[HERE_X, HERE_Y]] = rng.normal(0, 4, 2)
        i, f, passed = s.ti, s.tf, s.ti[:, PASSED].copy()
        want, waits = naive_tracks.next_in_turn(
            i[:, ST] != FREE, i[:, DIRTY], i[:, NRES], f[:, [R00, R11]].max(axis=1), f[:, PROB],
            (i[:, QUIET] > P.quiet) & (i[:, POLISH] > 0), np.hypot(*(f[:, [TX, TY]] - s.g[[HERE_X, HERE_Y]]).T),
            passed, THRESHOLD, P.range_max,
        )  # fmt: skip
        assert selection.is_waiting(s, P, THRESHOLD) == waits.any()
        assert selection.choose(s, P, THRESHOLD) == want
        expected = passed + waits
        if want >= 0:
            expected[want] = 0
            overdue += int(passed[want] > selection.PATIENCE)
        assert (s.ti[:, PASSED] == expected).all()
        none += want < 0
    assert none > 10
    assert overdue > 100


def test_new_evidence_doubt_and_nearness_each_decide_where_all_else_is_alike() -> None:
    for_evidence, for_doubt, for_nearness = alike(shared()), alike(shared()), alike(shared())
    for_evidence.ti[5, DIRTY] += 1
    assert selection.choose(for_evidence, P, THRESHOLD) == 5
    for_doubt.tf[3, R11] = 0.1
    assert selection.choose(for_doubt, P, THRESHOLD) == 3
    for_nearness.g[HERE_X] = 6.0
    for_nearness.tf[6, TX] = 5.0
    assert selection.choose(for_nearness, P, THRESHOLD) == 6


def test_polygons_are_chosen_by_evidence_and_patience_alone() -> None:
    s = shared()
    s.pi[:TRACKS, ST], s.pi[:TRACKS, NRES], s.pi[:TRACKS, DIRTY] = ESTABLISHED, 100, 10
    s.pi[2, DIRTY] += 1
    assert selection.choose_polygon(s, P, THRESHOLD) == 2
    s.pi[7, PASSED] = selection.PATIENCE + 1
    assert selection.choose_polygon(s, P, THRESHOLD) == 7
    s.pi[:, DIRTY] = 0
    assert selection.choose_polygon(s, P, THRESHOLD) == -1


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 30.0))
def test_with_one_quantum_a_cycle_nobody_waits_longer_than_the_bound(seed: int, far_m: float) -> None:
    """One object is far away and gets no more evidence; the others are near and get plenty in every cycle."""
    rng, s = np.random.default_rng(seed), alike(shared())
    s.tf[0, TX] = far_m
    since = np.zeros(TRACKS, int)
    for _ in range(4 * WAIT_MAX):
        s.ti[1:, DIRTY] += rng.integers(10, 60, TRACKS - 1)
        chosen = selection.choose(s, P, THRESHOLD)
        assert chosen >= 0
        s.ti[chosen, DIRTY] = 0  # as a refinement does
        since += 1
        since[chosen] = 0
        if s.ti[0, DIRTY] == 0:
            s.ti[0, DIRTY] = 10
        assert since.max() <= WAIT_MAX


def test_what_is_unfinished_is_the_next_cycles_first() -> None:
    s = alike(shared())
    order = []
    for _ in range(TRACKS):
        order.append(selection.choose(s, P, THRESHOLD))
        s.ti[order[-1], DIRTY] = 0
    assert sorted(order) == list(range(TRACKS)), "each once: nobody twice before everybody once"
    assert selection.choose(s, P, THRESHOLD) == -1


@pytest.mark.compiled
def test_in_a_hall_with_one_quantum_a_firing_every_track_gets_its_turn() -> None:
    """The wait is counted in quanta; the drive through a whole hall of drums, a box, posts and walls."""
    config = SETTINGS.perception.bayes.model_copy(update={"quanta_per_firing": 50})
    perception = BayesPerception(SETTINGS.ring, SETTINGS.models, config)
    hall = halls("halls", 3)[0]
    longest = cut = 0
    for firing in readings(SETTINGS.ring, hall, 3):
        perception.observe(firing)
        perception.refine()
        cut += perception.can_refine
        longest = max(longest, int(perception.memory.ti[:, PASSED].max()), int(perception.memory.pi[:, PASSED].max()))
    assert cut > 100, "one quantum was enough: nothing was put to the test"
    assert 3 < longest <= selection.PATIENCE + SETTINGS.perception.bayes.tracks_max + 1


def test_neither_circles_nor_polygons_keep_the_others_from_their_turn() -> None:
    """One quantum a firing, while circles wait all the time: polygons get every other one."""
    config = SETTINGS.perception.bayes
    perception = BayesPerception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes)
    served: list[str] = []
    for firing in list(readings(SETTINGS.ring, halls("boxes_45")[0], 0))[20:60]:
        perception.observe(firing)
        circles_done = perception.memory.g[REFINEMENTS]
        if selection.is_waiting(perception.memory, perception.settings, config.fresh_share):
            perception.refine()
            served.append("circle" if perception.memory.g[REFINEMENTS] > circles_done else "polygon")
    assert len(served) > 10
    assert abs(served.count("circle") - served.count("polygon")) <= 0.5 * len(served)
