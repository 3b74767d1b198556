"""Which object a quantum goes to: the most valuable one, what is unfinished next cycle, and everybody some day."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.load import load_settings
from perception.bayes import track_selection as selection
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.elements import MAX_POLYGONS
from perception.bayes.kernel_settings import make_settings
from perception.bayes.parameters import PASSES_MAX
from perception.bayes.state import ESTABLISHED, FREE, TENTATIVE, Memory
from runtime.simulation.scenes import halls, readings
from tests import naive_tracks

SETTINGS = load_settings("hallway", models=("semicircle", "box"))
P = make_settings(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes)
TRACKS = 8
THRESHOLD = 0.08
WAIT_MAX = PASSES_MAX + TRACKS + 1


def shared() -> Memory:
    return Memory(4, TRACKS)


def choose(memory: Memory) -> int:
    return selection.choose_circle(memory.s, memory.tracks, P, THRESHOLD)


def alike(memory: Memory, evidence: int = 10) -> Memory:
    """Give all tracks the same value: at one place, with one covariance and as much evidence."""
    circles = memory.circles
    circles["status"], circles["reservoir"], circles["unseen"] = ESTABLISHED, 100, evidence
    circles["root_xx"], circles["root_yy"], circles["probability"] = 0.001, 0.001, 1.0
    return memory


def test_the_rule_against_its_oracle() -> None:
    rng, memory, none, overdue = np.random.default_rng(12), shared(), 0, 0
    circles, settings = memory.circles, P[0]
    for _ in range(3000):
        circles["status"] = rng.choice([FREE, TENTATIVE, ESTABLISHED], TRACKS, p=[0.08, 0.32, 0.6])
        counts = rng.integers([12, 300, 30, 3], size=(TRACKS, 4)).T
        is_waiting = rng.integers(2)
        circles["unseen"], circles["reservoir"] = counts[0] * is_waiting, counts[1]
        circles["idle_firings"], circles["final_refinements"] = counts[2], counts[3] * is_waiting
        circles["passed_over"] = rng.integers(PASSES_MAX + 4, size=TRACKS) * rng.integers(2)
        circles["x"], circles["y"] = rng.normal(0, 4, (2, TRACKS))
        circles["root_xx"], circles["root_yy"] = rng.uniform(0, 0.02, (2, TRACKS))
        circles["probability"] = rng.uniform(0.9, 1.0, TRACKS)
        memory.s[0].ring_x, memory.s[0].ring_y = rng.normal(0, 4, 2).tolist()
        passed = circles["passed_over"].copy()
        away = np.hypot(circles["x"] - memory.s[0].ring_x, circles["y"] - memory.s[0].ring_y)
        want, waits = naive_tracks.next_in_turn(
            circles["status"] != FREE, circles["unseen"], circles["reservoir"],
            np.maximum(circles["root_xx"], circles["root_yy"]), circles["probability"],
            (circles["idle_firings"] > settings.idle_firings) & (circles["final_refinements"] > 0), away, passed,
            THRESHOLD, settings.range_max_m,
        )  # fmt: skip
        assert selection.is_waiting(memory.tracks, P, THRESHOLD) == waits.any()
        assert choose(memory) == want
        expected = passed + waits
        if want >= 0:
            expected[want] = 0
            overdue += int(passed[want] > PASSES_MAX)
        assert (circles["passed_over"] == expected).all()
        none += want < 0
    assert none > 10
    assert overdue > 100


def test_new_evidence_doubt_and_nearness_each_decide_where_all_else_is_alike() -> None:
    for_evidence, for_doubt, for_nearness = alike(shared()), alike(shared()), alike(shared())
    for_evidence.circles["unseen"][5] += 1
    assert choose(for_evidence) == 5
    for_doubt.circles["root_yy"][3] = 0.1
    assert choose(for_doubt) == 3
    for_nearness.s[0].ring_x = 6.0
    for_nearness.circles["x"][6] = 5.0
    assert choose(for_nearness) == 6


def test_polygons_are_chosen_by_evidence_and_waiting_time_alone() -> None:
    memory = shared()
    polygons = memory.polygons
    assert len(polygons) == MAX_POLYGONS
    polygons["status"][:TRACKS], polygons["reservoir"][:TRACKS], polygons["unseen"][:TRACKS] = ESTABLISHED, 100, 10
    polygons["unseen"][2] += 1
    assert selection.choose_polygon(memory.s, P, THRESHOLD) == 2
    polygons["passed_over"][7] = PASSES_MAX + 1
    assert selection.choose_polygon(memory.s, P, THRESHOLD) == 7
    polygons["unseen"] = 0
    assert selection.choose_polygon(memory.s, P, THRESHOLD) == -1


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 30.0))
def test_with_one_quantum_a_cycle_no_track_waits_longer_than_the_bound(seed: int, far_m: float) -> None:
    """One object is far away and gets no more evidence; the others are near and get plenty in every cycle."""
    rng, memory = np.random.default_rng(seed), alike(shared())
    memory.circles["x"][0], unseen = far_m, memory.circles["unseen"]
    since = np.zeros(TRACKS, int)
    for _ in range(4 * WAIT_MAX):
        unseen[1:] += rng.integers(10, 60, TRACKS - 1)
        chosen = choose(memory)
        assert chosen >= 0
        unseen[chosen] = 0  # as a refinement does
        since += 1
        since[chosen] = 0
        if unseen[0] == 0:
            unseen[0] = 10
        assert since.max() <= WAIT_MAX


def test_what_is_unfinished_is_the_next_cycles_first() -> None:
    memory = alike(shared())
    order: list[int] = []
    for _ in range(TRACKS):
        order.append(choose(memory))
        memory.circles["unseen"][order[-1]] = 0
    assert sorted(order) == list(range(TRACKS)), "each once: none twice before all once"
    assert choose(memory) == -1


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
        tracks = (perception.memory.circles, perception.memory.polygons)
        longest = max(longest, *(int(of["passed_over"].max()) for of in tracks))
    assert cut > 100, "one quantum was enough: nothing was put to the test"
    assert 3 < longest <= PASSES_MAX + SETTINGS.perception.bayes.tracks_max + 1


def test_neither_circles_nor_polygons_keep_the_others_from_their_turn() -> None:
    """One quantum a firing, while circles wait all the time: polygons get every other one."""
    config = SETTINGS.perception.bayes
    perception = BayesPerception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes)
    served: list[str] = []
    for firing in list(readings(SETTINGS.ring, halls("boxes_45")[0], 0))[20:60]:
        perception.observe(firing)
        circles_done = perception.memory.s[0].refinements
        if selection.is_waiting(perception.memory.tracks, perception.settings, config.fresh_share):
            perception.refine()
            served.append("circle" if perception.memory.s[0].refinements > circles_done else "polygon")
    assert len(served) > 10
    assert abs(served.count("circle") - served.count("polygon")) <= 0.5 * len(served)
