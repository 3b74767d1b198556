"""What counts as found, false and explained in a furnished, imperfect room."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.trials.imperfect_rooms import imperfect_room
from bench.trials.imperfect_trials import (
    ImperfectTrial,
    away_from,
    distances,
    false_length,
    figures,
    sides,
    try_room,
)
from bench.trials.wall_trials import Corner, Segment
from config.load import load_settings
from config.world import DrumConfig, WallConfig, WorldConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene


def test_length_is_false_where_no_surface_is_near() -> None:
    scene = compile_scene(WorldConfig(wall=(WallConfig(x1_m=0.0, y1_m=0.0, x2_m=2.0, y2_m=0.0, bend_m=0.03),)))
    right = Segment(np.array([0.0, 0.1]), np.array([2.0, 0.1]))
    beyond = Segment(np.array([1.0, 0.0]), np.array([3.15, 0.0]))

    def to_surface(x: float, y: float) -> float:
        return clearance(x, y, scene.circles, scene.segments)

    assert false_length([right], to_surface) == 0.0
    assert false_length([right, beyond], to_surface) == pytest.approx(1.0, abs=0.06)
    assert false_length([], to_surface) == 0.0


def test_points_are_as_far_as_the_nearest_piece() -> None:
    pieces = [
        Segment(np.array([0.0, 0.0]), np.array([1.0, 0.0])),
        Segment(np.array([0.0, 2.0]), np.array([1.0, 2.0])),
    ]
    assert distances(np.array([[0.5, 0.3], [2.0, 2.0]]), pieces).tolist() == pytest.approx([0.3, 1.0])
    assert distances(np.array([[0.5, 0.3]]), []).tolist() == [math.inf]
    corners = [Corner(3.0, 2.0, is_edge=True)]
    assert away_from(np.array([[0.5, 0.3], [3.0, 1.5]]), pieces, corners).tolist() == pytest.approx([0.3, 0.5])
    assert away_from(np.array([[3.0, 1.5]]), [], []).tolist() == [math.inf]


def test_a_side_of_a_drum_counts_from_its_third_echo_on() -> None:
    drum = DrumConfig(x_m=1.0, y_m=2.0, radius_m=0.3)
    degrees = np.radians(np.array([5.0, 6.0, 7.0, 15.0, 16.0, 175.0, 176.0, 177.0, -5.0, -6.0, -7.0]))
    points = np.array([1.0, 2.0]) + 0.31 * np.column_stack([np.cos(degrees), np.sin(degrees)])
    assert sides(points, drum) == 3
    assert sides(points + 0.1, drum) == 0
    assert sides(np.empty((0, 2)), drum) == 0


def test_figures_are_shares_of_all_drives() -> None:
    one = ImperfectTrial(3, 2, 1, (0.03048, 0.06096), 2, 2, 10.0, 8.0, 9.0, 0.9, 4, 1, 2.0, 0.0, 100, 60, 90)
    two = ImperfectTrial(3, 3, 0, (), 3, 2, 10.0, 10.0, 11.0, 0.1, 0, 0, 0.0, 0.0, 300, 300, 300)
    found = figures([one, two])
    assert (found["drums"], found["found"], found["false"]) == (6, 5, 1)
    assert (found["driven round"], found["of these found"]) == (5, 4)
    assert found["error, ft"] == pytest.approx(0.15)
    assert found["worst, ft"] == pytest.approx(0.2)
    assert found["walls found"] == pytest.approx(0.9)
    assert found["walls false"] == pytest.approx(0.05)
    assert found["corners false"] == pytest.approx(0.25)
    assert found["explained"] == pytest.approx(0.9)
    assert found["explained with polylines"] == pytest.approx(0.975)
    assert math.isnan(figures([])["error, ft"])


@pytest.mark.soak
def test_a_drive_hears_much_and_what_it_reports_stands_there() -> None:
    trial = try_room(load_settings("hallway"), imperfect_room(1, "cone"), 1, 0.3)
    assert trial.drums == 3
    assert trial.drums_round_found <= trial.drums_found <= trial.drums
    assert trial.echoes > 1000
    assert trial.walls_answered_m > 5.0
    assert trial.walls_false_m <= 0.2 * trial.walls_m
    assert 0 <= trial.explained <= trial.explained_with_lines <= trial.echoes
