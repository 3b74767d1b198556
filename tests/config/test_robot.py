"""The ring and its firing pattern: the places of the sensors, and combinations of settings that are refused."""

from __future__ import annotations

import copy
import math
from typing import Any

import pytest
from pydantic import ValidationError

from config.robot import RingConfig, RobotConfig
from tests.config.toml_text import ROBOT, irregular


def ring(**changes: Any) -> RingConfig:
    """Return the valid ring with some settings replaced, or removed if they are None."""
    table = {key: value for key, value in {**ROBOT["ring"], **changes}.items() if value is not None}
    return RingConfig.model_validate(table)


def test_the_sensors_of_a_regular_ring_lie_counter_clockwise_from_ahead() -> None:
    mounts = ring(count=4, radius_m=0.5).mounts
    assert [mount.angle_rad for mount in mounts] == pytest.approx([0.0, math.pi / 2, math.pi, 1.5 * math.pi])
    assert [(mount.x_m, mount.y_m) for mount in mounts] == [
        pytest.approx(place, abs=1e-12) for place in ((0.5, 0.0), (0.0, 0.5), (-0.5, 0.0), (0.0, -0.5))
    ]


def test_the_sensors_of_an_irregular_ring_are_those_of_the_file() -> None:
    table: dict[str, Any] = irregular(copy.deepcopy(ROBOT))
    found = RobotConfig.model_validate(table).ring
    assert found.mounts == ((0.1, 0.1, math.pi / 2), (0.1, -0.1, 0.0))
    assert found.firing.sets == ((0,), (1,))


def test_a_firing_listens_up_to_the_largest_range_by_default() -> None:
    assert ring(firing="octets").window_m == ring().range_max_m
    assert ring(firing={"preset": "octets", "window_m": 3.0}).window_m == 3.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"count": None}, "give either count and radius_m, or sensors"),
        ({"radius_m": None}, "give either count and radius_m, or sensors"),
        ({"sensors": [{"x_m": 0.0, "y_m": 0.0, "angle_deg": 0.0}]}, "give either count and radius_m, or sensors"),
        ({"count": None, "radius_m": None, "sensors": []}, "a ring needs at least one"),
        ({"range_min_m": 7.7724}, "range_min_m 7.7724 is not below range_max_m 7.7724"),
        ({"firing": {}}, "give either preset or sets"),
        ({"firing": {"preset": "octets", "sets": [[0]]}}, "give either preset or sets"),
        ({"firing": {"sets": []}}, "sets is empty"),
        ({"firing": {"sets": [[0], []]}}, "at least one sensor"),
        ({"firing": {"sets": [[3, 3]]}}, "each sensor once only"),
        ({"firing": {"sets": [[3]], "listen": [[2, 2]]}}, "each set of listen may name each sensor once only"),
        ({"firing": {"sets": [[3]], "listen": [[2]], "listen_preset": "second"}}, "give either listen_preset or"),
        ({"firing": {"sets": [[3]], "listen": []}}, "listen has 0 sets for the 1 of sets: give one for each"),
        ({"firing": {"sets": [[0], [3]], "listen": [[1], [2, 3]]}}, r"listen\[1\] names sensor 3, which fires"),
    ],
    ids=str,
)
def test_contradictions_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        ring(**changes)


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        ({"driver": "rflex"}, 'the driver "rflex" cannot listen without firing; remove it'),
        ({"driver": "arcos"}, 'the driver "arcos" cannot listen without firing; remove it'),
        ({"protocol": 1}, "version 1 of the protocol has no listeners; remove it, or set robot.protocol = 2"),
    ],
)
def test_listeners_are_refused_where_the_ring_cannot_have_any(robot: dict[str, Any], message: str) -> None:
    table = copy.deepcopy(ROBOT) | {"robot": robot}
    RobotConfig.model_validate(table)
    table["ring"]["firing"] = {"preset": "octets", "listen_preset": "neighbours"}
    with pytest.raises(ValidationError, match=message):
        RobotConfig.model_validate(table)
    RobotConfig.model_validate(table | {"robot": {"protocol": 2}})
