"""Tests of the feet of recognised objects, `perception/obstacle_echoes/unheard_feet.py`."""

import math
from itertools import pairwise

import numpy as np
import pytest

from config.load import load_model
from config.model import ModelConfig
from drivers.messages import Pose
from perception.detected_object import DetectedObject
from perception.obstacle_echoes.unheard_feet import foot_of, with_unheard_feet

DRUM, BOX = load_model("drum"), load_model("box")
OPEN = ModelConfig(name="angle", vertices_m=((0.0, 0.5), (0.0, 0.0), (0.5, 0.0)), closed=False)
NOTHING = np.zeros((0, 2))


def seen(
    model: ModelConfig, x: float, y: float, theta: float = 0.0, probability: float | None = 0.99
) -> DetectedObject:
    return DetectedObject(model.name, x, y, theta, 0.003, 40, 0.99, probability)


def outline(one: DetectedObject, model: ModelConfig) -> np.ndarray:
    """Return places on an object's outline, a millimetre apart or less."""
    if model.arc_radius_m is not None:
        around = np.linspace(0.0, math.tau, 4000)
        return np.column_stack(
            [one.x + model.arc_radius_m * np.cos(around), one.y + model.arc_radius_m * np.sin(around)]
        )
    corners = np.array([*model.vertices_m, *model.vertices_m[: model.closed]])
    sides = [a + np.linspace(0.0, 1.0, 2000)[:, None] * (b - a) for a, b in pairwise(corners)]
    c, s = math.cos(one.theta), math.sin(one.theta)
    places: np.ndarray = np.concatenate(sides) @ np.array([[c, s], [-s, c]]) + (one.x, one.y)
    return places


@pytest.mark.parametrize("model", [DRUM, BOX, OPEN], ids=lambda model: model.name)
def test_the_foot_is_the_nearest_place_of_the_outline(model: ModelConfig) -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        x, y, theta, robot_x, robot_y = rng.uniform(-1.0, 1.0, 5).tolist()
        one, robot = seen(model, x, y, math.pi * theta), Pose(robot_x + 1.5, robot_y + 1.5, 0.4)
        away = np.hypot(*(outline(one, model) - (robot.x, robot.y)).T)
        foot = foot_of(one, model, robot)
        assert math.dist(foot, (robot.x, robot.y)) == pytest.approx(away.min(), abs=1e-5)


def test_a_near_object_is_an_obstacle_where_no_echo_says_so() -> None:
    here = Pose(0.0, 0.0, 0.3)
    drum = seen(DRUM, 1.0, 0.0)
    assert DRUM.arc_radius_m is not None
    foot = (1.0 - DRUM.arc_radius_m, 0.0)
    np.testing.assert_allclose(with_unheard_feet(NOTHING, [drum], [DRUM, BOX], here, 0.3), [foot], atol=1e-12)
    elsewhere = np.array([[foot[0], 0.2]])
    np.testing.assert_allclose(
        with_unheard_feet(elsewhere, [drum], [DRUM], here, 0.3), [elsewhere[0], foot], atol=1e-12
    )
    heard = np.array([[foot[0], 0.04]])
    assert with_unheard_feet(heard, [drum], [DRUM], here, 0.3) is heard


@pytest.mark.parametrize(
    "one", [seen(DRUM, 1.2, 0.0), seen(DRUM, 1.0, 0.0, probability=None), seen(BOX, 1.0, 0.0)],
    ids=["far", "without a probability", "of another model"],
)  # fmt: skip
def test_no_other_object_is(one: DetectedObject) -> None:
    assert with_unheard_feet(NOTHING, [one], [DRUM], Pose(0.0, 0.0, 0.0), 0.3) is NOTHING
