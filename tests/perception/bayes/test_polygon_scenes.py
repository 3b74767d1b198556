"""Boxes at random poses, and among drums, on seeds that were not used for tuning; and their covariance."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from config.load import load_settings
from config.world import AcousticsConfig, BoxConfig, StartConfig, WorldConfig
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.reports.object_report import polygon_covariance
from perception.kernel import Floats
from perception.pipeline import Perception
from runtime.simulation.open_loop import HallOutcome, angle_error, match_objects, perceive, run_scene
from runtime.simulation.scenes import PLACES_FT, Hall, readings
from tests.perception.bayes.random_tracks import examples

pytestmark = pytest.mark.compiled

FT = 0.3048
SETTINGS = load_settings("hallway", ["perception.method=bayes"], models=("semicircle", "box"))


def random_boxes(seed: int, acoustics: AcousticsConfig) -> Hall:
    """Return a hall of six boxes, moved and turned at random."""
    rng = np.random.default_rng(seed)
    boxes = tuple(
        BoxConfig(
            x_m=(x + rng.uniform(-0.3, 0.3)) * FT, y_m=(y + rng.uniform(-0.3, 0.3)) * FT, width_m=2.0 * FT,
            depth_m=2.0 * FT, angle_deg=float(rng.uniform(0.0, 90.0)),
        )
        for x, y in PLACES_FT
    )  # fmt: skip
    return Hall("random boxes", WorldConfig(box=boxes, start=StartConfig(x_m=-6.0 * FT), acoustics=acoustics))


def squares(perception: Perception, world: WorldConfig) -> Iterator[tuple[float, float]]:
    """Yield the squared errors of the boxes found, in units of the covariance: of the position and of the pose."""
    assert isinstance(perception.method, BayesPerception)
    memory = perception.method.memory
    rows = match_objects(world, perception.objects(), SETTINGS.models)[1]
    for box, row in zip(world.box, rows, strict=True):
        estimate = row["estimate"]
        if estimate is None:
            continue
        away = np.hypot(memory.polygons["x"] - estimate[0], memory.polygons["y"] - estimate[1])
        covariance = polygon_covariance(memory.s[0].polygons[int(np.argmin(away))])
        seen = next(o for o in perception.objects() if (o.x, o.y) == estimate)
        assert seen.covariance == (covariance[0, 0], covariance[0, 1], covariance[1, 1])
        turn = (seen.theta - math.radians(box.angle_deg) + 0.25 * math.pi) % (0.5 * math.pi) - 0.25 * math.pi
        assert abs(turn) == pytest.approx(angle_error(box, seen.theta))
        error: Floats = np.array([seen.x - box.x_m, seen.y - box.y_m, turn])
        yield (
            float(error[:2] @ np.linalg.solve(covariance[:2, :2], error[:2])),
            float(error @ np.linalg.solve(covariance, error)),
        )


@pytest.mark.parametrize("halls", [2, pytest.param(5, marks=pytest.mark.soak)])
def test_boxes_at_random_poses_are_found_and_the_covariance_is_honest(halls: int) -> None:
    """The 95 % ellipses hold 92 to 98 %, and three binomial standard deviations more or less: the boxes are few."""
    actual = []
    wanted = false = 0
    for seed in range(halls):
        for model in ("cone", "specular"):
            acoustics = AcousticsConfig(
                model=model, noise_m=0.03 * FT, dropout=0.05, outliers=0.01, outlier_max_m=15.0 * FT
            )
            hall = random_boxes(6100 + seed, acoustics)
            perception = Perception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception)
            for firing in readings(SETTINGS.ring, hall, seed):
                perceive(perception, firing)
            actual += list(squares(perception, hall.world))
            wanted += len(hall.world.box)
            false += match_objects(hall.world, perception.objects(), SETTINGS.models)[2]
    assert len(actual) >= 0.93 * wanted
    assert false <= 2
    slack = 3.0 * math.sqrt(0.95 * 0.05 / len(actual))
    place, whole = np.mean(np.array(actual) < (5.991, 7.815), axis=0)
    assert 0.92 - slack <= place <= 0.98 + slack
    assert 0.92 - slack <= whole <= 0.98 + slack


@examples(3, 16)
@pytest.mark.boundscheck
def test_drums_in_random_halls_are_found_as_without_boxes_and_most_boxes_too(examples: int) -> None:
    seeds = range(6000, 6000 + examples)
    outcomes: list[HallOutcome] = [outcome for seed in seeds for outcome in run_scene(SETTINGS, "halls", seed)]
    drums = [row["error"] for outcome in outcomes for row in outcome.drums]
    errors = [e / FT for e in drums if e is not None]
    assert len(errors) >= 0.98 * len(drums)
    assert np.mean(errors) <= 0.02
    assert sum(outcome.false for outcome in outcomes) <= 1
    boxes = [row["error"] for outcome in outcomes for row in outcome.boxes]
    assert len(boxes) == examples
    assert len([e for e in boxes if e is not None and e < 0.25 * FT]) >= 0.6 * examples
