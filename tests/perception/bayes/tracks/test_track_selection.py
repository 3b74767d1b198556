"""Selection of the track to refine: the most valuable first, and none waits longer than the bound."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.load import load_settings
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.inference.kernel_settings import make_settings
from perception.bayes.memory.elements import MAX_POLYGONS
from perception.bayes.memory.parameters import PASSED_OVER_MAX
from perception.bayes.memory.state import ESTABLISHED, FREE, TENTATIVE, Memory
from perception.bayes.tracks import track_selection as selection
from runtime.simulation.scenes import halls, readings
from tests import naive_tracks
from tests.perception.bayes.random_tracks import examples

SETTINGS = load_settings("hallway", models=("semicircle", "box"))
P = make_settings(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes)
TRACKS = 8
THRESHOLD = 0.08
WAIT_MAX = PASSED_OVER_MAX + TRACKS + 1


def new_memory() -> Memory:
    return Memory(4, TRACKS)


def choose(memory: Memory) -> int:
    return selection.choose_circle(memory.s, memory.tracks, P, THRESHOLD)


def alike(memory: Memory, evidence: int = 10) -> Memory:
    """Give all tracks the same value: one place, one covariance, the same evidence."""
    circles = memory.circles
    circles["status"], circles["reservoir"], circles["unseen"] = ESTABLISHED, 100, evidence
    circles["root_xx"], circles["root_yy"], circles["probability"] = 0.001, 0.001, 1.0
    return memory


@examples(500, 3000)
def test_the_choice_equals_its_oracle(examples: int) -> None:
    rng, memory, none, overdue = np.random.default_rng(12), new_memory(), 0, 0
    circles = memory.circles
    for _ in range(examples):
        circles["status"] = rng.choice([FREE, TENTATIVE, ESTABLISHED], TRACKS, p=[0.08, 0.32, 0.6])
        counts = rng.integers([12, 300, 30, 3], size=(TRACKS, 4)).T
        has_evidence = rng.integers(2)
        circles["unseen"], circles["reservoir"] = counts[0] * has_evidence, counts[1]
        circles["idle_firings"], circles["final_refinements"] = counts[2], counts[3] * has_evidence
        circles["passed_over"] = rng.integers(PASSED_OVER_MAX + 4, size=TRACKS) * rng.integers(2)
        circles["x"], circles["y"] = rng.normal(0, 4, (2, TRACKS))
        circles["root_xx"], circles["root_yy"] = rng.uniform(0, 0.02, (2, TRACKS))
        circles["probability"] = rng.uniform(0.9, 1.0, TRACKS)
        memory.s[0].ring_x, memory.s[0].ring_y = rng.normal(0, 4, 2).tolist()
        passed = circles["passed_over"].copy()
        away = np.hypot(circles["x"] - memory.s[0].ring_x, circles["y"] - memory.s[0].ring_y)
        want, waits = naive_tracks.next_in_turn(
            circles["status"] != FREE, circles["unseen"], circles["reservoir"],
            np.maximum(circles["root_xx"], circles["root_yy"]), circles["probability"],
            (circles["idle_firings"] > P[0].idle_firings) & (circles["final_refinements"] > 0), away, passed,
            THRESHOLD, P[0].range_max_m,
        )  # fmt: skip
        assert selection.is_waiting(memory.tracks, P, THRESHOLD) == waits.any()
        assert choose(memory) == want
        expected = passed + waits
        if want >= 0:
            expected[want] = 0
            overdue += int(passed[want] > PASSED_OVER_MAX)
        assert (circles["passed_over"] == expected).all()
        none += want < 0
    assert none > 0.003 * examples
    assert overdue > 0.03 * examples


def test_new_evidence_uncertainty_and_nearness_each_decide_between_equal_tracks() -> None:
    for_evidence, for_uncertainty, for_nearness = alike(new_memory()), alike(new_memory()), alike(new_memory())
    for_evidence.circles["unseen"][5] += 1
    assert choose(for_evidence) == 5
    for_uncertainty.circles["root_yy"][3] = 0.1
    assert choose(for_uncertainty) == 3
    for_nearness.s[0].ring_x = 6.0
    for_nearness.circles["x"][6] = 5.0
    assert choose(for_nearness) == 6


def test_polygons_are_chosen_by_evidence_and_waiting_time_alone() -> None:
    memory = new_memory()
    polygons = memory.polygons
    assert len(polygons) == MAX_POLYGONS
    polygons["status"][:TRACKS], polygons["reservoir"][:TRACKS], polygons["unseen"][:TRACKS] = ESTABLISHED, 100, 10
    polygons["unseen"][2] += 1
    assert selection.choose_polygon(memory.s, P, THRESHOLD) == 2
    polygons["passed_over"][7] = PASSED_OVER_MAX + 1
    assert selection.choose_polygon(memory.s, P, THRESHOLD) == 7
    polygons["unseen"] = 0
    assert selection.choose_polygon(memory.s, P, THRESHOLD) == -1


@settings(max_examples=settings().max_examples // 5)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 30.0))
def test_with_one_quantum_a_cycle_no_track_waits_longer_than_the_bound(seed: int, far_m: float) -> None:
    """One object is far away and gets no more evidence; the others are near and get plenty in every cycle."""
    rng, memory = np.random.default_rng(seed), alike(new_memory())
    memory.circles["x"][0], unseen = far_m, memory.circles["unseen"]
    since = np.zeros(TRACKS, int)
    for _ in range(2 * WAIT_MAX):
        unseen[1:] += rng.integers(10, 60, TRACKS - 1)
        chosen = choose(memory)
        assert chosen >= 0
        unseen[chosen] = 0  # as a refinement does
        since += 1
        since[chosen] = 0
        if unseen[0] == 0:
            unseen[0] = 10
        assert since.max() <= WAIT_MAX


def test_each_track_is_refined_once_before_any_is_refined_twice() -> None:
    memory = alike(new_memory())
    order: list[int] = []
    for _ in range(TRACKS):
        order.append(choose(memory))
        memory.circles["unseen"][order[-1]] = 0
    assert sorted(order) == list(range(TRACKS))
    assert choose(memory) == -1


@pytest.mark.compiled
def test_in_a_hall_with_one_quantum_a_firing_no_track_waits_longer_than_the_bound() -> None:
    """The wait is counted in quanta, on a drive through a hall of drums, a box, posts and walls."""
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
    assert cut > 100, "one quantum was enough, so nothing was tested"
    assert 3 < longest <= PASSED_OVER_MAX + SETTINGS.perception.bayes.tracks_max + 1


@pytest.mark.compiled
def test_circles_and_polygons_take_turns() -> None:
    """With one quantum a firing, and circles always waiting, polygons get every other quantum."""
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
