"""The effect of a smaller refinement budget: the same drives down a long hall under several budgets.

Anytime perception promises that with less time objects are reported later but are no worse in the end. Each row is a
budget: when objects were reported, and their errors at the end. A drum counts as reported from the cycle in which an
object within the gate of Table 2 is reported.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final, TypedDict

import numpy as np

from config.settings import Settings
from config.world import WorldConfig
from drivers.emulator.robot_device import GroundTruth
from drivers.messages import Pose
from runtime.cycle.step import CycleRecord, State
from runtime.simulation.closed_loop import SimulationOptions, simulate
from runtime.simulation.evaluation import GATE_M, SECONDS_MAX, estimates, match_drums, require_finished
from runtime.simulation.long_hall import WAY_M, long_hall
from runtime.timing.refinement_budget import RefinementBudget

QUANTA_PER_FIRING: Final = 50
"""So high that only the budget ends refinement."""


class BudgetRow(TypedDict):
    """Results of a budget over all drives, metres and seconds."""

    budget: float
    """In ms, or in quanta per cycle."""
    quanta: float
    """Mean per cycle."""
    cut_short: float
    """Share of the cycles whose budget was spent before refinement had converged."""
    first_s: float | None
    """Time until the first drum was reported, mean over the drives."""
    first_m: float | None
    """Distance driven until then, mean over the drives."""
    way_m: float | None
    """Distance driven until a drum was reported, mean over the drums."""
    drums: int
    found: int
    false: int
    mean_error: float | None
    max_error: float | None


@dataclass
class DetectionLog:
    """Records when each drum of a drive is first reported."""

    world: WorldConfig
    when: dict[int, tuple[float, float]] = field(default_factory=dict)
    """Time (s) and distance driven (m) at each drum's first report, by the drum's index."""
    quanta: int = 0
    cut: int = 0
    cycles: int = 0
    _way_m: float = 0.0
    _before: Pose | None = None
    _last_objects: object = None

    def on_cycle(self, record: CycleRecord, truth: GroundTruth) -> None:
        """Count the quanta and measure the distance driven."""
        before, self._before = self._before, truth.pose
        if before is not None:
            self._way_m += math.hypot(truth.pose.x - before.x, truth.pose.y - before.y)
        self.quanta += record.quanta
        self.cut += record.refinement == "budget"
        self.cycles += 1

    def on_state(self, _record: CycleRecord, state: State, start: Pose) -> None:
        """Record the drums first reported in this cycle; `start` is where odometry began, in world coordinates."""
        objects = state.perception.objects()
        if objects is self._last_objects or state.run_s is None:
            return
        self._last_objects = objects
        for place in (start.compose(Pose(seen.x, seen.y, seen.theta)) for seen in objects):
            for i, drum in enumerate(self.world.drum):
                if i not in self.when and math.hypot(place.x - drum.x_m, place.y - drum.y_m) <= GATE_M:
                    self.when[i] = (state.run_s, self._way_m)


def long_hall_settings(settings: Settings) -> Settings:
    """Return the settings for one drive down the hall, with refinement limited only by the budget."""
    ahead = settings.behaviors.move_ahead.model_copy(update={"distance_m": WAY_M, "at_end": "stop"})
    bayes = settings.perception.bayes.model_copy(update={"quanta_per_firing": QUANTA_PER_FIRING})
    return settings.model_copy(
        update={
            "behaviors": settings.behaviors.model_copy(update={"move_ahead": ahead}),
            "perception": settings.perception.model_copy(update={"bayes": bayes}),
        }
    )


def drive(
    settings: Settings, budget: float, refinement_budget: Callable[[], RefinementBudget], seeds: Sequence[int]
) -> BudgetRow:
    """Drive down a hall for each seed under one budget and return the results.

    Parameters
    ----------
    settings : Settings
        From `long_hall_settings`.
    budget : float
        For the row.
    refinement_budget : callable
        Returns a new budget for each drive.
    seeds : sequence of int
        Of the halls and of all randomness in them.

    Raises
    ------
    UserError
        A drive did not reach the end of the hall.
    """
    logs, errors, found, false = [], [], 0, 0
    for seed in seeds:
        world = long_hall(seed)
        detections = DetectionLog(world)
        run = simulate(
            settings,
            world,
            seed,
            SECONDS_MAX,
            detections.on_cycle,
            on_state=detections.on_state,
            options=SimulationOptions(refinement_budget=refinement_budget()),
        )
        require_finished(run, seed, SECONDS_MAX)
        rows, wrong = match_drums(world, estimates(run))
        errors += [row["error"] for row in rows if row["error"] is not None]
        found += sum(row["estimate"] is not None for row in rows)
        false += wrong
        logs.append(detections)
    cycles = sum(log.cycles for log in logs)
    firsts = [min(log.when.values()) for log in logs if log.when]
    ways = [way for log in logs for _, way in log.when.values()]
    return {
        "budget": budget,
        "quanta": sum(log.quanta for log in logs) / cycles,
        "cut_short": sum(log.cut for log in logs) / cycles,
        "first_s": _mean([s for s, _ in firsts]),
        "first_m": _mean([m for _, m in firsts]),
        "way_m": _mean(ways),
        "drums": sum(len(log.world.drum) for log in logs),
        "found": found,
        "false": false,
        "mean_error": _mean(errors),
        "max_error": max(errors, default=None),
    }


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None
