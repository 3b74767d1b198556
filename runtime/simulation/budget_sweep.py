"""What a smaller budget costs: the same drives down a long hall, refinement cut short at different times.

Anytime perception promises answers that come later with less time and are no worse in the end. Each row is a budget:
when the answers came, and what they were when the robot had arrived. A drum is answered from the cycle in which it is
first reported, within the gate of Table 2.
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
from runtime.simulation.closed_loop import simulate
from runtime.simulation.evaluation import GATE_M, SECONDS_MAX, estimates, match_drums, require_finished
from runtime.simulation.long_hall import WAY_M, long_hall
from runtime.timing.refinement_budget import RefinementBudget

QUANTA_PER_FIRING: Final = 50
"""So many that time, and nothing else, ends refinement."""


class BudgetRow(TypedDict):
    """What came of a budget over all drives; metres and seconds."""

    budget: float
    """ms, or quanta."""
    quanta: float
    """A cycle, on average."""
    cut_short: float
    """Share of the cycles whose budget was spent before everything was improved."""
    first_s: float | None
    """Until the first drum was reported, on average over the drives."""
    first_m: float | None
    """The robot's way until then."""
    way_m: float | None
    """The robot's way until a drum was reported, on average over the drums."""
    drums: int
    found: int
    false: int
    mean_error: float | None
    max_error: float | None


@dataclass
class DetectionLog:
    """Looks on at one drive and notes when each drum is reported for the first time."""

    world: WorldConfig
    when: dict[int, tuple[float, float]] = field(default_factory=dict)
    """Time (s) and way (m) of each drum's first report."""
    quanta: int = 0
    cut: int = 0
    cycles: int = 0
    _way_m: float = 0.0
    _before: Pose | None = None
    _reported: object = None

    def on_cycle(self, record: CycleRecord, truth: GroundTruth) -> None:
        """Count the quanta and measure the way."""
        before, self._before = self._before, truth.pose
        if before is not None:
            self._way_m += math.hypot(truth.pose.x - before.x, truth.pose.y - before.y)
        self.quanta += record.quanta
        self.cut += record.refinement == "budget"
        self.cycles += 1

    def on_state(self, _record: CycleRecord, state: State, start: Pose) -> None:
        """Look at what is reported."""
        reported = state.perception.objects()
        if reported is self._reported or state.run_s is None:
            return
        self._reported = reported
        for place in (start.compose(Pose(seen.x, seen.y, seen.theta)) for seen in reported):
            for i, drum in enumerate(self.world.drum):
                if i not in self.when and math.hypot(place.x - drum.x_m, place.y - drum.y_m) <= GATE_M:
                    self.when[i] = (state.run_s, self._way_m)


def long_hall_settings(settings: Settings) -> Settings:
    """Return the settings for a drive down the hall once, with no limit on refinement but the budget."""
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
    """Drive down a hall for each seed under one budget.

    Parameters
    ----------
    settings : Settings
        From `long_hall_settings`.
    budget : float
        What the row is called.
    refinement_budget : callable
        Makes what carries the budget out.
    seeds : sequence of int
        Of the halls and of everything random in them.

    Raises
    ------
    UserError
        A drive did not come to its end.
    """
    looks, errors, found, false = [], [], 0, 0
    for seed in seeds:
        world = long_hall(seed)
        looking = DetectionLog(world)
        run = simulate(
            settings,
            world,
            seed,
            SECONDS_MAX,
            looking.on_cycle,
            refinement_budget=refinement_budget(),
            on_state=looking.on_state,
        )
        require_finished(run, seed, SECONDS_MAX)
        rows, wrong = match_drums(world, estimates(run))
        errors += [row["error"] for row in rows if row["error"] is not None]
        found += sum(row["estimate"] is not None for row in rows)
        false += wrong
        looks.append(looking)
    cycles = sum(look.cycles for look in looks)
    firsts = [min(look.when.values()) for look in looks if look.when]
    ways = [way for look in looks for _, way in look.when.values()]
    return {
        "budget": budget,
        "quanta": sum(look.quanta for look in looks) / cycles,
        "cut_short": sum(look.cut for look in looks) / cycles,
        "first_s": _mean([s for s, _ in firsts]),
        "first_m": _mean([m for _, m in firsts]),
        "way_m": _mean(ways),
        "drums": sum(len(look.world.drum) for look in looks),
        "found": found,
        "false": false,
        "mean_error": _mean(errors),
        "max_error": max(errors, default=None),
    }


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None
