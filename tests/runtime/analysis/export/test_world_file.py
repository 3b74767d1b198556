"""World files of what was recognised."""

from __future__ import annotations

import math
import tomllib

import numpy as np
import pytest

from config.load import load_model
from config.model import ModelConfig
from config.world import WorldConfig
from perception.detected_object import DetectedObject
from runtime.analysis.export.world_file import placed, world_of, world_text

BOX = ModelConfig(name="box", closed=True, vertices_m=((0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2)))
CORNER = ModelConfig(name="corner", closed=False, vertices_m=((1.0, 0.0), (0.0, 0.0), (0.0, 1.0)))
DRUM = load_model("drum")


def seen(model: str, x: float, y: float, theta: float = 0.0) -> DetectedObject:
    return DetectedObject(model, x, y, theta, 0.01, 30, 0.99)


def test_each_model_becomes_what_a_world_has_for_it_and_can_be_read_again() -> None:
    objects = (
        seen(DRUM.name, 1.0, 2.0), seen("box", 3.0, 0.0, 0.5 * math.pi), seen("corner", -1.0, 0.0),
        seen("unknown", 9.0, 9.0),
    )  # fmt: skip
    world = world_of(objects, np.array([[0.0, 5.0, 4.0, 5.00001]]), (DRUM, BOX, CORNER))
    assert [(drum.x_m, drum.y_m, drum.radius_m) for drum in world.drum] == [(1.0, 2.0, DRUM.arc_radius_m)]
    (polygon,) = world.polygon
    assert np.array(polygon.vertices_m) == pytest.approx(
        np.array([(2.8, 0.3), (2.8, -0.3), (3.2, -0.3), (3.2, 0.3)]), abs=1e-9
    )
    assert [(w.x1_m, w.y1_m, w.x2_m, w.y2_m) for w in world.wall] == [
        (0.0, 5.0, 4.0, 5.0), (0.0, 0.0, -1.0, 0.0), (-1.0, 0.0, -1.0, 1.0),
    ]  # fmt: skip
    text = world_text(world, ("a line", "and another"))
    assert text.startswith("# a line\n# and another\n")
    assert WorldConfig.model_validate(tomllib.loads(text)) == world


def test_an_empty_map_is_a_world_without_anything() -> None:
    world = world_of((), np.zeros((0, 4)), (DRUM,))
    assert WorldConfig.model_validate(tomllib.loads(world_text(world, ()))) == WorldConfig()


def test_a_model_is_turned_about_its_origin() -> None:
    assert placed(CORNER, seen("corner", 1.0, 1.0, math.pi)) == pytest.approx(
        np.array([(0.0, 1.0), (1.0, 1.0), (1.0, 0.0)]), abs=1e-12
    )
