"""What a ray hits first against the oracle, and which models are present in a scene."""

from __future__ import annotations

import math

import pytest

from config.world import WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.surfaces import CONE, RAYS, SILENT, SPECULAR, first_hit, models_present
from tests import naive_acoustics as naive
from tests.drivers.emulator.one_sensor import drum, wall
from tests.drivers.emulator.test_acoustics import random_cases


@pytest.mark.boundslong
def test_a_ray_stops_at_the_first_surface() -> None:
    for world, shapes, sensors, _ in random_cases(12, 30):
        scene = compile_scene(world)
        for sensor, axis in sensors:
            reach, _ = first_hit(sensor.real, sensor.imag, axis, scene.circles, scene.segments)
            expected = naive.rays(shapes, sensor, axis, 0.1, 1)
            assert reach == expected or abs(reach - expected) < 1e-8


def test_the_surface_that_a_ray_hits_is_named_and_nothing_behind_it() -> None:
    cloth = wall(2.0, -1.0, 2.0, 1.0).model_copy(update={"surface": "silent"})
    scene = compile_scene(WorldConfig(drum=(drum(4.0, 0.0, 0.5),), wall=(cloth,)))
    assert first_hit(0.0, 0.0, 0.0, scene.circles, scene.segments) == (2.0, SILENT)
    assert first_hit(0.0, 0.0, math.pi, scene.circles, scene.segments)[0] == math.inf


def test_objects_without_a_surface_answer_as_the_world() -> None:
    cloth = wall(2.0, -1.0, 2.0, 1.0).model_copy(update={"surface": "silent"})
    scene = compile_scene(WorldConfig(drum=(drum(4.0, 0.0, 0.5),), wall=(cloth,)))
    for model in (CONE, SPECULAR, RAYS):
        assert models_present(model, scene.circles, scene.segments) == 1 << model | 1 << SILENT
