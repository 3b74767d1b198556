"""The run itself: every contestant through every hall in turn, and what came of it.

Contestants take turns hall by hall, so that whatever else the machine does falls on all alike.
"""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Final, TypedDict

from bench.front_end import Place
from bench.runners import Contestant, Watch
from config.robot import RingConfig
from config.units import FOOT_M
from drivers.messages import Firing
from runtime.simulation.evaluation import nearest_pairs
from runtime.simulation.scene_names import SceneName
from runtime.simulation.scenes import READINGS, Hall, halls, readings

SCENES: Final[tuple[SceneName, ...]] = (
    "clean", "moved", "noisy", "walls", "jit10", "boxes_facing", "boxes_45",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Plan:
    """How much is run."""

    repetitions: int
    halls_max: int
    """Halls of a scene that are driven through."""
    passes: int
    """Of the long drive, whose last pass is compared with its first."""


class SceneScore(TypedDict):
    """One contestant in one scene and one repetition: counts over all its halls, errors in feet."""

    found: int
    of: int
    false: int
    mean_ft: float | None
    max_ft: float | None


class Times(TypedDict):
    """Medians per ring reading, ms."""

    front_end: float
    """Outline segments, common to all peers; none for ours, whose own time holds everything."""
    association: float
    """What a peer leaves to its user, common to all peers."""
    own: float
    """The library itself, and for ours everything."""
    total: float


class Result(TypedDict):
    """One contestant's whole run: medians over the repetitions, and each repetition."""

    name: str
    version: str
    scenes: dict[str, SceneScore]
    repetitions: dict[str, list[SceneScore]]
    ms: Times
    ms_first_pass: Times | None
    ms_last_pass: Times | None


@dataclass(slots=True)
class _Tally:
    """What a contestant has gathered so far."""

    scores: dict[SceneName, list[SceneScore]]
    clean: list[Watch]
    first: list[Watch]
    last: list[Watch]


def measure(
    contestants: Sequence[Contestant], ring: RingConfig, plan: Plan, say: Callable[[str], None]
) -> list[Result]:
    """Run all contestants and return their results in the same order.

    Parameters
    ----------
    contestants
        Who takes part.
    ring
        What they hear through.
    plan
        How much is run.
    say
        Told what is being run now.
    """
    tallies = [_Tally({name: [] for name in SCENES}, [], [], []) for _ in contestants]
    warm = list(readings(ring, halls("clean")[0], seed=0))
    for contestant in contestants:  # compiles, imports lazily, fills caches
        drive(contestant, warm)
    for repetition in range(plan.repetitions):
        for scene in SCENES:
            say(f"repetition {repetition + 1} of {plan.repetitions}: {scene}")
            _run_scene(scene, contestants, tallies, ring, plan, repetition)
        say(f"repetition {repetition + 1} of {plan.repetitions}: {plan.passes} passes of clean")
        _run_long(contestants, tallies, ring, plan, repetition)
    return [_result(c, t) for c, t in zip(contestants, tallies, strict=True)]


def drive(contestant: Contestant, firings: Sequence[Firing]) -> tuple[list[Watch], list[Place]]:
    """Take one contestant through one drive; return each reading's two times, s, and the drums at its end, m."""
    runner = contestant.begin()
    gc.collect()
    gc.disable()
    try:
        times = [runner.take(firing) for firing in firings]
    finally:
        gc.enable()
    return times, runner.drums()


def _run_scene(
    scene: SceneName,
    contestants: Sequence[Contestant],
    tallies: Sequence[_Tally],
    ring: RingConfig,
    plan: Plan,
    repetition: int,
) -> None:
    rows: list[list[tuple[Hall, list[tuple[float, float]]]]] = [[] for _ in contestants]
    for i, hall in enumerate(halls(scene)[: plan.halls_max]):
        firings = list(readings(ring, hall, seed=1000 * repetition + i))
        for contestant, tally, row in zip(contestants, tallies, rows, strict=True):
            times, drums = drive(contestant, firings)
            row.append((hall, drums))
            if scene == "clean":
                tally.clean += times
    for tally, row in zip(tallies, rows, strict=True):
        tally.scores[scene].append(score(row))


def _run_long(
    contestants: Sequence[Contestant], tallies: Sequence[_Tally], ring: RingConfig, plan: Plan, repetition: int
) -> None:
    firings = list(readings(ring, halls("clean")[0], seed=repetition, passes=plan.passes))
    for contestant, tally in zip(contestants, tallies, strict=True):
        if not contestant.slow:
            times, _ = drive(contestant, firings)
            tally.first += times[:READINGS]
            tally.last += times[-READINGS:]


def score(seen: Sequence[tuple[Hall, list[tuple[float, float]]]]) -> SceneScore:
    """Set the drums seen in each hall against those that stand there."""
    errors: list[float] = []
    of = false = 0
    for hall, drums in seen:
        truth = [(drum.x_m, drum.y_m) for drum in hall.world.drum]
        match = nearest_pairs(truth, drums)
        errors += [math.dist(truth[i], drums[j]) / FOOT_M for i, j in match.items()]
        of += len(truth)
        false += len(drums) - len(match)
    mean, worst = (sum(errors) / len(errors), max(errors)) if errors else (None, None)
    return {"found": len(errors), "of": of, "false": false, "mean_ft": mean, "max_ft": worst}


def _result(contestant: Contestant, tally: _Tally) -> Result:
    return {
        "name": contestant.name,
        "version": contestant.version,
        "scenes": {scene: _middle(scores) for scene, scores in tally.scores.items()},
        "repetitions": dict(tally.scores.items()),
        "ms": _times(tally.clean),
        "ms_first_pass": _times(tally.first) if tally.first else None,
        "ms_last_pass": _times(tally.last) if tally.last else None,
    }


def _middle(scores: Sequence[SceneScore]) -> SceneScore:
    means = [s["mean_ft"] for s in scores if s["mean_ft"] is not None]
    worst = [s["max_ft"] for s in scores if s["max_ft"] is not None]
    return {
        "found": round(median(s["found"] for s in scores)),
        "of": scores[0]["of"],
        "false": round(median(s["false"] for s in scores)),
        "mean_ft": median(means) if means else None,
        "max_ft": median(worst) if worst else None,
    }


def _times(watches: Sequence[Watch]) -> Times:
    columns = zip(*watches, strict=True)
    front_end, association, own = (1e3 * median(column) for column in columns)
    total = 1e3 * median(sum(watch) for watch in watches)
    return {"front_end": front_end, "association": association, "own": own, "total": total}
