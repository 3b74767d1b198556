"""The grid as perception keeps it: methods of the settings, the robot's way, the learnt range, snapshots."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings
from config.settings import GridConfig
from drivers.messages import Firing, Pose
from perception.mapping.grid.directed import DirectedGrid
from perception.mapping.grid.elfes import ElfesGrid
from perception.mapping.grid.evidence_grid import HEARD_MIN, EvidenceGrid
from perception.mapping.grid.moravec_elfes import MoravecElfesGrid
from perception.mapping.grid.sight_lines import PLACES_MIN
from perception.pipeline import Perception
from perception.snapshot import snapshot_of
from runtime.support.kernel_cache import GRIDS

SETTINGS = load_settings("hallway")
SENSORS = len(SETTINGS.ring.mounts)


def make(method: str, cells: int = 128) -> EvidenceGrid:
    return EvidenceGrid(SETTINGS.ring, GridConfig.model_validate({"method": method, "cells": cells}))


def fire(grid: EvidenceGrid, x: float, *heard: float) -> None:
    ranges = np.full(SENSORS, math.nan)
    ranges[: len(heard)] = heard
    grid.observe(Firing(0.0, Pose(x, 0.0, 0.0), 0.0, ranges))


@pytest.mark.parametrize(
    ("method", "kind"), [("directed", DirectedGrid), ("moravec_elfes", MoravecElfesGrid), ("elfes", ElfesGrid)]
)
def test_settings_name_the_method_and_the_window(method: str, kind: type) -> None:
    grid = make(method, 64)
    assert isinstance(grid.method, kind)
    grid.bearings[0] = 0.0  # the echoes are a recognised wall's
    for k in range(30):
        fire(grid, 0.02 * k, 1.5 - 0.02 * k)
    window = grid.occupancy()
    assert window.occupied.shape == (64, 64)
    assert window.occupied.dtype == np.float32
    assert (window.x_m, window.y_m, window.cell_m) == pytest.approx((-3.2 + 0.5, -3.2, 0.1))
    wall = math.floor((1.5 + SETTINGS.ring.mounts[0][0] - window.x_m) / 0.1)
    row = window.occupied[32]
    assert row[wall - 1 : wall + 2].max() > 0.6
    assert row[wall - 5] < 0.4
    grid.clear()
    assert (grid.occupancy().occupied == 0.5).all()


def test_silence_shows_free_space_only_to_the_range_from_which_echoes_come() -> None:
    grid = make("directed")
    for k in range(HEARD_MIN):
        assert grid.silence_m == 0.0
        fire(grid, 0.0, 2.1 if k else 1.0)
    assert grid.silence_m == 2.25
    for _ in range(5):
        fire(grid, 0.0, 7.7)
    assert grid.silence_m == pytest.approx(7.75)
    grid.clear()
    assert grid.silence_m == 0.0


def test_among_walls_known_as_mirrors_no_beam_is_open_because_it_was_passed_often() -> None:
    grid, ranges = make("directed"), np.full(SENSORS, math.nan)
    ranges[0] = 3.0
    free = {}
    for are_mirrors in (False, True):
        for k in range(2 * PLACES_MIN):
            grid.observe(Firing(0.0, Pose(0.1 * k, 0.0, 0.0), 0.0, ranges), slanting=-int(are_mirrors))
        free[are_mirrors] = int((grid.occupancy().occupied < 0.4).sum())
    assert grid.method.mirrors < 0.5, "the cells do not know"
    assert free[False] > 50
    assert free[True] == 0
    grid.observe(Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, ranges))
    assert grid.mirrors == 1.0, "what was known stays when the walls are forgotten"
    grid.observe(Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, ranges), slanting=1)
    assert grid.mirrors < 0.5


@pytest.mark.covered
def test_way_and_not_time_makes_a_repeat_count_again() -> None:
    standing, driving = make("directed"), make("directed")
    for k in range(10):
        fire(standing, 0.0, 2.0)
        fire(driving, 0.1 * k, 2.0 - 0.1 * k)
    once = make("directed")
    fire(once, 0.0, 2.0)
    assert standing.occupancy().occupied.max() == once.occupancy().occupied.max()
    assert driving.occupancy().occupied.max() > 0.8 > once.occupancy().occupied.max()


@pytest.mark.compiled
@pytest.mark.parametrize("method", GRIDS)
def test_perception_with_a_grid_continues_from_a_snapshot_to_the_bit(method: str) -> None:
    settings = load_settings("hallway", [f"perception.grid.method={method}"])
    rng = np.random.default_rng(3)
    ours, other = (Perception(settings.ring, settings.models, settings.perception) for _ in range(2))

    def drive(perception: Perception, k: int, ranges: np.ndarray) -> None:
        perception.observe(Firing(0.1 * k, Pose(0.05 * k, 0.0, 0.0), 0.0, ranges))

    firings = rng.choice([1.0, 2.0, math.inf, math.nan], (40, SENSORS))
    firings[20] = math.inf  # passes what is sure
    for k in range(20):
        drive(ours, k, firings[k])
    other.restore(ours.snapshot())
    for k in range(20, 40):
        drive(ours, k, firings[k])
        drive(other, k, firings[k])
    left, right = ours.occupancy(), other.occupancy()
    assert left is not None
    assert right is not None
    np.testing.assert_array_equal(left.occupied, right.occupied)
    np.testing.assert_equal(snapshot_of(ours.grid), snapshot_of(other.grid))
    assert (left.x_m, left.y_m) == (right.x_m, right.y_m)
    ours.reset()
    cleared = ours.occupancy()
    assert cleared is not None
    assert (cleared.occupied == 0.5).all()


def test_without_the_setting_there_is_no_grid() -> None:
    perception = Perception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception)
    assert perception.occupancy() is None
    assert not any(name.startswith("grid") for name in perception.snapshot())
