"""Short form of `python -m bench.budget`: refinement ends with its budget, and a quantum is short.

Thread times are judged as in tests/perception/thread_time.py: a drive is the same each time, to the bit, so that its
quanta can be compared from drive to drive.
"""

from __future__ import annotations

import numpy as np
import pytest

from bench.budget import DriveCosts, costs_of_drive
from config.load import load_settings
from tests.perception.thread_time import REPETITIONS_MAX, always_beyond, control_ms

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

SETTINGS = load_settings("hallway", ["behaviors.move_ahead.at_end=turn_back"])
CYCLES = 600
NEVER_S = 10.0
"""A budget that no cycle spends, whatever the machine does."""
QUANTUM_MAX = 5.0
"""Limit of a quantum's thread time beside the control: half a millisecond on the machine it was written on."""
CYCLE_MAX = 50.0
"""Limit of a cycle's perception: the default budget of five milliseconds."""
LATE_SHARE_MAX = 0.05
"""Share of quanta that the machine may have delayed, by half a quantum, between the look at the budget and their
start. Fewer than 1 in 100 were, beside eighteen busy processes: of 90 more than 4 are late once in 500 drives, in
each of six once in 10^16. Without a look at the budget, a third would be late."""
QUANTA_MIN, CUT_SHORT_MIN = 90, 30
"""Quanta and cycles cut short in a drive that says something."""


def control_us() -> float:
    """Return the time of the control now, µs."""
    return 1e3 * float(np.median([control_ms() for _ in range(50)]))


@pytest.fixture(scope="module")
def drive() -> DriveCosts:
    """Return the costs of a drive whose budget is never spent."""
    return costs_of_drive(SETTINGS, CYCLES, NEVER_S)


def test_each_quantum_and_each_cycle_is_short(drive: DriveCosts) -> None:
    drives: list[DriveCosts] = []

    def quanta() -> tuple[list[float], float]:
        drives.append(costs_of_drive(SETTINGS, CYCLES, NEVER_S) if drives else drive)
        return drives[-1].quanta_us, QUANTUM_MAX * control_us()

    assert always_beyond(quanta) == set(), "quanta that take too long every time"
    assert len(drives[0].quanta_us) > 150
    assert {len(drive.quanta_us) for drive in drives} == {len(drives[0].quanta_us)}
    assert all("budget" not in one.causes for one in drives)

    def cycles() -> tuple[list[float], float]:
        other = drives.pop() if drives else costs_of_drive(SETTINGS, CYCLES, NEVER_S)
        return other.spent_us, CYCLE_MAX * control_us()

    assert always_beyond(cycles) == set(), "cycles that spend more than the default budget every time"


def test_no_quantum_starts_after_the_budget_is_spent(drive: DriveCosts) -> None:
    """Where many cycles end with their budget and many quanta fit into it, those start before it is spent.

    The machine's speed may change from drive to drive, so that the budget follows it. Only what is late in each of
    six such drives is the program's fault; a program without a budget has no such drive.
    """
    budget_us = float(np.median(drive.started_us))
    late_shares: list[float] = []
    for _ in range(2 * REPETITIONS_MAX):
        tight = costs_of_drive(SETTINGS, CYCLES, 1e-6 * budget_us)
        if len(tight.started_us) < QUANTA_MIN:
            budget_us *= 1.5
        elif tight.causes.get("budget", 0) < CUT_SHORT_MIN:
            budget_us /= 1.5
        else:
            margin_us = 0.5 * float(np.median(tight.quanta_us))
            late_shares.append(float(np.mean(np.array(tight.started_us) > budget_us + margin_us)))
            if late_shares[-1] <= LATE_SHARE_MAX or len(late_shares) == REPETITIONS_MAX:
                break
    assert late_shares, "no drive is cut short by its budget"
    assert min(late_shares) <= LATE_SHARE_MAX, late_shares
