"""The experiment without the robot: perception alone on the readings of a scene, compared with the truth."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypedDict

import numpy as np

from config.model import ModelConfig
from config.settings import Settings
from config.world import BoxConfig, WorldConfig
from drivers.messages import Firing
from perception.detected_object import DetectedObject
from perception.pipeline import Perception
from runtime.simulation.evaluation import CHI2_95, DrumRow, Outcome, match_drums, nearest_pairs, place_nees
from runtime.simulation.first_fix import FirstFix, FirstFixTracker, summarise_fixes
from runtime.simulation.scene_names import SceneName
from runtime.simulation.scenes import Hall, halls, readings
from runtime.timing.cycle_stats import CycleStats, worst_of

_QUARTER_TURN: Final = 0.5 * math.pi
RADIUS_TOLERANCE_M: Final = 0.01
"""A cylinder counts as a drum to be found if its radius equals a model's to within this."""


class BoxRow(TypedDict):
    """A box, metres in world coordinates. Its angle error takes its symmetry into account."""

    truth: tuple[float, float]
    estimate: tuple[float, float] | None
    error: float | None
    angle_error: float | None
    """rad"""


class SceneOutcome(Outcome):
    """The experiment's summary, with the boxes of the scene."""

    scene: SceneName
    boxes: list[BoxRow]
    halls: int
    inside_95: float | None
    """Share of the found drums inside their 95 % ellipse; None if the method gives no covariance."""
    first_fix: FirstFix | None
    """How far before passing the drums were fixed; None if the path is not straight or no drum was fixed."""


@dataclass(frozen=True, slots=True)
class HallOutcome:
    """One drive through one hall."""

    drums: list[DrumRow]
    boxes: list[BoxRow]
    false: int
    virtual_s: float
    cycle_stats: CycleStats
    """What the readings took."""
    inside: list[bool]
    """For each drum found with a covariance, whether it is inside the 95 % ellipse."""
    fixes: list[float | None]
    """For each drum of a straight hall, how far before it the robot was at its first fix, m."""


def perceive(perception: Perception, firing: Firing) -> tuple[DetectedObject, ...]:
    """Process one reading, refine until convergence, and return the recognised objects."""
    perception.observe(firing)
    while perception.can_refine and perception.refine():
        pass
    return perception.objects()


def run_hall(settings: Settings, hall: Hall, seed: int, heard_in: Hall | None = None) -> HallOutcome:
    """Drive through a hall once and return how the recognised objects compare with the truth.

    Parameters
    ----------
    settings : Settings
        Ring, models and perception.
    hall : Hall
        The world and the path.
    seed : int
        Of the noise.
    heard_in : Hall, optional
        The hall as it sounds, if it is another one than what recognition is compared with.
    """
    perception = Perception(settings.ring, settings.models, settings.perception)
    seen: tuple[DetectedObject, ...] = ()
    heard = list(readings(settings.ring, heard_in or hall, seed))
    cycle_stats = CycleStats(late_after_s=math.inf)
    fix_tracker = FirstFixTracker(() if hall.path else hall.world.drum)
    for firing in heard:
        begin = time.perf_counter()
        seen = perceive(perception, firing)
        cycle_stats.add_cycle(time.perf_counter() - begin)
        fix_tracker.update(float(firing.pose.x), seen)
    drums, boxes, false = match_objects(hall.world, seen, settings.models)
    return HallOutcome(
        drums, boxes, false, heard[-1].robot_s, cycle_stats, inside_ellipse(drums, seen), fix_tracker.fixes()
    )


def inside_ellipse(drums: Iterable[DrumRow], seen: Iterable[DetectedObject]) -> list[bool]:
    """Return for each drum found with a covariance whether it is inside the 95 % ellipse of its estimate."""
    by_place = {(s.x, s.y): s.covariance for s in seen}
    inside = []
    for row in drums:
        covariance = None if row["estimate"] is None else by_place.get(row["estimate"])
        if covariance is not None and row["estimate"] is not None:
            dx, dy = row["truth"][0] - row["estimate"][0], row["truth"][1] - row["estimate"][1]
            inside.append(place_nees(dx, dy, covariance) <= CHI2_95)
    return inside


def match_objects(
    world: WorldConfig, seen: Iterable[DetectedObject], models: Iterable[ModelConfig]
) -> tuple[list[DrumRow], list[BoxRow], int]:
    """Match round objects with drums, others with boxes and polygons; return the rows and the number of false ones.

    Objects of none of the models, such as walls, are ignored, and so are drums and polygons that look like none. The
    rows of the polygons follow those of the boxes, with the middle of the vertices as their place.

    The objects seen are in world coordinates, as the truth; `models` are those that were looked for.
    """
    models = list(models)
    is_round = {model.name: model.arc_radius_m is not None for model in models}
    known = [s for s in seen if s.model in is_round]
    world = _looked_for(world, models)
    drums, false_drums = match_drums(world, [(s.x, s.y) for s in known if is_round[s.model]])
    middles = {model.name: np.mean(model.vertices_m, axis=0).tolist() for model in models}
    angular = [_about_its_middle(s, *middles[s.model]) for s in known if not is_round[s.model]]
    places = angular_places(world)
    match = nearest_pairs(places, [(s.x, s.y) for s in angular])
    boxes: list[BoxRow] = []
    for i, place in enumerate(places):
        box = world.box[i] if i < len(world.box) else None
        boxes.append(_box_row(place, box, angular[match[i]] if i in match else None))
    return drums, boxes, false_drums + len(angular) - len(match)


def _looked_for(world: WorldConfig, models: Sequence[ModelConfig]) -> WorldConfig:
    """Return the world without the drums and polygons that look like none of the models."""
    radii = [model.arc_radius_m for model in models if model.arc_radius_m is not None]
    drums = [d for d in world.drum if not radii or any(abs(d.radius_m - r) < RADIUS_TOLERANCE_M for r in radii)]
    spokes = [_spokes(model.vertices_m) for model in models if model.arc_radius_m is None]
    polygons = [p for p in world.polygon if any(_are_alike(_spokes(p.vertices_m), of) for of in spokes)]
    return world.model_copy(update={"drum": tuple(drums), "polygon": tuple(polygons)})


def _box_row(place: tuple[float, float], box: BoxConfig | None, found: DetectedObject | None) -> BoxRow:
    """Return the row of a box, or of a polygon (None), and of what was found there."""
    if found is None:
        return {"truth": place, "estimate": None, "error": None, "angle_error": None}
    return {
        "truth": place,
        "estimate": (found.x, found.y),
        "error": math.dist(place, (found.x, found.y)),
        "angle_error": None if box is None else angle_error(box, found.theta),
    }


def _spokes(vertices: Sequence[tuple[float, float]]) -> list[float]:
    """Return the distances of vertices from their mean, m, sorted: the same for an outline wherever it stands."""
    away = np.array(vertices) - np.mean(vertices, axis=0)
    return sorted(np.hypot(away[:, 0], away[:, 1]).tolist())


def _are_alike(a: Sequence[float], b: Sequence[float]) -> bool:
    return len(a) == len(b) and max(abs(i - j) for i, j in zip(a, b, strict=True)) < RADIUS_TOLERANCE_M


def _about_its_middle(seen: DetectedObject, x: float, y: float) -> DetectedObject:
    """Return an object of a model whose vertices have this mean, with its position at that mean."""
    c, s = math.cos(seen.theta), math.sin(seen.theta)
    return replace(seen, x=seen.x + c * x - s * y, y=seen.y + s * x + c * y)


def angular_places(world: WorldConfig) -> list[tuple[float, float]]:
    """Return the places (m) of a world's boxes, then those of its polygons: the mean of the vertices."""
    boxes = [(box.x_m, box.y_m) for box in world.box]
    polygons = [np.mean(polygon.vertices_m, axis=0).tolist() for polygon in world.polygon]
    return [*boxes, *((x, y) for x, y in polygons)]


def angle_error(box: BoxConfig, theta: float) -> float:
    """Return the difference of `theta` to the nearest angle at which the box looks the same, rad."""
    period = _QUARTER_TURN if box.width_m == box.depth_m else 2.0 * _QUARTER_TURN
    return abs((theta - math.radians(box.angle_deg) + 0.5 * period) % period - 0.5 * period)


def run_scene(settings: Settings, name: SceneName, seed: int) -> list[HallOutcome]:
    """Drive through every hall of a scene and return the outcomes; each hall has its own noise.

    The seed is of the scene and of the noise.
    """
    return [run_hall(settings, hall, seed * 1000 + i) for i, hall in enumerate(halls(name, seed))]


def _mean(values: Sequence[float]) -> float | None:
    """Return the mean, None of nothing."""
    return sum(values) / len(values) if values else None


def summarise_scene(name: SceneName, outcomes: list[HallOutcome], models: Iterable[ModelConfig]) -> SceneOutcome:
    """Return the summary over all drives.

    Boxes have rows only if a model that is not round was looked for.
    """
    with_boxes = any(model.arc_radius_m is None for model in models)
    drums = [row for outcome in outcomes for row in outcome.drums]
    boxes = [row for outcome in outcomes for row in outcome.boxes] if with_boxes else []
    errors = [e for rows in (drums, boxes) for row in rows if (e := row["error"]) is not None]
    elapsed_s = sum(outcome.cycle_stats.total_s for outcome in outcomes)
    inside = [float(is_inside) for outcome in outcomes for is_inside in outcome.inside]
    return {
        "scene": name,
        "halls": len(outcomes),
        "inside_95": _mean(inside),
        "first_fix": summarise_fixes([fix for outcome in outcomes for fix in outcome.fixes]),
        "drums": drums,
        "boxes": boxes,
        "false": sum(outcome.false for outcome in outcomes),
        "mean_error": _mean(errors),
        "max_error": max(errors, default=None),
        "times_real_time": sum(outcome.virtual_s for outcome in outcomes) / elapsed_s if elapsed_s else 0.0,
        "cycle_us": worst_of([outcome.cycle_stats.cycle_us() for outcome in outcomes]),
    }
