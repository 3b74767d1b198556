"""Perception over a ring log, firing by firing, as if the robot were driving there now."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from config.settings import Settings
from drivers.messages import Firing
from perception.pipeline import Perception
from runtime.cycle.summary import ReplaySummary, object_row
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.refinement_budget import within_quanta_per_cycle


def replay_firings(
    settings: Settings, firings: Iterable[Firing], on_firing: Callable[[Firing, Perception], None] | None = None
) -> ReplaySummary:
    """Run perception over `firings` and return what it saw.

    Parameters
    ----------
    settings : Settings
        Ring, models and constants.
    firings : iterable of Firing
        In the order of their times.
    on_firing : callable, optional
        Called after each.
    """
    perception = Perception(settings.ring, settings.models, settings.perception)
    cycle_stats = CycleStats(late_after_s=float("inf"))
    for firing in firings:
        began = time.perf_counter()
        perception.observe(firing)
        quanta = 0
        while perception.can_refine and within_quanta_per_cycle(quanta):
            perception.refine()
            quanta += 1
        cycle_stats.add_cycle(time.perf_counter() - began)
        if on_firing is not None:
            on_firing(firing, perception)
    return {
        "objects": [object_row(seen) for seen in perception.objects()],
        "segments": perception.counts.segments_total,
        "clusters": perception.counts.hypotheses,
        "cycles": cycle_stats.cycles,
        "cycle_us": cycle_stats.cycle_us(),
    }
