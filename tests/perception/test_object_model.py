"""A model file as the array of its sides: middles, directions, lengths, centroid, and the direction it faces."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_model
from config.model import ModelConfig
from perception.object_model import ObjectModel


def model(*vertices_m: tuple[float, float], closed: bool) -> ObjectModel:
    return ObjectModel.from_config(ModelConfig(name="test", closed=closed, vertices_m=vertices_m))


def test_a_closed_outline_has_a_side_for_each_vertex_and_faces_nowhere() -> None:
    square = model((1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), closed=True)
    np.testing.assert_allclose(square.sides[:, :2], [[1, 0], [0, 1], [-1, 0], [0, -1]], atol=1e-12)
    np.testing.assert_allclose(np.cos(square.sides[:, 2]), [0, -1, 0, 1], atol=1e-12)
    np.testing.assert_allclose(np.sin(square.sides[:, 2]), [1, 0, -1, 0], atol=1e-12)
    assert square.sides[:, 3].tolist() == [2.0] * 4
    assert square.centroid == pytest.approx((0.0, 0.0))
    assert square.facing is None
    assert square.sides.flags.c_contiguous


def test_an_open_outline_faces_its_bulge() -> None:
    angle = model((0.0, 1.0), (1.0, 0.0), (0.0, -1.0), closed=False)
    assert len(angle.sides) == 2
    assert angle.centroid == pytest.approx((0.5, 0.0))
    assert angle.facing == pytest.approx(0.0)


def test_a_straight_outline_faces_across() -> None:
    line = model((0.0, 0.0), (1.0, 0.0), (3.0, 0.0), closed=False)
    assert line.facing == pytest.approx(math.pi / 2)
    assert line.centroid == pytest.approx((1.5, 0.0)), "weighted by length"


def test_the_shipped_semicircle_is_as_wide_as_its_arc() -> None:
    config = load_model("semicircle")
    shape = ObjectModel.from_config(config)
    assert shape.name == "drum"
    assert config.arc_radius_m is not None
    assert shape.sides[:, 3].sum() == pytest.approx(math.pi * config.arc_radius_m, rel=0.02)
