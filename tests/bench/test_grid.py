"""Tests of bench.grid: cells that count as right, the corridor's files, and what each peer makes of a wall."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bench.grid import CORRIDOR_RING, corridor_score, make_grid, read_corridor, widened
from bench.peers.occupancy_grids import PEERS
from config.errors import UserError
from drivers.messages import Firing, Pose


def test_a_cell_beside_counts_as_right() -> None:
    cells = np.zeros((5, 6), np.bool_)
    cells[1, 2] = True
    assert widened(cells).sum() == 9
    assert widened(cells)[0:3, 1:4].all()


@pytest.mark.parametrize("name", PEERS)
def test_each_peer_finds_a_wall_that_is_approached(name: str) -> None:
    grid = make_grid(name, CORRIDOR_RING, np.array([(-1.0, 0.0), (3.0, 0.0)]))
    for k in range(20):
        ranges = np.full(8, np.nan)
        ranges[3:5] = 3.02 - 0.05 * k
        grid.observe(Firing(0.1 * k, Pose(0.05 * k, 0.0, 0.0), 0.0, ranges))
    window = grid.occupancy()
    row = window.occupied[int((0.38 - window.y_m) / 0.1)]
    wall = int((3.02 - window.x_m) / 0.1)
    assert row[wall - 2 : wall + 2].max() > 0.5
    assert row[wall - 15] <= 0.5


def test_readings_that_are_left_out_are_predicted(tmp_path: Path) -> None:
    """A robot drives along a wall on its left; a sensor's value is an old one where it does not change."""
    k = np.arange(120)
    poses = np.column_stack([100 * k, 30 * k, 0 * k, 0 * k])
    raw = np.full((120, 9), 5110.0)
    raw[:, 0] = 100 * k
    raw[:, 8] = 1000 + 10 * (k % 2)
    raw[::4, 8] = raw[1::4, 8][: len(raw[::4])]
    np.savetxt(tmp_path / "poses.txt", poses)
    np.savetxt(tmp_path / "measurement.txt", raw)
    corridor = read_corridor(tmp_path)
    assert np.isinf(corridor.ranges_m[:, :7]).all()
    assert 30 < np.isfinite(corridor.ranges_m[:, 7]).sum() < 119
    score = corridor_score("directed", corridor, 1)
    assert score["within 0.2 m, %"] > 90.0
    assert score["predicted where silent, %"] < 5.0
    assert score["silences"] == 7 * 60
    assert math.isfinite(score["median error, m"])


def test_a_folder_without_the_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"cannot read poses\.txt"):
        read_corridor(tmp_path)
