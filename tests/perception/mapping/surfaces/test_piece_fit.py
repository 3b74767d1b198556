"""The line of a piece by its echoes, and whether a round body explains them better."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.kernel import Floats
from perception.mapping.surfaces.parameters import READINGS_MAX
from perception.mapping.surfaces.piece_fit import group_echoes, judge
from perception.mapping.surfaces.records import FREE, CellCounts, LocalMap
from perception.records import Structured, records, zeros

RADII = np.array([0.107, 0.29, 0.671])


def judged(points: Floats, sensors: Floats, sigma_m: float) -> Structured:
    """Return a piece after its echoes came from some places, with errors."""
    local = zeros(LocalMap, 1)
    count = len(points)
    noisy = points + np.random.default_rng(1).normal(0.0, sigma_m, points.shape)
    local["points"]["piece"] = FREE
    for name, k in (("x", 0), ("y", 1)):
        local["points"][name][0, :count] = noisy[:, k]
        local["readings"][name][0, :count] = sensors[:, k]
    local["points"]["piece"][0, :count] = 0
    local["swept"], local["count"] = count, count
    piece = local["pieces"][0, 0]
    piece["x"], piece["y"] = noisy.mean(axis=0)
    piece["ux"], piece["low"], piece["high"] = 1.0, -0.5, 0.5
    room, counts = records(LocalMap, local), records(CellCounts, zeros(CellCounts, 1))
    group_echoes(room, counts)
    judge(room[0], counts[0], 0, RADII)
    return local["pieces"][0, 0]


@pytest.mark.parametrize("turn", [-0.2, 0.0, 0.15])
def test_a_straight_surface(turn: float) -> None:
    along = np.linspace(-0.6, 0.6, 80)
    points = np.column_stack([along * math.cos(turn), 1.0 + along * math.sin(turn)])
    piece = judged(points, np.column_stack([along, np.zeros(80)]), 0.02)
    assert math.atan2(piece["uy"], piece["ux"]) == pytest.approx(turn, abs=4.0 * math.sqrt(piece["variance_turn"]))
    off = (points[40] - (piece["x"], piece["y"])) @ np.array([-piece["uy"], piece["ux"]])
    assert abs(off) < 4.0 * math.sqrt(piece["variance_across"])
    assert piece["evidence"] > 3.0
    assert piece["echoes"] == 80


@pytest.mark.parametrize("radius", RADII.tolist())
def test_the_front_of_a_round_body(radius: float) -> None:
    angles = np.linspace(-0.9, 0.9, 80) - 0.5 * math.pi
    points = np.column_stack([radius * np.cos(angles), 1.0 + radius + radius * np.sin(angles)])
    piece = judged(points, np.column_stack([points[:, 0], np.zeros(80)]), 0.01)
    assert piece["evidence"] < -2.0


def test_two_echoes_say_nothing() -> None:
    assert judged(np.array([[0.0, 1.0], [0.1, 1.0]]), np.zeros((2, 2)), 0.0)["evidence"] < 0.0
    assert READINGS_MAX > 2
