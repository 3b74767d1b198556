"""Cost of perception per ring reading with compiled kernels, and its budget, which holds to one quantum.

Thread times are judged as in tests/perception/thread_time.py. Milliseconds are measured by `make bench`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from config.load import load_settings
from drivers.messages import Firing
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.tracks import refine
from perception.pipeline import Perception
from runtime.cycle.step import CycleRecord, State, step
from runtime.simulation.closed_loop import simulate
from runtime.timing.refinement_budget import within_quanta_per_cycle
from tests.perception.thread_time import always_beyond, control_ms, median_ratio, thread_ms

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

SETTINGS = load_settings("hallway")
MANY_QUANTA = load_settings("hallway", ["perception.method=paper"])
"""The paper's method refines every candidate whose cluster changed, so that a budget can interrupt it."""
RATIO_MAX = 2.0
"""Limit of a reading beside the control, twice what is measured, 1.0; beside other programs it is up to 1.2, and
interpreted ten times the control."""
DRIVES_MAX = 5
"""Drives of which one must keep to the limit."""
WORST_RATIO_MAX = 10.0
"""Limit of each single reading. Measured is 5."""


@pytest.fixture(scope="module")
def records() -> list[CycleRecord]:
    """Return a drive down the hallway, about 24 s of it."""
    assert SETTINGS.world is not None
    kept: list[CycleRecord] = []
    simulate(SETTINGS, SETTINGS.world, 0, 24.0, lambda record, _truth: kept.append(record))
    return kept


def fresh() -> Perception:
    return Perception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception)


def take(perception: Perception, firing: Firing) -> None:
    """Process one reading, with up to a cycle's quanta of refinement."""
    perception.observe(firing)
    done = 0
    while perception.can_refine and within_quanta_per_cycle(done):
        perception.refine()
        done += 1


@pytest.fixture(scope="module")
def firings(records: list[CycleRecord]) -> list[Firing]:
    """Return the readings of the drive."""
    firings = [firing for record in records for firing in record.inputs.received.firings]
    assert len(firings) > 300
    return firings


def test_cost_of_a_ring_reading(firings: list[Firing]) -> None:
    ratios: list[float] = []

    def drive() -> tuple[list[float], float]:
        perception, costs, controls = fresh(), [], []
        for firing in firings:
            costs.append(thread_ms(lambda: take(perception, firing)))  # noqa: B023
            controls.append(control_ms())
        assert len(perception.objects()) == 6
        ratios.append(median_ratio(costs, controls))
        return costs, WORST_RATIO_MAX * float(np.median(controls))

    assert always_beyond(drive) == set(), "readings that are slow every time"
    while min(ratios) > RATIO_MAX and len(ratios) < DRIVES_MAX:  # other programs share the processor's caches
        drive()
    assert min(ratios) <= RATIO_MAX, ratios


def test_cost_does_not_grow_with_distance(firings: list[Firing]) -> None:
    """Old segments are dropped, so that the fourth lap past the same drums costs what the first does."""
    lap_s = firings[-1].robot_s - firings[0].robot_s + 1.0
    first, fourth = fresh(), fresh()
    for lap in range(3):
        for firing in firings:
            take(fourth, later(firing, lap * 10.0 * lap_s))
    costs, controls = [], []
    for firing in firings:
        controls.append(thread_ms(lambda: take(first, firing)))  # noqa: B023
        costs.append(thread_ms(lambda: take(fourth, later(firing, 30.0 * lap_s))))  # noqa: B023
    assert median_ratio(costs, controls) <= 2.0


def later(firing: Firing, after_s: float) -> Firing:
    return Firing(firing.robot_s + after_s, firing.pose, firing.ring_yaw, firing.ranges_m)


def test_a_call_that_finds_nothing_to_do_costs_microseconds() -> None:
    """Three arrays of records go over to compiled code; single records would cost as much as the control."""
    perception = BayesPerception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes)
    memory, never = perception.memory, 1e9
    refine.quantum(memory.s, memory.tracks, perception.settings, never)
    costs, controls = [], []
    for _ in range(200):
        costs.append(thread_ms(lambda: refine.quantum(memory.s, memory.tracks, perception.settings, never)))
        controls.append(control_ms())
    assert median_ratio(costs, controls) < 0.1


class VirtualClock:
    """Clock that advances by `quantum_s` per quantum only."""

    def __init__(self, quantum_s: float) -> None:
        self.spent_s, self.quantum_s = 0.0, quantum_s


class VirtualTimePerception(Perception):
    """Perception whose every quantum takes the same virtual time."""

    clock: VirtualClock

    def refine(self) -> int:
        self.clock.spent_s += self.clock.quantum_s
        return super().refine()


def budgeted(records: list[CycleRecord], budget_s: float, quantum_s: float) -> Iterator[tuple[CycleRecord, float]]:
    """Repeat the drive under a budget; yield each record and the time of its refinement, s."""
    perception = VirtualTimePerception(MANY_QUANTA.ring, MANY_QUANTA.models, MANY_QUANTA.perception)
    clock = perception.clock = VirtualClock(quantum_s)
    state = State(perception)
    for record in records:
        begin_s = clock.spent_s

        def may_refine(_done: int, begin_s: float = begin_s) -> bool:
            return clock.spent_s - begin_s < budget_s

        yield step(state, record.inputs, MANY_QUANTA, lambda _c: None, may_refine), clock.spent_s - begin_s


@pytest.mark.parametrize(
    "budget_s", [0.001, *(pytest.param(one, marks=pytest.mark.soak) for one in (0.0001, 0.0015, 0.0025))]
)
def test_budget_is_exceeded_by_less_than_one_quantum(records: list[CycleRecord], budget_s: float) -> None:
    quantum_s = 0.001
    causes = []
    for record, spent_s in budgeted(records, budget_s, quantum_s):
        assert spent_s < budget_s + quantum_s
        if record.refinement == "budget":
            assert spent_s >= budget_s, "refinement stopped before its budget was spent"
        causes.append(record.refinement)
    assert {"budget", "nothing"} <= set(causes)


def test_zero_budget_turns_refinement_off(records: list[CycleRecord]) -> None:
    """The robot still drives and avoids obstacles, but recognises no objects."""
    for record, spent_s in budgeted(records, 0.0, 0.001):
        assert (record.quanta, spent_s) == (0, 0.0)
        assert record.refinement in {"budget", "nothing"}


def test_one_quantum_per_cycle_makes_progress(records: list[CycleRecord]) -> None:
    """One quantum per cycle is enough to find the drums."""
    perception = VirtualTimePerception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception)
    perception.clock = VirtualClock(1.0)
    state = State(perception)
    once: Callable[[int], bool] = lambda done: done < 1  # noqa: E731
    for record in records:
        assert step(state, record.inputs, SETTINGS, lambda _c: None, once).quanta <= 1
    assert len(perception.objects()) == 6
