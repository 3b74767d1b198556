"""The closed loop in virtual time: the same robot, protocol and cycle as over a serial line, as fast as possible.

No real clock has any influence, so the same seed gives the same run. Refinement gets a fixed number of quanta per
cycle in place of a time budget.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from config.settings import Settings
from config.world import WorldConfig
from drivers.emulator.memory_transport import STEP_S, MemoryLine, OnBytes
from drivers.emulator.robot_device import GroundTruth
from drivers.messages import LinkCounts, Pose
from drivers.registry import make_device, make_driver
from runtime.cycle.inputs import OperatorInput, Request, gather_inputs
from runtime.cycle.modes import Mode
from runtime.cycle.preparation import fresh_state
from runtime.cycle.step import CycleRecord, State, apply_command, apply_settings, step
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.refinement_budget import QUANTA_PER_CYCLE, QuantumBudget, RefinementBudget

SETTLING_S: Final = 1.0
"""Time that a run continues after the robot has arrived, so that the last echoes count."""


@dataclass(frozen=True, slots=True)
class SimulationResult:
    """The result of a run in virtual time."""

    state: State
    start: Pose
    """Where the odometry began, in world coordinates."""
    truth: GroundTruth
    virtual_s: float
    elapsed_s: float
    cycle_stats: CycleStats
    """What the cycles took."""
    counts: LinkCounts


@dataclass(frozen=True, slots=True)
class SimulationOptions:
    """What is seldom otherwise in a run in virtual time."""

    refinement_budget: RefinementBudget | None = None
    """Of each cycle; None for `QUANTA_PER_CYCLE` quanta."""
    clock_start_us: int = 0
    """The robot's own clock at the start, µs; it wraps at 2³²."""
    reload: Callable[[int], Settings | None] | None = None
    """Called with the number of each cycle; returns settings in force from there on, as after a reload, or None."""
    on_bytes: OnBytes | None = None
    """Called with direction, time and data of everything that goes over the line."""
    line_step_s: float = STEP_S
    """Time between exchanges on the line, s."""


DEFAULT_OPTIONS: Final = SimulationOptions()


def simulate(
    settings: Settings,
    world: WorldConfig,
    seed: int,
    seconds_max: float,
    on_cycle: Callable[[CycleRecord, GroundTruth], None] | None = None,
    *,
    on_state: Callable[[CycleRecord, State, Pose], None] | None = None,
    operator: Callable[[int, State], OperatorInput] | None = None,
    is_over: Callable[[State], bool] | None = None,
    options: SimulationOptions = DEFAULT_OPTIONS,
) -> SimulationResult:
    """Drive through `world` until the leg is done, the robot stops or the time is up, and return the result.

    Parameters
    ----------
    settings : Settings
        The robot and everything it does.
    world : WorldConfig
        The true world.
    seed : int
        Of all randomness.
    seconds_max : float
        Virtual time after which the run ends.
    on_cycle : callable, optional
        Called with every record and the ground truth at that moment.
    on_state : callable, optional
        Called with every record, the state after it, and where the odometry began.
    operator : callable, optional
        Called with the number of each cycle and the state before it; returns the operator's input. The robot is then
        armed only by that input, and the run lasts for `seconds_max`.
    is_over : callable, optional
        Called with the state after each cycle; the run ends when it returns True.
    options : SimulationOptions
        What is seldom otherwise.
    """
    refinement_budget = options.refinement_budget or QuantumBudget(QUANTA_PER_CYCLE)
    reload = options.reload
    robot = make_device(settings, world, seed, clock_start_us=options.clock_start_us)
    driver = make_driver(settings)
    line = MemoryLine(driver, robot, on_bytes=options.on_bytes, step_s=options.line_step_s)
    state = fresh_state(settings)
    start = robot.truth.pose
    began = time.perf_counter()
    cycle_stats = CycleStats(late_after_s=math.inf, is_touched=True)
    until, run_s = seconds_max, 0.0
    while run_s < until:
        run_s = (cycle_stats.cycles + 1) / settings.cycle.rate_hz
        if reload is not None and (other := reload(cycle_stats.cycles + 1)) is not None:
            settings = other
            driver.set_firing(settings.ring)
            apply_settings(state, settings)
        line.exchange(run_s)
        request = Request.ARM if state.mode.mode is Mode.READY else None
        operator_input = OperatorInput(request) if operator is None else operator(cycle_stats.cycles + 1, state)
        inputs = gather_inputs(driver, run_s, operator_input)
        step_s = time.perf_counter()
        refinement_budget.begin()
        record = step(state, inputs, settings, lambda c: apply_command(driver, c), refinement_budget)
        cycle_stats.add_cycle(time.perf_counter() - step_s)
        if on_cycle is not None:
            on_cycle(record, robot.truth)
        if on_state is not None:
            on_state(record, state, start)
        if operator is None and (state.mode.mode is Mode.SAFE_STOP or (state.leg is not None and state.leg.done)):
            until = min(until, run_s + SETTLING_S)
        if is_over is not None and is_over(state):
            break
    return SimulationResult(state, start, robot.truth, run_s, time.perf_counter() - began, cycle_stats, driver.counts)
