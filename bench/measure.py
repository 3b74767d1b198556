"""The comparison: drives every candidate through every hall and scores it.

Candidates take turns hall by hall, so that other load on the machine affects all of them alike.
"""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Final, TypedDict

from bench.front_end import Place
from bench.runners import Candidate, ReadingTimes
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
    """Extent of the comparison."""

    repetitions: int
    halls_max: int
    """Halls of a scene to drive through, at most."""
    passes: int
    """Passes of the long drive, whose last pass is compared with its first."""


class SceneScore(TypedDict):
    """Score of one candidate in one scene and repetition: counts over all halls, errors in feet."""

    found: int
    of: int
    false: int
    mean_ft: float | None
    max_ft: float | None


class Times(TypedDict):
    """Median times per ring reading, ms."""

    front_end: float
    """Outline segments, common to all peers; zero for our methods, whose `own` includes everything."""
    association: float
    """Data association, common to all peers."""
    own: float
    """The library itself; for our methods everything."""
    total: float


class Result(TypedDict):
    """Result of one candidate: medians over the repetitions, and each repetition."""

    name: str
    version: str
    scenes: dict[str, SceneScore]
    repetitions: dict[str, list[SceneScore]]
    ms: Times
    ms_first_pass: Times | None
    ms_last_pass: Times | None


@dataclass(slots=True)
class _Tally:
    """Scores and times of a candidate so far."""

    scores: dict[SceneName, list[SceneScore]]
    clean: list[ReadingTimes]
    first: list[ReadingTimes]
    last: list[ReadingTimes]


def measure(
    candidates: Sequence[Candidate], ring: RingConfig, plan: Plan, report: Callable[[str], None]
) -> list[Result]:
    """Run all candidates and return their results in the same order.

    Parameters
    ----------
    candidates
        Candidates to compare.
    ring
        Geometry of the sensors.
    plan
        Extent of the comparison.
    report
        Called with a line on what is running.
    """
    tallies = [_Tally({name: [] for name in SCENES}, [], [], []) for _ in candidates]
    warm = list(readings(ring, halls("clean")[0], seed=0))
    for candidate in candidates:  # compiles, imports lazily, fills caches
        drive(candidate, warm)
    for repetition in range(plan.repetitions):
        for scene in SCENES:
            report(f"repetition {repetition + 1} of {plan.repetitions}: {scene}")
            _run_scene(scene, candidates, tallies, ring, plan, repetition)
        report(f"repetition {repetition + 1} of {plan.repetitions}: {plan.passes} passes of clean")
        _run_long(candidates, tallies, ring, plan, repetition)
    return [_result(c, t) for c, t in zip(candidates, tallies, strict=True)]


def drive(candidate: Candidate, firings: Sequence[Firing]) -> tuple[list[ReadingTimes], list[Place]]:
    """Drive one candidate through one drive; return each reading's times, s, and the drums at the end, m."""
    runner = candidate.create()
    gc.collect()
    gc.disable()
    try:
        times = [runner.take(firing) for firing in firings]
    finally:
        gc.enable()
    return times, runner.drums()


def _run_scene(
    scene: SceneName,
    candidates: Sequence[Candidate],
    tallies: Sequence[_Tally],
    ring: RingConfig,
    plan: Plan,
    repetition: int,
) -> None:
    rows: list[list[tuple[Hall, list[tuple[float, float]]]]] = [[] for _ in candidates]
    for i, hall in enumerate(halls(scene)[: plan.halls_max]):
        firings = list(readings(ring, hall, seed=1000 * repetition + i))
        for candidate, tally, row in zip(candidates, tallies, rows, strict=True):
            times, drums = drive(candidate, firings)
            row.append((hall, drums))
            if scene == "clean":
                tally.clean += times
    for tally, row in zip(tallies, rows, strict=True):
        tally.scores[scene].append(score(row))


def _run_long(
    candidates: Sequence[Candidate], tallies: Sequence[_Tally], ring: RingConfig, plan: Plan, repetition: int
) -> None:
    firings = list(readings(ring, halls("clean")[0], seed=repetition, passes=plan.passes))
    for candidate, tally in zip(candidates, tallies, strict=True):
        if not candidate.slow:
            times, _ = drive(candidate, firings)
            tally.first += times[:READINGS]
            tally.last += times[-READINGS:]


def score(found: Sequence[tuple[Hall, list[tuple[float, float]]]]) -> SceneScore:
    """Return the score of the drums found (m) in each hall against the true ones."""
    errors: list[float] = []
    of = false = 0
    for hall, drums in found:
        truth = [(drum.x_m, drum.y_m) for drum in hall.world.drum]
        match = nearest_pairs(truth, drums)
        errors += [math.dist(truth[i], drums[j]) / FOOT_M for i, j in match.items()]
        of += len(truth)
        false += len(drums) - len(match)
    mean, worst = (sum(errors) / len(errors), max(errors)) if errors else (None, None)
    return {"found": len(errors), "of": of, "false": false, "mean_ft": mean, "max_ft": worst}


def _result(candidate: Candidate, tally: _Tally) -> Result:
    return {
        "name": candidate.name,
        "version": candidate.version,
        "scenes": {scene: _median_score(scores) for scene, scores in tally.scores.items()},
        "repetitions": dict(tally.scores.items()),
        "ms": _times(tally.clean),
        "ms_first_pass": _times(tally.first) if tally.first else None,
        "ms_last_pass": _times(tally.last) if tally.last else None,
    }


def _median_score(scores: Sequence[SceneScore]) -> SceneScore:
    means = [s["mean_ft"] for s in scores if s["mean_ft"] is not None]
    worst = [s["max_ft"] for s in scores if s["max_ft"] is not None]
    return {
        "found": round(median(s["found"] for s in scores)),
        "of": scores[0]["of"],
        "false": round(median(s["false"] for s in scores)),
        "mean_ft": median(means) if means else None,
        "max_ft": median(worst) if worst else None,
    }


def _times(samples: Sequence[ReadingTimes]) -> Times:
    columns = zip(*samples, strict=True)
    front_end, association, own = (1e3 * median(column) for column in columns)
    total = 1e3 * median(sum(sample) for sample in samples)
    return {"front_end": front_end, "association": association, "own": own, "total": total}
