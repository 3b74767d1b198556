"""The paper's simulated experiment: drive down the hall and compare estimates with the truth, as in its Table 2."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from statistics import mean, pstdev
from typing import Any, Final, NotRequired, TypedDict

from config.errors import FAILED, WRONG_CALL, UserError
from config.settings import Settings
from config.units import FOOT_M
from config.world import WorldConfig
from drivers.emulator.memory_transport import OnBytes
from drivers.messages import Pose
from runtime.cycle.modes import Mode
from runtime.cycle.step import CycleRecord, State
from runtime.cycle.summary import object_row
from runtime.simulation.closed_loop import SimulationOptions, SimulationResult, simulate
from runtime.timing.cycle_stats import Quantiles, worst_of

CHI2_95: Final = 5.991
"""The 95 % quantile of χ² with two degrees of freedom."""
GATE_M: Final = FOOT_M
"""An estimate farther than this (a foot) from every drum is false."""

SECONDS_MAX: Final = 600.0
"""Virtual time after which a drive has failed; a normal one takes about a tenth of it."""


class DrumRow(TypedDict):
    """A row of Table 2, metres in world coordinates."""

    truth: tuple[float, float]
    estimate: tuple[float, float] | None
    error: float | None


class Outcome(TypedDict):
    """The experiment's summary, as `--json` writes it."""

    drums: list[DrumRow]
    false: int
    mean_error: float | None
    max_error: float | None
    times_real_time: float
    cycle_us: Quantiles
    spread: NotRequired[Spread]
    """Only with more than one seed."""


class Spread(TypedDict):
    """Errors over many seeds, m."""

    seeds: int
    mean: float
    deviation: float
    """Standard deviation of the seeds' mean errors."""
    worst: float
    """The largest error of a single drum."""
    worst_seed: int
    """The first seed with that error."""
    missed: int
    missed_most: int
    """Drums not found by the worst seed."""
    false: int


@dataclass(frozen=True, slots=True)
class SeedOutcome:
    """One run of the experiment."""

    seed: int
    rows: list[DrumRow]
    false: int
    virtual_s: float
    elapsed_s: float
    cycle_us: Quantiles
    end: dict[str, Any] = field(default_factory=dict)
    """The summary at the end of a recording of it."""


def run_seed(
    settings: Settings,
    world: WorldConfig,
    seed: int,
    on_state: Callable[[CycleRecord, State, Pose], None] | None = None,
    on_bytes: OnBytes | None = None,
) -> SeedOutcome:
    """Run the experiment once in virtual time and return its outcome.

    `on_state` and `on_bytes` are called as by `simulate`, for a recorder.

    Raises
    ------
    UserError
        The robot stopped, touched an obstacle, or did not arrive within `SECONDS_MAX`.
    """
    run = simulate(
        settings, world, seed, SECONDS_MAX, on_state=on_state, options=SimulationOptions(on_bytes=on_bytes)
    )
    require_finished(run, seed, SECONDS_MAX)
    rows, false = match_drums(world, estimates(run))
    return SeedOutcome(
        seed, rows, false, run.virtual_s, run.elapsed_s, run.cycle_stats.cycle_us(), simulation_summary(run)
    )


def stop_at_leg_end(settings: Settings) -> Settings:
    """Return the settings with the drive ending at the end of its leg, as in the paper's experiment.

    Raises
    ------
    UserError
        The leg has no end.
    """
    ahead = settings.behaviors.move_ahead
    if ahead.distance_m is None:
        raise UserError("behaviors.move_ahead.distance_m is not set: the experiment needs an end", WRONG_CALL)
    behaviors = settings.behaviors.model_copy(update={"move_ahead": ahead.model_copy(update={"at_end": "stop"})})
    return settings.model_copy(update={"behaviors": behaviors})


def require_finished(run: SimulationResult, seed: int, seconds_max: float) -> None:
    """Check that a drive reached the end of the hall; seed and time limit (s) are for the message.

    Raises
    ------
    UserError
        The robot stopped, touched an obstacle, or did not arrive within `seconds_max`.
    """
    if run.state.mode.mode is Mode.SAFE_STOP:
        raise UserError(
            f"seed {seed}: the robot stopped after {run.virtual_s:.1f} s: {run.state.mode.reason}", FAILED
        )
    if run.truth.contacts:
        raise UserError(f"seed {seed}: the robot touched an obstacle", FAILED)
    if run.state.leg is None or not run.state.leg.done:
        raise UserError(
            f"seed {seed}: the robot did not arrive within {seconds_max:.0f} s: check for a passage that is too "
            "narrow for its radius and safety margin",
            FAILED,
        )


def simulation_summary(run: SimulationResult) -> dict[str, Any]:
    """Return the summary of a run in virtual time: that of ``echolocate run`` without the timing."""
    counts = run.counts
    return {
        "objects": [object_row(seen) for seen in run.state.perception.objects()],
        "cycles": run.cycle_stats.cycles,
        "cycle_us": run.cycle_stats.cycle_us(),
        "link": {"frames": counts.frames, "bad": counts.bad, "lost": counts.lost},
        "mode": run.state.mode.mode.value,
        "stop_reasons": [],
    }


def estimates(run: SimulationResult) -> list[tuple[float, float]]:
    """Return the estimated positions of the objects in world coordinates, m."""
    places = [run.start.compose(Pose(o.x, o.y, o.theta)) for o in run.state.perception.objects()]
    return [(p.x, p.y) for p in places]


def match_drums(world: WorldConfig, seen: list[tuple[float, float]]) -> tuple[list[DrumRow], int]:
    """Match estimates with drums by `nearest_pairs`; return a row for each drum and the number of false estimates."""
    drums = [(d.x_m, d.y_m) for d in world.drum]
    match = nearest_pairs(drums, seen)
    rows: list[DrumRow] = []
    for i, drum in enumerate(drums):
        estimate = seen[match[i]] if i in match else None
        error = None if estimate is None else math.dist(drum, estimate)
        rows.append({"truth": drum, "estimate": estimate, "error": error})
    return rows, len(seen) - len(match)


def nearest_pairs(truth: list[tuple[float, float]], seen: list[tuple[float, float]]) -> dict[int, int]:
    """Return the index of the estimate for each matched true position: nearest pairs first, none beyond the gate."""
    pairs = sorted((math.dist(t, e), i, j) for i, t in enumerate(truth) for j, e in enumerate(seen))
    match: dict[int, int] = {}
    for distance, i, j in pairs:
        if distance <= GATE_M and i not in match and j not in match.values():
            match[i] = j
    return match


def place_nees(dx: float, dy: float, covariance: tuple[float, float, float]) -> float:
    """Return the squared error of a place over its covariance xx, xy, yy (m²): χ² with two degrees of freedom."""
    xx, xy, yy = covariance
    return (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)


def spread(outcomes: Sequence[SeedOutcome]) -> Spread | None:
    """Return how much the seeds differ; None if none of them found a drum."""
    means, worst = [], []
    for outcome in outcomes:
        errors = [row["error"] for row in outcome.rows if row["error"] is not None]
        if errors:
            means.append(sum(errors) / len(errors))
            worst.append((max(errors), outcome.seed))
    if not means:
        return None
    missed = [sum(row["error"] is None for row in outcome.rows) for outcome in outcomes]
    return {
        "seeds": len(outcomes),
        "mean": mean(means),
        "deviation": pstdev(means),
        "worst": max(worst)[0],
        "worst_seed": max(worst, key=lambda one: (one[0], -one[1]))[1],
        "missed": sum(missed),
        "missed_most": max(missed),
        "false": sum(outcome.false for outcome in outcomes),
    }


def summarise(outcomes: list[SeedOutcome]) -> Outcome:
    """Return the summary over all runs, with their rows one after another."""
    rows = [row for outcome in outcomes for row in outcome.rows]
    errors = [row["error"] for row in rows if row["error"] is not None]
    elapsed_s = sum(outcome.elapsed_s for outcome in outcomes)
    outcome: Outcome = {
        "drums": rows,
        "false": sum(outcome.false for outcome in outcomes),
        "mean_error": sum(errors) / len(errors) if errors else None,
        "max_error": max(errors, default=None),
        "times_real_time": sum(outcome.virtual_s for outcome in outcomes) / elapsed_s if elapsed_s else 0.0,
        "cycle_us": worst_of([outcome.cycle_us for outcome in outcomes]),
    }
    if len(outcomes) > 1 and (over := spread(outcomes)) is not None:
        outcome["spread"] = over
    return outcome
