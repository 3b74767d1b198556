"""Tests of the experiment without the robot: objects set against drums and boxes, and the summary of a scene."""

from __future__ import annotations

import math

import pytest

from config.load import load_model, load_settings
from config.world import AcousticsConfig, BoxConfig
from perception.detected_object import DetectedObject
from runtime.simulation.evaluation import DrumRow
from runtime.simulation.open_loop import (
    angle_error,
    inside_ellipse,
    match_objects,
    run_hall,
    run_scene,
    summarise_scene,
)
from runtime.simulation.scenes import Hall, halls

FT = 0.3048


def seen(model: str, x_ft: float, y_ft: float, theta: float = 0.0) -> DetectedObject:
    return DetectedObject(model, x_ft * FT, y_ft * FT, theta, sigma=0.01, support=9, score=0.9)


def test_a_drum_is_no_box_and_a_box_no_drum() -> None:
    models = [load_model(name) for name in ("semicircle", "box")]
    world = halls("boxes_45")[0].world
    there = [seen("box", 1.1, 4.0, math.radians(139.0)), seen("drum", 4.0, 4.0), seen("wall", 0.0, 0.0)]
    drums, boxes, false = match_objects(world, there, models)
    assert drums == []
    assert false == 1
    assert [row["estimate"] is None for row in boxes] == [False] + [True] * 5
    assert boxes[0]["error"] == pytest.approx(0.1 * FT)
    assert boxes[0]["angle_error"] == pytest.approx(math.radians(4.0))

    drums, boxes, false = match_objects(halls("clean")[0].world, there, models)
    assert boxes == []
    assert false == 1
    assert sum(row["estimate"] is not None for row in drums) == 1


def test_two_estimates_of_one_drum_are_one_and_a_false_one() -> None:
    twice = [seen("drum", 1.2, 4.0), seen("drum", 1.0, 4.1), seen("drum", 1.0, 5.2)]
    drums, _, false = match_objects(halls("clean")[0].world, twice, [load_model("semicircle")])
    assert drums[0]["error"] == pytest.approx(0.1 * FT)
    assert false == 2


@pytest.mark.parametrize(("depth_m", "want_deg"), [(1.0, 5.0), (0.5, 85.0)])
def test_a_square_looks_alike_after_a_quarter_turn_and_an_oblong_after_half(depth_m: float, want_deg: float) -> None:
    box = BoxConfig(x_m=0.0, y_m=0.0, width_m=1.0, depth_m=depth_m, angle_deg=10.0)
    assert math.degrees(angle_error(box, math.radians(10.0 + 85.0))) == pytest.approx(want_deg)
    assert angle_error(box, math.radians(190.0)) == pytest.approx(0.0, abs=1e-12)


def test_a_drum_is_inside_its_ellipse_up_to_95_per_cent() -> None:
    """χ² with two degrees of freedom is 5.991 at 95 %: 2.447 standard deviations along an axis."""
    objects = [
        DetectedObject("semicircle", 0.0, 0.0, 0.0, 0.1, 9, 0.9, covariance=(0.01, 0.0, 0.0001)),
        DetectedObject("semicircle", 5.0, 0.0, 0.0, 0.1, 9, 0.9),
    ]
    for truth, is_inside in (((0.2446, 0.0), True), ((0.2449, 0.0), False), ((0.0, 0.03), False)):
        rows: list[DrumRow] = [
            {"truth": truth, "estimate": (0.0, 0.0), "error": 0.1},
            {"truth": (5.0, 0.0), "estimate": (5.0, 0.0), "error": 0.0},
            {"truth": (9.0, 0.0), "estimate": None, "error": None},
        ]
        assert inside_ellipse(rows, objects) == [is_inside], "without a covariance there is no ellipse"


def test_a_scene_is_summed_up() -> None:
    settings = load_settings("hallway", ["perception.method=paper"])
    (outcome,) = outcomes = run_scene(settings, "clean", 0)
    assert [row["estimate"] is None for row in outcome.drums] == [False] * 6
    assert outcome.inside == [], "the paper's method gives no covariance"
    summary = summarise_scene("clean", [*outcomes, *outcomes], settings.models)
    assert (summary["halls"], len(summary["drums"]), summary["boxes"], summary["false"]) == (2, 12, [], 0)
    assert summary["inside_95"] is None
    assert summary["first_fix"] is not None
    assert summary["first_fix"]["least"] == min(fix for fix in outcome.fixes if fix is not None)
    errors = [row["error"] for row in outcome.drums if row["error"] is not None]
    assert summary["max_error"] == max(errors)
    assert summary["mean_error"] == pytest.approx(sum(errors) / 6)


@pytest.mark.compiled
@pytest.mark.parametrize("robot", ["denning", "p3dx"])
@pytest.mark.parametrize("rays", [1, 3, 10])
def test_drums_are_found_by_any_number_of_rays(robot: str, rays: int) -> None:
    settings = load_settings("hallway", ["perception.method=bayes"], robot=robot)
    (hall,) = halls("clean")
    world = hall.world.model_copy(update={"acoustics": AcousticsConfig(model="rays", rays=rays)})
    outcome = run_hall(settings, Hall(hall.name, world), 0)
    errors = [math.inf if row["error"] is None else row["error"] for row in outcome.drums]
    assert outcome.false == 0
    assert max(errors) < 0.033 * FT
