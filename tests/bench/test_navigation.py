"""Tests of bench.navigation: drives are cut from a laser's recording; every method drives to a goal in the open."""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import numpy as np
import pytest

from bench.navigation import METHODS, laser_trials, measure
from bench.trials.navigation_trials import ACOUSTICS, Trial
from config.load import load_settings
from config.world import StartConfig, WallConfig, WorldConfig

SETTINGS = load_settings("hallway", ["perception.method=paper"])


def recording(path: Path) -> Path:
    """Write what a laser records that drives 7 m along the middle of a hall of 4 m."""
    rows, bearings = [], np.radians(np.arange(-90.0, 90.5, 1.0))
    for k in range(36):
        x = 1.0 + 0.2 * k
        with np.errstate(divide="ignore"):
            ends = np.where(np.cos(bearings) > 1e-9, (10.0 - x) / np.maximum(np.cos(bearings), 1e-9), np.inf)
            ranges = np.minimum(ends, 2.0 / np.abs(np.sin(bearings)))
        values = " ".join(f"{r:.3f}" for r in np.minimum(ranges, 39.0))
        rows.append(f"FLASER {len(bearings)} {values} {x} 2.0 0.0")
    path.write_bytes(gzip.compress("\n".join(rows).encode()))
    return path


def test_drives_lie_on_the_way_of_the_laser(tmp_path: Path) -> None:
    trials = laser_trials(recording(tmp_path / "hall.log.gz"), 3, SETTINGS)
    assert len(trials) == 3
    for trial in trials:
        start = trial.world.start
        assert (start.y_m, trial.goal[1]) == (2.0, 2.0)
        assert 4.0 <= abs(start.x_m - trial.goal[0]) <= trial.shortest_m + 0.2
        sides = {round(wall.y1_m, 1) for wall in trial.world.wall if abs(wall.y1_m - wall.y2_m) < 0.1}
        assert sides == {0.0, 4.0}
    again = laser_trials(tmp_path / "hall.log.gz", 3, SETTINGS)
    assert [trial.goal for trial in again] == [trial.goal for trial in trials]


@pytest.mark.soak
@pytest.mark.compiled
def test_every_method_drives_to_a_goal_in_the_open() -> None:
    wall = WallConfig(x1_m=-3.0, y1_m=-2.0, x2_m=6.0, y2_m=-2.0)
    world = WorldConfig(wall=(wall,), acoustics=ACOUSTICS, start=StartConfig(heading_deg=40.0))
    trial = Trial(world, (0.8, 0.3), math.hypot(0.8, 0.3))
    rows = measure([trial], tuple(METHODS), ("perception.method=paper",), list[str]().append)
    for name, row in rows.items():
        assert (row["arrives_pct"], row["touched"]) == (100.0, 0), name
    assert {name for name, row in rows.items() if "cycle_ms_median" in row} == {"ours", "ours, VFH+"}
