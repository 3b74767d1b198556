"""The paper's hall as AMRISim has it: drums of cells, heard by one ray a disc."""

from __future__ import annotations

import math

import pytest

from bench.imperfect_rooms import RASTER_M, measure_jitter, rastered
from config.load import load_settings
from config.units import FOOT_M
from config.world import AcousticsConfig
from runtime.simulation.open_loop import run_hall
from runtime.simulation.scenes import Hall, halls


def test_a_rastered_drum_is_as_large_as_the_drum_but_for_a_cell() -> None:
    (hall,) = halls("clean")
    world = rastered(hall.world)
    assert (world.drum, len(world.polygon)) == ((), len(hall.world.drum))
    for drum, outline in zip(hall.world.drum, world.polygon, strict=True):
        away = [math.dist((drum.x_m, drum.y_m), corner) for corner in outline.vertices_m]
        assert max(away) < drum.radius_m + 1.5 * RASTER_M
        assert min(away) > drum.radius_m - 1.5 * RASTER_M
        assert all(abs(x / RASTER_M - round(x / RASTER_M)) < 1e-6 for corner in outline.vertices_m for x in corner)


@pytest.mark.compiled
def test_one_ray_a_disc_on_a_raster_of_20_mm_finds_the_six_drums() -> None:
    (hall,) = halls("clean")
    world = hall.world.model_copy(update={"acoustics": AcousticsConfig(model="rays", rays=1)})
    settings = load_settings("hallway", ["perception.method=bayes"], robot="p3dx")
    outcome = run_hall(settings, Hall(hall.name, world), 0, Hall(hall.name, rastered(world)))
    errors_m = [row["error"] for row in outcome.drums if row["error"] is not None]
    assert (len(errors_m), outcome.false) == (6, 0)
    assert max(errors_m) < 0.02


@pytest.mark.soak
@pytest.mark.compiled
def test_with_pose_jitter_walls_and_the_drum_are_found_and_an_edge_of_a_doorway_is_no_drum() -> None:
    settings = load_settings("hallway", ["perception.method=bayes"])
    for name, row in measure_jitter(settings, [3008], 0.2 * FOOT_M, lambda _: None).items():
        assert (row["drums"], row["found"], row["false"]) == (1, 1, 0), name
        assert row["walls found"] > 0.9, name
