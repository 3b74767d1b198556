"""Generated rooms sound as real ones do: the statistics of their ranges against those of real drives."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bench.range_statistics import COLUMNS, KNOWN, REAL, facing_ahead, measure, real_drive, statistics
from config.errors import UserError


def no_report(_: str) -> None:
    pass


@pytest.mark.parametrize("rooms", [2, pytest.param(6, marks=pytest.mark.soak)])
@pytest.mark.parametrize("model", ["cone", pytest.param("mirrors", marks=pytest.mark.soak)])
def test_generated_rooms_are_within_the_spread_of_the_real_ones(model: str, rooms: int) -> None:
    """Between the two real drives, or beyond one of them by no more than a quarter of it or .03 (m, or a share)."""
    rows = measure(range(100, 100 + rooms), (model,), None, no_report)
    for column in COLUMNS:
        real = [rows[name][column] for name in REAL[model]]
        low, high = min(0.75 * min(real), min(real) - 0.03), max(1.25 * max(real), max(real) + 0.03)
        assert low <= rows[f"rooms, {model}"][column] <= high, (column, real, rows[f"rooms, {model}"][column])


def test_a_drive_in_files_has_the_statistics_of_its_ranges(tmp_path: Path) -> None:
    (tmp_path / "ring.csv").write_text("t,x,y,theta,r0,r1\n0,0,0,0,1.0,inf\n1,0,0,0,1.0,2.0\n2,0,0,0,1.5,2.2\n")
    (tmp_path / "bearings.csv").write_text("b0,b1\n0.1,\n0.1,\n0.1,0.2\n")
    found = real_drive(tmp_path)
    assert tuple(found) == COLUMNS
    assert found["silent"] == pytest.approx(1 / 6)
    assert found["late"] == pytest.approx(1 / 5)
    assert found["jumps"] == pytest.approx(1 / 3)
    assert found["repeated"] == pytest.approx(1 / 3)
    assert found["turned"] == pytest.approx(1 / 4)
    assert found["50% m"] == 1.5
    (tmp_path / "bearings.csv").unlink()
    with pytest.raises(UserError, match=r"no drive with ring\.csv and bearings\.csv"):
        real_drive(tmp_path)


def test_the_known_statistics_have_every_column() -> None:
    columns = tuple(statistics(np.array([[1.0], [2.0]]), np.zeros((2, 1), dtype=np.bool_)))
    assert columns == COLUMNS
    assert all(len(row) == len(COLUMNS) for row in KNOWN.values())
    assert {name for names in REAL.values() for name in names} == set(KNOWN)


def test_a_base_faces_where_it_goes_and_turns_by_so_much_at_most() -> None:
    square = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    most = math.radians(20.0)
    poses = facing_ahead(square, most)
    turns = np.diff(poses[:, 2])
    assert np.abs(turns).max() <= most + 1e-12
    assert poses[-1, 2] == pytest.approx(math.pi)
    assert np.unique(poses[:, :2], axis=0).shape == (3, 2)
