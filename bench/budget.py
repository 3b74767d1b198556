"""Cost of a cycle's refinement against its budget, in thread CPU time; `make soak` drives 100,000 cycles.

It runs as its own process. Perception's time is that of its base part and of its quanta: in no cycle may it exceed
the budget and one quantum of half a millisecond.

A virtual machine charges time that its host took away to the running thread. The drive is bit-identical every time,
so it is repeated: the smaller time of each cycle is its own, and the rest is the machine's.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field
from typing import Annotated, Any, Final

import numpy as np
import orjson
from cyclopts import App, Parameter
from rich.console import Console

from config.errors import DONE, FAILED
from config.load import load_settings
from config.settings import Settings
from drivers.driver import RobotDriver
from drivers.emulator.memory_transport import MemoryLine
from drivers.messages import Floats
from drivers.registry import make_device, make_driver
from perception.pipeline import Perception
from runtime.cycle.inputs import OperatorInput, Request, gather_inputs
from runtime.cycle.modes import Mode
from runtime.cycle.step import Inputs, State, apply_command, step
from runtime.support.kernel_warmup import prepare_kernels
from runtime.timing.memory_policy import MemoryPolicy
from runtime.timing.phases import Phase
from runtime.timing.refinement_budget import CpuTimeBudget

QUANTUM_MAX_US: Final = 500.0
"""Limit of a quantum's CPU time at p99.9."""
AMPLE_MS: Final = 5.0
"""The default budget of a run."""
TIGHT: Final = 1.25
"""The tight budget in medians of the part that always runs and one quantum, so that it often ends refinement."""
DRIVES: Final = 2
SETTLED_CYCLES: Final = 200
"""Cycles before the measurement: the robot is armed, and buffers are allocated on first use."""

app = App(help="Drive for many cycles in virtual time and compare perception's time with its budget.")


@dataclass
class DriveCosts:
    """CPU times of one drive, µs."""

    budget_us: float
    base_us: list[float] = field(default_factory=list)
    """Of the part of perception that always runs, per cycle."""
    spent_us: list[float] = field(default_factory=list)
    """Of that part and the quanta, per cycle."""
    quanta_us: list[float] = field(default_factory=list)
    """Of each quantum."""
    started_us: list[float] = field(default_factory=list)
    """From the beginning of its cycle to the start of each quantum."""
    begin_ns: int = 0
    """Beginning of the cycle in progress."""
    causes: dict[str, int] = field(default_factory=dict)
    """Number of cycles by the reason why refinement stopped."""

    def beyond_us(self) -> Floats:
        """Return by how much each cycle exceeded its budget, µs, shape (cycles,)."""
        return np.array(self.spent_us) - self.budget_us

    def figures(self) -> dict[str, Any]:
        """Return the figures of this drive."""
        return {
            "budget_us": self.budget_us,
            "cycles": len(self.spent_us),
            "quanta": len(self.quanta_us),
            "quantum_us": _quantiles(self.quanta_us),
            "perception_us": _quantiles(self.spent_us),
            "base_us": _quantiles(self.base_us),
            "beyond_budget_us_max": round(float(self.beyond_us().max()), 1),
            "cycles_beyond_a_quantum": int((self.beyond_us() > QUANTUM_MAX_US).sum()),
            "causes": self.causes,
        }


def _quantiles(taken_us: list[float]) -> dict[str, float]:
    """Return quantiles of durations; zeros if the budget left no time for any."""
    values = np.quantile(taken_us or [0.0], [0.5, 0.99, 0.999, 1.0]).tolist()
    return {name: round(value, 1) for name, value in zip(("p50", "p99", "p99.9", "max"), values, strict=True)}


class TimedPerception(Perception):
    """Perception that measures the CPU time of its quanta."""

    costs: DriveCosts

    def refine(self) -> int:
        """Run one quantum and record its CPU time; return what the quantum returns."""
        begin_ns = time.thread_time_ns()
        done = super().refine()
        took_us = 1e-3 * (time.thread_time_ns() - begin_ns)
        self.costs.quanta_us.append(took_us)
        self.costs.started_us.append(1e-3 * (begin_ns - self.costs.begin_ns))
        return done


def costs_of_drive(settings: Settings, cycles: int, budget_s: float) -> DriveCosts:
    """Return the costs of driving up and down the hall under a budget of thread CPU time.

    Parameters
    ----------
    settings
        Settings of the run.
    cycles
        Number of cycles to measure.
    budget_s
        Refinement budget of a cycle, s of CPU time.
    """
    assert settings.world is not None
    robot = make_device(settings, settings.world, 0)
    driver = make_driver(settings)
    line = MemoryLine(driver, robot)
    perception = TimedPerception(settings.ring, settings.models, settings.perception)
    costs = perception.costs = DriveCosts(1e6 * budget_s)
    state = State(perception)
    memory = MemoryPolicy()
    with memory.driving():
        for cycle in range(1, SETTLED_CYCLES + cycles + 1):
            run_s = cycle / settings.cycle.rate_hz
            line.exchange(run_s)
            inputs = gather_inputs(
                driver, run_s, OperatorInput(Request.ARM if state.mode.mode is Mode.READY else None)
            )
            if cycle == SETTLED_CYCLES + 1:
                costs = perception.costs = DriveCosts(1e6 * budget_s)
            _one_cycle(state, inputs, settings, driver, costs, budget_s)
            memory.cycle_done(1.0)
    return costs


def _one_cycle(
    state: State, inputs: Inputs, settings: Settings, driver: RobotDriver, costs: DriveCosts, budget_s: float
) -> None:
    """Run one cycle under the budget and record its costs."""
    marks: dict[Phase, float] = {}
    budget = CpuTimeBudget(budget_s)
    begin_s = time.thread_time()
    costs.begin_ns = time.thread_time_ns()
    budget.begin()
    record = step(
        state, inputs, settings, lambda command: apply_command(driver, command), budget,
        lambda phase: marks.__setitem__(phase, time.thread_time()),
    )  # fmt: skip
    base_us = 1e6 * (marks[Phase.PERCEIVE] - begin_s)
    costs.base_us.append(base_us)
    costs.spent_us.append(base_us + 1e6 * (marks[Phase.REFINE] - marks[Phase.COMMAND]))
    costs.causes[record.refinement] = costs.causes.get(record.refinement, 0) + 1


@app.default
def main(
    cycles: Annotated[int, Parameter(help="Cycles to drive.")] = 100_000,
    /,
    *,
    budget_ms: Annotated[tuple[float, ...] | None, Parameter(negative="", consume_multiple=True)] = None,
) -> int:
    """Print the figures of each budget as JSON; exit with 1 if a cycle exceeded its budget and one quantum.

    Without `--budget-ms` these are an ample budget and a tight one, which depends on the speed of the machine.
    """
    settings = load_settings("hallway", ["behaviors.move_ahead.at_end=turn_back"])
    prepare_kernels(settings, Console(stderr=True))
    within_limits = True
    budgets_s = [1e-3 * budget for budget in budget_ms or (AMPLE_MS,)]
    for budget_s in budgets_s:
        drives = [costs_of_drive(settings, cycles, budget_s) for _ in range(DRIVES)]
        beyond_us = np.min([drive.beyond_us() for drive in drives], axis=0)
        both = {
            "beyond_budget_us_max": round(float(beyond_us.max()), 1),
            "cycles_beyond_a_quantum": int((beyond_us > QUANTUM_MAX_US).sum()),
        }
        figures = {"in_every_drive": both, "drives": [drive.figures() for drive in drives]}
        sys.stdout.write(orjson.dumps(figures).decode() + "\n")
        within_limits &= both["cycles_beyond_a_quantum"] == 0
        within_limits &= all(drive.figures()["quantum_us"]["p99.9"] <= QUANTUM_MAX_US for drive in drives)
        if budget_ms is None and len(budgets_s) == 1:
            figures_of_one = drives[0].figures()
            budgets_s.append(1e-6 * TIGHT * (figures_of_one["base_us"]["p50"] + figures_of_one["quantum_us"]["p50"]))
    return DONE if within_limits else FAILED


if __name__ == "__main__":
    sys.exit(app(result_action="return_value"))
