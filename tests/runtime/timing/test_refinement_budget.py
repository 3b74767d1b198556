"""Tests of the refinement budgets: counted quanta, CPU time, and what the record of a cycle says about them."""

from __future__ import annotations

import pytest

from config.load import load_settings
from runtime.cycle.step import CycleRecord
from runtime.simulation.closed_loop import SimulationOptions, simulate
from runtime.timing.refinement_budget import CpuTimeBudget, QuantumBudget, RefinementBudget


def granted(budget: RefinementBudget, cycles: int) -> list[int]:
    """Return the number of quanta that each of `cycles` cycles gets while work never ends."""
    counts = []
    for _ in range(cycles):
        budget.begin()
        done = 0
        while budget(done):
            done += 1
        counts.append(done)
    return counts


def test_quanta_per_cycle() -> None:
    assert granted(QuantumBudget(3), 3) == [3, 3, 3]
    assert granted(QuantumBudget(0.25), 9) == [0, 0, 0, 1, 0, 0, 0, 1, 0]
    assert granted(QuantumBudget(0), 3) == [0, 0, 0]


def test_unused_quanta_are_lost() -> None:
    budget = QuantumBudget(2)
    for _ in range(5):
        budget.begin()
    assert granted(budget, 1) == [2]


def test_cpu_time_restarts_each_cycle() -> None:
    spent_s = 0.0

    def clock() -> float:
        nonlocal spent_s
        spent_s += 0.001  # one quantum between two readings of the clock
        return spent_s

    assert granted(CpuTimeBudget(0.0035, clock), 3) == [3, 3, 3]
    assert granted(CpuTimeBudget(0.0, clock), 2) == [0, 0]


@pytest.mark.compiled
def test_record_holds_quanta_and_the_reason_why_refinement_stopped() -> None:
    """Work beyond the quota of a firing waits for the next firing, beyond the budget for the next cycle."""
    settings = load_settings("hallway")
    assert settings.world is not None
    records: list[CycleRecord] = []
    for budget in (QuantumBudget(50), QuantumBudget(0.5)):
        simulate(
            settings,
            settings.world,
            0,
            15.0,
            lambda record, _truth: records.append(record),
            options=SimulationOptions(refinement_budget=budget),
        )
    quanta: dict[str, set[int]] = {}
    for record in records:
        quanta.setdefault(record.refinement, set()).add(record.quanta)
    assert quanta == {"nothing": {0}, "converged": {1, 2}, "quota": {2}, "budget": {0, 1}}
